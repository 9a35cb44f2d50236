//! Changes of each fact and fluent, in the order of a nominal schedule.

mod fluent;

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::derivation::{Derived, Moment};
use elbowroom_model::ground::{Expression, FactId, FluentId};
use elbowroom_model::problem::{Comparison, Unknown};
use elbowroom_num::Rational;

use super::precedence::{Around, Side};
use super::{Inequality, Refusal, Substitution};
use crate::linear::Linear;
use elbowroom_plan::{NodeId, ParameterId, ParametrizedPlan};
use fluent::FluentHistory;

pub(crate) use fluent::FluentChange;

/// Events of every fact and fluent so far, in nominal order.
///
/// A *cut* is a set of nodes that are assumed to have happened. Reading at a cut returns the plan's
/// state after exactly these. During the symbolic run the cut is everything recorded so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timeline {
    facts: BTreeMap<FactId, FactHistory>,
    /// Boxed, because most timelines contain one fluent, and a B-tree allocates space for eleven.
    fluents: BTreeMap<FluentId, Box<FluentHistory>>,
    /// Outcomes of conditional effects that this timeline assumes.
    pub(crate) assumptions: Vec<Inequality>,
}

/// Changes of a fact along a plan.
#[derive(Clone, Debug, Default)]
pub(crate) struct FactHistory {
    pub(crate) initially: bool,
    /// The nodes, each with the new value of the fact.
    pub(crate) events: Vec<(NodeId, bool)>,
}

/// Cut through a plan: `true` for nodes that have happened. `None` contains everything recorded.
pub(crate) type Cut<'a> = Option<&'a dyn Fn(NodeId) -> bool>;

/// Context for evaluating an expression: a cut, a moment, and the action it belongs to.
pub(crate) struct Reading<'a> {
    pub(crate) task: &'a Task,
    pub(crate) timeline: &'a Timeline,
    pub(crate) cut: Cut<'a>,
    /// The time at which values are read.
    pub(crate) moment: NodeId,
    /// Start and end of the action that `?duration` refers to.
    pub(crate) action: Option<(NodeId, NodeId)>,
    /// Parameters that are differences of times.
    pub(crate) substitution: &'a Substitution,
    /// Location, for messages.
    pub(crate) location: &'a str,
    /// The derived facts at the cut, computed on first use.
    pub(crate) derived: OnceCell<Derived<Refusal>>,
}

impl Timeline {
    /// Creates a timeline of the initial state.
    pub(crate) fn initial(
        task: &Task,
        plan: &ParametrizedPlan,
        substitution: &Substitution,
    ) -> Self {
        let mut timeline = Self::default();
        for &fact in &task.initial().facts {
            timeline.facts.entry(fact).or_default().initially = true;
        }
        for (&fluent, value) in &task.initial().values {
            timeline.put_value(fluent, Some(Linear::constant(value.clone())));
        }
        for (&fluent, &parameter) in &plan.initial {
            timeline.put_value(fluent, Some(parameter_value(parameter, substitution)));
        }
        timeline
    }

    /// Records that the fact becomes true or false at the node.
    pub(crate) fn set(&mut self, node: NodeId, fact: FactId, becomes: bool) {
        self.facts
            .entry(fact)
            .or_default()
            .events
            .push((node, becomes));
    }

    /// Records a change of the fluent at the node.
    pub(crate) fn change(&mut self, node: NodeId, fluent: FluentId, change: FluentChange) {
        self.fluents.entry(fluent).or_default().push(node, change);
    }

    /// Returns the facts and values at the moment, after all recorded changes, as a timeline
    /// without events.
    pub(crate) fn snapshot(&self, moment: NodeId) -> Self {
        let mut snapshot = Self {
            assumptions: self.assumptions.clone(),
            ..Self::default()
        };
        for &fact in self.facts.keys() {
            snapshot.put_fact(fact, self.is_true(fact, None));
        }
        for &fluent in self.fluents.keys() {
            snapshot.put_value(fluent, self.value(fluent, None, moment));
        }
        snapshot
    }

    /// Sets the initial truth value of a fact.
    pub(crate) fn put_fact(&mut self, fact: FactId, truth: bool) {
        self.facts.entry(fact).or_default().initially = truth;
    }

    /// Sets the initial value of a fluent.
    pub(crate) fn put_value(&mut self, fluent: FluentId, value: Option<Linear>) {
        self.fluents.entry(fluent).or_default().set_initial(value);
    }

    /// Returns the active continuous changes.
    pub(crate) fn drifts(&self) -> Vec<(FluentId, Linear)> {
        let all = self.fluents.iter().flat_map(|(&fluent, history)| {
            let rates = history.last().rates();
            rates.map(move |rate| (fluent, rate.clone()))
        });
        all.collect()
    }

    /// Returns the part of the timeline that is relevant to a condition on these facts and fluents
    /// inside an action. Also returns the events that may be on either side of the moment.
    pub(super) fn relevant_part(
        &self,
        (facts, fluents): (&[FactId], &[FluentId]),
        around: &mut Around<'_>,
    ) -> (Self, BTreeSet<NodeId>) {
        let mut near = Self::default();
        let mut open = BTreeSet::new();
        for fact in facts {
            if let Some(history) = self.facts.get(fact) {
                near.facts
                    .insert(*fact, history.relevant_part_of_history(around, &mut open));
            }
        }
        for fluent in fluents {
            if let Some(history) = self.fluents.get(fluent) {
                near.fluents
                    .insert(*fluent, Box::new(history.relevant_part(around, &mut open)));
            }
        }
        (near, open)
    }

    /// Returns the history of a fact.
    pub(crate) fn fact_history(&self, fact: FactId) -> FactHistory {
        self.facts.get(&fact).cloned().unwrap_or_default()
    }

    /// Returns the nodes at which the fact may change.
    pub(crate) fn fact_nodes(&self, fact: FactId) -> impl Iterator<Item = NodeId> + '_ {
        self.facts
            .get(&fact)
            .into_iter()
            .flat_map(|h| h.events.iter().map(|&(node, _)| node))
    }

    /// Returns the nodes at which the fluent's value or rate may change.
    pub(crate) fn fluent_nodes(&self, fluent: FluentId) -> impl Iterator<Item = NodeId> + '_ {
        self.fluents
            .get(&fluent)
            .into_iter()
            .flat_map(|h| h.events.iter().map(|(node, _)| *node))
    }

    fn is_true(&self, fact: FactId, cut: Cut<'_>) -> bool {
        let Some(history) = self.facts.get(&fact) else {
            return false;
        };
        history
            .events
            .iter()
            .rev()
            .find(|&&(node, _)| cut.is_none_or(|cut| cut(node)))
            .map_or(history.initially, |&(_, becomes)| becomes)
    }

    fn value(&self, fluent: FluentId, cut: Cut<'_>, moment: NodeId) -> Option<Linear> {
        let history = self.fluents.get(&fluent)?;
        match cut {
            Some(cut) => history.state_at(cut).value(moment),
            None => history.last().value(moment),
        }
    }
}

impl FactHistory {
    /// Returns the part of the history that is relevant to a moment inside an action. Collects the
    /// events that may be on either side of the moment.
    ///
    /// Events that make a fact true and events that make it false interfere. So if an event of each
    /// kind is known to come after the moment, so are all later ones.
    fn relevant_part_of_history(
        &self,
        around: &mut Around<'_>,
        open: &mut BTreeSet<NodeId>,
    ) -> Self {
        let here = self
            .events
            .partition_point(|(node, _)| around.is_not_after_start(*node));
        let (mut initially, mut kept) = (self.initially, Vec::new());
        for &(node, becomes) in self.events[..here].iter().rev() {
            if around.side(node) == Some(Side::Before) {
                initially = becomes;
                break;
            }
            kept.push((node, becomes));
        }
        kept.reverse();
        let mut to_come = [false; 2];
        for &(node, becomes) in &self.events[here..] {
            if around.side(node) != Some(Side::After) {
                kept.push((node, becomes));
                continue;
            }
            to_come[usize::from(becomes)] = true;
            if to_come == [true; 2] {
                break;
            }
        }
        open.extend(kept.iter().map(|(node, _)| node));
        Self {
            initially,
            events: kept,
        }
    }
}

/// Returns the parameter, or the difference of times that replaces it.
pub(crate) fn parameter_value(id: ParameterId, substitution: &Substitution) -> Linear {
    match substitution.get(&id) {
        Some(&(from, to)) => Linear::difference(from, to),
        None => Linear::parameter(id),
    }
}

impl Reading<'_> {
    /// Returns `true` if the fact is true at the cut.
    pub(crate) fn fact(&self, fact: FactId) -> Result<bool, Refusal> {
        if !self.task.is_derived(fact) {
            return Ok(self.timeline.is_true(fact, self.cut));
        }
        let derivation = self
            .task
            .derivation()
            .ok_or_else(|| Refusal::Unstratified {
                place: self.location.to_owned(),
            })?;
        let basic = BasicFacts(self);
        let derived = self.derived.get_or_init(|| derivation.derive(&basic));
        derivation.with_derived_facts(&basic, derived).fact(fact)
    }

    /// Returns the value of the expression at this position of the timeline; `None` if it is
    /// undefined.
    pub(crate) fn linear(&self, expression: &Expression) -> Result<Option<Linear>, Refusal> {
        Ok(match expression {
            Expression::Constant(value) => Some(Linear::constant(value.clone())),
            Expression::Fluent(fluent) => self.timeline.value(*fluent, self.cut, self.moment),
            Expression::Duration => self
                .action
                .map(|(start, end)| Linear::difference(start, end)),
            Expression::TotalTime | Expression::Violations(_) => {
                return Err(self.not_linear(expression));
            }
            Expression::Unknown(Unknown::Parameter(id)) => {
                Some(parameter_value(ParameterId(*id), self.substitution))
            }
            Expression::Unknown(_) => {
                return Err(Refusal::OpenNumber {
                    place: self.location.to_owned(),
                });
            }
            Expression::Add(parts) => {
                let mut sum = Some(Linear::default());
                for part in parts {
                    let part = self.linear(part)?;
                    sum = sum.zip(part).map(|(sum, part)| sum.plus(&part));
                }
                sum
            }
            Expression::Subtract(left, right) => self
                .linear(left)?
                .zip(self.linear(right)?)
                .map(|(l, r)| l.minus(&r)),
            Expression::Negate(part) => self
                .linear(part)?
                .map(|part| part.scaled(&Rational::from(-1))),
            Expression::Multiply(parts) => {
                let mut product = Some(Linear::constant(Rational::ONE));
                for part in parts {
                    let Some((so_far, part)) = product.zip(self.linear(part)?) else {
                        return Ok(None);
                    };
                    product = Some(
                        so_far
                            .times(&part)
                            .ok_or_else(|| self.not_linear(expression))?,
                    );
                }
                product
            }
            Expression::Divide(left, right) => {
                let Some((left, right)) = self.linear(left)?.zip(self.linear(right)?) else {
                    return Ok(None);
                };
                let divisor = right
                    .as_constant()
                    .ok_or_else(|| self.not_linear(expression))?;
                divisor.reciprocal().map(|factor| left.scaled(&factor))
            }
        })
    }

    fn not_linear(&self, expression: &Expression) -> Refusal {
        Refusal::NotLinear {
            place: self.location.to_owned(),
            expression: self.task.describe_expression(expression),
        }
    }
}

/// Context for evaluating rules: basic facts, and comparisons of constants.
struct BasicFacts<'a>(&'a Reading<'a>);

impl Moment<Refusal> for BasicFacts<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, Refusal> {
        Ok(self.0.timeline.is_true(fact, self.0.cut))
    }

    /// Evaluates a comparison, which is false with an undefined number.
    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, Refusal> {
        let (Some(left), Some(right)) = (self.0.linear(left)?, self.0.linear(right)?) else {
            return Ok(false);
        };
        let (Some(left), Some(right)) = (left.as_constant(), right.as_constant()) else {
            return Err(Refusal::NotLinear {
                place: self.0.location.to_owned(),
                expression: "a derived predicate over numbers that vary".to_owned(),
            });
        };
        Ok(comparison.holds(left, right))
    }
}

#[cfg(test)]
mod tests;
