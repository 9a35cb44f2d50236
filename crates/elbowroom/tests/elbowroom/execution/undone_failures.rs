//! Failures that undo the start effects, and failures that change facts.

use elbowroom::execution::Ending;
use elbowroom::execution::run::{RunningRule, Verdict};
use elbowroom::model::ground::Body;
use elbowroom::num::Rational;

use crate::execution::scene::Scene;

const DOMAIN: &str = "
    (define (domain robots) (:requirements :durative-actions :timed-initial-literals)
      (:predicates (home) (mid) (free) (cleaned) (day))
      (:durative-action go :parameters () :duration (= ?duration 2)
        :condition (at start (home)) :effect (and (at start (not (home))) (at end (mid))))
      (:durative-action clean :parameters () :duration (= ?duration 9)
        :condition (at start (free))
        :effect (and (at start (not (free))) (at end (free)) (at end (cleaned)))))";

const PLAN: &str = "0: (go) [2]\n0: (clean) [9]";

/// In both files half of the attempts of `go` fail and are undone.
fn scene(domain: &str, goal: &str) -> Scene {
    let problem = format!(
        "(define (problem p) (:domain robots) (:init (home) (free) (day)) (:goal (and {goal})))"
    );
    let plan = if goal.contains("cleaned") {
        PLAN
    } else {
        "0: (go) [2]"
    };
    Scene::new(domain, &problem, Some(plan)).with_likelihoods(
        "[defaults]\nbecomes_true = 0.0\nbecomes_false = 0.0\nstart = 1.0\neffect = 1.0\n\
         [actions.go]\nend = 0.5\nundone = true\n",
    )
}

const WORLD: &str = "[[failure]]\naction = \"go\"\nprobability = 0.5\nundone = true\n";

#[test]
fn undone_failure_is_retried_until_it_succeeds() {
    for goal in ["(mid)", "(mid) (cleaned)"] {
        let mut scene = scene(DOMAIN, goal);
        scene.settings.max_replans = 100;
        let world = scene.world(WORLD);
        let mut retries = 0;
        for executor in ["adaptable", "lookahead", "live", "esterel"] {
            for seed in 1..=20 {
                let report = scene.run(executor, &world, seed);
                assert_eq!(
                    report.verdict,
                    Verdict::GoalReached,
                    "{executor} {seed}: {report:#?}"
                );
                retries += report.executed.len() - goal.matches('(').count();
            }
        }
        assert!(retries > 20, "{retries}");
    }
}

#[test]
fn retry_is_separated_from_undoing_effects() {
    let scene = scene(DOMAIN, "(mid)");
    let world = scene.world(WORLD);
    for executor in ["adaptable", "lookahead"] {
        let mut retries = 0;
        for seed in 1..=20 {
            let report = scene.run(executor, &world, seed);
            for pair in report.executed.windows(2) {
                assert_eq!(
                    &pair[1].step.start - &pair[0].step.end(),
                    Rational::new(1, 1000)
                );
                retries += 1;
            }
        }
        assert!(retries > 5, "{executor}: {retries}");
    }
}

#[test]
fn fact_left_behind_by_a_failure_separates_the_action_that_needs_it() {
    let domain = DOMAIN.replace(
        "(:durative-action clean",
        "(:durative-action fetch :parameters () :duration (= ?duration 1)
           :condition (at start (day)) :effect (and (at start (not (day))) (at end (home)) (at end (day))))
         (:durative-action crawl :parameters () :duration (= ?duration 20)
           :condition (at start (cleaned)) :effect (and (at start (not (cleaned))) (at end (mid))))
         (:durative-action clean",
    );
    let problem = "(define (problem p) (:domain robots) (:init (home) (free) (day)) (:goal (mid)))";
    let scene = Scene::new(&domain, problem, Some("0: (go) [2]")).with_likelihoods(
        "[defaults]\nbecomes_true = 0.0\nbecomes_false = 0.0\nstart = 1.0\neffect = 1.0\n[actions.go]\n\
         end = 0.5\n[[actions.go.outcome]]\nprobability = 1.0\nbecomes_true = [\"(cleaned)\"]\n",
    );
    let world = scene.world(
        "[[failure]]\naction = \"go\"\nprobability = 0.5\n[[failure.outcome]]\nprobability = 1.0\n\
         becomes_true = [\"(cleaned)\"]\n",
    );
    for executor in ["adaptable", "lookahead", "live", "esterel"] {
        for seed in 1..=10 {
            let report = scene.run(executor, &world, seed);
            assert_eq!(
                report.verdict,
                Verdict::GoalReached,
                "{executor} {seed}: {report:#?}"
            );
        }
    }
}

/// An action is running when a new plan is adopted, then fails and is undone. The retry has the
/// duration of the domain, not the remaining duration in the plan.
#[test]
fn repeated_action_has_its_whole_duration_after_a_new_plan() {
    let domain = "
        (define (domain two) (:requirements :durative-actions)
          (:predicates (home) (mid) (cold) (warm) (hot))
          (:durative-action go :parameters () :duration (= ?duration 6)
            :condition (at start (home)) :effect (and (at start (not (home))) (at end (mid))))
          (:durative-action heat :parameters () :duration (= ?duration 2)
            :condition (at start (cold)) :effect (and (at start (not (cold))) (at end (hot))))
          (:durative-action boil :parameters () :duration (= ?duration 2)
            :condition (at start (warm)) :effect (and (at start (not (warm))) (at end (hot)))))";
    let problem =
        "(define (problem p) (:domain two) (:init (home) (cold)) (:goal (and (mid) (hot))))";
    let mut scene = Scene::new(domain, problem, Some("0: (go) [6]\n0: (heat) [2]")).with_likelihoods(
        "[defaults]\nbecomes_true = 0.0\nbecomes_false = 0.0\nstart = 1.0\neffect = 1.0\n[actions.go]\n\
         end = 0.5\nundone = true\n",
    );
    scene.settings.max_replans = 100;
    scene.settings.running = RunningRule::Keep;
    // Heating fails while the robot moves, and leaves the water warm, which requires a new plan.
    let world = scene.world(
        "[[failure]]\naction = \"go\"\nprobability = 0.5\nundone = true\n[[failure]]\naction = \"heat\"\n\
         probability = 1.0\n[[failure.outcome]]\nprobability = 1.0\nbecomes_true = [\"(warm)\"]\n",
    );
    for executor in crate::execution::scene::EXECUTORS.iter() {
        let mut repeated = 0;
        for seed in 1..=12 {
            let report = scene.run(executor, &world, seed);
            assert_eq!(
                report.verdict,
                Verdict::GoalReached,
                "{executor} {seed}: {report:#?}"
            );
            let goes = report.executed.iter();
            let goes: Vec<_> = goes
                .filter(|it| it.step.action.name == "(go)" && it.ending != Some(Ending::Cancelled))
                .collect();
            for it in &goes {
                assert_eq!(
                    it.step.duration,
                    Some(Rational::from(6)),
                    "{executor} {seed}"
                );
                let Body::Durative(body) = &it.step.action.body else {
                    panic!("(go) takes time");
                };
                assert_eq!(
                    body.start.effects.len(),
                    1,
                    "{executor} {seed}: {report:#?}"
                );
            }
            repeated += goes.len() - 1;
        }
        assert!(repeated > 0, "{executor}");
    }
}

/// An action fails late, and its failure makes the goal true, or reachable again, when there was no
/// plan.
#[test]
fn verdict_accounts_for_facts_that_change_during_ends() {
    for (body, step) in [
        (":precondition (p) :effect (g))", "0: (a)"),
        (
            ":duration (= ?duration 2) :condition (at start (p)) :effect (at end (g)))",
            "0: (a) [2]",
        ),
    ] {
        let kind = if step.ends_with(']') {
            ":durative-action"
        } else {
            ":action"
        };
        let domain = format!(
            "(define (domain late) (:requirements :durative-actions) (:predicates (p) (g)) ({kind} a :parameters () {body})"
        );
        let problem = "(define (problem q) (:domain late) (:init (p)) (:goal (g)))";
        let scene = Scene::new(&domain, problem, Some(step));
        for becomes in ["(g)", "(p)"] {
            let world = scene.world(&format!(
                "[[failure]]\naction = \"a\"\nprobability = 0.5\nwhen = \"start\"\n[[failure.outcome]]\nprobability = 1\n\
                 becomes_true = [\"{becomes}\"]\ndelay = 3\n[[event]]\nfact = \"(p)\"\nbecomes = false\nconstant = 1\n"
            ));
            for executor in ["live", "guarded", "stn", "esterel"] {
                for seed in 1..=8 {
                    let report = scene.run(executor, &world, seed);
                    assert_eq!(
                        report.verdict,
                        Verdict::GoalReached,
                        "{executor} {seed} {becomes} {step}: {report:#?}"
                    );
                }
            }
        }
    }
}
