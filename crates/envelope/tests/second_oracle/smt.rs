//! The authors' encoding of a plan as SMT-LIB text: one position for each time point, one copy of
//! each fact and fluent for each position.
//!
//! As in their tool, simultaneous time points are tried in every order. Where the judge is more
//! precise, the text follows the judge: over-all conditions are read at every moment between two
//! positions of different times, and timed initials after the last action do not count.

use std::fmt::Write;

use elbowroom_model::ground::{
    Body, Change, Condition, ContinuousEffect, DurativeBody, Effect, Expression, SnapAction,
};
use elbowroom_model::problem::{Comparison, Unknown, UpdateOperator};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;
use elbowroom_plan::{Bound, DecoupledEnvelope, InstanceId, Node, NodeId, ParametrizedPlan};

/// The plan has something that is not encoded here.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NotEncoded;

/// The text that a plan's schedules satisfy, and the text of what may go wrong in them.
pub(crate) struct Encoding {
    schedules: String,
    effects: String,
    violation: String,
}

impl Encoding {
    pub(crate) fn new(
        task: &Task,
        plan: &ParametrizedPlan,
        epsilon: &Rational,
    ) -> Result<Self, NotEncoded> {
        let mut encoder = Encoder {
            task,
            plan,
            epsilon,
            text: String::new(),
            violations: Vec::new(),
        };
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
            violation: or(&encoder.violations),
        })
    }

    /// Satisfiable if some schedule for some values in the box breaks something.
    pub(crate) fn broken(&self, envelope: &DecoupledEnvelope) -> String {
        format!(
            "{}{}{}(assert {})\n",
            self.schedules,
            in_box(envelope),
            self.effects,
            self.violation
        )
    }

    /// Satisfiable if there is a schedule for some values in the box.
    pub(crate) fn scheduled(&self, envelope: &DecoupledEnvelope) -> String {
        format!("{}{}", self.schedules, in_box(envelope))
    }
}

fn in_box(envelope: &DecoupledEnvelope) -> String {
    let mut text = String::new();
    for (index, interval) in envelope.intervals.iter().enumerate() {
        if let Some(lower) = interval.lower.value() {
            let _ = writeln!(text, "(assert (<= {} g{index}))", number(lower));
        }
        if let Some(upper) = interval.upper.value() {
            let _ = writeln!(text, "(assert (<= g{index} {}))", number(upper));
        }
    }
    text
}

fn number(value: &Rational) -> String {
    let text = value.abs().to_string();
    let text = match text.split_once('/') {
        Some((numerator, denominator)) => format!("(/ {numerator}.0 {denominator}.0)"),
        None => format!("{text}.0"),
    };
    if value.is_negative() {
        format!("(- {text})")
    } else {
        text
    }
}

fn apply(operator: &str, empty: &str, parts: &[String]) -> String {
    match parts {
        [] => empty.to_owned(),
        [part] => part.clone(),
        _ => format!("({operator} {})", parts.join(" ")),
    }
}

fn and(parts: &[String]) -> String {
    apply("and", "true", parts)
}

fn or(parts: &[String]) -> String {
    apply("or", "false", parts)
}

fn sum(parts: &[String]) -> String {
    apply("+", "0.0", parts)
}

/// The node's position is less than `k`.
fn before(node: usize, k: usize) -> String {
    let earlier: Vec<_> = (1..k).map(|j| format!("at{node}_{j}")).collect();
    or(&earlier)
}

/// Where an expression is read.
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
    text: String,
    violations: Vec<String>,
}

impl<'a> Encoder<'a> {
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn assert(&mut self, formula: &str) {
        self.line(&format!("(assert {formula})"));
    }

    /// How many nodes have a position: all but zero.
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

    /// Each node has a position, each position a node, and times follow positions.
    fn positions(&mut self) {
        let count = self.count();
        self.line("(define-fun tau0 () Real 0.0)");
        for k in 1..=count {
            self.line(&format!("(declare-const tau{k} Real)"));
            self.assert(&format!("(<= tau{} tau{k})", k - 1));
        }
        for node in self.nodes() {
            let mut here = Vec::new();
            for k in 1..=count {
                self.line(&format!("(declare-const at{node}_{k} Bool)"));
                self.assert(&format!("(=> at{node}_{k} (= t{node} tau{k}))"));
                here.push(format!("at{node}_{k}"));
            }
            self.assert(&or(&here));
        }
        for k in 1..=count {
            for node in self.nodes() {
                for other in 1..node {
                    self.assert(&format!("(not (and at{node}_{k} at{other}_{k}))"));
                }
            }
        }
    }

    fn snap(&self, node: usize) -> Option<&'a SnapAction> {
        let action = |id: InstanceId| &self.plan.plan.instances[id.index()].action;
        match self.node(node) {
            Node::Zero | Node::Timed(_) => None,
            Node::Start(id) | Node::Instant(id) => Some(match &action(id).body {
                Body::Instantaneous(snap) => snap,
                Body::Durative(body) => &body.start,
            }),
            Node::End(id) => action(id).durative().map(|body| &body.end),
        }
    }

    fn instance(&self, node: usize) -> Option<InstanceId> {
        match self.node(node) {
            Node::Start(id) | Node::End(id) => Some(id),
            _ => None,
        }
    }

    /// Constants for what the guards read at an action's start say: of end effects, then of
    /// continuous ones.
    fn declare_guards(&mut self) {
        for (id, body) in self.durative() {
            for index in 0..body.end.effects.len() + body.continuous.len() {
                self.line(&format!("(declare-const guard{}_{index} Bool)", id.0));
            }
        }
    }

    fn guards(&mut self) -> Result<(), NotEncoded> {
        for (id, body) in self.durative() {
            let ends = body.end.effects.iter().map(|effect| &effect.guard);
            let continuous = body.continuous.iter().map(|effect| &effect.guard);
            for (index, guard) in ends.chain(continuous).enumerate() {
                if !guard.over_all.is_trivial() {
                    return Err(NotEncoded);
                }
                let mut holds = Vec::new();
                for k in 1..=self.count() {
                    let here = self.condition(&guard.at_start, &At::Arrival(k), Some(id))?;
                    holds.push(format!("(and at{}_{k} {here})", self.start(id)));
                }
                self.assert(&format!("(= guard{}_{index} {})", id.0, or(&holds)));
            }
        }
        Ok(())
    }

    /// Copies of facts and fluents after each position, and of fluents on arrival.
    fn effects(&mut self) -> Result<(), NotEncoded> {
        let (facts, fluents) = (self.task.fact_count(), self.task.fluent_count());
        for fact in 0..facts {
            let is_true = self.task.initial().facts.iter().any(|f| f.index() == fact);
            self.line(&format!("(define-fun f{fact}_0 () Bool {is_true})"));
        }
        let initial: Vec<_> = self.task.initial().values.iter().collect();
        for (fluent, value) in initial {
            let value = match self.plan.initial.get(fluent) {
                Some(id) => format!("g{}", id.0),
                None => number(value),
            };
            self.line(&format!("(define-fun v{}_0 () Real {value})", fluent.0));
        }
        for k in 1..=self.count() {
            for fluent in 0..fluents {
                let drift = self.drift(fluent, k - 1, k, &format!("tau{k}"))?;
                self.line(&format!("(declare-const r{fluent}_{k} Real)"));
                self.assert(&format!(
                    "(= r{fluent}_{k} (+ v{fluent}_{} {drift}))",
                    k - 1
                ));
            }
            for fact in 0..facts {
                let after = self.fact_after(fact, k)?;
                self.line(&format!("(declare-const f{fact}_{k} Bool)"));
                self.assert(&format!("(= f{fact}_{k} {after})"));
            }
            for fluent in 0..fluents {
                let after = self.value_after(fluent, k)?;
                self.line(&format!("(declare-const v{fluent}_{k} Real)"));
                self.assert(&format!("(= v{fluent}_{k} {after})"));
            }
        }
        Ok(())
    }

    /// How much a fluent moves continuously from position `from` until the time `until`, which
    /// comes before position `next` or at it.
    fn drift(
        &self,
        fluent: usize,
        from: usize,
        next: usize,
        until: &str,
    ) -> Result<String, NotEncoded> {
        let mut terms = Vec::new();
        for (id, body) in self.durative() {
            let effects = body.continuous.iter().enumerate();
            let own = effects.filter(|(_, effect)| effect.fluent.index() == fluent);
            for (index, effect) in own {
                terms.push(self.drift_of(id, body, index, effect, (from, next, until))?);
            }
        }
        Ok(sum(&terms))
    }

    fn drift_of(
        &self,
        id: InstanceId,
        body: &DurativeBody,
        index: usize,
        effect: &ContinuousEffect,
        (from, next, until): (usize, usize, &str),
    ) -> Result<String, NotEncoded> {
        let rate = self.expression(&effect.rate, &At::After(from), Some(id))?;
        Ok(format!(
            "(ite (and {} (not {}) guard{}_{}) (* {rate} (- {until} tau{from})) 0.0)",
            before(self.start(id), next),
            before(self.end(id), next),
            id.0,
            body.end.effects.len() + index
        ))
    }

    /// The effects of a node with the formula for whether they happen at position `k`.
    fn changes(&self, node: usize, k: usize) -> Result<Vec<(String, &'a Change)>, NotEncoded> {
        if let Node::Timed(group) = self.node(node) {
            let changes = self.task.timed()[group].changes.iter();
            return Ok(changes.map(|change| ("true".to_owned(), change)).collect());
        }
        let effects: &[Effect] = self.snap(node).map_or(&[], |snap| &snap.effects);
        let id = self.instance(node);
        effects
            .iter()
            .enumerate()
            .map(|(index, effect)| {
                let now = self.condition(&effect.guard.now, &At::Arrival(k), id)?;
                let happens = match (self.node(node), id) {
                    (Node::End(_), Some(id)) => format!("(and guard{}_{index} {now})", id.0),
                    _ => now,
                };
                Ok((happens, &effect.change))
            })
            .collect()
    }

    fn fact_after(&self, fact: usize, k: usize) -> Result<String, NotEncoded> {
        let (mut adds, mut deletes) = (Vec::new(), Vec::new());
        for node in self.nodes() {
            for (happens, change) in self.changes(node, k)? {
                let happens = format!("(and at{node}_{k} {happens})");
                match change {
                    Change::Add(other) if other.index() == fact => adds.push(happens),
                    Change::Delete(other) if other.index() == fact => deletes.push(happens),
                    _ => {}
                }
            }
        }
        Ok(format!(
            "(or {} (and f{fact}_{} (not {})))",
            or(&adds),
            k - 1,
            or(&deletes)
        ))
    }

    fn value_after(&self, fluent: usize, k: usize) -> Result<String, NotEncoded> {
        let mut after = format!("r{fluent}_{k}");
        for node in self.nodes() {
            let mut value = format!("r{fluent}_{k}");
            let mut count = 0;
            for (happens, change) in self.changes(node, k)? {
                let Change::Update {
                    operator,
                    fluent: other,
                    value: amount,
                } = change
                else {
                    continue;
                };
                if other.index() != fluent {
                    continue;
                }
                count += 1;
                let amount = self.expression(amount, &At::Arrival(k), self.instance(node))?;
                let new = match operator {
                    UpdateOperator::Assign => amount,
                    UpdateOperator::Increase => format!("(+ {value} {amount})"),
                    UpdateOperator::Decrease => format!("(- {value} {amount})"),
                    UpdateOperator::ScaleUp => format!("(* {value} {amount})"),
                    UpdateOperator::ScaleDown => return Err(NotEncoded),
                };
                if count > 1 && !operator.is_additive() {
                    return Err(NotEncoded);
                }
                value = format!("(ite {happens} {new} {value})");
            }
            if count > 0 {
                after = format!("(ite at{node}_{k} {value} {after})");
            }
        }
        Ok(after)
    }

    fn conditions(&mut self) -> Result<(), NotEncoded> {
        for node in self.nodes() {
            let Some(snap) = self.snap(node) else {
                continue;
            };
            for k in 1..=self.count() {
                let holds =
                    self.condition(&snap.condition, &At::Arrival(k), self.instance(node))?;
                self.violations
                    .push(format!("(and at{node}_{k} (not {holds}))"));
            }
        }
        Ok(())
    }

    fn separation(&mut self) {
        let epsilon = number(self.epsilon);
        for node in self.nodes() {
            for other in 1..node {
                let (left, right) = (self.footprint(node), self.footprint(other));
                if !left.interferes_with(&right) {
                    continue;
                }
                let near = match (self.node(node), self.node(other)) {
                    (Node::Timed(_), Node::Timed(_)) => {
                        if !self.is_open(node) && !self.is_open(other) {
                            continue;
                        }
                        // Of two timed initials the one listed first comes first.
                        format!("(< (- t{node} t{other}) {epsilon})")
                    }
                    _ => format!(
                        "(and (< (- t{node} t{other}) {epsilon}) (< (- t{other} t{node}) {epsilon}))"
                    ),
                };
                self.violations.push(near);
            }
        }
    }

    fn is_open(&self, node: usize) -> bool {
        self.plan.plan.constraints.iter().any(|constraint| {
            constraint.to.index() == node
                && constraint.from == NodeId::ZERO
                && matches!(constraint.upper, Bound::Parameter(_))
        })
    }

    fn footprint(&self, node: usize) -> Footprint {
        let action = |id: InstanceId| &self.plan.plan.instances[id.index()].action;
        match self.node(node) {
            Node::Zero => Footprint::default(),
            Node::Start(id) | Node::Instant(id) => Footprint::of_start(self.task, action(id)),
            Node::End(id) => Footprint::of_end(self.task, action(id)),
            Node::Timed(group) => Footprint::of_timed(&self.task.timed()[group]),
        }
    }

    fn durations(&mut self) -> Result<(), NotEncoded> {
        for (id, body) in self.durative() {
            let (start, end) = (self.start(id), self.end(id));
            self.violations.push(format!("(< t{end} t{start})"));
            for limit in &body.duration {
                let node = if limit.at_end { end } else { start };
                let condition =
                    Condition::Compare(limit.comparison, Expression::Duration, limit.bound.clone());
                for k in 1..=self.count() {
                    let holds = self.condition(&condition, &At::Arrival(k), Some(id))?;
                    self.violations
                        .push(format!("(and at{node}_{k} (not {holds}))"));
                }
            }
        }
        Ok(())
    }

    /// One moment for each action, after each position.
    fn over_all(&mut self) -> Result<(), NotEncoded> {
        for (id, body) in self.durative() {
            if body.over_all.is_trivial() {
                continue;
            }
            let moment = format!("s{}", id.0);
            self.line(&format!("(declare-const {moment} Real)"));
            let inside = format!(
                "(and (< t{} {moment}) (< {moment} t{}))",
                self.start(id),
                self.end(id)
            );
            for k in 1..self.count() {
                let at = At::Moment(k, moment.clone());
                let holds = self.condition(&body.over_all, &at, Some(id))?;
                self.violations.push(format!(
                    "(and {inside} (<= tau{k} {moment}) (< {moment} tau{}) (not {holds}))",
                    k + 1
                ));
            }
        }
        Ok(())
    }

    /// The goal is read after the last position whose time is that of the last action.
    fn goal(&mut self) -> Result<(), NotEncoded> {
        let actions: Vec<_> = self
            .nodes()
            .filter(|&node| !matches!(self.node(node), Node::Timed(_)))
            .collect();
        for k in 1..=self.count() {
            let mut parts = Vec::new();
            let last: Vec<_> = actions
                .iter()
                .map(|node| format!("(= t{node} tau{k})"))
                .collect();
            parts.push(or(&last));
            parts.extend(actions.iter().map(|node| format!("(<= t{node} tau{k})")));
            if k < self.count() {
                parts.push(format!("(< tau{k} tau{})", k + 1));
            }
            let holds = self.condition(&self.plan.goal, &At::After(k), None)?;
            parts.push(format!("(not {holds})"));
            self.violations.push(and(&parts));
        }
        Ok(())
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
            Condition::Fact(fact) => match at {
                At::Arrival(k) => format!("f{}_{}", fact.0, k - 1),
                At::After(k) | At::Moment(k, _) => format!("f{}_{k}", fact.0),
            },
            Condition::Not(part) => format!("(not {})", self.condition(part, at, action)?),
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
            Expression::Unknown(_) | Expression::TotalTime | Expression::Divide(..) => {
                return Err(NotEncoded);
            }
            Expression::Negate(part) => format!("(- {})", self.expression(part, at, action)?),
        })
    }
}
