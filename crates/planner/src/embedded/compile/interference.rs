//! Which happenings must keep what distance: wishes first, then stamps for those that matter.

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, Expression, FactId, FluentId};
use elbowroom_model::{Footprint, TimedHappening};

use crate::embedded::hash::Map;
use crate::embedded::time::Ticks;

use super::NONE;

/// Something that happened to a fact or fluent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Access {
    Added(FactId),
    Deleted(FactId),
    Read(FactId),
    /// An action ended that needed the fact true throughout.
    NeededTrue(FactId),
    /// An action ended that needed the fact false throughout.
    NeededFalse(FactId),
    Shifted(FluentId),
    Assigned(FluentId),
    ReadValue(FluentId),
    /// An action ended that needed something of the fluent throughout.
    NeededValue(FluentId),
}

use Access::{
    Added, Assigned, Deleted, NeededFalse, NeededTrue, NeededValue, Read, ReadValue, Shifted,
};

/// What a happening reads and writes; like the judge's [`Footprint`], in plain lists.
#[derive(Clone, Debug, Default)]
pub(super) struct Touches {
    pub(super) reads: Vec<FactId>,
    pub(super) adds: Vec<FactId>,
    pub(super) deletes: Vec<FactId>,
    pub(super) reads_fluents: Vec<FluentId>,
    pub(super) shifts: Vec<FluentId>,
    pub(super) assigns: Vec<FluentId>,
}

/// The distances a happening must keep, and the accesses it makes.
#[derive(Clone, Debug, Default)]
pub(super) struct Wishes {
    /// At least so long after the last access of that kind.
    pub(super) after: Vec<(Access, Ticks)>,
    pub(super) makes: Vec<Access>,
}

/// Facts and fluents that over-all conditions read together, so that the order in which they
/// change matters even where no rule of PDDL keeps the changes apart.
#[derive(Debug, Default)]
pub(super) struct Links {
    facts: Map<FactId, Vec<Access>>,
    fluents: Map<FluentId, Vec<Access>>,
}

impl Touches {
    /// Those of the start, or of the instant.
    pub(super) fn of_start(task: &Task, action: &Action) -> Self {
        let mut touches = Self::default();
        match &action.body {
            Body::Instantaneous(snap) => {
                touches.condition(task, &snap.condition);
                touches.effects(task, &snap.effects);
            }
            Body::Durative(body) => {
                touches.condition(task, &body.start.condition);
                touches.effects(task, &body.start.effects);
                for bound in body.duration.iter().filter(|bound| !bound.at_end) {
                    touches.expression(&bound.bound);
                }
                for effect in &body.end.effects {
                    touches.condition(task, &effect.guard.at_start);
                }
                for effect in &body.continuous {
                    touches.condition(task, &effect.guard.at_start);
                    touches.expression(&effect.rate);
                    touches.shifts.push(effect.fluent);
                }
            }
        }
        touches.sorted()
    }

    /// Those of the end.
    pub(super) fn of_end(task: &Task, action: &Action) -> Self {
        let mut touches = Self::default();
        if let Some(body) = action.durative() {
            touches.condition(task, &body.end.condition);
            touches.effects(task, &body.end.effects);
            for bound in body.duration.iter().filter(|bound| bound.at_end) {
                touches.expression(&bound.bound);
            }
            touches
                .shifts
                .extend(body.continuous.iter().map(|effect| effect.fluent));
        }
        touches.sorted()
    }

    pub(super) fn of_footprint(footprint: Footprint) -> Self {
        Self {
            reads: footprint.reads.into_iter().collect(),
            adds: footprint.adds.into_iter().collect(),
            deletes: footprint.deletes.into_iter().collect(),
            reads_fluents: footprint.reads_fluents.into_iter().collect(),
            shifts: footprint.shifts.into_iter().collect(),
            assigns: footprint.assigns.into_iter().collect(),
        }
    }

    pub(super) fn of_timed(timed: &TimedHappening) -> Self {
        Self::of_footprint(Footprint::of_timed(timed))
    }

    /// What a condition reads.
    pub(super) fn of_condition(task: &Task, condition: &Condition) -> Self {
        let mut touches = Self::default();
        touches.condition(task, condition);
        touches.sorted()
    }

    fn effects(&mut self, task: &Task, effects: &[elbowroom_model::ground::Effect]) {
        for effect in effects {
            self.condition(task, &effect.guard.now);
            match &effect.change {
                Change::Add(fact) => self.adds.push(*fact),
                Change::Delete(fact) => self.deletes.push(*fact),
                Change::Update {
                    operator,
                    fluent,
                    value,
                } => {
                    if operator.is_additive() {
                        self.shifts.push(*fluent);
                    } else {
                        self.assigns.push(*fluent);
                    }
                    self.expression(value);
                }
            }
        }
    }

    fn condition(&mut self, task: &Task, condition: &Condition) {
        if condition.is_trivial() {
            return;
        }
        if task.rules().is_empty() {
            condition.visit_facts(&mut |fact| self.reads.push(fact));
            condition.visit_fluents(&mut |fluent| self.reads_fluents.push(fluent));
        } else {
            task.visit_facts_of(condition, &mut |fact| self.reads.push(fact));
            task.visit_fluents_of(condition, &mut |fluent| self.reads_fluents.push(fluent));
        }
    }

    fn expression(&mut self, expression: &Expression) {
        expression.visit_fluents(&mut |fluent| self.reads_fluents.push(fluent));
    }

    fn sorted(mut self) -> Self {
        for facts in [&mut self.reads, &mut self.adds, &mut self.deletes] {
            facts.sort_unstable();
            facts.dedup();
        }
        for fluents in [&mut self.reads_fluents, &mut self.shifts, &mut self.assigns] {
            fluents.sort_unstable();
            fluents.dedup();
        }
        self
    }

    /// The distances and accesses of a happening that touches this.
    pub(super) fn wishes(&self, epsilon: Ticks, links: &Links) -> Wishes {
        let mut wishes = Wishes::default();
        for &fact in &self.reads {
            wishes.after([Added(fact), Deleted(fact)], epsilon);
            wishes.makes.push(Read(fact));
        }
        for &fact in &self.adds {
            wishes.after([Deleted(fact), Read(fact)], epsilon);
            wishes.after([NeededFalse(fact)], 0);
            wishes.makes.push(Added(fact));
        }
        for &fact in &self.deletes {
            wishes.after([Added(fact), Read(fact)], epsilon);
            wishes.after([NeededTrue(fact)], 0);
            wishes.makes.push(Deleted(fact));
        }
        for &fluent in &self.reads_fluents {
            wishes.after([Shifted(fluent), Assigned(fluent)], epsilon);
            wishes.makes.push(ReadValue(fluent));
        }
        for &fluent in &self.shifts {
            wishes.after([Assigned(fluent), ReadValue(fluent)], epsilon);
            wishes.after([NeededValue(fluent)], 0);
            wishes.makes.push(Shifted(fluent));
        }
        for &fluent in &self.assigns {
            wishes.after(
                [Assigned(fluent), Shifted(fluent), ReadValue(fluent)],
                epsilon,
            );
            wishes.after([NeededValue(fluent)], 0);
            wishes.makes.push(Assigned(fluent));
        }
        for fact in self.adds.iter().chain(&self.deletes) {
            if let Some(linked) = links.facts.get(fact) {
                wishes.after(linked.iter().copied(), 0);
            }
        }
        for fluent in self.shifts.iter().chain(&self.assigns) {
            if let Some(linked) = links.fluents.get(fluent) {
                wishes.after(linked.iter().copied(), 0);
            }
        }
        wishes
    }
}

impl Wishes {
    fn after(&mut self, accesses: impl IntoIterator<Item = Access>, distance: Ticks) {
        self.after
            .extend(accesses.into_iter().map(|access| (access, distance)));
    }

    /// Adds what the start of an action needs for its over-all condition: what it reads was
    /// brought about by then.
    pub(super) fn need_from_now_on(&mut self, touches: &Touches) {
        for &fact in &touches.reads {
            self.after([Added(fact), Deleted(fact)], 0);
        }
        for &fluent in &touches.reads_fluents {
            self.after([Shifted(fluent), Assigned(fluent)], 0);
        }
    }

    /// Adds what the end of an action tells those who come later about its over-all condition.
    pub(super) fn needed_until_now(&mut self, task: &Task, condition: &Condition) {
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
                    let touches = Touches::of_condition(task, other);
                    for fact in touches.reads {
                        self.makes.extend([NeededTrue(fact), NeededFalse(fact)]);
                    }
                    for fluent in touches.reads_fluents {
                        self.makes.push(NeededValue(fluent));
                    }
                }
            }
        }
    }
}

impl Links {
    /// Notes an over-all condition.
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
            let touches = Touches::of_condition(task, conjunct);
            let accesses: Vec<Access> = touches
                .reads
                .iter()
                .flat_map(|&fact| [Added(fact), Deleted(fact)])
                .chain(
                    touches
                        .reads_fluents
                        .iter()
                        .flat_map(|&fluent| [Shifted(fluent), Assigned(fluent)]),
                )
                .collect();
            for &fact in &touches.reads {
                merge(self.facts.entry(fact).or_default(), &accesses);
            }
            for &fluent in &touches.reads_fluents {
                merge(self.fluents.entry(fluent).or_default(), &accesses);
            }
        }
    }
}

fn merge(list: &mut Vec<Access>, new: &[Access]) {
    for access in new {
        if !list.contains(access) {
            list.push(*access);
        }
    }
}

/// Numbers for the accesses that someone makes and someone waits for.
#[derive(Debug)]
pub(super) struct Stamps {
    numbers: Map<Access, u32>,
    count: usize,
}

impl Stamps {
    pub(super) fn of<'a>(wishes: impl Iterator<Item = &'a Wishes> + Clone) -> Self {
        let mut numbers: Map<Access, u32> = Map::default();
        for wish in wishes.clone() {
            for &access in &wish.makes {
                numbers.insert(access, NONE);
            }
        }
        let mut count = 0;
        for wish in wishes {
            for (access, _) in &wish.after {
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

    /// The stamps of the latest addition and deletion of a fact.
    pub(super) fn of_fact(&self, fact: FactId) -> [u32; 2] {
        [Added(fact), Deleted(fact)].map(|access| self.number(access).unwrap_or(NONE))
    }

    /// Whether someone makes the access and someone waits for it.
    pub(super) fn has(&self, access: Access) -> bool {
        self.number(access).is_some()
    }

    fn number(&self, access: Access) -> Option<u32> {
        let number = *self.numbers.get(&access)?;
        (number != NONE).then_some(number)
    }

    /// The stamps to keep away from, each once with its largest distance.
    pub(super) fn after(&self, wishes: &Wishes) -> Vec<(u32, Ticks)> {
        let mut list: Vec<(u32, Ticks)> = wishes
            .after
            .iter()
            .filter_map(|&(access, distance)| Some((self.number(access)?, distance)))
            .collect();
        list.sort_unstable_by_key(|&(stamp, distance)| (stamp, -distance));
        list.dedup_by_key(|&mut (stamp, _)| stamp);
        list
    }

    /// The stamps to set.
    pub(super) fn marks(&self, wishes: &Wishes) -> Vec<u32> {
        let mut list: Vec<u32> = wishes
            .makes
            .iter()
            .filter_map(|&access| self.number(access))
            .collect();
        list.sort_unstable();
        list.dedup();
        list
    }
}

/// For each access, the timed initials that must come some distance after it.
#[derive(Debug, Default)]
pub(super) struct TimedWishes(Map<Access, Vec<(u32, Ticks)>>);

impl TimedWishes {
    pub(super) fn of(timed: &[Wishes]) -> Self {
        let mut waiting: Map<Access, Vec<(u32, Ticks)>> = Map::default();
        for (number, wishes) in timed.iter().enumerate() {
            let number = u32::try_from(number).expect("fewer than 2^32 timed initials");
            for &(access, distance) in &wishes.after {
                waiting.entry(access).or_default().push((number, distance));
            }
        }
        Self(waiting)
    }

    /// The timed initials that must come some distance after these accesses, if they come later.
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
