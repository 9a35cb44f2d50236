//! Conditions, expressions, effects and actions without variables.
//!
//! Facts and fluents are numbers; [`Task`](crate::Task) maps them to names.

use std::sync::Arc;

use elbowroom_num::Rational;

use crate::problem::{Comparison, ObjectId, SchemaId, UpdateOperator};

/// A ground atom, as a position in its task's table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FactId(pub u32);

/// A ground numeric fluent, as a position in its task's table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FluentId(pub u32);

impl FactId {
    /// First id that no task assigns. Components that need additional facts of their own can use
    /// ids from here on.
    pub const FIRST_FREE: Self = Self(1 << 31);

    /// Returns the position in the table.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl FluentId {
    /// Returns the position in the table.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A ground condition. The empty conjunction is true, the empty disjunction false.
#[derive(Clone, Debug, PartialEq)]
pub enum Condition {
    /// The fact is true.
    Fact(FactId),
    /// A comparison of numbers.
    Compare(Comparison, Expression, Expression),
    /// Not.
    Not(Box<Condition>),
    /// All of them.
    And(Vec<Condition>),
    /// At least one of them.
    Or(Vec<Condition>),
}

impl Condition {
    /// The condition that always holds.
    pub const TRUE: Self = Self::And(Vec::new());
    /// The condition that never holds.
    pub const FALSE: Self = Self::Or(Vec::new());

    /// Returns `true` if this is the empty conjunction.
    pub fn is_trivial(&self) -> bool {
        matches!(self, Self::And(parts) if parts.is_empty())
    }

    /// Returns the conjuncts, with nested conjunctions flattened. The validator checks and reports
    /// each conjunct separately.
    pub fn conjuncts(&self) -> Vec<&Self> {
        match self {
            Self::And(parts) => parts.iter().flat_map(Self::conjuncts).collect(),
            other => vec![other],
        }
    }

    /// Calls `visit` for each fact read (derived facts as themselves).
    pub fn visit_facts(&self, visit: &mut impl FnMut(FactId)) {
        match self {
            Self::Fact(fact) => visit(*fact),
            Self::Compare(..) => {}
            Self::Not(part) => part.visit_facts(visit),
            Self::And(parts) | Self::Or(parts) => {
                for part in parts {
                    part.visit_facts(visit);
                }
            }
        }
    }

    /// Calls `visit` for the left and the right side of each comparison.
    pub fn visit_comparisons(&self, visit: &mut impl FnMut(&Expression, &Expression)) {
        match self {
            Self::Fact(_) => {}
            Self::Compare(_, left, right) => visit(left, right),
            Self::Not(part) => part.visit_comparisons(visit),
            Self::And(parts) | Self::Or(parts) => {
                for part in parts {
                    part.visit_comparisons(visit);
                }
            }
        }
    }

    /// Calls `visit` for each expression on either side of a comparison.
    pub fn visit_expressions(&self, visit: &mut impl FnMut(&Expression)) {
        self.visit_comparisons(&mut |left, right| {
            visit(left);
            visit(right);
        });
    }

    /// Calls `visit` for each fluent read.
    pub fn visit_fluents(&self, visit: &mut impl FnMut(FluentId)) {
        self.visit_expressions(&mut |expression| expression.visit_fluents(visit));
    }

    /// Returns the condition with `replace` applied to every leaf of its expressions.
    #[must_use]
    pub fn map_leaves(&self, replace: &mut impl FnMut(&Expression) -> Option<Expression>) -> Self {
        match self {
            Self::Fact(fact) => Self::Fact(*fact),
            Self::Compare(comparison, left, right) => Self::Compare(
                *comparison,
                left.map_leaves(replace),
                right.map_leaves(replace),
            ),
            Self::Not(part) => Self::Not(Box::new(part.map_leaves(replace))),
            Self::And(parts) => Self::And(parts.iter().map(|p| p.map_leaves(replace)).collect()),
            Self::Or(parts) => Self::Or(parts.iter().map(|p| p.map_leaves(replace)).collect()),
        }
    }
}

/// A ground numeric expression.
pub type Expression = crate::expression::Expression<FluentId>;

/// A ground effect with the condition it depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// Condition of the effect.
    pub guard: Guard,
    /// The change.
    pub change: Change,
}

/// See [`problem::Guard`](crate::problem::Guard).
#[derive(Clone, Debug, PartialEq)]
pub struct Guard {
    /// Read on arrival at the action's start, remembered until the end. End effects only.
    pub at_start: Condition,
    /// Must hold throughout the action. End effects only.
    pub over_all: Condition,
    /// Read on arrival at the effect's own moment.
    pub now: Condition,
}

impl Guard {
    /// The guard of an unconditional effect.
    pub const ALWAYS: Self = Self {
        at_start: Condition::TRUE,
        over_all: Condition::TRUE,
        now: Condition::TRUE,
    };

    /// Returns `true` if the effect is unconditional.
    pub fn is_trivial(&self) -> bool {
        self.at_start.is_trivial() && self.over_all.is_trivial() && self.now.is_trivial()
    }
}

/// The change that a ground effect makes.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// The fact becomes true. Wins over a deletion by the same happening.
    Add(FactId),
    /// The fact becomes false.
    Delete(FactId),
    /// The fluent changes.
    Update {
        /// The assignment operator.
        operator: UpdateOperator,
        /// The fluent.
        fluent: FluentId,
        /// Operand of the update; reads the state on arrival.
        value: Expression,
    },
}

/// A snap action: a start, an end, or an instantaneous action.
#[derive(Clone, Debug, PartialEq)]
pub struct SnapAction {
    /// Condition on arrival.
    pub condition: Condition,
    /// Effects.
    pub effects: Vec<Effect>,
}

/// A ground action: a schema with its arguments.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// The schema.
    pub schema: SchemaId,
    /// The arguments.
    pub arguments: Vec<ObjectId>,
    /// `(name arg …)`.
    pub name: String,
    /// Its conditions and effects.
    pub body: Body,
}

/// The part of an action that depends on whether it takes time.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// `:action`
    Instantaneous(SnapAction),
    /// `:durative-action`
    Durative(DurativeBody),
}

/// The conditions and effects of a durative action.
#[derive(Clone, Debug, PartialEq)]
pub struct DurativeBody {
    /// Constraints on the duration. All have to hold; without any, all durations `>= 0` are
    /// allowed.
    pub duration: Vec<DurationConstraint>,
    /// Start. Shared between copies of an action that differ only in their durations.
    pub start: Arc<SnapAction>,
    /// Condition at every moment of the open interval between start and end.
    pub over_all: Condition,
    /// End.
    pub end: Arc<SnapAction>,
    /// Continuous changes while the action runs.
    pub continuous: Vec<ContinuousEffect>,
    /// `true` for the rest of an action that began before time 0 ([`RunningAction::remaining_action`]). Its
    /// start is then fixed at time 0.
    ///
    /// [`RunningAction::remaining_action`]: crate::RunningAction::remaining_action
    pub is_running: bool,
}

impl DurativeBody {
    /// Returns `true` unless a constant bound excludes a duration of 0. With that duration, there
    /// is no moment between start and end, so the over-all condition is vacuous.
    pub fn may_take_no_time(&self) -> bool {
        self.duration
            .iter()
            .all(|constraint| match &constraint.bound {
                Expression::Constant(bound) => constraint.comparison.holds(&Rational::ZERO, bound),
                _ => true,
            })
    }
}

/// `?duration comparison bound`.
#[derive(Clone, Debug, PartialEq)]
pub struct DurationConstraint {
    /// Comparison operator.
    pub comparison: Comparison,
    /// The bound.
    pub bound: Expression,
    /// `true` if the bound reads the state on arrival at the end, not at the start.
    pub at_end: bool,
}

/// While the action runs, `d fluent / dt` has the term `rate`.
#[derive(Clone, Debug, PartialEq)]
pub struct ContinuousEffect {
    /// Condition of the effect.
    pub guard: Guard,
    /// The fluent.
    pub fluent: FluentId,
    /// Change per unit of time, sign included.
    pub rate: Expression,
}

impl Action {
    /// Returns the durative part, or `None` for an instantaneous action.
    pub fn durative(&self) -> Option<&DurativeBody> {
        match &self.body {
            Body::Durative(body) => Some(body),
            Body::Instantaneous(_) => None,
        }
    }

    /// Returns the action with leaves replaced where `replace` returns `Some`, in all expressions:
    /// conditions, guards, effects, rates and duration constraints.
    #[must_use]
    pub fn map_leaves(&self, replace: &mut impl FnMut(&Expression) -> Option<Expression>) -> Self {
        let body = match &self.body {
            Body::Instantaneous(snap) => Body::Instantaneous(snap.map_leaves(replace)),
            Body::Durative(body) => Body::Durative(DurativeBody {
                duration: body
                    .duration
                    .iter()
                    .map(|constraint| DurationConstraint {
                        comparison: constraint.comparison,
                        bound: constraint.bound.map_leaves(replace),
                        at_end: constraint.at_end,
                    })
                    .collect(),
                start: Arc::new(body.start.map_leaves(replace)),
                over_all: body.over_all.map_leaves(replace),
                end: Arc::new(body.end.map_leaves(replace)),
                continuous: body
                    .continuous
                    .iter()
                    .map(|effect| ContinuousEffect {
                        guard: effect.guard.map_leaves(replace),
                        fluent: effect.fluent,
                        rate: effect.rate.map_leaves(replace),
                    })
                    .collect(),
                is_running: body.is_running,
            }),
        };
        Self {
            schema: self.schema,
            arguments: self.arguments.clone(),
            name: self.name.clone(),
            body,
        }
    }

    /// Returns the action with its planned duration in place of every `?duration` that is read before
    /// the end, or `None` if there is none.
    ///
    /// The real duration is unknown until the action ends. So start and over-all conditions, start
    /// effects, rates, and guards that are decided before the end read the planned duration. End
    /// conditions and end effects read the real one.
    #[must_use]
    pub fn with_planned_duration(&self, planned: &elbowroom_num::Rational) -> Option<Self> {
        let Body::Durative(body) = &self.body else {
            return None;
        };
        let mut is_read = false;
        let mut replace = |leaf: &Expression| match leaf {
            Expression::Duration => {
                is_read = true;
                Some(Expression::Constant(planned.clone()))
            }
            _ => None,
        };
        let start = body.start.map_leaves(&mut replace);
        let over_all = body.over_all.map_leaves(&mut replace);
        let mut end = SnapAction::clone(&body.end);
        for effect in &mut end.effects {
            effect.guard.at_start = effect.guard.at_start.map_leaves(&mut replace);
            effect.guard.over_all = effect.guard.over_all.map_leaves(&mut replace);
        }
        let continuous = body.continuous.iter().map(|effect| ContinuousEffect {
            guard: effect.guard.map_leaves(&mut replace),
            fluent: effect.fluent,
            rate: effect.rate.map_leaves(&mut replace),
        });
        let continuous = continuous.collect();
        is_read.then(|| Self {
            body: Body::Durative(DurativeBody {
                duration: body.duration.clone(),
                start: Arc::new(start),
                over_all,
                end: Arc::new(end),
                continuous,
                is_running: body.is_running,
            }),
            ..self.clone()
        })
    }
}

impl SnapAction {
    fn map_leaves(&self, replace: &mut impl FnMut(&Expression) -> Option<Expression>) -> Self {
        Self {
            condition: self.condition.map_leaves(replace),
            effects: self
                .effects
                .iter()
                .map(|effect| effect.map_leaves(replace))
                .collect(),
        }
    }
}

impl Effect {
    fn map_leaves(&self, replace: &mut impl FnMut(&Expression) -> Option<Expression>) -> Self {
        let change = match &self.change {
            Change::Update {
                operator,
                fluent,
                value,
            } => Change::Update {
                operator: *operator,
                fluent: *fluent,
                value: value.map_leaves(replace),
            },
            other => other.clone(),
        };
        Self {
            guard: self.guard.map_leaves(replace),
            change,
        }
    }
}

impl Guard {
    fn map_leaves(&self, replace: &mut impl FnMut(&Expression) -> Option<Expression>) -> Self {
        Self {
            at_start: self.at_start.map_leaves(replace),
            over_all: self.over_all.map_leaves(replace),
            now: self.now.map_leaves(replace),
        }
    }
}
