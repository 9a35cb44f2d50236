//! Runs of one plan, counted.

use std::collections::BTreeMap;

use elbowroom::execution::Promise;
use elbowroom::execution::run::TimeoutRule;

use super::strain::Stray;
use super::trial::{Outcome, Ready};
use super::worlds::{Kind, Worlds};

/// Those that promise something inside the box.
const EXECUTORS: [&str; 2] = ["guarded", "live"];

/// Of so many runs, one meets the spoiler.
const SPOILED: u64 = 30;

/// Of so many runs of each, one meets something outside what is reckoned with.
const LATE: u64 = 5;

/// How many runs there were, and how many of them failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    pub(crate) runs: u64,
    pub(crate) failed: u64,
    /// How many ended with a plan that was given up, as it might be.
    pub(crate) given_up: u64,
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

    fn strained(&mut self, kind: Kind, label: &str, outcome: &Outcome, is_given_up: bool) {
        self.add(kind, label, outcome);
        if is_given_up {
            self.counts.entry(kind).or_default().given_up += 1;
        }
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
/// late, `guarded` promises alone, and `live` after a duration that is outside its interval.
pub(crate) fn run(ready: &Ready<'_>, worlds: &Worlds<'_>, number: u64, tally: &mut Tally) {
    let executor = EXECUTORS[usize::from(number % 2 == 1)];
    let label = format!("{executor}, run {number}");
    let turn = number / 2;
    // With time-outs and without, alternately.
    let timeout = if (turn / 2).is_multiple_of(2) {
        TimeoutRule::default()
    } else {
        TimeoutRule::Off
    };
    if turn.is_multiple_of(SPOILED)
        && let Some(mut world) = worlds.spoiled(&timeout)
    {
        let outcome = ready.run_timed(executor, &mut world, &timeout);
        return tally.add(Kind::Spoiler, &label, &outcome);
    }
    if turn % LATE == LATE - 1 && run_unreckoned(ready, worlds, number, tally) {
        return;
    }
    let kind = if turn.is_multiple_of(2) {
        Kind::Uniform
    } else {
        Kind::Corner
    };
    let mut world = worlds.drawn(kind, number, &timeout);
    let outcome = ready.run_timed(executor, &mut world, &timeout);
    tally.add(kind, &label, &outcome);
}

/// The run of that number in which something is not as was reckoned with; `false` if there is no such run.
fn run_unreckoned(ready: &Ready<'_>, worlds: &Worlds<'_>, number: u64, tally: &mut Tally) -> bool {
    let executor = EXECUTORS[usize::from(number % 2 == 1)];
    let label = format!("{executor}, run {number}");
    let turn = number / (2 * LATE);
    if turn.is_multiple_of(2) {
        let (mut world, look) = worlds.late_look(number);
        let stray = Stray::Look(look);
        let promise = Promise::PartOfEnvelope;
        let (outcome, is_given_up) = ready.run_strained(executor, &mut world, stray, promise);
        tally.strained(Kind::LateLook, &label, &outcome, is_given_up);
    } else if executor == "guarded" {
        let Some(late) = worlds.late_start(number) else {
            return false;
        };
        let outcome = ready.run_late(&mut worlds.late(&late, number), &late.action);
        // What a late start excuses does not happen where that start is in time.
        let mut in_time = worlds.drawn(Kind::Late, number, &TimeoutRule::Off);
        let outcome = outcome.unwrap_or_else(|| ready.run(executor, &mut in_time));
        tally.add(Kind::Late, &label, &outcome);
    } else {
        let (rest, promise) = match turn / 2 % 3 {
            0 => (Kind::Uniform, Promise::Envelope),
            1 => (Kind::Corner, Promise::Envelope),
            _ => (Kind::Late, Promise::PartOfEnvelope),
        };
        let Some((mut world, id)) = worlds.outside(rest, number) else {
            return false;
        };
        let stray = Stray::Duration(id);
        let (outcome, is_given_up) = ready.run_strained(executor, &mut world, stray, promise);
        tally.strained(Kind::Outside, &label, &outcome, is_given_up);
    }
    true
}
