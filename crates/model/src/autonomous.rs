//! What happens without a plan: processes and events (PDDL+, Fox & Long, JAIR 27, 2006).

use crate::ground;
use crate::problem::{Condition, ContinuousEffect, Effect, Variable};

/// A process: numbers change for as long as its condition holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Process {
    /// The name, in lower case.
    pub name: String,
    /// The parameters; there is a process for all of their objects.
    pub parameters: Vec<Variable>,
    /// When it is at work.
    pub condition: Condition,
    /// Change while it is; unconditional.
    pub effects: Vec<ContinuousEffect>,
}

/// An event: it happens as soon as its condition holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// The name, in lower case.
    pub name: String,
    /// The parameters; there is an event for all of their objects.
    pub parameters: Vec<Variable>,
    /// When it happens.
    pub condition: Condition,
    /// Done at once; each one's guard has only `now`.
    pub effects: Vec<Effect>,
}

/// The processes and events of a task, without variables. Those that static facts rule out are left
/// out.
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
    /// When it is at work.
    pub condition: ground::Condition,
    /// Change while it is.
    pub effects: Vec<ground::ContinuousEffect>,
}

/// An event without variables.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundEvent {
    /// `(name arg …)`.
    pub name: String,
    /// When it happens, and what it does.
    pub snap: ground::SnapAction,
}

impl Autonomous {
    /// Whether nothing happens without a plan.
    pub fn is_empty(&self) -> bool {
        self.processes.is_empty() && self.events.is_empty()
    }
}
