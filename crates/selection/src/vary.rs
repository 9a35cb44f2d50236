//! Checks of the quantities to leave open, before there is a plan.

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::parametrize::{ParametrizeError, Target, VarySpec, parametrize};
use elbowroom_plan::{Schedule, StnPlan};

/// Checks that each specification names something in the problem or in a possible plan.
///
/// A specification may name something that a plan does not have: the next plan may have it. A name
/// that is unknown in the problem is an error.
///
/// # Errors
/// The first error.
pub fn check_vary(task: &Task, specs: &[VarySpec]) -> Result<(), ParametrizeError> {
    let plan = StnPlan::unconstrained(task, Vec::new());
    let timed = task.timed().iter().map(|timed| timed.time.clone());
    let nominal: Schedule = [Rational::ZERO].into_iter().chain(timed).collect();
    for spec in specs {
        let is_about_the_problem = matches!(spec.target, Target::Initial(_) | Target::Timed { .. });
        match parametrize(task, plan.clone(), &nominal, std::slice::from_ref(spec)) {
            // Another specification may define the value; if not, preparing the plan reports the
            // error.
            Ok(_) | Err(ParametrizeError::NoNominal { .. }) => {}
            Err(ParametrizeError::NothingMatches { .. }) if !is_about_the_problem => {}
            Err(error) if is_about_an_absent_action(task, spec, &error) => {}
            Err(ParametrizeError::UnknownName { name, .. }) if is_label(&name) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Returns `true` if a specification matches nothing only because the plan does not use the action
/// of the domain, or the open number of an action, that it names.
pub(super) fn is_about_an_absent_action(
    task: &Task,
    spec: &VarySpec,
    error: &ParametrizeError,
) -> bool {
    let schemas = &task.problem().schemas;
    if let Target::Unknown { name, .. } = &spec.target {
        let short = name
            .rsplit_once('.')
            .map_or(name.as_str(), |(_, short)| short);
        let mut numbers = schemas.iter().flat_map(|schema| &schema.unknowns);
        return matches!(error, ParametrizeError::UnknownName { .. })
            && numbers.any(|number| number.eq_ignore_ascii_case(short));
    }
    let is_action = |word: &str| {
        let mut names = schemas.iter().map(|schema| schema.name.as_str());
        names.any(|name| name.eq_ignore_ascii_case(word))
    };
    matches!(error, ParametrizeError::UnknownName { .. })
        && spec.text.split([' ', '(', ')']).any(is_action)
}

/// Returns `true` if it can be the label of a plan's step: `n0`.
fn is_label(name: &str) -> bool {
    let number = name.strip_prefix(['n', 'N']);
    number.is_some_and(|number| !number.is_empty() && number.bytes().all(|it| it.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::is_label;

    #[test]
    fn step_labels_are_recognised() {
        assert!(is_label("n12"));
        assert!(!is_label("n"));
        assert!(!is_label("nap"));
        assert!(!is_label("12"));
    }
}
