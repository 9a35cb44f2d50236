//! Messages of violations.

use super::world::{World, number};
use crate::problem::{Body, Condition, ObjectId, Term};
use crate::validate::{ConditionTime, Reason, ViolationKind};

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
fn false_fact_names_happening_that_deleted_it() {
    let world = World::new("(at)")
        .durative("leave", &[("start effect", "(not (at))")])
        .instant("use", "(at)", "");
    assert_eq!(
        world.judge("1: leave [5]\n7: use"),
        "at 7.000: (use) needs (at): (at) is false since the start of (leave) at 1.000"
    );
}

#[test]
fn simultaneously_achieved_fact_is_reported_as_too_late() {
    let world = World::new("")
        .durative("make", &[("end effect", "(p)")])
        .instant("use", "(p)", "");
    assert_eq!(
        world.judge("1: make [5]\n6: use"),
        "at 6.000: (use) needs (p): (p) is false; the end of (make) at 6.000 changes this only \
         after the condition is read"
    );
    let world = World::new("(p)")
        .durative("lose", &[("end effect", "(not (p))")])
        .durative("win", &[("end effect", "(increase x 2)")])
        .instant("use", "(not (p))", "");
    assert_eq!(
        world.judge("1: lose [5]\n6: win [1]\n6: use"),
        "at 6.000: (use) needs (not (p)): (p) is true; the end of (lose) at 6.000 changes this \
         only after the condition is read"
    );
}

#[test]
fn simultaneously_sufficient_number_is_reported_as_too_late() {
    let world = World::new("(= x 3)")
        .instant("more", "", "(increase x 2)")
        .durative("use", &[("start", "(>= x 5)")]);
    assert_eq!(
        world.judge("1: more\n1: use [5]"),
        "at 1.000: (use) needs (>= (x) 5) at start: (x) = 3, short by 2; (more) at 1.000 changes \
         this only after the condition is read"
    );
}

#[test]
fn false_equality_names_its_objects() {
    let mut world = World::new("").instant("go", "(p)", "");
    world.problem.objects = ["a", "b"]
        .map(|name| crate::problem::Object {
            name: name.to_owned(),
            types: Vec::new(),
        })
        .to_vec();
    let object = |index: u32| Term::Object(ObjectId(index));
    let equal = |left, right| Condition::Equal(object(left), object(right));
    for (condition, words) in [
        (Condition::Not(Box::new(equal(0, 0))), "(not (= a a))"),
        (equal(0, 1), "(= a b)"),
        (
            Condition::Or(vec![equal(0, 1), Condition::Not(Box::new(equal(1, 1)))]),
            "(or (= a b) (not (= b b)))",
        ),
    ] {
        let Body::Instantaneous { condition: own, .. } = &mut world.problem.schemas[0].body else {
            panic!()
        };
        *own = Condition::And(vec![equal(0, 0), condition]);
        let found = world.judge("1: go");
        assert_eq!(found, format!("at 1.000: (go) needs {words}"));
    }
}

#[test]
fn only_failing_conjunct_is_reported() {
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
    let ViolationKind::Condition { when, reasons, .. } = &violation.kind else {
        panic!()
    };
    assert_eq!(*when, ConditionTime::Now);
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
