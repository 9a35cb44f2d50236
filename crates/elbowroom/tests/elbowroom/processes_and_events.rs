//! Envelopes of plans with processes and events, for random worlds and random plans. The boxes are
//! tested by the validator, which computes each trajectory independently, by polynomials.

mod by_hand;
mod races;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;

use crate::shared::{self, draw};
use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::{Guarantee, Oracle};
use elbowroom_model::Task;
use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_num::{Interval, Rational};
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Valuation, format};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Returns one of a few random numbers, so that bounds are often hit exactly.
fn number(rng: &mut ChaCha8Rng, halves: std::ops::RangeInclusive<i64>) -> Rational {
    Rational::new(rng.random_range(halves), 2)
}

fn fact(rng: &mut ChaCha8Rng) -> String {
    let fact = format!("(p{})", rng.random_range(0..3));
    if rng.random_bool(0.5) {
        return fact;
    }
    format!("(not {fact})")
}

fn comparison(rng: &mut ChaCha8Rng) -> String {
    let symbol = ["<", "<=", ">=", ">"].choose(rng).expect("a few");
    let fluent = rng.random_range(0..3);
    let bound = number(rng, -6..=8);
    if rng.random_bool(0.2) {
        let other = (fluent + 1) % 3;
        return format!("({symbol} (x{fluent}) (+ (x{other}) {bound}))");
    }
    format!("({symbol} (x{fluent}) {bound})")
}

fn condition(rng: &mut ChaCha8Rng) -> String {
    match rng.random_range(0..6) {
        0 => fact(rng),
        1 => comparison(rng),
        2 => format!("(or {} {})", fact(rng), comparison(rng)),
        3 => format!("(and {} {})", comparison(rng), comparison(rng)),
        _ => format!("(and {} {})", comparison(rng), fact(rng)),
    }
}

/// Returns the condition of an event. A number may pass through its whole range between two
/// happenings, or only one of two numbers may be in its range in time.
fn watched(rng: &mut ChaCha8Rng) -> String {
    match rng.random_range(0..4) {
        0 | 1 => comparison(rng),
        2 => {
            let (fluent, lower) = (rng.random_range(0..3), number(rng, -6..=8));
            let upper = &lower + number(rng, 0..=2);
            format!("(and (>= (x{fluent}) {lower}) (<= (x{fluent}) {upper}))")
        }
        _ => {
            let fluent = rng.random_range(0..3);
            let (below, above) = (number(rng, -4..=8), number(rng, -4..=8));
            let other = (fluent + 1) % 3;
            format!("(and (<= (x{fluent}) {below}) (> (x{other}) {above}))")
        }
    }
}

/// Returns an instantaneous change of a number.
fn change(rng: &mut ChaCha8Rng) -> String {
    let operator = ["increase", "decrease", "assign"].choose(rng).expect("few");
    let fluent = rng.random_range(0..3);
    format!("({operator} (x{fluent}) {})", number(rng, -4..=4))
}

fn rate(rng: &mut ChaCha8Rng) -> String {
    let fluent = rng.random_range(0..3);
    let rate = ["1", "2", "-1", "-2", "1/2", "(z)", "(x0)"]
        .choose(rng)
        .expect("some");
    format!("(increase (x{fluent}) (* #t {rate}))")
}

/// Returns a domain and a problem.
fn world(rng: &mut ChaCha8Rng) -> (String, String) {
    let mut domain = "(define (domain d) (:predicates (p0) (p1) (p2))
        (:functions (x0) (x1) (x2) (z))\n"
        .to_owned();
    for index in 0..rng.random_range(1..4) {
        let (when, rate) = (condition(rng), rate(rng));
        writeln!(
            domain,
            "(:process work{index} :precondition {when} :effect {rate})"
        )
        .expect("text");
    }
    for index in 0..rng.random_range(0..3) {
        // An event mostly makes its own condition false.
        let own = fact(rng);
        let undone = match own.strip_prefix("(not ") {
            Some(rest) => rest.trim_end_matches(')').to_owned() + ")",
            None => format!("(not {own})"),
        };
        let (when, mut effect) = (watched(rng), undone);
        if rng.random_bool(0.6) {
            effect += &change(rng);
        }
        if rng.random_bool(0.2) {
            write!(effect, "(when {} {})", fact(rng), change(rng)).expect("text");
        }
        writeln!(
            domain,
            "(:event turn{index} :precondition (and {own} {when}) :effect (and {effect}))"
        )
        .expect("text");
    }
    for index in 0..3 {
        let needed = if rng.random_bool(0.5) {
            condition(rng)
        } else {
            "(and)".to_owned()
        };
        let mut effect = fact(rng);
        if rng.random_bool(0.5) {
            effect += &change(rng);
        }
        writeln!(
            domain,
            "(:action act{index} :precondition {needed} :effect (and {effect}))"
        )
        .expect("text");
    }
    for index in 0..2 {
        let throughout = if rng.random_bool(0.6) {
            format!("(over all {})", condition(rng))
        } else {
            "(and)".to_owned()
        };
        let mut effect = format!("(at start {}) (at end {})", fact(rng), fact(rng));
        if rng.random_bool(0.5) {
            effect += &rate(rng);
        }
        writeln!(
            domain,
            "(:durative-action last{index} :duration (>= ?duration 0) :condition {throughout} :effect (and {effect}))"
        )
        .expect("text");
    }
    let goal = if rng.random_bool(0.5) {
        condition(rng)
    } else {
        "(and)".to_owned()
    };
    if rng.random_bool(0.3) {
        let always = condition(rng);
        writeln!(domain, "(:constraint always :condition {always})").expect("text");
    }
    let mut problem =
        format!("(define (problem p) (:domain d) (:goal {goal}) (:init (= (z) 3/2)\n");
    for index in 0..3 {
        writeln!(problem, "(= (x{index}) {})", number(rng, -4..=4)).expect("text");
        if rng.random_bool(0.5) {
            writeln!(problem, "(p{index})").expect("text");
        }
    }
    if rng.random_bool(0.3) {
        let (at, what) = (number(rng, 1..=6), fact(rng));
        writeln!(problem, "(at {at} {what})").expect("text");
    }
    (domain + ")", problem + "))")
}

fn task_of(domain: &str, problem: &str) -> Task {
    let domain = Source::new("domain.pddl", domain);
    let problem = Source::new("problem.pddl", problem);
    match read_problem(&domain, &problem) {
        Ok((problem, _)) => Task::new(problem),
        Err(diagnostics) => panic!("{}", diagnostics.render(false)),
    }
}

/// Returns a plan for the validator, and the same plan as a network with all starts and durations
/// as parameters.
fn plan(rng: &mut ChaCha8Rng) -> (String, String) {
    let (mut fixed, mut open) = (String::new(), String::new());
    let count = rng.random_range(1..4);
    let mut starts: Vec<i64> = (0..=12).collect();
    starts.shuffle(rng);
    for (index, start) in starts.into_iter().take(count).enumerate() {
        let start = Rational::new(start, 2);
        let kind = rng.random_range(0..3);
        if kind < 2 {
            let action = rng.random_range(0..3);
            writeln!(fixed, "{start}: (act{action})").expect("text");
            write!(
                open,
                "action instance n{index} : (act{action});
                parameter s{index} default {start};
                c: n{index} - .zero in [s{index}, s{index}];\n"
            )
            .expect("text");
        } else {
            let action = rng.random_range(0..2);
            let length = Rational::new(rng.random_range(1..7), 2);
            writeln!(fixed, "{start}: (last{action}) [{length}]").expect("text");
            write!(
                open,
                "durative-action instance n{index} : (last{action});
                parameter s{index} default {start};
                parameter d{index} default {length};
                c: n{index}.start - .zero in [s{index}, s{index}];
                c: n{index}.end - n{index}.start in [d{index}, d{index}];\n"
            )
            .expect("text");
        }
    }
    (fixed, open)
}

/// Returns a box around the nominal values, which are often ends of intervals.
fn some_box(plan: &ParametrizedPlan, rng: &mut ChaCha8Rng) -> DecoupledEnvelope {
    let unit = Rational::new(1, 1 << rng.random_range(0..7));
    let intervals = plan.parameters.iter().map(|parameter| {
        let mut side = || &unit * Rational::from(rng.random_range(0..3_i64));
        let lower = &parameter.nominal - side();
        let upper = &parameter.nominal + side();
        Interval::closed(lower.max(Rational::ZERO), upper)
    });
    DecoupledEnvelope::new(plan, intervals.collect()).expect("an interval for each")
}

/// Returns the first of some values in a box for which the validator rejects the plan.
fn refuted(
    task: &Task,
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
    rng: &mut ChaCha8Rng,
) -> Option<(Valuation, Verdict)> {
    (0..25).find_map(|_| {
        let valuation = draw::valuation(envelope, rng);
        let schedule = draw::schedule(&plan.plan, &valuation, rng)?;
        let fixed = plan.plan.at(&valuation).scheduled(&schedule);
        let verdict = validate(task, &fixed, &Settings::default());
        (!verdict.is_valid()).then_some((valuation, verdict))
    })
}

#[derive(Debug, Default)]
struct Count {
    valid: usize,
    /// Number of plans without a computed envelope, by reason.
    refused: BTreeMap<String, usize>,
    /// Number of plans that are not proved valid at their nominal values.
    not_proved_at_nominal: usize,
    /// Number of boxes with more than one value that passed the tests.
    inside: usize,
    /// Number of rejected boxes with values that break the plan.
    broken: usize,
    /// Number of rejected boxes without such values among those tried.
    without_counterexample: usize,
}

fn in_words(refusal: &Refusal) -> String {
    match refusal {
        Refusal::Autonomous { obstacle, .. } => obstacle.clone(),
        other => format!("{other:?}")
            .chars()
            .take_while(|c| c.is_alphanumeric())
            .collect(),
    }
}

/// Tests boxes of random plans in random worlds by the validator.
fn attack(
    worlds: usize,
    rng: &mut ChaCha8Rng,
    world: fn(&mut ChaCha8Rng) -> (String, String),
    plan_of: fn(&mut ChaCha8Rng) -> (String, String),
) -> Count {
    let mut count = Count::default();
    for _ in 0..worlds {
        let (domain, problem) = world(rng);
        let task = Arc::new(task_of(&domain, &problem));
        for _ in 0..4 {
            let (fixed, open) = plan_of(rng);
            let (planned, _) = read_plan(&Source::new("plan", fixed), &task).expect("a plan");
            if !validate(&task, &planned, &Settings::default()).is_valid() {
                continue;
            }
            count.valid += 1;
            let plan = format::read(open.as_bytes(), &task).expect("a readable plan");
            let plan = Arc::new(plan);
            let oracle = Oracle::new(&task, &plan, Guarantee::Weak);
            let mut oracle = match oracle {
                Ok(oracle) => oracle,
                Err(refusal) => {
                    *count.refused.entry(in_words(&refusal)).or_default() += 1;
                    continue;
                }
            };
            let point = DecoupledEnvelope::point(&plan.nominal());
            if oracle.objection(&point).expect("within reach").is_some() {
                count.not_proved_at_nominal += 1;
                continue;
            }
            for _ in 0..6 {
                let envelope = some_box(&plan, rng);
                if envelope == point {
                    continue;
                }
                let is_inside = oracle.objection(&envelope).expect("within reach").is_none();
                let refuted = refuted(&task, &plan, &envelope, rng);
                match refuted {
                    Some((valuation, verdict)) if is_inside => panic!(
                        "{domain}\n{problem}\n{open}\n{envelope:?}\n{valuation:?}\n{verdict:?}"
                    ),
                    Some(_) => count.broken += 1,
                    None if is_inside => count.inside += 1,
                    None => count.without_counterexample += 1,
                }
            }
        }
    }
    count
}

/// Returns the number of worlds, from the environment or by default.
fn worlds(so_many: usize) -> usize {
    let asked = std::env::var("ELBOWROOM_WORLDS").ok();
    asked.and_then(|text| text.parse().ok()).unwrap_or(so_many)
}

#[test]
#[allow(clippy::print_stdout, reason = "says what was attacked")]
fn schedules_in_boxes_of_random_hybrid_plans_are_valid() {
    let mut rng = ChaCha8Rng::seed_from_u64(2006);
    let count = attack(
        worlds(600 / shared::one_in::<usize>(3)),
        &mut rng,
        world,
        plan,
    );
    println!("{count:#?}");
    let refused: usize = count.refused.values().sum();
    assert!(
        count.inside * 4 > count.valid * 10,
        "few boxes are found to be inside"
    );
    assert!(count.broken * 10 > count.valid, "few boxes are too large");
    assert!(refused * 10 < count.valid, "many plans are refused");
    assert!(
        count.not_proved_at_nominal * 100 < count.valid,
        "many plans are not accepted as they are"
    );
}
