//! Turns of the search near the best plan.

use super::super::answer::Phase;
use super::super::apply::Step;
use super::super::compile::Compiled;
use super::super::refine::{Refiner, Ticker};
use super::super::search::Strategy;
use super::super::tuning::Member;
use super::strand::{Judged, Strand};

/// What makes better plans of the best one, and which best plan it has seen.
pub(super) struct Nearby<'a> {
    refiner: Refiner<'a>,
    /// The number of the best plan that it goes on from; zero for none.
    pub(super) known: u64,
}

impl<'a> Nearby<'a> {
    /// The first one, or the second: they draw other numbers.
    pub(super) fn new(compiled: &'a Compiled, number: u64) -> Self {
        let compresses = Strategy::of(Member::Compressing, &compiled.tuning).compresses;
        Self {
            refiner: Refiner::new(compiled, compresses, number),
            known: 0,
        }
    }

    /// From now on it takes no more than so many bytes at once.
    pub(super) fn limit_memory(&mut self, most: usize) {
        self.refiner.limit_memory(most);
    }

    /// What one estimate comes to.
    pub(super) fn weight(&self) -> u64 {
        1 + self.refiner.weight()
    }

    /// How long it should take for each unit of time of a search.
    pub(super) fn share(&self) -> u64 {
        // Before it has seen a plan, it cannot know that it does not understand it.
        if self.known == 0 || self.refiner.has_plan() {
            self.refiner.share()
        } else {
            0
        }
    }
}

/// What became of a piece of work near the best plan.
struct Piece {
    found: Option<Vec<Step>>,
    work: u64,
}

impl Strand<'_, '_> {
    /// Looks for better plans near the best one, for so much work. `newest` is its number.
    pub(super) fn refine(&mut self, nearby: &mut Nearby<'_>, newest: u64, most: u64) {
        let mut is_fresh = nearby.known != newest;
        nearby.known = newest;
        let refiner = &mut nearby.refiner;
        let mut work = 0;
        while work < most {
            if std::mem::take(&mut is_fresh)
                && let Some(best) = self.best.clone()
            {
                let piece = self.piece(refiner, |refiner, ticker| {
                    refiner.take(&best.steps, ticker);
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
            let piece = self.piece(refiner, Refiner::turn);
            work += piece.work + 1;
            if self.is_stopped {
                return;
            }
            let Some(steps) = piece.found else { continue };
            match self.judge(&steps) {
                Judged::Stopped => return,
                // The choices are its own.
                Judged::Better => {}
                Judged::NoBetter => self.counts.evaluated += steps.len() as u64,
                Judged::Refused => {
                    self.counts.evaluated += steps.len() as u64;
                    refiner.forget();
                    is_fresh = true;
                }
            }
        }
    }

    /// Lets the refiner do something, and asks now and then whether to go on.
    fn piece<'r>(
        &mut self,
        refiner: &mut Refiner<'r>,
        work: impl FnOnce(&mut Refiner<'r>, &mut Ticker<'_>) -> Option<Vec<Step>>,
    ) -> Piece {
        self.phase = Phase::Improving;
        let before = self.counts.evaluated;
        let mut known = 0;
        let mut goes_on = |work: u64, evaluated: u64| {
            let more = work - known;
            known = work;
            self.counted(before, evaluated, more)
        };
        let mut ticker = Ticker {
            weight: 1 + refiner.weight(),
            work: 0,
            evaluated: 0,
            goes_on: &mut goes_on,
            is_stopped: false,
        };
        let found = work(refiner, &mut ticker);
        Piece {
            found,
            work: ticker.work,
        }
    }
}
