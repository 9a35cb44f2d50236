//! The oracle and its accepted box.

use elbowroom_envelope::{Guarantee, Objection, Oracle};
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, ParameterId, Side};

use crate::given::{Given, envelope, oracle};

/// Two sequential actions, done within 10 by a constraint, with a deadline at 20.
const RELAY: Given<'_> = Given {
    domain: "(:durative-action run :parameters () :duration (>= ?duration 0)
                :condition (at end (p)) :effect (and))",
    init: "(p) (at 20 (not (p)))",
    goal: "",
    plan: "parameter a default 1; parameter b default 1;
           durative-action instance first : (run); durative-action instance second : (run);
           c: first.end - first.start in [a, a]; c: second.end - second.start in [b, b];
           c: second.start - first.end in [0, 0]; c: second.end - .zero in [0, 10];",
    vary: &[],
};

fn upper(parameter: usize) -> BoxEnd {
    BoxEnd {
        parameter: ParameterId::from(parameter),
        side: Side::Upper,
    }
}

fn number(number: i64) -> Rational {
    Rational::from(number)
}

#[test]
fn query_of_other_box_keeps_accepted_state() {
    let (task, plan) = RELAY.task_and_plan();
    let mut oracle = oracle(&task, &plan).unwrap();
    let accepted = envelope("[1, 1] [1, 8]");
    assert_eq!(oracle.start(&accepted), Ok(None));
    // This box is also inside, but the proofs found for it do not hold for the accepted one.
    assert_eq!(oracle.objection(&envelope("[1, 8] [1, 1]")), Ok(None));
    assert_eq!(oracle.accepted(), Some(&accepted));
    let too_far = oracle.objection_to_reach(upper(0), Some(number(8)));
    assert!(
        matches!(too_far, Ok(Some(Objection::NoSchedule(_)))),
        "{too_far:?}"
    );
    assert_eq!(oracle.try_reach(upper(0), Some(number(2))), Ok(true));
    assert_eq!(oracle.accepted(), Some(&envelope("[1, 2] [1, 8]")));
}

#[test]
fn return_to_accepted_box_is_not_counted_as_query() {
    let (task, plan) = RELAY.task_and_plan();
    let mut oracle = oracle(&task, &plan).unwrap();
    assert_eq!(oracle.start(&envelope("[1, 1] [1, 1]")), Ok(None));
    assert_eq!(oracle.objection(&envelope("[1, 2] [1, 2]")), Ok(None));
    assert_eq!(oracle.try_reach(upper(0), Some(number(2))), Ok(true));
    assert_eq!(oracle.checks(), 3);
}

#[test]
fn widening_within_accepted_interval_keeps_end() {
    let (task, plan) = RELAY.task_and_plan();
    let mut oracle = oracle(&task, &plan).unwrap();
    let accepted = envelope("[1, 4] [1, 4]");
    assert_eq!(oracle.start(&accepted), Ok(None));
    assert_eq!(oracle.try_reach(upper(0), Some(number(2))), Ok(true));
    assert_eq!(oracle.accepted(), Some(&accepted));
    // Nothing has become tighter either.
    assert_eq!(oracle.try_reach(upper(1), Some(number(6))), Ok(true));
    assert_eq!(oracle.try_reach(upper(0), Some(number(5))), Ok(false));
    assert_eq!(oracle.accepted(), Some(&envelope("[1, 4] [1, 6]")));
}

#[test]
fn search_starts_at_nominal_values_by_default() {
    let (task, plan) = RELAY.task_and_plan();
    let mut oracle = oracle(&task, &plan).unwrap();
    assert_eq!(oracle.accepted(), None);
    assert_eq!(oracle.try_reach(upper(1), Some(number(9))), Ok(true));
    assert_eq!(oracle.accepted(), Some(&envelope("[1, 1] [1, 9]")));
}

#[test]
fn refused_box_cannot_be_start() {
    let (task, plan) = RELAY.task_and_plan();
    let mut oracle = oracle(&task, &plan).unwrap();
    let accepted = envelope("[1, 1] [1, 1]");
    assert_eq!(oracle.start(&accepted), Ok(None));
    assert_ne!(oracle.start(&envelope("[1, 6] [1, 6]")), Ok(None));
    assert_eq!(oracle.accepted(), Some(&accepted));
}

#[test]
fn an_oracle_can_be_made_in_one_thread_and_used_in_another() {
    let (task, plan) = RELAY.task_and_plan();
    let mut oracle = oracle(&task, &plan).unwrap();
    drop((task, plan));
    let asked = std::thread::spawn(move || oracle.try_reach(upper(0), Some(number(9))));
    assert_eq!(asked.join().unwrap(), Ok(true));
}

/// A stronger guarantee never accepts more than a weaker one.
#[test]
fn a_stronger_guarantee_accepts_no_box_that_a_weaker_one_refuses() {
    let (task, plan) = RELAY.task_and_plan();
    let reaches = [1, 2, 5, 9, 20, 100];
    for reach in reaches {
        let accepts = |guarantee| {
            let oracle = Oracle::new(&task, &plan, guarantee);
            oracle
                .unwrap()
                .try_reach(upper(0), Some(number(reach)))
                .unwrap()
        };
        let [weak, dynamic, strong] =
            [Guarantee::Weak, Guarantee::Dynamic, Guarantee::Strong].map(accepts);
        assert!(weak >= dynamic && dynamic >= strong, "{reach}");
    }
}
