//! Plans with a better metric: small problems whose best plans are known.

use std::ops::ControlFlow;

use elbowroom_model::Situation;
use elbowroom_planner::{Answer, FoundPlan, Objective, Settings, Stopped, plan};

use crate::embedded::world::{describe, task};

/// Searches until the space is exhausted, and returns all plans that were reported.
fn plans(domain: &str, problem: &str, settings: &Settings) -> (Vec<FoundPlan>, Answer) {
    let task = task(domain, problem);
    let situation = Situation::initial(&task);
    let (mut plans, mut left) = (Vec::new(), 2000);
    let answer = plan(&task, &situation, settings, &mut |progress| {
        plans.extend(progress.plan.clone());
        left -= 1;
        if left == 0 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    (plans, answer)
}

/// Returns the best plan's metric and makespan from a search that has ended by itself.
fn best(domain: &str, problem: &str) -> (String, String) {
    let (plans, answer) = plans(domain, problem, &Settings::default());
    let Answer::Plan { found, stopped, .. } = &answer else {
        panic!("{}", describe(&answer));
    };
    assert_eq!(*stopped, Stopped::Exhausted, "{}", describe(&answer));
    assert_eq!(plans.last(), Some(found));
    let worth = |found: &FoundPlan| (found.value.clone(), found.makespan.clone());
    assert!(plans.is_sorted_by(|a, b| worth(a) > worth(b)));
    let metric = found.metric.as_ref().expect("there is a metric");
    (metric.to_string(), found.makespan.to_string())
}

/// From home to work: by taxi, or on foot to the bus, by bus, and on foot again.
const TRIP: &str = "(:requirements :durative-actions :numeric-fluents)
    (:predicates (home) (stop) (square) (work)) (:functions (money))
    (:durative-action taxi :parameters () :duration (= ?duration 5)
      :condition (at start (home))
      :effect (and (at start (not (home))) (at end (work)) (at end (increase (money) 30))))
    (:durative-action walk :parameters () :duration (= ?duration 4)
      :condition (at start (home)) :effect (and (at start (not (home))) (at end (stop))))
    (:durative-action bus :parameters () :duration (= ?duration 12)
      :condition (at start (stop))
      :effect (and (at start (not (stop))) (at end (square)) (at start (increase (money) 3))))
    (:durative-action stroll :parameters () :duration (= ?duration 3)
      :condition (at start (square)) :effect (and (at start (not (square))) (at end (work))))";

fn trip(metric: &str) -> String {
    format!("(:init (home) (= (money) 0)) (:goal (work)) {metric}")
}

#[test]
fn the_cheapest_plan_is_not_the_shortest() {
    let cheap = trip("(:metric minimize (money))");
    assert_eq!(best(TRIP, &cheap), ("3".into(), "9501/500".into()));
}

#[test]
fn metric_weights_time_against_cost() {
    // By taxi 30 + 5 r, by bus 3 + 19.002 r.
    let patient = trip("(:metric minimize (+ (money) (total-time)))");
    assert_eq!(best(TRIP, &patient).0, "11001/500");
    let hurried = trip("(:metric minimize (+ (money) (* 2 (total-time))))");
    assert_eq!(best(TRIP, &hurried), ("40".into(), "5".into()));
}

#[test]
fn makespan_objective_overrides_metric() {
    let settings = Settings {
        objective: Objective::Makespan,
        ..Settings::default()
    };
    let (_, answer) = plans(TRIP, &trip("(:metric minimize (money))"), &settings);
    let found = answer.found().expect("there is a plan");
    assert_eq!(found.makespan.to_string(), "5");
    assert_eq!(found.metric.as_ref().unwrap().to_string(), "30");
}

#[test]
fn first_plan_only_stops_after_first_plan() {
    let settings = Settings {
        first_plan_only: true,
        ..Settings::default()
    };
    let (reported, answer) = plans(TRIP, &trip("(:metric minimize (money))"), &settings);
    assert_eq!(reported.len(), 1);
    assert_eq!(answer.found(), reported.last());
}

#[test]
fn equal_cost_is_resolved_by_shorter_makespan() {
    let domain = "(:requirements :durative-actions :numeric-fluents)
        (:predicates (a) (b)) (:functions (cost))
        (:durative-action slow :parameters () :duration (= ?duration 9)
          :effect (and (at end (a)) (at end (b)) (at end (increase (cost) 1))))
        (:durative-action half :parameters () :duration (= ?duration 4)
          :effect (and (at end (a)) (at start (increase (cost) 1/2))))
        (:durative-action rest :parameters () :duration (= ?duration 3)
          :effect (and (at end (b)) (at start (increase (cost) 1/2))))"
        .replace("1/2", "0.5");
    let problem = "(:init (= (cost) 0)) (:goal (and (a) (b))) (:metric minimize (cost))";
    assert_eq!(best(&domain, problem), ("1".into(), "4".into()));
}

#[test]
fn maximised_metric_increases_from_plan_to_plan() {
    // Each sight takes an hour, and the last bus leaves at 3.5.
    let domain = "(:requirements :durative-actions :numeric-fluents :timed-initial-literals)
        (:types sight) (:predicates (runs) (back) (free) (new ?s - sight))
        (:functions (joy) (worth ?s - sight))
        (:durative-action visit :parameters (?s - sight) :duration (= ?duration 1)
          :condition (and (at start (free)) (at start (new ?s)))
          :effect (and (at start (not (free))) (at start (not (new ?s))) (at end (free))
            (at end (increase (joy) (worth ?s)))))
        (:action leave :parameters () :precondition (and (free) (runs))
          :effect (and (back) (not (free))))";
    let problem = "(:objects a b c d e - sight)
        (:init (runs) (free) (at 3.5 (not (runs))) (= (joy) 0)
          (new a) (new b) (new c) (new d) (new e)
          (= (worth a) 2) (= (worth b) 7) (= (worth c) 3) (= (worth d) 1) (= (worth e) 4))
        (:goal (back)) (:metric maximize (joy))";
    assert_eq!(best(domain, problem).0, "14");
}

#[test]
fn time_dependent_cost_is_minimised() {
    // The cost grows with the time that the lamp burns; it must burn while the work lasts.
    let domain = "(:requirements :durative-actions :numeric-fluents :duration-inequalities)
        (:predicates (light) (done) (dark)) (:functions (oil))
        (:durative-action burn :parameters ()
          :duration (and (>= ?duration 2) (<= ?duration 50)) :condition (at start (dark))
          :effect (and (at start (not (dark))) (at start (light)) (at end (not (light)))
            (at end (dark)) (at end (increase (oil) (* 3 ?duration)))))
        (:durative-action work :parameters () :duration (= ?duration 10)
          :condition (over all (light)) :effect (at end (done)))";
    let problem = "(:init (dark) (= (oil) 0)) (:goal (done)) (:metric minimize (oil))";
    assert_eq!(best(domain, problem), ("30".into(), "10".into()));
}

#[test]
fn a_fluent_that_conditions_read_can_be_measured() {
    // The conditions read the fuel that the metric measures: the way round needs less.
    let domain = "(:requirements :durative-actions :numeric-fluents)
        (:predicates (a) (b) (c)) (:functions (fuel))
        (:durative-action straight :parameters () :duration (= ?duration 2)
          :condition (and (at start (a)) (at start (>= (fuel) 6)))
          :effect (and (at start (not (a))) (at end (c)) (at start (decrease (fuel) 6))))
        (:durative-action out :parameters () :duration (= ?duration 2)
          :condition (and (at start (a)) (at start (>= (fuel) 2)))
          :effect (and (at start (not (a))) (at end (b)) (at start (decrease (fuel) 2))))
        (:durative-action on :parameters () :duration (= ?duration 2)
          :condition (and (at start (b)) (at start (>= (fuel) 2)))
          :effect (and (at start (not (b))) (at end (c)) (at start (decrease (fuel) 2))))";
    let problem = "(:init (a) (= (fuel) 7)) (:goal (c)) (:metric maximize (fuel))";
    assert_eq!(best(domain, problem).0, "3");
}

#[test]
fn a_metric_that_is_no_sum_is_compared() {
    let squared = trip("(:metric minimize (* (money) (money)))");
    assert_eq!(best(TRIP, &squared).0, "9");
    let ratio = trip("(:metric minimize (/ (total-time) (+ 1 (money))))");
    assert_eq!(best(TRIP, &ratio).0, "5/31");
}

#[test]
fn a_metric_without_a_value_leaves_the_makespan() {
    let problem = "(:init (home)) (:goal (work)) (:metric minimize (money))";
    let domain = TRIP.replace("(at end (increase (money) 30))", "");
    let domain = domain.replace("(at start (increase (money) 3))", "");
    let (_, answer) = plans(&domain, problem, &Settings::default());
    let found = answer.found().expect("there is a plan");
    assert_eq!(found.metric, None);
    assert_eq!(found.value, found.makespan);
}
