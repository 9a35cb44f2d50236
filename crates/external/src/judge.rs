//! No plan is shown that the judge has not seen.

use elbowroom_model::validate::{self, Verdict};
use elbowroom_model::{Task, TimeTriggeredPlan, validate_from};
use elbowroom_pddl::{Source, read_plan};

use super::outcome::Found;
use super::request::{Question, Request};

/// Gives a plan like the one given, with times that may be valid; `None` if there is none.
///
/// Planners round their times, and the judge forgives nothing. Who has plan networks at hand
/// (this crate has not) can keep a plan's order and choose its times again. What comes back is
/// judged like any plan. Both plans are for the task given, which begins at time 0.
pub type Repair<'a> = dyn FnMut(&Task, &TimeTriggeredPlan) -> Option<TimeTriggeredPlan> + 'a;

/// The validator's verdict on a planner's output.
pub(super) enum Judgement {
    Accepted(Found),
    Refused(String),
    /// It is no plan: an action is unknown, or lacks its duration.
    Unreadable(String),
}

pub(super) struct Judge<'a, 'r> {
    pub(super) request: &'a mut Request<'r>,
    pub(super) question: Question,
    pub(super) repair: &'a mut Repair<'a>,
}

impl Judge<'_, '_> {
    /// Judges a plan as it was printed.
    pub(super) fn judge(&mut self, text: &str) -> Judgement {
        let source = Source::new("plan", text);
        match read_plan(&source, &self.question.task) {
            Ok((plan, _)) => self.judge_plan(&plan),
            Err(errors) => {
                let first = errors.errors().next().map(ToString::to_string);
                Judgement::Unreadable(first.unwrap_or_else(|| "it cannot be read".to_owned()))
            }
        }
    }

    /// Judges doing nothing, which is a plan where the goal holds already, or will once what is
    /// running has ended.
    pub(super) fn judge_nothing(&mut self) -> Option<Found> {
        match self.judge_plan(&TimeTriggeredPlan::default()) {
            Judgement::Accepted(found) => Some(found),
            Judgement::Refused(_) | Judgement::Unreadable(_) => None,
        }
    }

    fn judge_plan(&mut self, plan: &TimeTriggeredPlan) -> Judgement {
        let objection = match self.accept(plan, None) {
            Ok(found) => return Judgement::Accepted(found),
            Err(objection) => objection,
        };
        if plan.steps.is_empty() {
            return Judgement::Refused(objection);
        }
        let repaired = (self.repair)(&self.question.task, plan);
        match repaired.map(|plan| self.accept(&plan, Some(&objection))) {
            Some(Ok(found)) => Judgement::Accepted(found),
            _ => Judgement::Refused(objection),
        }
    }

    /// The plan in our terms, if it is valid; else the objection.
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
