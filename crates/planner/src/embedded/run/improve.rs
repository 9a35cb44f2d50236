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
use super::parallel::{Job, ReportCallback};
use super::refining::LocalSearch;
use super::worker::{Frame, Outcome, SearchBudget, Worker};
use super::{Planner, share};

/// Divisor of the memory left by the searches: limit for the repair of each of two strands. Half of
/// it stays free.
const REPAIRS_SHARE: usize = 4;

/// A search and its strategy. The search is created at its first turn.
pub(super) struct SearchSlot<'a> {
    pub(super) strategy: Strategy,
    pub(super) search: Option<Search<'a>>,
    pub(super) is_over: bool,
}

impl<'a> SearchSlot<'a> {
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
pub(super) struct SearchPool<'a> {
    frame: Frame<'a>,
    symmetry: &'a Symmetry,
    pub(super) slots: Vec<SearchSlot<'a>>,
    /// Index of the current search.
    current: usize,
    /// Number of turns of each search in this round.
    budget: u64,
    /// Number of turns left to the current search, once it is known.
    remaining_turns: Option<u64>,
    /// Work that the searches may still do; negative if they have done too much.
    credit: i64,
    /// `true` if the current search has found a plan with a better metric in this turn. It may then
    /// continue without using up credit.
    is_finding: bool,
}

/// Result of a strand: the work since its last report, and the remaining search space.
struct WorkerResult {
    unreported: u64,
    remaining: RemainingSpace,
}

/// Remaining search space of the searches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RemainingSpace {
    Unexplored,
    /// Exhausted, but some plans are out of reach of the searches.
    ExhaustedIncomplete,
    /// Exhausted.
    Exhausted,
}

impl<'a> SearchPool<'a> {
    /// Forgets the current turn, whose search may have been removed.
    pub(super) fn forget_turn(&mut self) {
        (self.remaining_turns, self.is_finding, self.credit) = (None, false, 0);
    }

    /// Lets searches take turns for at most `most` work. Returns the work done, and the remaining
    /// search space.
    fn run_turns(&mut self, strand: &mut Worker<'a, '_>, most: u64) -> (u64, RemainingSpace) {
        let compiled = self.frame.compiled;
        let mut done = 0;
        while done < most {
            if self.slots.iter().all(|entrant| entrant.is_over) {
                return (done, RemainingSpace::ExhaustedIncomplete);
            }
            if self.current == self.slots.len() {
                self.current = 0;
                self.budget = self.budget.saturating_mul(2);
            }
            let entrant = &mut self.slots[self.current];
            if entrant.is_over {
                self.current += 1;
                continue;
            }
            let search = entrant.search(self.frame, self.symmetry);
            let turns = share(search, self.budget, compiled);
            let left = self.remaining_turns.take().unwrap_or(turns);
            let allowance = SearchBudget {
                turns: left,
                work: most - done,
            };
            let (outcome, spent, work) = strand.work(search, allowance);
            done += work.max(1);
            let finds = outcome == Outcome::Better && compiled.metric.is_some();
            self.is_finding = finds || self.is_finding && outcome == Outcome::WorkDone;
            match outcome {
                Outcome::Stopped => return (done, RemainingSpace::Unexplored),
                // A search that finds better plans may continue.
                Outcome::Better => self.remaining_turns = Some(turns),
                Outcome::WorkDone => self.remaining_turns = Some(left - spent.min(left)),
                Outcome::TurnsSpent => self.current += 1,
                Outcome::Over if search.is_incomplete() => {
                    entrant.is_over = true;
                    self.current += 1;
                }
                Outcome::Over => return (done, RemainingSpace::Exhausted),
            }
        }
        (done, RemainingSpace::Unexplored)
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
                strategy.compresses.is_some()
                    && !strategy.serializes_goals
                    && strategy.replenishes == self.has_reservoirs
            });
            entrants.extend(compressing.map(|strategy| strategy.with_aim(aim)));
        }
        entrants.push(Strategy::COMPLETE.with_aim(Aim::WeightedAStar(1)));
        let stopped = self.start_searches(entrants);
        let metric = self.frame.compiled.metric.as_ref();
        if stopped != Stopped::Exhausted || !metric.is_some_and(|metric| metric.only_grows) {
            return stopped;
        }
        let ties = strategies.iter().map(|one| one.with_aim(Aim::Shortest));
        self.start_searches(ties.collect())
    }

    fn start_searches(&mut self, strategies: Vec<Strategy>) -> Stopped {
        let entrants = strategies.into_iter().map(SearchSlot::new).collect();
        let before = self.progress.counts.memory;
        let stopped = self.run_searches(entrants, (0, self.frame.compiled.tuning.improving_round));
        if stopped == Stopped::Exhausted {
            self.progress.counts.memory = before;
        }
        stopped
    }

    /// Lets searches take turns until a complete one has exhausted its space, and meanwhile
    /// searches for better plans near the best one. It begins with the turn of search `first`.
    pub(super) fn run_searches(
        &mut self,
        entrants: Vec<SearchSlot<'a>>,
        (first, budget): (usize, u64),
    ) -> Stopped {
        let mut contest = SearchPool {
            frame: self.frame,
            symmetry: self.symmetry,
            slots: entrants,
            current: first,
            budget,
            remaining_turns: None,
            credit: 0,
            is_finding: false,
        };
        loop {
            self.reserve_memory(&mut contest);
            let rest = self.leg(&mut contest);
            if self.abandon_all_searches(&mut contest) {
                continue;
            }
            if let Some(stopped) = self.stopped {
                return stopped;
            }
            let is_over = match rest {
                RemainingSpace::Unexplored => false,
                // Plans that the searches cannot reach may be found near the best plan.
                RemainingSpace::ExhaustedIncomplete => {
                    !self.is_refining() || self.improvement_work >= self.least()
                }
                RemainingSpace::Exhausted => return Stopped::Exhausted,
            };
            if is_over {
                return self.stop_reason();
            }
        }
    }

    /// Returns the minimum work of a strand on better plans, if no search has exhausted the
    /// complete space.
    fn least(&self) -> u64 {
        let tuning = &self.frame.compiled.tuning;
        let weight = self.refiners.first().map_or(0, LocalSearch::weight);
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
    fn leg(&mut self, contest: &mut SearchPool<'a>) -> RemainingSpace {
        let compiled = self.frame.compiled;
        let tuning = &compiled.tuning;
        let (frame, newest, unreported) = (self.frame, self.improvement_count, self.unreported);
        if !self.is_refining() {
            let best = self.best.clone();
            let mut ended =
                self.run_workers(vec![Box::new(move |on_report: ReportCallback<'_>| {
                    let mut strand = Worker::new(frame, best, unreported, on_report);
                    let (_, rest) = contest.run_turns(&mut strand, u64::MAX);
                    WorkerResult {
                        unreported: strand.end(false),
                        remaining: rest,
                    }
                })]);
            return ended
                .pop()
                .map_or(RemainingSpace::Unexplored, |ended| ended.remaining);
        }
        let mut refiners = std::mem::take(&mut self.refiners);
        let own_task = self.second_task.take();
        if refiners.is_empty() {
            refiners.push(LocalSearch::new(compiled, 1));
        }
        let has_second = self.improvement_work >= tuning.second_strand_after;
        if has_second && refiners.len() == 1 {
            refiners.push(LocalSearch::new(compiled, 2));
        }
        // A repair frees its memory when it ends, so `counts.memory` does not include it.
        let room = frame.settings.max_memory;
        let room = room.saturating_sub(self.progress.counts.memory) / REPAIRS_SHARE;
        for refiner in &mut refiners {
            refiner.limit_memory(room);
        }
        let doubled = tuning.first_leg.saturating_add(self.improvement_work);
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
        let mut jobs: Vec<Job<'_, WorkerResult>> =
            vec![Box::new(move |on_report: ReportCallback<'_>| {
                let mut strand = Worker::new(frame, best, unreported, on_report);
                let (mut work, mut rest) = (0, RemainingSpace::Unexplored);
                if contest.is_finding {
                    (work, rest) = contest.run_turns(&mut strand, length);
                } else if let Ok(most) = u64::try_from(contest.credit)
                    && most > 0
                {
                    (work, rest) = contest.run_turns(&mut strand, most);
                    contest.credit = contest.credit.saturating_sub_unsigned(work);
                }
                if !strand.is_stopped && rest != RemainingSpace::Exhausted {
                    strand.refine(first, newest, length.saturating_sub(work));
                }
                WorkerResult {
                    unreported: strand.end(false),
                    remaining: rest,
                }
            })];
        if let (Some(second), Some(task)) = (others.first_mut(), &own_task) {
            let frame = Frame { task, ..frame };
            let best = self.best.clone();
            jobs.push(Box::new(move |on_report: ReportCallback<'_>| {
                let mut strand = Worker::new(frame, best, 0, on_report);
                strand.refine(second, newest, length);
                WorkerResult {
                    unreported: strand.end(false),
                    remaining: RemainingSpace::Unexplored,
                }
            }));
        }
        let ended = self.run_workers(jobs);
        self.unreported = ended.iter().map(|ended| ended.unreported).sum();
        self.improvement_work = self.improvement_work.saturating_add(length);
        self.refiners = refiners;
        self.second_task = own_task;
        ended
            .first()
            .map_or(RemainingSpace::Unexplored, |ended| ended.remaining)
    }
}
