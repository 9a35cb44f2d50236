//! Encoding of plans without changing numbers: no positions, only precedence.
//!
//! A fact is true at a moment exactly if something made it true before (the beginning counts) and
//! nothing made it false in between. Time points that interfere must not coincide, which is a
//! separate requirement, so the encoding of coinciding ones does not matter.

use elbowroom_model::ground::{Change, Condition, Effect, Expression, FactId};
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, Node};

use super::text::{and, not, number, or};
use super::{Encoder, NotEncoded, in_box};

/// Moment at which a condition is read.
#[derive(Clone, Copy)]
enum Moment {
    /// On arrival at a time point.
    Arrival(usize),
    /// Right after a time point.
    After(usize),
    /// After everything.
    Last,
}

impl Encoder<'_> {
    /// Returns the text that holds in all schedules for values in the box; adds the possible
    /// violations to `violations`.
    pub(super) fn causes(&mut self, envelope: &DecoupledEnvelope) -> Result<String, NotEncoded> {
        self.check_no_changing_numbers()?;
        self.network();
        self.separation();
        for node in self.nodes() {
            if let Some(snap) = self.snap(node) {
                let holds = self.holds(&snap.condition, Moment::Arrival(node))?;
                self.violations.push(not(&holds));
            }
        }
        for (id, body) in self.durative() {
            let (start, end) = (self.start(id), self.end(id));
            self.violations.push(format!("(< t{end} t{start})"));
            for limit in &body.duration {
                let bound = number(&self.constant(&limit.bound)?);
                let operator = operator(limit.comparison);
                let holds = format!("({operator} (- t{end} t{start}) {bound})");
                self.violations.push(not(&holds));
            }
            self.never_broken(&body.over_all, start, end)?;
        }
        let goal = self.plan.goal.clone();
        let goal = self.holds(&goal, Moment::Last)?;
        self.violations.push(not(&goal));
        Ok(format!("{}{}", self.text, in_box(envelope)))
    }

    /// Requires a condition right after the start, and after each time point before the end.
    fn never_broken(
        &mut self,
        condition: &Condition,
        start: usize,
        end: usize,
    ) -> Result<(), NotEncoded> {
        if condition.is_trivial() {
            return Ok(());
        }
        let first = self.holds(condition, Moment::After(start))?;
        self.violations
            .push(and(&[self.places.is_before(start, end), not(&first)]));
        let mut facts = Vec::new();
        condition.visit_facts(&mut |fact| facts.push(fact));
        for node in self.nodes() {
            let is_about = facts.iter().any(|fact| self.sets(node, *fact).is_some());
            if node == start || node == end || !is_about {
                continue;
            }
            let holds = self.holds(condition, Moment::After(node))?;
            let parts = [
                self.places.is_before(start, node),
                self.places.is_before(node, end),
                not(&holds),
            ];
            self.violations.push(and(&parts));
        }
        Ok(())
    }

    fn check_no_changing_numbers(&self) -> Result<(), NotEncoded> {
        let is_plain = |effect: &Effect| {
            effect.guard.is_trivial() && !matches!(effect.change, Change::Update { .. })
        };
        let snaps = self.nodes().filter_map(|node| self.snap(node));
        let timed = self.task.timed().iter().flat_map(|timed| &timed.changes);
        let are_plain = snaps.flat_map(|snap| &snap.effects).all(is_plain)
            && self
                .durative()
                .iter()
                .all(|(_, body)| body.continuous.is_empty())
            && timed
                .into_iter()
                .all(|change| !matches!(change, Change::Update { .. }))
            && self.plan.initial.is_empty();
        if are_plain { Ok(()) } else { Err(NotEncoded) }
    }

    /// Returns the truth value that a time point assigns to a fact, if any. Additions come after
    /// deletions.
    fn sets(&self, node: usize, fact: FactId) -> Option<bool> {
        let changes: Vec<&Change> = if let Node::Timed(group) = self.node(node) {
            self.task.timed()[group].changes.iter().collect()
        } else {
            let snap = self.snap(node)?;
            snap.effects.iter().map(|effect| &effect.change).collect()
        };
        if changes.contains(&&Change::Add(fact)) {
            Some(true)
        } else {
            changes.contains(&&Change::Delete(fact)).then_some(false)
        }
    }

    fn holds(&self, condition: &Condition, moment: Moment) -> Result<String, NotEncoded> {
        let all = |parts: &[Condition]| -> Result<Vec<String>, NotEncoded> {
            parts.iter().map(|part| self.holds(part, moment)).collect()
        };
        Ok(match condition {
            Condition::Fact(fact) if self.task.is_derived(*fact) => return Err(NotEncoded),
            Condition::Fact(fact) => self.is_true(*fact, moment),
            Condition::Not(part) => not(&self.holds(part, moment)?),
            Condition::And(parts) => and(&all(parts)?),
            Condition::Or(parts) => or(&all(parts)?),
            Condition::Compare(comparison, left, right) => {
                let holds = comparison.holds(&self.constant(left)?, &self.constant(right)?);
                holds.to_string()
            }
        })
    }

    /// Returns the value of an expression of fluents that nothing changes.
    fn constant(&self, expression: &Expression) -> Result<Rational, NotEncoded> {
        let initial = &self.task.initial().values;
        let value = expression.evaluate(&mut |leaf| match leaf {
            Expression::Constant(value) => Some(value.clone()),
            Expression::Fluent(fluent) => initial.get(fluent).cloned(),
            _ => None,
        });
        value.ok_or(NotEncoded)
    }

    fn is_true(&self, fact: FactId, moment: Moment) -> String {
        let setters = |truth| {
            self.nodes()
                .filter(move |&node| self.sets(node, fact) == Some(truth))
        };
        let has_happened = |node: usize| self.has_happened(node, moment);
        let mut ways = Vec::new();
        if self.task.initial().facts.contains(&fact) {
            let parts: Vec<_> = setters(false)
                .map(|node| not(&has_happened(node)))
                .collect();
            ways.push(and(&parts));
        }
        for adder in setters(true) {
            let mut parts = vec![has_happened(adder)];
            parts.extend(setters(false).map(|deleter| {
                let is_over = self.places.is_before(deleter, adder);
                or(&[is_over, not(&has_happened(deleter))])
            }));
            ways.push(and(&parts));
        }
        or(&ways)
    }

    fn has_happened(&self, node: usize, moment: Moment) -> String {
        match moment {
            Moment::Arrival(here) if node == here => "false".to_owned(),
            Moment::After(here) if node == here => "true".to_owned(),
            Moment::Arrival(here) => self.places.is_before(node, here),
            Moment::After(here) => not(&self.places.is_before(here, node)),
            Moment::Last => "true".to_owned(),
        }
    }
}

fn operator(comparison: Comparison) -> &'static str {
    match comparison {
        Comparison::Less => "<",
        Comparison::AtMost => "<=",
        Comparison::Equal => "=",
        Comparison::AtLeast => ">=",
        Comparison::Greater => ">",
    }
}
