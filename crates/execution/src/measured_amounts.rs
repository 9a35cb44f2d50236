//! Measured amounts, and the parameter values that follow from them.

use elbowroom_model::ground::{Action, Body, Change, Effect, Expression, FluentId};
use elbowroom_model::problem::Unknown;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, ParameterId, ParameterKind, ParametrizedPlan};

use crate::executor::{Amount, DecisionContext, PlanEvent};

/// A measured amount as a linear equation over the parameters in its expression.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AmountEquation {
    /// The action with the effect.
    pub(crate) action: String,
    pub(crate) fluent: String,
    /// The constant term of the domain's expression, and the coefficients of the parameters; at
    /// least one.
    pub(crate) constant: Rational,
    pub(crate) slopes: Vec<(ParameterId, Rational)>,
    pub(crate) observed: Rational,
}

/// An amount that differs from the domain's, in an expression without parameters.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Deviation {
    pub(crate) action: String,
    pub(crate) fluent: String,
    pub(crate) expected: Rational,
    pub(crate) observed: Rational,
}

/// The measured amounts among the news.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeasuredAmounts {
    pub(crate) readings: Vec<AmountEquation>,
    pub(crate) deviations: Vec<Deviation>,
    /// Number of amounts for which the plan has no expected value.
    pub(crate) unread: usize,
}

impl AmountEquation {
    /// Returns the value of the parameter, if there is only one.
    pub(crate) fn value(&self) -> Option<(ParameterId, Rational)> {
        let [(parameter, slope)] = self.slopes.as_slice() else {
            return None;
        };
        let value = (&self.observed - &self.constant).checked_div(slope)?;
        Some((*parameter, value))
    }
}

/// A measured amount in the news, with its action.
pub(crate) struct AmountLocation<'n> {
    pub(crate) instance: InstanceId,
    pub(crate) is_end: bool,
    pub(crate) amount: &'n Amount,
}

/// Returns all measured amounts.
pub(crate) fn amount_locations(news: &[PlanEvent]) -> impl Iterator<Item = AmountLocation<'_>> {
    let measured = news.iter().filter_map(|news| {
        let (step, is_end, measured) = match news {
            PlanEvent::Started { step, measured, .. } => (step, false, measured),
            PlanEvent::Ended { step, measured, .. } => (step, true, measured),
            _ => return None,
        };
        Some(measured.iter().map(move |amount| AmountLocation {
            instance: step.instance(),
            is_end,
            amount,
        }))
    });
    measured.flatten()
}

/// Returns the measured amounts in the news.
pub(crate) fn amounts(plan: &ParametrizedPlan, moment: &DecisionContext<'_>) -> MeasuredAmounts {
    let mut amounts = MeasuredAmounts::default();
    for place in amount_locations(moment.plan_events) {
        let action = &plan.plan.instance(place.instance).action;
        let fluent = place.amount.measured.fluent;
        if let Some(value) = amount_expression(action, place.is_end, fluent) {
            let name = moment.belief.task().fluent_name(fluent);
            note(plan, &place, name, value, &mut amounts);
        } else {
            amounts.unread += 1;
        }
    }
    amounts
}

/// Returns the plan's parameters that are durations, with their instances.
pub(crate) fn duration_parameters(
    plan: &ParametrizedPlan,
) -> impl Iterator<Item = (ParameterId, InstanceId)> + '_ {
    let numbered = plan.parameters.iter().enumerate();
    numbered.filter_map(|(index, parameter)| match parameter.kind {
        ParameterKind::Duration(instance) => Some((ParameterId::from(index), instance)),
        _ => None,
    })
}

/// Returns the expression for the nominal amount of an effect, in the domain or the plan.
pub(crate) fn amount_expression(
    action: &Action,
    is_end: bool,
    fluent: FluentId,
) -> Option<&Expression> {
    let effects: &[Effect] = match (&action.body, is_end) {
        (Body::Instantaneous(snap), _) => &snap.effects,
        (Body::Durative(body), false) => &body.start.effects,
        (Body::Durative(body), true) => &body.end.effects,
    };
    effects.iter().find_map(|effect| match &effect.change {
        Change::Update {
            fluent: own, value, ..
        } if *own == fluent => Some(value),
        _ => None,
    })
}

fn note(
    plan: &ParametrizedPlan,
    place: &AmountLocation<'_>,
    fluent: String,
    value: &Expression,
    amounts: &mut MeasuredAmounts,
) {
    let AmountLocation {
        instance, amount, ..
    } = place;
    // The actual duration is known.
    let is_duration = |index: u32| {
        let parameter = plan.parameters.get(index as usize);
        parameter.is_some_and(|own| own.kind == ParameterKind::Duration(*instance))
    };
    let mut open = Vec::new();
    value.visit_leaves(&mut |leaf| match leaf {
        Expression::Unknown(Unknown::Parameter(index)) if !is_duration(*index) => {
            open.push(ParameterId(*index));
        }
        _ => {}
    });
    open.sort_unstable();
    open.dedup();
    // The amount for one parameter, or none, set to 1 and the others to 0.
    let at = |one: Option<ParameterId>| {
        value.evaluate(&mut |leaf| match leaf {
            Expression::Fluent(fluent) => {
                let mut values = amount.values.iter();
                let found = values.find(|(own, _)| own == fluent);
                found.map(|(_, value)| value.clone())
            }
            Expression::Duration => amount.duration.clone(),
            Expression::Unknown(Unknown::Parameter(index)) if is_duration(*index) => {
                amount.duration.clone()
            }
            Expression::Unknown(Unknown::Parameter(index)) => {
                let is_one = one == Some(ParameterId(*index));
                Some(if is_one {
                    Rational::ONE
                } else {
                    Rational::ZERO
                })
            }
            _ => None,
        })
    };
    let observed = amount.measured.amount.clone();
    let Some(constant) = at(None) else {
        amounts.unread += 1;
        return;
    };
    // The amount is affine in the parameters, so one point for each determines it.
    let slope = |id: &ParameterId| Some((*id, at(Some(*id))? - &constant));
    let slopes: Vec<(ParameterId, Rational)> = open.iter().filter_map(slope).collect();
    let slopes: Vec<_> = slopes.into_iter().filter(|(_, by)| !by.is_zero()).collect();
    let action = plan.plan.instance(*instance).action.name.clone();
    if !slopes.is_empty() {
        amounts.readings.push(AmountEquation {
            action,
            fluent,
            constant,
            slopes,
            observed,
        });
    } else if constant != observed {
        amounts.deviations.push(Deviation {
            action,
            fluent,
            expected: constant,
            observed,
        });
    }
}
