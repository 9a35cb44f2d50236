//! State of a plan's execution: [`SearchState`].

use std::collections::BTreeMap;

use elbowroom_model::ground::{Expression, FluentId};
use elbowroom_model::{State, Task};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, NodeId};

use crate::belief::Belief;
use crate::likelihoods::Likelihoods;
use crate::model::Value;

/// State for which an order is searched.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchState {
    /// Present time, on the clock of the task's timed initials. Those up to and including this time
    /// have happened, and are in the belief.
    pub now: Rational,
    /// The belief: layer 0.
    pub belief: Belief,
    /// Values of fluents.
    pub values: BTreeMap<FluentId, Rational>,
    /// Actions of the plan that have started and not ended, sorted by start.
    pub running: Vec<Running>,
    /// Happenings of the plan less than ε ago, sorted by time. A happening that interferes with one
    /// of them has to wait.
    pub recent: Vec<(NodeId, Rational)>,
}

/// A running action of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Running {
    /// The action.
    pub instance: InstanceId,
    /// Its start time; not after [`SearchState::now`].
    pub start: Rational,
}

impl SearchState {
    /// Returns the initial circumstances: time 0, nothing running, a certain belief.
    pub fn initial(task: &Task) -> Self {
        Self::observed(Rational::ZERO, task.initial())
    }

    /// Returns the initial circumstances, with the initial facts' probabilities from the
    /// likelihoods.
    pub fn initial_with_beliefs(task: &Task, likelihoods: &Likelihoods) -> Self {
        let mut initial = Self::initial(task);
        for (fact, probability) in likelihoods.uncertain_facts(task) {
            initial.belief.set(fact, probability);
        }
        initial
    }

    /// Returns circumstances with a certain belief and without running actions.
    pub fn observed(now: Rational, state: &State) -> Self {
        Self {
            now,
            belief: Belief::certain(state),
            values: state.values.clone(),
            running: Vec::new(),
            recent: Vec::new(),
        }
    }

    /// Returns the value of a leaf of an expression.
    pub(crate) fn value(&self, leaf: &Expression) -> Value {
        match leaf {
            Expression::Fluent(fluent) => self.values.get(fluent).into(),
            _ => Value::TimeDependent,
        }
    }

    /// Returns `true` if the instance is running.
    pub fn is_running(&self, instance: InstanceId) -> bool {
        self.running
            .iter()
            .any(|running| running.instance == instance)
    }
}
