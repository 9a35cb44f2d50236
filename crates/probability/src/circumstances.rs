//! Where a plan stands: [`Circumstances`].

use std::collections::BTreeMap;

use elbowroom_model::ground::{Expression, FluentId};
use elbowroom_model::{State, Task};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, NodeId};

use crate::belief::Belief;
use crate::likelihoods::Likelihoods;
use crate::model::Value;

/// The state from which an order is searched for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Circumstances {
    /// Now, by the clock of the task's timed initials. Those up to and including now have
    /// happened, and are in the belief.
    pub now: Rational,
    /// Layer 0.
    pub belief: Belief,
    /// The fluents' values.
    pub values: BTreeMap<FluentId, Rational>,
    /// The plan's actions that have started and not ended, in order of their start.
    pub running: Vec<Running>,
    /// Happenings of the plan less than ε ago, in order of time: what interferes with one of them
    /// has to wait.
    pub recent: Vec<(NodeId, Rational)>,
}

/// An action of a plan under way.
#[derive(Clone, Debug, PartialEq)]
pub struct Running {
    /// Which one.
    pub instance: InstanceId,
    /// The time at which it started; not after [`Circumstances::now`].
    pub start: Rational,
}

impl Circumstances {
    /// The beginning: time 0, nothing running, everything known.
    pub fn initial(task: &Task) -> Self {
        Self::observed(Rational::ZERO, task.initial())
    }

    /// The beginning, where initial facts are as likely as the likelihoods say.
    pub fn believed(task: &Task, likelihoods: &Likelihoods) -> Self {
        let mut initial = Self::initial(task);
        for (fact, probability) in likelihoods.believed(task) {
            initial.belief.set(fact, probability);
        }
        initial
    }

    /// Everything is known, and nothing is running.
    pub fn observed(now: Rational, state: &State) -> Self {
        Self {
            now,
            belief: Belief::certain(state),
            values: state.values.clone(),
            running: Vec::new(),
            recent: Vec::new(),
        }
    }

    /// The value of a leaf of an expression.
    pub(crate) fn value(&self, leaf: &Expression) -> Value {
        match leaf {
            Expression::Fluent(fluent) => self.values.get(fluent).into(),
            _ => Value::Open,
        }
    }

    /// Whether the instance is under way.
    pub fn is_running(&self, instance: InstanceId) -> bool {
        self.running
            .iter()
            .any(|running| running.instance == instance)
    }
}
