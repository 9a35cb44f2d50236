//! What stands in the journal of a run, played again.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use elbowroom::answers::{Halt, Watcher};
use elbowroom::execution::run::Stand;
use elbowroom::execution::{Entry, Planner, PlannerAnswer, Recorder};
use elbowroom::model::{Situation, Task};
use elbowroom::report::trace::{Line, ReplayPlanner, Stored};

use crate::stopwatch::Stopwatch;
use elbowroom_executive::journaling::{JournalHealth, JournalWriter};

/// What stands in the journal, and how much of it has been played.
pub(super) struct Past {
    lines: Vec<Line>,
    /// The number of the first of them in the file.
    first: usize,
    played: AtomicUsize,
    /// The first line that came out otherwise; 0 if none has.
    difference: AtomicUsize,
    is_to_end: AtomicBool,
}

impl Past {
    pub(super) fn new(stored: &Stored) -> Self {
        let past = Self {
            lines: stored.lines.clone(),
            first: stored.first_number(),
            played: AtomicUsize::new(0),
            difference: AtomicUsize::new(0),
            is_to_end: AtomicBool::new(false),
        };
        past.look_ahead(0);
        past
    }

    /// The run was asked to end where its journal says so.
    fn look_ahead(&self, next: usize) {
        let is_to_end = matches!(self.lines.get(next), Some(Line::Interrupted(_)));
        self.is_to_end.store(is_to_end, Ordering::SeqCst);
    }

    /// Takes note of an entry; whether it is a new one.
    fn play(&self, line: &Line) -> bool {
        let index = self.played.fetch_add(1, Ordering::SeqCst);
        let Some(stored) = self.lines.get(index) else {
            return self.difference().is_none();
        };
        self.look_ahead(index + 1);
        if stored != line && self.difference().is_none() {
            self.difference.store(index + self.first, Ordering::SeqCst);
        }
        false
    }

    /// Whether the last entry stands in the journal: what it tells the world, the world was told,
    /// or may have been.
    pub(super) fn has_last(&self) -> bool {
        self.played.load(Ordering::SeqCst) <= self.lines.len()
    }

    pub(super) fn is_over(&self) -> bool {
        self.played.load(Ordering::SeqCst) >= self.lines.len()
    }

    pub(super) fn difference(&self) -> Option<usize> {
        Some(self.difference.load(Ordering::SeqCst)).filter(|line| *line > 0)
    }
}

/// Compares what is in the journal, and writes what is not.
pub(super) struct PastRecorder<'a> {
    pub(super) past: Arc<Past>,
    pub(super) task: Arc<Task>,
    pub(super) writer: JournalWriter<'a>,
}

impl Recorder for PastRecorder<'_> {
    fn record(&mut self, entry: &Entry<'_>) {
        if self.past.play(&Line::of(&self.task, entry)) {
            self.writer.record(entry);
        }
    }

    fn commit(&mut self) {
        self.writer.commit();
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> Stand) -> bool {
        // What the journal has is only played again until then.
        self.past.is_over() && self.past.difference().is_none() && self.writer.begin_anew(stand)
    }
}

/// Makes the plans that were made, and then new ones. One that was in the making when the journal ends
/// is made anew.
pub(super) struct PastPlanner<'a> {
    /// For each plan that the journal says is made, in order: whether it has the answer.
    asked: VecDeque<bool>,
    past: ReplayPlanner,
    present: Box<dyn Planner + 'a>,
    /// Whose plan is made beside the run.
    begun: Begun,
}

/// Whose plan is made beside the run.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Begun {
    /// One of the journal.
    Past,
    /// A new one.
    Present,
}

impl<'a> PastPlanner<'a> {
    pub(super) fn new(stored: &Stored, present: Box<dyn Planner + 'a>) -> Self {
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
            asked,
            past: ReplayPlanner::new(stored),
            present,
            begun: Begun::Past,
        }
    }

    /// Who makes the next plan; `None` for one that the journal says is begun, and was given up.
    fn next(&mut self) -> Option<Begun> {
        match self.asked.pop_front() {
            Some(true) => Some(Begun::Past),
            Some(false) if !self.asked.is_empty() => None,
            _ => Some(Begun::Present),
        }
    }
}

impl Planner for PastPlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        match self.next() {
            Some(Begun::Past) => self.past.plan(task, situation),
            _ => self.present.plan(task, situation),
        }
    }

    fn begin(&mut self, task: &Task, situation: &Situation) -> bool {
        self.begun = self.next().unwrap_or(Begun::Past);
        match self.begun {
            Begun::Past => self.past.begin(task, situation),
            Begun::Present => self.present.begin(task, situation),
        }
    }

    fn collect(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        match self.begun {
            Begun::Past => self.past.collect(task, situation),
            Begun::Present => self.present.collect(task, situation),
        }
    }

    fn give_up(&mut self) {
        if self.begun == Begun::Present {
            self.present.give_up();
        }
    }

    fn expect(&mut self, task: &Task, situation: &Situation) {
        if self.asked.is_empty() {
            self.present.expect(task, situation);
        }
    }

    fn is_recorded(&self) -> bool {
        self.asked.front() == Some(&true)
    }
}

/// Ends the run where it was asked to end, and when it is asked to now, or cannot be written down.
pub(super) struct Watch {
    pub(super) inner: Stopwatch,
    pub(super) past: Arc<Past>,
    pub(super) health: JournalHealth,
}

impl Watcher for Watch {
    fn elapsed(&mut self) -> Duration {
        self.inner.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<Halt> {
        let is_to_end = self.past.is_to_end.load(Ordering::SeqCst) || self.health.has_failed();
        match () {
            () if is_to_end => ControlFlow::Break(Halt::Cancelled),
            () if self.past.is_over() => self.inner.flow(),
            () => ControlFlow::Continue(()),
        }
    }
}
