//! Ground conditions and expressions as PDDL text.

use std::fmt::Write as _;

use elbowroom_num::Rational;

use crate::constraint::Modal;
use crate::ground::{Condition, Expression};
use crate::problem::Unknown;
use crate::task::Task;

impl Task {
    /// The condition as PDDL writes it: `(and (at r a) (>= (charge r) 5))`.
    pub fn describe_condition(&self, condition: &Condition) -> String {
        let mut text = String::new();
        self.write_condition(condition, &mut text);
        text
    }

    /// The expression as PDDL writes it: `(* (rate r) ?duration)`.
    pub fn describe_expression(&self, expression: &Expression) -> String {
        let mut text = String::new();
        self.write_expression(expression, &mut text);
        text
    }

    /// The constraint as PDDL writes it: `(within 10 (at r a))`.
    pub fn describe_modal(&self, modal: &Modal<Condition>) -> String {
        let mut text = format!("({}", modal.name());
        for time in modal.times() {
            let _ = write!(text, " {}", decimal(time));
        }
        for condition in modal.conditions() {
            text.push(' ');
            self.write_condition(condition, &mut text);
        }
        text.push(')');
        text
    }

    fn write_condition(&self, condition: &Condition, text: &mut String) {
        match condition {
            Condition::Fact(fact) => text.push_str(&self.fact_name(*fact)),
            Condition::Compare(comparison, left, right) => {
                let _ = write!(text, "({} ", comparison.symbol());
                self.write_expression(left, text);
                text.push(' ');
                self.write_expression(right, text);
                text.push(')');
            }
            Condition::Not(part) => {
                text.push_str("(not ");
                self.write_condition(part, text);
                text.push(')');
            }
            Condition::And(parts) => self.write_conditions("and", parts, text),
            Condition::Or(parts) => self.write_conditions("or", parts, text),
        }
    }

    fn write_conditions(&self, operator: &str, parts: &[Condition], text: &mut String) {
        let _ = write!(text, "({operator}");
        for part in parts {
            text.push(' ');
            self.write_condition(part, text);
        }
        text.push(')');
    }

    fn write_expression(&self, expression: &Expression, text: &mut String) {
        match expression {
            Expression::Constant(value) => text.push_str(&decimal(value)),
            Expression::Fluent(fluent) => text.push_str(&self.fluent_name(*fluent)),
            Expression::Duration => text.push_str("?duration"),
            Expression::TotalTime => text.push_str("total-time"),
            Expression::Violations(preference) => {
                let name = &self.problem().preferences[preference.index()];
                let _ = write!(text, "(is-violated {name})");
            }
            Expression::Unknown(unknown) => text.push_str(&self.describe_unknown(*unknown)),
            Expression::Add(parts) => self.write_operation("+", parts.iter(), text),
            Expression::Multiply(parts) => self.write_operation("*", parts.iter(), text),
            Expression::Subtract(left, right) => {
                self.write_operation("-", [&**left, &**right].into_iter(), text);
            }
            Expression::Divide(left, right) => {
                self.write_operation("/", [&**left, &**right].into_iter(), text);
            }
            Expression::Negate(part) => {
                self.write_operation("-", [&**part].into_iter(), text);
            }
        }
    }

    fn write_operation<'a>(
        &self,
        operator: &str,
        operands: impl Iterator<Item = &'a Expression>,
        text: &mut String,
    ) {
        let _ = write!(text, "({operator}");
        for operand in operands {
            text.push(' ');
            self.write_expression(operand, text);
        }
        text.push(')');
    }

    /// The name of a number left open, or its number where only its action knows the name.
    pub(crate) fn describe_unknown(&self, unknown: Unknown) -> String {
        match unknown {
            Unknown::Domain(position) => self
                .problem()
                .unknowns
                .get(position as usize)
                .cloned()
                .unwrap_or_else(|| format!("?unknown{position}")),
            Unknown::Action(position) => format!("?unknown{position}"),
            Unknown::Parameter(position) => format!("?parameter{position}"),
        }
    }
}

/// The number as a decimal where that is exact and short, else as a fraction.
pub(crate) fn decimal(value: &Rational) -> String {
    let text = value.to_decimal(12);
    match text.parse::<Rational>() {
        Ok(same) if same == *value => text,
        _ => value.to_string(),
    }
}
