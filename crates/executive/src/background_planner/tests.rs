use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use elbowroom::execute::{Embedded, NamedText, RunSpec};
use elbowroom::execution::{PlanAnswer, Planner, PlannerAnswer};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::num::work::Stop;
use elbowroom::pddl::{Source, read_problem};

use super::{BackgroundPlanner, BackgroundSettings};
use crate::completion_signal::{Completion, CompletionSignal};

/// Planner for situations without a plan in advance. Counts its calls.
struct CountingPlanner<'a>(&'a AtomicUsize);

impl Planner for CountingPlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.0.fetch_add(1, Ordering::SeqCst);
        Embedded::default().plan(task, situation)
    }
}

/// The case `delivery`.
pub(crate) fn delivery() -> (RunSpec, Task) {
    let text = |name: &str| {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/delivery");
        NamedText {
            name: name.to_owned(),
            text: std::fs::read_to_string(file.join(name)).expect("a case"),
        }
    };
    let (domain, problem) = (text("domain.pddl"), text("problem.pddl"));
    let source = |it: &NamedText| Source::new(it.name.clone(), it.text.clone());
    let (read, _) = read_problem(&source(&domain), &source(&problem)).expect("a correct case");
    (RunSpec::new(domain, problem), Task::new(read))
}

fn settings(stop: &Stop) -> BackgroundSettings {
    BackgroundSettings {
        stop: stop.clone(),
        signal: CompletionSignal::default(),
        memory_limit: None,
    }
}

fn steps(answer: PlanAnswer) -> Vec<(String, Rational)> {
    let PlanAnswer::Plan(plan) = answer else {
        panic!("there is a plan: {answer:?}");
    };
    let step = |step: &elbowroom::model::Step| (step.action.name.clone(), step.start.clone());
    plan.steps.iter().map(step).collect()
}

/// The thread returns the answer of the planner, which is not called again.
#[test]
fn plan_in_advance_equals_awaited_plan() {
    let ((spec, task), asked) = (delivery(), AtomicUsize::new(0));
    let situation = Situation::initial(&task);
    let mut planner = BackgroundPlanner::new(
        Box::new(CountingPlanner(&asked)),
        &spec,
        &settings(&Stop::default()),
    );
    planner.expect(&task, &situation);
    let made = steps(planner.plan(&task, &situation).answer);
    assert_eq!(asked.load(Ordering::SeqCst), 0);
    assert_eq!(
        made,
        steps(Embedded::default().plan(&task, &situation).answer)
    );
    // The plan is used once.
    assert_eq!(made, steps(planner.plan(&task, &situation).answer));
    assert_eq!(asked.load(Ordering::SeqCst), 1);
}

/// A plan for another situation is discarded, and so is an interrupted one.
#[test]
fn plan_for_other_situation_is_discarded() {
    let ((spec, task), asked) = (delivery(), AtomicUsize::new(0));
    let situation = Situation::initial(&task);
    let mut later = situation.clone();
    later.time = Rational::from(1);
    let stop = Stop::default();
    let mut planner =
        BackgroundPlanner::new(Box::new(CountingPlanner(&asked)), &spec, &settings(&stop));
    planner.expect(&task, &later);
    assert!(!steps(planner.plan(&task, &situation).answer).is_empty());
    assert_eq!(asked.load(Ordering::SeqCst), 1);
    // Only the last expectation counts.
    planner.expect(&task, &situation);
    planner.expect(&task, &later);
    assert!(!steps(planner.plan(&task, &situation).answer).is_empty());
    assert_eq!(asked.load(Ordering::SeqCst), 2);
    stop.request();
    planner.expect(&task, &situation);
    assert!(!steps(planner.plan(&task, &situation).answer).is_empty());
    assert_eq!(asked.load(Ordering::SeqCst), 3);
}

/// Only a begun plan is signalled, not one in advance or an abandoned one. It equals the awaited plan.
#[test]
fn begun_plan_is_signalled() {
    let ((spec, task), asked) = (delivery(), AtomicUsize::new(0));
    let situation = Situation::initial(&task);
    let settings = settings(&Stop::default());
    let long = std::time::Duration::from_secs(60);
    let mut planner = BackgroundPlanner::new(Box::new(CountingPlanner(&asked)), &spec, &settings);
    planner.expect(&task, &situation);
    assert!(!settings.signal.is_awaited());
    for _ in 0..2 {
        // The first one was begun in advance.
        assert!(planner.begin(&task, &situation));
        settings.signal.wait(long);
        assert_eq!(settings.signal.poll(), Some(Completion::PlanMade));
        let made = steps(planner.collect(&task, &situation).answer);
        assert_eq!(
            made,
            steps(Embedded::default().plan(&task, &situation).answer)
        );
    }
    assert!(planner.begin(&task, &situation));
    planner.give_up();
    assert!(!settings.signal.is_awaited() && settings.signal.poll().is_none());
    assert_eq!(asked.load(Ordering::SeqCst), 0);
}

/// A search beyond the memory limit finds no plan. (The limit is effective on Linux only.)
#[test]
fn search_beyond_memory_limit_finds_no_plan() {
    let ((spec, task), asked) = (delivery(), AtomicUsize::new(0));
    let mut situation = Situation::initial(&task);
    // The goal is unreachable without the parcel, but the search space is large.
    situation.state.facts.clear();
    let settings = BackgroundSettings {
        memory_limit: Some(0),
        ..settings(&Stop::default())
    };
    let mut planner = BackgroundPlanner::new(Box::new(CountingPlanner(&asked)), &spec, &settings);
    assert!(planner.begin(&task, &situation));
    let answer = planner.collect(&task, &situation).answer;
    assert!(!matches!(answer, PlanAnswer::Plan(_)), "{answer:?}");
}
