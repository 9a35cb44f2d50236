//! Exported files give the same results in other programs as the box check: in z3 for boxes and
//! regions, and in the readers of networks for STNUs.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

use crate::shared;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

use crate::shared::case::Case;
use crate::shared::draw;
use crate::shared::instances::{figure_3, figure_4};
use crate::shared::skipped;
use elbowroom::answers::envelope::envelope;
use elbowroom::answers::{EnvelopeRequest, NoObserver};
use elbowroom::envelope::{Guarantee, Oracle};
use elbowroom::model::Task;
use elbowroom::network::{
    NetworkFile, Request, Verdict, analyze, read, write_graphml, write_json, write_plain,
};
use elbowroom::num::Rational;
use elbowroom::parse_box;
use elbowroom::pddl::{Source, read_plan, read_problem};
use elbowroom::plan::{BoxEnd, DecoupledEnvelope, ParametrizedPlan};
use elbowroom::{AnyPlan, write_box};
use elbowroom_export::{ExportError, box_check, box_of, parametrized_plan, region, stnu};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const GUARANTEES: [Guarantee; 3] = [Guarantee::Weak, Guarantee::Dynamic, Guarantee::Strong];

/// Cases with an envelope.
const CASES: [&str; 7] = [
    "battery",
    "delivery",
    "hatchery",
    "lamp",
    "match",
    "paintshop",
    "tank",
];

/// Time limit of z3 for one text, in seconds.
const SECONDS: u64 = 10;

/// Returns the output of z3, line by line, or `None` if z3 is not installed.
fn z3(text: &str) -> Option<Vec<String>> {
    let mut child = Command::new("z3")
        .args([&format!("-T:{SECONDS}"), "-in"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .ok()?;
    let mut input = child.stdin.take().expect("piped");
    input.write_all(text.as_bytes()).expect("z3 listens");
    drop(input);
    let output = child.wait_with_output().expect("z3 ends");
    let output = String::from_utf8(output.stdout).expect("text");
    Some(output.lines().map(str::to_owned).collect())
}

/// Returns `true` if all queries are `unsat`, or `None` if z3 reached its time limit.
fn is_unsat(text: &str) -> Option<bool> {
    let answers = z3(text).expect("z3 was there a moment ago");
    let questions = text.matches("(check-sat)").count();
    if answers.iter().any(|answer| answer == "sat") {
        return Some(false);
    }
    if answers
        .iter()
        .any(|answer| ["unknown", "timeout"].contains(&answer.as_str()))
    {
        return None;
    }
    assert_eq!(answers, vec!["unsat"; questions], "{text}");
    Some(true)
}

fn has_z3() -> bool {
    let has = z3("(check-sat)").is_some_and(|answers| answers == ["sat"]);
    if !has {
        skipped("there is no z3 here");
    }
    has
}

/// Returns a case of this repository.
fn case(name: &str) -> (Arc<Task>, AnyPlan) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../cases")
        .join(name);
    let source = |file: &str| {
        let text = std::fs::read_to_string(folder.join(file)).expect("a file of the case");
        Source::new(file, text)
    };
    let read = read_problem(&source("domain.pddl"), &source("problem.pddl"));
    let task = Arc::new(Task::new(read.expect("a case without mistakes").0));
    let plan = read_plan(&source("plan.plan"), &task);
    (task, plan.expect("a plan without mistakes").0.into())
}

/// Returns the verdict, which must be the same in each exported format.
fn is_controllable(file: &NetworkFile) -> bool {
    let json = write_json(file);
    let (whole, _) = file.in_whole_numbers().expect("small numbers");
    // The other formats have no links without an upper bound.
    let is_bounded = whole
        .network
        .links()
        .iter()
        .all(|link| link.upper.is_some());
    let texts = [
        Some(("network.json", json)),
        is_bounded.then(|| ("network.stnu", write_graphml(&whole).expect("no waits"))),
        is_bounded.then(|| ("network.txt", write_plain(&whole).expect("plain names"))),
    ];
    let verdicts = texts.into_iter().flatten().map(|(name, text)| {
        let file = read(name, text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert!(file.remarks.is_empty(), "{:?}", file.remarks);
        let answer = analyze(&file, &Request::default()).expect("nothing to simulate");
        answer.dynamic.unwrap_or(answer.consistent).verdict == Verdict::Yes
    });
    let verdicts: Vec<bool> = verdicts.collect();
    assert!(
        verdicts.iter().all(|own| *own == verdicts[0]),
        "{verdicts:?}"
    );
    verdicts[0]
}

/// Returns the verdicts of other programs on a box.
fn others(
    task: &Task,
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
    guarantee: Guarantee,
) -> Option<bool> {
    let text = match box_check(task, plan, envelope, guarantee) {
        Ok(text) => text,
        Err(ExportError::NoSchedule | ExportError::Unlimited { .. }) => return Some(false),
        Err(error) => panic!("{error}"),
    };
    let mut verdict = is_unsat(&text);
    if guarantee == Guarantee::Dynamic && verdict == Some(true) {
        verdict = match stnu(task, plan, envelope) {
            Ok(file) => Some(is_controllable(&file)),
            Err(_) => Some(false),
        };
    }
    verdict
}

/// Numbers of agreeing verdicts.
#[derive(Debug, Default)]
struct Tally {
    inside: usize,
    outside: usize,
    /// Queries on which z3 reached its time limit.
    open: Vec<String>,
}

impl Tally {
    /// Compares a box, and the boxes with one end moved outwards.
    fn compare(
        &mut self,
        name: &str,
        (task, plan): (&Arc<Task>, &Arc<ParametrizedPlan>),
        envelope: &DecoupledEnvelope,
        guarantee: Guarantee,
        most_ends: usize,
    ) {
        let mut oracle = Oracle::new(task, plan, guarantee).expect("within reach");
        let ends = BoxEnd::all(plan.parameters.len()).filter_map(|end| {
            let nominal = plan.parameter(end.parameter).nominal.abs();
            let further = &nominal * &Rational::new(1, 5) + Rational::from(1);
            let reach = end.reach(envelope)? + further;
            Some(end.with_reach(envelope, Some(reach)))
        });
        let boxes = std::iter::once(envelope.clone()).chain(ends.take(most_ends));
        for own in boxes {
            let ours = oracle.objection(&own).expect("within reach").is_none();
            let what = format!("{name}, {guarantee:?}, {}", write_box(&own, plan));
            match others(task, plan, &own, guarantee) {
                Some(theirs) => {
                    assert_eq!(theirs, ours, "{what}");
                    if ours {
                        self.inside += 1;
                    } else {
                        self.outside += 1;
                    }
                }
                None => self.open.push(what),
            }
        }
    }
}

/// Returns the plan of a request and its envelope.
fn found(request: &EnvelopeRequest) -> Option<(Arc<ParametrizedPlan>, DecoupledEnvelope)> {
    let outcome = envelope(request, &mut NoObserver).expect("within exact reasoning");
    let plan = parametrized_plan(request).expect("a plan");
    let envelope = outcome.envelope?;
    assert_eq!(box_of(&outcome.answer, &plan), Ok(envelope.clone()));
    Some((Arc::new(plan), envelope))
}

#[test]
fn z3_and_readers_of_networks_agree_with_the_box_check_on_all_cases() {
    if !has_z3() {
        return;
    }
    let mut tally = Tally::default();
    for name in CASES {
        let (task, plan) = case(name);
        for guarantee in GUARANTEES {
            let mut request = EnvelopeRequest::new(&task, plan.clone());
            request.guarantee = guarantee;
            if let Some((plan, envelope)) = found(&request) {
                tally.compare(name, (&task, &plan), &envelope, guarantee, 8);
            }
        }
    }
    println!("{tally:?}");
    assert!(tally.open.is_empty(), "{tally:?}");
    assert!(tally.inside > 20 && tally.outside > 40, "{tally:?}");
}

#[test]
fn z3_and_readers_of_networks_agree_with_the_box_check_on_published_plans() {
    let Some(data) = shared::data() else { return };
    if !has_z3() {
        return;
    }
    for (family, instances) in [
        ("AAAI-19", figure_3(&data)),
        ("robot deliveries", figure_4(&data)),
    ] {
        let mut tally = Tally::default();
        for instance in instances.iter().step_by(5 * shared::one_in::<usize>(2)) {
            let case = Case::read(&instance.domain, &instance.problem, &instance.plan);
            for guarantee in GUARANTEES {
                let plan = ParametrizedPlan::clone(&case.plan);
                let mut request = EnvelopeRequest::new(&case.task, plan);
                request.guarantee = guarantee;
                if let Some((plan, envelope)) = found(&request) {
                    let own = (&case.task, &plan);
                    tally.compare(&instance.name, own, &envelope, guarantee, 2);
                }
            }
        }
        println!(
            "{family}: {} boxes inside, {} outside, {} left open: {:?}",
            tally.inside,
            tally.outside,
            tally.open.len(),
            tally.open
        );
        assert!(tally.inside + tally.outside > 10, "{tally:?}");
    }
}

/// Compares z3 and the box check at random points of a region. Returns the numbers of points
/// inside, of points outside, and of those on which z3 reached its time limit. They agree on all
/// others.
fn points_agree(
    name: &str,
    (task, plan): (&Arc<Task>, &Arc<ParametrizedPlan>),
    points: usize,
) -> [usize; 3] {
    let text = region(task, plan).expect("within reach");
    let mut oracle = Oracle::new(task, plan, Guarantee::Weak).expect("within reach");
    let around = parse_box("all=±100%", plan).expect("a box of all parameters");
    let mut random = ChaCha8Rng::seed_from_u64(14);
    let names: Vec<&str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("(declare-const ")?.strip_suffix(" Real)"))
        .collect();
    assert_eq!(names.len(), plan.parameters.len());
    let mut counts = [0; 3];
    let mut left = points;
    while left > 0 {
        // Several points for each process.
        let some = left.min(50);
        left -= some;
        let mut ours = Vec::new();
        let mut questions = String::new();
        for _ in 0..some {
            let point = draw::valuation(&around, &mut random);
            let values = DecoupledEnvelope::point(&point);
            ours.push(oracle.objection(&values).expect("within reach").is_none());
            questions.push_str("(push)\n");
            for (name, value) in names.iter().zip(&point) {
                let [numerator, denominator] = match value.to_string().split_once('/') {
                    Some((above, below)) => [above.to_owned(), below.to_owned()],
                    None => [value.to_string(), "1".to_owned()],
                };
                let fixed = format!("(assert (= (* {denominator} {name}) {numerator}))\n");
                questions.push_str(&fixed);
            }
            questions.push_str("(check-sat)\n(pop)\n");
        }
        let answers = z3(&text.replace("(check-sat)", &questions)).expect("z3 is there");
        for (index, ours) in ours.into_iter().enumerate() {
            match answers.get(index).map(String::as_str) {
                Some("sat") => assert!(ours, "{name}, {index} of {some}, {left} left"),
                Some("unsat") => assert!(!ours, "{name}, {index} of {some}, {left} left"),
                Some("unknown" | "timeout") | None => {
                    counts[2] += 1;
                    continue;
                }
                Some(other) => panic!("{name}: z3 says {other}"),
            }
            counts[usize::from(!ours)] += 1;
        }
    }
    counts
}

fn sum(counts: &mut [usize; 3], own: [usize; 3]) {
    for (count, own) in counts.iter_mut().zip(own) {
        *count += own;
    }
}

#[test]
fn region_contains_exactly_the_feasible_points() {
    if !has_z3() {
        return;
    }
    let mut counts = [0; 3];
    for name in CASES {
        let (task, plan) = case(name);
        let plan = parametrized_plan(&EnvelopeRequest::new(&task, plan));
        let plan = Arc::new(plan.expect("a plan"));
        sum(&mut counts, points_agree(name, (&task, &plan), 10));
    }
    println!("points inside, outside, left open: {counts:?}");
    assert!(counts[0] > 10 && counts[1] > 10 && counts[2] == 0);
}

/// `ELBOWROOM_POINTS` sets the number of points of each plan; by default, a few of each fifth.
#[test]
fn z3_agrees_with_regions_of_published_plans() {
    let Some(data) = shared::data() else { return };
    if !has_z3() {
        return;
    }
    let points = std::env::var("ELBOWROOM_POINTS").ok();
    let points: Option<usize> = points.map(|count| count.parse().expect("a number"));
    let mut counts = [0; 3];
    for instance in figure_3(&data)
        .iter()
        .step_by(if points.is_some() { 1 } else { 5 })
    {
        let case = Case::read(&instance.domain, &instance.problem, &instance.plan);
        let own = (&case.task, &case.plan);
        sum(
            &mut counts,
            points_agree(&instance.name, own, points.unwrap_or(4)),
        );
    }
    println!("points inside, outside, left open: {counts:?}");
    assert!(counts[0] > 5 && counts[1] > 5, "{counts:?}");
}

#[test]
fn the_box_of_an_answer_about_another_plan_is_refused() {
    let (task, plan) = case("delivery");
    let outcome = envelope(&EnvelopeRequest::new(&task, plan), &mut NoObserver);
    let answer = outcome.expect("within exact reasoning").answer;
    let (other_task, other) = case("hatchery");
    let other = parametrized_plan(&EnvelopeRequest::new(&other_task, other));
    let refused = box_of(&answer, &other.expect("a plan"));
    assert!(
        matches!(refused, Err(ExportError::OtherParameters { .. })),
        "{refused:?}"
    );
}
