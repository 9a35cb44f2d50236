//! Amounts that were measured, and what they say about a plan's parameters.

use elbowroom_model::ground::{Action, Body, Change, Effect, Expression};
use elbowroom_model::problem::Unknown;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, ParameterId, ParameterKind, ParametrizedPlan};

use crate::event::Measured;
use crate::executor::{Moment, News};
use crate::progression::Progression;

/// The value that something measured gives to a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reading {
    /// The action in whose effect the parameter stands.
    pub(crate) action: String,
    pub(crate) parameter: ParameterId,
    pub(crate) value: Rational,
}

/// An amount that differs from what the domain says, where no parameter stands.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Deviation {
    pub(crate) action: String,
    pub(crate) fluent: String,
    pub(crate) expected: Rational,
    pub(crate) observed: Rational,
}

/// What the news say about amounts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Amounts {
    pub(crate) readings: Vec<Reading>,
    pub(crate) deviations: Vec<Deviation>,
}

/// Reads the amounts in the news. What else an amount's expression mentions is read as it is
/// believed now.
pub(crate) fn amounts(plan: &ParametrizedPlan, moment: &Moment<'_>) -> Amounts {
    let mut amounts = Amounts::default();
    for news in moment.news {
        let (step, is_end, measured) = match news {
            News::Started { step, measured, .. } => (step, false, measured),
            News::Ended { step, measured, .. } => (step, true, measured),
            _ => continue,
        };
        let action = &plan.plan.instance(InstanceId(step.0)).action;
        for measured in measured {
            if let Some(value) = expression(action, is_end, measured) {
                note(plan, action, value, measured, moment.belief, &mut amounts);
            }
        }
    }
    amounts
}

/// The plan's parameters that are the durations of instances.
pub(crate) fn duration_parameters(
    plan: &ParametrizedPlan,
) -> impl Iterator<Item = (ParameterId, InstanceId)> + '_ {
    let numbered = plan.parameters.iter().enumerate();
    numbered.filter_map(|(index, parameter)| match parameter.kind {
        ParameterKind::Duration(instance) => Some((ParameterId::from(index), instance)),
        _ => None,
    })
}

/// What the domain, or the plan, says the amount is.
fn expression<'a>(action: &'a Action, is_end: bool, measured: &Measured) -> Option<&'a Expression> {
    let effects: &[Effect] = match (&action.body, is_end) {
        (Body::Instantaneous(snap), _) => &snap.effects,
        (Body::Durative(body), false) => &body.start.effects,
        (Body::Durative(body), true) => &body.end.effects,
    };
    effects.iter().find_map(|effect| match &effect.change {
        Change::Update { fluent, value, .. } if *fluent == measured.fluent => Some(value),
        _ => None,
    })
}

fn note(
    plan: &ParametrizedPlan,
    action: &Action,
    value: &Expression,
    measured: &Measured,
    belief: &Progression,
    amounts: &mut Amounts,
) {
    let mut open = Vec::new();
    value.visit_leaves(&mut |leaf| {
        if let Expression::Unknown(Unknown::Parameter(index)) = leaf {
            open.push(ParameterId(*index));
        }
    });
    open.dedup();
    let at = |unknown: &Rational| {
        value.evaluate(&mut |leaf| match leaf {
            Expression::Fluent(fluent) => belief.value(*fluent).cloned(),
            Expression::Unknown(Unknown::Parameter(_)) => Some(unknown.clone()),
            _ => None,
        })
    };
    match open.as_slice() {
        [] => {
            let Some(expected) = at(&Rational::ZERO).filter(|value| *value != measured.amount)
            else {
                return;
            };
            amounts.deviations.push(Deviation {
                action: action.name.clone(),
                fluent: belief.task().fluent_name(measured.fluent),
                expected,
                observed: measured.amount.clone(),
            });
        }
        &[parameter] => {
            // The amount is affine in the parameter: two points give the line.
            let (Some(at_zero), Some(at_one)) = (at(&Rational::ZERO), at(&Rational::ONE)) else {
                return;
            };
            let slope = at_one - &at_zero;
            if let Some(found) = (&measured.amount - &at_zero).checked_div(&slope) {
                debug_assert!(parameter.index() < plan.parameters.len());
                amounts.readings.push(Reading {
                    action: action.name.clone(),
                    parameter,
                    value: found,
                });
            }
        }
        // One amount says nothing definite about several parameters.
        _ => {}
    }
}
