//! A strand of work: a search or a refiner, for some time. It knows the best plan from its
//! beginning, and passes on its own plans in reports.

use std::sync::{Arc, OnceLock};

use elbowroom_model::validate::{self, Verdict};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan, validate_from};
use elbowroom_num::work;

use super::super::action_elimination::without_redundant_actions;
use super::super::answer::{Counts, FoundPlan, Phase, Settings};
use super::super::apply::Step;
use super::super::bound::MetricBound;
use super::super::compile::Compiled;
use super::super::extract;
use super::super::mutex_pairs::MutexPairs;
use super::super::search::{Aim, Expansion, Search};
use super::super::trajectory::{delayed, validated_without_observers};
use super::parallel::ReportCallback;

/// Work between two reports, in operators of estimates and their effects: about ten milliseconds.
const REPORT_WORK: u64 = 2_000_000;

/// Work units of a turn of a search: a state is generated, compared and stored.
const TURN_WORK: u64 = 8_000;

/// Work units of an operator of an estimate.
pub(super) const OPERATOR_WORK: u64 = 5;

/// Maximum number of pair lookups between two reports: some milliseconds.
const REPORT_LOOKUPS: u64 = 4_000_000;

/// Maximum weight of the turns between two reports if each state needs a linear program.
const REPORT_SYMBOLIC_TURNS: u64 = 8;

/// Maximum weight of the turns between two reports: one each, more if many happenings are
/// unsettled.
const REPORT_TURNS: u64 = 256;

/// Immutable data shared by all strands.
#[derive(Clone, Copy)]
pub(in super::super) struct Frame<'a> {
    pub(in super::super) task: &'a Task,
    /// The task with trajectory constraints, and its situation, if the search ignores some.
    pub(in super::super) constrained: Option<(&'a Task, &'a Situation)>,
    pub(in super::super) situation: &'a Situation,
    pub(in super::super) settings: &'a Settings,
    pub(in super::super) compiled: &'a Compiled,
    /// Mutex pairs for incomplete searches, computed once the first plan takes longer.
    pub(in super::super) mutex_pairs: &'a OnceLock<Option<MutexPairs>>,
    /// The maximum work between two reports, in operators of estimates.
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

/// A plan, and the choices that led to it.
#[derive(Debug)]
pub(in super::super) struct Best {
    pub(super) found: FoundPlan,
    pub(super) steps: Vec<Step>,
}

impl Best {
    pub(super) fn is_better_than(&self, other: Option<&Self>) -> bool {
        let worth = |best: &Self| (best.found.value.clone(), best.found.makespan.clone());
        other.is_none_or(|other| worth(self) < worth(other))
    }
}

/// Report of a strand.
#[derive(Debug, Default)]
pub(super) struct Report {
    pub(super) phase: Phase,
    /// Work of the strand since its beginning.
    pub(super) counts: Counts,
    /// A plan that is better than any known to the strand.
    pub(super) found: Option<Arc<Best>>,
    /// A plan that is still being improved. It is used if the work ends now.
    pub(super) pending: Option<Arc<Best>>,
    /// `true` if the strand has ended. The receiver's answer is then ignored.
    pub(super) is_last: bool,
    /// `true` if it has exhausted the search space, so that other strands are unnecessary.
    pub(super) has_exhausted_space: bool,
}

/// Context of a strand: its best plan, its counts and its reports.
pub(super) struct Worker<'a, 't> {
    pub(super) frame: Frame<'a>,
    /// The best plan that it knows.
    pub(super) best: Option<Arc<Best>>,
    /// Work done so far.
    pub(super) counts: Counts,
    pub(super) phase: Phase,
    /// The work since the last report.
    pub(super) unreported: u64,
    /// The thread's work when `counts` was last updated.
    settled: u64,
    pub(super) is_stopped: bool,
    on_report: ReportCallback<'t>,
}

/// Limit on a search: it continues until it has had `turns` turns, or done `work` work.
#[derive(Clone, Copy, Debug)]
pub(super) struct SearchBudget {
    pub(super) turns: u64,
    pub(super) work: u64,
}

impl SearchBudget {
    pub(super) fn turns(turns: u64) -> Self {
        Self {
            turns,
            work: u64::MAX,
        }
    }
}

/// Reason for the end of a search's turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// It was stopped.
    Stopped,
    /// There is a better plan.
    Better,
    /// The search space is exhausted.
    Over,
    /// The turns are used up.
    TurnsSpent,
    /// There are turns left, but the work limit is reached.
    WorkDone,
}

/// Result of validating the choices of a candidate plan.
pub(super) enum CandidateVerdict {
    Refused,
    NoBetter,
    Better,
    Stopped,
}

impl<'a, 't> Worker<'a, 't> {
    pub(super) fn new(
        frame: Frame<'a>,
        best: Option<Arc<Best>>,
        unreported: u64,
        on_report: ReportCallback<'t>,
    ) -> Self {
        Self {
            frame,
            best,
            counts: Counts::default(),
            phase: Phase::Incomplete,
            unreported,
            settled: work::spent(),
            is_stopped: false,
            on_report,
        }
    }

    /// Sends the last report. Returns the work since the previous report.
    pub(super) fn end(mut self, has_seen_everything: bool) -> u64 {
        self.update_counts();
        (self.on_report)(Report {
            phase: self.phase,
            counts: self.counts,
            is_last: true,
            has_exhausted_space: has_seen_everything,
            ..Report::default()
        });
        self.unreported
    }

    /// Adds the thread's work since the last call to the counts.
    fn update_counts(&mut self) {
        let now = work::spent();
        self.counts.work += now - self.settled;
        self.settled = now;
    }

    /// Reports the progress. Returns `false` to stop.
    pub(super) fn report_progress(&mut self) -> bool {
        self.report(None, None)
    }

    fn report(&mut self, found: Option<Arc<Best>>, pending: Option<Arc<Best>>) -> bool {
        self.unreported = 0;
        self.update_counts();
        let may_continue = (self.on_report)(Report {
            phase: self.phase,
            counts: self.counts,
            found,
            pending,
            ..Report::default()
        });
        self.is_stopped |= !may_continue;
        !self.is_stopped
    }

    /// Lets a search expand states. Returns the outcome, the number of turns that it counts for,
    /// and the work.
    pub(super) fn work(
        &mut self,
        search: &mut Search<'_>,
        allowance: SearchBudget,
    ) -> (Outcome, u64, u64) {
        self.phase = if self.best.is_some() {
            Phase::Improving
        } else if search.prunes_unsafely() {
            Phase::Incomplete
        } else {
            Phase::Complete
        };
        self.require_improvement(search);
        let before = (self.counts, search.counts());
        let most_turns = if self.frame.compiled.is_symbolic {
            REPORT_SYMBOLIC_TURNS
        } else {
            REPORT_TURNS
        };
        let weight = 1 + search.weight();
        let begin = (search.total_work(), search.lookups());
        let mut reported = begin;
        let work_since = |search: &Search<'_>, (labour, lookups): (u64, u64)| {
            (search.total_work() - labour).saturating_mul(weight)
                + (search.lookups() - lookups) / (REPORT_LOOKUPS / REPORT_WORK)
        };
        let spend_since = |search: &Search<'_>, from: (u64, u64)| {
            let turns = search.total_work() - from.0;
            work::spend(TURN_WORK * turns + OPERATOR_WORK * work_since(search, from));
        };
        let mut spent = 0;
        let outcome = loop {
            if spent >= allowance.turns && !self.is_turn_extended(search, allowance.turns, spent) {
                break Outcome::TurnsSpent;
            }
            if work_since(search, begin) >= allowance.work {
                break Outcome::WorkDone;
            }
            let result = search.turn();
            spent += search.last_turn_cost();
            // Scheduling and validating a candidate takes longer than many turns, and a candidate
            // that is no better than the best plan may be followed by any number of others.
            let mut is_report_due = false;
            match result {
                Expansion::Over => {
                    self.count(&before, search);
                    break Outcome::Over;
                }
                Expansion::Nothing => {}
                Expansion::Goal(steps) => {
                    self.count(&before, search);
                    spent += steps.len() as u64;
                    is_report_due = true;
                    match self.judge(&steps) {
                        CandidateVerdict::Refused => {
                            search.is_lossy = true;
                            search.count_rejected(steps.len());
                        }
                        CandidateVerdict::NoBetter => search.count_rejected(steps.len()),
                        CandidateVerdict::Stopped => break Outcome::Stopped,
                        CandidateVerdict::Better => break Outcome::Better,
                    }
                }
            }
            is_report_due |= search.total_work() - reported.0 >= most_turns
                || self.unreported + work_since(search, reported) >= self.frame.report_work;
            if is_report_due {
                spend_since(search, reported);
                reported = (search.total_work(), search.lookups());
                self.count(&before, search);
                if !self.report_progress() {
                    break Outcome::Stopped;
                }
            }
        };
        self.count(&before, search);
        spend_since(search, reported);
        self.unreported += work_since(search, reported);
        (outcome, spent, work_since(search, begin))
    }

    /// Returns `true` if a search continues although its turns are used up, because it still
    /// approaches a first plan. A search that does not compress works at most as much as a first
    /// round.
    fn is_turn_extended(&self, search: &Search<'_>, turns: u64, spent: u64) -> bool {
        let tuning = &self.frame.compiled.tuning;
        self.best.is_none()
            && turns > tuning.root_check_after
            && (search.compresses() || spent < tuning.first_round_work / (1 + search.size()))
            && search.has_improved_recently()
    }

    fn count(&mut self, before: &(Counts, Counts), search: &Search<'_>) {
        let (counts, start, now) = (&mut self.counts, before.1, search.counts());
        counts.expanded = before.0.expanded + now.expanded - start.expanded;
        counts.generated = before.0.generated + now.generated - start.generated;
        counts.evaluated = before.0.evaluated + now.evaluated - start.evaluated;
        counts.memory = before.0.memory + now.memory - start.memory;
    }

    /// Records work of the refiner or the clean-up, and regularly asks whether to continue.
    pub(super) fn count_work(&mut self, before: u64, evaluated: u64, work: u64) -> bool {
        self.counts.evaluated = before + evaluated;
        work::spend(OPERATOR_WORK * work);
        self.unreported += work;
        self.unreported < self.frame.report_work || self.report_progress()
    }

    /// Validates the plan of these choices, and reports it if it is better than the best plan.
    pub(super) fn judge(&mut self, steps: &[Step]) -> CandidateVerdict {
        let Frame {
            task,
            constrained,
            situation,
            settings,
            compiled,
            ..
        } = self.frame;
        let judged = extract::plan_of(task, situation, compiled, steps, &mut || {
            self.report_progress()
        });
        if self.is_stopped {
            return CandidateVerdict::Stopped;
        }
        let Some((mut plan, mut verdict)) = judged else {
            return CandidateVerdict::Refused;
        };
        if let Some((constrained, begin)) = constrained
            && validated_without_observers(constrained, begin, settings, &plan).is_none()
        {
            let Some(later) = delayed(constrained, begin, settings, &plan) else {
                return CandidateVerdict::Refused;
            };
            let strictness = validate::Settings::default();
            let Verdict::Valid(report) = validate_from(task, situation, &later, &strictness) else {
                return CandidateVerdict::Refused;
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
        let mut may_continue = || self.report(None, pending.clone());
        let (plan, verdict) = if constrained.is_some() {
            // A constraint may need steps that the goal does not need.
            (plan, verdict)
        } else {
            without_redundant_actions(task, situation, plan, verdict, &mut may_continue)
        };
        if self.is_stopped {
            return CandidateVerdict::Stopped;
        }
        // A metric can prefer steps that nothing needs, for example if it rewards time.
        let fewer = best(self.value(plan, &verdict));
        let found = if whole.is_better_than(Some(&fewer)) {
            whole
        } else {
            Arc::new(fewer)
        };
        if !found.is_better_than(self.best.as_deref()) {
            return CandidateVerdict::NoBetter;
        }
        self.best = Some(Arc::clone(&found));
        if self.report(Some(found), None) {
            CandidateVerdict::Better
        } else {
            CandidateVerdict::Stopped
        }
    }

    /// Restricts the search to plans that are better than the best one.
    fn require_improvement(&self, search: &mut Search<'_>) {
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

    fn value(&self, plan: TimeTriggeredPlan, verdict: &validate::Report) -> FoundPlan {
        let Frame { task, settings, .. } = self.frame;
        FoundPlan::new(task, settings.objective, plan, verdict)
    }
}
