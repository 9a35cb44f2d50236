//! Plans with many parameters: the work grows linearly with the plan, not quadratically.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::shared::chains::{Needs, chains};
use elbowroom::answers::envelope::{EnvelopeFinding, envelope};
use elbowroom::answers::{EnvelopeRequest, NoObserver, Observer, StopRequest};
use elbowroom::{AnyPlan, pipeline};
use elbowroom_envelope::{Guarantee, Method, Oracle, Settings, irr};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_plan::{ParameterId, ParametrizedPlan};

fn read(robots: usize, ways: usize, needs: Needs) -> (Arc<Task>, TimeTriggeredPlan) {
    let (domain, problem, plan) = chains(robots, ways, needs);
    let (domain, problem) = (
        Source::new("domain", domain),
        Source::new("problem", problem),
    );
    let (problem, _) = read_problem(&domain, &problem).expect("a readable problem");
    let task = Task::new(problem);
    let (plan, _) = read_plan(&Source::new("plan", plan), &task).expect("a readable plan");
    (Arc::new(task), plan)
}

fn open(robots: usize, ways: usize, needs: Needs) -> (Arc<Task>, Arc<ParametrizedPlan>) {
    let (task, plan) = read(robots, ways, needs);
    let freed = pipeline::free(&task, &plan).expect("a valid plan");
    let plan = pipeline::open(&task, freed, &[]).expect("durations to leave open");
    assert_eq!(plan.parameters.len(), robots * ways);
    (task, Arc::new(plan))
}

/// Returns the number of failure cases that a search refutes from scratch, which is most of its
/// work.
fn refutations(robots: usize, ways: usize, needs: Needs, guarantee: Guarantee) -> usize {
    let (task, plan) = open(robots, ways, needs);
    let mut oracle = Oracle::new(&task, &plan, guarantee).expect("within reach");
    let settings = Settings {
        relative: Some(Rational::new(1, 100)),
        ..Settings::default()
    };
    let run = irr(&mut oracle, &settings, &mut |_| ControlFlow::Continue(()));
    let run = run.expect("few cases");
    assert!(run.envelope.is_ok());
    // Without a cache, each of these boxes would have been checked.
    assert!(run.checks > 2 * plan.parameters.len());
    oracle.refutations()
}

#[test]
fn search_effort_is_linear_in_plan_length() {
    for (robots, needs) in [(1, Needs::Time), (4, Needs::Time), (1, Needs::Charge)] {
        for guarantee in Guarantee::ALL {
            let small = refutations(robots, 12, needs, guarantee);
            let large = refutations(robots, 48, needs, guarantee);
            assert!(
                large <= 6 * small,
                "{robots} {needs:?} {guarantee}: {small} {large}"
            );
        }
    }
}

#[test]
fn limits_are_reported_for_many_parameters() {
    let (task, plan) = read(3, 40, Needs::Time);
    let request = EnvelopeRequest::new(&task, AnyPlan::TimeTriggered(plan));
    let outcome = envelope(&request, &mut NoObserver).expect("within exact reasoning");
    let EnvelopeFinding::Envelope { parameters, .. } = &outcome.answer.finding else {
        panic!("{:?}", outcome.answer);
    };
    assert_eq!(parameters.len(), 120);
    for room in parameters {
        let limit = room.upper_limit.as_deref().unwrap_or_default();
        assert!(limit.contains("(open)"), "{limit}");
        // All ways of that robot, and of no other.
        let own = &room.range.quantity.quantity;
        let robot = own
            .split_whitespace()
            .find(|word| word.starts_with('r'))
            .expect("a robot");
        let others = ["r0", "r1", "r2"]
            .into_iter()
            .filter(|other| *other != robot);
        for other in others {
            assert!(!limit.contains(&format!("(go {other} ")), "{own}: {limit}");
        }
        assert!(room.lower_limit.is_some(), "{own}");
    }
}

/// Watcher that ends the search after `left` polls, and counts the polls after that.
struct PollLimit {
    remaining_polls: usize,
    polls_after_limit: usize,
}

impl Observer for PollLimit {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        if let Some(left) = self.remaining_polls.checked_sub(1) {
            self.remaining_polls = left;
            ControlFlow::Continue(())
        } else {
            self.polls_after_limit += 1;
            ControlFlow::Break(StopRequest::TimeLimit)
        }
    }
}

#[test]
fn interrupted_search_returns_partial_result_soon() {
    for (needs, method) in [
        (Needs::Time, Method::Irr),
        (Needs::Charge, Method::Irr),
        (Needs::Time, Method::Best),
        (Needs::Charge, Method::Best),
    ] {
        let (task, plan) = read(2, 10, needs);
        let mut request = EnvelopeRequest::new(&task, AnyPlan::TimeTriggered(plan));
        request.search.method = Some(method);
        let mut widest = Rational::ZERO;
        for left in [1, 2, 5, 20, 60, 100, 200, 500, 2_000, usize::MAX] {
            let mut patience = PollLimit {
                remaining_polls: left,
                polls_after_limit: 0,
            };
            let outcome = envelope(&request, &mut patience);
            let place = format!("{needs:?} {method} after {left}");
            // Each part of the remaining work polls once.
            assert!(
                patience.polls_after_limit <= 12,
                "{place}: {}",
                patience.polls_after_limit
            );
            let outcome = outcome.expect(&place);
            let found = outcome.envelope.expect(&place);
            let width = (0..20).map(|index| {
                let interval = found.interval(ParameterId::from(index));
                let ends = (interval.upper.value(), interval.lower.value());
                let (Some(upper), Some(lower)) = ends else {
                    panic!("{place}: {interval}");
                };
                upper - lower
            });
            let width: Rational = width.sum();
            assert!(width >= widest, "{place}: {width} {widest}");
            widest = width;
        }
        assert!(widest.is_positive());
    }
}
