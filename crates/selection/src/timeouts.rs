//! Time-outs of the actions of a plan.

use elbowroom_execution::run::TimeoutRule;
use elbowroom_model::problem::Problem;
use elbowroom_num::Rational;
use elbowroom_plan::{Bound, ParametrizedPlan};

/// Returns, for each parameter, the time-out of the action whose duration it is, or `None` if it is
/// not a duration, or if time-outs are off.
pub fn timeouts(plan: &ParametrizedPlan, rule: &TimeoutRule) -> Vec<Option<Rational>> {
    let mut timeouts = vec![None; plan.parameters.len()];
    for (instance, id) in plan.open_durations() {
        let action = &plan.plan.instance(instance).action.name;
        timeouts[id.index()] = rule.of(action, &plan.parameter(id).nominal);
    }
    timeouts
}

/// Returns an error message for users if a rule names an action that the problem does not have.
pub fn unknown_action(rule: &TimeoutRule, problem: &Problem) -> Option<String> {
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
pub struct PlannedTimeout {
    /// The action.
    pub action: String,
    /// Its planned duration.
    pub planned: Rational,
    /// Its time-out.
    pub timeout: Rational,
}

impl PlannedTimeout {
    /// Returns the first action of the plan that times out before its planned end.
    pub fn find(plan: &ParametrizedPlan, rule: &TimeoutRule) -> Option<Self> {
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
    pub fn message(&self) -> String {
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
