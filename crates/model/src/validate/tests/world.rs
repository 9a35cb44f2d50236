//! Small problems without objects, written in a few lines.
//!
//! `(p)` is a fact and `x` a fluent. A mention declares them.

use std::sync::Arc;

use elbowroom_num::Rational;

use super::forms::{Form, forms, head, words};
use crate::plan::{Step, TimeTriggeredPlan};
use crate::problem::{
    Atom, Body, Comparison, Condition, Constraint, ContinuousEffect, DurationConstraint, Effect,
    Expression, Fluent, Function, FunctionId, Guard, Modal, Predicate, PredicateId, PreferenceId,
    Problem, Rule, Schema, TimedChange, TimedInitial, Unknown, UpdateOperator,
};
use crate::task::Task;
use crate::validate::{Report, Settings, Verdict, validate};

pub(super) struct World {
    pub(super) problem: Problem,
    pub(super) settings: Settings,
}

impl World {
    /// Creates a world with these initial facts, and initial values `(= x 3)`.
    pub(super) fn new(initial: &str) -> Self {
        let mut world = Self {
            problem: Problem::default(),
            settings: Settings::default(),
        };
        for form in forms(initial) {
            match words(&form).as_slice() {
                [name] => {
                    let predicate = world.predicate(name);
                    world.problem.initial_facts.push((predicate, Vec::new()));
                }
                ["=", name, value] => {
                    let function = world.function(name);
                    world
                        .problem
                        .initial_values
                        .push((function, Vec::new(), number(value)));
                }
                other => panic!("{other:?}"),
            }
        }
        world
    }

    pub(super) fn goal(mut self, goal: &str) -> Self {
        self.problem.goal = self.conjunction(goal);
        self
    }

    /// Adds a constraint such as `(within 3 (p))`.
    pub(super) fn constraint(mut self, text: &str) -> Self {
        let constraint = self.modal(text);
        self.problem.constraints.push(constraint);
        self
    }

    /// Adds a preference with that name.
    pub(super) fn prefer(mut self, name: &str, text: &str) -> Self {
        let modal = self.modal(text);
        let preference = PreferenceId::from(self.problem.preferences.len());
        self.problem.preferences.push(name.to_owned());
        let constraint = Constraint::Preference(preference, Box::new(modal));
        self.problem.constraints.push(constraint);
        self
    }

    fn modal(&mut self, text: &str) -> Constraint {
        let form = forms(text).remove(0);
        let Form::List(parts) = &form else {
            panic!("{text}")
        };
        let words = words(&form);
        let lists = parts.iter().filter(|part| matches!(part, Form::List(_)));
        let mut conditions: Vec<_> = lists.map(|part| self.condition(part)).collect();
        let mut next = || conditions.remove(0);
        Constraint::Modal(match words.as_slice() {
            ["at", "end"] => Modal::AtEnd(next()),
            ["always"] => Modal::Always(next()),
            ["sometime"] => Modal::Sometime(next()),
            ["within", time] => Modal::Within(number(time), next()),
            ["at-most-once"] => Modal::AtMostOnce(next()),
            ["sometime-after"] => Modal::SometimeAfter(next(), next()),
            ["sometime-before"] => Modal::SometimeBefore(next(), next()),
            ["always-within", time] => Modal::AlwaysWithin(number(time), next(), next()),
            ["hold-during", from, until] => Modal::HoldDuring(number(from), number(until), next()),
            ["hold-after", time] => Modal::HoldAfter(number(time), next()),
            other => panic!("{other:?}"),
        })
    }

    pub(super) fn settings(mut self, settings: Settings) -> Self {
        self.settings = settings;
        self
    }

    pub(super) fn rule(mut self, head: &str, body: &str) -> Self {
        let predicate = self.predicate(head);
        self.problem.predicates[predicate.index()].is_derived = true;
        let body = self.conjunction(body);
        self.problem.rules.push(Rule {
            predicate,
            parameters: Vec::new(),
            body,
        });
        self
    }

    /// Adds a timed initial: `(p)`, `(not (p))` or `(= x 3)`.
    pub(super) fn timed(mut self, time: &str, change: &str) -> Self {
        let form = forms(change).remove(0);
        let change = match &form {
            Form::List(parts) if words(&form)[0] == "not" => {
                TimedChange::Delete(self.predicate(words(&parts[1])[0]), Vec::new())
            }
            _ => match words(&form).as_slice() {
                [name] => TimedChange::Add(self.predicate(name), Vec::new()),
                [_, name, value] => {
                    TimedChange::Assign(self.function(name), Vec::new(), number(value))
                }
                other => panic!("{other:?}"),
            },
        };
        self.problem.timed.push(TimedInitial {
            time: number(time),
            change,
        });
        self
    }

    pub(super) fn instant(mut self, name: &str, condition: &str, effects: &str) -> Self {
        let condition = self.conjunction(condition);
        let effects = self.effects(effects);
        self.schema(name, Body::Instantaneous { condition, effects })
    }

    /// Adds a durative action with sections `duration`, `start`, `over all`, `end`, `start effect`,
    /// `end effect`, and `rate` (`x 2`: x increases by 2 per unit of time).
    pub(super) fn durative(mut self, name: &str, sections: &[(&str, &str)]) -> Self {
        let text = |wanted: &str| {
            let found = sections.iter().find(|(section, _)| *section == wanted);
            found.map_or("", |(_, text)| text)
        };
        let duration = forms(text("duration"));
        let body = Body::Durative {
            duration: duration.iter().map(|form| self.duration(form)).collect(),
            at_start: self.conjunction(text("start")),
            over_all: self.conjunction(text("over all")),
            at_end: self.conjunction(text("end")),
            start_effects: self.effects(text("start effect")),
            end_effects: self.effects(text("end effect")),
            continuous: self.rates(text("rate")),
        };
        self.schema(name, body)
    }

    /// Returns the verdict on a plan: `valid`, or the violation.
    pub(super) fn judge(&self, plan: &str) -> String {
        match self.verdict(plan) {
            Verdict::Valid(_) => "valid".to_owned(),
            Verdict::Invalid(violation) => violation.to_string(),
            Verdict::Undecided(undecided) => format!("undecided: {undecided}"),
        }
    }

    pub(super) fn report(&self, plan: &str) -> Report {
        match self.verdict(plan) {
            Verdict::Valid(report) => report,
            other => panic!("{other:?}"),
        }
    }

    /// Lines `time: name` or `time: name [duration]`.
    pub(super) fn verdict(&self, plan: &str) -> Verdict {
        let (task, plan) = self.task_and_plan(plan);
        validate(&task, &plan, &self.settings)
    }

    /// Lines `time: name` or `time: name [duration]`.
    pub(super) fn task_and_plan(&self, plan: &str) -> (Task, TimeTriggeredPlan) {
        let task = Task::new(self.problem.clone());
        let mut steps = Vec::new();
        for line in plan.lines().map(str::trim).filter(|line| !line.is_empty()) {
            let (time, rest) = line.split_once(':').expect("time: name");
            let mut parts = rest.split_whitespace();
            let name = parts.next().expect("a name");
            let schema = self.problem.schema(name).expect("a schema");
            steps.push(Step {
                start: number(time.trim()),
                action: Arc::new(task.instantiate(schema, &[]).expect("no arguments")),
                duration: parts
                    .next()
                    .map(|text| number(text.trim_matches(['[', ']']))),
            });
        }
        (task, TimeTriggeredPlan { steps })
    }

    fn schema(mut self, name: &str, body: Body) -> Self {
        self.problem.schemas.push(Schema {
            name: name.to_owned(),
            parameters: Vec::new(),
            unknowns: Vec::new(),
            body,
        });
        self
    }

    fn predicate(&mut self, name: &str) -> PredicateId {
        self.problem.predicate(name).unwrap_or_else(|| {
            self.problem.predicates.push(Predicate {
                name: name.to_owned(),
                parameters: Vec::new(),
                is_derived: false,
            });
            PredicateId::from(self.problem.predicates.len() - 1)
        })
    }

    fn function(&mut self, name: &str) -> FunctionId {
        self.problem.function(name).unwrap_or_else(|| {
            self.problem.functions.push(Function {
                name: name.to_owned(),
                parameters: Vec::new(),
            });
            FunctionId::from(self.problem.functions.len() - 1)
        })
    }

    fn fluent(&mut self, name: &str) -> Fluent {
        Fluent {
            function: self.function(name),
            arguments: Vec::new(),
        }
    }

    fn conjunction(&mut self, text: &str) -> Condition {
        let mut parts: Vec<_> = forms(text)
            .iter()
            .map(|form| self.condition(form))
            .collect();
        if parts.len() == 1 {
            parts.remove(0)
        } else {
            Condition::And(parts)
        }
    }

    fn condition(&mut self, form: &Form) -> Condition {
        let Form::List(parts) = form else {
            panic!("{form:?}")
        };
        let mut rest = || parts[1..].iter().map(|part| self.condition(part)).collect();
        match head(parts) {
            "and" => Condition::And(rest()),
            "or" => Condition::Or(rest()),
            "not" => Condition::Not(Box::new(self.condition(&parts[1]))),
            name => {
                if let Some(comparison) = comparison(name) {
                    let left = self.expression(&parts[1]);
                    return Condition::Compare(comparison, left, self.expression(&parts[2]));
                }
                let predicate = self.predicate(name);
                Condition::Atom(Atom {
                    predicate,
                    arguments: Vec::new(),
                })
            }
        }
    }

    fn expression(&mut self, form: &Form) -> Expression {
        match form {
            Form::Word(word) if word == "?duration" => Expression::Duration,
            Form::Word(word) if word == "?open" => Expression::Unknown(Unknown::Parameter(0)),
            Form::Word(word) => match word.parse() {
                Ok(value) => Expression::Constant(value),
                Err(_) => Expression::Fluent(self.fluent(word)),
            },
            Form::List(parts) => {
                let mut operands: Vec<_> = parts[1..]
                    .iter()
                    .map(|part| self.expression(part))
                    .collect();
                match (head(parts), operands.len()) {
                    ("+", _) => Expression::Add(operands),
                    ("*", _) => Expression::Multiply(operands),
                    ("-", 1) => Expression::Negate(Box::new(operands.remove(0))),
                    (operator, _) => {
                        let right = Box::new(operands.remove(1));
                        let left = Box::new(operands.remove(0));
                        if operator == "-" {
                            Expression::Subtract(left, right)
                        } else {
                            Expression::Divide(left, right)
                        }
                    }
                }
            }
        }
    }

    fn effects(&mut self, text: &str) -> Vec<Effect> {
        forms(text).iter().map(|form| self.effect(form)).collect()
    }

    /// Parses `(p)`, `(not (p))`, `(increase x 1)`, or `(when condition effect)`. The condition may
    /// be `(start …)` or `(overall …)`, otherwise it is read at the effect's time.
    fn effect(&mut self, form: &Form) -> Effect {
        let Form::List(parts) = form else {
            panic!("{form:?}")
        };
        let operators = [
            UpdateOperator::Assign,
            UpdateOperator::Increase,
            UpdateOperator::Decrease,
            UpdateOperator::ScaleUp,
            UpdateOperator::ScaleDown,
        ];
        let name = head(parts);
        let change = if name == "when" {
            let mut effect = self.effect(&parts[2]);
            let Form::List(guard) = &parts[1] else {
                panic!("{form:?}")
            };
            match head(guard) {
                "start" => effect.guard.at_start = self.condition(&guard[1]),
                "overall" => effect.guard.over_all = self.condition(&guard[1]),
                _ => effect.guard.now = self.condition(&parts[1]),
            }
            return effect;
        } else if let Some(&operator) = operators.iter().find(|o| o.name() == name) {
            let fluent = self.fluent(words(form)[1]);
            crate::problem::Change::Update {
                operator,
                fluent,
                value: self.expression(&parts[2]),
            }
        } else {
            let atom = |predicate| Atom {
                predicate,
                arguments: Vec::new(),
            };
            match name {
                "not" => crate::problem::Change::Delete(atom(self.predicate(words(&parts[1])[0]))),
                name => crate::problem::Change::Add(atom(self.predicate(name))),
            }
        };
        Effect {
            variables: Vec::new(),
            guard: Guard::default(),
            change,
        }
    }

    fn rates(&mut self, text: &str) -> Vec<ContinuousEffect> {
        let forms = forms(text);
        forms
            .chunks(2)
            .map(|pair| ContinuousEffect {
                variables: Vec::new(),
                guard: Guard::default(),
                fluent: self.fluent(words(&pair[0])[0]),
                rate: self.expression(&pair[1]),
            })
            .collect()
    }

    fn duration(&mut self, form: &Form) -> DurationConstraint {
        let Form::List(parts) = form else {
            panic!("{form:?}")
        };
        if head(parts) == "end" {
            return DurationConstraint {
                at_end: true,
                ..self.duration(&parts[1])
            };
        }
        DurationConstraint {
            comparison: comparison(head(parts)).expect("a comparison"),
            bound: self.expression(&parts[1]),
            at_end: false,
        }
    }
}

fn comparison(symbol: &str) -> Option<Comparison> {
    [
        Comparison::Less,
        Comparison::AtMost,
        Comparison::Equal,
        Comparison::AtLeast,
        Comparison::Greater,
    ]
    .into_iter()
    .find(|comparison| comparison.symbol() == symbol)
}

pub(super) fn number(text: &str) -> Rational {
    text.parse().expect("a number")
}
