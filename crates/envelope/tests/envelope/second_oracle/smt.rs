//! The authors' encoding of a plan as SMT-LIB text: one position for each time point, one copy of
//! each fact and fluent for each position.
//!
//! As in their tool, simultaneous time points are tried in every order. If the validator is more
//! precise, the encoding follows the validator: over-all conditions are read at every moment
//! between two positions of different times.

mod causes;
mod effects;
mod obligations;
mod places;
mod text;

use std::fmt::Write;

use elbowroom_model::Task;
use elbowroom_model::ground::{Body, Condition, DurativeBody, Expression, SnapAction};
use elbowroom_model::problem::{Comparison, Unknown};
use elbowroom_num::Rational;
use elbowroom_plan::{Bound, DecoupledEnvelope, InstanceId, Node, ParametrizedPlan};

use crate::second_oracle::schedules;
use crate::second_oracle::z3::{Found, Z3};
pub(crate) use places::Places;
use text::{and, apply, not, number, or, sum};

/// Error for a plan with features that are not encoded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NotEncoded;

/// Text of the constraints on a plan's schedules, and text of the violations.
pub(crate) struct Encoding {
    schedules: String,
    effects: String,
    violations: Vec<String>,
}

impl Encoding {
    /// Encodes a plan; each time point may be at one of its `places`.
    pub(crate) fn new(
        task: &Task,
        plan: &ParametrizedPlan,
        epsilon: &Rational,
        places: &Places,
    ) -> Result<Self, NotEncoded> {
        let mut encoder = Encoder::new(task, plan, epsilon, places);
        encoder.check_covered()?;
        encoder.network();
        let schedules = std::mem::take(&mut encoder.text);
        encoder.positions();
        encoder.declare_guards();
        encoder.effects()?;
        encoder.guards()?;
        encoder.conditions()?;
        encoder.separation();
        encoder.durations()?;
        encoder.over_all()?;
        encoder.goal()?;
        Ok(Self {
            schedules,
            effects: encoder.text,
            violations: encoder.violations,
        })
    }

    /// Returns a text that is satisfiable if some schedule for some values in the box violates
    /// something.
    pub(crate) fn broken(&self, envelope: &DecoupledEnvelope) -> String {
        let violation = or(&self.violations);
        format!("{}(assert {violation})\n", self.lives(envelope))
    }

    /// Returns the text that holds in all schedules for values in the box.
    fn lives(&self, envelope: &DecoupledEnvelope) -> String {
        format!("{}{}{}", self.schedules, in_box(envelope), self.effects)
    }

    /// Returns a text that is satisfiable if there is a schedule for some values in the box.
    pub(crate) fn scheduled(&self, envelope: &DecoupledEnvelope) -> String {
        format!("{}{}", self.schedules, in_box(envelope))
    }
}

/// Returns `true` if the box is inside; `None` if Z3 cannot decide in time, or something is not
/// encoded.
pub(crate) fn contained(
    task: &Task,
    plan: &ParametrizedPlan,
    epsilon: &Rational,
    envelope: &DecoupledEnvelope,
    solver: &mut Z3,
) -> Option<bool> {
    if schedules::are_missing(plan, envelope)? {
        return Some(false);
    }
    let places = Places::within(plan, envelope)?;
    let mut encoder = Encoder::new(task, plan, epsilon, &places);
    let (lives, violations) = if let Ok(lives) = encoder.causes(envelope) {
        (lives, encoder.violations)
    } else {
        let encoding = Encoding::new(task, plan, epsilon, &places).ok()?;
        (encoding.lives(envelope), encoding.violations)
    };
    let mut ask = |violation: &str| match solver.ask(&format!("{lives}(assert {violation})\n")) {
        Found::Model => Some(false),
        Found::NoModel => Some(true),
        Found::Unknown => None,
    };
    // One query for all violations is fast if it succeeds; single queries take longer, but succeed
    // more often.
    ask(&or(&violations)).or_else(|| {
        let mut is_inside = Some(true);
        for violation in &violations {
            match ask(violation) {
                Some(true) => {}
                Some(false) => return Some(false),
                None => is_inside = None,
            }
        }
        is_inside
    })
}

fn in_box(envelope: &DecoupledEnvelope) -> String {
    let mut text = String::new();
    for (index, interval) in envelope.intervals().iter().enumerate() {
        if let Some(lower) = interval.lower.value() {
            let _ = writeln!(text, "(assert (<= {} g{index}))", number(lower));
        }
        if let Some(upper) = interval.upper.value() {
            let _ = writeln!(text, "(assert (<= g{index} {}))", number(upper));
        }
    }
    text
}

/// Moment at which an expression is evaluated.
#[derive(Clone)]
enum At {
    /// On arrival at a position.
    Arrival(usize),
    /// Right after a position.
    After(usize),
    /// At the moment of an action's over-all condition, after a position.
    Moment(usize, String),
}

struct Encoder<'a> {
    task: &'a Task,
    plan: &'a ParametrizedPlan,
    epsilon: &'a Rational,
    places: &'a Places,
    text: String,
    violations: Vec<String>,
}

impl<'a> Encoder<'a> {
    fn new(
        task: &'a Task,
        plan: &'a ParametrizedPlan,
        epsilon: &'a Rational,
        places: &'a Places,
    ) -> Self {
        Self {
            task,
            plan,
            epsilon,
            places,
            text: String::new(),
            violations: Vec::new(),
        }
    }

    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn assert(&mut self, formula: &str) {
        self.line(&format!("(assert {formula})"));
    }

    /// Returns the number of nodes with a position: all but zero.
    fn count(&self) -> usize {
        self.plan.plan.nodes.len() - 1
    }

    fn nodes(&self) -> impl Iterator<Item = usize> + use<> {
        1..=self.count()
    }

    fn node(&self, node: usize) -> Node {
        self.plan.plan.nodes[node]
    }

    fn durative(&self) -> Vec<(InstanceId, &'a DurativeBody)> {
        let instances = self.plan.plan.instances.iter().enumerate();
        instances
            .filter_map(|(index, instance)| {
                Some((InstanceId::from(index), instance.action.durative()?))
            })
            .collect()
    }

    fn start(&self, id: InstanceId) -> usize {
        self.plan.plan.start(id).index()
    }

    fn end(&self, id: InstanceId) -> usize {
        self.plan.plan.end(id).index()
    }

    fn check_covered(&self) -> Result<(), NotEncoded> {
        let fluents = self.task.fluent_count();
        let values = &self.task.initial().values;
        if values.len() < fluents {
            return Err(NotEncoded);
        }
        Ok(())
    }

    fn network(&mut self) {
        for node in 0..=self.count() {
            self.line(&format!("(declare-const t{node} Real)"));
            self.assert(&format!("(>= t{node} 0)"));
        }
        self.assert("(= t0 0)");
        for index in 0..self.plan.parameters.len() {
            self.line(&format!("(declare-const g{index} Real)"));
        }
        for constraint in &self.plan.plan.constraints {
            let gap = format!("(- t{} t{})", constraint.to.0, constraint.from.0);
            let bound = |bound: &Bound| match bound {
                Bound::Infinite => None,
                Bound::Finite(value) => Some(number(value)),
                Bound::Parameter(id) => Some(format!("g{}", id.0)),
            };
            if let Some(lower) = bound(&constraint.lower) {
                self.assert(&format!("(<= {lower} {gap})"));
            }
            if let Some(upper) = bound(&constraint.upper) {
                self.assert(&format!("(<= {gap} {upper})"));
            }
        }
    }

    /// Requires that each node has a position, each position a node, and that times are ordered by
    /// position.
    fn positions(&mut self) {
        let count = self.count();
        self.line("(define-fun tau0 () Real 0.0)");
        for k in 1..=count {
            self.line(&format!("(declare-const tau{k} Real)"));
            self.assert(&format!("(<= tau{} tau{k})", k - 1));
        }
        for node in self.nodes() {
            let here: Vec<_> = self
                .places
                .of(node)
                .map(|k| {
                    let at = self.at(node, k);
                    if at != "true" {
                        self.line(&format!("(declare-const {at} Bool)"));
                    }
                    self.assert(&or(&[not(&at), format!("(= t{node} tau{k})")]));
                    at
                })
                .collect();
            self.assert(&or(&here));
        }
        for node in self.nodes() {
            for other in 1..node {
                for k in self.places.of(node) {
                    let both = and(&[self.at(node, k), self.at(other, k)]);
                    self.assert(&not(&both));
                }
            }
        }
    }

    /// Returns the formula that the node's position is `k`.
    fn at(&self, node: usize, k: usize) -> String {
        let places = self.places.of(node);
        if !places.contains(&k) {
            "false".to_owned()
        } else if places.end() == places.start() {
            "true".to_owned()
        } else {
            format!("at{node}_{k}")
        }
    }

    /// Returns the formula that the node's position is less than `k`.
    fn before(&self, node: usize, k: usize) -> String {
        let places = self.places.of(node);
        if *places.end() < k {
            return "true".to_owned();
        }
        let earlier: Vec<_> = places
            .filter(|j| *j < k)
            .map(|j| self.at(node, j))
            .collect();
        or(&earlier)
    }

    fn snap(&self, node: usize) -> Option<&'a SnapAction> {
        let action = |id: InstanceId| &self.plan.plan.instances[id.index()].action;
        match self.node(node) {
            Node::Zero | Node::Timed(_) => None,
            Node::Start(id) | Node::Instant(id) => Some(match &action(id).body {
                Body::Instantaneous(snap) => snap,
                Body::Durative(body) => &body.start,
            }),
            Node::End(id) => action(id).durative().map(|body| &*body.end),
        }
    }

    fn instance(&self, node: usize) -> Option<InstanceId> {
        match self.node(node) {
            Node::Start(id) | Node::End(id) => Some(id),
            _ => None,
        }
    }

    fn condition(
        &self,
        condition: &Condition,
        at: &At,
        action: Option<InstanceId>,
    ) -> Result<String, NotEncoded> {
        let all = |parts: &[Condition]| -> Result<Vec<String>, NotEncoded> {
            parts
                .iter()
                .map(|part| self.condition(part, at, action))
                .collect()
        };
        Ok(match condition {
            Condition::Fact(fact) if self.task.is_derived(*fact) => {
                let rules = self.task.rules();
                let rules = rules.iter().filter(|rule| rule.head == *fact);
                let bodies = rules.map(|rule| self.condition(&rule.body, at, None));
                or(&bodies.collect::<Result<Vec<_>, _>>()?)
            }
            Condition::Fact(fact) => match at {
                At::Arrival(k) => format!("f{}_{}", fact.0, k - 1),
                At::After(k) | At::Moment(k, _) => format!("f{}_{k}", fact.0),
            },
            Condition::Not(part) => not(&self.condition(part, at, action)?),
            Condition::And(parts) => and(&all(parts)?),
            Condition::Or(parts) => or(&all(parts)?),
            Condition::Compare(comparison, left, right) => format!(
                "({} {} {})",
                match comparison {
                    Comparison::Less => "<",
                    Comparison::AtMost => "<=",
                    Comparison::Equal => "=",
                    Comparison::AtLeast => ">=",
                    Comparison::Greater => ">",
                },
                self.expression(left, at, action)?,
                self.expression(right, at, action)?
            ),
        })
    }

    fn expression(
        &self,
        expression: &Expression,
        at: &At,
        action: Option<InstanceId>,
    ) -> Result<String, NotEncoded> {
        let all = |parts: &[Expression]| -> Result<Vec<String>, NotEncoded> {
            parts
                .iter()
                .map(|part| self.expression(part, at, action))
                .collect()
        };
        Ok(match expression {
            Expression::Constant(value) => number(value),
            Expression::Fluent(fluent) => match at {
                At::Arrival(k) => format!("r{}_{k}", fluent.0),
                At::After(k) => format!("v{}_{k}", fluent.0),
                At::Moment(k, moment) => {
                    let drift = self.drift(fluent.index(), *k, k + 1, moment)?;
                    format!("(+ v{}_{k} {drift})", fluent.0)
                }
            },
            Expression::Duration => {
                let id = action.ok_or(NotEncoded)?;
                format!("(- t{} t{})", self.end(id), self.start(id))
            }
            Expression::Unknown(Unknown::Parameter(id)) => format!("g{id}"),
            Expression::Add(parts) => sum(&all(parts)?),
            Expression::Multiply(parts) => apply("*", "1.0", &all(parts)?),
            Expression::Subtract(left, right) => format!(
                "(- {} {})",
                self.expression(left, at, action)?,
                self.expression(right, at, action)?
            ),
            Expression::Unknown(_)
            | Expression::TotalTime
            | Expression::Violations(_)
            | Expression::Divide(..) => {
                return Err(NotEncoded);
            }
            Expression::Negate(part) => format!("(- {})", self.expression(part, at, action)?),
        })
    }
}
