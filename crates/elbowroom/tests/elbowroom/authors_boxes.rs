//! Comparison of our boxes with those that the authors' tool found (January 2019).
//!
//! Every recorded box of a finished run must be inside the envelope. With any end shifted outwards
//! by more than the run's last step, it must not be. The same search must find the same box.

use crate::shared;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use crate::shared::instances::{Instance, figure_3};
use elbowroom_envelope::{Guarantee, Oracle, Settings, irr};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParameterId, ParametrizedPlan, Side, format};

/// Box as printed by the authors' tool, by parameter name.
type Recorded = BTreeMap<String, (Rational, Rational)>;

/// Returns the distinct boxes of finished IRR runs, by instance.
fn recorded_boxes(data: &Path) -> BTreeMap<String, Vec<Recorded>> {
    let path = data.join("envelopes/paper_runs/aaai_runs.csv");
    let text = std::fs::read_to_string(&path).expect("the table of runs");
    let mut boxes: BTreeMap<String, Vec<Recorded>> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        if fields[2] != "IRR" || fields[4] != "ok" {
            continue;
        }
        let quoted = line.split('"').nth(1).expect("a box in quotes");
        let recorded: Recorded = quoted.split_whitespace().map(interval).collect();
        let known = boxes
            .entry(format!("{} {}", fields[0], fields[1]))
            .or_default();
        if !known.contains(&recorded) {
            known.push(recorded);
        }
    }
    boxes
}

/// Reads `dur_0=[7/4,3829/4]`.
fn interval(text: &str) -> (String, (Rational, Rational)) {
    let (name, ends) = text.split_once('=').expect("NAME=[LOWER,UPPER]");
    let ends = ends.trim_matches(['[', ']']);
    let (lower, upper) = ends.split_once(',').expect("two ends");
    (
        name.to_owned(),
        (
            lower.parse().expect("a number"),
            upper.parse().expect("a number"),
        ),
    )
}

/// Parsed instance.
struct Case {
    task: Arc<elbowroom_model::Task>,
    plan: Arc<ParametrizedPlan>,
}

fn read(instance: &Instance, text: &str) -> Case {
    let task = shared::task(&instance.domain, &instance.problem).expect("a readable problem");
    let plan = format::read(text.as_bytes(), &task).expect("a readable plan");
    Case {
        task: Arc::new(task),
        plan: Arc::new(plan),
    }
}

fn plan_text(instance: &Instance) -> String {
    std::fs::read_to_string(&instance.plan).expect("a plan file")
}

fn envelope_of(plan: &ParametrizedPlan, recorded: &Recorded) -> DecoupledEnvelope {
    let intervals = plan.parameters.iter().map(|parameter| {
        let (lower, upper) = recorded[&parameter.name].clone();
        Interval::closed(lower, upper)
    });
    DecoupledEnvelope::new(plan, intervals.collect()).expect("one for each")
}

/// Returns `true` for the only recorded end that may be moved further. `senddata` takes exactly 1
/// in its domain, which is a constraint in the authors' tool. Here a duration that is a parameter
/// is not constrained by its domain.
fn is_freed_by_us(instance: &str, parameter: &str) -> bool {
    instance == "solar_rover 01_4" && parameter == "dur_4"
}

#[test]
fn recorded_boxes_are_inside_and_maximal_up_to_their_precision() {
    let Some(data) = shared::data() else { return };
    let boxes = recorded_boxes(&data);
    let (mut inside, mut outside) = (0, 0);
    for instance in figure_3(&data) {
        let Some(recorded) = boxes.get(&instance.name) else {
            continue;
        };
        let Case { task, plan } = read(&instance, &plan_text(&instance));
        let mut oracle = Oracle::new(&task, &plan, Guarantee::Weak).expect("within reach");
        for recorded in recorded {
            let envelope = envelope_of(&plan, recorded);
            let objection = oracle.objection(&envelope).expect("within reach");
            assert_eq!(objection, None, "{}: {recorded:?}", instance.name);
            inside += 1;
            for (index, parameter) in plan.parameters.iter().enumerate() {
                for side in Side::BOTH {
                    let end = BoxEnd {
                        parameter: ParameterId::from(index),
                        side,
                    };
                    let reach =
                        end.reach(&envelope).expect("finite") + left_open(&parameter.nominal);
                    let shifted = end.with_reach(&envelope, Some(reach));
                    let objection = oracle.objection(&shifted).expect("within reach");
                    let freed = is_freed_by_us(&instance.name, &parameter.name);
                    assert!(
                        objection.is_some() || freed,
                        "{}: {} can move further {side:?}",
                        instance.name,
                        parameter.name
                    );
                    outside += usize::from(objection.is_some());
                }
            }
        }
    }
    println!("{inside} recorded boxes inside, {outside} shifted ones not");
    assert!(inside >= 50 && outside >= 300);
}

/// Returns the smallest step that a run with β = 1 rejected at both ends: the smallest of `nominal
/// · 2^k` that is not below 1.
fn left_open(nominal: &Rational) -> Rational {
    let half = Rational::new(1, 2);
    let mut step = nominal.clone().max(Rational::ONE);
    while &step * &half >= Rational::ONE {
        step *= &half;
    }
    step
}

#[test]
fn same_search_finds_same_fractions() {
    let Some(data) = shared::data() else { return };
    let boxes = recorded_boxes(&data);
    let (mut in_file_order, mut in_other_order, mut unfinished) = (0, 0, 0);
    for instance in figure_3(&data) {
        let text = plan_text(&instance);
        let Some(recorded) = boxes.get(&instance.name) else {
            // Their runs did not finish; ours must.
            search(&read(&instance, &text));
            unfinished += 1;
            continue;
        };
        let known: Vec<Recorded> = recorded
            .iter()
            .map(|recorded| without_freed(&instance.name, recorded.clone()))
            .collect();
        let found = |text: &str| {
            let found = search(&read(&instance, text));
            known.contains(&without_freed(&instance.name, found))
        };
        if found(&text) {
            in_file_order += 1;
        } else {
            // Their tool picks parameters in the order of a Python set, which differs between runs.
            // One of the orders must give the recorded box.
            assert!(
                reordered(&text).iter().any(|text| found(text)),
                "{}: no order of the parameters gives the recorded box",
                instance.name
            );
            in_other_order += 1;
        }
    }
    println!(
        "same box: {in_file_order} in file order, {in_other_order} in another; \
         {unfinished} that their tool did not finish"
    );
    assert_eq!((in_file_order, in_other_order, unfinished), (46, 5, 1));
}

/// Runs the search with the authors' settings.
fn search(case: &Case) -> Recorded {
    let mut oracle = Oracle::new(&case.task, &case.plan, Guarantee::Weak).expect("within reach");
    let run = irr(&mut oracle, &Settings::default(), &mut |_| {
        ControlFlow::Continue(())
    })
    .expect("within reach");
    let envelope = run.envelope.expect("the start point is inside");
    let named = case.plan.parameters.iter().zip(envelope.intervals());
    named
        .filter_map(|(parameter, interval)| {
            let ends = (
                interval.lower.value()?.clone(),
                interval.upper.value()?.clone(),
            );
            Some((parameter.name.clone(), ends))
        })
        .collect()
}

fn without_freed(instance: &str, mut recorded: Recorded) -> Recorded {
    recorded.retain(|parameter, _| !is_freed_by_us(instance, parameter));
    recorded
}

/// Returns the plan file with its parameters declared in other orders: all orders for up to four
/// parameters, all exchanges of two for more.
fn reordered(text: &str) -> Vec<String> {
    let (parameters, rest): (Vec<&str>, Vec<&str>) =
        text.lines().partition(|line| line.starts_with("parameter"));
    let orders: Vec<Vec<&str>> = if parameters.len() <= 4 {
        permutations(&parameters)
    } else {
        let pairs =
            (0..parameters.len()).flat_map(|i| (i + 1..parameters.len()).map(move |j| (i, j)));
        pairs
            .map(|(i, j)| {
                let mut order = parameters.clone();
                order.swap(i, j);
                order
            })
            .collect()
    };
    orders
        .iter()
        .map(|order| [&order[..], &rest].concat().join("\n"))
        .collect()
}

fn permutations<'a>(items: &[&'a str]) -> Vec<Vec<&'a str>> {
    if items.is_empty() {
        return vec![Vec::new()];
    }
    (0..items.len())
        .flat_map(|first| {
            let mut others = items.to_vec();
            let chosen = others.remove(first);
            permutations(&others)
                .into_iter()
                .map(move |rest| [vec![chosen], rest].concat())
        })
        .collect()
}
