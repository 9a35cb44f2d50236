//! Turns of the search near the best plan.

use super::super::answer::{Phase, Stopped};
use super::super::apply::Step;
use super::super::refine::{Refiner, Ticker};
use super::super::search::Strategy;
use super::super::tuning::{Member, Technique};
use super::{Judged, Planner, REPORT_WORK};

/// What became of a piece of work near the best plan.
struct Piece {
    found: Option<Vec<Step>>,
    work: u64,
    is_stopped: bool,
}

impl<'a> Planner<'a> {
    /// Whether better plans are looked for near the best one.
    pub(super) fn is_refining(&self) -> bool {
        let tuning = &self.compiled.tuning;
        self.best.is_some()
            && !self.settings.first_plan_only
            && !self.compiled.is_symbolic
            && (tuning.uses(Technique::Rescheduling) || tuning.uses(Technique::Repair))
    }

    /// Looks for better plans near the best one for as long as a search of so many states takes.
    /// Says why it ended, unless it goes on.
    pub(super) fn refine(&mut self, states: u64) -> Option<Stopped> {
        if !self.is_refining() {
            return None;
        }
        let compiled = self.compiled;
        let mut refiner = self.refiner.take().unwrap_or_else(|| {
            let compresses = Strategy::of(Member::Compressing, &compiled.tuning).compresses;
            Refiner::new(compiled, compresses)
        });
        let most = states
            .saturating_mul(refiner.share())
            .saturating_mul(1 + refiner.weight());
        let mut work = 0;
        while work < most {
            if std::mem::take(&mut self.is_fresh) {
                let steps = self.best_steps.clone();
                let piece = self.piece(&mut refiner, |refiner, ticker| {
                    refiner.take(&steps, ticker);
                    None
                });
                work += piece.work;
                if piece.is_stopped {
                    return Some(Stopped::Interrupted);
                }
            }
            let piece = self.piece(&mut refiner, Refiner::turn);
            work += piece.work + 1;
            if piece.is_stopped {
                return Some(Stopped::Interrupted);
            }
            let Some(steps) = piece.found else { continue };
            match self.judge(&steps) {
                Judged::Stop(stopped) => return Some(stopped),
                // The choices are its own.
                Judged::Better => self.is_fresh = false,
                Judged::NoBetter => {}
                Judged::Refused => {
                    refiner.forget();
                    self.is_fresh = true;
                }
            }
        }
        self.refiner = Some(refiner);
        None
    }

    /// Lets the refiner do something, and asks now and then whether to go on.
    fn piece(
        &mut self,
        refiner: &mut Refiner<'a>,
        work: impl FnOnce(&mut Refiner<'a>, &mut Ticker<'_>) -> Option<Vec<Step>>,
    ) -> Piece {
        let Self {
            observe,
            progress,
            unreported,
            ..
        } = self;
        progress.phase = Phase::Improving;
        let before = progress.counts.evaluated;
        let mut known = 0;
        let mut goes_on = |work: u64, evaluated: u64| {
            progress.counts.evaluated = before + evaluated;
            *unreported += work - known;
            known = work;
            if *unreported < REPORT_WORK {
                return true;
            }
            *unreported = 0;
            observe(progress).is_continue()
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
            is_stopped: ticker.is_stopped,
        }
    }
}
