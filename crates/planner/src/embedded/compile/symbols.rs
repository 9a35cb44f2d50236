//! Mapping of the task's facts and fluents to the search's numbers, and of conditions to formulas.

use elbowroom_model::Task;
use elbowroom_model::ground::{Condition, Expression, FactId, FluentId};
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::NONE;
use crate::embedded::formula::{Formula, Linear, Literal, Numeric, Test};
use crate::embedded::hash::Map;

/// The facts, fluents and tests numbered so far.
#[derive(Debug)]
pub(super) struct Symbols {
    pub(super) facts: Vec<FactId>,
    pub(super) fluents: Vec<FluentId>,
    pub(super) tests: Vec<Test>,
    linear_tests: Map<(Comparison, Linear), u32>,
    numbers_of_facts: Vec<u32>,
    numbers_of_fluents: Vec<u32>,
}

impl Symbols {
    pub(super) fn new(task: &Task) -> Self {
        Self {
            facts: Vec::new(),
            fluents: Vec::new(),
            tests: Vec::new(),
            linear_tests: Map::default(),
            numbers_of_facts: vec![NONE; task.fact_count()],
            numbers_of_fluents: vec![NONE; task.fluent_count()],
        }
    }

    /// Returns the number of a fact that is read.
    pub(super) fn fact(&mut self, fact: FactId) -> u32 {
        let number = &mut self.numbers_of_facts[fact.index()];
        if *number == NONE {
            *number = narrow(self.facts.len());
            self.facts.push(fact);
        }
        *number
    }

    /// Returns the number of a fact, if something reads it.
    pub(super) fn known_fact(&self, fact: FactId) -> Option<u32> {
        let number = *self.numbers_of_facts.get(fact.index())?;
        (number != NONE).then_some(number)
    }

    /// Returns the number of a fluent that is read.
    pub(super) fn fluent(&mut self, fluent: FluentId) -> u32 {
        let number = &mut self.numbers_of_fluents[fluent.index()];
        if *number == NONE {
            *number = narrow(self.fluents.len());
            self.fluents.push(fluent);
        }
        *number
    }

    /// Returns the number of a fluent, if something reads it.
    pub(super) fn known_fluent(&self, fluent: FluentId) -> Option<u32> {
        let number = *self.numbers_of_fluents.get(fluent.index())?;
        (number != NONE).then_some(number)
    }

    /// Returns an expression with the search's numbers for its fluents.
    pub(super) fn numeric(&mut self, expression: &Expression) -> Numeric {
        let numbered = expression.map_leaves(&mut |leaf| match leaf {
            Expression::Fluent(fluent) => Some(Expression::Fluent(FluentId(self.fluent(*fluent)))),
            _ => None,
        });
        Numeric::of(numbered)
    }

    /// Returns a condition as a formula, with negations at the leaves.
    pub(super) fn formula(&mut self, condition: &Condition) -> Formula {
        self.signed(condition, true)
    }

    fn signed(&mut self, condition: &Condition, truth: bool) -> Formula {
        let mut formula = Formula::default();
        match condition {
            Condition::Fact(fact) => {
                formula.literals.push(Literal::new(self.fact(*fact), truth));
            }
            Condition::Compare(comparison, left, right) => {
                self.compare(*comparison, left, right, truth, &mut formula);
            }
            Condition::Not(part) => return self.signed(part, !truth),
            Condition::And(parts) if truth => {
                for part in parts {
                    formula.join(self.signed(part, truth));
                }
            }
            Condition::Or(parts) if !truth => {
                for part in parts {
                    formula.join(self.signed(part, truth));
                }
            }
            Condition::And(parts) | Condition::Or(parts) => {
                let alternatives: Vec<_> = parts.iter().map(|p| self.signed(p, truth)).collect();
                if alternatives.iter().any(Formula::is_trivial) {
                    return formula;
                }
                if let [only] = &alternatives[..] {
                    return only.clone();
                }
                formula.choices.push(alternatives);
            }
        }
        formula
    }

    fn compare(
        &mut self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
        truth: bool,
        formula: &mut Formula,
    ) {
        let comparison = match (comparison, truth) {
            (same, true) => same,
            (Comparison::Less, false) => Comparison::AtLeast,
            (Comparison::AtMost, false) => Comparison::Greater,
            (Comparison::AtLeast, false) => Comparison::Less,
            (Comparison::Greater, false) => Comparison::AtMost,
            (Comparison::Equal, false) => {
                let mut part = |comparison| {
                    let mut part = Formula::default();
                    self.compare(comparison, left, right, true, &mut part);
                    part
                };
                let sides = vec![part(Comparison::Less), part(Comparison::Greater)];
                formula.choices.push(sides);
                return;
            }
        };
        let difference = Expression::Subtract(Box::new(left.clone()), Box::new(right.clone()));
        let difference = self.numeric(&difference);
        if let Some(value) = difference.as_constant() {
            if !comparison.holds(value, &Rational::ZERO) {
                formula.choices.push(Vec::new());
            }
            return;
        }
        let test = normal(comparison, difference);
        let number = self.test(test);
        if !formula.tests.contains(&number) {
            formula.tests.push(number);
        }
    }

    /// Returns the number of the test `difference comparison 0`.
    pub(super) fn linear_test(&mut self, comparison: Comparison, difference: Linear) -> u32 {
        self.test(normal(comparison, Numeric::Linear(difference)))
    }

    /// Returns the number of a test.
    fn test(&mut self, test: Test) -> u32 {
        let next = narrow(self.tests.len());
        if let Numeric::Linear(linear) = &test.difference {
            let number = *self
                .linear_tests
                .entry((test.comparison, linear.clone()))
                .or_insert(next);
            if number != next {
                return number;
            }
        }
        self.tests.push(test);
        next
    }
}

/// Returns the test in a normal form: "at least" or "greater" if it is linear, so that equal tests
/// compare equal.
fn normal(comparison: Comparison, difference: Numeric) -> Test {
    let turned = match comparison {
        Comparison::Less => Comparison::Greater,
        Comparison::AtMost => Comparison::AtLeast,
        same => same,
    };
    match difference {
        Numeric::Linear(linear) if turned != comparison => {
            let mut opposite = Linear::default();
            opposite.add(&Rational::from(-1), &linear);
            Test {
                comparison: turned,
                difference: Numeric::Linear(opposite),
            }
        }
        difference => Test {
            comparison,
            difference,
        },
    }
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}
