//! Files that are written can be read, and the reader never panics.

use elbowroom_num::Rational;
use proptest::prelude::*;

use super::{PAPER, parsed};
use crate::format::{read, write};
use crate::parameter::{Parameter, ParameterKind, ParametrizedPlan};
use crate::stn_plan::{Bound, Constraint, Instance, InstanceId, NodeId, Reason, StnPlan};
use crate::testing::rover;
use crate::valuation::ParameterId;

/// Generates plans that files can express, in the form that reading them produces.
fn plans() -> impl Strategy<Value = ParametrizedPlan> {
    let action = prop_oneof!["navigate", "beep", "collect s1", "collect s2", "refuel s1"];
    let rational = || (-2000_i64..2000, 1_i64..12).prop_map(|(n, d)| Rational::new(n, d));
    let bound = || prop_oneof![Just(None), rational().prop_map(Some)];
    let constraint = (
        any::<prop::sample::Index>(),
        any::<prop::sample::Index>(),
        bound(),
        bound(),
    );
    let parameter = (
        rational(),
        1_i64..9,
        bound(),
        bound(),
        any::<prop::sample::Index>(),
    );
    (
        prop::collection::vec(action, 0..8),
        prop::collection::vec(constraint, 0..20),
        prop::collection::vec(parameter, 0..5),
    )
        .prop_map(|(actions, constraints, parameters)| build(&actions, constraints, parameters))
}

type Pick = prop::sample::Index;
type PickedConstraint = (Pick, Pick, Option<Rational>, Option<Rational>);
type PickedParameter = (Rational, i64, Option<Rational>, Option<Rational>, Pick);

fn build(
    actions: &[String],
    constraints: Vec<PickedConstraint>,
    parameters: Vec<PickedParameter>,
) -> ParametrizedPlan {
    let task = rover();
    let mut lines = vec!["parameter ?s default 2;".to_owned()];
    for (index, action) in actions.iter().enumerate() {
        let keyword = if action == "beep" {
            "action"
        } else {
            "durative-action"
        };
        lines.push(format!("{keyword} instance n{index} : ({action});"));
        if action.starts_with("refuel") {
            lines.push(format!("parameter n{index}.?r default -{index};"));
        }
    }
    let text = lines.concat();
    let mut plan = read(text.as_bytes(), &task).unwrap_or_else(|errors| panic!("{errors}"));
    // All nodes but the timed initials, which files do not mention.
    let nodes = plan.plan.nodes.len() - 1;
    plan.plan
        .constraints
        .extend(merged_constraints(nodes, constraints));
    for (index, (nominal, weight, lower, upper, place)) in parameters.into_iter().enumerate() {
        let id = ParameterId::from(plan.parameters.len());
        let mut kind = ParameterKind::Bound;
        if let Some(instance) = pick_durative_instance(&plan.plan, place) {
            kind = ParameterKind::Duration(instance);
            plan.plan.free_duration(instance);
            plan.plan.constraints.push(Constraint {
                from: plan.plan.start(instance),
                to: plan.plan.end(instance),
                lower: Bound::Parameter(id),
                upper: Bound::Parameter(id),
                reason: Reason::Given,
            });
        }
        let nominal = if kind == ParameterKind::Bound {
            nominal
        } else {
            nominal.abs()
        };
        let mut range = kind.natural_range(&nominal);
        let both = [(lower, &mut range.lower), (upper, &mut range.upper)];
        for (factor, (distance, end)) in [-1, 1].into_iter().zip(both) {
            if let Some(distance) = distance {
                let value = &nominal + Rational::from(factor) * distance.abs();
                *end = elbowroom_num::End::Closed(value);
            }
        }
        plan.parameters.push(Parameter {
            name: format!("p_{index}.x-?"),
            kind,
            nominal,
            weight: Rational::new(weight, 2),
            range,
        });
    }
    plan
}

fn pick_durative_instance(plan: &StnPlan, place: Pick) -> Option<InstanceId> {
    let durative = |instance: &Instance| instance.action.durative().is_some();
    let all: Vec<_> = (0..plan.instances.len())
        .filter(|&index| durative(&plan.instances[index]))
        .collect();
    (!all.is_empty()).then(|| InstanceId::from(*place.get(&all)))
}

/// Generates at most one numeric constraint per pair, because the writer merges them.
fn merged_constraints(nodes: usize, constraints: Vec<PickedConstraint>) -> Vec<Constraint> {
    let mut seen = std::collections::BTreeSet::new();
    let bound = |value: Option<Rational>| value.map_or(Bound::Infinite, Bound::Finite);
    constraints
        .into_iter()
        .map(|(from, to, lower, upper)| match (lower, upper) {
            // The reader rejects bounds that cannot be satisfied.
            (Some(lower), Some(upper)) if lower > upper => (from, to, Some(upper), Some(lower)),
            (lower, upper) => (from, to, lower, upper),
        })
        .map(|(from, to, lower, upper)| Constraint {
            from: NodeId::from(from.index(nodes)),
            to: NodeId::from(to.index(nodes)),
            lower: bound(lower),
            upper: bound(upper),
            reason: Reason::Given,
        })
        .filter(|constraint| seen.insert((constraint.from, constraint.to)))
        .collect()
}

/// Generates the file with some bytes replaced, and some parts copied to other places.
fn mutated() -> impl Strategy<Value = Vec<u8>> {
    let replaced = prop::collection::vec((any::<Pick>(), any::<u8>()), 0..4);
    let copied = prop::collection::vec((any::<Pick>(), any::<Pick>(), 0..80_usize), 0..4);
    (replaced, copied).prop_map(|(replaced, copied)| {
        let mut bytes = PAPER.as_bytes().to_vec();
        for (at, byte) in replaced {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        for (from, to, length) in copied {
            let from = from.index(bytes.len());
            let stretch = bytes[from..(from + length).min(bytes.len())].to_vec();
            let to = to.index(bytes.len());
            bytes.splice(to..to, stretch);
        }
        bytes
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn mutated_file_is_refused_or_round_trips(bytes in mutated()) {
        let task = rover();
        match read(&bytes, &task) {
            Ok(plan) => {
                // Bounds on the same difference are merged when the file is written for the first
                // time.
                let written = write(&task, &plan).expect("what was read can be written");
                let again = read(written.as_bytes(), &task).expect("what is written is right");
                prop_assert_eq!(write(&task, &again).expect("again"), written);
            }
            Err(errors) => prop_assert!(!errors.to_string().is_empty()),
        }
    }
}

proptest! {
    #[test]
    fn written_and_reread_plan_is_identical(plan in plans()) {
        let text = write(&rover(), &plan).unwrap();
        prop_assert_eq!(parsed(&text), plan);
    }

    #[test]
    fn arbitrary_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = read(&bytes, &rover());
    }

    #[test]
    fn malformed_file_does_not_panic(
        cut in any::<prop::sample::Index>(),
        other in any::<prop::sample::Index>(),
        junk in "[ -~\\n;:é]{0,4}",
    ) {
        let (a, b) = (cut.index(PAPER.len()), other.index(PAPER.len()));
        let text = format!("{}{junk}{}", &PAPER[..a.min(b)], &PAPER[a.max(b)..]);
        let _ = read(text.as_bytes(), &rover());
    }
}
