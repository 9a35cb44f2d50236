//! Table of the requirements on a world and the results of their checks.

use serde::Serialize;

/// A requirement on a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Check {
    KeepsRunning,
    SpeaksProtocol,
    Answers,
    KeepsTime,
    Starts,
    StartsBeforeItEnds,
    Ends,
    EndsOnce,
    ReportsInTime,
    KnowsTickets,
    RunsConcurrently,
    Cancels,
    IgnoresUnknownMessages,
    AcceptsBeliefs,
    Resumes,
    Stops,
}

impl Check {
    /// All checks in the order of display, each with a keyword and a description.
    pub(super) const ALL: [(Self, &str, &str); 16] = [
        (
            Self::KeepsRunning,
            "lives",
            "it runs until it receives `stop`",
        ),
        (
            Self::SpeaksProtocol,
            "speaks",
            "each line that it sends is a message of the protocol",
        ),
        (
            Self::Answers,
            "answers",
            "each question is answered in time, with `time` as the last message",
        ),
        (
            Self::KeepsTime,
            "keeps-time",
            "time never goes back, and not beyond the requested time",
        ),
        (
            Self::Starts,
            "starts",
            "each requested start is reported as started or as failed",
        ),
        (
            Self::StartsBeforeItEnds,
            "starts-before-it-ends",
            "`started` comes before `ended`, and with an earlier or equal time",
        ),
        (Self::Ends, "ends", "each started action ends"),
        (Self::EndsOnce, "ends-once", "each action ends once"),
        (
            Self::ReportsInTime,
            "reports-in-time",
            "each report arrives in the answer that covers its time",
        ),
        (
            Self::KnowsTickets,
            "knows-its-tickets",
            "reports refer only to tickets of requested starts",
        ),
        (
            Self::RunsConcurrently,
            "does-two-at-once",
            "two actions run at the same time",
        ),
        (
            Self::Cancels,
            "cancels",
            "a cancelled action ends within five seconds",
        ),
        (
            Self::IgnoresUnknownMessages,
            "ignores-the-unknown",
            "it ignores unknown messages and late cancels",
        ),
        (
            Self::AcceptsBeliefs,
            "hears-beliefs",
            "it accepts `believed` and continues",
        ),
        (
            Self::Resumes,
            "resumes",
            "after a kill and a restart, it knows the state of the actions that were running",
        ),
        (Self::Stops, "stops", "it ends within a second after `stop`"),
    ];
}

/// The outcome of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// No violation was found.
    Passed,
    /// The world violated the requirement.
    Wrong,
    /// The situation did not occur, or the world does not claim the capability.
    Skipped,
}

/// A row of the answer.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The keyword of the check.
    pub check: &'static str,
    /// The requirement.
    pub what: &'static str,
    /// The outcome.
    pub outcome: Outcome,
    /// Violations, or the reason why the check was skipped.
    pub why: Vec<String>,
}

/// Results of the checks so far.
#[derive(Debug, Default)]
pub(super) struct Findings {
    violations: Vec<(Check, String)>,
    completed: Vec<Check>,
    unclaimed: Vec<Check>,
}

/// Maximum number of examples kept of each violation.
const MAX_EXAMPLES: usize = 3;

impl Findings {
    /// Marks the check as done.
    pub(super) fn mark_done(&mut self, check: Check) {
        self.completed.push(check);
    }

    /// Marks the check as skipped because the world does not claim the capability.
    pub(super) fn mark_unclaimed(&mut self, check: Check) {
        self.unclaimed.push(check);
    }

    /// Returns the number of violations so far.
    pub(super) fn violation_count(&self) -> usize {
        self.violations.len()
    }

    /// Records a violation.
    pub(super) fn record_violation(&mut self, check: Check, why: impl Into<String>) {
        let why = why.into();
        let known = self.violations.iter().filter(|(other, _)| *other == check);
        let known: Vec<_> = known.map(|(_, known)| known).collect();
        if known.len() < MAX_EXAMPLES && !known.contains(&&why) {
            self.violations.push((check, why));
        }
    }

    /// Returns the rows. `end` is the reason why the checks ended early, if they did.
    pub(super) fn rows(self, end: Option<&str>) -> Vec<Row> {
        let row = |(check, name, what)| {
            let wrong = self.violations.iter().filter(|(other, _)| *other == check);
            let wrong: Vec<String> = wrong.map(|(_, why)| why.clone()).collect();
            let (outcome, why) = if !wrong.is_empty() {
                (Outcome::Wrong, wrong)
            } else if self.completed.contains(&check) {
                (Outcome::Passed, Vec::new())
            } else {
                let why = if self.unclaimed.contains(&check) {
                    "the world does not claim this capability"
                } else {
                    end.unwrap_or("the situation did not occur")
                };
                (Outcome::Skipped, vec![why.to_owned()])
            };
            Row {
                check: name,
                what,
                outcome,
                why,
            }
        };
        Check::ALL.into_iter().map(row).collect()
    }
}
