//! Plans of a better metric, once there is one.
//!
//! A portfolio of searches that weigh costs takes turns. Some go for what costs least to finish,
//! which finds a plan soon; others give what was spent its weight too, which finds cheaper ones.
//! All are bounded by the best plan so far, whoever found it.

use super::super::answer::Stopped;
use super::super::search::{Aim, Search, Strategy};
use super::{Outcome, Planner, share};

/// A search and its strategy; it is made when its first turn comes.
struct Entrant<'a> {
    strategy: Strategy,
    search: Option<Search<'a>>,
    is_over: bool,
}

impl Planner<'_> {
    /// Looks for plans of a better metric until there is none, and then for shorter ones that are
    /// as good. Says why it ended.
    pub(super) fn improve(&mut self) -> Stopped {
        let strategies = self.strategies();
        let mut entrants = Vec::new();
        for aim in [Aim::CostToGo, Aim::WeightedAStar(3), Aim::WeightedAStar(1)] {
            // One of each compression will do.
            let compressing = strategies.iter().filter(|strategy| {
                strategy.compresses.is_some() && strategy.replenishes == self.has_reservoirs
            });
            entrants.extend(compressing.map(|strategy| strategy.towards(aim)));
        }
        entrants.push(Strategy::COMPLETE.towards(Aim::WeightedAStar(1)));
        let stopped = self.compete(entrants);
        let only_grows = self.compiled.metric.as_ref().is_some_and(|m| m.only_grows);
        if stopped != Stopped::Exhausted || !only_grows {
            return stopped;
        }
        let ties = strategies
            .iter()
            .map(|strategy| strategy.towards(Aim::Shortest));
        self.compete(ties.collect())
    }

    /// Lets searches take turns until one that loses nothing has seen everything.
    fn compete(&mut self, strategies: Vec<Strategy>) -> Stopped {
        let (compiled, symmetry) = (self.compiled, self.symmetry);
        let before = self.progress.counts.memory;
        let entrant = |strategy| Entrant {
            strategy,
            search: None,
            is_over: false,
        };
        let mut entrants: Vec<Entrant<'_>> = strategies.into_iter().map(entrant).collect();
        let mut budget = compiled.tuning.improving_round;
        while entrants.iter().any(|entrant| !entrant.is_over) {
            for entrant in entrants.iter_mut().filter(|entrant| !entrant.is_over) {
                let strategy = entrant.strategy;
                let search = entrant
                    .search
                    .get_or_insert_with(|| Search::new(compiled, symmetry, strategy));
                let states = share(search, budget, compiled);
                let mut left = states;
                // Who finds better plans may go on.
                loop {
                    match self.work(search, left) {
                        Outcome::Stop(reason) => return reason,
                        Outcome::Better => left = states,
                        Outcome::BudgetSpent => break,
                        Outcome::Over if search.is_incomplete() => {
                            entrant.is_over = true;
                            break;
                        }
                        Outcome::Over => {
                            self.progress.counts.memory = before;
                            return Stopped::Exhausted;
                        }
                    }
                }
                if let Some(stopped) = self.refine(states) {
                    return stopped;
                }
            }
            budget = budget.saturating_mul(2);
        }
        self.progress.counts.memory = before;
        Stopped::Exhausted
    }
}
