//! Bounded queue of operators' requests, drained by the run.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use elbowroom::execution::{ActionHandle, Ending, Event, GoalTerms, Observation, Request};
use elbowroom::model::Task;
use elbowroom::num::Rational;

use crate::clock::Clock;

/// Limit on pending requests.
const MAX_PENDING: usize = 1000;

/// Answer time of the world after which the state reports it as unanswered.
const SILENCE_THRESHOLD: Duration = Duration::from_secs(1);

/// Request or observation from outside the run. Facts and fluents are names. They are resolved when the run
/// drains the queue, so that a replay numbers them in the same order.
#[derive(Clone, Debug)]
pub enum ExternalRequest {
    /// Request about goals or dispatching.
    Request(Request),
    /// Goal with times that count from the time at which the run receives it.
    TimedGoal {
        /// Name of the goal.
        name: String,
        /// The goal in PDDL.
        goal: String,
        /// Its value, its author, and its other times.
        terms: GoalTerms,
        /// Time until its deadline, in seconds.
        within: Option<Rational>,
        /// Time until its release, in seconds.
        after: Option<Rational>,
    },
    /// Observation of a fact.
    Fact {
        /// The fact in PDDL, such as `(open door)`.
        fact: String,
        /// Its truth.
        becomes: bool,
    },
    /// Outcome of a running action that an operator has observed.
    Outcome {
        /// The ticket of its start.
        ticket: ActionHandle,
        /// `true` if it has succeeded.
        succeeded: bool,
    },
    /// Observation of a numeric fluent.
    Number {
        /// The fluent in PDDL, such as `(charge rover)`.
        fluent: String,
        /// Its value, in the unit of the problem.
        value: Rational,
    },
}

impl ExternalRequest {
    /// Returns the request as an event at `now`; `None` if the task does not have its fact or fluent.
    pub(crate) fn event(self, now: &Rational, task: &Task) -> Option<Event> {
        match self {
            Self::Request(request) => Some(Event::Requested(request)),
            Self::TimedGoal {
                name,
                goal,
                terms,
                within,
                after,
            } => Some(Event::Requested(Request::Pursue {
                name,
                goal,
                terms: GoalTerms {
                    deadline: within.map(|it| now + &it).or(terms.deadline),
                    release: after.map(|it| now + &it).or(terms.release),
                    ..terms
                },
            })),
            Self::Fact { fact, becomes } => Some(Event::Fact {
                fact: task.fact_named(&fact)?,
                truth: becomes,
            }),
            Self::Outcome { ticket, succeeded } => Some(Event::Ended {
                ticket,
                ending: if succeeded {
                    Ending::Succeeded
                } else {
                    let why = "an operator has reported it as failed".to_owned();
                    Ending::Failed { why }
                },
                measured: Vec::new(),
            }),
            Self::Number { fluent, value } => Some(Event::Value {
                fluent: task.fluent_named(&fluent)?,
                value,
            }),
        }
    }
}

/// Bounded queue of requests. Clones share the same queue.
#[derive(Clone, Default)]
pub struct RequestQueue(Arc<Inner>);

#[derive(Default)]
struct Inner {
    state: Mutex<State>,
    changed: Condvar,
}

/// State of a submitted request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestStatus {
    /// The run has recorded and processed the request.
    Accepted,
    /// The run has not processed the request yet.
    Pending,
    /// The journal cannot be written. The run accepts no further requests.
    JournalFailed,
    /// The run ended before it processed the request.
    RunEnded,
}

#[derive(Default)]
struct State {
    waiting: VecDeque<ExternalRequest>,
    /// Numbers of requests that were submitted, drained, recorded and accepted.
    submitted: u64,
    fetched: u64,
    recorded: u64,
    accepted: u64,
    /// The journal cannot be written.
    has_journal_failed: bool,
    /// The run has ended.
    has_run_ended: bool,
    /// Runs since the pending question to the world, if there is one.
    since_question: Option<Clock>,
    /// The reason why the world's program is being started again.
    restart: Option<String>,
}

impl RequestQueue {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Each change of the state is one statement, or harmless when incomplete.
        let state = self.0.state.lock();
        state.unwrap_or_else(PoisonError::into_inner)
    }

    /// Submits requests, which the run drains together. Returns the number of the last one, or `None` if the queue
    /// is full.
    pub fn submit(&self, requests: Vec<ExternalRequest>) -> Option<u64> {
        let mut state = self.lock();
        if state.waiting.len() >= MAX_PENDING {
            return None;
        }
        state.submitted += requests.len() as u64;
        state.waiting.extend(requests);
        Some(state.submitted)
    }

    /// Waits until the run has accepted request `number` or can no longer accept it, for at most `timeout`.
    pub fn wait_until_accepted(&self, number: u64, timeout: Duration) -> RequestStatus {
        let state = self.lock();
        let waits = |state: &mut State| {
            state.accepted < number && !state.has_journal_failed && !state.has_run_ended
        };
        let waited = self.0.changed.wait_timeout_while(state, timeout, waits);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        match () {
            () if state.accepted >= number => RequestStatus::Accepted,
            () if state.has_journal_failed => RequestStatus::JournalFailed,
            () if state.has_run_ended => RequestStatus::RunEnded,
            () => RequestStatus::Pending,
        }
    }

    /// Records that the journal cannot be written. Pending requests are not accepted then.
    pub fn fail_journal(&self) {
        self.lock().has_journal_failed = true;
        self.0.changed.notify_all();
    }

    /// Returns `true` if the journal cannot be written.
    pub fn has_journal_failed(&self) -> bool {
        self.lock().has_journal_failed
    }

    /// Records the end of the run. Pending requests are not accepted then.
    pub fn close(&self) {
        self.lock().has_run_ended = true;
        self.0.changed.notify_all();
    }

    /// Returns `true` if no request waits to be drained.
    pub fn is_empty(&self) -> bool {
        self.lock().waiting.is_empty()
    }

    /// Returns `true` if the run has accepted all submitted requests.
    pub fn is_idle(&self) -> bool {
        let state = self.lock();
        state.accepted == state.submitted
    }

    /// Removes all pending requests and returns them as observations at `now`. Unknown facts and fluents are
    /// omitted.
    pub fn drain(&self, now: &Rational, task: &Task) -> Vec<Observation> {
        let requests = {
            let mut state = self.lock();
            state.fetched = state.submitted;
            std::mem::take(&mut state.waiting)
        };
        let events = requests
            .into_iter()
            .filter_map(|request| request.event(now, task));
        let time = now.clone();
        events
            .map(|event| Observation {
                time: time.clone(),
                event,
            })
            .collect()
    }

    /// Returns `true` if drained requests are not recorded yet.
    pub fn has_unrecorded(&self) -> bool {
        let state = self.lock();
        state.recorded < state.fetched
    }

    /// Records that the drained requests are in the journal.
    pub fn note_recorded(&self) {
        let mut state = self.lock();
        state.recorded = state.fetched;
    }

    /// Records that the run sends a question or a command to the world.
    pub fn note_question(&self) {
        self.lock().since_question = Some(Clock::start());
    }

    /// Records that the world has answered.
    pub fn note_answer(&self) {
        self.lock().since_question = None;
    }

    /// Returns the time since the pending question to the world, or `None` if there is none.
    pub fn unanswered(&self) -> Option<Duration> {
        self.lock().since_question.map(Clock::elapsed)
    }

    /// Records why the world's program is being started again, or that it runs.
    pub fn note_restart(&self, why: Option<String>) {
        self.lock().restart = why;
    }

    /// Returns the reason why the world's program is being started again, or `None` if it runs.
    pub fn world_restart(&self) -> Option<String> {
        self.lock().restart.clone()
    }

    /// Returns the time in seconds for which the world has not answered, if that is more than one second. An interactive
    /// run queries its world many times a second.
    pub fn silence(&self) -> Option<u64> {
        let silence = self.unanswered()?;
        (silence > SILENCE_THRESHOLD).then_some(silence.as_secs())
    }

    /// Records that the run has processed the recorded requests, and that its published status includes them.
    pub fn acknowledge(&self) {
        let mut state = self.lock();
        state.accepted = state.recorded;
        drop(state);
        self.0.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::{ExternalRequest, MAX_PENDING, RequestQueue, RequestStatus};
    use elbowroom::execution::Request;
    use std::time::Duration;

    #[test]
    fn request_is_accepted_after_drain_and_record() {
        let queue = RequestQueue::default();
        let number = queue
            .submit(vec![ExternalRequest::Request(Request::Pause)])
            .expect("room");
        let soon = Duration::from_millis(1);
        queue.acknowledge();
        let is_waiting = |queue: &RequestQueue| {
            queue.wait_until_accepted(number, soon) == RequestStatus::Pending
        };
        assert!(is_waiting(&queue), "it was not drained");
        queue.lock().fetched = number;
        assert!(queue.has_unrecorded());
        queue.acknowledge();
        assert!(is_waiting(&queue), "it was not recorded");
        assert!(!queue.is_idle());
        queue.note_recorded();
        assert!(!queue.has_unrecorded());
        queue.acknowledge();
        assert_eq!(
            queue.wait_until_accepted(number, soon),
            RequestStatus::Accepted
        );
        assert!(queue.is_idle());
    }

    /// A waiting client is notified at once, not after its timeout.
    #[test]
    fn end_of_run_and_journal_failure_wake_waiting_clients() {
        let long = Duration::from_secs(600);
        let submit = |queue: &RequestQueue| {
            queue
                .submit(vec![ExternalRequest::Request(Request::Pause)])
                .expect("room")
        };
        for (end, reception) in [
            (
                RequestQueue::fail_journal as fn(&RequestQueue),
                RequestStatus::JournalFailed,
            ),
            (RequestQueue::close, RequestStatus::RunEnded),
        ] {
            let queue = RequestQueue::default();
            let taken = submit(&queue);
            queue.lock().fetched = taken;
            queue.note_recorded();
            queue.acknowledge();
            let number = submit(&queue);
            std::thread::scope(|scope| {
                let waiting = scope.spawn(|| queue.wait_until_accepted(number, long));
                end(&queue);
                assert_eq!(waiting.join().expect("an answer"), reception);
            });
            assert_eq!(
                queue.wait_until_accepted(taken, long),
                RequestStatus::Accepted
            );
        }
    }

    #[test]
    fn queue_has_a_limit() {
        let queue = RequestQueue::default();
        let taken = (0..2 * MAX_PENDING)
            .filter_map(|_| queue.submit(vec![ExternalRequest::Request(Request::Pause)]));
        assert_eq!(taken.count(), MAX_PENDING);
    }
}
