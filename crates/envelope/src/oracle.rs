//! The exact box check.

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::obligations::Refusal;
use elbowroom_plan::reduction::BoxEnd;
use elbowroom_plan::soundness::{Broken, Counterexample, Soundness};
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Valuation};

use crate::feasibility::Feasibility;

/// Decides whether a plan is guaranteed to work in a box: for all values in it there is a
/// schedule, and every schedule is valid (paper 1, CHECKINENVELOPE and theorem 1).
///
/// It remembers proofs from one box to the next, so a box that differs in one end from the last
/// one accepted costs little.
#[doc(alias = "CheckInEnvelope")]
#[derive(Clone, Debug)]
pub struct Oracle<'a> {
    task: &'a Task,
    epsilon: Rational,
    plan: &'a ParametrizedPlan,
    feasibility: Feasibility,
    soundness: Soundness<'a>,
    /// Values around which `soundness` was made: it decides boxes that contain them.
    center: Valuation,
    /// Whether all proofs that `soundness` knows hold in the last box accepted.
    proofs_hold_in_last: bool,
    checks: usize,
    without_schedule: usize,
}

/// Why a box is not inside the envelope.
#[derive(Clone, Debug, PartialEq)]
pub enum Objection {
    /// For these values of the parameters the plan has no schedule.
    NoSchedule(Valuation),
    /// For some values, some schedule breaks an obligation.
    Broken(Broken),
}

impl<'a> Oracle<'a> {
    /// The oracle for a plan.
    ///
    /// # Errors
    /// When the plan has no schedule at its nominal values, or holds something beyond exact linear
    /// reasoning; the message names it.
    pub fn new(
        task: &'a Task,
        plan: &'a ParametrizedPlan,
        epsilon: &Rational,
    ) -> Result<Self, Refusal> {
        let soundness = Soundness::new(task, plan, epsilon)?;
        let feasibility =
            Feasibility::new(plan, soundness.reduction()).map_err(|_| Refusal::TooManyCases {
                place: "parameters on constraints in both directions".to_owned(),
                limit: crate::feasibility::MOST_CORNERS,
            })?;
        Ok(Self {
            task,
            epsilon: epsilon.clone(),
            plan,
            feasibility,
            soundness,
            center: plan.nominal(),
            proofs_hold_in_last: true,
            checks: 0,
            without_schedule: 0,
        })
    }

    /// The plan it was made for.
    pub fn plan(&self) -> &'a ParametrizedPlan {
        self.plan
    }

    /// How many boxes have been checked.
    pub fn checks(&self) -> usize {
        self.checks
    }

    /// How many of these were refused because some values have no schedule.
    pub fn without_schedule(&self) -> usize {
        self.without_schedule
    }

    /// How many bad cases have been refuted from scratch: a measure of work.
    pub fn refutations(&self) -> usize {
        self.soundness.refutations()
    }

    /// Why the box is not inside the envelope; `None` if it is.
    ///
    /// # Errors
    /// When there are too many cases to tell apart.
    pub fn objection(
        &mut self,
        envelope: &DecoupledEnvelope,
    ) -> Result<Option<Objection>, Refusal> {
        self.objection_after(envelope, None)
    }

    /// Like [`objection`](Self::objection), for a box that differs from the last one accepted only
    /// in `moved`, which lies further out.
    ///
    /// # Errors
    /// When there are too many cases to tell apart.
    pub fn objection_after(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
    ) -> Result<Option<Objection>, Refusal> {
        self.checks += 1;
        // Proofs found for a box that was refused, and is not the last accepted one with an end
        // moved out, may not hold in the last accepted one: then the hint says nothing about them.
        let trusted = moved.filter(|_| self.proofs_hold_in_last);
        let objection = self.sound_and_feasible(envelope, moved, trusted);
        self.proofs_hold_in_last = match &objection {
            Ok(None) => true,
            _ => moved.is_some() && self.proofs_hold_in_last,
        };
        objection
    }

    fn sound_and_feasible(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
        trusted: Option<BoxEnd>,
    ) -> Result<Option<Objection>, Refusal> {
        if !envelope.contains(&self.center) {
            let center = nearest(envelope, &self.center);
            match Soundness::around(self.task, self.plan, &self.epsilon, &center) {
                Ok(soundness) => (self.soundness, self.center) = (soundness, center),
                Err(Refusal::NoNominalSchedule) => {
                    self.without_schedule += 1;
                    return Ok(Some(Objection::NoSchedule(center)));
                }
                Err(refusal) => return Err(refusal),
            }
        }
        // A sound box with an infeasible one rejected afterwards would leave the networks of the
        // feasibility check ahead of the accepted box, so soundness comes first.
        if let Some(broken) = self.soundness.broken(envelope, trusted)? {
            return Ok(Some(Objection::Broken(broken)));
        }
        if let Some(valuation) = self.feasibility.infeasible(envelope, moved) {
            self.without_schedule += 1;
            return Ok(Some(Objection::NoSchedule(valuation)));
        }
        Ok(None)
    }

    /// Values and a schedule in the box that show what is broken.
    pub fn counterexample(
        &self,
        envelope: &DecoupledEnvelope,
        broken: &Broken,
    ) -> Option<Counterexample> {
        self.soundness.counterexample(envelope, broken)
    }
}

/// The values in the box nearest to these.
fn nearest(envelope: &DecoupledEnvelope, values: &[Rational]) -> Valuation {
    let intervals = envelope.intervals.iter().zip(values);
    intervals
        .map(|(interval, value)| {
            let value = match interval.lower.value() {
                Some(lower) => lower.max(value),
                None => value,
            };
            let value = match interval.upper.value() {
                Some(upper) => upper.min(value),
                None => value,
            };
            value.clone()
        })
        .collect()
}
