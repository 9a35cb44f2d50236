//! Benchmark plans at their nominal values: each is guaranteed, or the violated requirement is
//! named.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

use crate::shared;
use std::collections::BTreeMap;
use std::path::Path;

use crate::shared::case::Case;
use crate::shared::instances::figure_4;
use elbowroom_plan::DecoupledEnvelope;

/// Counts the plans by the reason why they are not guaranteed; the empty text stands for guaranteed
/// ones.
fn verdicts(cases: impl Iterator<Item = (String, Case)>) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for (name, case) in cases {
        let reason = match case.why_not("") {
            None => {
                case.assert_withstands(&DecoupledEnvelope::point(&case.plan.nominal()));
                String::new()
            }
            Some(why_not) => {
                assert!(!why_not.reason.is_empty(), "{name}: {why_not:?}");
                println!("{name}: {}", why_not.reason);
                why_not.reason
            }
        };
        *counts.entry(reason).or_default() += 1;
    }
    counts
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder of plans");
    let mut names: Vec<String> = entries
        .map(|entry| {
            entry
                .expect("readable")
                .file_name()
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    names.sort();
    names
}

#[test]
fn auv_plans_are_guaranteed_unless_charge_is_too_low() {
    let Some(data) = shared::data() else { return };
    let folder = data.join("envelopes/auv");
    let read = |name: &String| {
        let (mission, _) = name.rsplit_once("_var").expect("stn_plan_MISSION_varNN");
        let mission = mission.trim_start_matches("stn_plan_");
        let case = Case::read(
            &folder.join("domains/pandora_domain_strategic_for_validation.pddl"),
            &folder.join(format!("problems/{mission}.pddl")),
            &folder.join("stns").join(name),
        );
        (name.clone(), case)
    };
    // From `var00` to `var09`, more and more durations may be longer.
    let (rigid, flexible): (Vec<_>, Vec<_>) = names(&folder.join("stns"))
        .into_iter()
        .partition(|name| name.ends_with("_var00"));
    let counts = verdicts(rigid.iter().map(read));
    assert_eq!(counts, BTreeMap::from([(String::new(), rigid.len())]));
    let mut counts = verdicts(flexible.iter().map(read));
    let guaranteed = counts.remove("").unwrap_or(0);
    let uncharged: usize = counts.values().sum();
    println!(
        "{} rigid ones guaranteed; of the flexible ones, {guaranteed}, not {uncharged}",
        rigid.len()
    );
    for reason in counts.keys() {
        assert!(reason.contains(" needs (>= (charge auv) "), "{reason}");
    }
    assert!(rigid.len() >= 20 && guaranteed >= 121 && uncharged >= 59);
}

#[test]
fn deliveries_are_guaranteed_or_miss_a_named_deadline() {
    let Some(data) = shared::data() else { return };
    let cases = figure_4(&data).into_iter().map(|instance| {
        let case = Case::read(&instance.domain, &instance.problem, &instance.plan);
        (instance.name, case)
    });
    // Some files contain no plan.
    let (cases, empty): (Vec<_>, Vec<_>) =
        cases.partition(|(_, case)| !case.plan.plan.instances.is_empty());
    let mut counts = verdicts(cases.into_iter());
    let guaranteed = counts.remove("").unwrap_or(0);
    let late: usize = counts.values().sum();
    println!(
        "{guaranteed} guaranteed, {late} late, {} empty",
        empty.len()
    );
    for reason in counts.keys() {
        assert!(
            reason.starts_with("deadline of (delivery_destination "),
            "{reason}"
        );
    }
    for reason in verdicts(empty.into_iter()).keys() {
        assert!(reason.starts_with("the goal "), "{reason}");
    }
    assert!(guaranteed >= 29 && late >= 13);
}
