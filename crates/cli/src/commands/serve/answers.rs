//! What is answered before there is a run.

use elbowroom::executive::documents::{Activity, State};
use elbowroom::num::Rational;

use super::front::Front;

impl Front {
    /// How things stand.
    pub(super) fn state(&self) -> State {
        match self.run() {
            Ok((status, _)) => status.state(),
            Err(refused) => State {
                now: Rational::ZERO.into(),
                activity: Activity::Beginning,
                why: Some(refused.1),
                goals: Vec::new(),
                running: Vec::new(),
                plans: 0,
                facts: Vec::new(),
                numbers: Vec::new(),
            },
        }
    }
}
