//! Handling of exhausted memory: the search that uses the most is abandoned, so that the others can
//! continue.
//!
//! The choice must not depend on the number of threads. So it uses the reported sizes only.
//! Searches whose turn had not come, and the one that was stopped, may have progressed further.

use super::super::answer::Stopped;
use super::Planner;
use super::improve::{SearchPool, SearchSlot};

/// Memory limit in eighths: searches for better plans are abandoned before the memory is exhausted,
/// so that none has to be stopped.
const FULL_SHARE: usize = 7;

/// Returns the memory of the search.
pub(super) fn memory_of(entrant: &SearchSlot<'_>) -> usize {
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
    pub(super) fn handle_exhausted_memory(
        &mut self,
        entrants: &mut [SearchSlot<'a>],
        running: &[usize],
        mut sizes: Vec<usize>,
    ) {
        for (number, entrant) in entrants.iter_mut().enumerate() {
            if running.contains(&number) {
                *entrant = SearchSlot::new(entrant.strategy);
            } else {
                sizes[number] = memory_of(entrant);
            }
        }
        if let Some(number) = largest(sizes.into_iter()) {
            self.abandon_search(&mut entrants[number]);
        }
        self.progress.counts.memory = entrants.iter().map(memory_of).sum();
    }

    /// Abandons searches for better plans while little memory is left, if refiners continue. After
    /// all searches are over, the refiners get at least as much work again as they have had.
    pub(super) fn reserve_memory(&mut self, contest: &mut SearchPool<'a>) {
        let most = self.frame.settings.max_memory / 8 * FULL_SHARE;
        while self.is_refining()
            && self.progress.counts.memory > most
            && let Some(number) = largest(contest.slots.iter().map(memory_of))
        {
            let entrant = &mut contest.slots[number];
            self.progress.counts.memory -= memory_of(entrant);
            self.abandon_search(entrant);
            contest.forget_turn();
            self.least_work = self.least_work.max(self.improvement_work.saturating_mul(2));
        }
    }

    /// Handles memory that was exhausted in a leg. Since the state of the stopped search is not
    /// deterministic, all searches are abandoned, and the refiners restart. Returns `false` if this
    /// is not possible.
    pub(super) fn abandon_all_searches(&mut self, contest: &mut SearchPool<'a>) -> bool {
        let mut entrants = contest.slots.iter();
        if self.stopped != Some(Stopped::OutOfMemory)
            || !self.is_refining()
            || entrants.all(|entrant| entrant.is_over)
        {
            return false;
        }
        for entrant in &mut contest.slots {
            self.abandon_search(entrant);
        }
        contest.forget_turn();
        self.refiners.clear();
        self.progress.counts.memory = 0;
        self.stopped = None;
        self.least_work = self.least_work.max(self.improvement_work.saturating_mul(2));
        true
    }

    fn abandon_search(&mut self, entrant: &mut SearchSlot<'a>) {
        self.has_abandoned_search |= !entrant.is_over;
        *entrant = SearchSlot {
            is_over: true,
            ..SearchSlot::new(entrant.strategy)
        };
    }
}
