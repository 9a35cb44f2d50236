//! The proof that an over-all condition holds: a tree over the places of its moment.

use std::borrow::Cow;

use elbowroom_model::Task;

use super::certificate::Certificate;
use super::scale::Scale;
use super::violation_case::{Outcome, Schedules};
use crate::obligations::{BadCase, Difference, OverAll, Refusal};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, NodeId, ParameterId, ParametrizedPlan};

/// Limit on the places of the moment that are distinguished in one over-all condition.
const MAX_PLACES: usize = 100_000;

/// Proof that there is no moment at which the condition is false.
#[derive(Clone, Debug)]
pub(crate) enum Proof {
    /// There is no such moment, whatever the condition.
    NoMoment(Certificate),
    /// The events before the moment are fixed, and the condition is true there: one proof for each
    /// way for it to be false.
    True(Vec<Vec<Certificate>>),
    /// The moment is at or after an event, or before it.
    Either(Box<Proof>, Box<Proof>),
}

impl Proof {
    /// Returns `true` if the proof holds in a box that differs from its own only in `moved`.
    pub(crate) fn holds_in(&self, envelope: &DecoupledEnvelope, moved: Option<BoxEnd>) -> bool {
        match self {
            Self::NoMoment(certificate) => certificate.holds_in(envelope, moved),
            Self::True(cases) => cases.iter().flatten().all(|c| c.holds_in(envelope, moved)),
            Self::Either(after, before) => {
                after.holds_in(envelope, moved) && before.holds_in(envelope, moved)
            }
        }
    }
}

/// Search for a moment at which an over-all condition is false.
pub(crate) struct Prover<'a, 'b, S: Scale> {
    pub(crate) task: &'a Task,
    pub(crate) plan: &'a ParametrizedPlan,
    pub(crate) over_all: &'a OverAll,
    pub(crate) schedules: &'b mut Schedules<'a, S>,
    /// The events that may come before the moment or after it.
    events: Cow<'a, [NodeId]>,
    is_in_ranges: bool,
    /// The differences assumed so far, for the counterexample.
    assumed: Vec<Difference>,
    places: usize,
}

/// Proof, or a way for the condition to be false.
pub(crate) type ProofResult = Result<Proof, BadCase>;

impl<'a, 'b, S: Scale> Prover<'a, 'b, S> {
    pub(crate) fn new(
        task: &'a Task,
        plan: &'a ParametrizedPlan,
        over_all: &'a OverAll,
        schedules: &'b mut Schedules<'a, S>,
        is_in_ranges: bool,
    ) -> Self {
        Self {
            events: over_all.events(is_in_ranges),
            is_in_ranges,
            task,
            plan,
            over_all,
            schedules,
            assumed: Vec::new(),
            places: 0,
        }
    }

    /// Proves the condition in the box, reusing the valid parts of an old proof.
    pub(crate) fn prove(
        &mut self,
        old: Option<&Proof>,
        moved: Option<BoxEnd>,
    ) -> Result<ProofResult, Refusal> {
        let before = self.schedules.save();
        self.schedules.add_moment(self.over_all.end);
        let inside = [
            Difference::before(self.over_all.start, self.over_all.moment),
            Difference::before(self.over_all.moment, self.over_all.end),
        ];
        let mut attempt = None;
        for difference in inside {
            match self.schedules.assume(&difference) {
                Ok(()) => self.assumed.push(difference),
                Err(certificate) => {
                    attempt = Some(Ok(Proof::NoMoment(certificate)));
                    break;
                }
            }
        }
        let attempt = match attempt {
            Some(attempt) => attempt,
            None => self.place_moment(0, &mut Vec::new(), old, moved)?,
        };
        self.schedules.undo_to(&before);
        Ok(attempt)
    }

    /// Places the moment relative to the events from `index` on; `happened` come before it.
    fn place_moment(
        &mut self,
        index: usize,
        happened: &mut Vec<NodeId>,
        old: Option<&Proof>,
        moved: Option<BoxEnd>,
    ) -> Result<ProofResult, Refusal> {
        if let Some(old) = old
            && old.holds_in(self.schedules.envelope, moved)
        {
            return Ok(Ok(old.clone()));
        }
        self.places += 1;
        if self.places > MAX_PLACES {
            return Err(Refusal::TooManyCases {
                place: format!(
                    "over-all condition of {}",
                    self.plan.plan.instance(self.over_all.instance).action.name
                ),
                limit: MAX_PLACES,
            });
        }
        let Some(&event) = self.events.get(index) else {
            return self.decide_condition(happened);
        };
        let (old_after, old_before) = match old {
            Some(Proof::Either(after, before)) => (Some(&**after), Some(&**before)),
            _ => (None, None),
        };
        let moment = self.over_all.moment;
        happened.push(event);
        let after = self.branch(
            Difference::not_after(event, moment),
            index,
            happened,
            old_after,
            moved,
        )?;
        happened.pop();
        let Ok(after) = after else { return Ok(after) };
        let before = self.branch(
            Difference::before(moment, event),
            index,
            happened,
            old_before,
            moved,
        )?;
        Ok(before.map(|before| Proof::Either(Box::new(after), Box::new(before))))
    }

    fn branch(
        &mut self,
        difference: Difference,
        index: usize,
        happened: &mut Vec<NodeId>,
        old: Option<&Proof>,
        moved: Option<BoxEnd>,
    ) -> Result<ProofResult, Refusal> {
        let before = self.schedules.save();
        if let Err(certificate) = self.schedules.assume(&difference) {
            return Ok(Ok(Proof::NoMoment(certificate)));
        }
        self.assumed.push(difference);
        let attempt = self.place_moment(index + 1, happened, old, moved)?;
        if attempt.is_ok() {
            self.assumed.pop();
        }
        self.schedules.undo_to(&before);
        Ok(attempt)
    }

    fn coupled(&self, parameter: ParameterId) -> Refusal {
        Refusal::Coupled {
            name: self.plan.parameter(parameter).name.clone(),
        }
    }

    /// Decides the condition after all events are placed: its value is now an expression.
    fn decide_condition(&mut self, happened: &[NodeId]) -> Result<ProofResult, Refusal> {
        let cut = |node: NodeId| happened.contains(&node);
        let mut proofs = Vec::new();
        let cases = (self.over_all).cases(self.task, &self.plan.plan, self.is_in_ranges, &cut)?;
        for mut inequalities in cases {
            inequalities.extend(self.over_all.assumptions.iter().cloned());
            let case = BadCase {
                differences: self.assumed.clone(),
                inequalities,
            };
            match self.schedules.inequalities_possible(&case) {
                Outcome::Impossible(certificates) => proofs.push(certificates),
                Outcome::Possible => return Ok(Err(case)),
                Outcome::Unknown(parameter) => return Err(self.coupled(parameter)),
            }
        }
        Ok(Ok(Proof::True(proofs)))
    }
}
