//! Other planners behind the port of [`elbowroom_execution`].

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom_envelope::pipeline;
use elbowroom_execution::{PlanAnswer, Planner, PlannerAnswer, Shortfall};
use elbowroom_external::{self as external, Event, Outcome, Report, Request, Settings};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_pddl::Source;

/// A supervised planner process. Each of its plans is validated; if only its times are rounded,
/// they are computed again.
///
/// The planning time is measured. If the process crashes or is killed, it is started once more. If
/// it fails again, the answer contains the reason ([`PlanAnswer::Failed`]); the run then has no
/// plan, and ends.
pub struct External<'a> {
    /// The planner.
    pub planner: external::Planner,
    /// The domain, as written.
    pub domain: Source,
    /// The problem, as written; for replanning, a new problem is written.
    pub problem: Source,
    /// Its limits.
    pub settings: Settings,
    /// `true` to use the first plan; `false` to use the last one before the time limit.
    pub stops_at_first_plan: bool,
    /// Called about fifty times a second; returns `false` to stop the planner.
    pub may_continue: &'a (dyn Fn() -> bool + Sync),
}

impl Planner for External<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let first = self.run_planner(task, situation);
        if !matches!(first.outcome, Outcome::Crashed { .. }) || !(self.may_continue)() {
            return self.answer(first, Duration::ZERO);
        }
        let second = self.run_planner(task, situation);
        self.answer(second, first.statistics.elapsed)
    }
}

impl External<'_> {
    /// Runs the planner.
    fn run_planner(&self, task: &Task, situation: &Situation) -> Report {
        external::plan(
            &self.planner,
            &mut Request {
                task,
                situation,
                domain: &self.domain,
                problem: &self.problem,
            },
            &self.settings,
            &mut pipeline::reschedule,
            &mut |event| {
                let is_enough = self.stops_at_first_plan && matches!(event, Event::Plan { .. });
                if is_enough || !(self.may_continue)() {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            },
        )
    }

    /// Converts the outcome to an answer. `before` is the duration of an earlier attempt.
    fn answer(&self, report: Report, before: Duration) -> PlannerAnswer {
        let name = &self.planner.name;
        let mut remark = None;
        let answer = match report.outcome {
            Outcome::Plan(found) => {
                remark = self_overlap(&found.plan);
                PlanAnswer::Plan(found.plan)
            }
            // A claim that no plan exists is not a proof.
            Outcome::NotStarted { ref help, .. } => PlanAnswer::Failed {
                why: format!("{name}: {}; {help}", report.outcome),
            },
            // `plan` requests treat the same outcomes as failures.
            other @ (Outcome::Crashed { .. }
            | Outcome::NotUnderstood { .. }
            | Outcome::Unsupported { .. }
            | Outcome::Refused { .. }) => PlanAnswer::Failed {
                why: format!("{name}: {other}"),
            },
            other => PlanAnswer::NotFound {
                why: format!("{name}: {other}"),
            },
        };
        PlannerAnswer {
            answer,
            seconds: Some(seconds(before + report.statistics.elapsed)),
            remark,
            shortfall: Shortfall::default(),
        }
    }
}

/// Returns the warning that an action overlaps itself in the plan.
fn self_overlap(plan: &TimeTriggeredPlan) -> Option<String> {
    let [earlier, later] = plan.self_overlap()?.map(|place| &plan.steps[place]);
    Some(format!(
        "{} overlaps itself: it starts at {}, before the instance from {} to {} has ended",
        later.action.name,
        later.start.to_decimal(6),
        earlier.start.to_decimal(6),
        earlier.end().to_decimal(6),
    ))
}

/// Converts a duration to seconds, in whole microseconds.
fn seconds(duration: Duration) -> Rational {
    let micros = i64::try_from(duration.as_micros()).unwrap_or(i64::MAX);
    Rational::new(micros, 1_000_000)
}
