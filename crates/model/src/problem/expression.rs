//! Numeric expressions, and how their values are compared.

use elbowroom_num::Rational;

use super::Fluent;

/// How two numbers are compared.
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
    /// Whether `left self right`.
    pub fn holds(self, left: &Rational, right: &Rational) -> bool {
        match self {
            Self::Less => left < right,
            Self::AtMost => left <= right,
            Self::Equal => left == right,
            Self::AtLeast => left >= right,
            Self::Greater => left > right,
        }
    }

    /// As PDDL writes it.
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

/// A numeric expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Expression {
    /// A number.
    Constant(Rational),
    /// The current value of a fluent.
    Fluent(Fluent),
    /// `?duration`
    Duration,
    /// `total-time`; metrics only.
    TotalTime,
    /// A `:synth-parameters` name: an unknown number.
    Unknown(Unknown),
    /// Sum of the operands.
    Add(Vec<Expression>),
    /// First minus second.
    Subtract(Box<Expression>, Box<Expression>),
    /// Product of the operands.
    Multiply(Vec<Expression>),
    /// First divided by second.
    Divide(Box<Expression>, Box<Expression>),
    /// Minus the operand.
    Negate(Box<Expression>),
}

impl Expression {
    /// The value, or `None` where a leaf has none or a division is by zero.
    pub fn evaluate(&self, leaf: &mut impl FnMut(&Self) -> Option<Rational>) -> Option<Rational> {
        Some(match self {
            Self::Constant(value) => value.clone(),
            Self::Fluent(_) | Self::Duration | Self::TotalTime | Self::Unknown(_) => leaf(self)?,
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

    /// Calls `visit` for each fluent read, as often as it is read.
    pub fn visit_fluents(&self, visit: &mut impl FnMut(&Fluent)) {
        match self {
            Self::Fluent(fluent) => visit(fluent),
            Self::Constant(_) | Self::Duration | Self::TotalTime | Self::Unknown(_) => {}
            Self::Add(parts) | Self::Multiply(parts) => {
                for part in parts {
                    part.visit_fluents(visit);
                }
            }
            Self::Subtract(left, right) | Self::Divide(left, right) => {
                left.visit_fluents(visit);
                right.visit_fluents(visit);
            }
            Self::Negate(part) => part.visit_fluents(visit),
        }
    }
}

/// A number that the problem leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Unknown {
    /// An entry of [`Problem::unknowns`](super::Problem::unknowns): one number for the whole domain.
    Domain(u32),
    /// An entry of [`Schema::unknowns`](super::Schema::unknowns): one number per action instance.
    Action(u32),
    /// A parameter that a parametrized plan put here, by its position in that plan's list.
    Parameter(u32),
}
