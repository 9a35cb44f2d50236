//! Numeric expressions over lifted or ground fluents, and comparisons of their values.

use elbowroom_num::Rational;

use crate::ground::FluentId;
use crate::problem::{Fluent, PreferenceId};

/// A comparison operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Comparison {
    /// `<`
    Less,
    /// `<=`
    AtMost,
    /// `=`
    Equal,
    /// `>=`
    AtLeast,
    /// `>`
    Greater,
}

impl Comparison {
    /// Returns `true` if `left self right` holds.
    pub fn holds(self, left: &Rational, right: &Rational) -> bool {
        match self {
            Self::Less => left < right,
            Self::AtMost => left <= right,
            Self::Equal => left == right,
            Self::AtLeast => left >= right,
            Self::Greater => left > right,
        }
    }

    /// Returns the PDDL symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Less => "<",
            Self::AtMost => "<=",
            Self::Equal => "=",
            Self::AtLeast => ">=",
            Self::Greater => ">",
        }
    }
}

/// A numeric expression over fluents of type `F`: [`Fluent`] in a lifted problem, [`FluentId`] in a
/// ground one.
#[derive(Clone, Debug, PartialEq)]
pub enum Expression<F> {
    /// A number.
    Constant(Rational),
    /// The current value of a fluent.
    Fluent(F),
    /// `?duration`
    Duration,
    /// `total-time`; metrics only.
    TotalTime,
    /// `(is-violated name)`: number of instances of a preference that the plan violates; metrics
    /// only.
    Violations(PreferenceId),
    /// A `:synth-parameters` name: an unknown number.
    Unknown(Unknown),
    /// Sum of the operands.
    Add(Vec<Self>),
    /// First minus second.
    Subtract(Box<Self>, Box<Self>),
    /// Product of the operands.
    Multiply(Vec<Self>),
    /// First divided by second.
    Divide(Box<Self>, Box<Self>),
    /// Minus the operand.
    Negate(Box<Self>),
}

impl<F> Expression<F> {
    /// Returns the value, or `None` if a leaf has none or a divisor is zero.
    pub fn evaluate(&self, leaf: &mut impl FnMut(&Self) -> Option<Rational>) -> Option<Rational> {
        Some(match self {
            Self::Constant(value) => value.clone(),
            Self::Fluent(_)
            | Self::Duration
            | Self::TotalTime
            | Self::Violations(_)
            | Self::Unknown(_) => leaf(self)?,
            Self::Add(parts) => {
                let mut total = Rational::ZERO;
                for part in parts {
                    total += part.evaluate(leaf)?;
                }
                total
            }
            Self::Multiply(parts) => {
                let mut product = Rational::ONE;
                for part in parts {
                    product *= part.evaluate(leaf)?;
                }
                product
            }
            Self::Subtract(left, right) => left.evaluate(leaf)? - right.evaluate(leaf)?,
            Self::Divide(left, right) => {
                left.evaluate(leaf)?.checked_div(&right.evaluate(leaf)?)?
            }
            Self::Negate(part) => -part.evaluate(leaf)?,
        })
    }

    /// Calls `visit` for each leaf: constants, fluents, `?duration`, unknowns.
    pub fn visit_leaves(&self, visit: &mut impl FnMut(&Self)) {
        match self {
            Self::Constant(_)
            | Self::Fluent(_)
            | Self::Duration
            | Self::TotalTime
            | Self::Violations(_)
            | Self::Unknown(_) => visit(self),
            Self::Add(parts) | Self::Multiply(parts) => {
                for part in parts {
                    part.visit_leaves(visit);
                }
            }
            Self::Subtract(left, right) | Self::Divide(left, right) => {
                left.visit_leaves(visit);
                right.visit_leaves(visit);
            }
            Self::Negate(part) => part.visit_leaves(visit),
        }
    }

    /// Returns the same expression over other fluents.
    pub fn map_fluents<G>(&self, other: &mut impl FnMut(&F) -> G) -> Expression<G> {
        let mut boxed = |part: &Self| Box::new(part.map_fluents(other));
        match self {
            Self::Constant(value) => Expression::Constant(value.clone()),
            Self::Fluent(fluent) => Expression::Fluent(other(fluent)),
            Self::Duration => Expression::Duration,
            Self::TotalTime => Expression::TotalTime,
            Self::Violations(preference) => Expression::Violations(*preference),
            Self::Unknown(unknown) => Expression::Unknown(*unknown),
            Self::Add(parts) => {
                Expression::Add(parts.iter().map(|part| part.map_fluents(other)).collect())
            }
            Self::Multiply(parts) => {
                Expression::Multiply(parts.iter().map(|part| part.map_fluents(other)).collect())
            }
            Self::Subtract(left, right) => Expression::Subtract(boxed(left), boxed(right)),
            Self::Divide(left, right) => Expression::Divide(boxed(left), boxed(right)),
            Self::Negate(part) => Expression::Negate(boxed(part)),
        }
    }
}

impl<F: Clone> Expression<F> {
    /// Returns the expression with leaves replaced where `replace` returns `Some`.
    #[must_use]
    pub fn map_leaves(&self, replace: &mut impl FnMut(&Self) -> Option<Self>) -> Self {
        match self {
            Self::Constant(_)
            | Self::Fluent(_)
            | Self::Duration
            | Self::TotalTime
            | Self::Violations(_)
            | Self::Unknown(_) => replace(self).unwrap_or_else(|| self.clone()),
            Self::Add(parts) => Self::Add(parts.iter().map(|p| p.map_leaves(replace)).collect()),
            Self::Multiply(parts) => {
                Self::Multiply(parts.iter().map(|p| p.map_leaves(replace)).collect())
            }
            Self::Subtract(left, right) => Self::Subtract(
                Box::new(left.map_leaves(replace)),
                Box::new(right.map_leaves(replace)),
            ),
            Self::Divide(left, right) => Self::Divide(
                Box::new(left.map_leaves(replace)),
                Box::new(right.map_leaves(replace)),
            ),
            Self::Negate(part) => Self::Negate(Box::new(part.map_leaves(replace))),
        }
    }
}

impl Expression<Fluent> {
    /// Calls `visit` for each fluent read, as often as it is read.
    pub fn visit_fluents(&self, visit: &mut impl FnMut(&Fluent)) {
        self.visit_leaves(&mut |leaf| {
            if let Self::Fluent(fluent) = leaf {
                visit(fluent);
            }
        });
    }
}

impl Expression<FluentId> {
    /// Calls `visit` for each fluent read, as often as it is read.
    pub fn visit_fluents(&self, visit: &mut impl FnMut(FluentId)) {
        self.visit_leaves(&mut |leaf| {
            if let Self::Fluent(fluent) = leaf {
                visit(*fluent);
            }
        });
    }
}

/// A number that the problem leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Unknown {
    /// An entry of [`Problem::unknowns`](crate::Problem::unknowns): one number for the whole
    /// domain.
    Domain(u32),
    /// An entry of [`Schema::unknowns`](crate::problem::Schema::unknowns): one number per action
    /// instance.
    Action(u32),
    /// A parameter that a parametrized plan put here, by its position in that plan's list.
    Parameter(u32),
}
