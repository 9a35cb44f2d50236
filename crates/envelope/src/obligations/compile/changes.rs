//! Changes made by happenings.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Change, Expression, FactId, FluentId};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::super::timeline::{FluentChange, Reading};
use super::super::{BadCase, Difference, Obligation, Obligations, Refusal, Requirement};
use super::guards::GuardPart;
use super::{Compiler, Run};
use crate::linear::Linear;
use elbowroom_plan::{InstanceId, NodeId};

impl Compiler<'_> {
    /// Returns the continuous changes that begin at the start of an instance, with their rates;
    /// `None` for an undefined rate.
    pub(super) fn drifts(
        &self,
        run: &Run,
        node: NodeId,
        instance: InstanceId,
    ) -> Result<Vec<(FluentId, Option<Linear>)>, Refusal> {
        let action = &self.plan.plan.instance(instance).action;
        let Some(body) = action.durative() else {
            return Ok(Vec::new());
        };
        let first = body.start.effects.len() + body.end.effects.len();
        let mut drifts = Vec::new();
        for (index, effect) in body.continuous.iter().enumerate() {
            if run
                .outcomes
                .get(&(instance, first + index, GuardPart::AtStart))
                == Some(&false)
            {
                continue;
            }
            let changing = || Refusal::ChangingRate {
                place: action.name.clone(),
                fluent: self.task.fluent_name(effect.fluent),
            };
            if self.changes_later(&effect.rate, node) {
                return Err(changing());
            }
            let rate = self.reading(&run.timeline, node).linear(&effect.rate)?;
            let is_linear = |rate: &Linear| rate.times.is_empty() && rate.products.is_empty();
            if !rate.as_ref().is_none_or(is_linear) {
                return Err(Refusal::NotLinear {
                    place: action.name.clone(),
                    expression: self.task.describe_expression(&effect.rate),
                });
            }
            drifts.push((effect.fluent, rate));
        }
        Ok(drifts)
    }

    /// Returns `true` if the node or a later one may change a fluent that the expression reads.
    pub(super) fn changes_later(&self, expression: &Expression, node: NodeId) -> bool {
        let mut read = Vec::new();
        expression.visit_fluents(&mut |fluent| read.push(fluent));
        if read.is_empty() {
            return false;
        }
        self.order
            .iter()
            .skip_while(|&&other| other != node)
            .any(|&later| {
                let footprint = self.plan.plan.footprint(self.task, later);
                read.iter().any(|fluent| {
                    footprint.shifts.contains(fluent) || footprint.assigns.contains(fluent)
                })
            })
    }

    pub(super) fn apply<'e>(
        &self,
        run: &mut Run,
        node: NodeId,
        effects: impl Iterator<Item = (&'e Change, bool)>,
        obligations: &mut Obligations,
    ) -> Result<(), Refusal> {
        let read = self.read_changes(run, node, effects, obligations)?;
        record(run, node, read);
        Ok(())
    }

    /// Returns the changes that take place, with right-hand sides read on arrival. Deletions come
    /// first, so that an addition by the same happening wins.
    pub(super) fn read_changes<'e>(
        &self,
        run: &Run,
        node: NodeId,
        effects: impl Iterator<Item = (&'e Change, bool)>,
        obligations: &mut Obligations,
    ) -> Result<Vec<Recorded>, Refusal> {
        let (mut recorded, mut additions) = (Vec::new(), Vec::new());
        let mut updates: BTreeMap<FluentId, Vec<UpdateOperator>> = BTreeMap::new();
        for (change, _) in effects.filter(|&(_, happens)| happens) {
            match change {
                Change::Add(fact) => additions.push(Recorded::Fact(*fact, true)),
                Change::Delete(fact) => recorded.push(Recorded::Fact(*fact, false)),
                Change::Update {
                    operator,
                    fluent,
                    value,
                } => {
                    updates.entry(*fluent).or_default().push(*operator);
                    let reading = self.reading(&run.timeline, node);
                    let value = reading.linear(value)?;
                    let old = reading.linear(&Expression::Fluent(*fluent))?;
                    let new = updated(&reading, *operator, old, value)?;
                    if new.is_none() {
                        // An effect without a value makes the plan invalid, whatever the times are.
                        obligations.direct.push(Obligation {
                            requirement: Requirement::Defined { node },
                            bad_cases: vec![BadCase {
                                differences: Vec::new(),
                                inequalities: run.timeline.assumptions.clone(),
                            }],
                        });
                    }
                    recorded.push(Recorded::Fluent(
                        *fluent,
                        new.unwrap_or(FluentChange::Assign(None)),
                    ));
                }
            }
        }
        forbid_conflicts(run, node, &updates, obligations);
        recorded.append(&mut additions);
        Ok(recorded)
    }

    /// Adds the obligation of a continuous change without a value or a rate: its action has
    /// duration 0.
    pub(super) fn never_takes_time(
        &self,
        run: &Run,
        node: NodeId,
        instance: InstanceId,
        obligations: &mut Obligations,
    ) {
        let (start, end) = (self.plan.plan.start(instance), self.plan.plan.end(instance));
        obligations.direct.push(Obligation {
            requirement: Requirement::Defined { node },
            bad_cases: vec![BadCase {
                differences: vec![Difference::before(start, end)],
                inequalities: run.timeline.assumptions.clone(),
            }],
        });
    }
}

/// Change that was read, but not recorded yet.
pub(super) enum Recorded {
    Fact(FactId, bool),
    Fluent(FluentId, FluentChange),
}

/// Adds the obligation that several updates of one fluent by one happening are all increases and
/// decreases.
fn forbid_conflicts(
    run: &Run,
    node: NodeId,
    updates: &BTreeMap<FluentId, Vec<UpdateOperator>>,
    obligations: &mut Obligations,
) {
    for (&fluent, operators) in updates {
        if operators.len() == 1 || operators.iter().all(|operator| operator.is_additive()) {
            continue;
        }
        obligations.direct.push(Obligation {
            requirement: Requirement::SingleUpdate { node, fluent },
            bad_cases: vec![BadCase {
                differences: Vec::new(),
                inequalities: run.timeline.assumptions.clone(),
            }],
        });
    }
}

pub(super) fn record(run: &mut Run, node: NodeId, changes: Vec<Recorded>) {
    for change in changes {
        match change {
            Recorded::Fact(fact, becomes) => run.timeline.set(node, fact, becomes),
            Recorded::Fluent(fluent, change) => run.timeline.change(node, fluent, change),
        }
    }
}

/// Returns the value of a fluent after an update; `None` if a number it needs is undefined.
pub(super) fn updated(
    reading: &Reading<'_>,
    operator: UpdateOperator,
    old: Option<Linear>,
    value: Option<Linear>,
) -> Result<Option<FluentChange>, Refusal> {
    let Some(value) = value else { return Ok(None) };
    if operator == UpdateOperator::Assign {
        return Ok(Some(FluentChange::Assign(Some(value))));
    }
    let Some(old) = old else { return Ok(None) };
    let not_linear = || Refusal::NotLinear {
        place: reading.location.to_owned(),
        expression: format!("a {} effect", operator.name()),
    };
    Ok(Some(match operator {
        UpdateOperator::Assign => FluentChange::Assign(Some(value)),
        UpdateOperator::Increase => FluentChange::Shift(value),
        UpdateOperator::Decrease => FluentChange::Shift(value.scaled(&Rational::from(-1))),
        UpdateOperator::ScaleUp => {
            FluentChange::Assign(Some(old.times(&value).ok_or_else(not_linear)?))
        }
        UpdateOperator::ScaleDown => {
            let divisor = value.as_constant().ok_or_else(not_linear)?;
            let Some(factor) = divisor.reciprocal() else {
                return Ok(None);
            };
            FluentChange::Assign(Some(old.scaled(&factor)))
        }
    }))
}
