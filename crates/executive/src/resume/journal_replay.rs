//! Replay of a journal: recorder, planner and watcher of a resumed run.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use elbowroom::answers::{Observer, StopRequest};
use elbowroom::execution::run::RunSnapshot;
use elbowroom::execution::{Entry, Planner, PlannerAnswer, Recorder};
use elbowroom::model::{Situation, Task};
use elbowroom::num::work::Stop;
use elbowroom::report::trace::{Line, ReplayPlanner, Stored};

use crate::journaling::{JournalHealth, JournalWriter};

/// Lines of a journal, and the progress of their replay.
pub(super) struct JournalReplay {
    lines: Vec<Line>,
    /// Line number of the first one in the file.
    first: usize,
    played: AtomicUsize,
    /// First line that deviates; 0 if there is none.
    difference: AtomicUsize,
    must_end: AtomicBool,
    is_interrupted: AtomicBool,
}

impl JournalReplay {
    pub(super) fn new(stored: &Stored) -> Self {
        let replay = Self {
            lines: stored.lines.clone(),
            first: stored.first_number(),
            played: AtomicUsize::new(0),
            difference: AtomicUsize::new(0),
            must_end: AtomicBool::new(false),
            is_interrupted: AtomicBool::new(false),
        };
        replay.look_ahead(0);
        replay
    }

    /// Ends the run where its journal contains an interruption.
    fn look_ahead(&self, next: usize) {
        let must_end = matches!(self.lines.get(next), Some(Line::Interrupted(_)));
        self.must_end.store(must_end, Ordering::SeqCst);
    }

    /// Compares an entry with the journal. Returns `true` for a new entry after its end.
    fn play(&self, line: &Line) -> bool {
        let index = self.played.fetch_add(1, Ordering::SeqCst);
        let Some(stored) = self.lines.get(index) else {
            return self.difference().is_none();
        };
        self.look_ahead(index + 1);
        let is_interrupted = self.is_interrupted.load(Ordering::SeqCst);
        let is_interrupted_after = stored.is_interrupted_after(is_interrupted);
        self.is_interrupted
            .store(is_interrupted_after, Ordering::SeqCst);
        if !stored.agrees_with(line, is_interrupted) && self.difference().is_none() {
            self.difference.store(index + self.first, Ordering::SeqCst);
        }
        false
    }

    /// Returns `true` if the last entry is in the journal: the world has, or may have, received its command.
    pub(super) fn has_last(&self) -> bool {
        self.played.load(Ordering::SeqCst) <= self.lines.len()
    }

    /// Returns `true` after the last line.
    pub(super) fn is_over(&self) -> bool {
        self.played.load(Ordering::SeqCst) >= self.lines.len()
    }

    /// Returns the number of the first line that deviates.
    pub(super) fn difference(&self) -> Option<usize> {
        Some(self.difference.load(Ordering::SeqCst)).filter(|line| *line > 0)
    }
}

/// Stop request that computations of this thread obey after the replay of a journal. During the
/// replay, a computation that ends early would differ from the recorded one.
pub(super) struct DeferredStop(Option<Stop>);

impl DeferredStop {
    /// Uninstalls the thread's stop request until the replay is over.
    pub(super) fn uninstall() -> Self {
        Self(Stop::uninstall_for_thread())
    }

    /// Installs the stop request again if the replay is over.
    pub(super) fn install_after(&mut self, replay: &JournalReplay) {
        if replay.is_over()
            && let Some(stop) = self.0.take()
        {
            stop.install_for_thread();
        }
    }
}

impl Drop for DeferredStop {
    fn drop(&mut self) {
        self.0.iter().for_each(Stop::install_for_thread);
    }
}

/// Recorder that compares entries with the journal and writes new ones.
pub(super) struct ReplayRecorder<'a> {
    pub(super) stop: DeferredStop,
    pub(super) replay: Arc<JournalReplay>,
    pub(super) task: Arc<Task>,
    pub(super) writer: JournalWriter<'a>,
}

impl Recorder for ReplayRecorder<'_> {
    fn record(&mut self, entry: &Entry<'_>) {
        if self.replay.play(&Line::of(&self.task, entry)) {
            self.writer.record(entry);
        }
        self.stop.install_after(&self.replay);
    }

    fn commit(&mut self) {
        self.writer.commit();
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool {
        // Only new entries can be replaced.
        self.replay.is_over() && self.replay.difference().is_none() && self.writer.begin_anew(stand)
    }
}

/// Planner that returns the plans of the journal, then new ones. A plan that was in progress at the end of the journal is
/// made again.
pub(super) struct ResumedPlanner<'a> {
    /// For each request for a plan in the journal, in order: `true` if it has the answer.
    answered_requests: VecDeque<bool>,
    journal: ReplayPlanner,
    planner: Box<dyn Planner + 'a>,
    /// Source of the plan that is made in the background.
    begun: Source,
}

/// Source of a plan.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Source {
    /// The journal.
    Journal,
    /// The planner.
    Planner,
}

impl<'a> ResumedPlanner<'a> {
    pub(super) fn new(stored: &Stored, planner: Box<dyn Planner + 'a>) -> Self {
        let mut asked = VecDeque::new();
        for line in &stored.lines {
            match line {
                Line::Planning(_) => asked.push_back(false),
                Line::Planned(_) => {
                    if let Some(last) = asked.back_mut() {
                        *last = true;
                    }
                }
                _ => {}
            }
        }
        Self {
            answered_requests: asked,
            journal: ReplayPlanner::new(stored),
            planner,
            begun: Source::Journal,
        }
    }

    /// Returns the source of the next plan, or `None` for a plan that was begun and abandoned in the journal.
    fn next(&mut self) -> Option<Source> {
        match self.answered_requests.pop_front() {
            Some(true) => Some(Source::Journal),
            Some(false) if !self.answered_requests.is_empty() => None,
            _ => Some(Source::Planner),
        }
    }
}

impl Planner for ResumedPlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        match self.next() {
            Some(Source::Journal) => self.journal.plan(task, situation),
            _ => self.planner.plan(task, situation),
        }
    }

    fn begin(&mut self, task: &Task, situation: &Situation) -> bool {
        self.begun = self.next().unwrap_or(Source::Journal);
        match self.begun {
            Source::Journal => self.journal.begin(task, situation),
            Source::Planner => self.planner.begin(task, situation),
        }
    }

    fn collect(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        match self.begun {
            Source::Journal => self.journal.collect(task, situation),
            Source::Planner => self.planner.collect(task, situation),
        }
    }

    fn give_up(&mut self) {
        if self.begun == Source::Planner {
            self.planner.give_up();
        }
    }

    fn expect(&mut self, task: &Task, situation: &Situation) {
        if self.answered_requests.is_empty() {
            self.planner.expect(task, situation);
        }
    }

    fn is_recorded(&self) -> bool {
        self.answered_requests.front() == Some(&true)
    }
}

/// Watcher that ends the run at an interruption in the journal, after a failure of the journal, and after its end as the
/// inner watcher requests.
pub(super) struct ReplayWatcher<'w> {
    pub(super) inner: &'w mut (dyn Observer + Send),
    pub(super) replay: Arc<JournalReplay>,
    pub(super) health: JournalHealth,
}

impl Observer for ReplayWatcher<'_> {
    fn elapsed(&mut self) -> Duration {
        self.inner.elapsed()
    }

    fn notice(&mut self, event: &elbowroom::answers::Event<'_>) {
        // The recorded part of the run was reported when it happened.
        if self.replay.is_over() {
            self.inner.notice(event);
        }
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        let must_end = self.replay.must_end.load(Ordering::SeqCst) || self.health.has_failed();
        match () {
            () if must_end => ControlFlow::Break(StopRequest::Cancelled),
            () if self.replay.is_over() => self.inner.flow(),
            () => ControlFlow::Continue(()),
        }
    }
}
