//! One run of the planner: the turns of the searches, and the handling of plans.

mod cleanup;
mod improve;
mod portfolio;
mod refining;
mod room;
mod side_by_side;
mod strand;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::Task;

use super::answer::{Answer, Counts, Progress, Proof, Stopped};
use super::compile::Compiled;
use super::mutex_pairs::MutexPairs;
use super::reasons::{self, Names};
use super::relaxed;
use super::root::root;
use super::search::Search;
use super::symmetry::Symmetry;
use super::tuning::Technique;
use improve::Entrant;
use refining::Nearby;
use room::taken;
use side_by_side::{Job, Tell, side_by_side};
pub(super) use strand::Frame;
use strand::{Allowance, Best, Outcome, Report, Strand};

pub(super) fn none_found(stopped: Stopped, counts: Counts) -> Answer {
    Answer::NoneFound {
        stopped,
        without_self_overlap: false,
        counts,
    }
}

/// Result of the search for a first plan.
enum First {
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
    finds: u64,
    /// The reason why the run ends.
    stopped: Option<Stopped>,
    /// The work since the last call of `observe`.
    unreported: u64,
    /// Work of each strand on better plans.
    improved_for: u64,
    /// Minimum of that work after searches were abandoned for lack of memory.
    least_work: u64,
    /// `true` if an unfinished search was abandoned because the memory was exhausted.
    has_given_up: bool,
    /// The refiners of the best plan.
    refiners: Vec<Nearby<'a>>,
    /// The task of the second strand.
    own_task: Option<Task>,
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
            finds: 0,
            stopped: None,
            unreported: 0,
            improved_for: 0,
            least_work: 0,
            has_given_up: false,
            refiners: Vec::new(),
            own_task: None,
            cleanup_limit: None,
        }
    }

    pub(super) fn run(mut self) -> Answer {
        let strategies = self.strategies();
        // The others are created at their first turn, since their creation is slow with many
        // actions.
        let mut entrants: Vec<Entrant<'_>> = strategies.into_iter().map(Entrant::new).collect();
        let (turn, budget) = match self.first_plan(&mut entrants) {
            First::Proved(proof) => {
                let counts = self.progress.counts;
                return Answer::Unsolvable { proof, counts };
            }
            First::Over => (0, 0),
            First::Found { turn, budget } => (turn, budget),
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
                self.compete(entrants, (turn, budget))
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
    fn first_plan(&mut self, entrants: &mut [Entrant<'a>]) -> First {
        let compiled = self.frame.compiled;
        let tuning = &compiled.tuning;
        self.begin(&mut entrants[0], Allowance::turns(tuning.root_check_after));
        if self.best.is_none()
            && tuning.uses(Technique::DeadEnds)
            && self
                .stopped
                .is_none_or(|stopped| stopped == Stopped::Exhausted)
            && compiled.is_relaxation_exact()
            && let Some(proof) = self.pairs_proof()
        {
            return First::Proved(proof);
        }
        let search = entrants[0].search.as_ref();
        let mut budget = self.first_budget(search.map_or(0, Search::size));
        let turns = search.map_or(0, |search| share(search, budget, compiled));
        let (mut turn, mut left) = (0, None);
        if self.is_looking() && !entrants[0].is_over {
            // Most problems are solved by then.
            let allowance = Allowance {
                turns,
                work: tuning.second_strand_after,
            };
            let (outcome, spent) = self.begin(&mut entrants[0], allowance);
            left = Some(turns.saturating_sub(spent).max(1 + tuning.root_check_after));
            turn = usize::from(outcome != Outcome::WorkDone && outcome != Outcome::Better);
        }
        if self.is_looking() && self.finds_mutex_pairs() && is_stuck(&entrants[0]) {
            // The other searches have not begun yet.
            self.progress.counts.memory -= taken(&entrants[0]);
            entrants[0] = Entrant::new(entrants[0].strategy);
            (turn, left) = (0, None);
        }
        while self.is_looking() {
            turn = self.round(entrants, turn, (budget, left.filter(|_| turn == 0)));
            if entrants.iter().all(|entrant| entrant.is_over) {
                self.stopped = self.stopped.or(Some(self.all_over()));
            }
            if self.is_looking() {
                budget = budget.saturating_mul(2);
                (turn, left) = (0, None);
            }
        }
        if self.stopped == Some(Stopped::FirstPlan) && self.cleans_up() {
            self.clean_up();
        }
        if self.stopped.is_some() {
            return First::Over;
        }
        if self.is_refining() {
            budget = budget.min(tuning.improving_round);
        }
        First::Found { turn, budget }
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
        let mut goes_on = || observe(progress).is_continue();
        let most_work = tuning.most_mutex_pair_work;
        let find = || MutexPairs::of(compiled, &root(compiled), most_work, &mut goes_on);
        frame.mutex_pairs.get_or_init(find).is_some()
    }

    /// Returns the reason for the end of a run whose searches are all over.
    fn all_over(&self) -> Stopped {
        if self.has_given_up {
            Stopped::OutOfMemory
        } else {
            Stopped::Exhausted
        }
    }

    fn is_looking(&self) -> bool {
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
        // If there are reservoirs, the first search replenishes them, and has by far the best
        // chance.
        if self.has_reservoirs {
            return budget;
        }
        let most = tuning.first_round_work / (1 + size);
        budget.min(most.max(tuning.root_check_after))
    }

    /// Runs the first search alone until a first plan. Returns its outcome, and the number of turns
    /// that it counts for.
    fn begin(&mut self, entrant: &mut Entrant<'a>, allowance: Allowance) -> (Outcome, u64) {
        let (frame, symmetry, unreported) = (self.frame, self.symmetry, self.unreported);
        let search = entrant.search(frame, symmetry);
        let mut base = self.progress.counts;
        let mut hear = |report| self.hear(&mut base, report);
        let mut strand = Strand::new(frame, None, unreported, &mut hear);
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
        entrants: &mut [Entrant<'a>],
        from: usize,
        (budget, left): (u64, Option<u64>),
    ) -> usize {
        let (frame, symmetry, unreported) = (self.frame, self.symmetry, self.unreported);
        let compiled = frame.compiled;
        // A separate task, because facts are numbered in the order of their first use, which is not
        // deterministic across threads.
        let own_task = self
            .own_task
            .take()
            .unwrap_or_else(|| frame.task.with_own_table());
        let memory: Vec<usize> = entrants.iter().map(taken).collect();
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
            jobs.push(Box::new(move |tell: Tell<'_>| {
                let own_task = own_task.map(Task::with_own_table);
                let task = own_task.as_ref().unwrap_or(frame.task);
                let search = entrant.search(frame, symmetry);
                let turns = left.unwrap_or_else(|| share(search, budget, compiled));
                let mut strand = Strand::new(Frame { task, ..frame }, None, unreported, tell);
                let (outcome, _, _) = strand.work(search, Allowance::turns(turns));
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
        let ended = side_by_side(
            jobs,
            (frame.settings.threads, ahead),
            &mut |turn, report| {
                last = turn;
                self.hear(&mut base, report) && self.is_looking()
            },
        );
        self.own_task = Some(own_task);
        if self.stopped == Some(Stopped::OutOfMemory) {
            let grown = self.progress.counts.memory - base.memory;
            let mut sizes = memory;
            if let Some(&number) = numbers.get(last) {
                sizes[number] += grown;
            }
            self.make_room(entrants, &numbers[last..], sizes);
            (self.stopped, self.unreported) = (None, 0);
            return 0;
        }
        if !self.is_looking() {
            // With one thread, later searches have not begun. With several threads, their progress
            // is not deterministic.
            let later = numbers.iter().skip(last + 1);
            for &number in later.filter(|_| self.stopped.is_none()) {
                self.progress.counts.memory -= memory[number];
                entrants[number] = Entrant::new(entrants[number].strategy);
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
    fn hear_all<R: Send>(&mut self, jobs: Vec<Job<'_, R>>) -> Vec<R> {
        let threads = self.frame.settings.threads;
        let mut base = self.progress.counts;
        side_by_side(jobs, (threads, usize::MAX), &mut |_, report| {
            self.hear(&mut base, report)
        })
    }

    /// Processes a report of a strand. Returns `false` to stop. `base` are the counts before the
    /// strand began.
    fn hear(&mut self, base: &mut Counts, report: Report) -> bool {
        let (before, done) = (*base, report.counts);
        let counts = &mut self.progress.counts;
        counts.expanded = before.expanded + done.expanded;
        counts.generated = before.generated + done.generated;
        counts.evaluated = before.evaluated + done.evaluated;
        counts.work = before.work + done.work;
        counts.memory = before.memory + done.memory;
        if report.is_last {
            *base = self.progress.counts;
            if report.has_seen_everything {
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
        let mut goes_on = self.tell(found);
        if !goes_on
            && let Some(pending) = report.pending
            && is_better(&pending, self.best.as_deref())
        {
            self.tell(Some(pending));
        }
        if !goes_on {
            self.stopped = Some(Stopped::Interrupted);
        } else if is_found && self.is_first_plan_enough() || self.is_cleanup_over() {
            self.stopped = Some(Stopped::FirstPlan);
            goes_on = false;
        } else if self.progress.counts.memory > self.frame.settings.max_memory {
            self.stopped = Some(Stopped::OutOfMemory);
            goes_on = false;
        }
        goes_on
    }

    /// Reports the progress, and a new best plan, to the caller. Returns `false` to stop.
    fn tell(&mut self, found: Option<Arc<Best>>) -> bool {
        if let Some(found) = found {
            if !self.cleans_up() {
                self.show(&found);
            }
            self.best = Some(found);
            self.finds += 1;
        }
        let flow = (self.observe)(&self.progress);
        self.progress.plan = None;
        flow.is_continue()
    }

    /// Adds a new best plan to the next progress report.
    fn show(&mut self, found: &Best) {
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
        let mut goes_on = || observe(progress).is_continue();
        reasons::pairs_proof(names, frame.compiled, &mut goes_on)
    }
}

/// Returns `true` if a search restarts with mutex pairs: it is incomplete, and its best estimate has not improved
/// recently.
fn is_stuck(entrant: &Entrant<'_>) -> bool {
    let search = entrant.search.as_ref();
    let makes_no_progress =
        |search: &Search<'_>| search.is_incomplete() && !search.has_come_nearer();
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
