//! Plans reported during the search.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::answers::plan::{
    BetterPlan, ImprovingPlans, ImprovingPlansRequest, NextPlan, PlanFinding, PlanRequest,
    PlanStop, plan,
};
use elbowroom::answers::{NoObserver, Observer, StopRequest};
use elbowroom::model::Task;
use elbowroom::model::validate::{Settings, Verdict, validate};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};

fn task(name: &str) -> Arc<Task> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    let [domain, problem] = ["domain", "problem"].map(|file| {
        let path = folder.join(name).join(format!("{file}.pddl"));
        let text = std::fs::read_to_string(&path).unwrap();
        Source::new(file, text.as_str())
    });
    Arc::new(Task::new(pddl::read_problem(&domain, &problem).unwrap().0))
}

fn request(task: &Arc<Task>) -> ImprovingPlansRequest<'_> {
    ImprovingPlansRequest {
        task,
        most_memory: None,
        self_overlap: false,
        threads: 1,
    }
}

/// Returns the values by which plans are compared if the metric is minimized.
fn value(better: &BetterPlan) -> (Rational, Rational) {
    let PlanFinding::Plan {
        makespan, metric, ..
    } = &better.finding
    else {
        panic!("no plan: {:?}", better.finding)
    };
    let metric = metric.clone().unwrap_or_else(|| makespan.clone());
    (metric, makespan.clone())
}

#[test]
fn each_plan_is_valid_and_strictly_better_than_the_one_before() {
    for name in ["errand", "crossing", "match", "delivery"] {
        let task = task(name);
        let mut search = ImprovingPlans::search(&request(&task), Box::new(NoObserver)).unwrap();
        let plans: Vec<_> = search.by_ref().collect();
        let values: Vec<_> = plans.iter().map(value).collect();
        assert!(!plans.is_empty(), "{name}");
        assert!(values.is_sorted_by(|a, b| a > b), "{name}: {values:?}");
        for better in &plans {
            let verdict = validate(&task, &better.plan, &Settings::default());
            assert!(matches!(verdict, Verdict::Valid(_)), "{name}: {verdict:?}");
        }
        // The answer is the last plan, and the same as without a listener.
        let outcome = search.answer().unwrap().as_ref().unwrap();
        assert_eq!(
            outcome.plan,
            plans.last().map(|it| it.plan.clone()),
            "{name}"
        );
        assert_eq!(outcome.answer.plans, plans.len(), "{name}");
        let mut alone = PlanRequest {
            task: &task,
            first_plan_only: false,
            most_memory: None,
            self_overlap: false,
            threads: 1,
        };
        let alone = plan(&mut alone, &mut NoObserver).unwrap();
        assert_eq!(*outcome, alone, "{name}");
        assert_eq!(search.next_within(Duration::ZERO), NextPlan::Ended);
    }
}

#[test]
fn improvable_plan_yields_several_plans() {
    let search = ImprovingPlans::search(&request(&task("errand")), Box::new(NoObserver));
    assert!(search.unwrap().count() > 1);
}

/// Watcher that lives as long as the search.
struct LifetimeObserver(Arc<()>);

impl Observer for LifetimeObserver {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        let _ = &self.0;
        ControlFlow::Continue(())
    }
}

#[test]
fn dropped_iterator_ends_its_search() {
    let task = task("errand");
    let witness = Arc::new(());
    let watcher = Box::new(LifetimeObserver(Arc::clone(&witness)));
    let mut search = ImprovingPlans::search(&request(&task), watcher).unwrap();
    assert!(search.next().is_some());
    drop(search);
    while Arc::strong_count(&witness) > 1 {
        std::thread::yield_now();
    }
}

/// Watcher that ends the search at once.
struct Impatient;

impl Observer for Impatient {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        ControlFlow::Break(StopRequest::TimeLimit)
    }
}

#[test]
fn final_answer_states_reason_for_missing_plan() {
    let task = task("errand");
    let mut search = ImprovingPlans::search(&request(&task), Box::new(Impatient)).unwrap();
    assert_eq!(search.next(), None);
    let outcome = search.answer().unwrap().as_ref().unwrap();
    assert_eq!(outcome.plan, None);
    assert_eq!(outcome.answer.stop, PlanStop::TimeLimit);
}
