//! A robot that assembles a product before a window closes (Tables 1 and 2 of paper 1), from plans
//! with fixed times.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

use crate::shared;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::shared::case::{Case, number};
use elbowroom::pipeline::{PipelineError, free, open};
use elbowroom::{Explainer, plan::parametrize::VarySpec};
use elbowroom_envelope::limits;
use elbowroom_model::Task;
use elbowroom_model::ground::Change;
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_plan};
use elbowroom_plan::{BoxEnd, ParameterId, Side};

/// The four productions are concurrent. For the domain with uncertain durations.
const DURATION_PLAN: &str = "golden_reference_runs/rcll/plan_o0.plan";

/// The six productions are concurrent. For the domain with uncertain consumption.
const RESOURCE_PLAN: &str = "
      0.000: (collect_order r0 s0 o0) [60.000]
     60.001: (goto_waypoint r0 s0 bs0) [20.000]
     80.002: (produce_base_1 r0 bs0 o0) [170.000]
     80.003: (produce_base_2 r0 bs0 o0) [160.000]
     80.004: (produce_base_3 r0 bs0 o0) [150.000]
     80.005: (produce_base_4 r0 bs0 o0) [140.000]
     80.006: (produce_base_5 r0 bs0 o0) [130.000]
     80.007: (produce_base_6 r0 bs0 o0) [120.000]
    250.003: (goto_waypoint r0 bs0 rs0) [20.000]
    270.004: (stack_ring r0 rs0 o0) [120.000]
    390.005: (goto_waypoint r0 rs0 ow0) [20.000]
    410.006: (deliver_order r0 ow0 o0) [1.000]";

/// Returns the deordered plan with some parameters.
fn opened(
    domain: &Path,
    problem: &Path,
    plan: &str,
    specs: &[&str],
) -> Result<Case, PipelineError> {
    let task = shared::task(domain, problem).expect("a readable problem");
    let (plan, _) = read_plan(&Source::new("plan", plan), &task).expect("a readable plan");
    let specs: Result<Vec<VarySpec>, _> = specs.iter().map(|spec| spec.parse()).collect();
    let freed = free(&task, &plan)?;
    let plan = open(&task, freed, &specs?)?;
    Ok(Case {
        task: Arc::new(task),
        plan: Arc::new(plan),
    })
}

const ALL_PRODUCTIONS: [&str; 4] = [
    "produce_base_1",
    "produce_base_2",
    "produce_base_3",
    "produce_base_4",
];

/// Returns the closing time of the window of order 0.
fn deadline(task: &Task) -> Rational {
    let closes = |change: &Change| match change {
        Change::Delete(fact) => task.fact_name(*fact) == "(open ow0)",
        _ => false,
    };
    let timed = task.timed().iter();
    let mut closing = timed.filter(|timed| timed.changes.iter().any(closes));
    closing.next().expect("the window closes").time.clone()
}

/// Returns the limit of the upper end of the parameter in the largest box around its nominal
/// values.
fn upper_limit(case: &Case, parameter: usize) -> String {
    let [_, sharp] = case.found("1");
    let mut oracle = case.oracle();
    let end = BoxEnd {
        parameter: ParameterId::from(parameter),
        side: Side::Upper,
    };
    let steps = vec![Rational::ONE; sharp.intervals().len()];
    let explainer = Explainer::new(&case.task, &case.plan);
    let mut words = None;
    limits(
        &mut oracle,
        &sharp,
        (&[end], &steps),
        &mut || ControlFlow::Continue(()),
        &mut |end, limit| words = explainer.limit(end.parameter, end.side, limit),
    );
    words.expect("it is limited")
}

fn duration_files(data: &Path) -> (PathBuf, PathBuf, String) {
    let envelopes = data.join("envelopes");
    let plan = std::fs::read_to_string(envelopes.join(DURATION_PLAN)).expect("a plan");
    let folder = envelopes.join("rcll_duration");
    let problem = folder.join("problems/problem_lp0.05_hp0.95.pddl");
    (folder, problem, plan)
}

/// Returns the maximum duration of each concurrent production until the deadline.
///
/// Collecting takes 60, three drives 60, stacking 60: 180. Three separations are on the path
/// through the first production: stacking requires at its start that the robot has arrived, the
/// drive away deletes the position that stacking requires at its end, and delivering requires an
/// open window. Each further production starts ε after the previous one.
fn duration_limits(deadline: &Rational) -> [Rational; 4] {
    let first = deadline - number("180.003");
    [0, 1, 2, 3].map(|place| &first - Rational::new(place, 1000))
}

#[test]
fn relaxed_and_hand_written_durations_give_same_slack() {
    let Some(data) = shared::data() else { return };
    let (folder, problem, plan) = duration_files(&data);
    for domain in ["domain_rcll_simple.pddl", "domain_rcll_simple_robust.pddl"] {
        let case = opened(&folder.join(domain), &problem, &plan, &ALL_PRODUCTIONS);
        let case = case.expect("a valid plan");
        let deadline = deadline(&case.task);
        assert_eq!(deadline, number("420.389474456"));
        let [first, second, third, fourth] = duration_limits(&deadline);
        assert_eq!(
            case.limits(),
            format!("dur_2=[0,{first}] dur_3=[0,{second}] dur_4=[0,{third}] dur_5=[0,{fourth}]"),
            "{domain}"
        );
        for parameter in 0..4 {
            let limit = upper_limit(&case, parameter);
            let begins = "deadline of (open ow0) at 420.389474";
            assert!(limit.starts_with(begins), "{domain}: {limit}");
        }
    }
}

/// Returns the problem files of a folder.
fn problems(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder of problems");
    let mut paths: Vec<_> = entries
        .map(|entry| entry.expect("readable").path())
        .collect();
    paths.sort();
    paths
}

#[test]
fn slack_follows_deadline_and_missing_slack_names_it() {
    let Some(data) = shared::data() else { return };
    let (folder, _, plan) = duration_files(&data);
    let domain = folder.join("domain_rcll_simple.pddl");
    for (problem_folder, expected) in [
        ("problems", (100, 0)),
        ("problems_1_param", (40, 60)),
        ("problems_2_param", (80, 20)),
    ] {
        let (mut met, mut missed) = (0, 0);
        for problem in problems(&folder.join(problem_folder)) {
            let closes = deadline(&shared::task(&domain, &problem).expect("a readable problem"));
            match opened(&domain, &problem, &plan, &["produce_base_1"]) {
                Ok(case) => {
                    let [limit, ..] = duration_limits(&closes);
                    // Earlier ends of the other productions do not affect this one.
                    assert_eq!(case.limits(), format!("dur_2=[0,{limit}]"));
                    met += 1;
                }
                Err(error) => {
                    let message = error.to_string();
                    assert!(matches!(error, PipelineError::Invalid(_)), "{message}");
                    assert!(message.contains("(open ow0)"), "{message}");
                    // Nominally the delivery starts at 350.006.
                    assert!(closes < number("350.006"), "{message}");
                    missed += 1;
                }
            }
        }
        println!("{problem_folder}: {met} meet the deadline, {missed} miss it");
        assert_eq!((met, missed), expected, "{problem_folder}");
    }
}

fn resource_files(data: &Path, rate: &str) -> (PathBuf, PathBuf) {
    let folder = data.join("envelopes/rcll_resource");
    let problem = folder.join(format!("problems/problem_extra_fuel_rate_{rate}.pddl"));
    (folder, problem)
}

/// Returns the maximum consumption of the first production. The battery holds 160 + 20 · rate, 9
/// less in the beginning. The other productions take 40 + 20 + 20 + 20, and delivering needs 30.
fn consumption_limit(rate: &str) -> Rational {
    let charge = number("151") + number("20") * number(rate);
    charge - number("100") - number("30")
}

#[test]
fn consumption_may_deviate_by_the_spare_charge() {
    let Some(data) = shared::data() else { return };
    for (rate, limit) in [("0.00", "21"), ("0.37", "28.4"), ("1.00", "41")] {
        let limit = number(limit);
        assert_eq!(consumption_limit(rate), limit);
        let (folder, problem) = resource_files(&data, rate);
        // An order may be stacked up to a weight of 110, and is delivered from 60 on.
        let varied = opened(
            &folder.join("domain_rcll_simple_resource_2_param.pddl"),
            &problem,
            RESOURCE_PLAN,
            &[
                "constant produce_base_1 charge_level",
                "constant produce_base_2 order_weight",
            ],
        );
        assert_eq!(
            varied.expect("a valid plan").limits(),
            format!("n2.charge_level=[0,{limit}] n3.order_weight=[60,110]")
        );
        let given = opened(
            &folder.join("domain_rcll_simple_resource_2_param_robust.pddl"),
            &problem,
            RESOURCE_PLAN,
            &["?refueling_rate=20", "?weight_rate=80", "deliver_order"],
        );
        assert_eq!(
            given.expect("a valid plan").limits(),
            format!("n2.?refueling_rate=[0,{limit}] n3.?weight_rate=[60,110] dur_11=[1/1000,inf]")
        );
    }
}

#[test]
fn durations_and_consumption_vary_together() {
    let Some(data) = shared::data() else { return };
    let (folder, problem) = resource_files(&data, "0.80");
    let case = opened(
        &folder.join("domain_rcll_simple_resource_2_param.pddl"),
        &problem,
        RESOURCE_PLAN,
        &[
            "produce_base_1",
            "constant produce_base_1 charge_level",
            "constant produce_base_2 order_weight",
        ],
    )
    .expect("a valid plan");
    // Collecting takes 60, three drives 60, stacking 120. Arriving and leaving are ε from the start
    // and the end of collecting, producing and stacking (five times; nothing comes before
    // collecting), and delivering starts ε before the deadline.
    let latest = number("460") - number("240.006");
    // In the plan the production ends, and consumes charge, after the others have ended, because
    // those need the battery throughout. The plan keeps this order even though there is charge
    // enough for any other: the second starts ε later and takes 160.
    let shortest = number("160.001");
    let consumption = consumption_limit("0.80");
    assert_eq!(
        case.limits(),
        format!(
            "dur_2=[{shortest},{latest}] n2.charge_level=[0,{consumption}] \
             n3.order_weight=[60,110]"
        )
    );
    assert!(upper_limit(&case, 0).starts_with("deadline of (open ow0) at 460"));
}

#[test]
fn validator_rejects_consumption_beyond_the_battery() {
    let Some(data) = shared::data() else { return };
    let (folder, problem) = resource_files(&data, "0.37");
    let case = opened(
        &folder.join("domain_rcll_simple_resource_2_param.pddl"),
        &problem,
        RESOURCE_PLAN,
        &["constant produce_base_1 charge_level"],
    )
    .expect("a valid plan");
    let why_not = case.why_not("n2.charge_level=[0,28.41]").expect("too much");
    assert_eq!(
        why_not.reason,
        "start of (deliver_order r0 ow0 o0) needs (>= (charge_level r0) 30)"
    );
}
