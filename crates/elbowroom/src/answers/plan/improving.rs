//! Iterator over the plans of a search, each better than the one before.

use std::io;
use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_selection::renumbered;

use super::{PlanFinding, PlanOutcome, PlanRequest, plan};
use crate::answers::{Event, Observer, RequestError, StopRequest};

/// Stack size of the search thread: that of the main thread.
const STACK_SIZE: usize = 64 << 20;

/// Requests an iterator over the plans that the embedded planner finds.
#[derive(Clone, Copy, Debug)]
pub struct ImprovingPlansRequest<'a> {
    /// The problem.
    pub task: &'a Arc<Task>,
    /// See [`PlanRequest::most_memory`].
    pub most_memory: Option<u64>,
    /// See [`PlanRequest::self_overlap`].
    pub self_overlap: bool,
    /// See [`PlanRequest::threads`].
    pub threads: usize,
}

/// A plan that is better than all before it: by the problem's metric, or, without one, by makespan.
#[derive(Clone, Debug, PartialEq)]
pub struct BetterPlan {
    /// The plan.
    pub plan: TimeTriggeredPlan,
    /// The same as a document: [`PlanFinding::Plan`].
    pub finding: PlanFinding,
}

/// The next result of a search.
#[derive(Clone, Debug, PartialEq)]
pub enum NextPlan {
    /// A better plan.
    Better(BetterPlan),
    /// There are no more: see [`ImprovingPlans::answer`].
    Ended,
    /// No result within the given time.
    Timeout,
}

/// Messages from the search thread.
enum SearchMessage {
    Better(BetterPlan),
    Ended(Box<Result<PlanOutcome, RequestError>>),
}

/// A search in its own thread, as an iterator over the plans that it finds.
///
/// The search continues between calls. Dropping this value requests its end at the next step.
#[derive(Debug)]
pub struct ImprovingPlans {
    /// The caller's task. The search numbers facts in its own table.
    task: Arc<Task>,
    messages: Receiver<SearchMessage>,
    stop_requested: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    answer: Option<Box<Result<PlanOutcome, RequestError>>>,
}

impl ImprovingPlans {
    /// Starts the search. It ends when the search space is exhausted, or when `watcher` stops it.
    ///
    /// # Errors
    /// When the thread cannot be started.
    pub fn search(
        request: &ImprovingPlansRequest<'_>,
        watcher: Box<dyn Observer + Send>,
    ) -> io::Result<Self> {
        let own = request.task.with_own_table();
        let (sender, news) = channel();
        let is_to_stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&is_to_stop);
        let ImprovingPlansRequest {
            most_memory,
            self_overlap,
            threads,
            ..
        } = *request;
        let thread = Builder::new().stack_size(STACK_SIZE).spawn(move || {
            let mut relay = Relay {
                inner: watcher,
                task: &own,
                stop_requested: flag,
                sender: sender.clone(),
            };
            let mut request = PlanRequest {
                task: &own,
                first_plan_only: false,
                most_memory,
                self_overlap,
                threads,
            };
            let answer = plan(&mut request, &mut relay);
            // The receiver may be gone.
            let _ = sender.send(SearchMessage::Ended(Box::new(answer)));
        })?;
        Ok(Self {
            task: Arc::clone(request.task),
            messages: news,
            stop_requested: is_to_stop,
            thread: Some(thread),
            answer: None,
        })
    }

    /// Waits up to `patience` for the next plan or the end of the search.
    ///
    /// # Panics
    /// When the search has panicked, with the same message.
    pub fn next_within(&mut self, patience: Duration) -> NextPlan {
        if self.answer.is_some() {
            return NextPlan::Ended;
        }
        match self.messages.recv_timeout(patience) {
            Ok(SearchMessage::Better(BetterPlan { plan, finding })) => {
                NextPlan::Better(BetterPlan {
                    plan: self.to_caller_facts(&plan),
                    finding,
                })
            }
            Ok(SearchMessage::Ended(mut answer)) => {
                if let Ok(PlanOutcome { plan, .. }) = &mut *answer {
                    *plan = plan.take().map(|plan| self.to_caller_facts(&plan));
                }
                self.answer = Some(answer);
                NextPlan::Ended
            }
            Err(RecvTimeoutError::Timeout) => NextPlan::Timeout,
            // A thread that ends without an answer has panicked.
            Err(RecvTimeoutError::Disconnected) => match self.thread.take().map(JoinHandle::join) {
                Some(Err(panic)) => resume_unwind(panic),
                _ => panic!("the search has panicked"),
            },
        }
    }

    /// Returns a plan of the search with the fact numbers of the caller's task.
    fn to_caller_facts(&self, plan: &TimeTriggeredPlan) -> TimeTriggeredPlan {
        renumbered(&self.task, plan).expect("the search has the same actions")
    }

    /// Requests the end of the search. It ends at its next step, with the best plan so far.
    pub fn stop(&self) {
        self.stop_requested.store(true, Ordering::Relaxed);
    }

    /// Returns the answer, with the last plan, after the end of the search.
    pub fn answer(&self) -> Option<&Result<PlanOutcome, RequestError>> {
        self.answer.as_deref()
    }
}

impl Iterator for ImprovingPlans {
    type Item = BetterPlan;

    /// Waits for the next plan.
    fn next(&mut self) -> Option<BetterPlan> {
        loop {
            match self.next_within(Duration::MAX) {
                NextPlan::Better(better) => return Some(better),
                NextPlan::Ended => return None,
                NextPlan::Timeout => {}
            }
        }
    }
}

impl Drop for ImprovingPlans {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Forwards each plan, and stops the search on request.
struct Relay<'a> {
    inner: Box<dyn Observer + Send>,
    task: &'a Task,
    stop_requested: Arc<AtomicBool>,
    sender: Sender<SearchMessage>,
}

impl Observer for Relay<'_> {
    fn elapsed(&mut self) -> Duration {
        self.inner.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        if self.stop_requested.load(Ordering::Relaxed) {
            return ControlFlow::Break(StopRequest::Cancelled);
        }
        self.inner.flow()
    }

    fn notice(&mut self, event: &Event<'_>) {
        if let Event::Plan(progress) = event
            && let (Some(plan), Some(makespan)) = (progress.plan, progress.makespan)
        {
            let (makespan, metric) = (makespan.clone(), progress.metric.cloned());
            let better = BetterPlan {
                plan: plan.clone(),
                finding: PlanFinding::of(self.task, plan, makespan, metric, None),
            };
            // The receiver may be gone.
            let _ = self.sender.send(SearchMessage::Better(better));
        }
        self.inner.notice(event);
    }
}
