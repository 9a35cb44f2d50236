//! Progress line of a run.

use std::collections::BTreeMap;

use elbowroom::execution::Entry;
use elbowroom::execution::{Command, Event};
use elbowroom::num::Rational;

use crate::number;
use crate::progress::Progress;
use elbowroom_executive::clock::Clock;
use elbowroom_executive::messages::{count_with_noun, escape_control};

/// Maximum number of running actions that are named.
const MAX_NAMED: usize = 3;

/// Line with the time, the running actions, and the number of new plans.
pub(super) struct ProgressLine {
    line: Progress,
    clock: Clock,
    /// Actions that have started and not ended, by ticket.
    running: BTreeMap<u64, String>,
    replans: usize,
}

impl ProgressLine {
    /// Creates the line of a run that begins.
    pub(super) fn new() -> Self {
        Self {
            line: Progress::new(),
            clock: Clock::start(),
            running: BTreeMap::new(),
            replans: 0,
        }
    }

    fn show(&mut self, now: &Rational, is_planning: bool) {
        let (running, replans) = (&self.running, self.replans);
        self.line.show(self.clock.elapsed(), || {
            let mut names: Vec<String> = running.values().take(MAX_NAMED).cloned().collect();
            if running.len() > MAX_NAMED {
                names.push(format!("and {} more", running.len() - MAX_NAMED));
            }
            let what = match (is_planning, names.is_empty()) {
                (true, _) => "planning".to_owned(),
                (false, true) => "no action is running".to_owned(),
                (false, false) => names.join(", "),
            };
            let time = number::nearest(now);
            format!(
                "at {time}: {what}; {}",
                count_with_noun(replans, "new plan")
            )
        });
    }

    /// Updates the line after an entry of the record.
    pub(super) fn update(&mut self, entry: &Entry<'_>) {
        match entry {
            Entry::Command { now, command, .. } => {
                if let Command::Start { ticket, action, .. } = command {
                    self.running.insert(ticket.0, escape_control(&action.name));
                }
                self.show(now, false);
            }
            Entry::Taken {
                now, observation, ..
            } => {
                if let Event::Ended { ticket, .. } = &observation.event {
                    self.running.remove(&ticket.0);
                }
                self.show(now, false);
            }
            Entry::Planning { now, .. } => self.show(now, true),
            Entry::Planned { now, plan, .. } => {
                self.replans += usize::from(plan.is_some());
                self.show(now, false);
            }
            Entry::Passed { now, .. } => self.show(now, false),
            _ => {}
        }
    }
}
