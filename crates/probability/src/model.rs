//! A plan's happenings as steps of a stochastic process: [`Model`].
//!
//! `docs/research/probability.md` defines the process. The model numbers facts and changing fluents densely,
//! splits conditions into parts, and assigns a probability to each effect.
//! [`PrunedNetwork`](crate::PrunedNetwork) computes with these probabilities.

mod compile;
mod requirement;

use std::sync::Arc;

use elbowroom_model::ground::{Condition, Expression, FactId, FluentId};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_model::{Step, Task};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId, PartialOrderPlan};

use crate::likelihoods::{Likelihoods, Missing, Rate, SpontaneousChange};

pub(crate) use requirement::{Requirement, Value, evaluate, visit_facts};

/// Semantics of failed effects and of spontaneous changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Semantics {
    /// Paper 2's network: a failed effect leaves the opposite value, and a fact with an effect of
    /// the action does not also change by itself in that step.
    #[default]
    Paper,
    /// The perturbed worlds of `sim`: a failed effect leaves the fact unchanged, and every fact may
    /// change by itself after each step.
    World,
}

/// Happenings of a partially ordered plan, with all relevant likelihoods.
#[derive(Clone, Debug)]
pub struct Model {
    task: Arc<Task>,
    plan: PartialOrderPlan,
    semantics: Semantics,
    /// Relevant facts, sorted; then one memory for each guard that is read before its effect, with
    /// ids that no task assigns.
    pub(crate) facts: Vec<FactId>,
    pub(crate) spontaneous_changes: Vec<SpontaneousChange>,
    /// Rates of changes of facts with time.
    pub(crate) rates: Vec<Rate>,
    /// `true` if any rate is above 0, or actions fail with time.
    pub(crate) has_rates: bool,
    /// Fluents that some happening changes, sorted.
    pub(crate) fluents: Vec<FluentId>,
    /// By node of the plan.
    pub(crate) events: Vec<Event>,
    pub(crate) goal: Requirement,
    /// By instance: its start and its end, or its only node twice.
    nodes_of: Vec<(NodeId, NodeId)>,
}

/// A compiled happening.
#[derive(Clone, Debug, Default)]
pub(crate) struct Event {
    /// Condition on arrival.
    pub(crate) condition: Requirement,
    /// P(success | condition); 1 for timed initials.
    pub(crate) success: f64,
    /// Rate of failures per second of the action that starts here, while it is running.
    pub(crate) failures_per_second: f64,
    /// Possible outcomes of a failure of this end; empty for all other happenings, whose failures
    /// change nothing.
    pub(crate) failure_outcomes: Vec<CompiledOutcome>,
    /// `true` for a snap action, after which facts change by themselves.
    pub(crate) is_step: bool,
    /// Conditions from right after this start to the end of its action.
    pub(crate) over_all: Requirement,
    /// Memories that become false when their condition does, from this start to the end.
    pub(crate) guard_memories: Vec<(usize, Condition)>,
    /// Effects on facts, sorted by fact.
    pub(crate) effects: Vec<FactEffect>,
    pub(crate) updates: Vec<Update>,
    /// Continuous changes that begin or stop here, with their rates.
    pub(crate) continuous: Vec<(usize, Expression)>,
    /// The action's duration, if only one is possible.
    pub(crate) duration: Option<Rational>,
}

/// An effect on a fact.
#[derive(Clone, Debug)]
pub(crate) struct FactEffect {
    pub(crate) fact: usize,
    pub(crate) makes_true: bool,
    pub(crate) probability: f64,
    /// Condition of the effect, read on arrival.
    pub(crate) guard: Option<Condition>,
    /// `true` if the effect cannot fail, and the fact does not change by itself (memories, timed
    /// initials).
    pub(crate) is_certain: bool,
}

/// A possible outcome of a failed end.
#[derive(Clone, Debug)]
pub(crate) struct CompiledOutcome {
    /// Probability, given the failure.
    pub(crate) probability: f64,
    /// Facts that are set, each once, sorted.
    pub(crate) changes: Vec<(usize, bool)>,
}

/// An effect on a number.
#[derive(Clone, Debug)]
pub(crate) struct Update {
    pub(crate) fluent: usize,
    pub(crate) operator: UpdateOperator,
    pub(crate) value: Expression,
    pub(crate) guard: Option<Condition>,
}

impl Model {
    /// Creates the model of a plan.
    ///
    /// # Errors
    /// When the likelihoods have no entry for a fact or an action of the plan.
    pub fn new(
        task: impl Into<Arc<Task>>,
        plan: PartialOrderPlan,
        likelihoods: &Likelihoods,
        semantics: Semantics,
    ) -> Result<Self, Missing> {
        compile::model(task.into(), plan, likelihoods, semantics)
    }

    /// Returns the model without helpful changes by steps: a fact that is only needed true does not
    /// become true by itself, one that is only needed false does not become false, and one that is
    /// needed with both values does not change. Changes with time are kept.
    ///
    /// An executor that relies on such changes repeats steps in vain if they do not occur in the
    /// world.
    #[must_use]
    pub fn without_luck(mut self) -> Self {
        let mut needed = vec![[false; 2]; self.facts.len()];
        let goal = std::iter::once(&self.goal);
        let events = self.events.iter();
        let requirements = events.flat_map(|event| [&event.condition, &event.over_all]);
        for requirement in requirements.chain(goal) {
            for &(fact, truth) in &requirement.literals {
                needed[fact][usize::from(truth)] = true;
            }
            for &fact in requirement.coupled.iter().flat_map(|it| &it.facts) {
                needed[fact] = [true; 2];
            }
        }
        let effects = self.events.iter().flat_map(|event| &event.effects);
        let updates = self.events.iter().flat_map(|event| &event.updates);
        let guards = effects.map(|it| &it.guard);
        let guards = guards.chain(updates.map(|it| &it.guard)).flatten();
        let watched = self.events.iter().flat_map(|event| &event.guard_memories);
        for condition in guards.chain(watched.map(|(_, condition)| condition)) {
            visit_facts(&self.task, condition, &mut |fact| {
                if let Ok(position) = self.facts.binary_search(&fact) {
                    needed[position] = [true; 2];
                }
            });
        }
        for (flip, [needed_false, needed_true]) in self.spontaneous_changes.iter_mut().zip(needed) {
            if needed_true {
                flip.becomes_true = 0.0;
            }
            if needed_false {
                flip.becomes_false = 0.0;
            }
        }
        self
    }

    /// Returns the task.
    pub fn task(&self) -> &Arc<Task> {
        &self.task
    }

    /// Returns the plan.
    pub fn plan(&self) -> &PartialOrderPlan {
        &self.plan
    }

    /// Returns the semantics of failed effects and of spontaneous changes.
    pub fn semantics(&self) -> Semantics {
        self.semantics
    }

    /// Returns the relevant facts of the plan.
    pub fn facts(&self) -> impl Iterator<Item = FactId> + '_ {
        self.facts.iter().copied().take_while(|&fact| is_fact(fact))
    }

    /// Returns `true` if a happening has an effect on a fact.
    pub fn has_effect_on(&self, node: NodeId, fact: FactId) -> bool {
        let effects = &self.event(node).effects;
        let position = self.position(fact);
        effects.iter().any(|effect| Some(effect.fact) == position)
    }

    /// Returns `true` if facts change with time, not only with steps, or actions fail with time.
    pub fn has_rates(&self) -> bool {
        self.has_rates
    }

    /// Returns a failed end as a happening of its own: it has none of its end effects, and the
    /// effects of the failure. Returns `None` if the failure has several possible outcomes.
    pub(crate) fn failed_end_event(&self, node: NodeId) -> Option<Event> {
        let event = self.event(node);
        let [aftermath] = event.failure_outcomes.as_slice() else {
            return None;
        };
        let Node::End(id) = self.plan.nodes[node.index()] else {
            return None;
        };
        // The memories of the start are reset.
        let start = self.event(self.start(id)).effects.iter();
        let memories = start.filter(|effect| effect.is_certain);
        let memories = memories.map(|effect| (effect.fact, false, true));
        let changes = aftermath.changes.iter();
        let changes = changes.map(|&(fact, becomes)| (fact, becomes, false));
        let effect = |(fact, makes_true, is_certain)| FactEffect {
            fact,
            makes_true,
            probability: 1.0,
            guard: None,
            is_certain,
        };
        let mut effects: Vec<FactEffect> = memories.chain(changes).map(effect).collect();
        effects.sort_by_key(|effect| effect.fact);
        Some(Event {
            success: 1.0 - event.success,
            effects,
            updates: Vec::new(),
            ..event.clone()
        })
    }

    /// Returns the least duration of an action, in seconds.
    pub(crate) fn min_duration(&self, id: InstanceId) -> f64 {
        self.plan.duration(id).0.to_f64()
    }

    pub(crate) fn event(&self, node: NodeId) -> &Event {
        &self.events[node.index()]
    }

    /// Returns the position of a fact, or of a memory.
    pub(crate) fn position(&self, fact: FactId) -> Option<usize> {
        self.facts.binary_search(&fact).ok()
    }

    pub(crate) fn fluent_position(&self, fluent: FluentId) -> Option<usize> {
        self.fluents.binary_search(&fluent).ok()
    }

    /// Returns the start node of an instance, or its only node.
    pub fn start(&self, id: InstanceId) -> NodeId {
        self.nodes_of[id.index()].0
    }

    /// Returns the end node of an instance, or its only node.
    pub fn end(&self, id: InstanceId) -> NodeId {
        self.nodes_of[id.index()].1
    }

    /// Returns the start and the end of each instance.
    fn nodes_of(plan: &PartialOrderPlan) -> Vec<(NodeId, NodeId)> {
        let mut nodes_of = vec![(NodeId::ZERO, NodeId::ZERO); plan.instances.len()];
        for (index, node) in plan.nodes.iter().enumerate() {
            let own = NodeId::from(index);
            match *node {
                Node::Start(id) => nodes_of[id.index()].0 = own,
                Node::End(id) => nodes_of[id.index()].1 = own,
                Node::Instant(id) => nodes_of[id.index()] = (own, own),
                Node::Zero | Node::Timed(_) => {}
            }
        }
        nodes_of
    }

    /// Returns the plan's happenings at their planned times, moment by moment. `steps` are in the
    /// order of the plan's instances.
    pub(crate) fn planned_moments(&self, steps: &[Step]) -> Vec<Vec<NodeId>> {
        let timed = self.task.timed();
        let nodes = self.plan.nodes.iter().enumerate();
        let mut happenings: Vec<_> = nodes
            .filter_map(|(index, node)| {
                let time = match *node {
                    Node::Zero => return None,
                    Node::End(id) => steps[id.index()].end(),
                    Node::Timed(index) => timed[index].time.clone(),
                    Node::Start(id) | Node::Instant(id) => steps[id.index()].start.clone(),
                };
                Some((time, NodeId::from(index)))
            })
            .collect();
        happenings.sort();
        let moments = happenings.chunk_by(|one, other| one.0 == other.0);
        let nodes = |moment: &[(Rational, NodeId)]| moment.iter().map(|it| it.1).collect();
        moments.map(nodes).collect()
    }

    /// Returns the happening in words.
    pub fn describe_node(&self, node: NodeId) -> String {
        match self.plan.nodes[node.index()] {
            Node::Zero => "the beginning of the plan".to_owned(),
            Node::Start(id) => format!("start of {}", self.plan.instance(id).action.name),
            Node::End(id) => format!("end of {}", self.plan.instance(id).action.name),
            Node::Instant(id) => self.plan.instance(id).action.name.clone(),
            Node::Timed(index) => {
                let time = self.task.timed()[index].time.to_decimal(3);
                format!("timed initials at {time}")
            }
        }
    }
}

/// Returns `true` for a fact of the task, `false` for a memory.
pub(crate) fn is_fact(fact: FactId) -> bool {
    fact < FactId::FIRST_FREE
}
