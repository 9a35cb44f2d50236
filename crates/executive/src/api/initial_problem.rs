//! Initial problem of an executive that was started without one.
//!
//! A client submits it, and is notified when execution begins: the problem is valid, and on the disk if there is a
//! journal.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use elbowroom::num::work::Stop;

use super::router::ApiError;

/// Interval between two checks for a stop request.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Time limit for a client to wait until its problem is read.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(20);

/// Slot for the initial problem.
#[derive(Default)]
pub struct InitialProblem {
    slot: Mutex<SlotState>,
    changed: Condvar,
}

/// State of the slot.
#[derive(Default)]
enum SlotState {
    /// No problem.
    #[default]
    Free,
    /// A submitted problem.
    Given(GivenProblem),
    /// A problem is being read or executed.
    Busy,
    /// The executive has ended.
    Closed,
}

/// Problem with the client that has submitted it.
pub struct GivenProblem {
    text: String,
    client: Client,
}

/// Client that waits for the result of its submission.
pub struct Client(Sender<Result<(), ApiError>>);

impl Client {
    /// Notifies the client that its problem is accepted.
    pub fn accept(&self) {
        // Disconnected clients need no answer.
        let _ = self.0.send(Ok(()));
    }

    /// Notifies the client that its problem is rejected, unless it was accepted before.
    pub fn refuse(&self, refused: ApiError) {
        let _ = self.0.send(Err(refused));
    }
}

impl GivenProblem {
    /// Returns the text of the problem, and the client.
    pub fn parts(self) -> (String, Client) {
        (self.text, self.client)
    }
}

impl InitialProblem {
    fn lock(&self) -> MutexGuard<'_, SlotState> {
        // Each change of the state is one statement.
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a problem. Returns `None` after a stop request.
    pub fn wait(&self, stop: &Stop) -> Option<GivenProblem> {
        let mut place = self.lock();
        loop {
            if stop.is_requested() {
                return None;
            }
            match std::mem::replace(&mut *place, SlotState::Busy) {
                SlotState::Given(problem) => return Some(problem),
                other => *place = other,
            }
            let waited = self.changed.wait_timeout(place, POLL_INTERVAL);
            place = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Accepts further problems after a rejection.
    pub fn reopen(&self) {
        *self.lock() = SlotState::Free;
    }

    /// Accepts no further problems, and rejects a waiting one.
    pub fn close(&self) {
        *self.lock() = SlotState::Closed;
    }

    /// Submits a problem and waits up to 20 s. Returns `true` if it is accepted, `false` if it is still being read.
    pub(super) fn submit_and_wait(&self, text: String) -> Result<bool, ApiError> {
        let (sender, answer) = channel();
        {
            let mut place = self.lock();
            match *place {
                SlotState::Free => {}
                SlotState::Given(_) | SlotState::Busy => {
                    let error = "another problem has just been given";
                    let help = "repeat the request later; `elbowroom ctl state` shows the state";
                    return Err(ApiError::new(409, error, help));
                }
                SlotState::Closed => return Err(ended()),
            }
            let client = Client(sender);
            *place = SlotState::Given(GivenProblem { text, client });
        }
        self.changed.notify_all();
        match answer.recv_timeout(ANSWER_TIMEOUT) {
            Ok(answer) => answer.map(|()| true),
            Err(RecvTimeoutError::Timeout) => Ok(false),
            Err(RecvTimeoutError::Disconnected) => Err(ended()),
        }
    }
}

fn ended() -> ApiError {
    ApiError::new(409, "the executive has ended", "start another executive")
}

#[cfg(test)]
mod tests {
    use super::InitialProblem;
    use crate::api::ApiError;
    use elbowroom::num::work::Stop;

    #[test]
    fn client_receives_result_of_its_problem() {
        let (slot, stop) = (InitialProblem::default(), Stop::default());
        std::thread::scope(|scope| {
            let refused = scope.spawn(|| slot.submit_and_wait("wrong".to_owned()));
            let (text, client) = slot.wait(&stop).expect("one is given").parts();
            assert_eq!(text, "wrong");
            let second = slot.submit_and_wait("right".to_owned());
            assert!(
                second.is_err_and(|it| it.status == 409),
                "one after the other"
            );
            slot.reopen();
            client.refuse(ApiError::new(422, "it is wrong", ""));
            let refused = refused.join().expect("an answer");
            assert!(refused.is_err_and(|it| it.error == "it is wrong"));

            let taken = scope.spawn(|| slot.submit_and_wait("right".to_owned()));
            let (_, client) = slot.wait(&stop).expect("one is given").parts();
            client.accept();
            assert!(taken.join().expect("an answer").is_ok_and(|it| it));
        });
    }

    #[test]
    fn problem_during_shutdown_is_rejected() {
        let (slot, stop) = (InitialProblem::default(), Stop::default());
        std::thread::scope(|scope| {
            let given = scope.spawn(|| slot.submit_and_wait("late".to_owned()));
            drop(slot.wait(&stop));
            slot.close();
            let given = given.join().expect("an answer");
            assert!(given.is_err_and(|it| it.error.contains("ended")));
        });
        stop.request();
        assert!(slot.wait(&stop).is_none());
        assert!(
            slot.submit_and_wait("later".to_owned())
                .is_err_and(|it| it.status == 409)
        );
    }
}
