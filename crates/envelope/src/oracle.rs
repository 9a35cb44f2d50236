//! The exact box check.

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::obligations::Refusal;
use elbowroom_plan::reduction::BoxEnd;
use elbowroom_plan::soundness::{Broken, Counterexample, Soundness};
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Valuation};

use crate::branching::{MOST_BRANCHES, TooManyBranches};
use crate::feasibility::{Feasibility, Infeasible};

/// Decides whether a plan is guaranteed to work in a box: for all values in it there is a
/// schedule, and every schedule is valid (paper 1, CHECKINENVELOPE and theorem 1).
///
/// It remembers proofs from one box to the next, so a box that differs in one end from the last
/// one accepted costs little.
#[doc(alias = "CheckInEnvelope")]
#[derive(Clone, Debug)]
pub struct Oracle<'a> {
    task: &'a Task,
    plan: &'a ParametrizedPlan,
    epsilon: Rational,
    feasibility: Feasibility,
    soundness: Soundness<'a>,
    /// The values whose order of happenings `soundness` goes by; at first the nominal ones.
    around: Valuation,
    /// How many bad cases had been refuted from scratch before `around` changed last.
    refuted_before: usize,
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

/// The same, before the values without a schedule are worked out.
enum Reason {
    NoSchedule(Infeasible),
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
        let feasibility = Feasibility::new(plan, soundness.reduction());
        Ok(Self {
            task,
            plan,
            epsilon: epsilon.clone(),
            feasibility,
            soundness,
            around: plan.nominal(),
            refuted_before: 0,
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
        self.refuted_before + self.soundness.refutations()
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
        let reason = self.check(envelope, moved)?;
        Ok(reason.map(|reason| match reason {
            Reason::Broken(broken) => Objection::Broken(broken),
            Reason::NoSchedule(found) => {
                Objection::NoSchedule(self.feasibility.values(envelope, found))
            }
        }))
    }

    /// Whether there is no [objection](Self::objection_after), which need not be worked out then.
    ///
    /// # Errors
    /// When there are too many cases to tell apart.
    pub fn is_inside_after(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
    ) -> Result<bool, Refusal> {
        Ok(self.check(envelope, moved)?.is_none())
    }

    fn check(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
    ) -> Result<Option<Reason>, Refusal> {
        self.checks += 1;
        // Proofs found for a box that was refused, and is not the last accepted one with an end
        // moved out, may not hold in the last accepted one: then the hint says nothing about them.
        let trusted = moved.filter(|_| self.proofs_hold_in_last);
        let reason = self.sound_and_feasible(envelope, moved, trusted);
        self.proofs_hold_in_last = match &reason {
            Ok(None) => true,
            _ => moved.is_some() && self.proofs_hold_in_last,
        };
        reason
    }

    fn sound_and_feasible(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
        trusted: Option<BoxEnd>,
    ) -> Result<Option<Reason>, Refusal> {
        if !envelope.contains(&self.around)
            && let Some(without_schedule) = self.move_to(envelope)?
        {
            let found = Infeasible::At(without_schedule);
            return Ok(Some(Reason::NoSchedule(found)));
        }
        // A sound box with an infeasible one rejected afterwards would leave the networks of the
        // feasibility check ahead of the accepted box, so soundness comes first.
        if let Some(broken) = self.soundness.broken(envelope, trusted)? {
            return Ok(Some(Reason::Broken(broken)));
        }
        let infeasible = self.feasibility.infeasible(envelope, moved);
        let infeasible = infeasible.map_err(|TooManyBranches| Refusal::TooManyCases {
            place: "parameters on constraints in both directions".to_owned(),
            limit: MOST_BRANCHES,
        })?;
        if let Some(found) = infeasible {
            self.without_schedule += 1;
            return Ok(Some(Reason::NoSchedule(found)));
        }
        Ok(None)
    }

    /// Goes by the order that happenings have in the box from now on. The box need not hold the
    /// nominal values, and elsewhere a plan may work in another order.
    ///
    /// Values in the box that have no schedule, if that shows already.
    fn move_to(&mut self, envelope: &DecoupledEnvelope) -> Result<Option<Valuation>, Refusal> {
        let nearest = envelope.nearest(&self.plan.nominal());
        match Soundness::around(self.task, self.plan, &self.epsilon, &nearest) {
            Ok(soundness) => {
                self.refuted_before += self.soundness.refutations();
                self.soundness = soundness;
                self.around = nearest;
                Ok(None)
            }
            Err(Refusal::NoNominalSchedule) => {
                self.without_schedule += 1;
                Ok(Some(nearest))
            }
            Err(refusal) => Err(refusal),
        }
    }

    /// Values and a schedule in the box that break the obligation by as much as any do; see
    /// [`Soundness::worst_case`].
    pub fn worst_case(
        &self,
        envelope: &DecoupledEnvelope,
        broken: &Broken,
    ) -> Option<Counterexample> {
        self.soundness.worst_case(envelope, broken)
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
