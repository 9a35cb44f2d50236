use std::sync::Arc;
use std::time::Duration;

use elbowroom::execute::{Embedded, PlanPreparer, RunInputs, RunSpec, WorldNames};
use elbowroom::execution::executors::ExecutorSpec;
use elbowroom::execution::{
    PlanAnswer, PlanForm, Planner, PreparationRequest, PreparedPlan, Preparer,
};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;

use super::BackgroundPreparer;
use crate::background_planner::tests::delivery;
use crate::completion_signal::{Completion, CompletionSignal};

/// Returns a prepared plan as text, without its task.
fn mission_text(mission: &PreparedPlan) -> String {
    let PreparedPlan {
        plan,
        instances,
        nominal,
        envelope,
        running,
        now,
        origin,
        ..
    } = mission;
    format!("{plan:?} {instances:?} {nominal:?} {envelope:?} {running:?} {now:?} {origin:?}")
}

/// Preparations in the background and in the foreground are the same for every form of plan.
#[test]
fn background_preparation_equals_awaited_one() {
    let (spec, task): (RunSpec, Task) = delivery();
    let task = Arc::new(task);
    let situation = Situation::initial(&task);
    let PlanAnswer::Plan(plan) = Embedded::default().plan(&task, &situation).answer else {
        panic!("there is a plan");
    };
    for name in ["guarded", "live", "stn", "fixed:20", "esterel", "adaptable"] {
        let executor: ExecutorSpec = name.parse().expect("a registered one");
        let spec = RunSpec {
            executor,
            ..spec.clone()
        };
        let need = spec.executor.needs().plan;
        let (signal, zero, later) = (
            CompletionSignal::default(),
            Rational::ZERO,
            Rational::from(3),
        );
        let mut wanted = PreparationRequest {
            task: &task,
            plan: &plan,
            situation: &situation,
            running: &[],
            now: &zero,
            need,
        };
        let inputs = RunInputs::of(spec, Arc::clone(&task), &WorldNames::default());
        let inputs = inputs.expect("it has no world file");
        let mut preparer = BackgroundPreparer::new(&inputs, &signal);
        assert!(preparer.begin(&wanted) && signal.is_awaited());
        signal.wait(Duration::from_secs(60));
        assert_eq!(signal.poll(), Some(Completion::PlanReady));
        wanted.now = &later;
        let aside = preparer.collect(&wanted).expect("it works");
        let mut analyst = PlanPreparer::new(inputs.spec().envelopes());
        let waited_for = wanted.prepare_now(&mut analyst).expect("it works");
        assert_eq!(mission_text(&aside), mission_text(&waited_for), "{name}");
        assert_eq!(aside.now, later);
        assert_eq!(aside.task.initial(), waited_for.task.initial());
        assert_eq!(need == PlanForm::PartialOrder, aside.order.is_some());
        // An abandoned preparation is not signalled.
        assert!(preparer.begin(&wanted));
        preparer.give_up();
        assert!(!signal.is_awaited());
    }
}
