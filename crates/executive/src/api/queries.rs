//! Queries of the state of an executive.

use std::sync::TryLockError;

use elbowroom::num::Rational;

use super::router::{ApiError, ApiRouter};
use crate::history::{MAX_PAGE, page};
use crate::interface::documents::{Activity, HistoryNow, State};

/// Number of entries of a page, if the client does not give one.
const DEFAULT_PAGE: usize = 100;

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

    /// Returns a page of the history. One page is read at a time.
    pub(super) fn history_page(&self, query: &str) -> Result<HistoryNow, ApiError> {
        let run = self.run()?;
        let help = "for example /v1/history?before=120.5&limit=50";
        let (mut before, mut limit) = (None, DEFAULT_PAGE);
        for member in query.split('&').filter(|member| !member.is_empty()) {
            let wrong = |expected: &str| {
                let error = format!("expected {expected}, found `{}`", member.escape_debug());
                ApiError::new(422, error, help)
            };
            match member.split_once('=') {
                Some(("before", time)) => {
                    let time = time.replace("%2F", "/").parse::<Rational>();
                    before = Some(time.map_err(|_| wrong("a time in `before`"))?);
                }
                Some(("limit", number)) => {
                    let number = number.parse::<usize>().ok();
                    let number = number.filter(|it| (1..=MAX_PAGE).contains(it));
                    let expected = format!("a number from 1 to {MAX_PAGE} in `limit`");
                    limit = number.ok_or_else(|| wrong(&expected))?;
                }
                _ => return Err(wrong("`before` or `limit`")),
            }
        }
        let busy = |_| ApiError::new(503, "another page of the history is being read", help);
        let _reading = match self.history.try_lock() {
            Err(TryLockError::Poisoned(lock)) => lock.into_inner(),
            lock => lock.map_err(busy)?,
        };
        let present = || self.buffer.trace();
        let files = self.history_files.get();
        Ok(page(files, &present, &run.status, before.as_ref(), limit))
    }
}
