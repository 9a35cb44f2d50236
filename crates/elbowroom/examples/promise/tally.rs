//! Counts over the runs of one plan.

use std::collections::BTreeMap;

use elbowroom::execution::GuaranteeLevel;
use elbowroom::execution::run::TimeoutRule;

use super::deviations::Stray;
use super::trial::{Outcome, Ready};
use super::worlds::{Kind, Worlds};

/// Executors with a promise inside the box.
const EXECUTORS: [&str; 2] = ["guarded", "live"];

/// One run in this number meets the spoiler.
const SPOILED: u64 = 30;

/// One run of each executor in this number has an unexpected deviation.
const LATE: u64 = 5;

/// Numbers of runs and of failed runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    pub(crate) runs: u64,
    pub(crate) failed: u64,
    /// Number of runs that ended with an abandoned plan, for a valid reason.
    pub(crate) given_up: u64,
}

/// Result of one plan.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) counts: BTreeMap<Kind, Count>,
    /// Description of the first failure.
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

/// Executes the run of that number. Kinds of worlds and executors alternate. Late starts are only
/// tested with `guarded`, and durations outside their interval only with `live`, because only these
/// make promises for them.
pub(crate) fn run(ready: &Ready<'_>, worlds: &Worlds<'_>, number: u64, tally: &mut Tally) {
    let executor = EXECUTORS[usize::from(number % 2 == 1)];
    let label = format!("{executor}, run {number}");
    let turn = number / 2;
    // With and without time-outs, alternately.
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

/// Executes the run of that number with an unexpected deviation. Returns `false` if there is no
/// such run.
fn run_unreckoned(ready: &Ready<'_>, worlds: &Worlds<'_>, number: u64, tally: &mut Tally) -> bool {
    let executor = EXECUTORS[usize::from(number % 2 == 1)];
    let label = format!("{executor}, run {number}");
    let turn = number / (2 * LATE);
    if turn.is_multiple_of(2) {
        let (mut world, look) = worlds.late_look(number);
        let stray = Stray::Look(look);
        let promise = GuaranteeLevel::PartOfEnvelope;
        let (outcome, is_given_up) = ready.run_strained(executor, &mut world, stray, promise);
        tally.strained(Kind::LateLook, &label, &outcome, is_given_up);
    } else if executor == "guarded" {
        let Some(late) = worlds.late_start(number) else {
            return false;
        };
        let outcome = ready.run_late(&mut worlds.late(&late, number), &late.action);
        // An excused failure must not occur if that start is in time.
        let mut in_time = worlds.drawn(Kind::Late, number, &TimeoutRule::Off);
        let outcome = outcome.unwrap_or_else(|| ready.run(executor, &mut in_time));
        tally.add(Kind::Late, &label, &outcome);
    } else {
        let (rest, promise) = match turn / 2 % 3 {
            0 => (Kind::Uniform, GuaranteeLevel::Envelope),
            1 => (Kind::Corner, GuaranteeLevel::Envelope),
            _ => (Kind::Late, GuaranteeLevel::PartOfEnvelope),
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
