//! Conditional effects of durative actions whose condition is about the start or all of the action.
//!
//! VAL turns each of them into a separate action, a *conditional effect monitor* that happens at
//! the end.

use std::fmt::Write as _;

use elbowroom_pddl::Source;

use crate::val_program::program::{PlanVerdict, Val, ours, task};

/// Returns the verdicts of VAL and of the validator on one action `(a)` from 0.5 to 2.5, with these
/// effects, initial facts and goal.
fn verdict_of(val: &Val, [effects, initial, goal]: [&str; 3]) -> [PlanVerdict; 2] {
    let domain = format!(
        "(define (domain d)
 (:requirements :adl :durative-actions :fluents :conditional-effects)
 (:types thing) (:constants o1 o2 - thing)
 (:predicates (p) (q) (r) (z) (seen ?t - thing) (done ?t - thing)) (:functions (n))
 (:durative-action a :parameters () :duration (= ?duration 2)
  :condition (at start (z)) :effect (and {effects})))"
    );
    let problem = format!(
        "(define (problem x) (:domain d) (:init (z) (= (n) 0) {initial}) (:goal (and {goal})))"
    );
    let plan = "0.5: (a) [2]\n";
    let read = task(
        &Source::new("d", domain.as_str()),
        &Source::new("p", problem.as_str()),
    );
    let (own, _) = ours(&read.expect("a problem"), &Source::new("plan", plan));
    [val.verdict(&domain, &problem, plan), own]
}

fn is_valid(said: &PlanVerdict) -> bool {
    matches!(said, PlanVerdict::Valid(_))
}

/// The smallest examples of the disagreements in the document. The validator accepts all of them.
#[test]
fn document_lists_conditional_effects_with_other_verdict_of_val() {
    let Some(val) = Val::find("conditional-known") else {
        return;
    };
    for example in [
        // An end effect and the monitor of the same action are mutex.
        [
            "(at end (not (q))) (when (at start (p)) (at end (q)))",
            "(p)",
            "(q)",
        ],
        [
            "(at end (q)) (when (over all (p)) (at end (not (q))))",
            "(p)",
            "(q)",
        ],
        // Two monitors of one action are mutex.
        [
            "(when (at start (p)) (at end (not (q)))) (when (at start (z)) (at end (q)))",
            "(p)",
            "(q)",
        ],
        // The part about the end of a mixed condition is ignored.
        [
            "(when (and (at start (p)) (at end (r))) (at end (q)))",
            "(p)",
            "(not (q))",
        ],
        [
            "(when (and (over all (p)) (at end (r))) (at end (q)))",
            "(p)",
            "(not (q))",
        ],
        // `?duration` is 0.
        [
            "(when (at start (p)) (at end (increase (n) ?duration)))",
            "(p)",
            "(= (n) 2)",
        ],
        // Under `forall`, one object that meets the condition counts for all objects.
        [
            "(forall (?t - thing) (when (at start (seen ?t)) (at end (done ?t))))",
            "(seen o2)",
            "(not (done o1))",
        ],
    ] {
        let [theirs, own] = verdict_of(&val, example);
        assert!(is_valid(&own), "{example:?}: {own:?}");
        assert!(!is_valid(&theirs), "{example:?}: VAL {theirs:?}");
    }
}

/// A condition at the start is read before the effects of the action's own start, by VAL and by the
/// validator.
#[test]
fn start_conditions_are_read_before_own_start_effects_like_val() {
    let Some(val) = Val::find("conditional-start") else {
        return;
    };
    for (own_start, initial, holds) in [
        ("(at start (not (p)))", "(p)", true),
        ("(at start (not (p)))", "", false),
        ("(at start (p))", "(p)", true),
        ("(at start (p))", "", false),
    ] {
        for effect_time in ["at start", "at end"] {
            let effects = format!("{own_start} (when (at start (p)) ({effect_time} (q)))");
            let goal = if holds { "(q)" } else { "(not (q))" };
            let said = verdict_of(&val, [&effects, initial, goal]);
            assert!(
                said.iter().all(is_valid),
                "{effects}, {initial}, {goal}: {said:?}"
            );
        }
    }
}

/// `SplitMix64`.
struct Rng(u64);

impl Rng {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (bits ^ (bits >> 31)) % end
    }

    fn literal(&mut self) -> String {
        let fact = ["(p)", "(q)", "(r)"][usize::try_from(self.below(3)).expect("small")];
        if self.below(5) < 3 {
            fact.to_owned()
        } else {
            format!("(not {fact})")
        }
    }
}

/// Random conditional effects without the known causes: one end effect, and conditions about one time.
#[test]
fn other_conditional_effects_get_same_verdict_as_val() {
    let Some(val) = Val::find("conditional-random") else {
        return;
    };
    let mut counts = [0; 2];
    for seed in 0..150 {
        let mut dice = Rng(seed);
        let mut effects = String::new();
        for _ in 0..dice.below(3) {
            let literal = dice.literal();
            let _ = write!(effects, "(at start {literal}) ");
        }
        let time = ["at start", "at start", "over all", "at end"];
        let time = time[usize::try_from(dice.below(4)).expect("small")];
        let [one, two, effect] = [dice.literal(), dice.literal(), dice.literal()];
        let condition = match dice.below(3) {
            0 => format!("({time} {one})"),
            1 => format!("(and ({time} {one}) ({time} {two}))"),
            _ => format!("({time} (or {one} {two}))"),
        };
        let _ = write!(effects, "(when {condition} (at end {effect}))");
        let initial = ["(p)", "(q)", "(r)"].map(|fact| (fact, dice.below(2) == 0));
        let initial = initial.iter().filter(|(_, holds)| *holds);
        let initial: Vec<&str> = initial.map(|(fact, _)| *fact).collect();
        let goal = dice.literal();
        let said = verdict_of(&val, [&effects, &initial.join(" "), &goal]);
        let [theirs, own] = &said;
        assert!(
            own.agrees_with(theirs),
            "{effects}, {initial:?}, {goal}: {said:?}"
        );
        counts[usize::from(is_valid(own))] += 1;
    }
    assert!(counts.iter().all(|count| *count > 40), "{counts:?}");
}
