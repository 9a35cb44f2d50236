//! Helpers shared by the tests: short texts in, PDDL-like text out.

#![allow(dead_code, reason = "each test program uses a part of it")]

use std::fmt::Write;

use elbowroom_model::problem::{
    Atom, Body, Change, Condition, Expression, Fluent, Guard, Schema, Term, Unknown, Variable,
};
use elbowroom_model::{Problem, Task};
use elbowroom_pddl::{Diagnostic, Diagnostics, Source, read_problem};

/// Returns a domain with some names for tests, and `actions`.
pub(crate) fn domain(actions: &str) -> Source {
    let frame = "(define (domain d)
(:types room ball - thing thing)
(:constants hall - room)
(:predicates (in ?b - thing ?r - room) (open ?r - room) (lit) (dark ?r - room))
(:functions (size ?b - thing) (level) (speed))
";
    Source::new("domain.pddl", format!("{frame}{actions})"))
}

/// Returns a problem with some objects, and `sections`.
pub(crate) fn problem(sections: &str) -> Source {
    let text = format!(
        "(define (problem p) (:domain d) (:objects kitchen - room b1 B2 - ball)\n{sections})"
    );
    Source::new("problem.pddl", text)
}

/// Reads a minimal problem file with these actions in its domain.
pub(crate) fn read_actions(actions: &str) -> Result<(Problem, Vec<Diagnostic>), Diagnostics> {
    read_problem(&domain(actions), &problem("(:init) (:goal (and))"))
}

/// Reads a minimal domain with these sections in its problem file.
pub(crate) fn read_sections(sections: &str) -> Result<(Problem, Vec<Diagnostic>), Diagnostics> {
    read_problem(&domain(""), &problem(sections))
}

/// Returns the diagnostics, one line each.
pub(crate) fn mistakes<T>(read: Result<T, Diagnostics>) -> String {
    match read {
        Ok(_) => "none".to_owned(),
        Err(diagnostics) => diagnostics.to_string(),
    }
}

/// Returns the ground task of a text.
pub(crate) fn task(domain: &Source, problem: &Source) -> Task {
    match read_problem(domain, problem) {
        Ok((problem, _)) => Task::new(problem),
        Err(diagnostics) => panic!("{}", diagnostics.render(false)),
    }
}

/// Returns the only action of a domain, as text.
pub(crate) fn only_action(actions: &str) -> String {
    match read_actions(actions) {
        Ok((problem, _)) => Printer(&problem).schema(&problem.schemas[0]),
        Err(diagnostics) => panic!("{}", diagnostics.render(false)),
    }
}

/// Writer of parts of a problem in the style of PDDL, with variables as numbers.
pub(crate) struct Printer<'a>(pub(crate) &'a Problem);

impl Printer<'_> {
    pub(crate) fn schema(&self, schema: &Schema) -> String {
        let mut lines = Vec::new();
        match &schema.body {
            Body::Instantaneous { condition, effects } => {
                self.push_condition("condition", condition, &mut lines);
                self.push_effects("effect", effects, &mut lines);
            }
            Body::Durative {
                duration,
                at_start,
                over_all,
                at_end,
                start_effects,
                end_effects,
                continuous,
            } => {
                for constraint in duration {
                    let symbol = constraint.comparison.symbol();
                    let end = if constraint.at_end { " at end" } else { "" };
                    let bound = self.expression(&constraint.bound);
                    lines.push(format!("duration {symbol} {bound}{end}"));
                }
                self.push_condition("at start", at_start, &mut lines);
                self.push_condition("over all", over_all, &mut lines);
                self.push_condition("at end", at_end, &mut lines);
                self.push_effects("start effect", start_effects, &mut lines);
                self.push_effects("end effect", end_effects, &mut lines);
                for effect in continuous {
                    lines.push(format!(
                        "rate of {}: {}{}",
                        self.fluent(&effect.fluent),
                        self.expression(&effect.rate),
                        self.around(&effect.variables, &effect.guard),
                    ));
                }
            }
        }
        lines.join("\n")
    }

    fn push_condition(&self, name: &str, condition: &Condition, lines: &mut Vec<String>) {
        if !condition.is_trivial() {
            lines.push(format!("{name} {}", self.condition(condition)));
        }
    }

    fn push_effects(
        &self,
        name: &str,
        effects: &[elbowroom_model::problem::Effect],
        lines: &mut Vec<String>,
    ) {
        for effect in effects {
            let change = match &effect.change {
                Change::Add(atom) => self.atom(atom),
                Change::Delete(atom) => format!("(not {})", self.atom(atom)),
                Change::Update {
                    operator,
                    fluent,
                    value,
                } => format!(
                    "({} {} {})",
                    operator.name(),
                    self.fluent(fluent),
                    self.expression(value)
                ),
            };
            let around = self.around(&effect.variables, &effect.guard);
            lines.push(format!("{name} {change}{around}"));
        }
    }

    fn around(&self, variables: &[Variable], guard: &Guard) -> String {
        let mut text = String::new();
        if !variables.is_empty() {
            let _ = write!(text, " for all {}", self.variables(variables));
        }
        for (name, part) in [
            ("at start", &guard.at_start),
            ("over all", &guard.over_all),
            ("now", &guard.now),
        ] {
            if !part.is_trivial() {
                let _ = write!(text, " when {name} {}", self.condition(part));
            }
        }
        text
    }

    pub(crate) fn condition(&self, condition: &Condition) -> String {
        match condition {
            Condition::Atom(atom) => self.atom(atom),
            Condition::Equal(left, right) => {
                format!("(= {} {})", self.term(*left), self.term(*right))
            }
            Condition::Compare(comparison, left, right) => format!(
                "({} {} {})",
                comparison.symbol(),
                self.expression(left),
                self.expression(right)
            ),
            Condition::Not(part) => format!("(not {})", self.condition(part)),
            Condition::And(parts) => list("and", parts.iter().map(|part| self.condition(part))),
            Condition::Or(parts) => list("or", parts.iter().map(|part| self.condition(part))),
            Condition::Forall(variables, part) => format!(
                "(forall ({}) {})",
                self.variables(variables),
                self.condition(part)
            ),
            Condition::Exists(variables, part) => format!(
                "(exists ({}) {})",
                self.variables(variables),
                self.condition(part)
            ),
        }
    }

    pub(crate) fn expression(&self, expression: &Expression) -> String {
        match expression {
            Expression::Constant(value) => value.to_string(),
            Expression::Fluent(fluent) => self.fluent(fluent),
            Expression::Duration => "?duration".to_owned(),
            Expression::Violations(preference) => {
                format!("(is-violated {})", self.0.preferences[preference.index()])
            }
            Expression::TotalTime => "(total-time)".to_owned(),
            Expression::Unknown(Unknown::Domain(index)) => format!("unknown {index}"),
            Expression::Unknown(Unknown::Action(index)) => format!("own unknown {index}"),
            Expression::Unknown(Unknown::Parameter(index)) => format!("parameter {index}"),
            Expression::Add(parts) => list("+", parts.iter().map(|part| self.expression(part))),
            Expression::Multiply(parts) => {
                list("*", parts.iter().map(|part| self.expression(part)))
            }
            Expression::Subtract(left, right) => {
                format!("(- {} {})", self.expression(left), self.expression(right))
            }
            Expression::Divide(left, right) => {
                format!("(/ {} {})", self.expression(left), self.expression(right))
            }
            Expression::Negate(part) => format!("(- {})", self.expression(part)),
        }
    }

    fn atom(&self, atom: &Atom) -> String {
        let name = &self.0.predicates[atom.predicate.index()].name;
        list(name, atom.arguments.iter().map(|term| self.term(*term)))
    }

    fn fluent(&self, fluent: &Fluent) -> String {
        let name = &self.0.functions[fluent.function.index()].name;
        list(name, fluent.arguments.iter().map(|term| self.term(*term)))
    }

    fn term(&self, term: Term) -> String {
        match term {
            Term::Variable(position) => format!("?{position}"),
            Term::Object(object) => self.0.objects[object.index()].name.clone(),
        }
    }

    fn variables(&self, variables: &[Variable]) -> String {
        variables
            .iter()
            .map(|variable| {
                let types: Vec<_> = variable
                    .types
                    .iter()
                    .map(|ty| self.0.types[ty.index()].name.as_str())
                    .collect();
                format!("{} - {}", variable.name, types.join("|"))
            })
            .collect::<Vec<_>>()
            .join(" ")
    }
}

fn list(head: &str, parts: impl Iterator<Item = String>) -> String {
    let mut words = vec![head.to_owned()];
    words.extend(parts);
    format!("({})", words.join(" "))
}
