//! File format of closed sets of states.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::problem::ObjectId;
use serde::{Deserialize, Serialize};

use super::zone::Zone;
use super::{Closure, FIRST_START, Node, RunningProcess};
use crate::Exact;
use crate::no_plan::instances::Instances;
use crate::no_plan::{NoPlanFlaw, ReachedFacts, fact};

/// Closed set of states: every happening leads from one of them to one of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClosedSet {
    /// Classes of interchangeable objects.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alike: Vec<Vec<String>>,
    /// The states.
    pub states: Vec<ClosedState>,
}

/// A state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClosedState {
    /// True facts, among those that change and that something reads.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub facts: Vec<String>,
    /// Known numbers, among those that change and that something reads.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, Exact>,
    /// Running actions, with the least and the greatest duration.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub under_way: Vec<(String, Exact, Option<Exact>)>,
    /// Number of timed initials that have happened.
    #[serde(default, skip_serializing_if = "is_none")]
    pub timed: usize,
    /// Upper bounds on differences of times. Position 0 is time 0, position 1 is the current time,
    /// and the starts of running actions follow.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub times: Vec<(usize, usize, Exact)>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde wants it so")]
fn is_none(number: &usize) -> bool {
    *number == 0
}

impl ClosedSet {
    /// Returns the classes of interchangeable objects.
    ///
    /// # Errors
    /// When an object does not exist or is listed twice.
    fn objects(&self, instances: &Instances) -> Result<Vec<Vec<ObjectId>>, NoPlanFlaw> {
        let problem = instances.task.problem();
        let mut seen = BTreeSet::new();
        let mut object = |name: &String| {
            let object = problem.object(name);
            let object = object.ok_or_else(|| NoPlanFlaw::NoSuchFact(name.clone()))?;
            if seen.insert(object) {
                Ok(object)
            } else {
                Err(NoPlanFlaw::Twice(name.clone()))
            }
        };
        let classes = self.alike.iter();
        classes
            .map(|class| class.iter().map(&mut object).collect())
            .collect()
    }

    /// Checks that the states are closed and that the goal holds in none.
    pub(in crate::no_plan) fn verify(
        &self,
        instances: &Instances,
        reached: &ReachedFacts,
    ) -> Result<(), NoPlanFlaw> {
        let closure = Closure::of(instances, reached, &self.objects(instances)?)?;
        let mut nodes = Vec::new();
        for state in &self.states {
            // States without possible times need no check.
            nodes.extend(closure.parse_state(state)?);
        }
        closure.check(&nodes)
    }
}

impl Closure<'_> {
    /// Returns the state in the file format.
    pub fn format_state(&self, node: &Node) -> ClosedState {
        let task = &self.instances.task;
        let values = node.values.iter();
        let mut times = Vec::new();
        for one in 0..node.zone.size() {
            for other in 0..node.zone.size() {
                if one != other
                    && let Some(most) = node.zone.get(one, other)
                {
                    times.push((one, other, Exact(most.clone())));
                }
            }
        }
        let under_way = node.running.iter().map(|own| {
            let most = own.most.clone().map(Exact);
            (
                self.process(own.process).title(),
                Exact(own.least.clone()),
                most,
            )
        });
        ClosedState {
            facts: node.facts.iter().map(|own| task.fact_name(*own)).collect(),
            values: values
                .map(|(own, value)| (task.fluent_name(*own), Exact(value.clone())))
                .collect(),
            under_way: under_way.collect(),
            timed: node.timed,
            times,
        }
    }

    /// Converts a state from the file format; `None` if its bounds on times are contradictory.
    fn parse_state(&self, state: &ClosedState) -> Result<Option<Node>, NoPlanFlaw> {
        let task = &self.instances.task;
        let unknown = |name: &String| NoPlanFlaw::NoSuchFact(name.clone());
        let mut facts = BTreeSet::new();
        for name in &state.facts {
            let (predicate, objects) = fact(task, name).ok_or_else(|| unknown(name))?;
            let found = task.find_fact(predicate, &objects);
            let found = found.filter(|own| self.facts.contains(own));
            facts.insert(found.ok_or_else(|| unknown(name))?);
        }
        let mut values = BTreeMap::new();
        for (name, value) in &state.values {
            let found = task
                .fluent_named(name)
                .filter(|own| self.fluents.contains(own));
            values.insert(found.ok_or_else(|| unknown(name))?, value.0.clone());
        }
        let mut under_way = Vec::new();
        for (title, least, most) in &state.under_way {
            let process = self.number_of(title).ok_or_else(|| unknown(title))?;
            under_way.push(RunningProcess {
                process,
                least: least.0.clone(),
                most: most.as_ref().map(|most| most.0.clone()),
            });
        }
        let mut zone = Zone::any(FIRST_START + under_way.len());
        for (one, other, most) in &state.times {
            if *one >= zone.size() || *other >= zone.size() {
                return Err(NoPlanFlaw::NoSuchFact(format!("time {one} or {other}")));
            }
            zone.limit(*one, *other, &most.0);
        }
        let is_possible = zone.close();
        Ok(is_possible.then_some(Node {
            running: under_way,
            timed: state.timed,
            facts,
            values,
            zone,
        }))
    }
}
