//! The boxes that our search finds on the paper's instances, as Z3 sees them through the authors'
//! encoding.
//!
//! The encoding grows with the square of the plan and Z3 has to find the order of its time points,
//! so only plans with few time points are asked about, each within a time limit.

use std::ops::ControlFlow;
use std::path::Path;

use elbowroom_envelope::{Oracle, Settings, irr};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_plan::reduction::{BoxEnd, Side};
use elbowroom_plan::{DecoupledEnvelope, ParameterId, ParametrizedPlan, format};

use crate::instances::{Instance, figure_3};
use crate::plain::corners;
use crate::smt::Encoding;
use crate::z3::{Found, Z3};

/// The most time points of a plan that is asked about.
const MOST_NODES: usize = 12;

#[test]
fn the_boxes_of_figure_3_are_inside_by_the_authors_encoding_and_cannot_grow() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    if !data.is_dir() {
        println!("skipped: there is no {}", data.display());
        return;
    }
    let Some(mut solver) = Z3::start() else {
        println!("skipped: there is no z3 here");
        return;
    };
    let (mut inside, mut outside, mut undecided) = (0, 0, 0);
    for instance in figure_3(&data) {
        let (task, plan) = read(&instance);
        if plan.plan.nodes.len() > MOST_NODES {
            continue;
        }
        let epsilon = Rational::new(1, 1000);
        let mut oracle = Oracle::new(&task, &plan, &epsilon).expect("within reach");
        let run = irr(&mut oracle, &Settings::default(), &mut |_| {
            ControlFlow::Continue(())
        });
        let envelope = run
            .expect("within reach")
            .envelope
            .expect("it works as planned");
        let encoding = Encoding::new(&task, &plan, &epsilon).expect("covered");
        match contained(&encoding, &envelope, &mut solver) {
            Some(verdict) => {
                assert!(
                    verdict,
                    "{}: Z3 says that the box is not inside",
                    instance.name
                );
                inside += 1;
            }
            None => undecided += 1,
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
            match contained(&encoding, &shifted, &mut solver) {
                Some(verdict) => {
                    assert_eq!(
                        verdict, ours,
                        "{}: parameter {index} moved out",
                        instance.name
                    );
                    outside += usize::from(!verdict);
                }
                None => undecided += 1,
            }
        }
    }
    println!("Z3 finds {inside} boxes inside and {outside} widened ones outside; {undecided} open");
    assert!(
        inside >= 10 && outside >= 15,
        "{inside} {outside} {undecided}"
    );
}

fn read(instance: &Instance) -> (Task, ParametrizedPlan) {
    let bytes = |path: &Path| std::fs::read(path).expect("a benchmark file");
    let source = |path: &Path| Source::from_bytes(path.display().to_string(), &bytes(path));
    let (problem, _) = read_problem(&source(&instance.domain), &source(&instance.problem))
        .expect("a readable problem");
    let mut task = Task::new(problem);
    let plan = format::read(&bytes(&instance.plan), &mut task).expect("a readable plan");
    (task, plan)
}

/// Whether the box is inside; `None` if Z3 cannot tell in time.
fn contained(encoding: &Encoding, envelope: &DecoupledEnvelope, solver: &mut Z3) -> Option<bool> {
    // The values with a schedule form a convex set: the corners decide.
    for corner in corners(envelope) {
        match solver.ask(&encoding.scheduled(&DecoupledEnvelope::point(&corner))) {
            Found::Model => {}
            Found::NoModel => return Some(false),
            Found::Unknown => return None,
        }
    }
    match solver.ask(&encoding.broken(envelope)) {
        Found::Model => Some(false),
        Found::NoModel => Some(true),
        Found::Unknown => None,
    }
}
