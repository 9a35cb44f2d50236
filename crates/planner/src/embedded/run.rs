//! One run of the planner: the turns of the searches, and the handling of plans.

mod cleanup;
mod improve;
mod memory_limit;
mod parallel;
mod portfolio;
mod refining;
mod worker;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::Task;

use super::answer::{Answer, Counts, Progress, Proof, Stopped};
use super::compile::Compiled;
use super::deadline_explanation::{self, Names};
use super::mutex_pairs::MutexPairs;
use super::relaxed;
use super::root::root;
use super::search::Search;
use super::symmetry::Symmetry;
use super::tuning::Technique;
use improve::SearchSlot;
use memory_limit::memory_of;
use parallel::{Job, ReportCallback, run_parallel};
use refining::LocalSearch;
pub(super) use worker::Frame;
use worker::{Best, Outcome, Report, SearchBudget, Worker};

pub(super) fn none_found(stopped: Stopped, counts: Counts) -> Answer {
    Answer::NoneFound {
        stopped,
        without_self_overlap: false,
        counts,
    }
}

/// Result of the search for a first plan.
enum FirstPlanResult {
    /// No plan exists.
    Proved(Proof),
    /// The run is over, with or without a plan.
    Over,
    /// There is a plan. `turn` is the current search, `budget` the number of turns of each search
    /// in this round.
    Found { turn: usize, budget: u64 },
}

/// State of one run.
pub(super) struct Planner<'a> {
    pub(super) frame: Frame<'a>,
    pub(super) observe: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
    pub(super) symmetry: &'a Symmetry,
    pub(super) names: &'a Names,
    pub(super) progress: Progress,
    /// `true` if some fluent is used up and replenished.
    pub(super) has_reservoirs: bool,
    best: Option<Arc<Best>>,
    /// Number of plans that have been the best one.
    improvement_count: u64,
    /// The reason why the run ends.
    stopped: Option<Stopped>,
    /// The work since the last call of `observe`.
    unreported: u64,
    /// Work of each strand on better plans.
    improvement_work: u64,
    /// Minimum of that work after searches were abandoned for lack of memory.
    least_work: u64,
    /// `true` if an unfinished search was abandoned because the memory was exhausted.
    has_abandoned_search: bool,
    /// The refiners of the best plan.
    refiners: Vec<LocalSearch<'a>>,
    /// The task of the second strand.
    second_task: Option<Task>,
    /// Counts at which the clean-up of the first plan ends. `None` if it has not begun.
    cleanup_limit: Option<Counts>,
}

impl<'a> Planner<'a> {
    pub(super) fn new(
        frame: Frame<'a>,
        (names, symmetry): (&'a Names, &'a Symmetry),
        progress: Progress,
        observe: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Self {
        let compiled = frame.compiled;
        Self {
            frame,
            observe,
            symmetry,
            names,
            progress,
            has_reservoirs: compiled.tuning.uses(Technique::Reservoirs)
                && !relaxed::reservoirs(compiled).is_empty(),
            best: None,
            improvement_count: 0,
            stopped: None,
            unreported: 0,
            improvement_work: 0,
            least_work: 0,
            has_abandoned_search: false,
            refiners: Vec::new(),
            second_task: None,
            cleanup_limit: None,
        }
    }

    pub(super) fn run(mut self) -> Answer {
        let strategies = self.strategies();
        // The others are created at their first turn, since their creation is slow with many
        // actions.
        let mut entrants: Vec<SearchSlot<'_>> =
            strategies.into_iter().map(SearchSlot::new).collect();
        let (turn, budget) = match self.first_plan(&mut entrants) {
            FirstPlanResult::Proved(proof) => {
                let counts = self.progress.counts;
                return Answer::Unsolvable { proof, counts };
            }
            FirstPlanResult::Over => (0, 0),
            FirstPlanResult::Found { turn, budget } => (turn, budget),
        };
        let compiled = self.frame.compiled;
        let mut searches = entrants
            .iter()
            .filter_map(|entrant| entrant.search.as_ref());
        let is_proof = self.stopped == Some(Stopped::Exhausted)
            && compiled.is_exact
            && compiled.incomplete_because.is_none()
            && searches.any(|search| !search.is_incomplete());
        let stopped = match self.stopped {
            Some(stopped) => stopped,
            None if compiled.metric.is_some() => {
                let searches = entrants
                    .iter()
                    .filter_map(|entrant| entrant.search.as_ref());
                let freed: usize = searches.map(|search| search.counts().memory).sum();
                drop(entrants);
                self.progress.counts.memory -= freed;
                self.improve()
            }
            None => {
                if turn + 1 < entrants.len() && entrants.last().is_some_and(|e| e.strategy.joins) {
                    entrants.pop();
                }
                self.run_searches(entrants, (turn, budget))
            }
        };
        self.report_held_back();
        let counts = self.progress.counts;
        match self.best {
            Some(best) => Answer::Plan {
                found: best.found.clone(),
                stopped,
                counts,
            },
            None if is_proof => {
                let states = counts.evaluated;
                let proof = if compiled.excludes_self_overlap() {
                    Proof::WithoutSelfOverlap { states }
                } else {
                    Proof::Exhausted { states }
                };
                Answer::Unsolvable { proof, counts }
            }
            None => Answer::NoneFound {
                stopped,
                without_self_overlap: compiled.excludes_self_overlap(),
                counts,
            },
        }
    }

    /// Searches for a first plan.
    fn first_plan(&mut self, entrants: &mut [SearchSlot<'a>]) -> FirstPlanResult {
        let compiled = self.frame.compiled;
        let tuning = &compiled.tuning;
        self.run_first_search(
            &mut entrants[0],
            SearchBudget::turns(tuning.root_check_after),
        );
        if self.best.is_none()
            && tuning.uses(Technique::DeadEnds)
            && self
                .stopped
                .is_none_or(|stopped| stopped == Stopped::Exhausted)
            && compiled.is_relaxation_exact()
            && let Some(proof) = self.pairs_proof()
        {
            return FirstPlanResult::Proved(proof);
        }
        let search = entrants[0].search.as_ref();
        let mut budget = self.first_budget(search.map_or(0, Search::size));
        let turns = search.map_or(0, |search| share(search, budget, compiled));
        let (mut turn, mut left) = (0, None);
        if self.is_searching() && !entrants[0].is_over {
            // Most problems are solved by then.
            let allowance = SearchBudget {
                turns,
                work: tuning.second_strand_after,
            };
            let (outcome, spent) = self.run_first_search(&mut entrants[0], allowance);
            left = Some(turns.saturating_sub(spent).max(1 + tuning.root_check_after));
            turn = usize::from(outcome != Outcome::WorkDone && outcome != Outcome::Better);
        }
        if self.is_searching() && self.finds_mutex_pairs() && is_stuck(&entrants[0]) {
            // The other searches have not begun yet.
            self.progress.counts.memory -= memory_of(&entrants[0]);
            entrants[0] = SearchSlot::new(entrants[0].strategy);
            (turn, left) = (0, None);
        }
        while self.is_searching() {
            turn = self.round(entrants, turn, (budget, left.filter(|_| turn == 0)));
            if entrants.iter().all(|entrant| entrant.is_over) {
                self.stopped = self.stopped.or(Some(self.stop_reason()));
            }
            if self.is_searching() {
                budget = budget.saturating_mul(2);
                (turn, left) = (0, None);
            }
        }
        if self.stopped == Some(Stopped::FirstPlan) && self.cleans_up() {
            self.clean_up();
        }
        if self.stopped.is_some() {
            return FirstPlanResult::Over;
        }
        if self.is_refining() {
            budget = budget.min(tuning.improving_round);
        }
        FirstPlanResult::Found { turn, budget }
    }

    /// Computes mutex pairs. Returns `true` if there is a spurious action or a dead pair.
    fn finds_mutex_pairs(&mut self) -> bool {
        let Self {
            observe,
            progress,
            frame,
            ..
        } = self;
        let compiled = frame.compiled;
        let tuning = &compiled.tuning;
        if !tuning.uses(Technique::MutexPairs) || compiled.is_symbolic {
            return false;
        }
        let mut may_continue = || observe(progress).is_continue();
        let most_work = tuning.most_mutex_pair_work;
        let find = || MutexPairs::of(compiled, &root(compiled), most_work, &mut may_continue);
        frame.mutex_pairs.get_or_init(find).is_some()
    }

    /// Returns the reason for the end of a run whose searches are all over.
    fn stop_reason(&self) -> Stopped {
        if self.has_abandoned_search {
            Stopped::OutOfMemory
        } else {
            Stopped::Exhausted
        }
    }

    fn is_searching(&self) -> bool {
        self.stopped.is_none() && self.best.is_none()
    }

    /// Returns the number of states per search in the first round. `size` is the number of
    /// operators of an estimate.
    fn first_budget(&self, size: u64) -> u64 {
        let tuning = &self.frame.compiled.tuning;
        let budget = if self.frame.compiled.is_symbolic {
            return tuning.first_round_symbolic;
        } else if self.needs_concurrency() {
            tuning.first_round_with_concurrency
        } else if self.has_reservoirs {
            tuning.first_round_with_reservoirs
        } else {
            tuning.first_round
        };
        let most_work = if self.has_reservoirs {
            tuning.first_round_work_with_reservoirs
        } else {
            tuning.first_round_work
        };
        let most = most_work / (1 + size);
        budget.min(most.max(tuning.root_check_after))
    }

    /// Runs the first search alone until a first plan. Returns its outcome, and the number of turns
    /// that it counts for.
    fn run_first_search(
        &mut self,
        entrant: &mut SearchSlot<'a>,
        allowance: SearchBudget,
    ) -> (Outcome, u64) {
        let (frame, symmetry, unreported) = (self.frame, self.symmetry, self.unreported);
        let search = entrant.search(frame, symmetry);
        let mut base = self.progress.counts;
        let mut on_report = |report| self.process_report(&mut base, report);
        let mut strand = Worker::new(frame, None, unreported, &mut on_report);
        let (outcome, spent, _) = strand.work(search, allowance);
        let is_over = outcome == Outcome::Over;
        let is_all = !search.is_incomplete() && (search.joins() || !frame.compiled.needs_joining);
        self.unreported = strand.end(is_over && is_all);
        entrant.is_over = is_over;
        (outcome, spent)
    }

    /// Runs a round of the searches for a first plan, concurrently, from search `from` until there
    /// is a plan. Returns the search whose turn it was at the end. `left` is the number of turns
    /// left to the search `from`.
    fn round(
        &mut self,
        entrants: &mut [SearchSlot<'a>],
        from: usize,
        (budget, left): (u64, Option<u64>),
    ) -> usize {
        let (frame, symmetry, unreported) = (self.frame, self.symmetry, self.unreported);
        let compiled = frame.compiled;
        // A separate task, because facts are numbered in the order of their first use, which is not
        // deterministic across threads.
        let own_task = self
            .second_task
            .take()
            .unwrap_or_else(|| frame.task.with_own_table());
        let memory: Vec<usize> = entrants.iter().map(memory_of).collect();
        let mut numbers = Vec::new();
        let mut jobs: Vec<Job<'_, (u64, bool)>> = Vec::new();
        for (number, entrant) in entrants.iter_mut().enumerate().skip(from) {
            if entrant.is_over {
                continue;
            }
            numbers.push(number);
            let left = left.filter(|_| number == from);
            let unreported = if jobs.is_empty() { unreported } else { 0 };
            let own_task = (number > 0).then_some(&own_task);
            let budget = budget.saturating_mul(entrant.strategy.share);
            jobs.push(Box::new(move |on_report: ReportCallback<'_>| {
                let own_task = own_task.map(Task::with_own_table);
                let task = own_task.as_ref().unwrap_or(frame.task);
                let search = entrant.search(frame, symmetry);
                let turns = left.unwrap_or_else(|| share(search, budget, compiled));
                let mut strand = Worker::new(Frame { task, ..frame }, None, unreported, on_report);
                let (outcome, _, _) = strand.work(search, SearchBudget::turns(turns));
                let is_over = outcome == Outcome::Over;
                let is_all = !search.is_incomplete() && (search.joins() || !compiled.needs_joining);
                let unreported = strand.end(is_over && is_all);
                (unreported, is_over)
            }));
        }
        let rest = frame.settings.max_memory;
        let rest = rest.saturating_sub(self.progress.counts.memory);
        let ahead = rest / (4 * jobs.len().max(1));
        let (mut base, mut last) = (self.progress.counts, 0);
        let ended = run_parallel(
            jobs,
            (frame.settings.threads, ahead),
            &mut |turn, report| {
                last = turn;
                self.process_report(&mut base, report) && self.is_searching()
            },
        );
        self.second_task = Some(own_task);
        if self.stopped == Some(Stopped::OutOfMemory) {
            let grown = self.progress.counts.memory - base.memory;
            let mut sizes = memory;
            if let Some(&number) = numbers.get(last) {
                sizes[number] += grown;
            }
            self.handle_exhausted_memory(entrants, &numbers[last..], sizes);
            (self.stopped, self.unreported) = (None, 0);
            return 0;
        }
        if !self.is_searching() {
            // With one thread, later searches have not begun. With several threads, their progress
            // is not deterministic.
            let later = numbers.iter().skip(last + 1);
            for &number in later.filter(|_| self.stopped.is_none()) {
                self.progress.counts.memory -= memory[number];
                entrants[number] = SearchSlot::new(entrants[number].strategy);
            }
            return numbers.get(last).copied().unwrap_or(from);
        }
        self.unreported = 0;
        for (number, (unreported, is_over)) in numbers.into_iter().zip(ended) {
            entrants[number].is_over = is_over;
            self.unreported += unreported;
        }
        0
    }

    /// Runs strands, and processes their reports.
    fn run_workers<R: Send>(&mut self, jobs: Vec<Job<'_, R>>) -> Vec<R> {
        let threads = self.frame.settings.threads;
        let mut base = self.progress.counts;
        run_parallel(jobs, (threads, usize::MAX), &mut |_, report| {
            self.process_report(&mut base, report)
        })
    }

    /// Processes a report of a strand. Returns `false` to stop. `base` are the counts before the
    /// strand began.
    fn process_report(&mut self, base: &mut Counts, report: Report) -> bool {
        let (before, done) = (*base, report.counts);
        let counts = &mut self.progress.counts;
        counts.expanded = before.expanded + done.expanded;
        counts.generated = before.generated + done.generated;
        counts.evaluated = before.evaluated + done.evaluated;
        counts.work = before.work + done.work;
        counts.memory = before.memory + done.memory;
        if report.is_last {
            *base = self.progress.counts;
            if report.has_exhausted_space {
                self.stopped = self.stopped.or(Some(Stopped::Exhausted));
            }
            return self.stopped.is_none();
        }
        self.progress.phase = report.phase;
        let is_better = |found: &Arc<Best>, own: Option<&Best>| found.is_better_than(own);
        let found = report
            .found
            .filter(|found| is_better(found, self.best.as_deref()));
        let is_found = found.is_some();
        let mut may_continue = self.report_to_caller(found);
        if !may_continue
            && let Some(pending) = report.pending
            && is_better(&pending, self.best.as_deref())
        {
            self.report_to_caller(Some(pending));
        }
        if !may_continue {
            self.stopped = Some(Stopped::Interrupted);
        } else if is_found && self.is_first_plan_enough() || self.is_cleanup_over() {
            self.stopped = Some(Stopped::FirstPlan);
            may_continue = false;
        } else if self.progress.counts.memory > self.frame.settings.max_memory {
            self.stopped = Some(Stopped::OutOfMemory);
            may_continue = false;
        }
        may_continue
    }

    /// Reports the progress, and a new best plan, to the caller. Returns `false` to stop.
    fn report_to_caller(&mut self, found: Option<Arc<Best>>) -> bool {
        if let Some(found) = found {
            if !self.cleans_up() {
                self.add_to_progress(&found);
            }
            self.best = Some(found);
            self.improvement_count += 1;
        }
        let flow = (self.observe)(&self.progress);
        self.progress.plan = None;
        flow.is_continue()
    }

    /// Adds a new best plan to the next progress report.
    fn add_to_progress(&mut self, found: &Best) {
        self.progress.best = Some(found.found.value.clone());
        self.progress.plan = Some(found.found.clone());
    }

    /// Returns a proof from the bound on pairs. If the caller stops it, the proof names no
    /// deadlines.
    fn pairs_proof(&mut self) -> Option<Proof> {
        let Self {
            observe,
            progress,
            names,
            frame,
            ..
        } = self;
        let mut may_continue = || observe(progress).is_continue();
        deadline_explanation::pairs_proof(names, frame.compiled, &mut may_continue)
    }
}

/// Returns `true` if a search restarts with mutex pairs: it is incomplete, and its best estimate has not improved
/// recently.
fn is_stuck(entrant: &SearchSlot<'_>) -> bool {
    let search = entrant.search.as_ref();
    let makes_no_progress =
        |search: &Search<'_>| search.is_incomplete() && !search.has_improved_recently();
    !entrant.is_over && !entrant.strategy.is_complete() && search.is_some_and(makes_no_progress)
}

/// Returns the number of turns of a search in a round.
fn share(search: &Search<'_>, budget: u64, compiled: &Compiled) -> u64 {
    if search.prunes_unsafely() || compiled.is_symbolic && !search.joins() {
        budget
    } else if search.joins() {
        // Plans that only this search can find are rare.
        budget / (8 * compiled.tuning.incomplete_share.max(1))
    } else {
        budget / compiled.tuning.incomplete_share.max(1)
    }
}
