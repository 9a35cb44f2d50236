//! Problems from text, and answers as text.

use std::ops::ControlFlow;

use elbowroom_model::{Situation, Task};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_planner::{Answer, Settings, Technique, plan};

/// Returns the task of a domain's and a problem's inner parts.
pub(crate) fn task(domain: &str, problem: &str) -> Task {
    let domain = format!("(define (domain d) {domain})");
    let problem = format!("(define (problem p) (:domain d) {problem})");
    let sources = (
        Source::new("domain.pddl", domain),
        Source::new("problem.pddl", problem),
    );
    match read_problem(&sources.0, &sources.1) {
        Ok((problem, _)) => Task::new(problem),
        Err(diagnostics) => panic!("{}", diagnostics.render(false)),
    }
}

/// Returns the first plan, or the answer after `turns` reports.
pub(crate) fn answer_from(task: &Task, situation: &Situation, turns: usize) -> Answer {
    answer_by(task, situation, turns, &Settings::default())
}

fn answer_by(task: &Task, situation: &Situation, turns: usize, settings: &Settings) -> Answer {
    let settings = Settings {
        first_plan_only: true,
        ..settings.clone()
    };
    let mut left = turns;
    plan(task, situation, &settings, &mut |_| {
        left = left.saturating_sub(1);
        if left == 0 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
}

pub(crate) fn answer(domain: &str, problem: &str) -> Answer {
    let task = task(domain, problem);
    let situation = Situation::initial(&task);
    answer_from(&task, &situation, 400)
}

/// As above, without clean-up, so that the counts are those of the first plan.
pub(crate) fn answer_without_cleanup(domain: &str, problem: &str) -> Answer {
    let task = task(domain, problem);
    let mut settings = Settings::default();
    settings.tuning.without.push(Technique::Cleanup);
    answer_by(&task, &Situation::initial(&task), 400, &settings)
}

/// As above, with self-overlap allowed.
pub(crate) fn answer_with_self_overlap(domain: &str, problem: &str) -> Answer {
    let task = task(domain, problem);
    let settings = Settings {
        self_overlap: true,
        ..Settings::default()
    };
    answer_by(&task, &Situation::initial(&task), 400, &settings)
}

/// Returns the steps of a plan, or the reason why there is none.
pub(crate) fn describe(answer: &Answer) -> String {
    match answer {
        Answer::Plan { found, .. } => {
            let steps = found.plan.steps.iter().map(|step| {
                let duration = step.duration.as_ref().map(ToString::to_string);
                let duration = duration.map_or(String::new(), |d| format!(" [{d}]"));
                format!("{}: {}{duration}", step.start, step.action.name)
            });
            steps.collect::<Vec<_>>().join("\n")
        }
        Answer::Unsolvable { proof, .. } => proof.to_string(),
        Answer::NoneFound { stopped, .. } => format!("none found: {stopped:?}"),
        Answer::Unsupported(unsupported) => unsupported.to_string(),
    }
}

pub(crate) fn makespan(answer: &Answer) -> String {
    answer
        .found()
        .map_or_else(|| describe(answer), |found| found.makespan.to_string())
}
