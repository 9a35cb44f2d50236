//! Conditions as alternatives of linear inequalities.

use elbowroom_model::ground::{Condition, Expression};
use elbowroom_model::problem::Comparison;

use super::timeline::Reading;
use super::{Inequality, Refusal};
use crate::linear::Linear;

/// Disjunction of conjunctions: the empty disjunction is false, an empty conjunction is true.
pub(crate) type Alternatives = Vec<Vec<Inequality>>;

/// Limit on the alternatives of a condition.
const MAX_ALTERNATIVES: usize = 4096;

/// Wanted truth value of a condition.
///
/// A comparison with an undefined number is neither true nor false (undefined), and so are the
/// conditions around it, unless their other parts decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WantedTruth {
    /// It is true.
    True,
    /// It is false.
    False,
    /// It is false or undefined: a required condition is then violated.
    NotTrue,
    /// It is true or undefined.
    NotFalse,
}

impl WantedTruth {
    fn negated(self) -> Self {
        match self {
            Self::True => Self::False,
            Self::False => Self::True,
            Self::NotTrue => Self::NotFalse,
            Self::NotFalse => Self::NotTrue,
        }
    }

    fn is_positive(self) -> bool {
        matches!(self, Self::True | Self::NotFalse)
    }
}

impl Reading<'_> {
    /// Returns the alternatives that give the condition the wanted truth value.
    pub(crate) fn alternatives(
        &self,
        condition: &Condition,
        wanted: WantedTruth,
    ) -> Result<Alternatives, Refusal> {
        let is_positive = wanted.is_positive();
        match condition {
            Condition::Fact(fact) => Ok(always_if(self.fact(*fact)? == is_positive)),
            Condition::Not(part) => self.alternatives(part, wanted.negated()),
            Condition::And(parts) if is_positive => self.all(parts, wanted),
            Condition::Or(parts) if !is_positive => self.all(parts, wanted),
            Condition::And(parts) | Condition::Or(parts) => self.any(parts, wanted),
            Condition::Compare(comparison, left, right) => {
                self.comparison(*comparison, left, right, wanted)
            }
        }
    }

    /// Returns the alternatives that make the condition neither true nor false.
    pub(crate) fn undefined_cases(&self, condition: &Condition) -> Result<Alternatives, Refusal> {
        let mut expressions = Vec::new();
        condition.visit_expressions(&mut |expression| expressions.push(expression.clone()));
        for expression in &expressions {
            if self.linear(expression)?.is_none() {
                let opposite = Condition::Not(Box::new(condition.clone()));
                return self.all(&[condition.clone(), opposite], WantedTruth::NotTrue);
            }
        }
        Ok(Vec::new())
    }

    fn any(&self, parts: &[Condition], wanted: WantedTruth) -> Result<Alternatives, Refusal> {
        let mut alternatives = Vec::new();
        for part in parts {
            alternatives.extend(self.alternatives(part, wanted)?);
            if alternatives.iter().any(Vec::is_empty) {
                return Ok(vec![Vec::new()]);
            }
            self.check_size(&alternatives)?;
        }
        Ok(alternatives)
    }

    fn all(&self, parts: &[Condition], wanted: WantedTruth) -> Result<Alternatives, Refusal> {
        let mut product: Alternatives = vec![Vec::new()];
        for part in parts {
            let alternatives = self.alternatives(part, wanted)?;
            product = product
                .iter()
                .flat_map(|so_far| {
                    alternatives
                        .iter()
                        .map(move |more| [&so_far[..], more].concat())
                })
                .collect();
            if product.is_empty() {
                break;
            }
            self.check_size(&product)?;
        }
        Ok(product)
    }

    fn check_size(&self, alternatives: &Alternatives) -> Result<(), Refusal> {
        if alternatives.len() > MAX_ALTERNATIVES {
            return Err(Refusal::TooManyCases {
                place: self.location.to_owned(),
                limit: MAX_ALTERNATIVES,
            });
        }
        Ok(())
    }

    fn comparison(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
        wanted: WantedTruth,
    ) -> Result<Alternatives, Refusal> {
        let (Some(left), Some(right)) = (self.linear(left)?, self.linear(right)?) else {
            return Ok(always_if(matches!(
                wanted,
                WantedTruth::NotTrue | WantedTruth::NotFalse
            )));
        };
        Ok(compared(comparison, &left, &right, wanted.is_positive()))
    }
}

/// Returns the alternatives that make `left comparison right` true (`wanted`) or false.
pub(crate) fn compared(
    comparison: Comparison,
    left: &Linear,
    right: &Linear,
    wanted: bool,
) -> Alternatives {
    let below = |is_strict| {
        vec![Inequality {
            expression: left.minus(right),
            is_strict,
        }]
    };
    let above = |is_strict| {
        vec![Inequality {
            expression: right.minus(left),
            is_strict,
        }]
    };
    let alternatives = match (comparison, wanted) {
        (Comparison::Less, true) | (Comparison::AtLeast, false) => vec![below(true)],
        (Comparison::AtMost, true) | (Comparison::Greater, false) => vec![below(false)],
        (Comparison::AtLeast, true) | (Comparison::Less, false) => vec![above(false)],
        (Comparison::Greater, true) | (Comparison::AtMost, false) => vec![above(true)],
        (Comparison::Equal, true) => vec![[below(false), above(false)].concat()],
        (Comparison::Equal, false) => vec![below(true), above(true)],
    };
    alternatives
        .into_iter()
        .filter_map(drop_constants)
        .collect()
}

/// Drops inequalities between constants that hold. Returns `None` if one does not.
pub(crate) fn drop_constants(mut conjunction: Vec<Inequality>) -> Option<Vec<Inequality>> {
    let is_broken = |inequality: &Inequality| {
        let value = inequality.expression.as_constant();
        value.is_some_and(|value| value.is_positive() || (value.is_zero() && inequality.is_strict))
    };
    if conjunction.iter().any(is_broken) {
        return None;
    }
    conjunction.retain(|inequality| inequality.expression.as_constant().is_none());
    Some(conjunction)
}

pub(crate) fn always_if(condition: bool) -> Alternatives {
    if condition {
        vec![Vec::new()]
    } else {
        Vec::new()
    }
}
