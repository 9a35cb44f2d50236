//! The times of each action of a plan, as planned and anywhere in its envelope.

use std::collections::BTreeMap;

use elbowroom_envelope::linear_form::relaxed;
use elbowroom_model::Task;
use elbowroom_model::ground::Change;
use elbowroom_num::Rational;
use elbowroom_plan::makespan::with_fixed_choices;
use elbowroom_plan::{
    DecoupledEnvelope, Node, NodeId, ParameterKind, ParametrizedPlan, network_node,
};
use elbowroom_stn::Windows;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::answers::Exact;

/// The times of a plan, for a chart.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timeline {
    /// The actions, in the order of the plan.
    pub actions: Vec<TimedAction>,
    /// The timed initials, by time.
    pub timed: Vec<TimedFacts>,
    /// The type of each object that an action of the plan mentions, as the problem declares it.
    #[serde(default)]
    pub types: IndexMap<String, String>,
}

/// An action and its times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimedAction {
    /// The label of the action's instance.
    pub instance: String,
    /// The action: `(drive rover depot shelf)`.
    pub action: String,
    /// The start time if everything starts as early as possible and takes as long as planned.
    pub start: Exact,
    /// The end time in that schedule; `None` for an instantaneous action.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<Exact>,
    /// The times of its start, for all values in the envelope and all schedules.
    pub start_window: WindowAnswer,
    /// The same for its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_window: Option<WindowAnswer>,
    /// The parameter for its duration, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameter: Option<String>,
}

/// A window of times; an end that is missing is unbounded.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct WindowAnswer {
    /// The earliest time.
    pub earliest: Option<Exact>,
    /// The latest time.
    pub latest: Option<Exact>,
}

/// Timed initials that happen together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimedFacts {
    /// The planned time.
    pub time: Exact,
    /// The times anywhere in the envelope.
    pub window: WindowAnswer,
    /// The changes, such as `(open office) becomes false`.
    pub changes: Vec<String>,
    /// The parameter for its time, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameter: Option<String>,
}

impl Timeline {
    /// Computes the times of a plan, in a box around its planned values; `None` if it has no
    /// schedule there.
    pub fn of(task: &Task, plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Option<Self> {
        let zero = network_node(NodeId::ZERO);
        let nominal = with_fixed_choices(plan, plan.plan.network(&plan.nominal()))?;
        let nominal = nominal.earliest_schedule(zero);
        let windows = with_fixed_choices(plan, relaxed(plan, envelope))?;
        let times = Times {
            nominal: nominal.times(),
            windows: &windows.windows(zero),
        };
        let mut durations = vec![None; plan.plan.instances.len()];
        let mut moments = vec![None; task.timed().len()];
        for parameter in &plan.parameters {
            match parameter.kind {
                ParameterKind::Duration(id) => durations[id.index()] = Some(&parameter.name),
                ParameterKind::Timed(index) => moments[index] = Some(&parameter.name),
                _ => {}
            }
        }
        let mut starts = vec![NodeId::ZERO; plan.plan.instances.len()];
        let mut ends = vec![None; plan.plan.instances.len()];
        let mut initials = Vec::new();
        for (node, what) in plan.plan.nodes() {
            match what {
                Node::Zero => {}
                Node::Start(id) | Node::Instant(id) => starts[id.index()] = node,
                Node::End(id) => ends[id.index()] = Some(node),
                Node::Timed(index) => initials.push(TimedFacts {
                    time: times.planned(node),
                    window: times.window(node),
                    changes: changes(task, index),
                    parameter: moments[index].cloned(),
                }),
            }
        }
        let mut actions = Vec::with_capacity(plan.plan.instances.len());
        for (index, instance) in plan.plan.instances.iter().enumerate() {
            let (start, end) = (starts[index], ends[index]);
            actions.push(TimedAction {
                instance: instance.label.clone(),
                action: instance.action.name.clone(),
                start: times.planned(start),
                end: end.map(|node| times.planned(node)),
                start_window: times.window(start),
                end_window: end.map(|node| times.window(node)),
                parameter: durations[index].cloned(),
            });
        }
        let names = actions.iter().map(|action| action.action.as_str());
        Some(Self {
            types: types(task, names),
            actions,
            timed: initials,
        })
    }
}

/// Returns the declared types of the objects that these actions mention; for an object with several
/// types, the first.
pub fn types<'a>(
    task: &Task,
    actions: impl IntoIterator<Item = &'a str>,
) -> IndexMap<String, String> {
    let problem = task.problem();
    let declared: BTreeMap<String, &str> = problem
        .objects
        .iter()
        .filter_map(|object| {
            let own = object.types.first()?;
            let name = problem.types[own.index()].name.as_str();
            Some((object.name.to_lowercase(), name))
        })
        .collect();
    let mut types = IndexMap::new();
    for action in actions {
        let words = action.trim_matches(['(', ')']).split_whitespace();
        for object in words.skip(1) {
            if let Some(own) = declared.get(&object.to_lowercase()) {
                types.insert(object.to_owned(), (*own).to_owned());
            }
        }
    }
    types
}

/// Times by node.
struct Times<'a> {
    nominal: &'a [Rational],
    windows: &'a Windows,
}

impl Times<'_> {
    fn planned(&self, node: NodeId) -> Exact {
        Exact(self.nominal[node.index()].clone())
    }

    fn window(&self, node: NodeId) -> WindowAnswer {
        let window = &self.windows[network_node(node)];
        WindowAnswer {
            earliest: window.earliest.clone().map(Exact),
            latest: window.latest.clone().map(Exact),
        }
    }
}

/// Describes the changes of a group of timed initials.
pub fn changes(task: &Task, timed: usize) -> Vec<String> {
    let words = |change: &Change| match change {
        Change::Add(fact) => format!("{} becomes true", task.fact_name(*fact)),
        Change::Delete(fact) => format!("{} becomes false", task.fact_name(*fact)),
        Change::Update { fluent, value, .. } => format!(
            "{} becomes {}",
            task.fluent_name(*fluent),
            task.describe_expression(value)
        ),
    };
    task.timed()[timed].changes.iter().map(words).collect()
}
