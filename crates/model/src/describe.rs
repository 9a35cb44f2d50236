//! Ground conditions and expressions as PDDL text.

use std::fmt::Write as _;

use elbowroom_num::Rational;

use crate::constraint::Modal;
use crate::ground::{Action, Condition, Expression};
use crate::problem::{self, ObjectId, Unknown, Variable};
use crate::task::Task;
use crate::terms::resolve;

impl Task {
    /// Returns the condition in PDDL notation: `(and (at r a) (>= (charge r) 5))`.
    pub fn describe_condition(&self, condition: &Condition) -> String {
        let mut text = String::new();
        self.write_condition(condition, &mut text);
        text
    }

    /// Returns a conjunct of an action's condition, or of the goal (`None`), in PDDL notation,
    /// including equalities of objects: `(not (= a a))`. Instantiation evaluates equalities, so a
    /// ground condition contains only their truth values; their text comes from the domain.
    pub fn describe_condition_of(&self, action: Option<&Action>, conjunct: &Condition) -> String {
        let problem = self.problem();
        let lifted: Vec<&problem::Condition> = match action {
            None => vec![&problem.goal],
            Some(action) => match &problem.schemas[action.schema.index()].body {
                problem::Body::Instantaneous { condition, .. } => vec![condition],
                problem::Body::Durative {
                    at_start,
                    over_all,
                    at_end,
                    ..
                } => vec![at_start, over_all, at_end],
            },
        };
        let arguments = action.map_or(&[][..], |action| &action.arguments);
        let written = || {
            let mut lifted = lifted.into_iter();
            lifted.find_map(|part| self.written(part, &mut arguments.to_vec(), conjunct))
        };
        let is_decided = is_partly_decided(conjunct);
        let written = is_decided.then(written).flatten();
        written.unwrap_or_else(|| self.describe_condition(conjunct))
    }

    /// Returns the text of the conjunct of `lifted` whose ground form is `wanted`.
    fn written(
        &self,
        lifted: &problem::Condition,
        binding: &mut Vec<ObjectId>,
        wanted: &Condition,
    ) -> Option<String> {
        match lifted {
            problem::Condition::And(parts) => {
                let mut parts = parts.iter();
                parts.find_map(|part| self.written(part, binding, wanted))
            }
            problem::Condition::Forall(variables, part) => {
                let mut bindings = self.bindings(variables, binding).into_iter();
                bindings.find_map(|mut binding| self.written(part, &mut binding, wanted))
            }
            _ => (self.ground(lifted, binding) == *wanted).then(|| {
                let mut text = String::new();
                self.write_lifted(lifted, binding, &mut text);
                text
            }),
        }
    }

    fn ground(&self, lifted: &problem::Condition, binding: &mut Vec<ObjectId>) -> Condition {
        self.grounding(|grounder| grounder.ground_condition(lifted, binding))
    }

    /// Returns all extensions of the binding with objects for these variables.
    fn bindings(&self, variables: &[Variable], binding: &mut Vec<ObjectId>) -> Vec<Vec<ObjectId>> {
        let mut bindings = Vec::new();
        self.grounding(|grounder| {
            grounder.for_all(variables, binding, &mut |_, binding| {
                bindings.push(binding.clone());
            });
        });
        bindings
    }

    fn write_lifted(
        &self,
        lifted: &problem::Condition,
        binding: &mut Vec<ObjectId>,
        text: &mut String,
    ) {
        use problem::Condition as Lifted;
        let parts: Vec<(&Lifted, Vec<ObjectId>)> = match lifted {
            Lifted::Atom(_) | Lifted::Compare(..) => {
                return self.write_condition(&self.ground(lifted, binding), text);
            }
            Lifted::Equal(left, right) => {
                let objects = [resolve(*left, binding), resolve(*right, binding)];
                text.push_str(&self.problem().apply_name("=", &objects));
                return;
            }
            Lifted::Not(part) => vec![(part, binding.clone())],
            Lifted::And(parts) | Lifted::Or(parts) => {
                parts.iter().map(|part| (part, binding.clone())).collect()
            }
            Lifted::Forall(variables, part) | Lifted::Exists(variables, part) => {
                let bindings = self.bindings(variables, binding).into_iter();
                bindings.map(|binding| (&**part, binding)).collect()
            }
        };
        text.push_str(match lifted {
            Lifted::Not(_) => "(not",
            Lifted::And(_) | Lifted::Forall(..) => "(and",
            _ => "(or",
        });
        for (part, mut binding) in parts {
            text.push(' ');
            self.write_lifted(part, &mut binding, text);
        }
        text.push(')');
    }

    /// Returns the expression in PDDL notation: `(* (rate r) ?duration)`.
    pub fn describe_expression(&self, expression: &Expression) -> String {
        let mut text = String::new();
        self.write_expression(expression, &mut text);
        text
    }

    /// Returns the constraint in PDDL notation: `(within 10 (at r a))`.
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

    /// Returns the name of an open number, or its position if the name is only available in its
    /// action's schema.
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

/// Returns `true` if a part of the condition has been decided when it was instantiated.
fn is_partly_decided(condition: &Condition) -> bool {
    match condition {
        Condition::Fact(_) | Condition::Compare(..) => false,
        Condition::Not(part) => is_partly_decided(part),
        Condition::And(parts) | Condition::Or(parts) => {
            parts.is_empty() || parts.iter().any(is_partly_decided)
        }
    }
}

/// Returns the number as a decimal if that is exact and short, else as a fraction.
pub(crate) fn decimal(value: &Rational) -> String {
    let text = value.to_decimal(12);
    match text.parse::<Rational>() {
        Ok(same) if same == *value => text,
        _ => value.to_string(),
    }
}
