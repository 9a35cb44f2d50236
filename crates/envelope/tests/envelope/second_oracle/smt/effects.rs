//! Copies of facts and fluents, position by position.

use elbowroom_model::ground::{Change, ContinuousEffect, DurativeBody, Effect};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_plan::{InstanceId, Node};

use super::text::{and, not, number, or, sum};
use super::{At, Encoder, NotEncoded};

impl<'a> Encoder<'a> {
    /// Declares constants for the guards read at an action's start: of end effects, then of
    /// continuous ones.
    pub(super) fn declare_guards(&mut self) {
        for (id, body) in self.durative() {
            for index in 0..body.end.effects.len() + body.continuous.len() {
                self.line(&format!("(declare-const guard{}_{index} Bool)", id.0));
            }
        }
    }

    pub(super) fn guards(&mut self) -> Result<(), NotEncoded> {
        for (id, body) in self.durative() {
            let ends = body.end.effects.iter().map(|effect| &effect.guard);
            let continuous = body.continuous.iter().map(|effect| &effect.guard);
            for (index, guard) in ends.chain(continuous).enumerate() {
                if !guard.over_all.is_trivial() {
                    return Err(NotEncoded);
                }
                let mut holds = Vec::new();
                for k in self.places.of(self.start(id)) {
                    let here = self.condition(&guard.at_start, &At::Arrival(k), Some(id))?;
                    holds.push(and(&[self.at(self.start(id), k), here]));
                }
                self.assert(&format!("(= guard{}_{index} {})", id.0, or(&holds)));
            }
        }
        Ok(())
    }

    /// Defines copies of facts and fluents after each position, and of fluents on arrival.
    pub(super) fn effects(&mut self) -> Result<(), NotEncoded> {
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
                let before = format!("v{fluent}_{}", k - 1);
                let arriving = match drift.as_str() {
                    "0.0" => before,
                    _ => format!("(+ {before} {drift})"),
                };
                self.copy(&format!("r{fluent}_{k}"), "Real", &arriving);
            }
            for fact in 0..facts {
                let after = self.fact_after(fact, k)?;
                self.copy(&format!("f{fact}_{k}"), "Bool", &after);
            }
            for fluent in 0..fluents {
                let after = self.value_after(fluent, k)?;
                self.copy(&format!("v{fluent}_{k}"), "Real", &after);
            }
        }
        Ok(())
    }

    /// Defines a constant with a value, or only an alias if the value is simple.
    fn copy(&mut self, name: &str, sort: &str, value: &str) {
        if value.contains(' ') {
            self.line(&format!("(declare-const {name} {sort})"));
            self.assert(&format!("(= {name} {value})"));
        } else {
            self.line(&format!("(define-fun {name} () {sort} {value})"));
        }
    }

    /// Returns the continuous change of a fluent from position `from` until the time `until`, which
    /// comes before position `next` or at it.
    pub(super) fn drift(
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
        terms.retain(|term| term != "0.0");
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
        let guard = format!("guard{}_{}", id.0, body.end.effects.len() + index);
        let runs = and(&[
            self.before(self.start(id), next),
            not(&self.before(self.end(id), next)),
            guard,
        ]);
        if runs == "false" {
            return Ok("0.0".to_owned());
        }
        let rate = self.expression(&effect.rate, &At::After(from), Some(id))?;
        Ok(format!("(ite {runs} (* {rate} (- {until} tau{from})) 0.0)"))
    }

    /// Returns the effects of a node, each with the formula that it happens at position `k`.
    fn changes(&self, node: usize, k: usize) -> Result<Vec<(String, &'a Change)>, NotEncoded> {
        if self.at(node, k) == "false" {
            return Ok(Vec::new());
        }
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
                    (Node::End(_), Some(id)) => and(&[format!("guard{}_{index}", id.0), now]),
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
                let happens = and(&[self.at(node, k), happens]);
                match change {
                    Change::Add(other) if other.index() == fact => adds.push(happens),
                    Change::Delete(other) if other.index() == fact => deletes.push(happens),
                    _ => {}
                }
            }
        }
        let kept = and(&[format!("f{fact}_{}", k - 1), not(&or(&deletes))]);
        adds.push(kept);
        Ok(or(&adds))
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
                after = format!("(ite {} {value} {after})", self.at(node, k));
            }
        }
        Ok(after)
    }
}
