//! Spontaneous changes of facts at a rate.

use std::sync::Arc;

use elbowroom_execution::{Event, World};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_sim::{SimWorld, WorldModel};

const DOMAIN: &str = "(define (domain d) (:requirements :typing)
    (:types door) (:predicates (open ?d - door) (done))
    (:action finish :parameters () :precondition () :effect (done)))";

const PROBLEM: &str = "(define (problem p) (:domain d) (:objects a b - door)
    (:init (open a)) (:goal (done)))";

fn task() -> Arc<Task> {
    let source = |text: &str| Source::new("test", text);
    let (problem, _) = read_problem(&source(DOMAIN), &source(PROBLEM)).expect("correct");
    Arc::new(Task::new(problem))
}

/// Returns all changes that a world reports until then: time, fact, and new truth.
fn changes(task: &Arc<Task>, hazards: &str, seed: u64, until: i64) -> Vec<(f64, String, bool)> {
    let text = format!("format = \"elbowroom-world\"\nversion = 1\n{hazards}");
    let model = WorldModel::read(text.as_str(), task.problem()).expect("a correct world");
    let mut world = SimWorld::new(Arc::clone(task), &model, seed);
    let until = Rational::from(until);
    let mut told = Vec::new();
    loop {
        let passage = world.wait(&until).expect("it is simulated");
        for observation in passage.observations {
            if let Event::Fact { fact, truth } = observation.event {
                told.push((observation.time.to_f64(), task.fact_name(fact), truth));
            }
        }
        if passage.now >= until {
            return told;
        }
    }
}

const BOTH: &str = "[[hazard]]\nfact = \"open\"
    becomes_true_per_second = 0.5\nbecomes_false_per_second = 0.1\n";

#[test]
#[allow(clippy::cast_precision_loss, reason = "there are few changes")]
fn fact_changes_repeatedly_after_exponential_times() {
    let task = task();
    let told = changes(&task, BOTH, 7, 100_000);
    for door in ["(open a)", "(open b)"] {
        let mut truth = door == "(open a)";
        let mut since = 0.0;
        let mut times = [Vec::new(), Vec::new()];
        for (time, _, becomes) in told.iter().filter(|(_, name, _)| name == door) {
            assert_ne!(*becomes, truth, "only changes are told");
            times[usize::from(truth)].push(time - since);
            (truth, since) = (*becomes, *time);
        }
        for (times, rate) in [(&times[1], 0.1), (&times[0], 0.5)] {
            let count = times.len() as f64;
            assert!(count > 5_000.0, "{count}");
            let mean = times.iter().sum::<f64>() / count;
            assert!(
                (mean * rate - 1.0).abs() < 4.0 / count.sqrt(),
                "{mean} at {rate}"
            );
            // Exponentially distributed: the share that lasts longer than a span is exp(−rate · span).
            for span in [0.5 / rate, 1.0 / rate, 2.0 / rate] {
                let longer = times.iter().filter(|time| **time > span).count() as f64 / count;
                let expected = (-rate * span).exp();
                let error = (expected * (1.0 - expected) / count).sqrt();
                assert!(
                    (longer - expected).abs() < 4.0 * error + 1e-3,
                    "{longer} of {span}"
                );
            }
        }
    }
}

#[test]
fn seed_determines_changes_and_facts_are_independent() {
    let task = task();
    assert_eq!(changes(&task, BOTH, 3, 200), changes(&task, BOTH, 3, 200));
    assert_ne!(changes(&task, BOTH, 3, 200), changes(&task, BOTH, 4, 200));
    let of_a = |told: Vec<(f64, String, bool)>| -> Vec<_> {
        told.into_iter()
            .filter(|(_, name, _)| name == "(open a)")
            .collect()
    };
    let only_a = BOTH.replace("\"open\"", "\"(open a)\"");
    assert_eq!(
        of_a(changes(&task, BOTH, 3, 200)),
        changes(&task, &only_a, 3, 200)
    );
}

#[test]
fn last_matching_hazard_applies_and_unreported_changes_are_silent() {
    let task = task();
    let steady = format!("{BOTH}[[hazard]]\nfact = \"(open a)\"\nbecomes_false_per_second = 0\n");
    let told = changes(&task, &steady, 1, 1000);
    assert!(!told.is_empty() && told.iter().all(|(_, name, _)| name == "(open b)"));
    let silent = format!("{BOTH}reported = false\n");
    assert_eq!(changes(&task, &silent, 1, 1000), []);
}

#[test]
fn rate_errors_have_line_and_advice() {
    let task = task();
    let cases = [
        ("fact = \"open\"", 3, "expected a rate"),
        (
            "fact = \"open\"\nbecomes_true_per_second = -1",
            5,
            "0 or more",
        ),
        (
            "fact = \"open\"\nbecomes_true_per_second = nan",
            5,
            "0 or more",
        ),
        (
            "fact = \"open\"\nbecomes_true_per_second = 1001",
            5,
            "smaller rate",
        ),
        (
            "fact = \"*\"\nbecomes_true_per_second = 1",
            4,
            "name a predicate",
        ),
        (
            "fact = \"shut\"\nbecomes_true_per_second = 1",
            4,
            "it has open, done",
        ),
        (
            "fact = \"open\"\nbecomes = true\nbecomes_true_per_second = 1",
            5,
            "leave it out",
        ),
        ("becomes_true_per_second = 1", 3, "`fact` is missing"),
    ];
    for (section, line, advice) in cases {
        let text = format!("format = \"elbowroom-world\"\nversion = 1\n[[hazard]]\n{section}\n");
        let error = WorldModel::read(text.as_str(), task.problem()).expect_err(section);
        let error = error.errors().next().expect("a mistake").clone();
        assert_eq!(error.line(), line, "{section}: {}", error.message);
        assert!(
            error.message.contains(advice),
            "{section}: {}",
            error.message
        );
    }
}
