//! Decision times of the executors that execute orders of a plan's happenings. Printed are the
//! times of adopting the plan and of the first decision (which searches for an order), then median,
//! 99th percentile and maximum of all other decisions, and the time of the whole run.
//!
//! Robots visit rooms in parallel, each robot one room after the other, and facts change by
//! themselves now and then. The effects of the actions are needed until the end, so each layer has
//! many conditions.
//!
//! ```text
//! cargo bench -p elbowroom-execution --bench decisions
//! ```

#![allow(clippy::print_stdout, reason = "the table is what it is for")]
#![allow(clippy::disallowed_methods, reason = "decisions are timed")]

#[allow(dead_code, reason = "shared with benches of single events")]
mod robots;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;
use std::time::{Duration, Instant};

use elbowroom_execution::executors::{ExecutorServices, ExecutorSpec, PolicyTableCache};
use elbowroom_execution::{
    ActionHandle, BeliefState, Decision, DecisionContext, Ending, Executor, Order, PlanEvent,
    PreparedPlan, StepId,
};
use elbowroom_model::ground::Action;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_plan::partial_order::partial_order;
use elbowroom_probability::Likelihoods;

const DOMAIN: &str = "(define (domain rooms) (:requirements :typing :durative-actions :fluents)
  (:types robot room)
  (:functions (pace ?r - robot))
  (:predicates (at ?r - robot ?a - room) (way ?a ?b - room) (visited ?r - robot ?a - room))
  (:durative-action move :parameters (?r - robot ?a ?b - room) :duration (= ?duration (pace ?r))
    :condition (and (at start (at ?r ?a)) (over all (way ?a ?b)))
    :effect (and (at start (not (at ?r ?a))) (at end (at ?r ?b)) (at end (visited ?r ?b)))))";

fn main() {
    // As in the test harness, words are filters on the names.
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<_> = words.iter().filter(|word| !word.starts_with('-')).collect();
    println!(
        "| executor | robots | actions | taking up | first | median | p99 | worst | decisions | run |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for executor in ["adaptable", "lookahead"] {
        if !words.is_empty() && !words.iter().any(|word| executor.contains(word.as_str())) {
            continue;
        }
        for robots in [1, 5] {
            for actions in [50, 100, 200, 400, 800] {
                row(executor, robots, actions);
            }
        }
    }
}

fn row(executor: &str, robots: usize, actions: usize) {
    let mission = mission(robots, actions);
    let spec: ExecutorSpec = executor.parse().expect("a known executor");
    let mut likelihoods = Likelihoods::certain();
    likelihoods.defaults.becomes_false = Some(1e-6);
    likelihoods.defaults.start = Some(0.99);
    let mut decider = spec.build(ExecutorServices {
        region: Box::new(robots::UnlimitedRegion),
        likelihoods: Arc::new(likelihoods),
        comparator: None,
        policy_cache: PolicyTableCache::default(),
        order_cache: None,
        action_values: None,
        rollout: None,
        has_planner: false,
    });
    let begin = Instant::now();
    decider.adopt(&mission).expect("a plan with orders");
    let adopting = begin.elapsed();
    let mut times = World::new(&mission).run(decider.as_mut());
    let run: Duration = times.iter().sum();
    let first = times.remove(0);
    times.sort_unstable();
    let at = |share: usize| milliseconds(times[(times.len() - 1) * share / 100]);
    let (median, p99, worst) = (at(50), at(99), at(100));
    let count = times.len() + 1;
    let (adopting, first, run) = (
        milliseconds(adopting),
        milliseconds(first),
        milliseconds(run),
    );
    println!(
        "| `{executor}` | {robots} | {actions} | {adopting} | {first} | {median} | {p99} | {worst} | {count} | {run} |"
    );
}

fn milliseconds(time: Duration) -> String {
    format!("{:.3} ms", time.as_secs_f64() * 1000.0)
}

/// World in which everything happens as planned.
struct World {
    running: BTreeMap<(Rational, StepId), Arc<Action>>,
    now: Rational,
    news: Vec<PlanEvent>,
    belief: BeliefState,
}

impl World {
    fn new(mission: &PreparedPlan) -> Self {
        Self {
            running: BTreeMap::new(),
            now: Rational::ZERO,
            news: Vec::new(),
            belief: BeliefState::new(Arc::clone(&mission.task)),
        }
    }

    /// Executes the plan. Returns the time of each decision.
    fn run(mut self, executor: &mut dyn Executor) -> Vec<Duration> {
        let mut times = Vec::new();
        loop {
            let moment = DecisionContext {
                now: &self.now,
                plan_events: &std::mem::take(&mut self.news),
                belief: &self.belief,
            };
            let begin = Instant::now();
            let decided = executor.decide(&moment);
            times.push(begin.elapsed());
            match decided.decision {
                Decision::Start(orders) => orders.into_iter().for_each(|order| self.start(order)),
                Decision::Wait { until } => self.wait(until),
                Decision::GoalReached => return times,
                other => panic!("everything goes as planned: {other:?}"),
            }
        }
    }

    fn start(&mut self, order: Order) {
        let duration = order.duration.expect("all take time");
        self.belief
            .advance_for_happening(&self.now)
            .expect("no numbers");
        let ticket = ActionHandle(u64::from(order.step.0));
        let started = self.belief.start(ticket, &order.action, &duration, &[]);
        started.expect("no numbers");
        self.running
            .insert((&self.now + duration, order.step), order.action);
        self.news.push(PlanEvent::Started {
            step: order.step,
            time: self.now.clone(),
            measured: Vec::new(),
        });
    }

    fn wait(&mut self, until: Option<Rational>) {
        let next = self.running.first_key_value();
        let next = next.map(|((time, _), _)| time.clone());
        if let Some(until) = until.filter(|until| next.as_ref().is_none_or(|next| until < next)) {
            self.now = until;
            return;
        }
        let ((time, step), _) = self.running.pop_first().expect("something to wait for");
        self.now.clone_from(&time);
        self.belief
            .advance_for_happening(&time)
            .expect("no numbers");
        let ended = self.belief.end(ActionHandle(u64::from(step.0)), &[]);
        ended.expect("no numbers");
        self.news.push(PlanEvent::Ended {
            step,
            time,
            ending: Ending::Succeeded,
            measured: Vec::new(),
        });
    }
}

/// Creates a mission with `actions` moves.
fn mission(robots: usize, actions: usize) -> PreparedPlan {
    let rooms = actions / robots;
    let (mut init, mut goal, mut plan) = (String::new(), String::new(), String::new());
    let text = |into: &mut String, line: String| writeln!(into, "{line}").expect("memory");
    for room in 0..rooms {
        let next = room + 1;
        text(&mut init, format!("(way a{room} a{next})"));
        for robot in 0..robots {
            text(&mut goal, format!("(visited r{robot} a{next})"));
            let time = format!("{}.{robot:02}", room * 6);
            text(
                &mut plan,
                format!("{time}: (move r{robot} a{room} a{next}) [5.{robot}]"),
            );
        }
    }
    for robot in 0..robots {
        text(
            &mut init,
            format!("(at r{robot} a0) (= (pace r{robot}) 5.{robot})"),
        );
    }
    let names = |letter: char, count: usize| {
        let names = (0..count).map(|index| format!("{letter}{index}"));
        names.collect::<Vec<_>>().join(" ")
    };
    let problem = format!(
        "(define (problem p) (:domain rooms) (:objects {} - robot {} - room)
           (:init {init}) (:goal (and {goal})))",
        names('r', robots),
        names('a', rooms + 1),
    );
    let read = read_problem(&Source::new("d", DOMAIN), &Source::new("p", problem));
    let (problem, _) = read.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    let task = Arc::new(Task::new(problem));
    let read = read_plan(&Source::new("x", plan), &task);
    let (plan, _): (TimeTriggeredPlan, _) =
        read.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    PreparedPlan {
        order: Some(partial_order(&task, &plan)),
        time_triggered: plan,
        task,
        ..robots::mission(0, false)
    }
}
