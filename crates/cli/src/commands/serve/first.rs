//! The first problem of an executive that was started without one.
//!
//! A client gives it, and hears that it is taken only when execution begins: when it can be executed,
//! and is on the disk if there is a journal.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::front::Refused;
use crate::interrupt::Interrupt;

/// How often it is looked whether the executive was asked to end.
const GLANCE: Duration = Duration::from_millis(100);

/// How long a client waits until its problem is read; afterwards it is told that it will be.
const PATIENCE: Duration = Duration::from_secs(20);

/// Where the first problem is given.
#[derive(Default)]
pub(super) struct First {
    place: Mutex<Place>,
    changed: Condvar,
}

/// What there is.
#[derive(Default)]
enum Place {
    /// Nothing.
    #[default]
    Free,
    /// A problem.
    Given(GivenProblem),
    /// A problem was given, and is being read or executed.
    Busy,
    /// The executive has ended.
    Closed,
}

/// A problem, and the client that has given it.
pub(super) struct GivenProblem {
    pub(super) text: String,
    client: Client,
}

/// A client that waits to hear what becomes of its problem.
pub(super) struct Client(Sender<Result<(), Refused>>);

impl Client {
    /// Its problem is taken.
    pub(super) fn accept(&self) {
        // A client that has gone away needs no answer.
        let _ = self.0.send(Ok(()));
    }

    /// Its problem is not taken, unless it was before.
    pub(super) fn refuse(&self, refused: Refused) {
        let _ = self.0.send(Err(refused));
    }
}

impl GivenProblem {
    /// The text, and who has given it.
    pub(super) fn parts(self) -> (String, Client) {
        (self.text, self.client)
    }
}

impl First {
    fn place(&self) -> MutexGuard<'_, Place> {
        // Each change of it is one statement.
        self.place.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a problem; `None` if the executive is asked to end before.
    pub(super) fn wait(&self, interrupt: &Interrupt) -> Option<GivenProblem> {
        let mut place = self.place();
        loop {
            if interrupt.is_requested() {
                return None;
            }
            match std::mem::replace(&mut *place, Place::Busy) {
                Place::Given(problem) => return Some(problem),
                other => *place = other,
            }
            let waited = self.changed.wait_timeout(place, GLANCE);
            place = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// What was given is refused: others can be given.
    pub(super) fn reopen(&self) {
        *self.place() = Place::Free;
    }

    /// Nothing is read any more. Whoever waits is told so.
    pub(super) fn close(&self) {
        *self.place() = Place::Closed;
    }

    /// Gives a problem, and waits until it is taken, which the answer says; or not, if that takes long.
    pub(super) fn give(&self, text: String) -> Result<bool, Refused> {
        let (sender, answer) = channel();
        {
            let mut place = self.place();
            match *place {
                Place::Free => {}
                Place::Given(_) | Place::Busy => {
                    let error = "another problem has just been given";
                    let help = "ask again in a moment; `elbowroom ctl state` says how things stand";
                    return Err(Refused::new(409, error, help));
                }
                Place::Closed => return Err(ended()),
            }
            let client = Client(sender);
            *place = Place::Given(GivenProblem { text, client });
        }
        self.changed.notify_all();
        match answer.recv_timeout(PATIENCE) {
            Ok(answer) => answer.map(|()| true),
            Err(RecvTimeoutError::Timeout) => Ok(false),
            Err(RecvTimeoutError::Disconnected) => Err(ended()),
        }
    }
}

fn ended() -> Refused {
    Refused::new(409, "the executive has ended", "start another one")
}

#[cfg(test)]
mod tests {
    use super::First;
    use crate::commands::serve::front::Refused;
    use crate::interrupt::Interrupt;

    #[test]
    fn whoever_gives_a_problem_hears_what_becomes_of_it() {
        let (first, interrupt) = (First::default(), Interrupt::default());
        std::thread::scope(|scope| {
            let refused = scope.spawn(|| first.give("wrong".to_owned()));
            let (text, client) = first.wait(&interrupt).expect("one is given").parts();
            assert_eq!(text, "wrong");
            let second = first.give("right".to_owned());
            assert!(second.is_err_and(|it| it.0 == 409), "one after the other");
            first.reopen();
            client.refuse(Refused::new(422, "it is wrong", ""));
            let refused = refused.join().expect("an answer");
            assert!(refused.is_err_and(|it| it.1 == "it is wrong"));

            let taken = scope.spawn(|| first.give("right".to_owned()));
            let (_, client) = first.wait(&interrupt).expect("one is given").parts();
            client.accept();
            assert!(taken.join().expect("an answer").is_ok_and(|it| it));
        });
    }

    #[test]
    fn a_problem_that_is_given_at_the_end_is_answered() {
        let (first, interrupt) = (First::default(), Interrupt::default());
        std::thread::scope(|scope| {
            let given = scope.spawn(|| first.give("late".to_owned()));
            drop(first.wait(&interrupt));
            first.close();
            let given = given.join().expect("an answer");
            assert!(given.is_err_and(|it| it.1.contains("ended")));
        });
        interrupt.request();
        assert!(first.wait(&interrupt).is_none());
        assert!(first.give("later".to_owned()).is_err_and(|it| it.0 == 409));
    }
}
