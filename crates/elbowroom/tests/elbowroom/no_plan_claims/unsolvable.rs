//! Random problems that are unsolvable by construction: solvable ones with one change. Each
//! certificate is accepted from its JSON text. It is rejected after a modification, and for the
//! problem without the change.

use crate::solvable;
use std::collections::BTreeMap;

use elbowroom::model::{Situation, Task};
use elbowroom::no_plan::no_plan_certificate_from;
use elbowroom::num::Rational;
use elbowroom::pddl::read_problem;
use elbowroom::text::Source;
use elbowroom::verify::Exact;
use elbowroom::verify::no_plan::{Kind, NoPlan, certificate_of, verify_no_plan};
use serde_json::json;

/// Number of random problems for each obstacle.
const SEEDS: u64 = 60;

/// Maximum number of modifications of one certificate.
const MUTATIONS: usize = 12;

/// Change that makes any problem unsolvable. `(z0)`, `(z1)` and `(z2)` occur in no other place.
struct Obstacle {
    name: &'static str,
    initial: &'static str,
    actions: &'static str,
    goal: &'static str,
    /// Minimum number of [`SEEDS`] problems for which a certificate is expected.
    least_certified: usize,
}

const OBSTACLES: [Obstacle; 4] = [
    Obstacle {
        name: "nothing achieves a goal",
        initial: "",
        actions: "",
        goal: "(z0)",
        least_certified: 30,
    },
    Obstacle {
        name: "one goal costs the other",
        initial: "(z0)",
        actions: "(:action burn :parameters () :precondition (z0) :effect (and (not (z0)) (z1)))",
        goal: "(z0) (z1)",
        least_certified: 20,
    },
    Obstacle {
        name: "two tokens for three places",
        initial: "(z0) (z1)",
        actions: "(:action out :parameters () :precondition (and (z0) (not (z2))) :effect (and (not (z0)) (z2)))
            (:action on :parameters () :precondition (and (z1) (not (z2))) :effect (and (not (z1)) (z2)))
            (:action back :parameters () :precondition (and (z2) (not (z0))) :effect (and (not (z2)) (z0)))",
        goal: "(z0) (z1) (z2)",
        least_certified: 1,
    },
    Obstacle {
        name: "a window is too short",
        initial: "(z0) (at 5 (not (z0)))",
        actions: "(:durative-action wrap :parameters () :duration (= ?duration 10)
            :condition (over all (z0)) :effect (at end (z1)))",
        goal: "(z1)",
        least_certified: 30,
    },
];

impl Obstacle {
    /// Returns the unsolvable problem, and the same one with its former goal, which has a plan.
    fn added_to(&self, solvable: &solvable::Solvable) -> [Task; 2] {
        let Obstacle {
            initial,
            actions,
            goal,
            ..
        } = self;
        let domain = solvable.domain.trim_end();
        let domain = domain.strip_suffix(')').unwrap();
        let domain = domain.replacen("(:predicates", "(:predicates (z0) (z1) (z2)", 1);
        let domain = format!("{domain} {actions})");
        let whole = solvable
            .problem
            .replacen("(:init", &format!("(:init {initial}"), 1);
        let denied = whole.replacen("(:goal (and", &format!("(:goal (and {goal}"), 1);
        assert_ne!(whole, denied);
        [denied, whole].map(|problem| read(&domain, &problem))
    }
}

fn read(domain: &str, problem: &str) -> Task {
    let domain = Source::new("domain", domain.to_owned());
    let problem = Source::new("problem", problem.to_owned());
    match read_problem(&domain, &problem) {
        Ok((read, _)) => Task::new(read),
        Err(diagnostics) => panic!("{}", diagnostics.render(false)),
    }
}

/// Returns the verdict about a certificate that is read from the JSON text of an answer.
fn verdict(task: &Task, certificate: &NoPlan) -> Result<(), String> {
    let answer = json!({
        "format": "elbowroom-plan",
        "version": 1,
        "answer": "no plan",
        "certificate": certificate,
    });
    let read = certificate_of(&answer.to_string()).map_err(|wrong| wrong.to_string())?;
    verify_no_plan(task, &read).map_err(|flaw| flaw.to_string())
}

/// Returns certificates with one modification each. None of them is a proof.
fn mutated(certificate: &NoPlan) -> Vec<NoPlan> {
    let mut all = Vec::new();
    let mut note = |change: &dyn Fn(&mut NoPlan)| {
        let mut other = certificate.clone();
        change(&mut other);
        if other != *certificate {
            all.push(other);
        }
    };
    note(&|own| own.proves.push('!'));
    note(&|own| own.apart.clear());
    note(&|own| own.closed = None);
    if let Some(closed) = &certificate.closed {
        note(&|own| own.closed.as_mut().unwrap().states.clear());
        for state in 0..closed.states.len() {
            note(&|own| drop(own.closed.as_mut().unwrap().states.remove(state)));
        }
    }
    // The list has the earliest time of each reached fact, and no other fact.
    for group in 0..certificate.reached.len() {
        note(&|own| {
            let from = &own.reached[group].from;
            own.reached[group].from = Exact(&from.0 + &Rational::new(1, 7));
        });
        for fact in 0..certificate.reached[group].facts.len() {
            note(&|own| drop(own.reached[group].facts.remove(fact)));
        }
    }
    all.truncate(MUTATIONS);
    all
}

#[test]
fn certificates_of_unsolvable_problems_are_accepted_and_changed_ones_refused() {
    let (mut kinds, mut changes) = (BTreeMap::<Kind, usize>::new(), 0);
    for obstacle in &OBSTACLES {
        let mut certified = 0;
        for seed in 0..SEEDS {
            let solvable = solvable::problem(seed).unwrap();
            let [task, solved] = obstacle.added_to(&solvable);
            let mut left = 300;
            let found = no_plan_certificate_from(&task, &Situation::initial(&task), &mut || {
                left -= 1;
                left > 0
            });
            let what = format!("{}, seed {seed}\n{solvable}", obstacle.name);
            let certificate = match found {
                Ok(certificate) => certificate,
                Err(why) => {
                    assert!(!why.contains("verifier refuses"), "{why}: {what}");
                    continue;
                }
            };
            certified += 1;
            *kinds.entry(certificate.kind()).or_default() += 1;
            assert_eq!(verdict(&task, &certificate), Ok(()), "{what}");
            let of_solved = verdict(&solved, &certificate);
            assert!(
                of_solved.is_err(),
                "{certificate:?} {:?}: {what}",
                solved.goal()
            );
            for other in mutated(&certificate) {
                changes += 1;
                let accepted = verdict(&task, &other).is_ok();
                assert!(!accepted, "{other:?}\ninstead of {certificate:?}\n{what}");
            }
        }
        println!("{}: {certified} of {SEEDS} certified", obstacle.name);
        assert!(
            certified >= obstacle.least_certified,
            "{}: {certified}",
            obstacle.name
        );
    }
    println!("{kinds:?}, {changes} changes");
    assert_eq!(kinds.len(), 3, "{kinds:?}");
}
