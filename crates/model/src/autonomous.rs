//! Changes without actions: processes and events (PDDL+, Fox & Long, JAIR 27, 2006).

use crate::ground;
use crate::problem::{Condition, ContinuousEffect, Effect, Variable};

/// A process: changes numbers continuously while its condition holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Process {
    /// The name, in lower case.
    pub name: String,
    /// The parameters. There is a ground process for each combination of their objects.
    pub parameters: Vec<Variable>,
    /// Condition under which it is active.
    pub condition: Condition,
    /// Changes while it is active; unconditional.
    pub effects: Vec<ContinuousEffect>,
}

/// An event: happens as soon as its condition holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// The name, in lower case.
    pub name: String,
    /// The parameters. There is a ground event for each combination of their objects.
    pub parameters: Vec<Variable>,
    /// Condition that triggers the event.
    pub condition: Condition,
    /// Effects. Their guards have only the part `now`.
    pub effects: Vec<Effect>,
}

/// Ground processes and events of a task, without those that static facts exclude.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Autonomous {
    /// The processes, in the order of the domain and of the objects.
    pub processes: Vec<GroundProcess>,
    /// The events, in the same order.
    pub events: Vec<GroundEvent>,
}

/// A process without variables.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundProcess {
    /// `(name arg …)`.
    pub name: String,
    /// Condition under which it is active.
    pub condition: ground::Condition,
    /// Changes while it is active.
    pub effects: Vec<ground::ContinuousEffect>,
}

/// An event without variables.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundEvent {
    /// `(name arg …)`.
    pub name: String,
    /// Its condition and its effects.
    pub snap: ground::SnapAction,
}

impl Autonomous {
    /// Returns `true` if there are neither processes nor events.
    pub fn is_empty(&self) -> bool {
        self.processes.is_empty() && self.events.is_empty()
    }
}
