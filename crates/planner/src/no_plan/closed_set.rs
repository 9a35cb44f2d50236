//! Closed sets of states: all states that are reachable by the checker's rules. They are computed
//! first without times, and then, if necessary, with bounds on times.

use std::collections::{BTreeMap, VecDeque};

use elbowroom_model::Task;
use elbowroom_model::problem::ObjectId;
use elbowroom_num::Rational;
use elbowroom_verify::no_plan::closed::zone::Zone;
use elbowroom_verify::no_plan::closed::{
    ClosedSet, Closure, FIRST_START, NOW, Node, RunningProcess, ZERO,
};
use elbowroom_verify::no_plan::{Instances, ReachedFacts};

use super::{Effort, EffortExhausted};

/// Maximum number of states.
const MAX_STATES: usize = 5_000;

/// Maximum number of generated states.
const MAX_GENERATED: usize = 200_000;

/// Maximum number of running actions. Without it, an action that may overlap itself could run any
/// number of times.
const MAX_RUNNING: usize = 6;

/// Work for the expansion of a state, and for each generated state: see [`Effort`].
const STATE_WORK: u64 = 500;

/// Work for each process whose condition is tested in an expansion, both in the search and in the
/// verification.
const PROCESS_WORK: u64 = 5;

/// Reasons for a missing closed set.
pub(super) enum Failure {
    Unknown(String),
    TooMany,
    /// The goal is reachable by the checker's rules.
    Reachable,
    Stopped,
}

/// Computes a closed set of states without a goal state.
pub(super) fn closed_set(
    task: &Task,
    instances: &Instances,
    reached: &ReachedFacts,
    effort: &mut Effort<'_>,
) -> Result<ClosedSet, Failure> {
    let alike = interchangeable_objects(task, instances, reached)?;
    let closure = Closure::of(instances, reached, &alike);
    let closure = closure.map_err(|flaw| Failure::Unknown(flaw.to_string()))?;
    let states = match states(&closure, false, effort) {
        Err(Failure::Reachable | Failure::TooMany) => states(&closure, true, effort)?,
        other => other?,
    };
    let name = |object: &ObjectId| task.problem().objects[object.index()].name.clone();
    let alike = alike.iter().map(|class| class.iter().map(name).collect());
    Ok(ClosedSet {
        alike: alike.collect(),
        states: states
            .iter()
            .map(|node| closure.format_state(node))
            .collect(),
    })
}

/// Returns classes of interchangeable objects. Each object joins the first class whose last member
/// is interchangeable with it.
fn interchangeable_objects(
    task: &Task,
    instances: &Instances,
    reached: &ReachedFacts,
) -> Result<Vec<Vec<ObjectId>>, Failure> {
    let none = Closure::of(instances, reached, &[]);
    let none = none.map_err(|flaw| Failure::Unknown(flaw.to_string()))?;
    let mut classes: Vec<Vec<ObjectId>> = Vec::new();
    for number in task.problem().constants..task.problem().objects.len() {
        let object = ObjectId::from(number);
        let is_like = |class: &&mut Vec<ObjectId>| {
            class
                .last()
                .is_some_and(|&last| none.are_interchangeable(last, object))
        };
        match classes.iter_mut().find(is_like) {
            Some(class) => class.push(object),
            None => classes.push(vec![object]),
        }
    }
    classes.retain(|class| class.len() > 1);
    Ok(classes)
}

/// Returns the reachable states, without states that others cover.
fn states(
    closure: &Closure<'_>,
    with_times: bool,
    effort: &mut Effort<'_>,
) -> Result<Vec<Node>, Failure> {
    let last = closure.times().last().cloned();
    let mut known: BTreeMap<(Vec<RunningProcess>, usize), Vec<usize>> = BTreeMap::new();
    let mut nodes: Vec<Option<Node>> = Vec::new();
    let mut open = VecDeque::new();
    let mut count = 0;
    let mut made = 0;
    let mut add = |node: Node, nodes: &mut Vec<Option<Node>>, open: &mut VecDeque<usize>| {
        made += 1;
        if node.running.len() > MAX_RUNNING {
            return Err(Failure::TooMany);
        }
        // The verifier also compares states with the listed ones before bounds are widened.
        let mut node = closure.canonical(node);
        node.zone = if with_times {
            widened(&node, closure.times().len(), last.as_ref())
        } else {
            Zone::any(node.zone.size())
        };
        if closure.is_goal(&node) {
            return Err(Failure::Reachable);
        }
        let alike = known.entry((node.running.clone(), node.timed)).or_default();
        let covers = |own: &usize| {
            nodes[*own]
                .as_ref()
                .is_some_and(|own| closure.covers(own, &node))
        };
        if alike.iter().any(covers) {
            return Ok(());
        }
        alike.retain(|&own| {
            let is_covered = nodes[own]
                .as_ref()
                .is_some_and(|own| closure.covers(&node, own));
            if is_covered {
                nodes[own] = None;
                count -= 1;
            }
            !is_covered
        });
        alike.push(nodes.len());
        open.push_back(nodes.len());
        nodes.push(Some(node));
        count += 1;
        if count > MAX_STATES || made > MAX_GENERATED {
            return Err(Failure::TooMany);
        }
        Ok(())
    };
    add(closure.initial(), &mut nodes, &mut open)?;
    let tests = PROCESS_WORK * closure.process_count() as u64;
    while let Some(next) = open.pop_front() {
        let Some(node) = nodes[next].clone() else {
            continue;
        };
        let after = closure.successors(&node);
        let after = after.map_err(|flaw| Failure::Unknown(flaw.to_string()))?;
        let work = STATE_WORK * (1 + after.len() as u64) + tests;
        effort
            .spend(work)
            .map_err(|EffortExhausted| Failure::Stopped)?;
        for node in after {
            add(node, &mut nodes, &mut open)?;
        }
    }
    Ok(nodes.into_iter().flatten().collect())
}

/// Returns the zone with only the relevant bounds: those on the present time until the last timed
/// initial, and those on the elapsed times of running actions up to the durations that they must
/// have.
fn widened(node: &Node, timed: usize, last: Option<&Rational>) -> Zone {
    let mut zone = node.zone.clone();
    let size = zone.size();
    if node.timed >= timed || last.is_none() {
        for time in NOW..size {
            zone.forget(time, ZERO);
            zone.forget(ZERO, time);
        }
    }
    for (place, own) in node.running.iter().enumerate() {
        if own.most.is_some() {
            continue;
        }
        // Without a maximum duration, the zone only records whether the minimum duration has
        // passed.
        let start = FIRST_START + place;
        let has_passed = zone.get(start, NOW).is_some_and(|most| -most >= own.least);
        for time in ZERO..size {
            zone.forget(time, start);
            zone.forget(start, time);
        }
        if has_passed {
            zone.limit(start, NOW, &-&own.least);
        } else {
            zone.limit(start, NOW, &Rational::ZERO);
        }
    }
    zone
}
