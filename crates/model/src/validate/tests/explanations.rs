//! How a violation reads.

use super::world::{World, number};
use crate::validate::{Mistake, Reason, When};

#[test]
fn a_numeric_condition_names_values_and_the_shortfall() {
    let world = World::new("(= charge 10)")
        .instant("drive", "", "(decrease charge 6.8)")
        .durative("deliver", &[("start", "(and (>= charge 5))")]);
    assert_eq!(
        world.judge("10: drive\n20: deliver [5]"),
        "at 20.000: (deliver) needs (>= (charge) 5) at start: (charge) = 3.2, short by 1.8"
    );
}

#[test]
fn a_false_fact_names_what_last_made_it_false() {
    let world = World::new("(at)")
        .durative("leave", &[("start effect", "(not (at))")])
        .instant("use", "(at)", "");
    assert_eq!(
        world.judge("1: leave [5]\n7: use"),
        "at 7.000: (use) needs (at): (at) is false since the start of (leave) at 1.000"
    );
}

#[test]
fn only_the_conjunct_that_fails_is_blamed() {
    let world = World::new("(p)").instant("go", "(and (p) (q) (r))", "");
    assert_eq!(
        world.judge("1: go"),
        "at 1.000: (go) needs (q): (q) is false"
    );
}

#[test]
fn a_violation_has_fields_for_programs() {
    let world = World::new("(= x 3)").instant("go", "(>= x 5)", "");
    let verdict = world.verdict("1: go");
    let violation = verdict.violation().expect("invalid");
    assert_eq!(violation.time, number("1"));
    let Mistake::Condition { when, reasons, .. } = &violation.mistake else {
        panic!()
    };
    assert_eq!(*when, When::Now);
    let [Reason::Comparison { left, right, .. }] = reasons.as_slice() else {
        panic!()
    };
    assert_eq!((left, right), (&number("3"), &number("5")));
}

#[test]
fn interference_over_a_fluent_names_the_fluent() {
    let world = World::new("(= x 3)")
        .instant("set", "", "(assign x 5)")
        .instant("more", "", "(increase x 1)");
    assert_eq!(
        world.judge("1: set\n1: more"),
        "at 1.000: (more) interferes: (set) at 1.000 and (more) at 1.000 both concern (x) and \
         must be at least 0.001 apart"
    );
}
