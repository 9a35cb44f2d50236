//! Time-outs in an envelope's answer. An action is not cancelled if its duration is inside the box
//! *and* below its time-out.

use elbowroom_execution::run::TimeoutRule;
use elbowroom_model::problem::Problem;
use elbowroom_num::{End, Rational};
use elbowroom_plan::{Bound, DecoupledEnvelope, ParameterId, ParametrizedPlan};

use super::Subject;
use super::answer::Counterexample;
use crate::answers::Exact;

/// Returns, for each parameter, the time-out of the action whose duration it is, or `None` if it is
/// no duration, or if time-outs are off.
pub(super) fn timeouts(plan: &ParametrizedPlan, rule: &TimeoutRule) -> Vec<Option<Rational>> {
    let mut timeouts = vec![None; plan.parameters.len()];
    for (instance, id) in plan.open_durations() {
        let action = &plan.plan.instance(instance).action.name;
        timeouts[id.index()] = rule.of(action, &plan.parameter(id).nominal);
    }
    timeouts
}

/// Returns the mistake, for users, if a rule is about an action that the problem does not have.
pub(crate) fn unknown_action(rule: &TimeoutRule, problem: &Problem) -> Option<String> {
    let is_known = |name: &str| {
        let inner = name
            .strip_prefix('(')
            .and_then(|name| name.strip_suffix(')'));
        let mut words = inner.unwrap_or(name).split_whitespace();
        let schema = words.next();
        let schema = problem
            .schemas
            .iter()
            .find(|it| Some(it.name.as_str()) == schema);
        let objects: Vec<&str> = words.collect();
        schema.is_some_and(|schema| {
            inner.is_none()
                || objects.len() == schema.parameters.len()
                    && objects
                        .iter()
                        .all(|object| problem.object(object).is_some())
        })
    };
    let unknown = rule.names().find(|name| !is_known(name))?;
    Some(format!(
        "unknown action `{unknown}` in the time-outs; write `drive=40`, or `(drive a b)=40` with \
         the objects"
    ))
}

/// An action that is planned to take longer than its time-out.
pub(crate) struct PlannedTimeout {
    action: String,
    planned: Rational,
    timeout: Rational,
}

impl PlannedTimeout {
    /// Returns the first action of the plan that times out before its planned end.
    pub(crate) fn find(plan: &ParametrizedPlan, rule: &TimeoutRule) -> Option<Self> {
        let constraints = plan.plan.constraints.iter();
        let set = constraints.filter_map(|constraint| {
            let id = plan.plan.duration_of(constraint)?;
            match &constraint.lower {
                lower if *lower != constraint.upper => None,
                Bound::Finite(planned) => Some((id, planned)),
                Bound::Parameter(own) => Some((id, &plan.parameter(*own).nominal)),
                Bound::Infinite => None,
            }
        });
        let told = plan
            .commanded_durations
            .iter()
            .map(|(id, planned)| (*id, planned));
        set.chain(told).find_map(|(id, planned)| {
            let action = &plan.plan.instance(id).action.name;
            let timeout = rule.of(action, planned);
            let timeout = timeout.filter(|timeout| planned > timeout)?;
            Some(Self {
                action: action.clone(),
                planned: planned.clone(),
                timeout,
            })
        })
    }

    /// Returns the mistake and its remedy, for users.
    pub(crate) fn message(&self) -> String {
        let Self {
            action,
            planned,
            timeout,
        } = self;
        format!(
            "{action} is planned to take {}, but times out after {}; give a longer --timeout, or \
             `none`",
            planned.to_decimal(3),
            timeout.to_decimal(3),
        )
    }
}

impl Subject<'_> {
    /// Returns a counterexample if an action of the plan times out even as planned.
    pub(super) fn planned_timeout(&self) -> Option<Counterexample> {
        let found = PlannedTimeout::find(self.plan, &self.request.timeout)?;
        let shortfall = Some(&found.planned - &found.timeout);
        let values = self.plan.nominal().iter().cloned().collect();
        Some(self.timeout_counterexample(found.message(), shortfall, values))
    }

    /// Returns a counterexample if an action can time out inside the box.
    pub(super) fn possible_timeout(&self, envelope: &DecoupledEnvelope) -> Option<Counterexample> {
        let rule = &self.request.timeout;
        let plan = self.plan;
        let all = timeouts(plan, rule).into_iter().enumerate();
        let (id, timeout) = all
            .filter_map(|(index, timeout)| Some((ParameterId::from(index), timeout?)))
            .find(|(id, timeout)| match &envelope.interval(*id).upper {
                End::Closed(upper) | End::Open(upper) => upper > timeout,
                End::Infinite => true,
            })?;
        let interval = envelope.interval(id);
        let upper = interval.upper.value();
        let may_take = match upper {
            Some(upper) => format!("up to {}", upper.to_decimal(3)),
            None => "arbitrarily long".to_owned(),
        };
        let message = format!(
            "{} may be {may_take} in this box, but the action times out after {}; give a smaller \
             box, a longer --timeout, or `none`",
            self.explainer.quantity(id),
            timeout.to_decimal(3),
        );
        let lower = interval.lower.value().cloned().unwrap_or_default();
        let beyond = match upper {
            Some(upper) => (&timeout + upper) / Rational::from(2),
            None => timeout.clone() + Rational::ONE,
        };
        let mut values: Vec<Rational> = plan.nominal().iter().cloned().collect();
        values[id.index()] = beyond.max(lower);
        let shortfall = upper.map(|upper| upper - &timeout);
        Some(self.timeout_counterexample(message, shortfall, values))
    }

    fn timeout_counterexample(
        &self,
        message: String,
        shortfall: Option<Rational>,
        values: Vec<Rational>,
    ) -> Counterexample {
        let names = self.plan.parameters.iter().map(|own| own.name.clone());
        Counterexample {
            message,
            shortfall,
            verdict: None,
            values: names.zip(values.into_iter().map(Exact)).collect(),
            schedule: Vec::new(),
            plays: Vec::new(),
        }
    }
}
