//! Refinement near the best plan, in turns.

use super::super::answer::Phase;
use super::super::apply::Step;
use super::super::compile::Compiled;
use super::super::local_search::{Refiner, WorkMeter};
use super::super::search::Strategy;
use super::super::tuning::Member;
use super::worker::{CandidateVerdict, Worker};

/// A refiner, and the best plan that it has processed.
pub(super) struct LocalSearch<'a> {
    refiner: Refiner<'a>,
    /// The number of the best plan that it continues from; zero for none.
    pub(super) known: u64,
}

impl<'a> LocalSearch<'a> {
    /// Creates the first refiner, or the second one; their random numbers differ.
    pub(super) fn new(compiled: &'a Compiled, number: u64) -> Self {
        let compresses = Strategy::of(Member::Compressing, &compiled.tuning).compresses;
        Self {
            refiner: Refiner::new(compiled, compresses, number),
            known: 0,
        }
    }

    /// Limits its memory, in bytes.
    pub(super) fn limit_memory(&mut self, most: usize) {
        self.refiner.limit_memory(most);
    }

    /// Returns the work units of one estimate.
    pub(super) fn weight(&self) -> u64 {
        1 + self.refiner.weight()
    }

    /// Returns its share of time, relative to a search.
    pub(super) fn share(&self) -> u64 {
        // Before its first plan, it is unknown whether the refiner supports the plans.
        if self.known == 0 || self.refiner.has_plan() {
            self.refiner.share()
        } else {
            0
        }
    }
}

/// Result of a piece of work near the best plan.
struct RefinementResult {
    found: Option<Vec<Step>>,
    work: u64,
}

impl Worker<'_, '_> {
    /// Searches for better plans near the best one, for at most `most` work. `newest` is the number
    /// of the best plan.
    pub(super) fn refine(&mut self, nearby: &mut LocalSearch<'_>, newest: u64, most: u64) {
        let mut is_fresh = nearby.known != newest;
        nearby.known = newest;
        let refiner = &mut nearby.refiner;
        let mut work = 0;
        while work < most {
            if std::mem::take(&mut is_fresh)
                && let Some(best) = self.best.clone()
            {
                let piece = self.refine_piece(refiner, |refiner, ticker| {
                    refiner.adopt(&best.steps, ticker);
                    None
                });
                work += piece.work;
                if self.is_stopped {
                    return;
                }
            }
            if !refiner.has_plan() {
                return;
            }
            let piece = self.refine_piece(refiner, Refiner::try_change);
            work += piece.work + 1;
            if self.is_stopped {
                return;
            }
            let Some(steps) = piece.found else { continue };
            match self.judge(&steps) {
                CandidateVerdict::Stopped => return,
                // The choices are the refiner's own.
                CandidateVerdict::Better => {}
                CandidateVerdict::NoBetter => self.counts.evaluated += steps.len() as u64,
                CandidateVerdict::Refused => {
                    self.counts.evaluated += steps.len() as u64;
                    refiner.discard_plan();
                    is_fresh = true;
                }
            }
        }
    }

    /// Runs a piece of the refiner's work, and regularly asks whether to continue.
    fn refine_piece<'r>(
        &mut self,
        refiner: &mut Refiner<'r>,
        work: impl FnOnce(&mut Refiner<'r>, &mut WorkMeter<'_>) -> Option<Vec<Step>>,
    ) -> RefinementResult {
        self.phase = Phase::Improving;
        let before = self.counts.evaluated;
        let mut known = 0;
        let mut may_continue = |work: u64, evaluated: u64| {
            let more = work - known;
            known = work;
            self.count_work(before, evaluated, more)
        };
        let mut ticker = WorkMeter {
            weight: 1 + refiner.weight(),
            work: 0,
            evaluated: 0,
            should_continue: &mut may_continue,
            is_stopped: false,
        };
        let found = work(refiner, &mut ticker);
        RefinementResult {
            found,
            work: ticker.work,
        }
    }
}
