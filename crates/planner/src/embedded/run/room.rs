//! Handling of exhausted memory: the search that uses the most is abandoned, so that the others can
//! continue.
//!
//! The choice must not depend on the number of threads. So it uses the reported sizes only.
//! Searches whose turn had not come, and the one that was stopped, may have progressed further.

use super::super::answer::Stopped;
use super::Planner;
use super::improve::{Contest, Entrant};

/// Memory limit in eighths: searches for better plans are abandoned before the memory is exhausted,
/// so that none has to be stopped.
const FULL: usize = 7;

/// Returns the memory of the search.
pub(super) fn taken(entrant: &Entrant<'_>) -> usize {
    let search = entrant.search.as_ref();
    search.map_or(0, |search| search.counts().memory)
}

/// Returns the index of the largest positive size; of equal ones, the first.
fn largest(sizes: impl Iterator<Item = usize>) -> Option<usize> {
    let taken = sizes.enumerate().filter(|&(_, size)| size > 0);
    taken
        .max_by_key(|&(place, size)| (size, std::cmp::Reverse(place)))
        .map(|(place, _)| place)
}

impl<'a> Planner<'a> {
    /// Handles memory that was exhausted in the turn of the first of `running`; the rest of them
    /// come later. Abandons the largest search and restarts the others of these. `sizes` are the
    /// reported sizes.
    pub(super) fn make_room(
        &mut self,
        entrants: &mut [Entrant<'a>],
        running: &[usize],
        mut sizes: Vec<usize>,
    ) {
        for (number, entrant) in entrants.iter_mut().enumerate() {
            if running.contains(&number) {
                *entrant = Entrant::new(entrant.strategy);
            } else {
                sizes[number] = taken(entrant);
            }
        }
        if let Some(number) = largest(sizes.into_iter()) {
            self.give_way(&mut entrants[number]);
        }
        self.progress.counts.memory = entrants.iter().map(taken).sum();
    }

    /// Abandons searches for better plans while little memory is left, if refiners continue. After
    /// all searches are over, the refiners get at least as much work again as they have had.
    pub(super) fn keep_room(&mut self, contest: &mut Contest<'a>) {
        let most = self.frame.settings.max_memory / 8 * FULL;
        while self.is_refining()
            && self.progress.counts.memory > most
            && let Some(number) = largest(contest.entrants.iter().map(taken))
        {
            let entrant = &mut contest.entrants[number];
            self.progress.counts.memory -= taken(entrant);
            self.give_way(entrant);
            contest.forget_turn();
            self.least_work = self.least_work.max(self.improved_for.saturating_mul(2));
        }
    }

    /// Handles memory that was exhausted in a leg. Since the state of the stopped search is not
    /// deterministic, all searches are abandoned, and the refiners restart. Returns `false` if this
    /// is not possible.
    pub(super) fn clear_room(&mut self, contest: &mut Contest<'a>) -> bool {
        let mut entrants = contest.entrants.iter();
        if self.stopped != Some(Stopped::OutOfMemory)
            || !self.is_refining()
            || entrants.all(|entrant| entrant.is_over)
        {
            return false;
        }
        for entrant in &mut contest.entrants {
            self.give_way(entrant);
        }
        contest.forget_turn();
        self.refiners.clear();
        self.progress.counts.memory = 0;
        self.stopped = None;
        self.least_work = self.least_work.max(self.improved_for.saturating_mul(2));
        true
    }

    fn give_way(&mut self, entrant: &mut Entrant<'a>) {
        self.has_given_up |= !entrant.is_over;
        *entrant = Entrant {
            is_over: true,
            ..Entrant::new(entrant.strategy)
        };
    }
}
