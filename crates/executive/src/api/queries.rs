//! Queries of the state of an executive.

use std::time::Duration;

use elbowroom::executive::documents::{Activity, State};
use elbowroom::num::Rational;

use super::router::ApiRouter;

/// Answer time of the world from which the state reports it as unanswered. An interactive run queries its world many
/// times a second.
const SILENCE_THRESHOLD: Duration = Duration::from_secs(1);

impl ApiRouter {
    /// Returns the state of the executive.
    pub(super) fn state(&self) -> State {
        match self.run() {
            Ok(run) => State {
                unanswered: self.unanswered(),
                ..run.status.state()
            },
            Err(refused) => State {
                now: Rational::ZERO.into(),
                unanswered: None,
                activity: Activity::Beginning,
                why: Some(refused.error),
                goals: Vec::new(),
                running: Vec::new(),
                plans: 0,
                facts: Vec::new(),
                numbers: Vec::new(),
                in_doubt: Vec::new(),
            },
        }
    }

    /// Returns the time in seconds for which the world has not answered, if that is more than one second.
    pub(super) fn unanswered(&self) -> Option<u64> {
        let silence = self.queue().unanswered()?;
        (silence > SILENCE_THRESHOLD).then_some(silence.as_secs())
    }
}
