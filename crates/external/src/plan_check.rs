//! Validation of the planner's output. Only valid plans are reported.

use elbowroom_model::validate::{self, Verdict};
use elbowroom_model::{Task, TimeTriggeredPlan, validate_from};
use elbowroom_pddl::{Source, read_plan};

use super::outcome::Found;
use super::request::{Question, Request};

/// Returns a plan like the given one, with times that may be valid; `None` if there is none.
///
/// Planners round their times, and the validator tolerates no errors. A caller with plan networks
/// (this crate has none) can keep the order of a plan and compute new times. The result is
/// validated like any plan. Both plans are for the given task, which begins at time 0.
pub type Repair<'a> = dyn FnMut(&Task, &TimeTriggeredPlan) -> Option<TimeTriggeredPlan> + 'a;

/// The validator's verdict on a planner's output.
pub(super) enum ValidationResult {
    Accepted(Found),
    Refused(String),
    /// The output is not a plan: an action is unknown, or lacks its duration.
    Unreadable(String),
}

pub(super) struct PlanValidator<'a, 'r> {
    pub(super) request: &'a mut Request<'r>,
    pub(super) question: Question,
    pub(super) repair: &'a mut Repair<'a>,
}

impl PlanValidator<'_, '_> {
    /// Validates a plan as printed.
    pub(super) fn validate(&mut self, text: &str) -> ValidationResult {
        let source = Source::new("plan", text);
        match read_plan(&source, &self.question.task) {
            Ok((plan, _)) => self.validate_plan(&plan),
            Err(errors) => {
                let first = errors.errors().next().map(ToString::to_string);
                ValidationResult::Unreadable(
                    first.unwrap_or_else(|| "it cannot be read".to_owned()),
                )
            }
        }
    }

    /// Validates the empty plan. It is valid if the goal holds already, or will hold once the
    /// running actions have ended.
    pub(super) fn validate_empty_plan(&mut self) -> Option<Found> {
        match self.validate_plan(&TimeTriggeredPlan::default()) {
            ValidationResult::Accepted(found) => Some(found),
            ValidationResult::Refused(_) | ValidationResult::Unreadable(_) => None,
        }
    }

    fn validate_plan(&mut self, plan: &TimeTriggeredPlan) -> ValidationResult {
        let objection = match self.accept(plan, None) {
            Ok(found) => return ValidationResult::Accepted(found),
            Err(objection) => objection,
        };
        if plan.steps.is_empty() {
            return ValidationResult::Refused(objection);
        }
        let repaired = (self.repair)(&self.question.task, plan);
        match repaired.map(|plan| self.accept(&plan, Some(&objection))) {
            Some(Ok(found)) => ValidationResult::Accepted(found),
            _ => ValidationResult::Refused(objection),
        }
    }

    /// Returns the plan in terms of the request's task if it is valid, or else the objection.
    fn accept(
        &mut self,
        plan: &TimeTriggeredPlan,
        repaired: Option<&String>,
    ) -> Result<Found, String> {
        let plan = self.question.translate(plan, self.request)?;
        let settings = validate::Settings::default();
        let situation = self.request.situation;
        match validate_from(self.request.task, situation, &plan, &settings) {
            Verdict::Valid(report) => Ok(Found {
                metric: report.metric(self.request.task),
                makespan: report.makespan,
                plan,
                repaired: repaired.cloned(),
            }),
            Verdict::Invalid(violation) => Err(violation.to_string()),
            Verdict::Undecided(why) => Err(format!("the validator cannot decide: {why}")),
        }
    }
}
