//! Runs of one plan, counted.

use std::collections::BTreeMap;

use super::trial::{Outcome, Ready};
use super::worlds::{Kind, Worlds};

/// Those that promise something inside the box.
const EXECUTORS: [&str; 2] = ["guarded", "live"];

/// Of so many runs, one meets the spoiler.
const SPOILED: u64 = 30;

/// Of so many runs of `guarded`, one meets a start that is late.
const LATE: u64 = 5;

/// How many runs there were, and how many of them failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    pub(crate) runs: u64,
    pub(crate) failed: u64,
}

/// What came of one plan.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) counts: BTreeMap<Kind, Count>,
    /// The first failure, in words.
    pub(crate) failure: Option<String>,
}

impl Tally {
    pub(crate) fn runs(&self) -> u64 {
        self.counts.values().map(|count| count.runs).sum()
    }

    fn add(&mut self, kind: Kind, label: &str, outcome: &Outcome) {
        let count = self.counts.entry(kind).or_default();
        count.runs += 1;
        if let Some(failure) = outcome.failure {
            count.failed += 1;
            if self.failure.is_none() {
                let kind = kind.name();
                self.failure = Some(format!("{label} ({kind}): {failure}: {}", outcome.why));
            }
        }
    }
}

/// The run of that number: kinds of worlds and executors take turns. What is promised after a start that is
/// late, `guarded` promises alone.
pub(crate) fn run(ready: &Ready<'_>, worlds: &Worlds<'_>, number: u64, tally: &mut Tally) {
    let executor = EXECUTORS[usize::from(number % 2 == 1)];
    let label = format!("{executor}, run {number}");
    let is_spoiled = (number / 2).is_multiple_of(SPOILED);
    if is_spoiled && let Some(mut world) = worlds.spoiled() {
        let outcome = ready.run(executor, &mut world);
        return tally.add(Kind::Spoiler, &label, &outcome);
    }
    if number.is_multiple_of(2)
        && (number / 2) % LATE == LATE - 1
        && let Some(late) = worlds.late_start(number)
    {
        let outcome = ready.run_late(&mut worlds.late(&late, number), &late.action);
        // What a late start excuses does not happen where that start is in time.
        let outcome =
            outcome.unwrap_or_else(|| ready.run(executor, &mut worlds.drawn(Kind::Late, number)));
        return tally.add(Kind::Late, &label, &outcome);
    }
    let kind = if (number / 2).is_multiple_of(2) {
        Kind::Uniform
    } else {
        Kind::Corner
    };
    let outcome = ready.run(executor, &mut worlds.drawn(kind, number));
    tally.add(kind, &label, &outcome);
}
