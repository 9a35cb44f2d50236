use std::sync::Arc;

use elbowroom_model::Step;
use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;

use super::{DeorderError, Deordered, deorder, pin_until_sound, with_fixed_times};
use crate::format;
use crate::parameter::ParametrizedPlan;
use crate::stn_plan::{Bound, NodeId, Reason};
use crate::testing::{number, rover};
use crate::valuation::Valuation;

/// Parses a plan of the rover, with `start: action [duration]` on each line.
fn plan(text: &str) -> (elbowroom_model::Task, TimeTriggeredPlan) {
    let task = rover();
    let mut plan = TimeTriggeredPlan::default();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let (start, rest) = line.split_once(':').unwrap();
        let (action, duration) = rest.split_once('[').unwrap_or((rest, ""));
        let mut words = action.split_whitespace();
        let schema = task.problem().schema(words.next().unwrap()).unwrap();
        let objects: Vec<_> = words
            .map(|name| task.problem().object(name).unwrap())
            .collect();
        plan.steps.push(Step {
            start: number(start.trim()),
            action: Arc::new(task.instantiate(schema, &objects).unwrap()),
            duration: duration.strip_suffix(']').map(number),
        });
    }
    (task, plan)
}

fn deordered(text: &str) -> Deordered {
    let (task, plan) = plan(text);
    deorder(&task, &plan).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns the constraints in the notation of STN plan files.
fn constraints(text: &str) -> String {
    let (task, _) = plan(text);
    let closed = ParametrizedPlan::closed(&task, deordered(text).plan);
    let file = format::write(&task, &closed).unwrap();
    let lines = file.lines().filter(|line| line.starts_with("c:"));
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn duration_is_bounded_by_domain_and_not_by_plan() {
    assert_eq!(
        constraints("3: collect s1 [15]"),
        "c: n0.end - n0.start in [15, 15];"
    );
    assert_eq!(
        constraints("3: navigate [7]"),
        // An action that makes a fact true at its start and false at its end has a positive
        // duration.
        "c: n0.end - n0.start in [5, 15];"
    );
}

#[test]
fn noninterfering_actions_are_unordered() {
    assert_eq!(
        constraints(
            "0: collect s1 [15]
             20: collect s2 [15]"
        ),
        "\
c: n0.end - n0.start in [15, 15];
c: n1.end - n1.start in [15, 15];"
    );
}

#[test]
fn instances_of_one_action_are_ordered_unless_they_overlap_in_plan() {
    let both = "c: n0.end - n0.start in [15, 15];\nc: n1.end - n1.start in [15, 15];";
    assert_eq!(
        constraints(
            "0: collect s1 [15]
             15: collect s1 [15]"
        ),
        format!("{both}\nc: n1.start - n0.end in [0, inf];")
    );
    assert_eq!(
        constraints(
            "0: collect s1 [15]
             14: collect s1 [15]"
        ),
        both
    );
}

#[test]
fn writer_of_over_all_condition_is_kept_outside_interval() {
    assert_eq!(
        constraints(
            "0: navigate [7]
             7: collect s1 [15]
             22: navigate [7]"
        ),
        "\
c: n0.end - n0.start in [5, 15];
c: n1.end - n1.start in [15, 15];
c: n2.end - n2.start in [5, 15];
c: n1.start - n0.end in [0, inf];
c: n2.start - n0.end in [0.001, inf];
c: n2.start - n1.end in [0, inf];"
    );
}

#[test]
fn a_deadline_becomes_a_constraint() {
    assert_eq!(constraints("40: beep"), "c: n0 - .zero in [-inf, 99.999];");
}

#[test]
fn a_fluent_that_is_read_and_changed_keeps_the_order_of_its_users() {
    // Refuelling needs 3 at the start, consumes them, and adds an amount at the end.
    assert_eq!(
        constraints(
            "0: refuel s1 [10]
             5: refuel s2 [10]"
        ),
        "\
c: n0.end - n0.start in [10, 10];
c: n1.end - n1.start in [10, 10];
c: n1.start - n0.start in [0.001, inf];
c: n0.end - n1.start in [0.001, inf];"
    );
}

#[test]
fn the_nominal_schedule_is_the_original_plan() {
    let text = "0: navigate [7]
                7.5: collect s1 [15]";
    let nominal = deordered(text).nominal;
    let times: Vec<_> = nominal.iter().map(ToString::to_string).collect();
    assert_eq!(times, ["0", "0", "7", "15/2", "45/2", "100"]);
}

#[test]
fn rounded_times_are_repaired_in_nominal_schedule() {
    // The duration is one ten-thousandth too long, the gap half a thousandth.
    let text = "0: refuel s1 [10.0001]
                10.0005: refuel s2 [10]";
    let Deordered { plan, nominal, .. } = deordered(text);
    let schedule = elbowroom_stn::Schedule::from(nominal);
    assert!(schedule.holds_in(&plan.network(&Valuation::default())));
    assert_eq!(schedule.times()[2], number("10"));
    assert_eq!(schedule.times()[3], number("10.001"));
}

#[test]
fn interfering_happenings_at_one_time_are_refused() {
    let (task, plan) = plan(
        "0: navigate [7]
         7: navigate [7]",
    );
    let error = deorder(&task, &plan).unwrap_err();
    assert_eq!(
        error,
        DeorderError::Simultaneous {
            first: "end of (navigate)".to_owned(),
            second: "start of (navigate)".to_owned(),
            time: "7".to_owned(),
        }
    );
}

#[test]
fn a_plan_past_its_deadline_has_no_schedule() {
    let (task, plan) = plan("99.9995: beep");
    assert!(deorder(&task, &plan).is_ok(), "rounded, and mended");
    let task = task.with_epsilon(Rational::from(101));
    let error = deorder(&task, &plan).unwrap_err();
    assert!(matches!(error, DeorderError::NoSchedule { .. }), "{error}");
}

#[test]
fn number_of_pins_is_minimal_for_oracle() {
    let text = "0: collect s1 [15]
                3: collect s2 [15]";
    let Deordered { plan, nominal, .. } = deordered(text);
    let (first, second) = (NodeId(1), NodeId(3));
    // The oracle accepts if the second start is known to come no sooner than the first.
    let mut oracle = |plan: &crate::StnPlan| {
        let network =
            elbowroom_stn::ConsistentNetwork::try_from(plan.network(&Valuation::default()))
                .unwrap();
        let node = crate::network_node;
        let back = network.distance(node(second), node(first));
        let is_ordered = back.is_some_and(|back| !back.is_positive());
        (!is_ordered).then(|| vec![second, first, NodeId(4)])
    };
    let pinned = pin_until_sound(plan.clone(), &nominal, &mut oracle).unwrap();
    let pins: Vec<_> = pinned
        .constraints
        .iter()
        .filter(|constraint| constraint.reason == Reason::Pinned)
        .collect();
    assert_eq!(pins.len(), 1);
    assert_eq!((pins[0].from, pins[0].to), (first, second));
    assert_eq!(
        (&pins[0].lower, &pins[0].upper),
        (&Bound::Finite(Rational::ZERO), &Bound::Infinite)
    );
}

#[test]
fn oracle_that_rejects_everything_is_offered_nominal_schedule_then_none() {
    let Deordered { plan, nominal, .. } = deordered("0: collect s1 [15]\n3: navigate [7]");
    let rigid = with_fixed_times(plan.clone(), &nominal).network(&Valuation::default());
    assert!(elbowroom_stn::Schedule::from(nominal.clone()).holds_in(&rigid));
    let mut asked = 0;
    let nothing = pin_until_sound(plan, &nominal, &mut |_| {
        asked += 1;
        Some(vec![NodeId(2)])
    });
    assert!(nothing.is_none());
    assert!(asked < 20, "{asked}");
}

#[test]
fn plans_of_thousands_of_actions_are_deordered_with_about_as_many_constraints() {
    let lines: Vec<_> = (0..1500)
        .map(|index| match index % 3 {
            0 => format!("{}: refuel s1 [10]", 16 * index),
            1 => format!("{}: collect s1 [15]", 16 * index),
            _ => format!("{}: navigate [7]", 16 * index),
        })
        .collect();
    let Deordered { plan, .. } = deordered(&lines.join("\n"));
    assert!(plan.constraints.len() < 6000, "{}", plan.constraints.len());
}
