//! Storm confirms the optima that are computed here, from the exported processes.
//!
//! `ELBOWROOM_STORM` is the Python that has stormpy.

#![allow(clippy::print_stdout, reason = "what Storm says is worth seeing")]

use crate::twin;
use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;

use elbowroom::mdp::{Settings, TimedOptimum, optimum};
use elbowroom_export::prism::{Bound, timed, untimed};
use elbowroom_laboratory::perturbed::PerturbedExperiment;
use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_plan::PartialOrderPlan;
use elbowroom_probability::optimum::{self as without_time, DeadEnds, Perturbed};
use elbowroom_probability::{
    Likelihoods, Model, SearchState, Semantics, all_actions_under, likelihoods,
};
use elbowroom_sim::WorldModel;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;

use crate::skipped::skipped;
use crate::twin::SmallWorld;

/// Output of `testing/storm.py` for a file.
#[derive(Debug, Deserialize)]
struct StormResult {
    value: f64,
    fraction: Option<String>,
    states: usize,
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Returns the Python program with Storm; without it, reports the test as skipped.
fn python() -> Option<OsString> {
    let python = std::env::var_os("ELBOWROOM_STORM");
    if python.is_none() {
        skipped("ELBOWROOM_STORM names no Python with stormpy");
    }
    python
}

/// Returns the results of Storm for each text. Those from `exact` on are computed with fractions.
fn storm(python: OsString, test: &str, texts: &[String], exact: usize) -> Vec<StormResult> {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(test);
    fs::create_dir_all(&folder).expect("a folder for texts");
    let mut arguments = Vec::new();
    for (number, text) in texts.iter().enumerate() {
        let file = folder.join(format!("{number}.prism"));
        fs::write(&file, text).expect("a file for a text");
        if number == exact {
            arguments.push("--exact".into());
        }
        arguments.push(file);
    }
    let output = Command::new(python)
        .arg(root().join("testing/storm.py"))
        .args(arguments)
        .output()
        .expect("ELBOWROOM_STORM can be run");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let lines = String::from_utf8(output.stdout).expect("text");
    let lines = lines.lines().filter(|line| line.starts_with('{'));
    let said: Vec<StormResult> = lines
        .map(|line| serde_json::from_str(line).expect("an answer"))
        .collect();
    assert_eq!(said.len(), texts.len(), "{errors}");
    let is_exact = |said: &StormResult| said.fraction.is_some();
    assert!(said[exact.min(said.len())..].iter().all(is_exact));
    said
}

fn task(domain: &str, problem: &str) -> Task {
    let source = |text: &str| Source::new("test", text);
    let (problem, _) = read_problem(&source(domain), &source(problem)).expect("it is PDDL");
    Task::new(problem)
}

/// Returns the optimum in a world without time.
fn best(task: &Task, likelihoods: &Likelihoods, settings: &without_time::Settings) -> f64 {
    let task = Arc::new(task.clone());
    let actions = all_actions_under(&task, likelihoods).expect("there is no time in it");
    let plan = PartialOrderPlan::unordered(&task, actions);
    let model = Model::new(Arc::clone(&task), plan, likelihoods, Semantics::World);
    let model = model.expect("all likelihoods are there");
    let process = Perturbed::new(model, settings.clone()).expect("it is small");
    let circumstances = SearchState::initial_with_beliefs(&task, likelihoods);
    process.optimum().value(&process, &circumstances)
}

#[track_caller]
fn assert_the_same(name: &str, ours: f64, said: &StormResult) {
    println!(
        "{name}: {ours:.12}, Storm {} of {} states",
        said.value, said.states
    );
    assert!(
        (ours - said.value).abs() < 1e-9,
        "{name}: {ours} and {said:?}"
    );
}

#[test]
fn optima_of_paper_2_match_storm() {
    let Some(python) = python() else {
        return;
    };
    let folder = root().join("experiments");
    let file = |path: &str| fs::read_to_string(folder.join(path)).map_err(|it| it.to_string());
    let text = file("olisipo.toml").expect("it is there");
    let experiment = PerturbedExperiment::read(Source::new("olisipo.toml", text), &file);
    let experiment = experiment.expect("an experiment");
    assert_eq!(experiment.cases.len(), 18);
    let (mut names, mut ours, mut texts) = (Vec::new(), Vec::new(), Vec::new());
    // If no broken machine works again, fractions take only seconds.
    let is_quick = |name: &str| name == "SF3 p1";
    let mut cases: Vec<_> = experiment.cases.iter().collect();
    cases.sort_by_key(|case| is_quick(&case.name));
    let mut exact = None;
    for case in cases {
        if is_quick(&case.name) {
            exact.get_or_insert(texts.len());
        }
        let task = task(&case.domain, &case.problem);
        let source = Source::new("likelihoods", case.likelihoods.as_str());
        let likelihoods = likelihoods::read(source, &task).expect("likelihoods");
        let rules = |dead_ends, enforces_over_all| without_time::Settings {
            most_running: case.most_running,
            dead_ends,
            enforces_over_all,
            ..without_time::Settings::default()
        };
        let mut add = |rules: &without_time::Settings, name: &str| {
            names.push(format!("{} {name}", case.name));
            ours.push(best(&task, &likelihoods, rules));
            texts.push(untimed(&task, &likelihoods, rules).expect("it can be written"));
        };
        // The rules of the trials: the first plan is one of ten rounds.
        add(&rules(DeadEnds::Patience(9), false), "rounds");
        add(&rules(DeadEnds::Lost, false), "lost");
        if ["SF3 p6", "SF3 p7"].contains(&case.name.as_str()) {
            add(&rules(DeadEnds::Patience(9), true), "rounds, over all");
            add(&rules(DeadEnds::Lost, true), "lost, over all");
        }
    }
    let exact = exact.expect("one of the cases");
    let said = storm(python, "paper-2", &texts, exact);
    for ((name, ours), said) in names.iter().zip(&ours).zip(&said) {
        assert_the_same(name, *ours, said);
    }
}

#[test]
fn cases_with_beliefs_and_instantaneous_actions_match_storm() {
    let Some(python) = python() else {
        return;
    };
    let domain = "
        (define (domain door) (:requirements :strips :durative-actions :negative-preconditions)
          (:predicates (open) (inside) (dark) (seen) (bell))
          (:action knock :parameters () :precondition (and (bell) (not (open)))
            :effect (and (open) (not (bell))))
          (:durative-action enter :parameters () :duration (= ?duration 2)
            :condition (and (at start (open)) (over all (open)))
            :effect (and (at start (dark)) (at end (inside)) (at end (not (dark)))))
          (:action look :parameters () :precondition (or (inside) (not (dark)))
            :effect (and (seen) (not (inside)) (dark))))";
    let problem =
        "(define (problem in) (:domain door) (:init (dark) (bell)) (:goal (and (inside) (seen))))";
    let task = task(domain, problem);
    let text = r#"
        format = "elbowroom-likelihoods"
        version = 1
        [defaults]
        becomes_true = 0.02
        becomes_false = 0.07
        start = 0.9
        effect = 0.85
        [actions.look]
        effects = { seen = 0.6, "not inside" = 0.3 }
        [beliefs]
        "open" = 0.25
        "dark" = 0.4
    "#;
    let likelihoods = likelihoods::read(Source::new("likelihoods", text), &task).expect("text");
    let mut texts = Vec::new();
    let mut ours = Vec::new();
    for dead_ends in [DeadEnds::Patience(1), DeadEnds::Patience(3), DeadEnds::Lost] {
        for enforces_over_all in [false, true] {
            for most_running in [0, usize::MAX] {
                let rules = without_time::Settings {
                    most_running,
                    dead_ends,
                    enforces_over_all,
                    ..without_time::Settings::default()
                };
                ours.push((rules.clone(), best(&task, &likelihoods, &rules)));
                texts.push(untimed(&task, &likelihoods, &rules).expect("it can be written"));
            }
        }
    }
    let said = storm(python, "door", &texts, 0);
    for ((rules, ours), said) in ours.iter().zip(&said) {
        assert_the_same(&format!("{rules:?}"), *ours, said);
    }
}

#[test]
fn worlds_with_failing_ends_match_storm() {
    let Some(python) = python() else {
        return;
    };
    let file = |name: &str| {
        let path = root().join("experiments/grasp").join(name);
        fs::read_to_string(path).expect("it is there")
    };
    let task = task(&file("domain.pddl"), &file("problem.pddl"));
    let (mut ours, mut texts) = (Vec::new(), Vec::new());
    for name in ["undone.toml", "falls.toml"] {
        let source = Source::new(name, file(name));
        let likelihoods = likelihoods::read(source, &task).expect("likelihoods");
        for dead_ends in [DeadEnds::Patience(2), DeadEnds::Lost] {
            for enforces_over_all in [false, true] {
                let rules = without_time::Settings {
                    most_running: 1,
                    dead_ends,
                    enforces_over_all,
                    ..without_time::Settings::default()
                };
                let name = format!("{name} {rules:?}");
                ours.push((name, best(&task, &likelihoods, &rules)));
                texts.push(untimed(&task, &likelihoods, &rules).expect("it can be written"));
            }
        }
    }
    // The outcomes of failures make a difference.
    assert!(ours[0].1 > ours[4].1 + 0.01, "{ours:?}");
    let said = storm(python, "grasp", &texts, texts.len());
    for ((name, ours), said) in ours.iter().zip(&said) {
        assert_the_same(name, *ours, said);
    }
}

/// Returns our bounds on one grid.
fn grid(task: &Task, world: &WorldModel, settings: &Settings, cells: usize) -> TimedOptimum {
    let settings = Settings {
        first_cells: cells,
        gap: 1.0,
        ..settings.clone()
    };
    optimum(task, world, &settings, &|| true).expect("it can be tabulated")
}

#[track_caller]
fn assert_within(name: &str, ours: &TimedOptimum, (upper, lower): (&StormResult, &StormResult)) {
    println!(
        "{name}: {} to {}, Storm {} to {} of {} and {} states",
        ours.lower, ours.upper, lower.value, upper.value, lower.states, upper.states
    );
    // The bounds are widened by 1e-9.
    assert!(
        (upper.value - ours.upper).abs() < 3e-9,
        "{name}: {upper:?} and {ours:?}"
    );
    assert!(
        ours.lower <= lower.value + 1e-9 && lower.value <= ours.upper + 1e-9,
        "{name}: {lower:?} and {ours:?}"
    );
}

#[test]
fn bounds_of_timed_optimum_match_storm() {
    let Some(python) = python() else {
        return;
    };
    let file = |name: &str, file: &str| {
        let path = root().join("experiments").join(name).join(file);
        fs::read_to_string(path).expect("it is there")
    };
    let mut scenes = Vec::new();
    let mut texts = Vec::new();
    let mut add = |name: String, task: Task, world: WorldModel, horizon, cells| {
        let settings = Settings {
            horizon,
            ..Settings::default()
        };
        for bound in [Bound::Upper, Bound::Lower] {
            let text = timed(&task, &world, &settings, (cells, bound));
            texts.push(text.expect("it can be written"));
        }
        scenes.push((name, grid(&task, &world, &settings, cells)));
    };
    for (name, cells) in [("weld", 41), ("machines", 10), ("door", 17)] {
        let task = task(&file(name, "domain.pddl"), &file(name, "problem.pddl"));
        let world = WorldModel::read(&file(name, "world.toml"), task.problem()).expect("a world");
        add(name.to_owned(), task, world, None, cells);
    }
    let mut chancy = 0;
    for number in 0..400 {
        let mut rng = ChaCha8Rng::seed_from_u64(number);
        let small = SmallWorld::random(&mut rng, number % 2 == 0);
        let task = task(&small.domain(), &small.problem());
        let world = WorldModel::read(&small.world(), task.problem()).expect("a world");
        let ends = Some(i64::from(twin::ENDS).into());
        let settings = Settings {
            horizon: ends.clone(),
            ..Settings::default()
        };
        let ours = grid(&task, &world, &settings, 4);
        // Only worlds in which chance or the order matters.
        if ours.lower < 0.99 && ours.upper > 0.01 {
            add(format!("small world {number}"), task, world, ends, 4);
            chancy += 1;
        }
        if chancy == 12 {
            break;
        }
    }
    let said = storm(python, "timed", &texts, texts.len());
    for ((name, ours), said) in scenes.iter().zip(said.chunks(2)) {
        assert_within(name, ours, (&said[0], &said[1]));
    }
}

#[test]
fn export_rejects_rates_by_name() {
    let task = task(
        "(define (domain d) (:requirements :durative-actions) (:predicates (open) (through))
            (:durative-action go :parameters () :duration (= ?duration 2)
              :condition (over all (open)) :effect (at end (through))))",
        "(define (problem p) (:domain d) (:init (open)) (:goal (through)))",
    );
    let text = "format = \"elbowroom-world\"\nversion = 1
        [[hazard]]\nfact = \"open\"\nbecomes_false_per_second = 0.1";
    let world = WorldModel::read(text, task.problem()).expect("a world");
    let written = timed(&task, &world, &Settings::default(), (4, Bound::Upper));
    let error = written.expect_err("it is refused");
    assert!(error.to_string().contains("[[hazard]]"), "{error}");
}

#[test]
fn export_rejects_different_failures_by_name() {
    let task = task(
        "(define (domain d) (:requirements :durative-actions) (:predicates (late) (through))
            (:durative-action go :parameters () :duration (= ?duration 2)
              :condition () :effect (at end (through))))",
        "(define (problem p) (:domain d) (:init (at 9 (late))) (:goal (through)))",
    );
    let text = "format = \"elbowroom-world\"\nversion = 1
        [[failure]]\naction = \"go\"\nprobability = 0.5
        [[failure.outcome]]\nprobability = 0.5\ndelay = 3";
    let world = WorldModel::read(text, task.problem()).expect("a world");
    let settings = Settings {
        horizon: Some(9.into()),
        ..Settings::default()
    };
    let written = timed(&task, &world, &settings, (4, Bound::Upper));
    let error = written.expect_err("it is refused");
    assert!(error.to_string().contains("[[failure.outcome]]"), "{error}");
}
