//! Plans of a better metric, once there is one.
//!
//! A portfolio of searches that weigh costs takes turns. Some go for what costs least to finish,
//! which finds a plan soon; others give what was spent its weight too, which finds cheaper ones.
//! All are bounded by the best plan so far, whoever found it.

use super::super::answer::Stopped;
use super::super::search::{Aim, Search, Style};
use super::{Outcome, Planner, share};

/// How many states a search looks at in the first round; twice as many in the next, and so on.
const FIRST_ROUND: u64 = 4096;

/// A search and its style; it is made when its first turn comes.
struct Entrant<'a> {
    style: Style,
    search: Option<Search<'a>>,
    is_over: bool,
}

impl Planner<'_> {
    /// Looks for plans of a better metric until there is none, and then for shorter ones that are
    /// as good. Says why it ended.
    pub(super) fn improve(&mut self) -> Stopped {
        let styles = self.styles();
        let mut entrants = Vec::new();
        for aim in [Aim::CheapRest, Aim::CheapWhole(3), Aim::CheapWhole(1)] {
            // One of each haste will do.
            let hasty = styles
                .iter()
                .filter(|style| style.haste.is_some() && style.fills_up == self.has_resources);
            entrants.extend(hasty.map(|style| style.towards(aim)));
        }
        entrants.push(Style::COMPLETE.towards(Aim::CheapWhole(1)));
        let stopped = self.compete(entrants);
        let only_grows = self.compiled.metric.as_ref().is_some_and(|m| m.only_grows);
        if stopped != Stopped::Exhausted || !only_grows {
            return stopped;
        }
        let ties = styles.iter().map(|style| style.towards(Aim::Shortest));
        self.compete(ties.collect())
    }

    /// Lets searches take turns until one that loses nothing has seen everything.
    fn compete(&mut self, styles: Vec<Style>) -> Stopped {
        let (compiled, symmetry) = (self.compiled, self.symmetry);
        let before = self.progress.counts.memory;
        let entrant = |style| Entrant {
            style,
            search: None,
            is_over: false,
        };
        let mut entrants: Vec<Entrant<'_>> = styles.into_iter().map(entrant).collect();
        let mut budget = FIRST_ROUND;
        while entrants.iter().any(|entrant| !entrant.is_over) {
            for entrant in entrants.iter_mut().filter(|entrant| !entrant.is_over) {
                let style = entrant.style;
                let search = entrant
                    .search
                    .get_or_insert_with(|| Search::new(compiled, symmetry, style));
                let mut left = share(search, budget);
                // Who finds better plans may go on.
                loop {
                    match self.work(search, left) {
                        Outcome::Stop(reason) => return reason,
                        Outcome::Better => left = share(search, budget),
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
            }
            budget = budget.saturating_mul(2);
        }
        self.progress.counts.memory = before;
        Stopped::Exhausted
    }
}
