//! Interchangeable objects: exchanging them does not change the problem.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::ground::{Change, Condition, FactId, FluentId};
use elbowroom_model::problem::ObjectId;

use super::{Closure, FIRST_START, NOW, Node, RunningProcess, ZERO};
use crate::no_plan::NoPlanFlaw;

/// Exchange of two objects, as a mapping of facts, fluents and processes.
#[derive(Debug)]
pub(in crate::no_plan) struct Exchange {
    facts: BTreeMap<FactId, FactId>,
    fluents: BTreeMap<FluentId, FluentId>,
    processes: Vec<usize>,
}

/// Returns the exchanges of neighbours in classes of interchangeable objects.
///
/// # Errors
/// When an exchange changes the problem.
pub(super) fn exchanges(
    closure: &Closure<'_>,
    alike: &[Vec<ObjectId>],
) -> Result<Vec<Exchange>, NoPlanFlaw> {
    let pairs = alike.iter().flat_map(|class| class.windows(2));
    let pairs = pairs.map(|pair| (pair[0], pair[1]));
    pairs
        .map(|pair| {
            let name = |object: ObjectId| {
                closure.task().problem().objects[object.index()]
                    .name
                    .clone()
            };
            let not_alike = || NoPlanFlaw::NotInterchangeable(name(pair.0), name(pair.1));
            closure.exchange(pair).ok_or_else(not_alike)
        })
        .collect()
}

impl Exchange {
    /// Returns the state after the exchange.
    pub(super) fn image(&self, node: &Node) -> Node {
        let mut under_way: Vec<(RunningProcess, usize)> = Vec::new();
        for (place, own) in node.running.iter().enumerate() {
            let process = self.processes[own.process];
            under_way.push((
                RunningProcess {
                    process,
                    ..own.clone()
                },
                FIRST_START + place,
            ));
        }
        under_way.sort();
        let starts = under_way.iter().map(|own| own.1);
        let order: Vec<usize> = [ZERO, NOW].into_iter().chain(starts).collect();
        let fact = |own: &FactId| self.facts.get(own).copied().unwrap_or(*own);
        let fluent = |own: &FluentId| self.fluents.get(own).copied().unwrap_or(*own);
        let values = node.values.iter();
        Node {
            zone: node.zone.select(&order),
            running: under_way.into_iter().map(|own| own.0).collect(),
            timed: node.timed,
            facts: node.facts.iter().map(fact).collect(),
            values: values
                .map(|(own, value)| (fluent(own), value.clone()))
                .collect(),
        }
    }
}

impl Closure<'_> {
    /// Returns `true` if two objects are interchangeable.
    pub fn are_interchangeable(&self, one: ObjectId, other: ObjectId) -> bool {
        self.exchange((one, other)).is_some()
    }

    fn task(&self) -> &Task {
        &self.instances().task
    }

    /// Returns the exchange of two objects, or `None` if it changes the problem. The domain must
    /// mention neither object. Constant facts and numbers that are read, timed initials, the goal
    /// and the actions must be the same after the exchange.
    fn exchange(&self, pair: (ObjectId, ObjectId)) -> Option<Exchange> {
        let task = self.task();
        let problem = task.problem();
        let types = |object: ObjectId| &problem.objects[object.index()].types;
        let is_named = pair.0.index() < problem.constants || pair.1.index() < problem.constants;
        if pair.0 == pair.1 || is_named || types(pair.0) != types(pair.1) {
            return None;
        }
        let swapped = |objects: &[ObjectId]| -> Vec<ObjectId> {
            let swap = |&object: &ObjectId| match object {
                own if own == pair.0 => pair.1,
                own if own == pair.1 => pair.0,
                own => own,
            };
            objects.iter().map(swap).collect()
        };
        let fact = |own: FactId| {
            let (predicate, objects) = task.atom(own);
            task.find_fact(predicate, &swapped(&objects))
        };
        let fluent = |own: FluentId| {
            let (function, objects) = task.application(own);
            task.find_fluent(function, &swapped(&objects))
        };
        let initial = task.initial();
        let mut facts = BTreeMap::new();
        for &own in &self.read {
            let image = fact(own)?;
            if self.facts.contains(&own) != self.facts.contains(&image) {
                return None;
            }
            let is_same = initial.facts.contains(&own) == initial.facts.contains(&image);
            if self.facts.contains(&own) {
                facts.insert(own, image);
            } else if !is_same {
                return None;
            }
        }
        let mut fluents = BTreeMap::new();
        for &own in &self.read_fluents {
            let image = fluent(own)?;
            if self.fluents.contains(&own) != self.fluents.contains(&image)
                || self.flowing.contains(&own) != self.flowing.contains(&image)
            {
                return None;
            }
            if self.fluents.contains(&own) {
                fluents.insert(own, image);
            } else if initial.values.get(&own) != initial.values.get(&image) {
                return None;
            }
        }
        let map = Map {
            fact: &fact,
            fluent: &fluent,
        };
        if !self
            .timed
            .iter()
            .all(|own| self.is_preserved(&own.changes, &map))
            || !map.is_same(task.goal(), task.goal())
        {
            return None;
        }
        let mut processes = Vec::new();
        for process in &self.processes {
            let arguments = swapped(&process.arguments);
            let is_begun = process.initial_start.is_some();
            if is_begun && arguments != process.arguments {
                return None;
            }
            let image = self.number_of(&process.title_with(task, &arguments))?;
            let other = &self.processes[image];
            let literals = process.over_all.iter();
            let literals: Option<BTreeSet<_>> =
                literals.map(|own| Some((fact(own.0)?, own.1))).collect();
            let theirs: BTreeSet<_> = other.over_all.iter().copied().collect();
            let bounds = (&process.least, &process.most);
            if literals? != theirs || bounds != (&other.least, &other.most) {
                return None;
            }
            processes.push(image);
        }
        Some(Exchange {
            facts,
            fluents,
            processes,
        })
    }

    /// Returns `true` if the timed initials of one time stay the same.
    fn is_preserved(&self, changes: &[Change], map: &Map<'_>) -> bool {
        let mut own = BTreeSet::new();
        let mut images = BTreeSet::new();
        for change in changes {
            match change {
                Change::Add(fact) | Change::Delete(fact) => {
                    let truth = matches!(change, Change::Add(_));
                    if self.facts.contains(fact) {
                        own.insert((truth, Some(*fact)));
                        images.insert((truth, (map.fact)(*fact)));
                    }
                }
                // Changes of numbers are not compared: the exchange must keep the fluent.
                Change::Update { fluent, .. } => {
                    if self.read_fluents.contains(fluent) && (map.fluent)(*fluent) != Some(*fluent)
                    {
                        return false;
                    }
                }
            }
        }
        own == images
    }
}

struct Map<'a> {
    fact: &'a dyn Fn(FactId) -> Option<FactId>,
    fluent: &'a dyn Fn(FluentId) -> Option<FluentId>,
}

impl Map<'_> {
    /// Returns `true` if the exchange maps a condition to another one, in any order of its parts.
    fn is_same(&self, own: &Condition, other: &Condition) -> bool {
        match (own, other) {
            (Condition::Fact(own), Condition::Fact(other)) => (self.fact)(*own) == Some(*other),
            (Condition::Not(own), Condition::Not(other)) => self.is_same(own, other),
            (Condition::And(own), Condition::And(other))
            | (Condition::Or(own), Condition::Or(other)) => {
                let is_matched = |part: &Condition| other.iter().any(|own| self.is_same(part, own));
                let is_met = |part: &Condition| own.iter().any(|own| self.is_same(own, part));
                own.iter().all(is_matched) && other.iter().all(is_met)
            }
            (
                Condition::Compare(comparison, left, right),
                Condition::Compare(theirs, their_left, their_right),
            ) => {
                let mut is_known = true;
                let mut image = |own: &elbowroom_model::ground::Expression| {
                    own.map_fluents(&mut |fluent| {
                        (self.fluent)(*fluent).unwrap_or_else(|| {
                            is_known = false;
                            *fluent
                        })
                    })
                };
                let (left, right) = (image(left), image(right));
                is_known && comparison == theirs && left == *their_left && right == *their_right
            }
            _ => false,
        }
    }
}
