//! Validation of executions: violations by faulty executors are reported, and those by the world are not.

use std::sync::{Arc, Mutex};

use elbowroom::execute::{Execution, Validated};
use elbowroom::execution::{
    Cause, Decided, Decision, DecisionContext, Executor, NoRecord, Order, PlanForm, Planned,
    PreparedPlan, Reason, StepId,
};
use elbowroom::num::Rational;
use elbowroom::report::validation::Invalid;
use elbowroom::sim::SimWorld;

use crate::execution::scene::Scene;

const DOMAIN: &str = "
    (define (domain d) (:requirements :durative-actions)
      (:predicates (free) (p) (q))
      (:durative-action a :parameters () :duration (= ?duration 6)
        :condition (at start (free)) :effect (and (at start (not (free))) (at end (free)) (at end (p))))
      (:durative-action b :parameters () :duration (= ?duration 2)
        :condition (at start (p)) :effect (at end (q))))";

/// Executor that starts the steps of its plan in order, each with its own time and duration, in any
/// state.
struct Reckless {
    mission: Option<PreparedPlan>,
    orders: Vec<(Rational, i64)>,
    next: usize,
}

impl Executor for Reckless {
    fn need(&self) -> PlanForm {
        PlanForm::Network
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        self.mission = Some(mission.clone());
        Ok(())
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let mission = self.mission.as_ref().expect("a plan was adopted");
        let decided = |decision| Decided {
            decision,
            reason: Reason::new(Cause::Due),
        };
        let Some((time, duration)) = self.orders.get(self.next) else {
            let is_running = !moment.belief.running().is_empty();
            return decided(if is_running {
                Decision::Wait { until: None }
            } else {
                Decision::GoalReached
            });
        };
        if moment.now < time {
            let until = Some(time.clone());
            return decided(Decision::Wait { until });
        }
        let step = &mission.time_triggered.steps[self.next];
        let order = Order {
            step: StepId::from(mission.instances[self.next]),
            action: Arc::clone(&step.action),
            duration: Some(Rational::from(*duration)),
            planned: Planned::default(),
        };
        self.next += 1;
        decided(Decision::Start(vec![order]))
    }
}

/// Returns the validator's objections to these commanded starts: pairs of a time in thousandths and a
/// duration.
fn objections(orders: &[(i64, i64)], world: &str) -> Vec<String> {
    let problem = "(define (problem p) (:domain d) (:init (free)) (:goal (q)))";
    let scene = Scene::new(DOMAIN, problem, Some("0: (a) [6]\n6.001: (b) [2]"));
    let orders = orders.iter();
    let executor = Reckless {
        mission: None,
        orders: orders
            .map(|(time, duration)| (Rational::new(*time, 1000), *duration))
            .collect(),
        next: 0,
    };
    let told = Mutex::new(Vec::new());
    let (recorder, validation) = Validated::new(NoRecord, &scene.task, None);
    let recorder =
        recorder.on_finding(|invalid| told.lock().expect("no panic").push(invalid.clone()));
    let model = scene.world(world);
    let mut world = SimWorld::new(Arc::clone(&scene.task), &model, 1);
    let mut settings = scene.settings.clone();
    settings.max_replans = 0;
    let _ = Execution::of(&scene.task)
        .beginning_with(scene.plan.clone())
        .with_executor(executor)
        .with_settings(settings)
        .with_planner(scene.planner())
        .recorded_by(recorder)
        .run_in(&mut world);
    let found = validation.findings();
    assert_eq!(told.into_inner().expect("no panic"), found);
    assert!(
        found.iter().all(|it| matches!(it, Invalid::Start(_))),
        "{found:?}"
    );
    found.iter().map(ToString::to_string).collect()
}

#[test]
fn execution_as_the_domain_has_it_is_valid() {
    assert_eq!(objections(&[(0, 6), (6001, 2)], ""), [""; 0]);
}

#[test]
fn duration_outside_its_bounds_is_invalid() {
    assert_eq!(
        objections(&[(0, 3), (3001, 2)], ""),
        ["at 0.000: (a) takes 3, but its duration must be = 6"]
    );
}

#[test]
fn duration_that_the_world_chooses_is_not_the_fault_of_the_executor() {
    let slow = "[[duration]]\naction = \"a\"\nvalues = [17]\n";
    assert_eq!(objections(&[(0, 6), (17001, 2)], slow), [""; 0]);
}

#[test]
fn start_without_its_condition_is_invalid_even_if_the_world_refuses_it() {
    let fails = "[[failure]]\naction = \"a\"\nprobability = 1.0\n";
    let found = objections(&[(0, 6), (6001, 2)], fails);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].starts_with("at 6.001: (b)"), "{found:?}");
}

#[test]
fn start_at_the_moment_of_the_end_that_it_needs_is_invalid() {
    let found = objections(&[(0, 6), (6000, 2)], "");
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].starts_with("at 6.000: (b)"), "{found:?}");
}

#[test]
fn condition_lost_to_the_world_after_the_start_is_not_the_fault_of_the_executor() {
    let event = "[[event]]\nfact = \"(p)\"\nbecomes = false\nconstant = 7\nprobability = 1.0\n";
    assert_eq!(objections(&[(0, 6), (6001, 2)], event), [""; 0]);
}
