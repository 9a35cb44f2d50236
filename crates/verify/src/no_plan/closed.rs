//! Closed sets of states: every happening leads from one of the states to one of them, and the goal
//! holds in none.
//!
//! A state ([`Node`]) consists of the facts and numbers after a happening (only those that
//! something reads), the running actions, the number of timed initials that have happened, and
//! bounds on the differences of times: the current time, the starts of running actions, and time 0.
//! The rules for the next happening ([`Closure::successors`]) cover all steps of a valid plan in
//! the order of time (`processes`). They do not require ε between happenings, and they do not
//! require that disjunctions and conditions on numbers hold throughout actions. Numbers that depend
//! on durations or on continuous change may have any value.
//!
//! A listed state covers more than itself. Its bounds cover all times within them. A number that it
//! does not list may have any value. It may have more facts than the covered state if these never
//! do harm (`harmless_when_true`). Interchangeable objects (`alike`) may be exchanged.

mod format;
mod partial_state;
mod relevant_symbols;
pub(super) mod symmetry;
pub mod zone;

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::TimedHappening;
use elbowroom_model::ground::{Change, Effect, FactId, FluentId, SnapAction};
use elbowroom_model::problem::{Comparison, ObjectId};
use elbowroom_num::Rational;

use super::instances::Instances;
use super::processes::Process;
use super::{NoPlanFlaw, ReachedFacts};
pub use format::{ClosedSet, ClosedState};
use partial_state::{View, updated};
use symmetry::Exchange;
use zone::Zone;

/// Positions of time 0, of the current time, and of the first start of a running action among the
/// times of a state.
pub const ZERO: usize = 0;
/// See [`ZERO`].
pub const NOW: usize = 1;
/// See [`ZERO`].
pub const FIRST_START: usize = 2;

/// A running action, with the least and the greatest duration that it may have.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RunningProcess {
    pub(super) process: usize,
    /// Least duration.
    pub least: Rational,
    /// Greatest duration; `None`: unbounded.
    pub most: Option<Rational>,
}

/// A state.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Node {
    /// Running actions, sorted.
    pub running: Vec<RunningProcess>,
    /// Number of pending timed initials that have happened.
    pub timed: usize,
    pub(super) facts: BTreeSet<FactId>,
    pub(super) values: BTreeMap<FluentId, Rational>,
    /// Bounds on times.
    pub zone: Zone,
}

/// Successor relation of a problem.
#[derive(Debug)]
pub struct Closure<'a> {
    instances: &'a Instances,
    processes: Vec<Process>,
    timed: &'a [TimedHappening],
    /// Facts and fluents that something reads.
    read: BTreeSet<FactId>,
    read_fluents: BTreeSet<FluentId>,
    /// Read fluents that change continuously; they may have any value.
    flowing: BTreeSet<FluentId>,
    /// Facts that something reads and something changes.
    pub(super) facts: BTreeSet<FactId>,
    /// Changing facts that do no harm when they are true.
    harmless_when_true: BTreeSet<FactId>,
    pub(super) fluents: BTreeSet<FluentId>,
    /// Processes by title. An action that may start and one that is running initially have
    /// different titles.
    names: BTreeMap<String, usize>,
    exchanges: Vec<Exchange>,
}

/// Largest number of effects of one happening whose conditions may be undecided.
const MAX_OPEN: usize = 4;

impl<'a> Closure<'a> {
    /// Creates the closure of the instances that the list of facts allows, with classes of
    /// interchangeable objects.
    ///
    /// # Errors
    /// When the problem has an unsupported feature, or objects are not interchangeable.
    pub fn of(
        instances: &'a Instances,
        reached: &ReachedFacts,
        alike: &[Vec<ObjectId>],
    ) -> Result<Self, NoPlanFlaw> {
        if !instances.task.problem().rules.is_empty() {
            return Err(NoPlanFlaw::Unknown("derived predicates among states"));
        }
        let processes = instances.processes(reached);
        let reading = relevant_symbols::RelevantSymbols::of(instances, &processes);
        let mut names = BTreeMap::new();
        for (number, process) in processes.iter().enumerate() {
            if names.insert(process.title(), number).is_some() {
                return Err(NoPlanFlaw::Unknown("an action with two running instances"));
            }
        }
        let mut closure = Self {
            instances,
            timed: &instances.initial.timed,
            read: reading.read,
            read_fluents: reading.read_fluents,
            flowing: reading.flowing,
            facts: reading.facts,
            harmless_when_true: reading.harmless_when_true,
            fluents: reading.fluents,
            names,
            exchanges: Vec::new(),
            processes,
        };
        closure.exchanges = symmetry::exchanges(&closure, alike)?;
        Ok(closure)
    }

    /// Returns the initial state.
    pub fn initial(&self) -> Node {
        let state = self.instances.task.initial();
        let now = &self.instances.initial.now;
        let mut under_way = Vec::new();
        let mut starts = Vec::new();
        for (process, own) in self.processes.iter().enumerate() {
            if let Some(begun) = &own.initial_start {
                let (least, most) = (own.least.clone(), own.most.clone());
                under_way.push(RunningProcess {
                    process,
                    least,
                    most,
                });
                starts.push(begun);
            }
        }
        let mut zone = Zone::any(FIRST_START + starts.len());
        for (place, time) in [now].into_iter().chain(starts).enumerate() {
            zone.limit(NOW + place, ZERO, time);
            zone.limit(ZERO, NOW + place, &-time);
        }
        let _ = zone.close();
        let values = state
            .values
            .iter()
            .filter(|(own, _)| self.fluents.contains(own));
        Node {
            running: under_way,
            timed: 0,
            facts: state.facts.intersection(&self.facts).copied().collect(),
            values: values.map(|(own, value)| (*own, value.clone())).collect(),
            zone,
        }
    }

    /// Returns `true` if the goal may hold in a state without running actions and pending timed
    /// initials.
    pub fn is_goal(&self, node: &Node) -> bool {
        let view = View {
            closure: self,
            node,
            duration: None,
        };
        node.running.is_empty()
            && node.timed == self.timed.len()
            && view.may_hold(self.instances.task.goal())
    }

    /// Returns all states that one happening can lead to.
    ///
    /// # Errors
    /// When too many effects are undecided.
    pub fn successors(&self, node: &Node) -> Result<Vec<Node>, NoPlanFlaw> {
        let mut found = Vec::new();
        for (number, process) in self.processes.iter().enumerate() {
            if process.start.is_some() {
                self.start(node, number, &mut found)?;
            }
        }
        for place in 0..node.running.len() {
            self.end(node, place, &mut found)?;
        }
        if let Some(happening) = self.timed.get(node.timed)
            && let Some(zone) = self.next(node, None, Some(&happening.time))
        {
            let sure: Vec<Effect> = happening.changes.iter().map(always).collect();
            for mut after in self.changed(node, &sure, None)? {
                after.timed += 1;
                after.zone = zone.select(&times(node.running.len(), &zone));
                self.keep(after, &mut found);
            }
        }
        Ok(found)
    }

    /// Returns the number of ground actions and happenings that [`Closure::successors`] tries in
    /// each state.
    pub fn process_count(&self) -> usize {
        self.processes.len()
    }

    fn start(&self, node: &Node, number: usize, found: &mut Vec<Node>) -> Result<(), NoPlanFlaw> {
        let process = &self.processes[number];
        let view = View {
            closure: self,
            node,
            duration: None,
        };
        let snap = process.first();
        if !view.may_hold(&snap.condition) {
            return Ok(());
        }
        let mut own = None;
        if let Some(body) = process.durative() {
            let (mut least, mut most) = (process.least.clone(), process.most.clone());
            for bound in body.duration.iter().filter(|bound| !bound.at_end) {
                let Some(value) = view.value(&bound.bound) else {
                    continue;
                };
                if !matches!(bound.comparison, Comparison::AtMost | Comparison::Less) {
                    least = Rational::max(least, value.clone());
                }
                if !matches!(bound.comparison, Comparison::AtLeast | Comparison::Greater) {
                    most = Some(most.map_or(value.clone(), |most| Rational::min(most, value)));
                }
            }
            if most.as_ref().is_some_and(|most| *most < least) {
                return Ok(());
            }
            own = Some(RunningProcess {
                process: number,
                least,
                most,
            });
        }
        let Some(zone) = self.next(node, None, None) else {
            return Ok(());
        };
        let duration = own
            .as_ref()
            .and_then(|own| (own.most.as_ref() == Some(&own.least)).then(|| own.least.clone()));
        for mut after in self.changed(node, &snap.effects, duration)? {
            let mut order = times(node.running.len(), &zone);
            if let Some(own) = &own {
                let place = after.running.partition_point(|other| other <= own);
                after.running.insert(place, own.clone());
                order.insert(FIRST_START + place, zone.size() - 1);
            }
            after.zone = zone.select(&order);
            self.keep(after, found);
        }
        Ok(())
    }

    fn end(&self, node: &Node, place: usize, found: &mut Vec<Node>) -> Result<(), NoPlanFlaw> {
        let own = &node.running[place];
        let Some(body) = self.processes[own.process].durative() else {
            return Ok(());
        };
        let duration = (own.most.as_ref() == Some(&own.least)).then(|| own.least.clone());
        let view = View {
            closure: self,
            node,
            duration: duration.clone(),
        };
        if !view.may_hold(&body.end.condition) {
            return Ok(());
        }
        let Some(zone) = self.next(node, Some(place), None) else {
            return Ok(());
        };
        for mut after in self.changed(node, &body.end.effects, duration)? {
            after.running.remove(place);
            let mut order = times(node.running.len(), &zone);
            order.remove(FIRST_START + place);
            after.zone = zone.select(&order);
            self.keep(after, found);
        }
        Ok(())
    }

    /// Returns the zone extended by the time of the next happening, as its last time. The happening
    /// is the end of the running action `ends`, a happening at time `at`, or any other one. Returns
    /// `None` if there is no such time.
    fn next(&self, node: &Node, ends: Option<usize>, at: Option<&Rational>) -> Option<Zone> {
        let mut zone = node.zone.with_another();
        let then = zone.size() - 1;
        zone.limit(NOW, then, &Rational::ZERO);
        for (place, own) in node.running.iter().enumerate() {
            if let Some(most) = &own.most {
                zone.limit(then, FIRST_START + place, most);
            }
            if ends == Some(place) {
                zone.limit(FIRST_START + place, then, &-&own.least);
            }
        }
        if let Some(timed) = self.timed.get(node.timed) {
            zone.limit(then, ZERO, &timed.time);
        }
        if let Some(at) = at {
            zone.limit(ZERO, then, &-at);
        }
        zone.close().then_some(zone)
    }

    /// Returns the states after some effects, with unchanged times.
    fn changed(
        &self,
        node: &Node,
        effects: &[Effect],
        duration: Option<Rational>,
    ) -> Result<Vec<Node>, NoPlanFlaw> {
        let view = View {
            closure: self,
            node,
            duration,
        };
        let mut after = node.clone();
        // Additions win over deletions, and all effects read the previous state.
        let (mut sure, mut open): (Vec<&Change>, Vec<&Change>) = (Vec::new(), Vec::new());
        for effect in effects {
            let guard = &effect.guard;
            let is_plain = guard.at_start.is_trivial() && guard.over_all.is_trivial();
            match view.holds(&guard.now) {
                Ok(false) => {}
                Ok(true) if is_plain => sure.push(&effect.change),
                _ => open.push(&effect.change),
            }
        }
        for change in &sure {
            if let Change::Update {
                operator,
                fluent,
                value,
            } = change
                && self.fluents.contains(fluent)
            {
                let old = after.values.remove(fluent);
                if let Some(value) = updated(*operator, old, view.value(value)) {
                    after.values.insert(*fluent, value);
                }
            }
        }
        open.retain(|change| match change {
            Change::Update { fluent, .. } => {
                after.values.remove(fluent);
                false
            }
            Change::Add(fact) | Change::Delete(fact) => self.facts.contains(fact),
        });
        if open.len() > MAX_OPEN {
            return Err(NoPlanFlaw::Unknown("too many undecided effects"));
        }
        let subsets = (0..1_usize << open.len()).map(|subset| {
            let mut own = after.clone();
            let chosen = open
                .iter()
                .enumerate()
                .filter(|(place, _)| subset >> place & 1 == 1);
            let changes: Vec<&&Change> = sure.iter().chain(chosen.map(|own| own.1)).collect();
            for change in &changes {
                if let Change::Delete(fact) = change {
                    own.facts.remove(fact);
                }
            }
            for change in &changes {
                if let Change::Add(fact) = change
                    && self.facts.contains(fact)
                {
                    own.facts.insert(*fact);
                }
            }
            own
        });
        Ok(subsets.collect())
    }

    /// Records a state, unless it violates an over-all condition of a running action.
    fn keep(&self, node: Node, found: &mut Vec<Node>) {
        let view = View {
            closure: self,
            node: &node,
            duration: None,
        };
        let is_kept = |own: &RunningProcess| {
            let mut literals = self.processes[own.process].over_all.iter();
            literals.all(|(fact, is_true)| view.is_true(*fact) == *is_true)
        };
        if node.running.iter().all(is_kept) {
            found.push(node);
        }
    }

    /// Returns `true` if `node` covers `other`.
    pub fn covers(&self, node: &Node, other: &Node) -> bool {
        let has = |fact: &FactId| node.facts.contains(fact);
        node.running == other.running
            && node.timed == other.timed
            && other.facts.iter().all(has)
            && node
                .facts
                .iter()
                .all(|fact| other.facts.contains(fact) || self.harmless_when_true.contains(fact))
            && node
                .values
                .iter()
                .all(|(own, value)| other.values.get(own) == Some(value))
            && other.zone.is_within(&node.zone)
    }

    /// Returns a representative of the states that result from exchanges of objects.
    pub fn canonical(&self, mut node: Node) -> Node {
        loop {
            let images = self.exchanges.iter().map(|own| own.image(&node));
            let Some(least) = images.min().filter(|least| *least < node) else {
                return node;
            };
            node = least;
        }
    }

    /// Checks that the states are closed, and that the goal holds in none.
    ///
    /// # Errors
    /// The first flaw.
    pub fn check(&self, nodes: &[Node]) -> Result<(), NoPlanFlaw> {
        let mut by_kind: BTreeMap<(&[RunningProcess], usize), Vec<&Node>> = BTreeMap::new();
        for node in nodes {
            by_kind
                .entry((&node.running, node.timed))
                .or_default()
                .push(node);
        }
        let is_covered = |node: Node| {
            let node = self.canonical(node);
            let known = by_kind.get(&(&node.running[..], node.timed));
            known.is_some_and(|known| known.iter().any(|own| self.covers(own, &node)))
        };
        if !is_covered(self.initial()) {
            return Err(NoPlanFlaw::Leads("the beginning".to_owned()));
        }
        for (number, node) in nodes.iter().enumerate() {
            if self.is_goal(node) {
                return Err(NoPlanFlaw::GoalInReach);
            }
            for after in self.successors(node)? {
                if !is_covered(after) {
                    return Err(NoPlanFlaw::Leads(format!("state {}", number + 1)));
                }
            }
        }
        Ok(())
    }

    pub(super) fn process(&self, number: usize) -> &Process {
        &self.processes[number]
    }

    pub(super) fn number_of(&self, title: &str) -> Option<usize> {
        self.names.get(title).copied()
    }

    pub(super) fn instances(&self) -> &Instances {
        self.instances
    }

    /// Returns the times of the pending timed initials.
    pub fn times(&self) -> impl ExactSizeIterator<Item = &Rational> {
        self.timed.iter().map(|own| &own.time)
    }
}

/// Returns the positions of time 0, of the zone's last time as the current time, and of the starts.
fn times(starts: usize, zone: &Zone) -> Vec<usize> {
    let mut order = vec![ZERO, zone.size() - 1];
    order.extend(FIRST_START..FIRST_START + starts);
    order
}

fn always(change: &Change) -> Effect {
    Effect {
        guard: elbowroom_model::ground::Guard::ALWAYS,
        change: change.clone(),
    }
}

impl Process {
    /// Returns the snap action at the start, or that of an instantaneous action.
    fn first(&self) -> &SnapAction {
        match &self.body {
            elbowroom_model::ground::Body::Instantaneous(snap) => snap,
            elbowroom_model::ground::Body::Durative(body) => &body.start,
        }
    }
}
