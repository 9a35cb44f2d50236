//! Success probability of a plan: the complete answer.

use std::path::Path;
use std::sync::Arc;

use elbowroom::answers::NoObserver;
use elbowroom::answers::odds::{
    LatticeFinding, LossReason, Odds, OddsAnswer, OddsFinding, OddsRequest, OddsSettings,
    ValueAnswer, odds,
};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};
use elbowroom::probability::{Likelihoods, likelihoods};
use elbowroom::sim::WorldModel;

struct Scene {
    task: Arc<Task>,
    plan: Option<TimeTriggeredPlan>,
    likelihoods: Arc<Likelihoods>,
    world: Option<WorldModel>,
}

impl Scene {
    fn new(domain: &str, problem: &str, likely: &str) -> Self {
        let domain = Source::new("domain.pddl", domain);
        let problem = Source::new("problem.pddl", problem);
        let (problem, _) = pddl::read_problem(&domain, &problem).unwrap();
        let task = Arc::new(Task::new(problem));
        let likelihoods = likelihoods::read(likely, &task).unwrap();
        Self {
            task,
            plan: None,
            likelihoods: Arc::new(likelihoods),
            world: None,
        }
    }

    fn with_plan(mut self, plan: &str) -> Self {
        let (plan, _) = pddl::read_plan(&Source::new("plan", plan), &self.task).unwrap();
        self.plan = Some(plan);
        self
    }

    fn in_world(mut self, sections: &str) -> Self {
        let text = format!("format = \"elbowroom-world\"\nversion = 1\n{sections}");
        let world = WorldModel::read(Source::new("world", text.as_str()), self.task.problem());
        self.world = Some(world.unwrap());
        self
    }

    fn answer(&self, settings: OddsSettings) -> OddsAnswer {
        let request = OddsRequest {
            task: &self.task,
            plan: self.plan.clone(),
            likelihoods: &self.likelihoods,
            world: self.world.as_ref(),
            settings,
        };
        odds(&request, &mut NoObserver).unwrap()
    }

    fn odds(&self, settings: OddsSettings) -> Odds {
        match self.answer(settings).finding {
            OddsFinding::Odds(odds) => *odds,
            other => panic!("{other:?}"),
        }
    }
}

fn published(name: &str) -> Scene {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/olisipo");
    let file = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let kind = &name[..3];
    Scene::new(
        &file(&format!("{kind}-domain.pddl")),
        &file(&format!("{kind}-problem.pddl")),
        &file(&format!("{name}.toml")),
    )
}

const LAMP: &str = "(define (domain lamp) (:predicates (whole) (lit))
    (:durative-action screw :parameters () :duration (= ?duration 5)
      :condition (over all (whole)) :effect (at end (lit))))";
const EVENING: &str = "(define (problem evening) (:domain lamp) (:init (whole)) (:goal (lit)))";
const LIKELY: &str = "format = \"elbowroom-likelihoods\"\nversion = 1
    defaults = { becomes_true = 0.0, becomes_false = 0.0, start = 0.5, effect = 0.9 }
    facts.whole.becomes_false = 0.25\n";

#[test]
fn published_values_of_first_order_are_reproduced() {
    // Results of the authors' code, to four digits, where it returned the best order.
    for (name, value) in [("sf3-p1", 0.1575), ("sf3-p2", 0.1541), ("sf3-p9", 0.0656)] {
        let odds = published(name).odds(OddsSettings::default());
        assert!(odds.order.is_best && odds.order.is_proven == Some(true));
        let found = odds.order.probability;
        assert!((found - value).abs() < 0.000_051, "{name}: {found}");
        let lost: f64 = odds.order.losses.iter().map(|loss| loss.mass).sum();
        assert!((lost + found - 1.0).abs() < 1e-9);
        // Retrying increases the probability, and so do all other actions.
        let value = |answer: &ValueAnswer| match answer {
            ValueAnswer::Probability(p) => *p,
            other => panic!("{other:?}"),
        };
        let (own, any) = (
            value(&odds.gains.as_the_state_asks),
            value(&odds.gains.any_action),
        );
        assert!(found < own && own <= any + 1e-12, "{found} {own} {any}");
    }
}

#[test]
fn answer_round_trips_as_document() {
    let scene = Scene::new(LAMP, EVENING, LIKELY)
        .with_plan("0: (screw) [5]")
        .in_world("[[failure]]\naction = \"screw\"\nprobability = 0.5\nwhen = \"start\"\n");
    let settings = OddsSettings {
        samples: 20,
        with_lattice: true,
        ..OddsSettings::default()
    };
    let text = serde_json::to_string(&settings).unwrap();
    assert_eq!(
        serde_json::from_str::<OddsSettings>(&text).unwrap(),
        settings
    );
    let answer = scene.answer(settings);
    let text = serde_json::to_string_pretty(&answer).unwrap();
    let read: OddsAnswer = serde_json::from_str(&text).unwrap();
    assert_eq!(serde_json::to_string_pretty(&read).unwrap(), text);
}

#[test]
fn losses_are_located_and_explained() {
    let odds = Scene::new(LAMP, EVENING, LIKELY).with_plan("0: (screw) [5]");
    let odds = odds.odds(OddsSettings::default());
    // It starts, the lamp stays intact for one step, and the effect takes place.
    assert!((odds.order.probability - 0.5 * 0.75 * 0.9).abs() < 1e-12);
    let losses = odds
        .order
        .losses
        .iter()
        .map(|it| (it.at.as_str(), &it.reason));
    let losses: Vec<_> = losses.collect();
    let throughout = LossReason::Throughout {
        action: "(screw)".to_owned(),
        condition: "(whole)".to_owned(),
        since: None,
    };
    let goal = LossReason::Goal {
        condition: "(lit)".to_owned(),
        since: Some("end of (screw)".to_owned()),
    };
    let start = "start of (screw)";
    assert_eq!(
        losses,
        [
            (start, &LossReason::Start),
            (start, &throughout),
            ("end of (screw)", &goal)
        ]
    );
    let action = &odds.order.actions[0];
    // After each failed attempt the lamp must still be intact. No condition requires that, but the
    // start's over-all condition detects a broken lamp.
    let retried: f64 = (0..200)
        .map(|n| 0.5_f64.powi(n) * 0.75_f64.powi(n))
        .sum::<f64>()
        * 0.3375;
    assert!(
        (action.if_retried.unwrap() - retried).abs() < 1e-9,
        "{action:?}"
    );
    assert!((action.if_certain - 0.75).abs() < 1e-12);
    assert!((odds.order.facts[0].if_steady - 0.45).abs() < 1e-12);
}

#[test]
fn initial_beliefs_affect_the_probability() {
    let likely = format!("{LIKELY}[beliefs]\nwhole = 0.8\n");
    let odds = Scene::new(LAMP, EVENING, &likely).with_plan("0: (screw) [5]");
    let odds = odds.odds(OddsSettings::default());
    assert!((odds.order.probability - 0.8 * 0.5 * 0.75 * 0.9).abs() < 1e-12);
}

#[test]
fn sampled_success_rate_matches_world() {
    let scene = Scene::new(LAMP, EVENING, LIKELY)
        .with_plan("0: (screw) [5]")
        .in_world("[[failure]]\naction = \"screw\"\nprobability = 0.3\nwhen = \"start\"\n");
    let settings = OddsSettings {
        samples: 1000,
        ..OddsSettings::default()
    };
    let executed = scene.odds(settings.clone()).executed;
    let words: Vec<_> = executed
        .iter()
        .map(|it| (it.executor.as_str(), it.replans))
        .collect();
    let expected = [
        ("live", false),
        ("live", true),
        ("adaptable", false),
        ("adaptable", true),
    ];
    assert_eq!(words, expected);
    // Executed once as it is, it starts or does not: 5 standard deviations.
    let once = executed[0].reached;
    assert!((628..=772).contains(&once), "{once}");
    let lost: u64 = executed[0].ends.iter().map(|end| end.samples).sum();
    assert_eq!(lost + once, 1000);
    assert_eq!(executed[0].ends[0].action.as_deref(), Some("(screw)"));
    let (low, high) = executed[0].interval.unwrap();
    assert!(low < 0.7 && 0.7 < high, "{low} {high}");
    // With retries, it always succeeds.
    assert_eq!(executed[2].reached, 1000);
    assert_eq!(
        executed,
        scene.odds(settings).executed,
        "one seed, one answer"
    );
}

#[test]
fn lattice_is_drawn_for_short_plans_only() {
    let settings = OddsSettings {
        with_lattice: true,
        ..OddsSettings::default()
    };
    let Some(LatticeFinding::Lattice(lattice)) = published("sf3-p1").odds(settings.clone()).lattice
    else {
        panic!("three actions have few orders");
    };
    assert_eq!(lattice.sets.len(), 27);
    // The lattice contains the best order, from the empty set to the whole.
    assert_eq!(lattice.order.len(), 7);
    let svg = lattice.picture("orders").svg();
    assert_eq!(svg.matches("<circle").count(), 27);
    assert_eq!(svg.matches("<line").count(), lattice.edges.len());

    let objects: Vec<String> = (0..9).map(|lamp| format!("l{lamp}")).collect();
    let domain = "(define (domain d) (:types lamp) (:predicates (lit ?l - lamp))
        (:durative-action light :parameters (?l - lamp) :duration (= ?duration 1)
          :effect (at end (lit ?l))))";
    let goals: String = objects
        .iter()
        .map(|lamp| format!("(lit {lamp})"))
        .collect::<Vec<_>>()
        .concat();
    let problem = format!(
        "(define (problem p) (:domain d) (:objects {} - lamp) (:init) (:goal (and {goals})))",
        objects.join(" ")
    );
    let plan: String = objects
        .iter()
        .map(|lamp| format!("0: (light {lamp}) [1]\n"))
        .collect::<Vec<_>>()
        .concat();
    let likely = LIKELY.replace("facts.whole.becomes_false = 0.25", "");
    // The best order is not needed here.
    let settings = OddsSettings {
        most_sequences: 100,
        ..settings
    };
    let long = Scene::new(domain, &problem, &likely)
        .with_plan(&plan)
        .odds(settings);
    match long.lattice {
        Some(LatticeFinding::Refused(why)) => assert!(why.contains("more than"), "{why}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn invalid_plan_has_no_probability() {
    let nothing = Scene::new(LAMP, EVENING, LIKELY).with_plan("0: (screw) [4]");
    assert!(matches!(
        nothing.answer(OddsSettings::default()).finding,
        OddsFinding::Invalid { .. }
    ));
    let dark = EVENING.replace("(:init (whole))", "(:init)");
    let unsolvable = Scene::new(LAMP, &dark, LIKELY).answer(OddsSettings::default());
    assert!(
        matches!(unsolvable.finding, OddsFinding::NoPlan),
        "{unsolvable:?}"
    );
    let never = LIKELY.replace("start = 0.5", "start = 0.0");
    let never = Scene::new(LAMP, EVENING, &never).answer(OddsSettings::default());
    assert!(matches!(never.finding, OddsFinding::NoOrder), "{never:?}");
}

#[test]
fn bound_of_a_condition_on_a_duration_delays_the_end() {
    for (condition, earliest) in [
        ("(and)", 1),
        ("(at start (>= ?duration 5))", 5),
        ("(at start (not (< ?duration 5)))", 5),
        ("(at end (<= (least) ?duration))", 5),
        ("(over all (>= ?duration 5))", 5),
        // An open end, as planned.
        ("(at start (> ?duration 5))", 6),
    ] {
        let domain = format!(
            "(define (domain d) (:requirements :durative-actions :fluents) (:predicates (g))
              (:functions (least))
              (:durative-action a :parameters ()
                :duration (and (>= ?duration 1) (<= ?duration 10))
                :condition {condition} :effect (at end (g))))"
        );
        let problem = "(define (problem p) (:domain d) (:init (= (least) 5)) (:goal (g)))";
        let likely = "format = \"elbowroom-likelihoods\"\nversion = 1\n[defaults]\nbecomes_true = 0.0\n\
                      becomes_false = 0.0\nstart = 0.9\neffect = 1.0\n";
        let scene = Scene::new(&domain, problem, likely).with_plan("0: (a) [6]");
        let odds = scene.odds(OddsSettings::default());
        let end = odds.order.happenings[1].earliest.as_ref();
        assert_eq!(end, Some(&Rational::from(earliest)), "{condition}");
    }
}

#[test]
fn mutually_dependent_starts_succeed_together() {
    let domain = "(define (domain d) (:requirements :durative-actions) (:predicates (x) (y) (g))
      (:durative-action a :parameters () :duration (= ?duration 2) :condition (over all (y))
        :effect (and (at start (x)) (at end (not (x)))))
      (:durative-action b :parameters () :duration (= ?duration 2) :condition (over all (x))
        :effect (and (at start (y)) (at end (g)))))";
    let problem = "(define (problem p) (:domain d) (:init) (:goal (g)))";
    let likely = "format = \"elbowroom-likelihoods\"\nversion = 1\n[defaults]\nbecomes_true = 0.0\n\
                  becomes_false = 0.0\nstart = 0.9\neffect = 1.0\n";
    let without = Scene::new(domain, problem, likely);
    let with = Scene::new(domain, problem, likely).with_plan("0: (a) [2]\n0: (b) [2]");
    for scene in [without, with] {
        let answer = scene.answer(OddsSettings::default());
        let OddsFinding::Odds(odds) = &answer.finding else {
            panic!("{answer:?}");
        };
        assert!((odds.order.probability - 0.81).abs() < 1e-12, "{odds:?}");
        let happenings = odds.order.happenings.iter();
        let together: Vec<bool> = happenings.map(|it| it.together).collect();
        assert_eq!(together, [false, true, false, false], "{odds:?}");
        // Retries of a single start would lack the other one.
        assert!(
            matches!(odds.gains.any_action, ValueAnswer::Unknown(_)),
            "{odds:?}"
        );
    }
}
