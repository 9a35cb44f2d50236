//! Other people's planners behind the port of [`execution`](crate::execution).

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom_execution::{PlanAnswer, Planner, PlannerAnswer, Shortfall};
use elbowroom_external::{self as external, Event, Outcome, Report, Request, Settings};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_pddl::Source;

use crate::flow;

/// A program that plans, supervised; each of its plans is judged, and where only its times are
/// rounded, they are chosen again.
///
/// The program takes as long as it takes, and that is measured. If it crashes, or somebody kills it, it is
/// asked once more. What goes wrong with it then, is said in the answer
/// ([`PlanAnswer::Failed`]): a run has no plan then, and ends.
pub struct External<'a> {
    /// Which program.
    pub planner: external::Planner,
    /// The domain, to the letter.
    pub domain: Source,
    /// The problem, to the letter; in mid-execution it is written anew.
    pub problem: Source,
    /// Its limits.
    pub settings: Settings,
    /// Whether to take the first plan; otherwise the last one before the time limit.
    pub takes_first: bool,
    /// Asked about fifty times a second whether to go on.
    pub goes_on: &'a (dyn Fn() -> bool + Sync),
}

impl Planner for External<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let first = self.ask(task, situation);
        if !matches!(first.outcome, Outcome::Crashed { .. }) || !(self.goes_on)() {
            return self.answer(first, Duration::ZERO);
        }
        let second = self.ask(task, situation);
        self.answer(second, first.statistics.elapsed)
    }
}

impl External<'_> {
    /// Has the program plan.
    fn ask(&self, task: &Task, situation: &Situation) -> Report {
        external::plan(
            &self.planner,
            &mut Request {
                task,
                situation,
                domain: &self.domain,
                problem: &self.problem,
            },
            &self.settings,
            &mut flow::repaired,
            &mut |event| {
                let is_enough = self.takes_first && matches!(event, Event::Plan { .. });
                if is_enough || !(self.goes_on)() {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            },
        )
    }

    /// The answer, `before` which as much time had passed.
    fn answer(&self, report: Report, before: Duration) -> PlannerAnswer {
        let name = &self.planner.name;
        let mut remark = None;
        let answer = match report.outcome {
            Outcome::Plan(found) => {
                remark = self_overlap(&found.plan);
                PlanAnswer::Plan(found.plan)
            }
            // "No plan exists" is its claim, not a proof.
            Outcome::NotStarted { ref help, .. } => PlanAnswer::Failed {
                why: format!("{name}: {}; {help}", report.outcome),
            },
            // The same outcomes are failures where somebody asks for a plan alone.
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

/// In whole microseconds.
fn seconds(duration: Duration) -> Rational {
    let micros = i64::try_from(duration.as_micros()).unwrap_or(i64::MAX);
    Rational::new(micros, 1_000_000)
}
