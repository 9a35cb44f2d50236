//! Literal execution of a plan: each action at its planned time, independent of results.

use std::sync::{Arc, Mutex};

use elbowroom::execution::run::Report;
use elbowroom::execution::{
    Cause, Decided, Decision, DecisionContext, DispatchableCache, Ending, Executor, NoPlanner,
    Order, PlanEvent, PlanForm, Planned, PreparationResult, PrepareError, PreparedPlan, Preparer,
    Reason, StepId,
};
use elbowroom::model::{State, Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::plan::{ParametrizedPlan, StnPlan};
use elbowroom::sim::{SimWorld, WorldModel};

use crate::execution::scene::Scene;

/// Result of an execution.
pub(crate) struct Outcome {
    pub(crate) report: Report,
    /// True state at the end.
    pub(crate) truth: State,
    /// `true` if the goal holds.
    pub(crate) is_goal: bool,
    /// Believed state when the last action has ended; `None` after a failure.
    pub(crate) belief: Option<State>,
}

/// Executes the plan of a scene literally in a world without deviations.
pub(crate) fn execute(scene: &Scene) -> Outcome {
    let model = WorldModel::without_deviations();
    let mut world = SimWorld::new(Arc::clone(&scene.task), &model, 0);
    let belief = Arc::new(Mutex::new(None));
    let executor = Literal {
        steps: Vec::new(),
        left: 0,
        belief: Arc::clone(&belief),
    };
    let report = scene
        .execution("stn")
        .with_executor(executor)
        .with_preparer(IdentityPreparer)
        .with_planner(NoPlanner)
        .run_in(&mut world);
    let belief = belief.lock().expect("nobody panics").take();
    Outcome {
        report,
        truth: world.truth().state(),
        is_goal: world.truth().is_goal() == Ok(true),
        belief,
    }
}

/// Preparer without any analysis of the plan.
struct IdentityPreparer;

impl Preparer for IdentityPreparer {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        given: &TimeTriggeredPlan,
        _need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        let plan = StnPlan::unconstrained(task, Vec::new());
        Ok(PreparationResult {
            time_triggered: given.clone(),
            instances: Vec::new(),
            nominal: plan.nodes.iter().map(|_| Rational::ZERO).collect(),
            plan: ParametrizedPlan {
                commanded_durations: std::collections::BTreeMap::default(),
                plan,
                parameters: Vec::new(),
                initial: std::collections::BTreeMap::default(),
                goal: task.goal().clone(),
            },
            envelope: None,
            forms: DispatchableCache::default(),
            order: None,
        })
    }
}

struct Literal {
    /// Steps that have not been started, in reverse order.
    steps: Vec<(StepId, elbowroom::model::Step)>,
    left: usize,
    belief: Arc<Mutex<Option<State>>>,
}

fn decided(decision: Decision, cause: Cause) -> Decided {
    Decided {
        decision,
        reason: Reason::new(cause),
    }
}

impl Executor for Literal {
    fn need(&self) -> PlanForm {
        PlanForm::Orderings
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        let steps = mission.time_triggered.steps.iter().cloned();
        self.steps = (0..).map(StepId).zip(steps).collect();
        self.steps.sort_by(|(_, a), (_, b)| b.start.cmp(&a.start));
        self.left = self.steps.len();
        Ok(())
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        for news in moment.plan_events {
            match news {
                PlanEvent::Ended {
                    ending: Ending::Succeeded,
                    ..
                } => self.left -= 1,
                PlanEvent::Ended { .. } => return decided(Decision::Replan, Cause::Failed),
                PlanEvent::Started { step, .. } => {
                    let _ = step;
                }
                other => panic!("{other:?} in a world where everything goes as planned"),
            }
        }
        if moment.belief.violated_action().is_some() {
            return decided(Decision::Replan, Cause::Condition);
        }
        let due = |(_, step): &(StepId, elbowroom::model::Step)| step.start <= *moment.now;
        let mut orders = Vec::new();
        while self.steps.last().is_some_and(due) {
            let Some((id, step)) = self.steps.pop() else {
                break;
            };
            orders.push(Order {
                step: id,
                action: step.action,
                duration: step.duration,
                planned: Planned::default(),
            });
        }
        if !orders.is_empty() {
            return decided(Decision::Start(orders), Cause::Due);
        }
        if self.left == 0 {
            let belief = moment.belief;
            *self.belief.lock().expect("nobody panics") = Some(belief.state());
            return if belief.is_goal() == Ok(true) {
                decided(Decision::GoalReached, Cause::GoalReached)
            } else {
                decided(Decision::Replan, Cause::PlanDone)
            };
        }
        let until = self.steps.last().map(|(_, step)| step.start.clone());
        decided(Decision::Wait { until }, Cause::NothingDue)
    }
}
