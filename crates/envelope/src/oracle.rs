//! The exact box check.

mod cut_generation;
mod probe;
mod proofs;

use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParametrizedPlan, Valuation};

use crate::control::{beyond_all_bounds, strong_conflict};
use crate::cut_pool::CutPool;
use crate::guarantee::{Controllability, Guarantee, Uncontrollable};
use crate::objection::Objection;
use crate::obligations::Refusal;
use crate::soundness::{Broken, Conditions, Counterexample, Soundness};

pub(crate) use probe::Probe;

/// Decides whether a plan is guaranteed to work in a box: for all values in it there is a schedule,
/// and every schedule is valid (paper 1, CHECKINENVELOPE and theorem 1). "There is a schedule" is
/// interpreted by a [`Guarantee`].
///
/// The oracle keeps one [accepted](Self::accepted) box and its proofs. Moving one end of that box
/// ([`try_reach`](Self::try_reach)) costs little, because only the proofs that use the end are
/// searched again. The oracle constructs the wider box itself, so the caller cannot misstate the
/// difference of two boxes. Other boxes can be checked at any time
/// ([`objection`](Self::objection)). That takes longer, and does not change the accepted box.
///
/// The interface has no way to pass an arbitrary box as one that differs in one end only:
///
/// ```compile_fail
/// # use elbowroom_envelope::Oracle;
/// # use elbowroom_plan::{BoxEnd, DecoupledEnvelope};
/// fn check(oracle: &mut Oracle, somewhere_else: &DecoupledEnvelope, end: BoxEnd) {
///     let _ = oracle.objection_after(somewhere_else, Some(end));
/// }
/// ```
#[doc(alias = "CheckInEnvelope")]
#[derive(Clone, Debug)]
pub struct Oracle {
    task: Arc<Task>,
    plan: Arc<ParametrizedPlan>,
    guarantee: Guarantee,
    scope: CheckScope,
    controllability: Controllability,
    /// The conditions on all schedules; `None` while no values with a schedule are known, or if
    /// only the times are checked.
    soundness: Option<Soundness>,
    /// Values that determine the order of happenings in `soundness`; initially the nominal ones.
    order_values: Valuation,
    /// The number of bad cases refuted from scratch before `around` changed last.
    earlier_refutations: usize,
    accepted: Option<DecoupledEnvelope>,
    /// `true` if `accepted` is the last box that was found inside, so that the stored proofs are
    /// about it.
    has_accepted_proofs: bool,
    /// `true` if all proofs stored in `soundness` hold in the last box found inside.
    proofs_hold_in_last: bool,
    checks: usize,
    without_schedule: usize,
    /// Reasons that the last search has found.
    cut_pool: CutPool,
}

/// Scope of the check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CheckScope {
    /// The conditions on all schedules, and the times.
    All,
    /// Only the times: the network is known to imply the conditions.
    TimesOnly,
}

/// [`Objection`] without its values.
enum Reason {
    /// The plan has no schedule at these values.
    NoSchedule(Valuation),
    Uncontrollable(Uncontrollable),
    Broken(Broken),
}

impl Oracle {
    /// Creates the oracle for a plan. If the plan has no schedule at its nominal values, every box
    /// that contains them is rejected for that reason.
    ///
    /// # Errors
    /// If the plan contains something beyond exact linear reasoning; the message names it.
    pub fn new(
        task: &Arc<Task>,
        plan: &Arc<ParametrizedPlan>,
        guarantee: Guarantee,
    ) -> Result<Self, Refusal> {
        Self::with_scope(task, plan, guarantee, CheckScope::All)
    }

    /// Creates the oracle for a plan whose schedules are all known to be valid, whatever the values
    /// of its parameters
    /// ([`keeps_all_that_is_read`](elbowroom_plan::deorder::keeps_all_that_is_read)). The time
    /// grows little faster than the plan. Checking each condition would take time that grows with
    /// the square of its length.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn of_times(
        task: &Arc<Task>,
        plan: &Arc<ParametrizedPlan>,
        guarantee: Guarantee,
    ) -> Result<Self, Refusal> {
        Self::with_scope(task, plan, guarantee, CheckScope::TimesOnly)
    }

    fn with_scope(
        task: &Arc<Task>,
        plan: &Arc<ParametrizedPlan>,
        guarantee: Guarantee,
        asked: CheckScope,
    ) -> Result<Self, Refusal> {
        let around = plan.nominal();
        let soundness = match asked {
            CheckScope::All => Soundness::for_values(task, plan, &around)?,
            CheckScope::TimesOnly => None,
        };
        let reduction = soundness.as_ref().map(Soundness::reduction);
        let controllability = Controllability::new(guarantee, plan, reduction);
        Ok(Self {
            task: Arc::clone(task),
            plan: Arc::clone(plan),
            guarantee,
            scope: asked,
            controllability,
            soundness,
            order_values: around,
            earlier_refutations: 0,
            accepted: None,
            has_accepted_proofs: false,
            proofs_hold_in_last: true,
            checks: 0,
            without_schedule: 0,
            cut_pool: CutPool::default(),
        })
    }

    /// Returns the plan that it was created for.
    pub fn plan(&self) -> &Arc<ParametrizedPlan> {
        &self.plan
    }

    /// Returns the guarantee that it checks.
    pub fn guarantee(&self) -> Guarantee {
        self.guarantee
    }

    /// Returns the box that was accepted by [`start`](Self::start), as widened since; `None` before
    /// that.
    pub fn accepted(&self) -> Option<&DecoupledEnvelope> {
        self.accepted.as_ref()
    }

    /// Returns the numbers of conditions of the plan, by the mechanism that enforces them in an accepted box.
    pub fn conditions(&self) -> Conditions {
        let known = self.soundness.as_ref();
        known.map(Soundness::conditions).unwrap_or_default()
    }

    /// Returns the number of boxes checked.
    pub fn checks(&self) -> usize {
        self.checks
    }

    /// Returns the number of checked boxes that were rejected because some values have no schedule.
    pub fn without_schedule(&self) -> usize {
        self.without_schedule
    }

    /// Returns the number of bad cases refuted from scratch: a measure of work.
    pub fn refutations(&self) -> usize {
        let now = self.soundness.as_ref().map_or(0, Soundness::refutations);
        self.earlier_refutations + now
    }

    /// Makes a box the accepted one, or returns the objection if it is not inside the envelope. In
    /// that case a box accepted earlier stays the accepted one.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub fn start(&mut self, envelope: &DecoupledEnvelope) -> Result<Option<Objection>, Refusal> {
        let reason = self.check_from_scratch(envelope)?;
        if reason.is_none() {
            self.accepted = Some(envelope.clone());
            self.has_accepted_proofs = true;
        }
        Ok(reason.map(|reason| self.objection_of(envelope, reason, None)))
    }

    /// Moves one end of the accepted box out to `reach` ([`BoxEnd::reach`]; `None` is infinitely
    /// far), if the box stays inside the envelope. Returns `true` if it does.
    ///
    /// An end that already reaches as far is not moved. If no box has been accepted yet, the
    /// nominal values are the initial box. If not even they are inside, neither is a wider box.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub fn try_reach(&mut self, end: BoxEnd, reach: Option<Rational>) -> Result<bool, Refusal> {
        Ok(self.widen(end, reach)?.is_none())
    }

    /// Like [`try_reach`](Self::try_reach), but returns the objection if the box cannot be widened.
    /// Computing it can take some time.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub fn objection_to_reach(
        &mut self,
        end: BoxEnd,
        reach: Option<Rational>,
    ) -> Result<Option<Objection>, Refusal> {
        let refused = self.widen(end, reach)?;
        Ok(refused.map(|(envelope, reason)| self.objection_of(&envelope, reason, None)))
    }

    /// Returns the reason why the box is not inside the envelope; `None` if it is. The accepted box
    /// does not change.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub fn objection(
        &mut self,
        envelope: &DecoupledEnvelope,
    ) -> Result<Option<Objection>, Refusal> {
        let reason = self.check_from_scratch(envelope)?;
        if reason.is_none() {
            self.has_accepted_proofs = self.accepted.as_ref() == Some(envelope);
        }
        Ok(reason.map(|reason| self.objection_of(envelope, reason, None)))
    }

    /// Returns `true` if it is proved that the box, with this end at any finite value further out, is
    /// inside the envelope. Only for the strong guarantee, which no box with an infinite duration has.
    ///
    /// The conditions are checked with an infinite end, which covers all finite values. Times fixed in
    /// advance exist for all greater values if they exist for one value that exceeds the sum of all
    /// other numbers of the network. A cycle of the network contains that value a whole number of
    /// times, so a cycle that contains it negatively has a negative length.
    ///
    /// # Errors
    /// When there are too many cases to distinguish.
    pub fn accepts_all_finite(
        &mut self,
        envelope: &DecoupledEnvelope,
        end: BoxEnd,
    ) -> Result<bool, Refusal> {
        if self.guarantee != Guarantee::Strong {
            return Ok(false);
        }
        let plan = Arc::clone(&self.plan);
        self.has_accepted_proofs = false;
        self.proofs_hold_in_last = false;
        if self.scope == CheckScope::All
            && self
                .soundness_violation(&end.with_reach(envelope, None), None)?
                .is_some()
        {
            return Ok(false);
        }
        let Some(far) = beyond_all_bounds(&plan, envelope) else {
            return Ok(false);
        };
        let far = end.with_reach(envelope, Some(far));
        Ok(strong_conflict(&plan, &far).is_none())
    }

    /// Returns values and a schedule in the box with the greatest violation of the obligation. Two
    /// happenings that should be apart may then be far apart in the reverse order, which is
    /// harmless.
    pub fn worst_case(
        &self,
        envelope: &DecoupledEnvelope,
        broken: &Broken,
    ) -> Option<Counterexample> {
        self.soundness.as_ref()?.worst_case(envelope, broken)
    }

    /// Returns values and a schedule in the box that show the violation.
    pub fn counterexample(
        &self,
        envelope: &DecoupledEnvelope,
        broken: &Broken,
    ) -> Option<Counterexample> {
        self.soundness.as_ref()?.counterexample(envelope, broken)
    }

    /// Moves an end of the accepted box out. Returns the wider box and the reason if it is
    /// rejected; `None` if it is the accepted box now.
    fn widen(
        &mut self,
        end: BoxEnd,
        reach: Option<Rational>,
    ) -> Result<Option<(DecoupledEnvelope, Reason)>, Refusal> {
        let accepted = match self.accepted.take() {
            Some(accepted) => accepted,
            None => match self.start_at_nominal()? {
                Ok(point) => point,
                Err(refused) => return Ok(Some(refused)),
            },
        };
        let is_reached = match (end.reach(&accepted), &reach) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(present), Some(wanted)) => present >= *wanted,
        };
        if is_reached {
            self.accepted = Some(accepted);
            return Ok(None);
        }
        let candidate = end.with_reach(&accepted, reach);
        let reason = self.check_widened(&accepted, &candidate, end);
        match reason {
            Ok(None) => {
                self.accepted = Some(candidate);
                self.has_accepted_proofs = true;
                Ok(None)
            }
            refused => {
                self.accepted = Some(accepted);
                Ok(refused?.map(|reason| (candidate, reason)))
            }
        }
    }

    /// Returns the nominal values as a box, if they are inside.
    fn start_at_nominal(
        &mut self,
    ) -> Result<Result<DecoupledEnvelope, (DecoupledEnvelope, Reason)>, Refusal> {
        let point = DecoupledEnvelope::point(&self.plan.nominal());
        if let Some(reason) = self.check_from_scratch(&point)? {
            return Ok(Err((point, reason)));
        }
        self.has_accepted_proofs = true;
        Ok(Ok(point))
    }

    /// Checks `accepted` with `end` moved out.
    fn check_widened(
        &mut self,
        accepted: &DecoupledEnvelope,
        candidate: &DecoupledEnvelope,
        end: BoxEnd,
    ) -> Result<Option<Reason>, Refusal> {
        if !self.has_accepted_proofs {
            // Another box has been found inside since, so the stored proofs are about that one.
            let again = self.check_from_scratch(accepted);
            self.checks -= 1;
            self.has_accepted_proofs = again?.is_none();
        }
        if !self.has_accepted_proofs {
            return self.check_from_scratch(candidate);
        }
        self.checks += 1;
        // Proofs found for a rejected box that is not the last accepted one with an end moved out
        // may not hold in the last accepted one. The moved end then says nothing about them.
        let trusted = self.proofs_hold_in_last.then_some(end);
        let reason = self.sound_and_controllable(candidate, Some(end), trusted);
        if let Ok(None) = &reason {
            self.proofs_hold_in_last = true;
        }
        reason
    }

    /// Checks a box that may be unrelated to the previous one.
    fn check_from_scratch(
        &mut self,
        envelope: &DecoupledEnvelope,
    ) -> Result<Option<Reason>, Refusal> {
        self.checks += 1;
        let reason = self.sound_and_controllable(envelope, None, None);
        self.proofs_hold_in_last = matches!(&reason, Ok(None));
        reason
    }

    fn sound_and_controllable(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
        trusted: Option<BoxEnd>,
    ) -> Result<Option<Reason>, Refusal> {
        // Soundness comes first. If a feasible box were rejected as unsound afterwards, the
        // networks of the feasibility check would be ahead of the accepted box.
        if self.scope == CheckScope::All
            && let Some(reason) = self.soundness_violation(envelope, trusted)?
        {
            return Ok(Some(reason));
        }
        if let Some(found) = self.controllability.refuses(envelope, moved)? {
            self.without_schedule += 1;
            return Ok(Some(Reason::Uncontrollable(found)));
        }
        Ok(None)
    }

    /// Returns the reason why some schedule in the box violates a condition, or why there is no
    /// schedule.
    fn soundness_violation(
        &mut self,
        envelope: &DecoupledEnvelope,
        trusted: Option<BoxEnd>,
    ) -> Result<Option<Reason>, Refusal> {
        let is_there = self.soundness.is_some() && envelope.contains(&self.order_values);
        let without_schedule = if is_there {
            None
        } else {
            self.move_to(envelope)?
        };
        let (None, Some(soundness)) = (&without_schedule, &mut self.soundness) else {
            self.without_schedule += 1;
            let values = without_schedule.unwrap_or_else(|| self.order_values.clone());
            return Ok(Some(Reason::NoSchedule(values)));
        };
        let broken = soundness.broken(&self.task, &self.plan, envelope, trusted)?;
        Ok(broken.map(Reason::Broken))
    }

    /// Switches to the order of happenings in the box. The box need not contain the nominal values,
    /// and elsewhere a plan may work in another order.
    ///
    /// Returns values in the box without a schedule, if they are found on the way; then nothing
    /// changes.
    fn move_to(&mut self, envelope: &DecoupledEnvelope) -> Result<Option<Valuation>, Refusal> {
        let nearest = envelope.nearest(&self.plan.nominal());
        let Some(soundness) = Soundness::for_values(&self.task, &self.plan, &nearest)? else {
            return Ok(Some(nearest));
        };
        self.earlier_refutations = self.refutations();
        self.soundness = Some(soundness);
        self.order_values = nearest;
        Ok(None)
    }

    /// Returns the objection with its values. `widened` is the accepted box and the end by which
    /// the rejected one differs from it, if that is known.
    fn objection_of(
        &mut self,
        envelope: &DecoupledEnvelope,
        reason: Reason,
        widened: Option<(&DecoupledEnvelope, BoxEnd)>,
    ) -> Objection {
        match reason {
            Reason::NoSchedule(values) => Objection::NoSchedule(values),
            Reason::Uncontrollable(found) => {
                self.controllability.objection(envelope, found, widened)
            }
            Reason::Broken(broken) => Objection::Broken(broken),
        }
    }
}
