//! The boxes that the search finds on the paper's instances, checked by Z3 with the authors'
//! encoding.
//!
//! Z3 has a time limit for each query (`ELBOWROOM_Z3_MILLISECONDS`). The generators, whose numbers
//! change continuously, take it up to half a minute. So only generators of up to `ELBOWROOM_NODES`
//! time points are checked, and only for the smallest ones, the test also checks whether their
//! boxes can grow. `ELBOWROOM_INSTANCES` is a prefix of the instance names.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use elbowroom_envelope::{Guarantee, Oracle, Settings, irr};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParameterId, ParametrizedPlan, Side, format};

use crate::sampled::one_in;
use crate::second_oracle::instances::{Instance, figure_3, figure_4};
use crate::second_oracle::setting;
use crate::second_oracle::smt::contained;
use crate::second_oracle::z3::Z3;
use crate::skipped::skipped;

/// Default limit on the time points of a generator plan that is checked.
const MAX_NODES: u64 = 12;

#[test]
fn boxes_are_inside_and_maximal_by_published_encoding() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    if !data.is_dir() {
        skipped(format_args!("there is no {}", data.display()));
        return;
    }
    let Some(mut solver) = Z3::start() else {
        skipped("there is no z3 here");
        return;
    };
    let most_nodes = setting("ELBOWROOM_NODES", MAX_NODES);
    let epsilon = Rational::new(1, 1000);
    let mut tally = Tally::default();
    let wanted = std::env::var("ELBOWROOM_INSTANCES").unwrap_or_default();
    let instances = figure_3(&data).into_iter().chain(figure_4(&data));
    for instance in instances.step_by(one_in(3)) {
        if !instance.name.starts_with(&wanted) {
            continue;
        }
        let Some((task, plan)) = read(&instance) else {
            continue;
        };
        let nodes = plan.plan.nodes.len() as u64;
        let is_generator = instance.name.starts_with("generator");
        if is_generator && nodes > most_nodes {
            continue;
        }
        let mut oracle = Oracle::new(&task, &plan, Guarantee::Weak).expect("within reach");
        let run = irr(&mut oracle, &Settings::default(), &mut |_| {
            ControlFlow::Continue(())
        });
        let Ok(envelope) = run.expect("within reach").envelope else {
            continue;
        };
        let mut ask =
            |envelope: &DecoupledEnvelope| contained(&task, &plan, &epsilon, envelope, &mut solver);
        tally.boxes += 1;
        match ask(&envelope) {
            Some(true) => tally.inside += 1,
            Some(false) => panic!("{}: Z3 says that the box is not inside", instance.name),
            None => tally.open.push(instance.name.clone()),
        }
        let (inside, boxes) = (tally.inside, tally.boxes);
        println!("{}: {inside} of {boxes} boxes inside", instance.name);
        if is_generator && nodes > MAX_NODES {
            continue;
        }
        for index in 0..plan.parameters.len() {
            let end = BoxEnd {
                parameter: ParameterId::from(index),
                side: Side::Upper,
            };
            let Some(reach) = end.reach(&envelope) else {
                continue;
            };
            let shifted = end.with_reach(&envelope, Some(reach + Rational::from(2)));
            let ours = oracle.objection(&shifted).expect("within reach").is_none();
            match ask(&shifted) {
                Some(theirs) => {
                    assert_eq!(
                        theirs, ours,
                        "{}: parameter {index} moved out",
                        instance.name
                    );
                    tally.shifted += 1;
                    tally.outside += usize::from(!theirs);
                }
                None => tally.open.push(format!("{}, end {index}", instance.name)),
            }
        }
    }
    println!("{tally:?}");
    let is_whole = wanted.is_empty();
    assert!(
        !is_whole || (tally.inside >= 5 && tally.outside >= 5),
        "{tally:?}"
    );
}

/// Z3's verdicts on the computed boxes.
#[derive(Debug, Default)]
#[allow(dead_code, reason = "printed")]
struct Tally {
    boxes: usize,
    inside: usize,
    shifted: usize,
    outside: usize,
    /// Boxes that Z3 could not decide in time.
    open: Vec<String>,
}

/// Reads an instance; `None` if its plan file is empty.
fn read(instance: &Instance) -> Option<(Arc<Task>, Arc<ParametrizedPlan>)> {
    let bytes = |path: &Path| std::fs::read(path).expect("a benchmark file");
    let text = bytes(&instance.plan);
    if text.iter().all(u8::is_ascii_whitespace) {
        return None;
    }
    let source = |path: &Path| Source::from_bytes(path.display().to_string(), &bytes(path));
    let (problem, _) = read_problem(&source(&instance.domain), &source(&instance.problem))
        .expect("a readable problem");
    let task = Task::new(problem);
    let plan = format::read(&text, &task).expect("a readable plan");
    Some((Arc::new(task), Arc::new(plan)))
}
