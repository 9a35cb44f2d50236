//! CCMMZ, the tool that computes whole envelopes: its examples, and its boxes in them.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

use crate::shared;
use std::collections::BTreeSet;
use std::path::Path;

use crate::shared::case::Case;
use crate::shared::instances::figure_3;
use elbowroom::parse_box;
use elbowroom_envelope::obligations::Requirement;
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, ParameterId, Side};

fn example(envelopes: &Path, folder: &str, plan: &str) -> Case {
    let folder = envelopes.join("ccmmz_examples").join(folder);
    let [domain, problem] = if folder.join("domain.pddl").exists() {
        ["domain.pddl", "problem.pddl"]
    } else {
        ["gen_linear_domain.pddl", "gen_linear_prob01.pddl"]
    };
    Case::read(
        &folder.join(domain),
        &folder.join(problem),
        &folder.join(plan),
    )
}

#[test]
fn plans_accepted_by_ccmmz_are_guaranteed() {
    let Some(data) = shared::data() else { return };
    for (folder, plan) in [
        ("paper", "plan.stn"),
        ("tils", "plan.stn"),
        ("generator_linear", "generator_linear.stn"),
        ("generator_instantaneous_action", "generator_linear.stn"),
    ] {
        let case = example(&data.join("envelopes"), folder, plan);
        assert_eq!(case.broken(), None, "{folder}/{plan}");
    }
}

#[test]
fn plans_rejected_by_ccmmz_violate_the_reported_requirement() {
    let Some(data) = shared::data() else { return };
    let broken = |plan: &str| {
        let case = example(&data.join("envelopes"), "generator_linear", plan);
        let broken = case.broken();
        let why_not = case.why_not("").expect("it is not valid");
        (broken.expect("it is not valid"), why_not.reason)
    };
    // Refuelled from 4 on, the tank is full before the end of refuelling, with no happening in
    // between.
    let (requirement, reason) = broken("bug1.stn");
    assert!(matches!(requirement, Requirement::OverAll { .. }));
    assert_eq!(
        reason,
        "(refuel gen tank1) needs (< (fuellevel gen) (capacity gen)) throughout"
    );
    // Refuelled from 991 on, the generator is empty. (The tool calls this an action condition: at a
    // happening inside the action, here the start of refuelling, it treats an over-all condition as
    // an action condition, and as an invariant only between happenings.)
    let (requirement, reason) = broken("bug2.stn");
    assert!(matches!(requirement, Requirement::OverAll { .. }));
    assert_eq!(
        reason,
        "(generate gen) needs (>= (fuellevel gen) 0) throughout"
    );
    // Refuelling may take 6, where the domain allows 5.
    let (requirement, reason) = broken("bug3.stn");
    assert!(matches!(requirement, Requirement::Duration { .. }));
    assert_eq!(reason, "(refuel gen tank1) must obey its domain's duration");
}

#[test]
fn the_running_example_of_the_paper_covers_a_distance_of_100_to_150() {
    let Some(data) = shared::data() else { return };
    let folder = data.join("envelopes/ccmmz_examples/paper");
    let plan = std::fs::read_to_string(folder.join("plan.stn")).expect("a plan");
    let plan = format!("parameter ?s default 2;\n{plan}");
    let case = Case::of_text(
        &folder.join("domain_param.pddl"),
        &folder.join("problem.pddl"),
        &plan,
    );
    // Five drives of 10 at speed ?s.
    assert_eq!(case.limits(), "?s=[2,3]");
    let golden = data.join("envelopes/golden_reference_runs/paper_plan_param_defaults.stn");
    let case = Case::read(
        &folder.join("domain.pddl"),
        &folder.join("problem.pddl"),
        &golden,
    );
    // At speed 2, 40 come from two drives of 10, and the other three last 30 to 55 together.
    assert!(case.has_inside("dur_n1=[10,20] dur_n2=[10,20] dur_n3=[10,15]"));
    for beyond in ["dur_n1=[10,35.001]", "dur_n2=[9.999,10]"] {
        let why_not = case.why_not(beyond).expect("too far, or not far enough");
        assert!(why_not.reason.starts_with("the goal"), "{}", why_not.reason);
    }
    assert!(case.has_inside("dur_n1=[10,35]"));
}

/// Returns the distinct boxes of finished runs, with the instance's name.
fn recorded_boxes(data: &Path) -> BTreeSet<(String, String)> {
    let path = data.join("envelopes/paper_runs/aaai_runs.csv");
    let text = std::fs::read_to_string(&path).expect("the table of runs");
    let rows = text.lines().skip(1).filter_map(|line| {
        let fields: Vec<&str> = line.split(',').collect();
        let found = line.split('"').nth(1)?;
        let is_finished = fields[2] == "CCMMZ" && fields[4] == "ok";
        is_finished.then(|| (format!("{} {}", fields[0], fields[1]), found.to_owned()))
    });
    rows.collect()
}

#[test]
fn boxes_of_ccmmz_are_inside_and_maximal() {
    let Some(data) = shared::data() else { return };
    let recorded = recorded_boxes(&data);
    let (mut inside, mut away, mut borders, mut same) = (0, 0, 0, 0);
    for instance in figure_3(&data) {
        for (_, found) in recorded.iter().filter(|(name, _)| *name == instance.name) {
            let case = Case::read(&instance.domain, &instance.problem, &instance.plan);
            let envelope = parse_box(found, &case.plan).expect("a box");
            let name = format!("{}: {found}", instance.name);
            assert_eq!(case.why_not(found), None, "{name}");
            case.assert_withstands(&envelope);
            inside += 1;
            if !envelope.contains(&case.plan.nominal()) {
                away += 1;
            } else if case.plan.parameters.len() == 1 {
                assert_eq!(parse_box(&case.limits(), &case.plan), Ok(envelope.clone()));
                same += 1;
            }
            let mut oracle = case.oracle();
            for index in 0..case.plan.parameters.len() {
                for side in Side::BOTH {
                    let end = BoxEnd {
                        parameter: ParameterId::from(index),
                        side,
                    };
                    let reach = end.reach(&envelope).expect("finite");
                    let wider =
                        end.with_reach(&envelope, Some(reach + Rational::new(1, 1_000_000)));
                    let objection = oracle.objection(&wider).expect("within reach");
                    assert!(objection.is_some(), "{name}: {side:?} end of {index}");
                    borders += 1;
                }
            }
        }
    }
    println!(
        "{inside} boxes inside, {away} of them without the nominal point; {borders} ends on \
         borders; {same} times the whole envelope around the nominal point, which ours is too"
    );
    assert_eq!(inside, recorded.len());
}
