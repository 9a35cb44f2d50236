//! Batched steps of the search: [`Speculation`].
//!
//! If a box is inside the envelope, so are all boxes inside it. So a sequence of widenings that
//! were assumed to succeed is correct if the last box is inside, and one check is enough for all of
//! them. The reason for rejecting a box also applies to others ([`Cut`](crate::Cut)), so steps that
//! a known reason excludes need no check either. The resulting steps are those of one check after
//! the other.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParametrizedPlan};

use super::conflict_split::ConflictSplit;
use super::parameter_bounds::ParameterBounds;
use super::{MAX_UNDECIDED, Settings, StopReason, Widening, max_reach};
use crate::cut::Cut;
use crate::cut_generation::CheckOutcome;
use crate::cut_pool::CutPool;
use crate::frontier::Frontier;
use crate::objection::Objection;
use crate::obligations::Refusal;
use crate::oracle::Oracle;

/// Number of cuts from one check from which they are assumed to be most of the relevant ones.
const ENOUGH_CUTS: usize = 2;

/// A search in progress.
pub(super) struct Speculation<'a> {
    oracle: &'a mut Oracle,
    plan: Arc<ParametrizedPlan>,
    settings: &'a Settings,
    frontier: Frontier,
    /// Box that is known to be inside the envelope.
    envelope: DecoupledEnvelope,
    cut_pool: CutPool,
    /// The number of decided boxes, including the first one.
    checks: usize,
    /// Number of undecided boxes.
    undecided: usize,
    /// Number of steps to take before the next check.
    length: usize,
    /// Known limits on the ends, used instead of the oracle's if present.
    bounds: Option<ParameterBounds>,
    /// Division of growing conflicts, if enabled.
    conflict_split: Option<ConflictSplit>,
}

/// A step that was taken.
struct Step {
    /// The end that was moved, if one was.
    moved: Option<(BoxEnd, Reach)>,
    /// The number of decided boxes so far.
    checks: usize,
}

/// Reach of an end; `None` is infinitely far.
#[derive(Clone)]
struct Reach(Option<Rational>);

/// Steps that were taken without a check.
struct SpeculativeSteps {
    frontier: Frontier,
    envelope: DecoupledEnvelope,
    steps: Vec<Step>,
    checks: usize,
    /// Reason why there are no more steps.
    end: Option<StopReason>,
}

impl<'a> Speculation<'a> {
    /// Creates a search from the box of the nominal values.
    pub(super) fn new(
        oracle: &'a mut Oracle,
        settings: &'a Settings,
        frontier: Frontier,
        envelope: DecoupledEnvelope,
    ) -> Self {
        Self {
            // If there are few obstacles, checks at each power of two would be most of the work. If
            // there are many, the obstacles of a long leap have to be found anyway.
            length: oracle.plan().parameters.len().max(1),
            plan: Arc::clone(oracle.plan()),
            oracle,
            settings,
            frontier,
            envelope,
            cut_pool: CutPool::default(),
            checks: 1,
            undecided: 0,
            bounds: None,
            conflict_split: settings.divide_after.map(ConflictSplit::with_remaining),
        }
    }

    /// Checks the initial box, and returns the objection to it, if any.
    pub(super) fn start(&mut self) -> Result<Option<Objection>, Refusal> {
        self.oracle.start(&self.envelope)
    }

    /// Takes all steps before the first check. If there are few obstacles, that succeeds at once.
    /// Otherwise the steps are discarded, and the result is `None`. Returns the reason why the
    /// search ended.
    pub(super) fn run_at_once(
        &mut self,
        on_step: &mut dyn FnMut(Option<&Widening<'_>>) -> ControlFlow<()>,
    ) -> Option<StopReason> {
        let length = std::mem::replace(&mut self.length, usize::MAX);
        self.bounds = Some(ParameterBounds::new(&self.plan));
        let leap = self.speculate();
        self.length = length;
        if let Verification::No(cuts) = self.verify(&leap) {
            self.discard(cuts);
            return None;
        }
        self.cut_pool.commit();
        self.frontier = leap.frontier.clone();
        let flow = self.report_steps(&leap, on_step);
        if flow.is_break() {
            return Some(StopReason::Cancelled);
        }
        leap.end
    }

    /// Returns the number of decided boxes.
    pub(super) fn checks(&self) -> usize {
        self.checks
    }

    /// Returns the box, and hands the knowledge about other boxes to the oracle.
    pub(super) fn finish(self) -> DecoupledEnvelope {
        self.oracle.store_cuts(self.cut_pool);
        self.envelope
    }

    /// Searches until nothing can be gained, a limit is reached, or the caller cancels.
    pub(super) fn run(
        &mut self,
        on_step: &mut dyn FnMut(Option<&Widening<'_>>) -> ControlFlow<()>,
    ) -> StopReason {
        loop {
            if self.undecided >= MAX_UNDECIDED {
                return StopReason::Undecided;
            }
            let leap = self.speculate();
            let is_one = leap.steps.len() == 1;
            let mut end = leap.end;
            let flow = match self.verify(&leap) {
                Verification::Yes => {
                    self.cut_pool.commit();
                    self.length = self.length.saturating_mul(2);
                    self.frontier = leap.frontier.clone();
                    self.report_steps(&leap, on_step)
                }
                Verification::No(cuts) => {
                    end = None;
                    // Several cuts are probably most of the relevant ones. Few cuts suggest that
                    // one conflict hides the next, and these are found sooner in narrower boxes.
                    if cuts.len() < ENOUGH_CUTS {
                        self.length = (leap.steps.len() / 2).max(1);
                    }
                    let is_unknown = cuts.is_empty();
                    self.discard(cuts);
                    if is_unknown && is_one {
                        self.step(on_step)
                    } else {
                        ControlFlow::Continue(())
                    }
                }
            };
            if flow.is_break() {
                return StopReason::Cancelled;
            }
            match end {
                Some(StopReason::Converged) if self.undecided > 0 => return StopReason::Undecided,
                Some(reason) => return reason,
                None => {}
            }
        }
    }

    /// Discards a leap whose box was rejected, and records the cuts.
    fn discard(&mut self, cuts: Vec<Cut>) {
        self.cut_pool.rollback();
        if let Some(pieces) = &mut self.conflict_split {
            for row in pieces.split_conflicts(&self.plan, &cuts, &self.envelope) {
                self.cut_pool.add_condition(row, &self.envelope);
            }
        }
        for cut in cuts {
            self.cut_pool.add(cut, &self.envelope);
        }
    }

    /// Takes steps that no known reason rejects, without checks.
    fn speculate(&mut self) -> SpeculativeSteps {
        let plan = Arc::clone(&self.plan);
        let mut leap = SpeculativeSteps {
            frontier: self.frontier.clone(),
            envelope: self.envelope.clone(),
            steps: Vec::new(),
            checks: self.checks,
            end: None,
        };
        while leap.steps.len() < self.length {
            let Some((end, step)) = leap.frontier.next_end() else {
                leap.end = Some(StopReason::Converged);
                break;
            };
            if self.is_check_limit_reached(leap.checks) {
                leap.end = Some(StopReason::CheckLimit);
                break;
            }
            let reach = self.reach(&mut leap, end, &plan.parameter(end.parameter).range, &step);
            match &reach {
                Some(reach) => {
                    leap.frontier.accept(end);
                    if self.is_far(end, reach.0.as_ref()) {
                        leap.frontier.finish(end);
                    }
                    leap.envelope.set_reach(end, reach.0.clone());
                }
                None => leap.frontier.reject(end),
            }
            leap.steps.push(Step {
                moved: reach.map(|reach| (end, reach)),
                checks: leap.checks,
            });
        }
        leap
    }

    /// Returns the reach of an end after a step; `None` if it cannot be moved.
    fn reach(
        &mut self,
        leap: &mut SpeculativeSteps,
        end: BoxEnd,
        range: &Interval,
        step: &Rational,
    ) -> Option<Reach> {
        let from = end.reach(&leap.envelope)?;
        let reach = next_reach(&from, end, range, step)?;
        leap.checks += 1;
        if self.is_refused(end, &from, Some(&reach)) {
            return None;
        }
        self.cut_pool.apply_move(end, &from, Some(&reach));
        if matches!(end.side.of(range), End::Infinite) {
            leap.checks += 1;
            if !self.is_refused(end, &reach, None) {
                self.cut_pool.apply_move(end, &reach, None);
                return Some(Reach(None));
            }
        }
        Some(Reach(Some(reach)))
    }

    /// Returns `true` if the box with that end moved is known to be rejected.
    fn is_refused(&self, end: BoxEnd, from: &Rational, to: Option<&Rational>) -> bool {
        let is_too_far = match &self.bounds {
            Some(bounds) => bounds.exclude(end, to),
            None => self.oracle.is_too_far(end, to),
        };
        is_too_far || self.cut_pool.refuses(end, from, to)
    }

    /// Checks the box after these steps. If it is not inside the envelope, the result contains cuts
    /// that apply to other boxes.
    fn verify(&mut self, leap: &SpeculativeSteps) -> Verification {
        let moved = leap.steps.iter().filter(|step| step.moved.is_some());
        let answer = match moved.count() {
            0 => return Verification::Yes,
            _ => self.oracle.accept_or_cuts(&leap.envelope),
        };
        match answer {
            Ok(CheckOutcome::Accepted) => Verification::Yes,
            Ok(CheckOutcome::Cuts(cuts)) => Verification::No(cuts),
            Ok(CheckOutcome::Unknown) | Err(_) => Verification::No(Vec::new()),
        }
    }

    /// Reports the confirmed steps one by one.
    fn report_steps(
        &mut self,
        leap: &SpeculativeSteps,
        on_step: &mut dyn FnMut(Option<&Widening<'_>>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        for step in &leap.steps {
            self.checks = step.checks;
            let flow = match &step.moved {
                Some((end, reach)) => {
                    self.envelope.set_reach(*end, reach.0.clone());
                    on_step(Some(&Widening {
                        envelope: &self.envelope,
                        end: *end,
                        checks: self.checks,
                    }))
                }
                None => on_step(None),
            };
            if flow.is_break() {
                // The remaining steps are discarded.
                self.oracle.shrink_accepted(&self.envelope);
                return flow;
            }
        }
        ControlFlow::Continue(())
    }

    /// Takes one step with a separate check.
    fn step(
        &mut self,
        on_step: &mut dyn FnMut(Option<&Widening<'_>>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let Some((end, step)) = self.frontier.next_end() else {
            return ControlFlow::Continue(());
        };
        let range = self.plan.parameter(end.parameter).range.clone();
        let from = end.reach(&self.envelope);
        let reach = from.and_then(|from| Some((next_reach(&from, end, &range, &step)?, from)));
        let is_wider = match &reach {
            Some((reach, _)) => self.is_inside(end, Some(reach.clone())),
            None => false,
        };
        let (Some((reach, from)), true) = (reach, is_wider) else {
            self.frontier.reject(end);
            return on_step(None);
        };
        self.frontier.accept(end);
        let is_endless = matches!(end.side.of(&range), End::Infinite) && self.is_inside(end, None);
        if !is_endless {
            self.cut_pool.set_finite(end);
        }
        let reach = (!is_endless).then_some(reach);
        if self.is_far(end, reach.as_ref()) {
            self.frontier.finish(end);
        }
        self.cut_pool.apply_move(end, &from, reach.as_ref());
        self.cut_pool.commit();
        self.envelope.set_reach(end, reach);
        on_step(Some(&Widening {
            envelope: &self.envelope,
            end,
            checks: self.checks,
        }))
    }

    /// Returns `true` if the box with an end moved out is inside the envelope. An undecided box
    /// counts as rejected.
    fn is_inside(&mut self, end: BoxEnd, reach: Option<Rational>) -> bool {
        self.checks += 1;
        let answer: Result<bool, Refusal> = self.oracle.try_reach(end, reach);
        self.undecided += usize::from(answer.is_err());
        answer.unwrap_or(false)
    }

    /// Returns `true` if the limit on checks is reached.
    fn is_check_limit_reached(&self, checks: usize) -> bool {
        self.settings.most_checks.is_some_and(|most| checks >= most)
    }

    /// Returns `true` if an end is so far out that it need not move further. A fixed schedule may
    /// tolerate any finite duration, but not an infinite one.
    fn is_far(&self, end: BoxEnd, reach: Option<&Rational>) -> bool {
        reach.is_none_or(|reach| *reach > max_reach(self.plan.parameter(end.parameter)))
    }
}

/// The outcome of a check of several steps.
enum Verification {
    Yes,
    /// Refused, with cuts that apply to other boxes, if any.
    No(Vec<Cut>),
}

/// Returns the reach of an end after a step; `None` if it is outside its parameter's range.
fn next_reach(from: &Rational, end: BoxEnd, range: &Interval, step: &Rational) -> Option<Rational> {
    let reach = from + step;
    range
        .contains(&end.side.value_at_reach(&reach))
        .then_some(reach)
}
