mod round_trip;

use elbowroom_num::{Interval, Rational};

use elbowroom_text::Diagnostics;

use super::{WriteError, read, write};
use crate::parameter::{Parameter, ParameterKind, ParametrizedPlan};
use crate::stn_plan::{Bound, Constraint, InstanceId, NodeId, Reason};
use crate::testing::{number, rover};

const PAPER: &str = "
    # The running example, with one of everything.
    parameter dur_1 weight 1/2 default 12 lb 0 ub 500;  parameter gap default 1;
    parameter ?s default 1.5;
    durative-action instance n0 : (NAVIGATE);
    durative-action instance cs1:(collect s1);   # objects compare without case
    action instance b : (beep);
    c: n0.end - n0.start in [dur_1, dur_1];
    c: cs1.start-n0.end in [ gap , +inf];
    c: b - .zero in [1 / 3, 40];
    c: b - cs1.end in [-inf, -.5]";

fn parsed(text: &str) -> ParametrizedPlan {
    read(text.as_bytes(), &rover()).unwrap_or_else(|errors| panic!("{errors}"))
}

fn refused(text: &str) -> String {
    let errors: Diagnostics = read(text.as_bytes(), &rover()).unwrap_err();
    errors.to_string()
}

#[test]
fn all_elements_of_format_are_read() {
    let plan = parsed(PAPER);
    let labels: Vec<_> = plan.plan.instances.iter().map(|i| &i.label[..]).collect();
    assert_eq!(labels, ["n0", "cs1", "b"]);
    assert_eq!(plan.plan.instances[1].action.name, "(collect S1)");
    let kinds: Vec<_> = plan.parameters.iter().map(|p| p.kind).collect();
    let duration = ParameterKind::Duration(InstanceId(0));
    assert_eq!(
        kinds,
        [duration, ParameterKind::Bound, ParameterKind::Domain]
    );
    assert_eq!(plan.parameters[0].weight, number("1/2"));
    assert_eq!(plan.parameters[0].range.to_string(), "[0, 500]");
    assert_eq!(plan.parameters[1].range, Interval::EVERYTHING);
    assert_eq!(plan.parameters[2].range.to_string(), "[0, inf)");
    let last = plan.plan.constraints.last().unwrap();
    assert_eq!(last.lower, Bound::Infinite);
    assert_eq!(last.upper, Bound::Finite(number("-1/2")));
}

#[test]
fn free_duration_ignores_bounds_of_domain() {
    let plan = parsed(PAPER);
    let durations = |index: usize| {
        plan.plan.instances[index]
            .action
            .durative()
            .unwrap()
            .duration
            .len()
    };
    assert_eq!((durations(0), durations(1)), (0, 1));
}

#[test]
fn open_number_of_domain_becomes_parameter() {
    let plan = parsed(PAPER);
    let navigate = plan.plan.instances[0].action.durative().unwrap();
    assert_eq!(
        format!("{:?}", navigate.continuous[0].rate),
        "Unknown(Parameter(2))"
    );
}

#[test]
fn open_number_of_action_is_separate_for_each_instance() {
    let plan = parsed(
        "durative-action instance a : (refuel s1); durative-action instance b : (refuel s2);
         parameter a.?r default 4; parameter B.?R default 5;",
    );
    let rate = |index: usize| {
        format!(
            "{:?}",
            plan.plan.instances[index]
                .action
                .durative()
                .unwrap()
                .end
                .effects[0]
                .change
        )
    };
    assert!(rate(0).contains("Parameter(0)"), "{}", rate(0));
    assert!(rate(1).contains("Parameter(1)"), "{}", rate(1));
    assert_eq!(
        plan.parameters[1].kind,
        ParameterKind::Constant(InstanceId(1))
    );
}

#[test]
fn nominal_values_come_from_the_domain_or_from_the_earliest_schedule() {
    let plan = parsed(
        "durative-action instance cs : (collect s1); durative-action instance ct : (collect s2);
         parameter dur; parameter free lb 3; parameter gap;
         c: cs.end - cs.start in [dur, dur];
         c: ct.start - cs.end in [gap, gap];
         c: ct.start - .zero in [20, inf];
         c: ct.end - .zero in [free, 60];",
    );
    let nominal: Vec<_> = plan.nominal().iter().map(ToString::to_string).collect();
    // The collection takes 15 by the initial state; the next action starts at 20, and no sooner.
    assert_eq!(nominal, ["15", "3", "5"]);
}

#[test]
fn several_mistakes_are_reported_in_one_run() {
    let text = "
parameter p wieght 3;
durative-action instance n0 : (navigat);
durative-action instance n1 : (collect s3)
action instance n2 : (collect s1);
c: n1.start - n0.end on [0, inf];
parameter q default;
c: n1.end - n1.start in [5, inf;
@@@ what;
";
    assert_eq!(
        refused(text),
        "\
text:2:13: error: `wieght` is not expected here; expected `weight`, `default`, `lb`, `ub` or `;`
text:3:32: error: the domain has no action `navigat`; did you mean `navigate`?
text:4:40: error: the problem has no object `s3`; did you mean `S1`?
text:4:43: error: this item does not end; expected `;`
text:5:23: error: `collect` takes time; write `durative-action instance`
text:6:22: error: `on` is not expected here; expected `in`
text:7:20: error: `;` is not expected here; expected a number such as 12.5 or 25/2
text:8:32: error: `;` is not expected here; expected `]`
text:9:1: error: `@@@` is not expected here; expected `parameter`, `durative-action instance`, \
`action instance` or `c:`"
    );
}

#[test]
fn a_mistake_shows_its_line() {
    let errors = read(
        b"# \xff is no UTF-8\naction instance b : (beeep);",
        &rover(),
    )
    .unwrap_err();
    let error = errors.errors().next().expect("a mistake");
    assert_eq!((error.line(), error.column(), error.length()), (2, 22, 5));
    assert!(
        error
            .render(false)
            .contains("2 | action instance b : (beeep);")
    );
}

#[test]
fn unknown_name_is_reported_with_similar_names() {
    let text = "
action instance b : (beep); action instance b : (beep); durative-action instance n : (collect s1);
parameter speed default 1; parameter speed default 2; parameter 7 default 1;
c: n - b.end in [sped, inf];
c: m.start - .zero in [inf, inf];";
    assert_eq!(
        refused(text),
        "\
text:2:45: error: two instances are labelled `b`; labels must differ
text:3:38: error: two parameters have the name `speed`; names must differ
text:3:65: error: `7` cannot be a parameter's name; choose another name
text:4:4: error: there is no time point `n`; `n` takes time: write `n.start` or `n.end`
text:4:8: error: there is no time point `b.end`; `b` is instantaneous: write `b`
text:4:18: error: there is no parameter `sped`; did you mean `speed`?
text:5:4: error: there is no time point `m.start`; did you mean `n.start`?
text:5:24: error: infinite bound with the wrong sign: no times satisfy it"
    );
}

#[test]
fn missing_value_of_open_number_is_refused() {
    let navigate = "durative-action instance n0 : (navigate);";
    assert_eq!(
        refused(navigate),
        "text:1:1: error: the domain leaves `?s` open; add `parameter ?s default VALUE;`"
    );
    assert_eq!(
        refused(&format!("parameter ?s;{navigate}")),
        "text:1:11: error: `?s` has no nominal value; give `default`"
    );
    assert_eq!(
        refused(&format!("parameter ?s default 3 ub 2;{navigate}")),
        "text:1:11: error: the default 3 of `?s` is not in its range [0, 2]; \
         change `default`, `lb` or `ub`"
    );
}

#[test]
fn written_plan_equals_read_plan() {
    let task = rover();
    let plan = parsed(PAPER);
    let text = write(&task, &plan).unwrap();
    assert_eq!(
        text,
        "\
parameter dur_1 weight 0.5 default 12 ub 500;
parameter gap default 1;
parameter ?s default 1.5;
durative-action instance n0 : (navigate);
durative-action instance cs1 : (collect S1);
action instance b : (beep);
c: n0.end - n0.start in [dur_1, dur_1];
c: cs1.start - n0.end in [gap, inf];
c: b - .zero in [1/3, 40];
c: b - cs1.end in [-inf, -0.5];
"
    );
    assert_eq!(parsed(&text), plan);
}

#[test]
fn timed_initials_are_written_as_absolute_times() {
    let task = rover();
    let mut plan = parsed("action instance a : (beep); action instance b : (beep);").plan;
    let (zero, a, b, timed) = (NodeId(0), NodeId(1), NodeId(2), NodeId(3));
    let mut add = |from, to, lower: &str, upper: Option<&str>| {
        plan.constraints.push(Constraint {
            from,
            to,
            lower: Bound::Finite(number(lower)),
            upper: upper.map_or(Bound::Infinite, |upper| Bound::Finite(number(upper))),
            reason: Reason::Interference,
        });
    };
    add(zero, a, "0", Some("99"));
    add(a, timed, "0.001", None);
    add(timed, b, "0.001", Some("7"));
    add(zero, timed, "3", None);
    let text = write(&task, &ParametrizedPlan::closed(&task, plan)).unwrap();
    assert_eq!(
        text,
        "\
action instance a : (beep);
action instance b : (beep);
c: a - .zero in [0, 99];
c: b - .zero in [100.001, 107];
"
    );
    let again = read(text.as_bytes(), &task).unwrap();
    assert_eq!(write(&task, &again).unwrap(), text);
}

#[test]
fn inexpressible_plan_is_refused() {
    let task = rover();
    let mut plan = parsed("action instance a : (beep);");
    plan.parameters.push(Parameter {
        name: "deadline".to_owned(),
        kind: ParameterKind::Timed(0),
        nominal: Rational::from(100),
        weight: Rational::ONE,
        range: Interval::EVERYTHING,
    });
    let names = vec!["deadline".to_owned()];
    assert_eq!(
        write(&task, &plan),
        Err(WriteError::NotExpressible { names })
    );
    plan.parameters.clear();
    plan.plan.instances[0].label = "a b".to_owned();
    let name = "a b".to_owned();
    assert_eq!(write(&task, &plan), Err(WriteError::Name { name }));
}

#[test]
fn unsatisfiable_bound_is_reported_at_its_position() {
    let text = "action instance b : (beep);
c: b - .zero in [9, 8];";
    assert_eq!(
        refused(text),
        "text:2:18: error: empty range: the lower bound 9 is above the upper bound 8; write the lower bound first"
    );
}
