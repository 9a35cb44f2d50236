//! Trajectory constraints, and preferences (PDDL 3).
//!
//! Gerevini, Haslum, Long, Saetti & Dimopoulos, "Deterministic planning in the fifth international
//! planning competition: PDDL3 and experimental evaluation of the planners", AIJ 173 (2009).

use elbowroom_num::Rational;

use crate::problem::{Condition, PreferenceId, SchemaId, Variable};

/// A constraint on the states that a plan goes through, over conditions of type `C`.
///
/// There is one state at each moment: the state after all happenings of that moment. The initial
/// state before any happening counts as well, and the final state lasts forever.
#[derive(Clone, Debug, PartialEq)]
pub enum Modal<C> {
    /// `(at end c)`: it holds at the end.
    AtEnd(C),
    /// `(always c)`: it holds at every moment.
    Always(C),
    /// `(sometime c)`: it holds at some moment.
    Sometime(C),
    /// `(within t c)`: it holds at some moment that is no later than `t`.
    Within(Rational, C),
    /// `(at-most-once c)`: once it has ceased to hold, it never holds again.
    AtMostOnce(C),
    /// `(sometime-after c d)`: whenever `c` holds, `d` holds then or later.
    SometimeAfter(C, C),
    /// `(sometime-before c d)`: whenever `c` holds, `d` held at some earlier moment.
    SometimeBefore(C, C),
    /// `(always-within t c d)`: whenever `c` holds, `d` holds then, or at most `t` later.
    AlwaysWithin(Rational, C, C),
    /// `(hold-during t u c)`: it holds at each moment from `t` until before `u`.
    HoldDuring(Rational, Rational, C),
    /// `(hold-after t c)`: it holds at `t` and at each moment later.
    HoldAfter(Rational, C),
}

impl<C> Modal<C> {
    /// Returns the PDDL keyword.
    pub fn name(&self) -> &'static str {
        match self {
            Self::AtEnd(_) => "at end",
            Self::Always(_) => "always",
            Self::Sometime(_) => "sometime",
            Self::Within(..) => "within",
            Self::AtMostOnce(_) => "at-most-once",
            Self::SometimeAfter(..) => "sometime-after",
            Self::SometimeBefore(..) => "sometime-before",
            Self::AlwaysWithin(..) => "always-within",
            Self::HoldDuring(..) => "hold-during",
            Self::HoldAfter(..) => "hold-after",
        }
    }

    /// Returns the times between the name and the conditions, in the order of the PDDL notation.
    pub fn times(&self) -> Vec<&Rational> {
        match self {
            Self::Within(time, _) | Self::AlwaysWithin(time, ..) | Self::HoldAfter(time, _) => {
                vec![time]
            }
            Self::HoldDuring(from, until, _) => vec![from, until],
            _ => Vec::new(),
        }
    }

    /// Returns the conditions, in the order of the PDDL notation.
    pub fn conditions(&self) -> Vec<&C> {
        match self {
            Self::AtEnd(c)
            | Self::Always(c)
            | Self::Sometime(c)
            | Self::Within(_, c)
            | Self::AtMostOnce(c)
            | Self::HoldDuring(_, _, c)
            | Self::HoldAfter(_, c) => vec![c],
            Self::SometimeAfter(c, d)
            | Self::SometimeBefore(c, d)
            | Self::AlwaysWithin(_, c, d) => vec![c, d],
        }
    }

    /// Returns the same constraint on other conditions.
    pub fn map<D>(&self, mut other: impl FnMut(&C) -> D) -> Modal<D> {
        match self {
            Self::AtEnd(c) => Modal::AtEnd(other(c)),
            Self::Always(c) => Modal::Always(other(c)),
            Self::Sometime(c) => Modal::Sometime(other(c)),
            Self::Within(time, c) => Modal::Within(time.clone(), other(c)),
            Self::AtMostOnce(c) => Modal::AtMostOnce(other(c)),
            Self::SometimeAfter(c, d) => Modal::SometimeAfter(other(c), other(d)),
            Self::SometimeBefore(c, d) => Modal::SometimeBefore(other(c), other(d)),
            Self::AlwaysWithin(time, c, d) => Modal::AlwaysWithin(time.clone(), other(c), other(d)),
            Self::HoldDuring(from, until, c) => {
                Modal::HoldDuring(from.clone(), until.clone(), other(c))
            }
            Self::HoldAfter(time, c) => Modal::HoldAfter(time.clone(), other(c)),
        }
    }
}

/// An entry of `:constraints`, or a preference of the goal. The latter is a constraint at the end.
#[derive(Clone, Debug, PartialEq)]
pub enum Constraint {
    /// A trajectory constraint.
    Modal(Modal<Condition>),
    /// All of them.
    And(Vec<Constraint>),
    /// For all objects of the variables' types.
    Forall(Vec<Variable>, Box<Constraint>),
    /// A soft constraint; each violated instance counts.
    Preference(PreferenceId, Box<Constraint>),
}

/// A preference among an action's conditions. It counts for each execution of the action.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionPreference {
    /// The action.
    pub schema: SchemaId,
    /// The preference.
    pub preference: PreferenceId,
    /// Variables of the enclosing `forall`s, after the action's parameters. All their objects
    /// together form a single instance.
    pub variables: Vec<Variable>,
    /// Read on arrival at the start, or at the moment of an instantaneous action.
    pub at_start: Condition,
    /// Read at every moment of the open interval between start and end.
    pub over_all: Condition,
    /// Read on arrival at the end.
    pub at_end: Condition,
}

/// The constraints of a task, without variables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Constraints {
    /// Constraints that every valid plan satisfies.
    pub hard: Vec<Modal<crate::ground::Condition>>,
    /// Constraints that a plan may violate.
    pub soft: Vec<SoftConstraint>,
    /// `true` if the constraints depend on earlier states, which are unknown.
    pub(crate) depends_on_unknown_past: bool,
    /// `true` if earlier states do not matter: the constraints are deadlines of goals that are not achieved yet ([`Task::with_deadlines`](crate::Task::with_deadlines)).
    pub(crate) ignores_past: bool,
}

/// One instance of a preference among a task's constraints.
#[derive(Clone, Debug, PartialEq)]
pub struct SoftConstraint {
    /// The preference.
    pub preference: PreferenceId,
    /// It is violated, once, if any of these constraints is violated.
    pub all: Vec<Modal<crate::ground::Condition>>,
}

impl Constraints {
    /// Returns `true` if the constraints depend on earlier states, which are unknown. This is the
    /// case for the remaining task of a situation during execution.
    pub fn depends_on_unknown_past(&self) -> bool {
        self.depends_on_unknown_past
    }

    /// Returns `true` if the constraints apply from any situation on as they do from the initial
    /// state: earlier states do not count.
    pub fn ignores_past(&self) -> bool {
        self.ignores_past
    }

    /// Returns `true` if there are no constraints.
    pub fn is_empty(&self) -> bool {
        self.hard.is_empty() && self.soft.is_empty()
    }

    /// Returns the constraints that remain at `time` during execution. Their times are relative to
    /// `time`.
    pub(crate) fn from(&self, time: &Rational) -> Self {
        let mut rest = self.clone();
        if !self.ignores_past {
            rest.depends_on_unknown_past = !self.is_empty();
            return rest;
        }
        for modal in &mut rest.hard {
            if let Modal::Within(deadline, _) = modal {
                *deadline -= time;
            }
        }
        rest
    }
}
