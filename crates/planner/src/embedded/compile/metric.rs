//! The problem's metric in the form used by the search.
//!
//! Most metrics are sums of `total-time` and of fluents that nothing else reads, such as
//! `total-cost`. These fluents are not part of the identity of a state: two states that differ only
//! in them allow the same plans, and the cheaper one is better. So they are added up in
//! `State::cost` and omitted from `State::values`. Fluents that are read elsewhere, or not only
//! added to, stay among the values.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{self, Body, Change as ModelChange, Expression, FluentId};
use elbowroom_model::problem::{ObjectId, Term, UpdateOperator};
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;

use super::symbols::Symbols;
use super::{Action, Change, Snap, Timed, Update};
use crate::embedded::formula::{Linear, Numeric};

/// The metric, to be minimized. Metrics to be maximized are negated.
#[derive(Clone, Debug)]
pub(crate) struct Metric {
    /// The part that is computed from `State::values`.
    pub(crate) values: Numeric,
    /// The weight of `total-time`.
    pub(crate) time: Rational,
    /// `true` if no step lowers the metric. The cost of a state is then a lower bound for all plans
    /// with the same beginning.
    pub(crate) only_grows: bool,
}

impl Metric {
    /// Returns the weight of a fluent among the values, or zero if it is not constant.
    pub(crate) fn weight(&self, fluent: u32) -> Rational {
        let Numeric::Linear(linear) = &self.values else {
            return Rational::ZERO;
        };
        let place = linear.terms.binary_search_by_key(&fluent, |term| term.0);
        place.map_or(Rational::ZERO, |place| linear.terms[place].1.clone())
    }

    /// Returns the amount by which an update increases the metric, if it is the weighted amount
    /// itself.
    pub(crate) fn amount_of(&self, update: &Update) -> Option<Linear> {
        let weight = self.weight(update.fluent);
        let Numeric::Linear(value) = &update.value else {
            return None;
        };
        let mut amount = Linear::default();
        match update.operator {
            UpdateOperator::Increase => amount.add(&weight, value),
            UpdateOperator::Decrease => amount.add(&-weight, value),
            _ => return None,
        }
        Some(amount)
    }
}

/// Returns the expression of the metric. Unknown fluents have the greatest number.
pub(super) fn ground_metric(task: &Task) -> Option<Expression> {
    let metric = task.problem().metric.as_ref()?;
    Some(metric.expression.map_fluents(&mut |fluent| {
        let objects = fluent.arguments.iter().map(|term| match term {
            Term::Object(object) => Some(*object),
            Term::Variable(_) => None,
        });
        let objects: Option<Vec<ObjectId>> = objects.collect();
        let found = objects.and_then(|objects| task.find_fluent(fluent.function, &objects));
        found.unwrap_or(FluentId(u32::MAX))
    }))
}

/// The metric while symbols are being numbered.
#[derive(Debug)]
pub(super) struct Draft {
    /// Expression over the task's fluents, with `?duration` replaced by `total-time`.
    expression: Expression,
    /// The fluents that are added up in [`State::cost`].
    summed: BTreeMap<FluentId, Sum>,
    /// `true` if it is a weighted sum.
    is_linear: bool,
}

/// A fluent that is added up.
#[derive(Debug)]
struct Sum {
    weight: Rational,
    /// The amounts that are added to it.
    amounts: Vec<Expression>,
}

impl Draft {
    /// Returns the metric of a problem if it is more than the makespan and always has a value.
    pub(super) fn of(
        task: &Task,
        grounding: &Grounding,
        situation: &Situation,
        has_fixed_numbers: bool,
    ) -> Option<Self> {
        let metric = task.problem().metric.as_ref()?;
        let values = &situation.state.values;
        let ground = ground_metric(task)?;
        let mut is_defined = true;
        ground.visit_fluents(&mut |fluent| is_defined &= values.contains_key(&fluent));
        ground.visit_leaves(&mut |leaf| {
            // The validator counts violations of preferences.
            is_defined &= !matches!(leaf, Expression::Violations(_));
        });
        if !is_defined {
            return None;
        }
        let changes = Changes::of(&ground, task, grounding, situation);
        let mut expression = ground.map_leaves(&mut |leaf| match leaf {
            Expression::TotalTime => Some(Expression::Duration),
            Expression::Fluent(fluent) if !changes.writes(*fluent) => {
                values.get(fluent).cloned().map(Expression::Constant)
            }
            _ => None,
        });
        if metric.maximize {
            expression = Expression::Negate(Box::new(expression));
        }
        let linear = Linear::of(&expression);
        if let Some(linear) = &linear
            && linear.terms.is_empty()
            && !linear.duration.is_negative()
        {
            return None;
        }
        let is_linear = linear.is_some();
        let weights = linear.map_or_else(Vec::new, |linear| linear.terms);
        let summed = weights.into_iter().filter_map(|(fluent, weight)| {
            let fluent = FluentId(fluent);
            let amounts = changes.additions_to(fluent, has_fixed_numbers)?.to_vec();
            Some((fluent, Sum { weight, amounts }))
        });
        Some(Self {
            summed: summed.collect(),
            expression,
            is_linear,
        })
    }

    /// Numbers the fluents that the metric reads. Must be called until no new fluent is numbered,
    /// since other expressions may turn out to read the metric's fluents.
    pub(super) fn read(&mut self, symbols: &mut Symbols) {
        let is_unknown = |fluent: FluentId| symbols.known_fluent(fluent).is_none();
        self.summed.retain(|&fluent, _| is_unknown(fluent));
        for amount in self.summed.values().flat_map(|sum| &sum.amounts) {
            amount.visit_fluents(&mut |read| {
                symbols.fluent(read);
            });
        }
        let summed = &self.summed;
        self.expression.visit_fluents(&mut |fluent| {
            if !summed.contains_key(&fluent) {
                symbols.fluent(fluent);
            }
        });
    }

    /// Calls `visit` for each fluent that the metric or an amount of its sum reads.
    pub(super) fn visit_fluents(&self, visit: &mut impl FnMut(FluentId)) {
        self.expression.visit_fluents(&mut *visit);
        for amount in self.summed.values().flat_map(|sum| &sum.amounts) {
            amount.visit_fluents(&mut *visit);
        }
    }

    /// Returns the cost of a change of a fluent in the metric's sum, or `None` if the fluent is not
    /// part of it.
    pub(super) fn cost(
        &self,
        fluent: FluentId,
        operator: UpdateOperator,
        value: &Expression,
    ) -> Option<Expression> {
        let weight = &self.summed.get(&fluent)?.weight;
        let factor = match operator {
            UpdateOperator::Decrease => -weight,
            _ => weight.clone(),
        };
        let parts = vec![Expression::Constant(factor), value.clone()];
        Some(Expression::Multiply(parts))
    }

    /// Returns the initial cost of the fluents in the metric's sum.
    pub(super) fn initial_cost(&self, situation: &Situation) -> Rational {
        let values = &situation.state.values;
        let costs = self.summed.iter();
        let costs = costs.filter_map(|(fluent, sum)| Some(&sum.weight * values.get(fluent)?));
        costs.fold(Rational::ZERO, |sum, cost| sum + cost)
    }

    /// Returns the finished metric. [`only_grows`] determines whether it only grows.
    pub(super) fn finish(&self, symbols: &mut Symbols) -> Metric {
        if !self.is_linear {
            // The total time is unknown where the expression is evaluated.
            let expression = self.expression.map_leaves(&mut |leaf| match leaf {
                Expression::Duration => Some(Expression::TotalTime),
                _ => None,
            });
            return Metric {
                values: symbols.numeric(&expression),
                time: Rational::ZERO,
                only_grows: false,
            };
        }
        let rest = self.expression.map_leaves(&mut |leaf| match leaf {
            Expression::Fluent(fluent) if self.summed.contains_key(fluent) => {
                Some(Expression::Constant(Rational::ZERO))
            }
            _ => None,
        });
        let mut values = symbols.numeric(&rest);
        let mut time = Rational::ZERO;
        if let Numeric::Linear(linear) = &mut values {
            time = std::mem::take(&mut linear.duration);
        }
        Metric {
            values,
            time,
            only_grows: false,
        }
    }
}

/// Returns `true` if no step lowers the metric.
pub(super) fn only_grows(
    metric: &Metric,
    snaps: &[Snap],
    actions: &[Action],
    timed: &[Timed],
) -> bool {
    let Numeric::Linear(values) = &metric.values else {
        return false;
    };
    let matters = |fluent: u32| values.terms.iter().any(|term| term.0 == fluent);
    // The values of expressions over changing fluents are not analysed.
    let is_growth = |amount: &Linear| {
        amount.terms.is_empty() && !amount.constant.is_negative() && !amount.duration.is_negative()
    };
    let is_dear = |cost: &Numeric| matches!(cost, Numeric::Linear(cost) if is_growth(cost));
    let grows = |update: &Update| {
        !matters(update.fluent) || metric.amount_of(update).is_some_and(|a| is_growth(&a))
    };
    !metric.time.is_negative()
        && snaps.iter().all(|snap| {
            snap.cost.iter().all(is_dear)
                && snap.updates.iter().all(grows)
                && snap.conditional.iter().all(|effect| match &effect.change {
                    Change::Update(update) => grows(update),
                    Change::Cost(cost) => is_dear(cost),
                    Change::Add(_) | Change::Delete(_) => true,
                })
        })
        && actions
            .iter()
            .all(|action| action.flows.iter().all(|flow| !matters(flow.fluent)))
        && timed
            .iter()
            .all(|timed| timed.assigns.iter().all(|(fluent, _)| !matters(*fluent)))
}

/// All changes of the metric's fluents.
#[derive(Debug, Default)]
struct Changes {
    /// For each fluent, the amounts that are added or subtracted.
    additions: BTreeMap<FluentId, Vec<Expression>>,
    /// The fluents that are changed in other ways.
    others: BTreeSet<FluentId>,
}

impl Changes {
    fn of(metric: &Expression, task: &Task, grounding: &Grounding, situation: &Situation) -> Self {
        let mut changes = Self::default();
        metric.visit_fluents(&mut |fluent| {
            changes.additions.insert(fluent, Vec::new());
        });
        let running = situation.running.iter().map(|running| &*running.action);
        for action in running.chain(&grounding.actions) {
            match &action.body {
                Body::Instantaneous(body) => changes.note_all(&body.effects),
                Body::Durative(body) => {
                    changes.note_all(&body.start.effects);
                    changes.note_all(&body.end.effects);
                    let moving = body.continuous.iter().map(|effect| effect.fluent);
                    changes.others.extend(moving);
                }
            }
        }
        for timed in task.timed() {
            for change in &timed.changes {
                changes.note(change);
            }
        }
        changes
    }

    fn note_all(&mut self, effects: &[ground::Effect]) {
        for effect in effects {
            self.note(&effect.change);
        }
    }

    fn note(&mut self, change: &ModelChange) {
        let ModelChange::Update {
            operator,
            fluent,
            value,
        } = change
        else {
            return;
        };
        if !operator.is_additive() {
            self.others.insert(*fluent);
        } else if let Some(amounts) = self.additions.get_mut(fluent) {
            amounts.push(value.clone());
        }
    }

    fn writes(&self, fluent: FluentId) -> bool {
        let amounts = self.additions.get(&fluent);
        self.others.contains(&fluent) || amounts.is_some_and(|amounts| !amounts.is_empty())
    }

    /// Returns the amounts if the fluent is only added to, by amounts that a state determines.
    fn additions_to(&self, fluent: FluentId, has_fixed_numbers: bool) -> Option<&[Expression]> {
        let is_constant = |amount: &Expression| Numeric::of(amount.clone()).as_constant().is_some();
        let amounts = self.additions.get(&fluent)?;
        let is_plain = !self.others.contains(&fluent)
            && (has_fixed_numbers || amounts.iter().all(is_constant));
        is_plain.then_some(amounts)
    }
}
