//! Test on the benchmark set.

use crate::document;
use crate::skipped::skipped;
use crate::survey;
use insta::assert_snapshot;

#[test]
fn every_benchmark_is_read_unless_it_is_wrong_or_uses_a_refused_feature() {
    let Some(folder) = survey::folder() else {
        skipped("there is no benchmark set; set ELBOWROOM_SHARED to its folder");
        return;
    };
    let survey = survey::survey(&folder);
    let instances: usize = survey.domains.iter().map(|domain| domain.instances).sum();
    let read: usize = survey.domains.iter().map(|domain| domain.read).sum();
    assert_eq!((instances, read), (827, 812));
    assert_eq!(survey.plans, (164, 164));
    let reasons: Vec<_> = document::reasons(&survey)
        .iter()
        .map(|(reason, count)| format!("{count} {reason}"))
        .collect();
    assert_snapshot!(reasons.join("\n"), @"15 mistakes");
    let mistaken: Vec<_> = survey
        .domains
        .iter()
        .flat_map(|domain| &domain.refused)
        .filter(|(_, errors)| survey::reason(errors) == "mistakes")
        .map(|(path, _)| path.as_str())
        .collect();
    assert_snapshot!(mistaken.join("\n"), @r"
    pddl-plus/1d-powered-descent/instances/prob_earth07.pddl
    pddl-plus/1d-powered-descent/instances/prob_earth14.pddl
    pddl-plus/1d-powered-descent/instances/prob_earth20.pddl
    pddl-plus/generator/instances/instance_1.pddl
    pddl-plus/generator/instances/instance_3.pddl
    pddl-plus/generator/instances/instance_6.pddl
    pddl-plus/generator/instances/instance_8.pddl
    rosplan/test_domain/instances/test_problem_invalid_syntax.pddl
    strathclyde/crew-planning-temporal-satisficing-2011/instances/instance-9.pddl
    tfd/rovers-object-fluent/instances/pfile2.pddl
    tfd/rovers-object-fluent/instances/pfile4.pddl
    tfd/rovers-object-fluent/instances/pfile6.pddl
    tfd/rovers-object-fluent/instances/pfile7.pddl
    tfd/rovers-object-fluent/instances/pfile9.pddl
    tfd/timed-initials-test/instances/problem.pddl
    ");
    let written = include_str!("../../../../docs/reference/pddl-support.md");
    assert!(
        written == document::document(Some(&survey)),
        "docs/reference/pddl-support.md is out of date: run the example pddl_support"
    );
}
