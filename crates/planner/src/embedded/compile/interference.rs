//! Separations between happenings: distances first, then annotations for the accesses that need
//! them.

use elbowroom_model::Footprint;
use elbowroom_model::Task;
use elbowroom_model::ground::{Condition, FactId, FluentId};

use crate::embedded::hash::Map;
use crate::embedded::time::Ticks;

use super::NONE;
use super::directions::{self, Direction, Shifts};

/// A kind of access to a fact or fluent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Access {
    Added(FactId),
    Deleted(FactId),
    Read(FactId),
    /// An action ended whose over-all condition required the fact.
    NeededTrue(FactId),
    /// An action ended whose over-all condition required the fact to be false.
    NeededFalse(FactId),
    Raised(FluentId),
    Lowered(FluentId),
    Assigned(FluentId),
    ReadValue(FluentId),
    /// An action ended whose over-all condition bounded the fluent from below.
    NeededHigh(FluentId),
    /// An action ended whose over-all condition bounded the fluent from above.
    NeededLow(FluentId),
}

use Access::{
    Added, Assigned, Deleted, Lowered, NeededFalse, NeededHigh, NeededLow, NeededTrue, Raised,
    Read, ReadValue,
};

/// The distances that a happening must keep, and its accesses.
#[derive(Clone, Debug, Default)]
pub(super) struct Separations {
    /// Accesses that the happening must follow, with the minimum distance from the latest one.
    pub(super) after: Vec<(Access, Ticks)>,
    pub(super) makes: Vec<Access>,
}

/// Facts and fluents that over-all conditions read together. The order of their changes matters
/// even where no rule of PDDL separates the changes.
///
/// A change that can break such a condition follows the earlier changes that could have satisfied
/// it. So a condition that holds in the order of choices also holds in time.
#[derive(Debug, Default)]
pub(super) struct Links {
    /// For each access, the accesses that it must not overtake.
    not_overtaken: Map<Access, Vec<Access>>,
    /// `true` if the direction of a change decides whether it can break a condition. Where numbers
    /// depend on times, each change must keep its place in the order.
    has_directions: bool,
}

impl Separations {
    /// Returns the distances and accesses of a happening with this footprint that shifts fluents in
    /// these directions.
    pub(super) fn of(
        footprint: &Footprint,
        shifts: &Shifts,
        epsilon: Ticks,
        links: &Links,
    ) -> Self {
        let mut separations = Self::default();
        for &fact in &footprint.reads {
            separations.after([Added(fact), Deleted(fact)], epsilon);
            separations.makes.push(Read(fact));
        }
        for &fact in &footprint.adds {
            separations.after([Deleted(fact), Read(fact)], epsilon);
            separations.after([NeededFalse(fact)], 0);
            separations.makes.push(Added(fact));
        }
        for &fact in &footprint.deletes {
            separations.after([Added(fact), Read(fact)], epsilon);
            separations.after([NeededTrue(fact)], 0);
            separations.makes.push(Deleted(fact));
        }
        for &fluent in &footprint.reads_fluents {
            separations.after([Raised(fluent), Lowered(fluent), Assigned(fluent)], epsilon);
            separations.makes.push(ReadValue(fluent));
        }
        for &fluent in &footprint.shifts {
            separations.after([Assigned(fluent), ReadValue(fluent)], epsilon);
            let direction = links.direction(shifts.of_fluent(fluent));
            if direction.up {
                separations.after([NeededLow(fluent)], 0);
                separations.makes.push(Raised(fluent));
            }
            if direction.down {
                separations.after([NeededHigh(fluent)], 0);
                separations.makes.push(Lowered(fluent));
            }
        }
        for &fluent in &footprint.assigns {
            let changes = [Assigned(fluent), Raised(fluent), Lowered(fluent)];
            separations.after(changes, epsilon);
            separations.after([ReadValue(fluent)], epsilon);
            separations.after([NeededHigh(fluent), NeededLow(fluent)], 0);
            separations.makes.push(Assigned(fluent));
        }
        for made in separations.makes.clone() {
            if let Some(overtaken) = links.not_overtaken.get(&made) {
                separations.after(overtaken.iter().copied(), 0);
            }
        }
        separations
    }

    fn after(&mut self, accesses: impl IntoIterator<Item = Access>, distance: Ticks) {
        self.after
            .extend(accesses.into_iter().map(|access| (access, distance)));
    }

    /// Adds the separations that an over-all condition requires at the start of its action: the
    /// facts and fluents that it reads were changed before.
    pub(super) fn add_over_all_start(&mut self, task: &Task, condition: &Condition, links: &Links) {
        for conjunct in condition.conjuncts() {
            for fact in Footprint::of_condition(task, conjunct).reads {
                self.after([Added(fact), Deleted(fact)], 0);
            }
            for (fluent, wanted) in directions::enabling_directions(conjunct) {
                self.after([Assigned(fluent)], 0);
                let wanted = links.direction(wanted);
                if wanted.up {
                    self.after([Raised(fluent)], 0);
                }
                if wanted.down {
                    self.after([Lowered(fluent)], 0);
                }
            }
        }
    }

    /// Adds the accesses of the end of an action by its over-all condition, from which later
    /// happenings must be separated.
    pub(super) fn add_over_all_end(&mut self, task: &Task, condition: &Condition, links: &Links) {
        for conjunct in condition.conjuncts() {
            match conjunct {
                Condition::Fact(fact) if !task.is_derived(*fact) => {
                    self.makes.push(NeededTrue(*fact));
                }
                Condition::Not(part) if matches!(**part, Condition::Fact(fact) if !task.is_derived(fact)) =>
                {
                    part.visit_facts(&mut |fact| self.makes.push(NeededFalse(fact)));
                }
                other => {
                    for fact in Footprint::of_condition(task, other).reads {
                        self.makes.extend([NeededTrue(fact), NeededFalse(fact)]);
                    }
                    for (fluent, wanted) in directions::enabling_directions(other) {
                        let wanted = links.direction(wanted);
                        if wanted.up {
                            self.makes.push(NeededHigh(fluent));
                        }
                        if wanted.down {
                            self.makes.push(NeededLow(fluent));
                        }
                    }
                }
            }
        }
    }
}

impl Links {
    /// Returns links without conditions.
    pub(super) fn new(has_directions: bool) -> Self {
        Self {
            not_overtaken: Map::default(),
            has_directions,
        }
    }

    fn direction(&self, direction: Direction) -> Direction {
        if self.has_directions {
            direction
        } else {
            Direction::BOTH
        }
    }

    /// Adds an over-all condition.
    pub(super) fn note(&mut self, task: &Task, condition: &Condition) {
        for conjunct in condition.conjuncts() {
            let is_literal = match conjunct {
                Condition::Fact(fact) => !task.is_derived(*fact),
                Condition::Not(part) => {
                    matches!(**part, Condition::Fact(fact) if !task.is_derived(fact))
                }
                _ => false,
            };
            if is_literal {
                continue;
            }
            let (mut mending, mut spoiling) = (Vec::new(), Vec::new());
            for fact in Footprint::of_condition(task, conjunct).reads {
                mending.extend([Added(fact), Deleted(fact)]);
                spoiling.extend([Added(fact), Deleted(fact)]);
            }
            for (fluent, wanted) in directions::enabling_directions(conjunct) {
                mending.push(Assigned(fluent));
                spoiling.push(Assigned(fluent));
                let wanted = self.direction(wanted);
                if wanted.up {
                    mending.push(Raised(fluent));
                    spoiling.push(Lowered(fluent));
                }
                if wanted.down {
                    mending.push(Lowered(fluent));
                    spoiling.push(Raised(fluent));
                }
            }
            for access in spoiling {
                let overtaken = self.not_overtaken.entry(access).or_default();
                for &mended in &mending {
                    if !overtaken.contains(&mended) {
                        overtaken.push(mended);
                    }
                }
            }
        }
    }
}

/// Numbers of the accesses that some happening makes and some happening waits for.
#[derive(Debug)]
pub(super) struct Annotations {
    numbers: Map<Access, u32>,
    count: usize,
}

impl Annotations {
    pub(super) fn of<'a>(separations: impl Iterator<Item = &'a Separations> + Clone) -> Self {
        let mut numbers: Map<Access, u32> = Map::default();
        for separation in separations.clone() {
            for &access in &separation.makes {
                numbers.insert(access, NONE);
            }
        }
        let mut count = 0;
        for separation in separations {
            for (access, _) in &separation.after {
                if let Some(number) = numbers.get_mut(access)
                    && *number == NONE
                {
                    *number = count;
                    count += 1;
                }
            }
        }
        Self {
            numbers,
            count: count as usize,
        }
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Returns the annotations of the latest addition and deletion of a fact.
    pub(super) fn of_fact(&self, fact: FactId) -> [u32; 2] {
        [Added(fact), Deleted(fact)].map(|access| self.number(access).unwrap_or(NONE))
    }

    /// Returns `true` if some happening has this access to the state, and another happening has to
    /// wait for it.
    pub(super) fn has(&self, access: Access) -> bool {
        self.number(access).is_some()
    }

    fn number(&self, access: Access) -> Option<u32> {
        let number = *self.numbers.get(&access)?;
        (number != NONE).then_some(number)
    }

    /// Returns the annotations that a happening must be separated from, each with the largest
    /// required distance.
    pub(super) fn after(&self, separations: &Separations) -> Vec<(u32, Ticks)> {
        let mut list: Vec<(u32, Ticks)> = separations
            .after
            .iter()
            .filter_map(|&(access, distance)| Some((self.number(access)?, distance)))
            .collect();
        list.sort_unstable_by_key(|&(annotation, distance)| (annotation, -distance));
        list.dedup_by_key(|&mut (annotation, _)| annotation);
        list
    }

    /// Returns the annotations that a happening sets.
    pub(super) fn marks(&self, separations: &Separations) -> Vec<u32> {
        let mut list: Vec<u32> = separations
            .makes
            .iter()
            .filter_map(|&access| self.number(access))
            .collect();
        list.sort_unstable();
        list.dedup();
        list
    }
}

/// For each access, the timed initials that must keep a distance after it.
#[derive(Debug, Default)]
pub(super) struct TimedSeparations(Map<Access, Vec<(u32, Ticks)>>);

impl TimedSeparations {
    pub(super) fn of(timed: &[Separations]) -> Self {
        let mut waiting: Map<Access, Vec<(u32, Ticks)>> = Map::default();
        for (number, separations) in timed.iter().enumerate() {
            let number = u32::try_from(number).expect("fewer than 2^32 timed initials");
            for &(access, distance) in &separations.after {
                waiting.entry(access).or_default().push((number, distance));
            }
        }
        Self(waiting)
    }

    /// Returns the timed initials that must keep a distance after these accesses, if they come
    /// later.
    pub(super) fn before(&self, makes: &[Access]) -> Vec<(u32, Ticks)> {
        if self.0.is_empty() {
            return Vec::new();
        }
        let mut list: Vec<(u32, Ticks)> = makes
            .iter()
            .filter_map(|access| self.0.get(access))
            .flatten()
            .copied()
            .collect();
        list.sort_unstable_by_key(|&(timed, distance)| (timed, -distance));
        list.dedup_by_key(|&mut (timed, _)| timed);
        list
    }
}
