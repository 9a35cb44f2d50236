//! Search for better plans after the first one.
//!
//! Searches take turns. If the metric decides, they differ from those for a first plan: some prefer
//! the states that cost least to finish, which finds a plan soon; others also weigh the cost so
//! far, which finds cheaper ones. All are bounded by the best plan so far.
//!
//! In addition, refiners search for better plans near the best one. The work proceeds in *legs* of
//! counted work. Each leg has at first one strand, a search and then the refiner, and after a while
//! a second strand with another refiner. The strands exchange their plans at the end of a leg. Of
//! equally good plans, the first strand's counts.

use super::super::answer::Stopped;
use super::super::search::{Aim, Search, Strategy};
use super::super::symmetry::Symmetry;
use super::super::tuning::Technique;
use super::refining::Nearby;
use super::side_by_side::{Job, Tell};
use super::strand::{Allowance, Frame, Outcome, Strand};
use super::{Planner, share};

/// Divisor of the memory left by the searches: limit for the repair of each of two strands. Half of
/// it stays free.
const REPAIRS_SHARE: usize = 4;

/// A search and its strategy. The search is created at its first turn.
pub(super) struct Entrant<'a> {
    pub(super) strategy: Strategy,
    pub(super) search: Option<Search<'a>>,
    pub(super) is_over: bool,
}

impl<'a> Entrant<'a> {
    pub(super) fn new(strategy: Strategy) -> Self {
        Self {
            strategy,
            search: None,
            is_over: false,
        }
    }

    /// Returns the search, and creates it if necessary.
    pub(super) fn search(&mut self, frame: Frame<'a>, symmetry: &'a Symmetry) -> &mut Search<'a> {
        let strategy = self.strategy;
        let mutex_pairs = frame.mutex_pairs.get().and_then(Option::as_ref);
        self.search
            .get_or_insert_with(|| Search::new(frame.compiled, (symmetry, mutex_pairs), strategy))
    }
}

/// Searches that take turns.
pub(super) struct Contest<'a> {
    frame: Frame<'a>,
    symmetry: &'a Symmetry,
    pub(super) entrants: Vec<Entrant<'a>>,
    /// Index of the current search.
    current: usize,
    /// Number of turns of each search in this round.
    budget: u64,
    /// Number of turns left to the current search, once it is known.
    left: Option<u64>,
    /// Work that the searches may still do; negative if they have done too much.
    credit: i64,
    /// `true` if the current search has found a plan with a better metric in this turn. It may then
    /// continue without using up credit.
    is_finding: bool,
}

/// Result of a strand: the work since its last report, and the remaining search space.
struct Ended {
    unreported: u64,
    rest: Rest,
}

/// Remaining search space of the searches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rest {
    Something,
    /// Exhausted, but some plans are out of reach of the searches.
    OutOfReach,
    /// Exhausted.
    Nothing,
}

impl<'a> Contest<'a> {
    /// Forgets the current turn, whose search may have been removed.
    pub(super) fn forget_turn(&mut self) {
        (self.left, self.is_finding, self.credit) = (None, false, 0);
    }

    /// Lets searches take turns for at most `most` work. Returns the work done, and the remaining
    /// search space.
    fn go_on(&mut self, strand: &mut Strand<'a, '_>, most: u64) -> (u64, Rest) {
        let compiled = self.frame.compiled;
        let mut done = 0;
        while done < most {
            if self.entrants.iter().all(|entrant| entrant.is_over) {
                return (done, Rest::OutOfReach);
            }
            if self.current == self.entrants.len() {
                self.current = 0;
                self.budget = self.budget.saturating_mul(2);
            }
            let entrant = &mut self.entrants[self.current];
            if entrant.is_over {
                self.current += 1;
                continue;
            }
            let search = entrant.search(self.frame, self.symmetry);
            let turns = share(search, self.budget, compiled);
            let left = self.left.take().unwrap_or(turns);
            let allowance = Allowance {
                turns: left,
                work: most - done,
            };
            let (outcome, spent, work) = strand.work(search, allowance);
            done += work.max(1);
            let finds = outcome == Outcome::Better && compiled.metric.is_some();
            self.is_finding = finds || self.is_finding && outcome == Outcome::WorkDone;
            match outcome {
                Outcome::Stopped => return (done, Rest::Something),
                // A search that finds better plans may continue.
                Outcome::Better => self.left = Some(turns),
                Outcome::WorkDone => self.left = Some(left - spent.min(left)),
                Outcome::TurnsSpent => self.current += 1,
                Outcome::Over if search.is_incomplete() => {
                    entrant.is_over = true;
                    self.current += 1;
                }
                Outcome::Over => return (done, Rest::Nothing),
            }
        }
        (done, Rest::Something)
    }
}

impl<'a> Planner<'a> {
    /// Searches for plans with a better metric until there is none, and then for shorter ones with
    /// the same metric. Returns the reason for its end.
    pub(super) fn improve(&mut self) -> Stopped {
        let strategies = self.strategies();
        let mut entrants = Vec::new();
        for aim in [Aim::CostToGo, Aim::WeightedAStar(3), Aim::WeightedAStar(1)] {
            // One strategy of each compression suffices.
            let compressing = strategies.iter().filter(|strategy| {
                strategy.compresses.is_some() && strategy.replenishes == self.has_reservoirs
            });
            entrants.extend(compressing.map(|strategy| strategy.towards(aim)));
        }
        entrants.push(Strategy::COMPLETE.towards(Aim::WeightedAStar(1)));
        let stopped = self.begin_to_compete(entrants);
        let metric = self.frame.compiled.metric.as_ref();
        if stopped != Stopped::Exhausted || !metric.is_some_and(|metric| metric.only_grows) {
            return stopped;
        }
        let ties = strategies.iter().map(|one| one.towards(Aim::Shortest));
        self.begin_to_compete(ties.collect())
    }

    fn begin_to_compete(&mut self, strategies: Vec<Strategy>) -> Stopped {
        let entrants = strategies.into_iter().map(Entrant::new).collect();
        let before = self.progress.counts.memory;
        let stopped = self.compete(entrants, (0, self.frame.compiled.tuning.improving_round));
        if stopped == Stopped::Exhausted {
            self.progress.counts.memory = before;
        }
        stopped
    }

    /// Lets searches take turns until a complete one has exhausted its space, and meanwhile
    /// searches for better plans near the best one. It begins with the turn of search `first`.
    pub(super) fn compete(
        &mut self,
        entrants: Vec<Entrant<'a>>,
        (first, budget): (usize, u64),
    ) -> Stopped {
        let mut contest = Contest {
            frame: self.frame,
            symmetry: self.symmetry,
            entrants,
            current: first,
            budget,
            left: None,
            credit: 0,
            is_finding: false,
        };
        loop {
            self.keep_room(&mut contest);
            let rest = self.leg(&mut contest);
            if self.clear_room(&mut contest) {
                continue;
            }
            if let Some(stopped) = self.stopped {
                return stopped;
            }
            let is_over = match rest {
                Rest::Something => false,
                // Plans that the searches cannot reach may be found near the best plan.
                Rest::OutOfReach => !self.is_refining() || self.improved_for >= self.least(),
                Rest::Nothing => return Stopped::Exhausted,
            };
            if is_over {
                return self.all_over();
            }
        }
    }

    /// Returns the minimum work of a strand on better plans, if no search has exhausted the
    /// complete space.
    fn least(&self) -> u64 {
        let tuning = &self.frame.compiled.tuning;
        let weight = self.refiners.first().map_or(0, Nearby::weight);
        tuning
            .improving_round
            .saturating_mul(tuning.refining_share_later)
            .saturating_mul(weight)
            .max(self.least_work)
    }

    /// Returns `true` if better plans are searched for near the best one.
    pub(super) fn is_refining(&self) -> bool {
        let tuning = &self.frame.compiled.tuning;
        self.best.is_some()
            && !self.frame.settings.first_plan_only
            && !self.frame.compiled.is_symbolic
            && (tuning.uses(Technique::Rescheduling) || tuning.uses(Technique::Repair))
    }

    /// Runs one leg. Returns the remaining search space.
    fn leg(&mut self, contest: &mut Contest<'a>) -> Rest {
        let compiled = self.frame.compiled;
        let tuning = &compiled.tuning;
        let (frame, newest, unreported) = (self.frame, self.finds, self.unreported);
        if !self.is_refining() {
            let best = self.best.clone();
            let mut ended = self.hear_all(vec![Box::new(move |tell: Tell<'_>| {
                let mut strand = Strand::new(frame, best, unreported, tell);
                let (_, rest) = contest.go_on(&mut strand, u64::MAX);
                Ended {
                    unreported: strand.end(false),
                    rest,
                }
            })]);
            return ended.pop().map_or(Rest::Something, |ended| ended.rest);
        }
        let mut refiners = std::mem::take(&mut self.refiners);
        let own_task = self.own_task.take();
        if refiners.is_empty() {
            refiners.push(Nearby::new(compiled, 1));
        }
        let has_second = self.improved_for >= tuning.second_strand_after;
        if has_second && refiners.len() == 1 {
            refiners.push(Nearby::new(compiled, 2));
        }
        // A repair frees its memory at its end, so this memory is not part of the counts.
        let room = frame.settings.max_memory;
        let room = room.saturating_sub(self.progress.counts.memory) / REPAIRS_SHARE;
        for refiner in &mut refiners {
            refiner.limit_memory(room);
        }
        let doubled = tuning.first_leg.saturating_add(self.improved_for);
        let length = doubled.min(tuning.leg);
        let strands = 1 + u64::from(has_second);
        let own = strands * length / (1 + refiners[0].share());
        contest.credit = contest.credit.saturating_add_unsigned(own);
        // A separate task, because facts are numbered in the order of their first use, which is not
        // deterministic across threads.
        let own_task = has_second.then(|| own_task.unwrap_or_else(|| frame.task.with_own_table()));
        let (first, others) = refiners.split_at_mut(1);
        let first = &mut first[0];
        let best = self.best.clone();
        let mut jobs: Vec<Job<'_, Ended>> = vec![Box::new(move |tell: Tell<'_>| {
            let mut strand = Strand::new(frame, best, unreported, tell);
            let (mut work, mut rest) = (0, Rest::Something);
            if contest.is_finding {
                (work, rest) = contest.go_on(&mut strand, length);
            } else if let Ok(most) = u64::try_from(contest.credit)
                && most > 0
            {
                (work, rest) = contest.go_on(&mut strand, most);
                contest.credit = contest.credit.saturating_sub_unsigned(work);
            }
            if !strand.is_stopped && rest != Rest::Nothing {
                strand.refine(first, newest, length.saturating_sub(work));
            }
            Ended {
                unreported: strand.end(false),
                rest,
            }
        })];
        if let (Some(second), Some(task)) = (others.first_mut(), &own_task) {
            let frame = Frame { task, ..frame };
            let best = self.best.clone();
            jobs.push(Box::new(move |tell: Tell<'_>| {
                let mut strand = Strand::new(frame, best, 0, tell);
                strand.refine(second, newest, length);
                Ended {
                    unreported: strand.end(false),
                    rest: Rest::Something,
                }
            }));
        }
        let ended = self.hear_all(jobs);
        self.unreported = ended.iter().map(|ended| ended.unreported).sum();
        self.improved_for = self.improved_for.saturating_add(length);
        self.refiners = refiners;
        self.own_task = own_task;
        ended.first().map_or(Rest::Something, |ended| ended.rest)
    }
}
