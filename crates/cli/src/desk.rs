//! Where requests wait until the run takes them in.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use elbowroom::execution::{Event, Observation, Request};
use elbowroom::model::Task;
use elbowroom::num::Rational;

use crate::clock::Clock;

/// The limit on requests that wait.
const MOST_WAITING: usize = 1000;

/// Something that is asked of a run, or told to it. Facts and fluents are names: what they stand for
/// is looked up when the run takes them in, so that a replay numbers them in the same order.
#[derive(Clone, Debug)]
pub(crate) enum Ask {
    Request(Request),
    Fact { fact: String, becomes: bool },
    Number { fluent: String, value: Rational },
}

/// Where requests wait.
#[derive(Clone, Default)]
pub(crate) struct Desk(Arc<Inner>);

#[derive(Default)]
struct Inner {
    state: Mutex<State>,
    changed: Condvar,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reception {
    /// The run has taken it in.
    Taken,
    /// The run has not taken it in yet.
    Waits,
    /// The journal cannot be written, so that the run takes in nothing more.
    Lost,
    /// The run has ended before it took it in.
    Over,
}

#[derive(Default)]
struct State {
    waiting: VecDeque<Ask>,
    /// How many were handed in, handed to the run, recorded, and taken in by it.
    given: u64,
    fetched: u64,
    recorded: u64,
    taken: u64,
    /// The journal cannot be written.
    is_lost: bool,
    /// The run has ended.
    is_over: bool,
    /// Since when the world owes the run an answer.
    asked: Option<Clock>,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Each change of the state is one statement, or does not matter in halves.
        let state = self.0.state.lock();
        state.unwrap_or_else(PoisonError::into_inner)
    }

    /// Hands in requests, which the run takes in together. The number of the last one, or `None` if
    /// too many wait.
    pub(crate) fn hand_in(&self, asks: Vec<Ask>) -> Option<u64> {
        let mut state = self.lock();
        if state.waiting.len() >= MOST_WAITING {
            return None;
        }
        state.given += asks.len() as u64;
        state.waiting.extend(asks);
        Some(state.given)
    }

    /// Waits until the run has taken in that request, or will not any more, but not for long.
    pub(crate) fn await_taken(&self, number: u64, patience: Duration) -> Reception {
        let state = self.lock();
        let waits = |state: &mut State| state.taken < number && !state.is_lost && !state.is_over;
        let waited = self.0.changed.wait_timeout_while(state, patience, waits);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        match () {
            () if state.taken >= number => Reception::Taken,
            () if state.is_lost => Reception::Lost,
            () if state.is_over => Reception::Over,
            () => Reception::Waits,
        }
    }

    /// The journal cannot be written: what is not taken in yet, will not be.
    pub(crate) fn lose(&self) {
        self.lock().is_lost = true;
        self.0.changed.notify_all();
    }

    /// Whether the run ends because the journal cannot be written.
    pub(crate) fn is_lost(&self) -> bool {
        self.lock().is_lost
    }

    /// The run has ended: what is not taken in yet, will not be.
    pub(crate) fn close(&self) {
        self.lock().is_over = true;
        self.0.changed.notify_all();
    }

    /// Whether nothing waits to be fetched.
    pub(crate) fn is_empty(&self) -> bool {
        self.lock().waiting.is_empty()
    }

    /// Whether the run has taken in all that was handed in.
    pub(crate) fn is_clear(&self) -> bool {
        let state = self.lock();
        state.taken == state.given
    }

    /// Everything that waits, as observed at `now`.
    pub(crate) fn fetch(&self, now: &Rational, task: &Task) -> Vec<Observation> {
        let asks = {
            let mut state = self.lock();
            state.fetched = state.given;
            std::mem::take(&mut state.waiting)
        };
        let events = asks.into_iter().filter_map(|ask| match ask {
            Ask::Request(request) => Some(Event::Asked(request)),
            Ask::Fact { fact, becomes } => Some(Event::Fact {
                fact: task.fact_named(&fact)?,
                truth: becomes,
            }),
            Ask::Number { fluent, value } => Some(Event::Value {
                fluent: task.fluent_named(&fluent)?,
                value,
            }),
        });
        let time = now.clone();
        events
            .map(|event| Observation {
                time: time.clone(),
                event,
            })
            .collect()
    }

    /// Whether the run was handed something that it has not recorded yet.
    pub(crate) fn has_fetched(&self) -> bool {
        let state = self.lock();
        state.recorded < state.fetched
    }

    /// What the run was handed is recorded.
    pub(crate) fn note_recorded(&self) {
        let mut state = self.lock();
        state.recorded = state.fetched;
    }

    /// The run asks something of its world, or tells it.
    pub(crate) fn note_question(&self) {
        self.lock().asked = Some(Clock::start());
    }

    /// The world has answered.
    pub(crate) fn note_answer(&self) {
        self.lock().asked = None;
    }

    /// How long the world has not answered, if it was asked something.
    pub(crate) fn unanswered(&self) -> Option<Duration> {
        self.lock().asked.map(Clock::elapsed)
    }

    /// The run has taken in what is recorded, and whoever asks how it stands is told so.
    pub(crate) fn acknowledge(&self) {
        let mut state = self.lock();
        state.taken = state.recorded;
        drop(state);
        self.0.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::{Ask, Desk, MOST_WAITING, Reception};
    use elbowroom::execution::Request;
    use std::time::Duration;

    #[test]
    fn a_request_is_taken_in_after_it_was_fetched_and_recorded() {
        let desk = Desk::default();
        let number = desk
            .hand_in(vec![Ask::Request(Request::Pause)])
            .expect("room");
        let soon = Duration::from_millis(1);
        desk.acknowledge();
        let is_waiting = |desk: &Desk| desk.await_taken(number, soon) == Reception::Waits;
        assert!(is_waiting(&desk), "it was not fetched");
        desk.lock().fetched = number;
        assert!(desk.has_fetched());
        desk.acknowledge();
        assert!(is_waiting(&desk), "it was not recorded");
        assert!(!desk.is_clear());
        desk.note_recorded();
        assert!(!desk.has_fetched());
        desk.acknowledge();
        assert_eq!(desk.await_taken(number, soon), Reception::Taken);
        assert!(desk.is_clear());
    }

    /// Whoever waits is told at once, not when their patience is over.
    #[test]
    fn a_request_that_is_never_taken_in_is_not_waited_for() {
        let long = Duration::from_secs(600);
        let hand_in = |desk: &Desk| {
            desk.hand_in(vec![Ask::Request(Request::Pause)])
                .expect("room")
        };
        for (end, reception) in [
            (Desk::lose as fn(&Desk), Reception::Lost),
            (Desk::close, Reception::Over),
        ] {
            let desk = Desk::default();
            let taken = hand_in(&desk);
            desk.lock().fetched = taken;
            desk.note_recorded();
            desk.acknowledge();
            let number = hand_in(&desk);
            std::thread::scope(|scope| {
                let waiting = scope.spawn(|| desk.await_taken(number, long));
                end(&desk);
                assert_eq!(waiting.join().expect("an answer"), reception);
            });
            assert_eq!(desk.await_taken(taken, long), Reception::Taken);
        }
    }

    #[test]
    fn a_desk_has_a_limit() {
        let desk = Desk::default();
        let taken =
            (0..2 * MOST_WAITING).filter_map(|_| desk.hand_in(vec![Ask::Request(Request::Pause)]));
        assert_eq!(taken.count(), MOST_WAITING);
    }
}
