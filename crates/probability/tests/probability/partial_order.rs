//! Orderings of a plan that are kept.

use crate::shared;
use elbowroom_plan::partial_order::LinkKind;
use elbowroom_plan::{InstanceId, PartialOrderPlan};

const DOMAIN: &str = "(define (domain d) (:types room)
    (:predicates (in ?r - room) (clean ?r - room)) (:functions (soap) (size ?r - room))
    (:durative-action sweep :parameters (?r - room) :duration (= ?duration (size ?r))
      :condition (and (over all (in ?r)) (at start (>= (soap) 1)))
      :effect (and (at start (decrease (soap) 1)) (at end (clean ?r))))
    (:durative-action go :parameters (?a ?b - room) :duration (and (>= ?duration 1) (<= ?duration 3))
      :condition (at start (in ?a))
      :effect (and (at start (not (in ?a))) (at end (in ?b))))
    (:action buy :parameters () :precondition () :effect (increase (soap) 5)))";

const PROBLEM: &str = "(define (problem p) (:domain d) (:objects a b - room)
    (:init (in a) (= (soap) 0) (= (size a) 4) (= (size b) 5)) (:goal (and (clean a) (clean b))))";

/// Returns `from -> to` for each interference link.
fn interference(plan: &PartialOrderPlan) -> Vec<String> {
    let word = |node: elbowroom_plan::NodeId| format!("{:?}", plan.nodes[node.index()]);
    let links = plan.interference();
    links
        .map(|link| format!("{} -> {}", word(link.from), word(link.to)).replace("InstanceId", ""))
        .collect()
}

#[test]
fn threats_stay_ordered_and_enablers_are_free() {
    let steps = "0: (buy)\n1: (sweep a) [4]\n6: (go a b) [1]\n8: (sweep b) [5]";
    let (_, plan) = shared::read_task(DOMAIN, PROBLEM, steps);
    assert_eq!(
        interference(&plan),
        [
            // Sweeping `b` uses soap that sweeping `a` needs.
            "Start((1)) -> Start((3))",
            // Leaving `a` invalidates sweeping it, and undoes nothing else.
            "End((1)) -> Start((2))",
        ]
    );
    let durations: Vec<String> = (0..4)
        .map(|id| {
            let (least, greatest) = plan.duration(InstanceId(id));
            format!("{least} {}", greatest.unwrap())
        })
        .collect();
    assert_eq!(durations, ["0 0", "4 4", "1 3", "5 5"]);
    let of_durations = plan
        .links
        .iter()
        .filter(|link| link.kind == LinkKind::Duration);
    assert_eq!(of_durations.count(), 3);
}

#[test]
fn all_possible_actions_are_unordered() {
    let (task, plan) = shared::read_task(DOMAIN, PROBLEM, "0: (sweep a) [4]\n6: (go a b) [1]");
    let actions = plan
        .instances
        .iter()
        .map(|instance| (*instance.action).clone());
    let all = PartialOrderPlan::unordered(&task, actions);
    assert_eq!(interference(&all), [""; 0]);
    let (least, greatest) = all.duration(InstanceId(1));
    assert_eq!(
        (least.to_string(), greatest.unwrap().to_string()),
        ("1".into(), "3".into())
    );
}
