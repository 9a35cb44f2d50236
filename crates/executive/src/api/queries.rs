//! Queries of the state of an executive.

use elbowroom::num::Rational;

use super::router::ApiRouter;
use crate::interface::documents::{Activity, State};

impl ApiRouter {
    /// Returns the state of the executive.
    pub(super) fn state(&self) -> State {
        match self.run() {
            Ok(run) => State {
                unanswered: self.queue().silence(),
                restarting: self.queue().world_restart(),
                ..run.status.state()
            },
            Err(refused) => State {
                now: Rational::ZERO.into(),
                unanswered: None,
                restarting: None,
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
}
