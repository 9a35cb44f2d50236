use std::sync::Arc;

use super::{ParametrizeError, VarySpec, parametrize};
use crate::format;
use crate::network::Schedule;
use crate::parameter::{ParameterKind, ParametrizedPlan};
use crate::stn_plan::{Bound, InstanceId, Reason, StnPlan};
use crate::testing::{number, rover};

/// Returns a plan of two collections, a refuelling and a beep, with a nominal schedule.
fn plan() -> (StnPlan, Schedule) {
    let text = "
        durative-action instance n0 : (collect S1);
        durative-action instance n1 : (collect s2);
        durative-action instance n2 : (refuel s2);
        action instance n3 : (beep);
        parameter n2.?r default 4;";
    let mut plan = format::read(text.as_bytes(), &rover()).unwrap().plan;
    // Restores the open number of the refuelling, as in a plan that was not read from a file.
    let task = rover();
    for instance in &mut plan.instances {
        let action = &instance.action;
        let action = task.instantiate(action.schema, &action.arguments);
        instance.action = Arc::new(action.unwrap());
    }
    let nominal = ["0", "1", "16", "20", "35", "0", "10", "7", "100"];
    (plan, nominal.into_iter().map(number).collect())
}

fn varied(specs: &[&str]) -> Result<ParametrizedPlan, ParametrizeError> {
    let (plan, nominal) = plan();
    let specs: Result<Vec<VarySpec>, _> = specs.iter().map(|spec| spec.parse()).collect();
    parametrize(&rover(), plan, &nominal, &specs?)
}

/// Returns `name=nominal` for each parameter except the refuelling's open number.
fn summary(specs: &[&str]) -> String {
    let open = [specs, &["?r=4"]].concat();
    let plan = varied(&open).unwrap_or_else(|error| panic!("{error}"));
    let all: Vec<_> = plan
        .parameters
        .iter()
        .filter(|parameter| parameter.name != "n2.?r")
        .map(|parameter| format!("{}={}", parameter.name, parameter.nominal))
        .collect();
    all.join(" ")
}

fn mistake(specs: &[&str]) -> String {
    varied(specs).unwrap_err().to_string()
}

#[test]
fn without_a_specification_all_durations_vary() {
    assert_eq!(summary(&[]), "dur_0=15 dur_1=15 dur_2=10");
    assert_eq!(summary(&["durations"]), summary(&[]));
}

#[test]
fn durations_are_chosen_by_action_arguments_or_label() {
    assert_eq!(summary(&["collect"]), "dur_0=15 dur_1=15");
    assert_eq!(summary(&["duration (COLLECT s1)"]), "dur_0=15");
    assert_eq!(
        summary(&["(collect _)", "n2"]),
        "dur_0=15 dur_1=15 dur_2=10"
    );
    assert_eq!(summary(&["duration n1"]), "dur_1=15");
}

#[test]
fn varied_duration_replaces_bounds_of_domain() {
    let plan = varied(&["n1 weight 3 in [10, inf]", "?r=4"]).unwrap();
    let parameter = &plan.parameters[0];
    assert_eq!(parameter.kind, ParameterKind::Duration(InstanceId(1)));
    assert_eq!(
        (parameter.weight.to_string(), parameter.range.to_string()),
        ("3".to_owned(), "[10, inf)".to_owned())
    );
    let instance = &plan.plan.instances[1];
    assert!(instance.action.durative().unwrap().duration.is_empty());
    let set = plan.plan.constraints.last().unwrap();
    assert_eq!(set.reason, Reason::Duration(InstanceId(1)));
    assert!(matches!(
        (&set.lower, &set.upper),
        (Bound::Parameter(_), Bound::Parameter(_))
    ));
}

#[test]
fn a_later_specification_overrides_weight_and_range() {
    let plan = varied(&["durations weight 2", "n1 weight 5", "?r=4"]).unwrap();
    let weights: Vec<_> = plan
        .parameters
        .iter()
        .map(|p| p.weight.to_string())
        .collect();
    assert_eq!(weights, ["2", "5", "2", "1"]);
}

#[test]
fn constants_in_effects_and_conditions_become_parameters() {
    assert_eq!(summary(&["constant refuel fuel"]), "n2.fuel=3");
    assert_eq!(
        summary(&["condition (refuel _) fuel shared"]),
        "refuel.fuel=3"
    );
    assert_eq!(summary(&["constant beep distance 2"]), "n3.distance=2");
    let plan = varied(&["constant refuel fuel", "?r=4"]).unwrap();
    let refuel = plan.plan.instances[2].action.durative().unwrap();
    let effect = format!("{:?}", refuel.start.effects[0].change);
    assert!(effect.contains("Unknown(Parameter(0))"), "{effect}");
    assert!(format!("{:?}", refuel.start.condition).contains("Constant(3)"));
}

#[test]
fn initial_values_and_deadlines_become_parameters() {
    assert_eq!(
        summary(&["initial (fuel)", "initial fuel weight 2"]),
        "initial_fuel=7"
    );
    assert_eq!(summary(&["deadline (open)"]), "deadline_open=100");
    let plan = varied(&["timed open", "?r=4"]).unwrap();
    let fixed = plan
        .plan
        .constraints
        .iter()
        .find(|c| c.reason == Reason::Timed(0))
        .unwrap();
    assert!(matches!(
        (&fixed.lower, &fixed.upper),
        (Bound::Parameter(_), Bound::Parameter(_))
    ));
}

#[test]
fn open_numbers_need_a_nominal_value() {
    assert_eq!(
        mistake(&[]),
        "the domain leaves `n2.?r` open: give its nominal value with `--vary 'n2.?r=VALUE'`"
    );
    let plan = varied(&["n2.?r = 4.5 in [0, 9]"]).unwrap();
    let open = plan.find("n2.?r").unwrap();
    assert_eq!(plan.parameter(open).nominal, number("4.5"));
    assert_eq!(
        plan.parameter(open).kind,
        ParameterKind::Constant(InstanceId(2))
    );
}

#[test]
fn error_messages_name_the_expected_form() {
    let cases = [
        (
            "duration colect",
            "`--vary duration colect`: there is no action or label `colect`; did you mean `collect`?",
        ),
        (
            "(collect s9)",
            "`--vary (collect s9)`: there is no object `s9`; did you mean `S1`?",
        ),
        ("navigate", "`--vary navigate`: the plan has no such action"),
        ("beep", "`--vary beep`: `(beep)` is instantaneous"),
        (
            "constant refuel fuel 8",
            "`--vary constant refuel fuel 8`: `(refuel s2)` has no such number for `fuel`, only 3",
        ),
        (
            "n1 wieght 3",
            "invalid `--vary n1 wieght 3`: expected `weight W`, `in [LB, UB]` or the end",
        ),
        (
            "n1 in [4, 2]",
            "invalid `--vary n1 in [4, 2]`: expected `[LB, UB]`",
        ),
        (
            "n1 in [20, 30]",
            "`dur_1` is nominally 15, which is not in its range [20, 30]",
        ),
        (
            "deadline (navigating)",
            "`--vary deadline (navigating)`: no timed initial makes it false",
        ),
        (
            "?q=3",
            "`--vary ?q=3`: there is no open number `?q`; did you mean `?s`?",
        ),
    ];
    for (spec, message) in cases {
        assert_eq!(mistake(&[spec]), message);
    }
}
