//! A strand of the work: a search, or what makes better plans of the best one, for a while. It knows
//! the best plan that there was when it began, and tells others of its own plans by reports.

use std::sync::{Arc, OnceLock};

use elbowroom_model::validate::{self, Verdict};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan, validate_from};
use elbowroom_num::work;

use super::super::answer::{Counts, Found, Objective, Phase, Settings};
use super::super::apply::Step;
use super::super::bound::MetricBound;
use super::super::compile::Compiled;
use super::super::course::{delayed, judged_without_observers};
use super::super::extract;
use super::super::mutex_pairs::MutexPairs;
use super::super::needless::without_needless;
use super::super::search::{Aim, Search, Turn};
use super::side_by_side::Tell;

/// How much work lies between two reports, in operators of estimates and what they change: about ten
/// milliseconds.
const REPORT_WORK: u64 = 2_000_000;

/// Work that is counted for a turn of a search: a state is made, compared and stored.
const TURN_WORK: u64 = 8_000;

/// Work that is counted for an operator of an estimate.
pub(super) const OPERATOR_WORK: u64 = 5;

/// The number of looked-up pairs that lie between two reports at most: some milliseconds.
const REPORT_LOOKUPS: u64 = 4_000_000;

/// What turns count for between two reports, at most, where each state is a linear program.
const REPORT_SYMBOLIC_TURNS: u64 = 8;

/// What turns count for between two reports, at most: one each, more where much is unsettled.
const REPORT_TURNS: u64 = 256;

/// What all strands have in common, and none changes.
#[derive(Clone, Copy)]
pub(in super::super) struct Frame<'a> {
    pub(in super::super) task: &'a Task,
    /// The task with constraints on the course of plans, and its situation, if the search ignores some.
    pub(in super::super) constrained: Option<(&'a Task, &'a Situation)>,
    pub(in super::super) situation: &'a Situation,
    pub(in super::super) settings: &'a Settings,
    pub(in super::super) compiled: &'a Compiled,
    /// Mutex pairs for incomplete searches, computed once the first plan takes longer.
    pub(in super::super) mutex_pairs: &'a OnceLock<Option<MutexPairs>>,
    /// The most work between two reports, in operators of estimates.
    pub(super) report_work: u64,
}

impl<'a> Frame<'a> {
    pub(in super::super) fn new(
        (task, constrained): (&'a Task, Option<(&'a Task, &'a Situation)>),
        situation: &'a Situation,
        settings: &'a Settings,
        (compiled, mutex_pairs): (&'a Compiled, &'a OnceLock<Option<MutexPairs>>),
    ) -> Self {
        Self {
            task,
            constrained,
            situation,
            settings,
            compiled,
            mutex_pairs,
            report_work: REPORT_WORK,
        }
    }

    /// Limits the work between two reports, in units of [`work`].
    pub(super) fn limit_report_work(&mut self, most: u64) {
        self.report_work = (most / OPERATOR_WORK).clamp(1, REPORT_WORK);
    }
}

/// A plan, and the choices that it comes from.
#[derive(Debug)]
pub(in super::super) struct Best {
    pub(super) found: Found,
    pub(super) steps: Vec<Step>,
}

impl Best {
    pub(super) fn is_better_than(&self, other: Option<&Self>) -> bool {
        let worth = |best: &Self| (best.found.value.clone(), best.found.makespan.clone());
        other.is_none_or(|other| worth(self) < worth(other))
    }
}

/// What a strand has to tell.
#[derive(Debug, Default)]
pub(super) struct Report {
    pub(super) phase: Phase,
    /// What the strand has done since it began.
    pub(super) counts: Counts,
    /// A plan that is better than any that the strand knows.
    pub(super) found: Option<Arc<Best>>,
    /// A plan that is being made better: if the work ends now, it will do.
    pub(super) pending: Option<Arc<Best>>,
    /// Whether the strand has ended; that is no question whether to go on.
    pub(super) is_last: bool,
    /// Whether it has seen everything, so that there is no need of others.
    pub(super) has_seen_everything: bool,
}

/// See the module.
pub(super) struct Strand<'a, 't> {
    pub(super) frame: Frame<'a>,
    /// The best plan that it knows.
    pub(super) best: Option<Arc<Best>>,
    /// What it has done.
    pub(super) counts: Counts,
    pub(super) phase: Phase,
    /// The work since the last report.
    pub(super) unreported: u64,
    /// The thread's work when `counts` was last updated.
    settled: u64,
    pub(super) is_stopped: bool,
    tell: Tell<'t>,
}

/// How much of its time a search may use: it goes on until it has had so many turns, or done so much.
#[derive(Clone, Copy, Debug)]
pub(super) struct Allowance {
    pub(super) turns: u64,
    pub(super) work: u64,
}

impl Allowance {
    pub(super) fn turns(turns: u64) -> Self {
        Self {
            turns,
            work: u64::MAX,
        }
    }
}

/// The reason why a search no longer works.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// It was told to.
    Stopped,
    /// There is a better plan.
    Better,
    /// There is nothing left to look at.
    Over,
    /// The turns are used up.
    TurnsSpent,
    /// There are turns left, but it has done so much as it was to do.
    WorkDone,
}

/// What became of choices that were taken for a plan.
pub(super) enum Judged {
    Refused,
    NoBetter,
    Better,
    Stopped,
}

impl<'a, 't> Strand<'a, 't> {
    pub(super) fn new(
        frame: Frame<'a>,
        best: Option<Arc<Best>>,
        unreported: u64,
        tell: Tell<'t>,
    ) -> Self {
        Self {
            frame,
            best,
            counts: Counts::default(),
            phase: Phase::Incomplete,
            unreported,
            settled: work::spent(),
            is_stopped: false,
            tell,
        }
    }

    /// Tells what it has done, for the last time. The work since the last question.
    pub(super) fn end(mut self, has_seen_everything: bool) -> u64 {
        self.settle();
        (self.tell)(Report {
            phase: self.phase,
            counts: self.counts,
            is_last: true,
            has_seen_everything,
            ..Report::default()
        });
        self.unreported
    }

    /// Counts what the thread has done since this was called last.
    fn settle(&mut self) {
        let now = work::spent();
        self.counts.work += now - self.settled;
        self.settled = now;
    }

    /// Asks whether to go on.
    pub(super) fn ask(&mut self) -> bool {
        self.report(None, None)
    }

    fn report(&mut self, found: Option<Arc<Best>>, pending: Option<Arc<Best>>) -> bool {
        self.unreported = 0;
        self.settle();
        let goes_on = (self.tell)(Report {
            phase: self.phase,
            counts: self.counts,
            found,
            pending,
            ..Report::default()
        });
        self.is_stopped |= !goes_on;
        !self.is_stopped
    }

    /// Lets a search look at states. Why it ended, how many turns that counts for, and the work.
    pub(super) fn work(
        &mut self,
        search: &mut Search<'_>,
        allowance: Allowance,
    ) -> (Outcome, u64, u64) {
        self.phase = if self.best.is_some() {
            Phase::Improving
        } else if search.prunes_unsafely() {
            Phase::Incomplete
        } else {
            Phase::Complete
        };
        self.demand_better(search);
        let before = (self.counts, search.counts());
        let most_turns = if self.frame.compiled.is_symbolic {
            REPORT_SYMBOLIC_TURNS
        } else {
            REPORT_TURNS
        };
        let weight = 1 + search.weight();
        let begin = (search.labour(), search.lookups());
        let mut reported = begin;
        let work_since = |search: &Search<'_>, (labour, lookups): (u64, u64)| {
            (search.labour() - labour).saturating_mul(weight)
                + (search.lookups() - lookups) / (REPORT_LOOKUPS / REPORT_WORK)
        };
        let spend_since = |search: &Search<'_>, from: (u64, u64)| {
            let turns = search.labour() - from.0;
            work::spend(TURN_WORK * turns + OPERATOR_WORK * work_since(search, from));
        };
        let mut spent = 0;
        let outcome = loop {
            if spent >= allowance.turns && !self.keeps_its_turn(search, allowance.turns, spent) {
                break Outcome::TurnsSpent;
            }
            if work_since(search, begin) >= allowance.work {
                break Outcome::WorkDone;
            }
            let result = search.turn();
            spent += search.price();
            // To schedule and to judge a candidate takes longer than many turns, and one that is no
            // better than the best plan may be followed by any number of others.
            let mut is_report_due = false;
            match result {
                Turn::Over => {
                    self.count(&before, search);
                    break Outcome::Over;
                }
                Turn::Nothing => {}
                Turn::Goal(steps) => {
                    self.count(&before, search);
                    spent += steps.len() as u64;
                    is_report_due = true;
                    match self.judge(&steps) {
                        Judged::Refused => {
                            search.has_lost = true;
                            search.waste(steps.len());
                        }
                        Judged::NoBetter => search.waste(steps.len()),
                        Judged::Stopped => break Outcome::Stopped,
                        Judged::Better => break Outcome::Better,
                    }
                }
            }
            is_report_due |= search.labour() - reported.0 >= most_turns
                || self.unreported + work_since(search, reported) >= self.frame.report_work;
            if is_report_due {
                spend_since(search, reported);
                reported = (search.labour(), search.lookups());
                self.count(&before, search);
                if !self.ask() {
                    break Outcome::Stopped;
                }
            }
        };
        self.count(&before, search);
        spend_since(search, reported);
        self.unreported += work_since(search, reported);
        (outcome, spent, work_since(search, begin))
    }

    /// Whether a search goes on though its turns are used up: it still comes nearer to a first plan.
    /// One that does not compress works no more than a first round may come to.
    fn keeps_its_turn(&self, search: &Search<'_>, turns: u64, spent: u64) -> bool {
        let tuning = &self.frame.compiled.tuning;
        self.best.is_none()
            && turns > tuning.root_check_after
            && (search.compresses() || spent < tuning.first_round_work / (1 + search.size()))
            && search.has_come_nearer()
    }

    fn count(&mut self, before: &(Counts, Counts), search: &Search<'_>) {
        let (counts, start, now) = (&mut self.counts, before.1, search.counts());
        counts.expanded = before.0.expanded + now.expanded - start.expanded;
        counts.generated = before.0.generated + now.generated - start.generated;
        counts.evaluated = before.0.evaluated + now.evaluated - start.evaluated;
        counts.memory = before.0.memory + now.memory - start.memory;
    }

    /// Lets the refiner, or what it is given, count its work, and asks now and then whether to go on.
    pub(super) fn counted(&mut self, before: u64, evaluated: u64, work: u64) -> bool {
        self.counts.evaluated = before + evaluated;
        work::spend(OPERATOR_WORK * work);
        self.unreported += work;
        self.unreported < self.frame.report_work || self.ask()
    }

    /// Asks the judge about the plan of these choices, and tells of it if it is better than the best.
    pub(super) fn judge(&mut self, steps: &[Step]) -> Judged {
        let Frame {
            task,
            constrained,
            situation,
            settings,
            compiled,
            ..
        } = self.frame;
        let judged = extract::plan_of(task, situation, compiled, steps, &mut || self.ask());
        if self.is_stopped {
            return Judged::Stopped;
        }
        let Some((mut plan, mut verdict)) = judged else {
            return Judged::Refused;
        };
        if let Some((constrained, begin)) = constrained
            && judged_without_observers(constrained, begin, settings, &plan).is_none()
        {
            let Some(later) = delayed(constrained, begin, settings, &plan) else {
                return Judged::Refused;
            };
            let strictness = validate::Settings::default();
            let Verdict::Valid(report) = validate_from(task, situation, &later, &strictness) else {
                return Judged::Refused;
            };
            (plan, verdict) = (later, report);
        }
        let best = |found| Best {
            found,
            steps: steps.to_vec(),
        };
        let whole = Arc::new(best(self.value(plan.clone(), &verdict)));
        let is_better = whole.is_better_than(self.best.as_deref());
        let pending = is_better.then(|| Arc::clone(&whole));
        let mut goes_on = || self.report(None, pending.clone());
        let (plan, verdict) = if constrained.is_some() {
            // A constraint may need what the goal does not.
            (plan, verdict)
        } else {
            without_needless(task, situation, plan, verdict, &mut goes_on)
        };
        if self.is_stopped {
            return Judged::Stopped;
        }
        // A metric can prefer what nothing needs, such as one that rewards time.
        let fewer = best(self.value(plan, &verdict));
        let found = if whole.is_better_than(Some(&fewer)) {
            whole
        } else {
            Arc::new(fewer)
        };
        if !found.is_better_than(self.best.as_deref()) {
            return Judged::NoBetter;
        }
        self.best = Some(Arc::clone(&found));
        if self.report(Some(found), None) {
            Judged::Better
        } else {
            Judged::Stopped
        }
    }

    /// From now on only plans count that are better than the best one.
    fn demand_better(&self, search: &mut Search<'_>) {
        let Some(best) = &self.best else { return };
        let compiled = self.frame.compiled;
        let (end, _) = compiled.scale.floor(&best.found.makespan);
        if compiled.metric.is_none() {
            search.set_horizon(end - 1);
            return;
        }
        let may_equal = search.aim() == Aim::Shortest;
        if may_equal {
            search.set_horizon(end - 1);
        }
        search.set_limit(MetricBound {
            value: best.found.value.clone(),
            may_equal,
        });
    }

    fn value(&self, plan: TimeTriggeredPlan, verdict: &validate::Report) -> Found {
        let task = self.frame.task;
        let makespan = verdict.makespan.clone();
        let metric = verdict.metric(task);
        let wanted = task.problem().metric.as_ref();
        let is_maximized = wanted.is_some_and(|metric| metric.maximize);
        let value = match (&metric, self.frame.settings.objective) {
            (Some(metric), Objective::Metric) if is_maximized => -metric,
            (Some(metric), Objective::Metric) => metric.clone(),
            _ => makespan.clone(),
        };
        Found {
            plan,
            makespan,
            metric,
            value,
        }
    }
}
