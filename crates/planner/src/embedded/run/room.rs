//! What becomes of the searches when the memory is used up: the one that has taken the most gives
//! way, so that the others can go on.
//!
//! Which one that is must not depend on the number of threads. So it is told by what has been heard
//! of them: those whose turn had not come, and the one that was stopped, may be further.

use super::super::answer::Stopped;
use super::Planner;
use super::improve::{Contest, Entrant};

/// Of the memory, in eighths: searches for better plans give way before it is used up, so that none
/// has to be stopped.
const FULL: usize = 7;

/// The memory that its search takes.
pub(super) fn taken(entrant: &Entrant<'_>) -> usize {
    let search = entrant.search.as_ref();
    search.map_or(0, |search| search.counts().memory)
}

/// The place of the largest, the first one of equals, if anything is taken.
fn largest(sizes: impl Iterator<Item = usize>) -> Option<usize> {
    let taken = sizes.enumerate().filter(|&(_, size)| size > 0);
    taken
        .max_by_key(|&(place, size)| (size, std::cmp::Reverse(place)))
        .map(|(place, _)| place)
}

impl<'a> Planner<'a> {
    /// The memory was used up in the turn of the first of `running`; the rest of them come later. The largest
    /// search gives way, and the others of these begin anew. `sizes`: what has been heard of how much they take.
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

    /// Lets searches for better plans give way while there is little memory left, if something else goes on:
    /// for as long again as it has, once all searches are over.
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

    /// The memory was used up in a leg all the same, and what was stopped there may be anywhere: all searches
    /// give way, and the search near the best plan begins anew. Whether that is possible.
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
