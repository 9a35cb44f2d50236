//! Checkable proofs that a box is inside the envelope.

use elbowroom_num::Rational;
use elbowroom_plan::{NodeId, ParameterId, Schedule};

use crate::obligations::{Difference, Inequality, Requirement};

/// Proof that there are times for all points, for all values in a box.
#[derive(Clone, Debug)]
pub enum ControlProof {
    /// These times work, for the strong guarantee; those that the world decides on are the
    /// earliest.
    Times(Schedule),
    /// Rules for an executor that knows the values; the first case is split into the others.
    Schedules(Vec<ScheduleCase>),
    /// Constraints for an executor that observes the values during execution.
    Strategy(Strategy),
}

/// Schedules for the values in a part of a box.
#[derive(Clone, Debug)]
pub enum ScheduleCase {
    /// The parameter is at its least value in the first case, and at its greatest in the second.
    Split(ParameterId, [usize; 2]),
    /// A rule for the time of each node, depending on the values.
    Rule(Vec<TimeRule>),
}

/// `constant + Σ factor · value`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeRule {
    /// Constant part.
    pub constant: Rational,
    /// Factors of the values; none is zero.
    pub factors: Vec<(ParameterId, Rational)>,
}

/// Dispatchable form of the plan's network.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Strategy {
    /// Edges `to - from <= bound`, in addition to the plan's own constraints.
    pub edges: Vec<(NodeId, NodeId, Rational)>,
    /// Nodes that wait for the end of a duration (the plan's constraint at this position), and the
    /// longest wait after its beginning.
    pub waits: Vec<(NodeId, usize, Option<Rational>)>,
}

/// Proof that a condition of the plan cannot fail in any schedule for values in a box.
#[derive(Clone, Debug)]
pub struct ConditionProof {
    /// The condition.
    pub requirement: Requirement,
    /// For an over-all condition, the nodes between which its moment lies.
    pub during: Option<[NodeId; 2]>,
    /// Proof that it cannot fail; `None` if it cannot be computed.
    pub proof: Option<ImpossibilityProof>,
}

/// Proof that a condition cannot fail.
#[derive(Clone, Debug)]
pub enum ImpossibilityProof {
    /// The moment is at or after a node, or before it.
    Split(NodeId, Box<ImpossibilityProof>, Box<ImpossibilityProof>),
    /// There is no such moment.
    NoMoment(Refutation),
    /// Each way for the condition to fail is impossible.
    Cases(Vec<RefutedCase>),
}

/// Way for a condition to fail, with the proof that it is impossible.
#[derive(Clone, Debug)]
pub struct RefutedCase {
    /// Differences of times, in addition to those for the place of the moment.
    pub differences: Vec<Difference>,
    /// Other inequalities.
    pub inequalities: Vec<Inequality>,
    /// Parameters that are multiplied.
    pub corners: Vec<ParameterId>,
    /// A sum for each combination of their ends, the last parameter's ends first.
    pub sums: Vec<Refutation>,
}

/// Inequalities with multipliers, whose sum is a contradiction.
pub type Refutation = Vec<(Summand, Rational)>;

/// Inequality of a [`Refutation`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Summand {
    /// The node comes at 0 or later.
    NonNegativeTime(NodeId),
    /// The lower bound of the plan's constraint at this position.
    AtLeast(usize),
    /// The upper bound of the plan's constraint at this position.
    AtMost(usize),
    /// The difference at this position: those for the place of the moment come first.
    Difference(usize),
    /// The inequality at this position.
    Inequality(usize),
}
