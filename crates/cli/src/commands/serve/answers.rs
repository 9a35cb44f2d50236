//! What is answered before there is a run.

use std::time::Duration;

use elbowroom::executive::documents::{Activity, State};
use elbowroom::num::Rational;

use super::front::Front;

/// A run with people at its queue asks its world many times a second: one that takes longer than this to answer
/// stands still.
const ANSWERS_WITHIN: Duration = Duration::from_secs(1);

impl Front {
    /// How things stand.
    pub(super) fn state(&self) -> State {
        match self.run() {
            Ok((status, _)) => State {
                unanswered: self.unanswered(),
                ..status.state()
            },
            Err(refused) => State {
                now: Rational::ZERO.into(),
                unanswered: None,
                activity: Activity::Beginning,
                why: Some(refused.1),
                goals: Vec::new(),
                running: Vec::new(),
                plans: 0,
                facts: Vec::new(),
                numbers: Vec::new(),
                in_doubt: Vec::new(),
            },
        }
    }

    /// For how many seconds the world has not answered, if it is silent.
    pub(super) fn unanswered(&self) -> Option<u64> {
        let silence = self.queue().unanswered()?;
        (silence > ANSWERS_WITHIN).then_some(silence.as_secs())
    }
}
