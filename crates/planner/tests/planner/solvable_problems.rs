//! Random problems that are solvable by construction: the planner never claims that there is no plan, and
//! nearly always finds one.

use crate::solvable::{Outcome, Solvable, Tally, numeric_problem, outcome, outcome_with, problem};
use elbowroom_model::validate::{Settings, Verdict, validate};

/// Number of seeds; `examples/solvable` tries more.
const SEEDS: u64 = 1_000;

/// Maximum number of states per problem.
const STATES: u64 = 1_000;

/// As above for problems about one changing number, which need more states.
const NUMERIC_SEEDS: u64 = 300;
const NUMERIC_STATES: u64 = 20_000;

/// Maximum number of problems without a plan found, including unsupported ones.
const MAX_MISSED: usize = 2;

/// Plans for these problems. Returns the number of plans found, and the seeds of the other
/// problems. Panics if a problem is called unsolvable, or a plan is invalid.
fn tried(seeds: u64, states: u64, problem: impl Fn(u64) -> Option<Solvable>) -> (Tally, Vec<u64>) {
    let mut tally = Tally::default();
    let mut missed = Vec::new();
    for seed in 0..seeds {
        let problem = problem(seed).unwrap_or_else(|| panic!("seed {seed} gives no problem"));
        let outcome = outcome(&problem, states);
        tally.count(&outcome);
        match &outcome {
            Outcome::Found => {}
            Outcome::FalseClaim(_) | Outcome::Invalid(_) => {
                panic!("seed {seed}: {outcome:?}\n{problem}")
            }
            Outcome::NoneFound(_) | Outcome::Unsupported(_) => missed.push(seed),
        }
    }
    assert_eq!(tally.found + missed.len(), tally.problems);
    (tally, missed)
}

#[test]
fn solvable_problems_are_never_called_unsolvable_and_rarely_missed() {
    let (tally, missed) = tried(SEEDS, STATES, problem);
    assert!(missed.len() <= MAX_MISSED, "{tally:?}, {missed:?}");
}

#[test]
fn solvable_problems_about_one_changing_number_are_rarely_missed() {
    let (tally, missed) = tried(NUMERIC_SEEDS, NUMERIC_STATES, numeric_problem);
    assert!(missed.len() <= MAX_MISSED, "{tally:?}, {missed:?}");
}

#[test]
fn search_without_self_overlap_makes_no_false_claim() {
    let (mut needing, mut found) = (0, 0);
    for seed in 0..SEEDS {
        let problem = problem(seed).unwrap_or_else(|| panic!("seed {seed} gives no problem"));
        if !problem.overlaps_itself() {
            continue;
        }
        needing += 1;
        match outcome_with(&problem, STATES, false) {
            Outcome::Found => found += 1,
            outcome @ (Outcome::FalseClaim(_) | Outcome::Invalid(_)) => {
                panic!("seed {seed}: {outcome:?}\n{problem}")
            }
            Outcome::NoneFound(_) | Outcome::Unsupported(_) => {}
        }
    }
    assert!(
        found > 100,
        "{found} of {needing} problems have a plan without self-overlap"
    );
}

#[test]
fn witness_plans_are_valid_and_needed() {
    for seed in 0..100 {
        let Some(problem) = problem(seed) else {
            panic!("seed {seed} gives no problem");
        };
        let task = problem.task();
        let verdict = validate(&task, &problem.witness(&task), &Settings::default());
        assert!(matches!(verdict, Verdict::Valid(_)), "{problem}");
        let empty = validate(
            &task,
            &elbowroom_model::TimeTriggeredPlan::default(),
            &Settings::default(),
        );
        assert!(!matches!(empty, Verdict::Valid(_)), "{problem}");
    }
}
