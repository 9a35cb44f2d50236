//! Small problems with a plan, for tests.

#![allow(dead_code, reason = "not every test uses everything")]

use std::sync::Arc;

use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::soundness::Counterexample;
use elbowroom_envelope::{Guarantee, Objection, Oracle};
use elbowroom_model::Task;
use elbowroom_num::{End, Interval, Rational};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_plan::parametrize::vary;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan};

/// Problem over the facts `(p)`, `(q)`, `(r)` and the numbers `(x)`, `(y)`, with an STN plan.
#[derive(Default)]
pub(crate) struct Given<'a> {
    /// `:synth-parameters` and actions.
    pub(crate) domain: &'a str,
    /// Initial state and timed initials. `(x)` and `(y)` begin at 5, `(z)` has no value.
    pub(crate) init: &'a str,
    /// The goal; `(and)` if empty.
    pub(crate) goal: &'a str,
    /// An STN plan file.
    pub(crate) plan: &'a str,
    /// Further quantities to leave open.
    pub(crate) vary: &'a [&'a str],
}

impl Given<'_> {
    /// Returns the task with ε = 1/4, and the plan.
    pub(crate) fn task_and_plan(&self) -> (Arc<Task>, Arc<ParametrizedPlan>) {
        let domain = format!(
            "(define (domain d) (:predicates (p) (q) (r)) (:functions (x) (y) (z)) {})",
            self.domain
        );
        let goal = if self.goal.is_empty() {
            "(and)"
        } else {
            self.goal
        };
        let problem = format!(
            "(define (problem d) (:domain d) (:init (= (x) 5) (= (y) 5) {}) (:goal {goal}))",
            self.init
        );
        let (problem, _) = read_problem(
            &Source::new("domain", domain),
            &Source::new("problem", problem),
        )
        .unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false)));
        let task = Task::new(problem).with_epsilon(Rational::new(1, 4));
        let plan = elbowroom_plan::format::read(self.plan.as_bytes(), &task).expect("a plan");
        let specs: Vec<_> = self
            .vary
            .iter()
            .map(|spec| spec.parse().expect("a quantity"))
            .collect();
        let nominal = plan.plan.nodes.iter().map(|_| Rational::ZERO).collect();
        let plan = vary(&task, plan, &nominal, &specs).expect("quantities of the plan");
        (Arc::new(task), Arc::new(plan))
    }

    /// Returns the answers of one oracle for these boxes, one after the other: `inside`, or the
    /// objection.
    pub(crate) fn answers(&self, boxes: &[&str]) -> Vec<String> {
        let (task, plan) = self.task_and_plan();
        let mut oracle = oracle(&task, &plan).expect("within reach");
        boxes
            .iter()
            .map(
                |text| match oracle.objection(&envelope(text)).expect("few cases") {
                    None => "inside".to_owned(),
                    Some(Objection::NoSchedule(_)) => "no schedule".to_owned(),
                    Some(Objection::Broken(broken)) => {
                        broken.requirement.describe(&task, &plan.plan)
                    }
                    Some(other) => other.to_string(),
                },
            )
            .collect()
    }

    /// Returns the counterexample that shows that the box is not inside.
    pub(crate) fn counterexample(&self, text: &str) -> Counterexample {
        let (task, plan) = self.task_and_plan();
        let mut oracle = oracle(&task, &plan).expect("within reach");
        match oracle.objection(&envelope(text)).expect("few cases") {
            Some(Objection::Broken(broken)) => oracle
                .counterexample(&envelope(text), &broken)
                .expect("it breaks"),
            other => panic!("{other:?}"),
        }
    }

    pub(crate) fn answer(&self, envelope: &str) -> String {
        self.answers(&[envelope]).remove(0)
    }
}

/// Creates the oracle of the weak guarantee.
pub(crate) fn oracle(task: &Arc<Task>, plan: &Arc<ParametrizedPlan>) -> Result<Oracle, Refusal> {
    Oracle::new(task, plan, Guarantee::Weak)
}

/// Parses `[1, 3/2] [-inf, 0]`: an interval for each parameter.
pub(crate) fn envelope(text: &str) -> DecoupledEnvelope {
    let end = |text: &str| match text.trim() {
        "inf" | "-inf" => End::Infinite,
        number => End::Closed(number.parse().expect("a number")),
    };
    let intervals = text.split(']').filter_map(|interval| {
        let (lower, upper) = interval.trim().strip_prefix('[')?.split_once(',')?;
        Some(Interval {
            lower: end(lower),
            upper: end(upper),
        })
    });
    let intervals: Vec<_> = intervals.collect();
    let zeros = intervals.iter().map(|_| Rational::ZERO).collect();
    let given = intervals.into_iter().enumerate();
    given.fold(
        DecoupledEnvelope::point(&zeros),
        |all, (index, interval)| all.with_interval(index.into(), interval),
    )
}
