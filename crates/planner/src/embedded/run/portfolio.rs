//! The searches for a first plan, and the order of their turns.

use super::super::compile::{self, Compressibility};
use super::super::formula::Literal;
use super::super::relaxed;
use super::super::search::Strategy;
use super::super::tuning::{Member, Technique};
use super::Planner;

impl Planner<'_> {
    /// Returns the searches that take turns. The complete one is last, or the one that joins
    /// happenings of one moment, where that may be needed. If some fluent is used up and
    /// replenished, estimates that account for it find most plans sooner, but not all. If actions
    /// have effects that hold only while they run, some searches choose happenings in chronological
    /// order.
    pub(super) fn strategies(&self) -> Vec<Strategy> {
        let tuning = &self.frame.compiled.tuning;
        if let Some(member) = tuning.only {
            return vec![Strategy::of(member, tuning)];
        }
        let mut compressing = vec![Member::Compressing];
        let holds =
            |action: &compile::Action| action.compressibility == Compressibility::HoldsResource;
        if self.frame.compiled.actions.iter().any(holds) {
            compressing.push(Member::CompressingSafe);
        }
        let mut strategies = Vec::new();
        for member in compressing {
            let strategy = Strategy::of(member, tuning);
            if self.has_reservoirs {
                strategies.push(strategy.replenishing());
            }
            strategies.push(strategy);
        }
        let counts_landmarks =
            tuning.uses(Technique::Landmarks) && !self.frame.compiled.is_symbolic;
        let needs_concurrency = self.needs_concurrency();
        let compiled = self.frame.compiled;
        let has_timed = !compiled.timed.is_empty() || !compiled.calendars.is_empty();
        let serializing = [Member::Spreading, Member::Serializing];
        let serializing = serializing.map(|member| Strategy::of(member, tuning));
        let serializes = tuning.uses(Technique::Serialization);
        // Otherwise BFWS(f₅) comes first: storage and parking take 1.3 to 5 times the states behind
        // these searches.
        let serializes_early =
            serializes && (self.has_reservoirs || has_timed || needs_concurrency);
        if serializes_early {
            let [spreading, plain] = serializing;
            let spreading = spreading.with_share(tuning.serialization_share);
            strategies.splice(1..1, [spreading, plain]);
        }
        let mut add = |member| strategies.push(Strategy::of(member, tuning));
        if needs_concurrency {
            // States take longest in chronological order.
            if counts_landmarks {
                add(Member::Landmarks);
            }
            add(Member::Chronological);
            if tuning.uses(Technique::Consumables)
                && !relaxed::consumables(self.frame.compiled).is_empty()
            {
                add(Member::Saving);
            }
        }
        if !self.frame.compiled.is_symbolic {
            if tuning.uses(Technique::Width) {
                if counts_landmarks && !needs_concurrency && !has_timed {
                    // Ends at once if there are no landmarks besides the goals. Not used with
                    // deadlines and windows: two instances of satellite with time windows take 11.9
                    // s with it, and 7.3 and 7.6 s without it.
                    add(Member::LandmarkWidth);
                }
                add(Member::Width);
            }
            if counts_landmarks && !needs_concurrency {
                add(Member::Landmarks);
            }
        }
        if serializes && !serializes_early {
            strategies.extend(serializing);
        }
        strategies.push(Strategy::COMPLETE);
        if self.frame.compiled.needs_joining {
            strategies.push(Strategy::JOINING);
        }
        if self.frame.compiled.is_symbolic {
            // Where estimates assume tests that depend on times to hold, the best estimates can
            // lead away from the goal for ever.
            for strategy in strategies.iter_mut().filter(|s| s.is_complete()) {
                *strategy = strategy.counting_steps();
            }
        }
        strategies
    }

    /// Returns `true` if plans may need concurrency: some action provides facts for others only
    /// while it runs, or waits for others before it can end.
    pub(super) fn needs_concurrency(&self) -> bool {
        let compiled = self.frame.compiled;
        let needs = |action: &compile::Action| {
            if action.start == compile::NONE || action.end == compile::NONE {
                return false;
            }
            let (start, end) = (compiled.snap(action.start), compiled.snap(action.end));
            let is_kept = |literal: &Literal| {
                let own = if literal.truth() {
                    &start.adds
                } else {
                    &start.deletes
                };
                action.over_all.literals.contains(literal)
                    || start.condition.literals.contains(literal)
                    || own.contains(&literal.fact())
            };
            let waits = end
                .condition
                .literals
                .iter()
                .any(|literal| !is_kept(literal));
            waits || action.compressibility == Compressibility::Envelope && action.flows.is_empty()
        };
        compiled.tuning.uses(Technique::Chronological)
            && !compiled.is_symbolic
            && compiled.actions.iter().any(needs)
    }
}
