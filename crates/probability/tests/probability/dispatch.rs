//! `PExec`: choice of the next happening.

use crate::shared;
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::FactId;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node};
use elbowroom_probability::dispatch::never_interrupt;
use elbowroom_probability::{
    Choice, LayerDispatch, Likelihoods, Model, OrderSearch, Reconsider, Running, SearchSettings,
    SearchState, Semantics,
};

const DOMAIN: &str = "(define (domain letters)
    (:predicates (written) (stamped) (posted) (open) (at-desk))
    (:durative-action write :parameters () :duration (= ?duration 10)
      :condition (over all (at-desk)) :effect (at end (written)))
    (:durative-action stamp :parameters () :duration (= ?duration 2)
      :condition (at start (at-desk)) :effect (at end (stamped)))
    (:durative-action post :parameters () :duration (= ?duration 5)
      :condition (and (at start (written)) (at start (stamped)) (at end (open)))
      :effect (at end (posted))))";

const PLAN: &str = "0: (write) [10]\n11: (stamp) [2]\n14: (post) [5]";

struct Fixture {
    task: Arc<Task>,
    dispatch: LayerDispatch,
    now: SearchState,
}

impl Fixture {
    fn new(init: &str) -> Self {
        let problem = format!(
            "(define (problem p) (:domain letters) (:init (at-desk) {init}) (:goal (posted)))"
        );
        let (task, plan) = shared::read_task(DOMAIN, &problem, PLAN);
        let mut likelihoods = Likelihoods::certain();
        likelihoods.defaults.becomes_false = Some(0.01);
        likelihoods.defaults.start = Some(0.9);
        let task = Arc::new(task);
        let model = Model::new(task.clone(), plan, &likelihoods, Semantics::Paper).unwrap();
        let search = OrderSearch::new(model, SearchSettings::default());
        Self {
            now: SearchState::initial(&task),
            dispatch: LayerDispatch::new(search, Reconsider::WhenNoLayerFits),
            task,
        }
    }

    fn fact(&self, name: &str) -> FactId {
        let predicate = self.task.problem().predicate(name).unwrap();
        self.task.find_fact(predicate, &[]).unwrap()
    }

    fn believe(&mut self, name: &str, probability: f64) {
        let fact = self.fact(name);
        self.now.belief.set(fact, probability);
    }

    fn at(&mut self, time: i64) {
        self.now.now = Rational::from(time);
    }

    fn start(&mut self, instance: u32, start: i64) {
        self.now.running.push(Running {
            instance: InstanceId(instance),
            start: Rational::from(start),
        });
    }

    /// Returns the next step in words; a star marks a new order.
    fn next(&mut self) -> String {
        match self
            .dispatch
            .choose(&self.now, &mut never_interrupt)
            .unwrap()
        {
            Choice::GoalReached => "goal reached".to_owned(),
            Choice::Replan => "replan".to_owned(),
            Choice::Abandon(_) => unreachable!("orders end what they start"),
            Choice::Next(next) => {
                let model = self.dispatch.search().model();
                let star = if next.is_new_order { "*" } else { "" };
                let from = next.slot.earliest.to_decimal(3);
                format!("{}{star} from {from}", model.describe_node(next.node))
            }
        }
    }
}

#[test]
fn superfluous_steps_are_skipped_and_failed_steps_repeated() {
    let mut desk = Fixture::new("(open)");
    // Writing takes long, so the stamp can come off in both orders.
    let first = desk.next();
    assert!(first.ends_with("* from 0"), "{first}");
    // Another agent has written and stamped the letter, so the last layer fits.
    desk.believe("written", 1.0);
    desk.believe("stamped", 1.0);
    assert_eq!(desk.next(), "start of (post) from 0");
    // The start failed and nothing has changed, so it is tried again.
    assert_eq!(desk.next(), "start of (post) from 0");
    // The stamp has come off, so an earlier layer fits again.
    desk.believe("stamped", 0.0);
    let next = desk.next();
    assert!(!next.contains('*') && !next.contains("post"), "{next}");
    // An executor that reconsiders does not write the letter again.
    desk.dispatch = LayerDispatch::new(desk.dispatch.search().clone(), Reconsider::Always);
    assert_eq!(desk.next(), "start of (stamp)* from 0");
    desk.believe("stamped", 1.0);
    desk.start(2, 0);
    assert_eq!(desk.next(), "end of (post)* from 5");
    // Running actions end before the goal is declared.
    desk.believe("posted", 1.0);
    assert_eq!(desk.next(), "end of (post)* from 5");
    desk.now.running.clear();
    assert_eq!(desk.next(), "goal reached");
}

#[test]
fn unexpected_end_requests_new_order() {
    let mut desk = Fixture::new("(open) (written)");
    assert_eq!(desk.next(), "start of (stamp)* from 0");
    // The action `write` was started, though the order does not contain it.
    desk.start(0, 0);
    let next = desk.next();
    assert!(next.contains('*'), "{next}");
    let order = desk.dispatch.order().unwrap();
    let plan = desk.dispatch.search().model().plan();
    let end = |node: &&elbowroom_plan::NodeId| plan.nodes[node.index()] == Node::End(InstanceId(0));
    assert_eq!(order.sequence.iter().filter(end).count(), 1);
}

#[test]
fn without_an_order_the_answer_is_to_replan() {
    let mut desk = Fixture::new("(written)");
    assert_eq!(desk.next(), "replan");
    desk.believe("open", 0.6);
    assert_eq!(desk.next(), "start of (stamp)* from 0");
}

#[test]
fn an_order_that_misses_its_deadline_is_not_chosen() {
    // The post office opens at 16 and closes at 21.
    let mut desk = Fixture::new("(at 16 (open)) (at 21 (not (open)))");
    assert!(desk.next().contains('*'));
    // Posting takes 5, so it must begin before 16, after 10 of writing and 2 of stamping.
    desk.believe("stamped", 1.0);
    desk.at(5);
    assert!(desk.next().starts_with("start of (write)"));
    desk.at(6);
    assert_eq!(desk.next(), "replan");
    desk.believe("written", 1.0);
    desk.at(15);
    assert_eq!(desk.next(), "start of (post)* from 15");
    desk.at(16);
    desk.believe("open", 1.0);
    assert_eq!(desk.next(), "replan");
}
