//! Transitions between plans: a plan can be begun from the situation for which it was made.

use elbowroom::execute::PlanPreparer;
use elbowroom::execution::run::Verdict;
use elbowroom::execution::{Decision, Entry, PreparedPlan, Recorder};
use elbowroom::num::Rational;
use elbowroom::plan::ParameterKind;
use elbowroom::sim::SimWorld;

use crate::execution::scene::Scene;

const TORCH: &str = "(define (domain torch) (:requirements :typing :durative-actions)
    (:types job) (:predicates (lit) (fresh) (hand) (done ?j - job))
    (:durative-action burn :parameters () :duration (= ?duration 10) :condition (at start (fresh))
      :effect (and (at start (not (fresh))) (at start (lit)) (at end (not (lit)))))
    (:durative-action work :parameters (?j - job) :duration (= ?duration 3)
      :condition (and (at start (hand)) (over all (lit)))
      :effect (and (at start (not (hand))) (at end (hand)) (at end (done ?j)))))";

const THREE: &str = "(define (problem p) (:domain torch) (:objects a b c - job)
    (:init (fresh) (hand)) (:goal (and (done a) (done b) (done c))))";

const PLAN: &str = "0: (burn) [10]\n0.001: (work a) [3]\n3.002: (work b) [3]\n6.003: (work c) [3]";

/// Recorder of the observations since the current plan was adopted.
#[derive(Default)]
struct SwitchRecorder {
    /// Start time of the current plan, if nothing was observed since.
    unobserved_since: Option<Rational>,
    /// Plans that were abandoned in the situation for which they were made.
    rejected: Vec<String>,
    /// Number of plans with running actions, and those whose box exceeds the remaining resource.
    with_running_actions: usize,
    too_large: Vec<String>,
}

impl Recorder for SwitchRecorder {
    fn record(&mut self, entry: &Entry<'_>) {
        match entry {
            Entry::PlanAdopted(mission) => {
                self.unobserved_since = Some(mission.origin.clone());
                if !mission.running.is_empty() {
                    self.check_mission(mission);
                }
            }
            Entry::Taken { .. } => self.unobserved_since = None,
            Entry::Decided { now, decided } => {
                if decided.decision == Decision::Replan
                    && let Some(origin) = &self.unobserved_since
                    && **now <= origin + Rational::new(1, 1000)
                {
                    self.rejected.push(format!("{now}: {}", decided.reason));
                }
            }
            _ => {}
        }
    }
}

impl SwitchRecorder {
    /// Checks that all jobs of the plan fit into the remaining burning time of the torch.
    fn check_mission(&mut self, mission: &PreparedPlan) {
        let Some(envelope) = &mission.envelope else {
            return;
        };
        let mut torch = None;
        let mut jobs = Rational::ZERO;
        for (parameter, interval) in mission.plan.parameters.iter().zip(envelope.intervals()) {
            let ParameterKind::Duration(instance) = parameter.kind else {
                continue;
            };
            if mission.plan.plan.instance(instance).action.name == "(burn)" {
                torch = interval.lower.value().cloned();
            } else {
                match interval.upper.value() {
                    Some(upper) => jobs += upper,
                    None => jobs += Rational::from(1_000_000),
                }
            }
        }
        if let Some(torch) = torch {
            self.with_running_actions += 1;
            if jobs > torch {
                self.too_large.push(format!("{jobs} in {torch}"));
            }
        }
    }
}

#[test]
fn plan_adopted_in_mid_execution_has_a_sound_envelope() {
    let scene = Scene::new(TORCH, THREE, Some(PLAN));
    let text =
        "[[duration]]\naction = \"*\"\nuniform = { from = 0.7, to = 1.3 }\nrelative = true\n";
    let model = scene.world(text);
    let mut amid = 0;
    for executor in ["guarded", "live"] {
        let mut reached = 0;
        for seed in 0..40 {
            let mut seams = SwitchRecorder::default();
            let mut world = SimWorld::new(std::sync::Arc::clone(&scene.task), &model, seed);
            let mut analyst = PlanPreparer::new(scene.flow.clone());
            let report = scene.run_in(executor, &mut world, &mut analyst, &mut seams);
            assert_eq!(seams.rejected, [""; 0], "{executor}, seed {seed}");
            assert_eq!(seams.too_large, [""; 0], "{executor}, seed {seed}");
            amid += seams.with_running_actions;
            reached += usize::from(report.verdict == Verdict::GoalReached);
        }
        assert!(reached >= 12, "{executor}: {reached}");
    }
    assert!(amid > 5, "{amid}");
}
