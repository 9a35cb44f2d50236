//! Envelopes of plans with processes and events: random worlds and random plans in them. What a box
//! promises is attacked with the judge, which follows each course on its own, by polynomials.

mod shared;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use elbowroom::answers::Unwatched;
use elbowroom::answers::envelope::{EnvelopeRequest, envelope};
use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::{Guarantee, Oracle, irr, sharpen};
use elbowroom_model::Task;
use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_num::{Interval, Rational};
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Valuation, format};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shared::draw;

/// A random number from a few, so that bounds are often hit exactly.
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

/// What an event watches. A number may pass through all that makes it happen between two happenings,
/// and of two numbers one may come too early for the other.
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

/// A change of a number, at once.
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

/// A domain and a problem.
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
        // Mostly it makes its own condition false.
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

/// A plan as the judge reads it, and as a network in which each start and each duration may deviate.
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

/// A box around the nominal values, often with these at ends of intervals.
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

/// The first of some values in a box for which the judge does not accept the plan.
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
    /// Plans that no envelope is computed of, by what stands in the way.
    refused: BTreeMap<String, usize>,
    /// Plans that are not found to work as they are.
    not_as_they_are: usize,
    /// Boxes with more than one value that withstood the attack.
    inside: usize,
    /// Boxes that were rejected, with values in them that break the plan.
    broken: usize,
    /// Boxes that were rejected, without such values among those tried.
    doubted: usize,
}

fn in_words(refusal: &Refusal) -> String {
    match refusal {
        Refusal::Nature { obstacle, .. } => obstacle.clone(),
        other => format!("{other:?}")
            .chars()
            .take_while(|c| c.is_alphanumeric())
            .collect(),
    }
}

/// Boxes of random plans in random worlds, attacked with the judge.
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
                count.not_as_they_are += 1;
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
                    None => count.doubted += 1,
                }
            }
        }
    }
    count
}

/// So many, or as many as the environment asks for.
fn worlds(so_many: usize) -> usize {
    let asked = std::env::var("ELBOWROOM_WORLDS").ok();
    asked.and_then(|text| text.parse().ok()).unwrap_or(so_many)
}

#[test]
#[allow(clippy::print_stdout, reason = "says what was attacked")]
fn schedules_in_boxes_of_random_plans_with_processes_and_events_pass_the_judge() {
    let mut rng = ChaCha8Rng::seed_from_u64(2006);
    let count = attack(worlds(600), &mut rng, world, plan);
    println!("{count:#?}");
    let refused: usize = count.refused.values().sum();
    assert!(
        count.inside * 4 > count.valid * 10,
        "few boxes are found to be inside"
    );
    assert!(count.broken * 10 > count.valid, "few boxes are too large");
    assert!(refused * 10 < count.valid, "many plans are refused");
    assert!(
        count.not_as_they_are * 100 < count.valid,
        "many plans are not accepted as they are"
    );
}

/// A domain and a problem in which numbers race: each rises on its own from some time on, and what is
/// watched is how they stand to each other.
fn race(rng: &mut ChaCha8Rng) -> (String, String) {
    let mut domain = "(define (domain d) (:predicates (on0) (on1) (on2) (done0) (done1) (seen))
        (:functions (x0) (x1) (x2)) (:action look :effect (seen))\n"
        .to_owned();
    for index in 0..3 {
        let rate = ["1", "2", "1/2"].choose(rng).expect("some");
        writeln!(
            domain,
            "(:action act{index} :effect (on{index}))
            (:process rise{index} :precondition (on{index})
             :effect (increase (x{index}) (* #t {rate})))"
        )
        .expect("text");
    }
    for index in 0..rng.random_range(1..3) {
        let early = rng.random_range(0..3);
        let late = (early + rng.random_range(1..3)) % 3;
        let (below, above) = (number(rng, 1..=10), number(rng, 1..=10));
        writeln!(
            domain,
            "(:event turn{index} :precondition (and (not (done{index})) (<= (x{early}) {below})
              (> (x{late}) {above})) :effect (done{index}))"
        )
        .expect("text");
    }
    let problem = "(define (problem p) (:domain d) (:init (= (x0) 0) (= (x1) 0) (= (x2) 0))
        (:goal (and (not (done0)) (not (done1)))))";
    (domain + ")", problem.to_owned())
}

/// A plan for such a race: who begins when, and some looks in between.
fn plan_of_a_race(rng: &mut ChaCha8Rng) -> (String, String) {
    let (mut fixed, mut open) = (String::new(), String::new());
    let mut starts: Vec<i64> = (0..=16).collect();
    starts.shuffle(rng);
    let actions = ["act0", "act1", "act2", "look", "look", "look"];
    for (index, (start, action)) in starts.into_iter().zip(actions).enumerate() {
        let start = Rational::new(start, 2);
        writeln!(fixed, "{start}: ({action})").expect("text");
        write!(
            open,
            "action instance n{index} : ({action});
            parameter s{index} default {start};
            c: n{index} - .zero in [s{index}, s{index}];\n"
        )
        .expect("text");
    }
    (fixed, open)
}

/// Between two happenings, an event's condition may come to hold and cease to hold again: only what
/// is demanded of the time between them keeps boxes from that.
#[test]
#[allow(clippy::print_stdout, reason = "says what was attacked")]
fn schedules_in_boxes_of_random_races_pass_the_judge() {
    let mut rng = ChaCha8Rng::seed_from_u64(1871);
    let count = attack(worlds(60), &mut rng, race, plan_of_a_race);
    println!("{count:#?}");
    assert!(
        count.inside > count.valid,
        "few boxes are found to be inside"
    );
    assert!(count.broken * 4 > count.valid, "few boxes are too large");
    assert_eq!(count.refused, BTreeMap::new());
    assert_eq!(count.not_as_they_are, 0);
}

fn kettle(file: &str) -> (Arc<Task>, Source) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/kettle");
    let task = shared::task(&folder.join("domain.pddl"), &folder.join("problem.pddl"));
    (
        Arc::new(task.expect("a case without mistakes")),
        shared::source(&folder.join(file)),
    )
}

/// The largest box of a plan of few parameters.
fn largest(task: &Arc<Task>, text: impl Into<Source>) -> DecoupledEnvelope {
    let plan = Arc::new(format::read(text, task).expect("a readable plan"));
    let mut oracle = Oracle::new(task, &plan, Guarantee::Weak).expect("within reach");
    let settings = elbowroom_envelope::Settings::default();
    let run = irr(&mut oracle, &settings, &mut |_| ControlFlow::Continue(()));
    let found = run
        .expect("within reach")
        .envelope
        .expect("it works as planned");
    let found = sharpen(&mut oracle, &found, &mut || ControlFlow::Continue(()));
    found.expect("within reach").expect("it was found inside")
}

/// The box is worked by hand in the problem file.
#[test]
fn the_kettle_boils_before_the_tea_is_poured() {
    let (task, text) = kettle("tea.stn");
    let found = largest(&task, &text);
    let number = |text: &str| text.parse::<Rational>().expect("a number");
    let expected = [("6", "10"), ("8.001", "28")]
        .map(|(lower, upper)| Interval::closed(number(lower), number(upper)));
    assert_eq!(found.intervals(), expected);
}

/// Two numbers that rise, and an event that watches both.
const CLIMB: &str = "(define (domain d)
    (:predicates (clashed) (seen))
    (:functions (x) (y))
    (:durative-action climb :duration (= ?duration 10) :condition (and)
     :effect (increase (x) (* #t 1)))
    (:durative-action follow :duration (= ?duration 10) :condition (and)
     :effect (increase (y) (* #t 1)))
    (:action look :effect (seen))
    (:event clash :precondition (and (not (clashed)) (<= (x) 6) (> (y) 4))
     :effect (clashed)))";

/// x rises from s on, and y from 5 on. From 9 on, y is above 4; the event would happen then if x were
/// at most 6, as it is until s + 6. At the plan's happenings it is never so.
#[test]
fn no_event_may_happen_between_two_happenings() {
    let problem = "(define (problem p) (:domain d)
        (:init (= (x) 0) (= (y) 0)) (:goal (not (clashed))))";
    let task = Arc::new(task_of(CLIMB, problem));
    let plan = "durative-action instance first : (climb);
        durative-action instance second : (follow);
        parameter s default 1;
        c: first.start - .zero in [s, s];
        c: first.end - first.start in [10, 10];
        c: second.start - .zero in [5, 5];
        c: second.end - second.start in [10, 10];";
    let until = |last: i64| [Interval::closed(Rational::ZERO, Rational::from(last))];
    assert_eq!(largest(&task, plan).intervals(), until(3));
    // At 8, x is above 6 as planned and y is not above 4. From there on one of the two has to be as
    // it is, be it needed or not.
    let looking = format!("{plan} action instance eye : (look); c: eye - .zero in [8, 8];");
    assert_eq!(largest(&task, &looking).intervals(), until(2));
}

/// A plan with fixed times keeps its order, and the executor as much freedom as all that leaves.
#[test]
fn a_plan_with_fixed_times_leaves_durations_open() {
    let (task, text) = kettle("tea.plan");
    let (plan, _) = read_plan(&text, &task).expect("a readable plan");
    let request = EnvelopeRequest::new(&task, plan);
    let outcome = envelope(&request, &mut Unwatched).expect("within reach");
    let plan = outcome.plan.expect("a network");
    let found = outcome.envelope.expect("it works as planned");
    let has_room = |own: &Interval| own.width().is_none_or(|width| width.is_positive());
    assert!(found.intervals().iter().all(has_room), "{found:?}");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    assert_eq!(refuted(&task, &plan, &found, &mut rng), None);
}
