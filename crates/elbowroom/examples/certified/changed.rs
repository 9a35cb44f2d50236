//! Variants of problems with less time, or with fewer initial facts.

use std::time::Duration;

use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::planner::Answer;

use crate::first_plan;
use crate::statistics::Sums;

const LIMIT: Duration = Duration::from_secs(1);

/// Maximum number of initial facts to remove, one in each variant.
const MAX_FACTS: usize = 8;

/// Plans for each variant of a problem that has a plan.
pub(crate) fn plan_variants(name: &str, task: &Task, sums: &mut Sums) {
    let whole = first_plan(task, &Situation::initial(task), LIMIT);
    if !matches!(whole, Answer::Plan { .. }) {
        return;
    }
    let mut ask = |what: &str, task: &Task| {
        let situation = Situation::initial(task);
        let answer = first_plan(task, &situation, LIMIT);
        sums.count_answer(&format!("{name} {what}"), task, &situation, &answer);
    };
    if !task.timed().is_empty() {
        for eighths in [1, 2, 3, 4, 5, 6, 7] {
            let part = Rational::new(eighths, 8);
            let times = task.timed().iter().map(|own| &own.time * &part);
            let times: Vec<Rational> = times.collect();
            ask(&format!("{eighths}/8"), &task.with_numbers(&times, []));
        }
    }
    let facts = task.problem().initial_facts.len();
    for number in 0..facts.min(MAX_FACTS) {
        // Distributed evenly over all facts.
        let left_out = number * facts / facts.min(MAX_FACTS);
        let mut problem = task.problem().clone();
        let (predicate, objects) = problem.initial_facts.remove(left_out);
        let fact = task.problem().apply_predicate(predicate, &objects);
        ask(&format!("without {fact}"), &Task::new(problem));
    }
}
