//! Check whether an end may be better after another happening: [`may_be_better_later`].

use crate::process::action_model::{ActionModel, Ending, Facts, FailureKind, Needs, Snap};
use crate::process::value_intervals::Amount;
use crate::process::world::TimedWorld;

/// The changes by a happening.
#[derive(Clone, Copy, Debug, Default)]
struct Footprint {
    adds: Facts,
    deletes: Facts,
    /// The changed numbers, as bits.
    numbers: u64,
    /// The changed numbers that are assigned, as bits.
    sets: u64,
}

/// An end that is possible now.
struct PendingEnd<'a> {
    world: &'a TimedWorld,
    /// The action, if it is known. It does not start again before it has ended.
    act: Option<usize>,
    own: Footprint,
    /// The facts that its condition reads.
    reads: Facts,
    /// The comparisons of the numbers that it changes.
    tests: Facts,
    /// The facts of its over-all condition, which must hold until it ends.
    kept: Facts,
}

/// Returns `true` if an end that is possible now may be better after a happening that is possible
/// while its action is running: one that the end would prevent, one that would undo the end's
/// effects, or one that its condition requires. In a monotone world, added facts prevent nothing.
/// If `is_alone`, no other action has the same end; otherwise another action of the class may be
/// running instead.
pub(super) fn may_be_better_later(
    world: &TimedWorld,
    (facts, under_way, happened, act, ending): (Facts, u64, u32, usize, Ending),
    is_alone: bool,
) -> bool {
    let Some((over_all, end)) = &world.acts[act].rest else {
        return false;
    };
    let (own, reads) = match world.acts[act].failed(ending) {
        Some(failed) => (Footprint::of_failed(failed), 0),
        // The end waits until its condition holds.
        None if !end.needs.holds(facts) => return true,
        None => (Footprint::of(end), end.needs.mentions()),
    };
    let waiting = PendingEnd {
        world,
        act: is_alone.then_some(act),
        own,
        reads,
        tests: world.tests_of(own.numbers),
        kept: over_all.conjunction().unwrap_or(0),
    };
    if waiting.can_violate(&world.goal) {
        return true;
    }
    let events = world.events.iter().enumerate();
    let coming = events.filter(|(index, _)| happened & (1 << index) == 0);
    let mut facts = facts;
    for (_, event) in coming {
        let of_event = Footprint {
            adds: event.adds,
            deletes: event.deletes,
            ..Footprint::default()
        };
        if waiting.is_undone_by(of_event) {
            return true;
        }
        facts |= event.adds;
    }
    waiting.can_improve(facts, under_way & !(1 << act))
}

impl PendingEnd<'_> {
    /// Searches for such a happening among all that are possible from these facts and with these
    /// running actions, in a relaxation: only facts of the action's over-all condition become
    /// false.
    fn can_improve(&self, mut facts: Facts, mut started: u64) -> bool {
        let acts = || self.world.acts.iter().enumerate();
        for (index, other) in acts() {
            if started & (1 << index) != 0 {
                facts |= other.adds_by_failing();
            }
        }
        let mut ended = 0;
        loop {
            let before = (facts, started, ended);
            for (index, other) in acts().filter(|(index, _)| Some(*index) != self.act) {
                let bit = 1 << index;
                let start = &other.start;
                if started & bit == 0 && start.needs.is_possible(facts) && !self.is_broken_by(start)
                {
                    if self.is_better_after_start(other) {
                        return true;
                    }
                    started |= bit;
                    facts |= start.adds | other.adds_by_failing();
                }
                let Some((over_all, end)) = &other.rest else {
                    continue;
                };
                if started & !ended & bit == 0 {
                    continue;
                }
                if self.is_better_after_failures(other) || self.can_violate(over_all) {
                    return true;
                }
                let can_end = over_all.is_possible(facts) && end.needs.is_possible(facts);
                if can_end && !self.is_broken_by(end) {
                    if self.can_violate(&end.needs) || self.is_undone_by(Footprint::of(end)) {
                        return true;
                    }
                    ended |= bit;
                    facts |= end.adds;
                }
            }
            if (facts, started, ended) == before {
                return false;
            }
        }
    }

    fn is_better_after_start(&self, other: &ActionModel) -> bool {
        let over_all = other.rest.as_ref();
        self.can_violate(&other.start.needs)
            || over_all.is_some_and(|(over_all, _)| self.can_violate(over_all))
            || self.is_undone_by(Footprint::of(&other.start))
    }

    fn is_better_after_failures(&self, other: &ActionModel) -> bool {
        let mut failures = other.failures.iter();
        failures.any(|failed| self.is_undone_by(Footprint::of_failed(failed)))
    }

    /// Returns `true` if a condition that holds before the end may fail after it.
    fn can_violate(&self, needs: &Needs) -> bool {
        let changed = if self.world.is_monotone {
            self.own.deletes & !self.own.adds
        } else {
            self.own.adds | self.own.deletes
        };
        needs.mentions() & (changed | self.tests) != 0
    }

    /// Returns `true` if the result may depend on the order of `other` and the end.
    fn is_undone_by(&self, other: Footprint) -> bool {
        let own = self.own;
        let changed = if self.world.is_monotone {
            other.deletes & own.adds
        } else {
            (other.deletes | other.adds) & (own.adds | own.deletes | self.reads)
        };
        changed != 0 || (other.sets & own.numbers) | (other.numbers & own.sets) != 0
    }

    /// Returns `true` if `snap` violates the over-all condition, so that the action is aborted.
    fn is_broken_by(&self, snap: &Snap) -> bool {
        snap.deletes & !snap.adds & self.kept != 0
    }
}

impl Footprint {
    fn of(snap: &Snap) -> Self {
        let amounts = || snap.amounts.iter();
        let bit = |all, number: usize| all | 1 << number;
        let setting = amounts().filter(|amount| amount.sets());
        Self {
            adds: snap.adds,
            deletes: snap.deletes,
            numbers: amounts().map(Amount::number).fold(0, bit),
            sets: setting.map(Amount::number).fold(0, bit),
        }
    }

    fn of_failed(failed: &FailureKind) -> Self {
        Self {
            adds: failed.adds,
            deletes: failed.deletes,
            ..Self::default()
        }
    }
}

impl TimedWorld {
    /// Returns the comparisons of these numbers.
    fn tests_of(&self, numbers: u64) -> Facts {
        let tests = self.tests.iter().enumerate();
        let read = tests.filter(|(_, test)| numbers & (1 << test.number) != 0);
        let first = self.facts.len();
        read.fold(0, |all, (place, _)| all | 1 << (first + place))
    }
}
