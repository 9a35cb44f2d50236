use std::sync::Arc;
use std::time::Duration;

use elbowroom::execute::{Analyst, Embedded, RunSpec};
use elbowroom::execution::executors::ExecutorSpec;
use elbowroom::execution::{Mission, Need, PlanAnswer, Planner, Preparer, Wanted};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;

use super::super::ahead::tests::delivery;
use super::Readied;
use crate::bell::{Bell, Ring};

/// What there is to say about a plan that is ready, but for its task.
fn said(mission: &Mission) -> String {
    let Mission {
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

/// The same is made ready in a thread as by whoever waits for it, with every executor's need.
#[test]
fn a_plan_that_is_made_ready_aside_is_what_it_would_be_otherwise() {
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
        let need = spec.executor.registered.need;
        let (bell, zero, later) = (Bell::default(), Rational::ZERO, Rational::from(3));
        let mut wanted = Wanted {
            task: &task,
            plan: &plan,
            situation: &situation,
            running: &[],
            now: &zero,
            need,
        };
        let mut readied = Readied::new(&spec, &task, &bell).expect("it has no world file");
        assert!(readied.begin(&wanted) && bell.is_awaited());
        bell.wait(Duration::from_secs(60));
        assert_eq!(bell.heard(), Some(Ring::PlanReady));
        wanted.now = &later;
        let aside = readied.collect(&wanted).expect("it works");
        let mut analyst = Analyst::new(spec.envelopes());
        let waited_for = wanted.mission(&mut analyst).expect("it works");
        assert_eq!(said(&aside), said(&waited_for), "{name}");
        assert_eq!(aside.now, later);
        assert_eq!(aside.task.initial(), waited_for.task.initial());
        assert_eq!(need == Need::PartialOrder, aside.order.is_some());
        // Whoever begins with another one, or gives it up, is not rung for.
        assert!(readied.begin(&wanted));
        readied.give_up();
        assert!(!bell.is_awaited());
    }
}
