//! Simplification of conditions, expressions and actions: removes parts that are the same in every
//! state.

use std::sync::Arc;

use elbowroom_num::Rational;

use crate::ground::{
    Action, Body, Change, Condition, Effect, Expression, FactId, FluentId, Guard, SnapAction,
};

/// Access to facts and values that are the same in every state.
pub trait Constants {
    /// Returns the fact's truth value, if it never changes.
    fn truth(&mut self, fact: FactId) -> Option<bool>;

    /// Returns the fluent's value, if it has one and never changes.
    fn value(&mut self, fluent: FluentId) -> Option<Rational>;
}

impl Condition {
    /// Returns `true` if this is the empty disjunction.
    pub fn is_contradiction(&self) -> bool {
        matches!(self, Self::Or(parts) if parts.is_empty())
    }

    /// Returns an equivalent condition without constant parts: [`Condition::TRUE`],
    /// [`Condition::FALSE`], or a condition that contains neither. Nested conjunctions and
    /// disjunctions are flattened.
    #[must_use]
    pub fn simplified(self, constants: &mut impl Constants) -> Self {
        match self {
            Self::Fact(fact) => constants.truth(fact).map_or(Self::Fact(fact), Self::always),
            Self::Compare(comparison, left, right) => {
                let left = left.simplified(constants);
                let right = right.simplified(constants);
                match (&left, &right) {
                    (Expression::Constant(left), Expression::Constant(right)) => {
                        Self::always(comparison.holds(left, right))
                    }
                    _ => Self::Compare(comparison, left, right),
                }
            }
            Self::Not(part) => match part.simplified(constants) {
                Self::Not(part) => *part,
                part if part.is_trivial() => Self::FALSE,
                part if part.is_contradiction() => Self::TRUE,
                part => Self::Not(Box::new(part)),
            },
            Self::And(parts) => {
                let mut left = Vec::with_capacity(parts.len());
                for part in parts {
                    match part.simplified(constants) {
                        Self::And(parts) => left.extend(parts),
                        part if part.is_contradiction() => return Self::FALSE,
                        part => left.push(part),
                    }
                }
                take_single(&mut left).unwrap_or(Self::And(left))
            }
            Self::Or(parts) => {
                let mut left = Vec::with_capacity(parts.len());
                for part in parts {
                    match part.simplified(constants) {
                        Self::Or(parts) => left.extend(parts),
                        part if part.is_trivial() => return Self::TRUE,
                        part => left.push(part),
                    }
                }
                take_single(&mut left).unwrap_or(Self::Or(left))
            }
        }
    }

    /// Returns [`Condition::TRUE`] or [`Condition::FALSE`].
    pub(crate) fn always(truth: bool) -> Self {
        if truth { Self::TRUE } else { Self::FALSE }
    }
}

/// Returns the only part, if there is exactly one.
fn take_single(parts: &mut Vec<Condition>) -> Option<Condition> {
    if parts.len() == 1 { parts.pop() } else { None }
}

impl Expression {
    /// Returns the expression with constant parts evaluated, except those without a value.
    #[must_use]
    pub fn simplified(self, constants: &mut impl Constants) -> Self {
        let mut each = |parts: Vec<Self>| -> Vec<Self> {
            let parts = parts.into_iter();
            parts.map(|part| part.simplified(constants)).collect()
        };
        let simplified = match self {
            Self::Fluent(fluent) => match constants.value(fluent) {
                Some(value) => Self::Constant(value),
                None => Self::Fluent(fluent),
            },
            Self::Constant(_)
            | Self::Duration
            | Self::TotalTime
            | Self::Violations(_)
            | Self::Unknown(_) => return self,
            Self::Add(parts) => Self::Add(each(parts)),
            Self::Multiply(parts) => Self::Multiply(each(parts)),
            Self::Subtract(left, right) => Self::Subtract(
                Box::new(left.simplified(constants)),
                Box::new(right.simplified(constants)),
            ),
            Self::Divide(left, right) => Self::Divide(
                Box::new(left.simplified(constants)),
                Box::new(right.simplified(constants)),
            ),
            Self::Negate(part) => Self::Negate(Box::new(part.simplified(constants))),
        };
        match simplified.evaluate_constants() {
            Some(value) => Self::Constant(value),
            None => simplified,
        }
    }

    /// Returns the value if all operands are numbers. Does not descend into the operands.
    fn evaluate_constants(&self) -> Option<Rational> {
        let is_constant = |part: &Self| matches!(part, Self::Constant(_));
        let are_constant = match self {
            Self::Add(parts) | Self::Multiply(parts) => parts.iter().all(is_constant),
            Self::Subtract(left, right) | Self::Divide(left, right) => {
                is_constant(left) && is_constant(right)
            }
            Self::Negate(part) => is_constant(part),
            _ => false,
        };
        if are_constant {
            self.evaluate(&mut |_| None)
        } else {
            None
        }
    }
}

impl Action {
    /// Returns the action with conditions and expressions simplified, and without conditional
    /// effects that never take place.
    #[must_use]
    pub fn simplified(mut self, constants: &mut impl Constants) -> Self {
        match &mut self.body {
            Body::Instantaneous(snap) => snap.simplify(constants),
            Body::Durative(body) => {
                for constraint in &mut body.duration {
                    simplify_expression(&mut constraint.bound, constants);
                }
                Arc::make_mut(&mut body.start).simplify(constants);
                simplify_condition(&mut body.over_all, constants);
                Arc::make_mut(&mut body.end).simplify(constants);
                body.continuous.retain_mut(|effect| {
                    simplify_expression(&mut effect.rate, constants);
                    effect.guard.simplify(constants);
                    !effect.guard.is_contradiction()
                });
            }
        }
        self
    }

    /// Returns `true` if a condition of the action is the empty disjunction. An over-all condition does
    /// not count where the duration may be 0.
    pub fn is_contradiction(&self) -> bool {
        match &self.body {
            Body::Instantaneous(snap) => snap.condition.is_contradiction(),
            Body::Durative(body) => {
                body.start.condition.is_contradiction()
                    || body.end.condition.is_contradiction()
                    || body.over_all.is_contradiction() && !body.may_take_no_time()
            }
        }
    }
}

impl SnapAction {
    fn simplify(&mut self, constants: &mut impl Constants) {
        simplify_condition(&mut self.condition, constants);
        self.effects.retain_mut(|effect| {
            effect.simplify(constants);
            !effect.guard.is_contradiction()
        });
    }
}

impl Effect {
    fn simplify(&mut self, constants: &mut impl Constants) {
        self.guard.simplify(constants);
        if let Change::Update { value, .. } = &mut self.change {
            simplify_expression(value, constants);
        }
    }
}

impl Guard {
    fn simplify(&mut self, constants: &mut impl Constants) {
        simplify_condition(&mut self.at_start, constants);
        simplify_condition(&mut self.over_all, constants);
        simplify_condition(&mut self.now, constants);
    }

    fn is_contradiction(&self) -> bool {
        [&self.at_start, &self.over_all, &self.now]
            .into_iter()
            .any(Condition::is_contradiction)
    }
}

fn simplify_condition(condition: &mut Condition, constants: &mut impl Constants) {
    *condition = std::mem::replace(condition, Condition::TRUE).simplified(constants);
}

fn simplify_expression(expression: &mut Expression, constants: &mut impl Constants) {
    *expression = std::mem::replace(expression, Expression::Duration).simplified(constants);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::Comparison;

    /// Fact 0 is true, fact 1 false, fluent 0 is 2; all others change.
    struct SampleConstants;

    impl Constants for SampleConstants {
        fn truth(&mut self, fact: FactId) -> Option<bool> {
            [Some(true), Some(false)]
                .get(fact.index())
                .copied()
                .flatten()
        }

        fn value(&mut self, fluent: FluentId) -> Option<Rational> {
            (fluent.index() == 0).then(|| Rational::from(2))
        }
    }

    const ALWAYS: Condition = Condition::Fact(FactId(0));
    const NEVER: Condition = Condition::Fact(FactId(1));
    const OPEN: Condition = Condition::Fact(FactId(2));

    fn not(condition: Condition) -> Condition {
        Condition::Not(Box::new(condition))
    }

    #[test]
    fn constant_true_part_is_dropped_from_conjunction() {
        let condition = Condition::And(vec![ALWAYS, Condition::And(vec![OPEN, not(NEVER)])]);
        assert_eq!(condition.simplified(&mut SampleConstants), OPEN);
    }

    #[test]
    fn single_constant_part_decides_conjunction_or_disjunction() {
        let condition = Condition::And(vec![OPEN, NEVER]);
        assert_eq!(condition.simplified(&mut SampleConstants), Condition::FALSE);
        let condition = Condition::Or(vec![OPEN, not(NEVER)]);
        assert_eq!(condition.simplified(&mut SampleConstants), Condition::TRUE);
    }

    #[test]
    fn constant_numbers_are_compared_and_others_computed_as_far_as_possible() {
        let two = Expression::Fluent(FluentId(0));
        let open = Expression::Fluent(FluentId(1));
        let three = Expression::Constant(Rational::from(3));
        let compare = |left| Condition::Compare(Comparison::Less, left, three.clone());
        assert_eq!(
            compare(two.clone()).simplified(&mut SampleConstants),
            Condition::TRUE
        );
        let twice = Expression::Add(vec![two.clone(), two]);
        let sum = Expression::Add(vec![open.clone(), twice]);
        let four = Expression::Constant(Rational::from(4));
        assert_eq!(
            compare(sum).simplified(&mut SampleConstants),
            compare(Expression::Add(vec![open, four]))
        );
    }

    #[test]
    fn a_division_by_zero_is_left_as_it_is() {
        let zero = || Box::new(Expression::Constant(Rational::ZERO));
        let quotient = Expression::Divide(zero(), zero());
        assert_eq!(quotient.clone().simplified(&mut SampleConstants), quotient);
    }

    #[test]
    fn an_effect_that_never_happens_is_dropped() {
        let effect = |now| Effect {
            guard: Guard {
                now,
                ..Guard::ALWAYS
            },
            change: Change::Add(FactId(3)),
        };
        let mut snap = SnapAction {
            condition: Condition::TRUE,
            effects: vec![effect(NEVER), effect(OPEN)],
        };
        snap.simplify(&mut SampleConstants);
        assert_eq!(snap.effects, [effect(OPEN)]);
    }
}
