//! `elbowroom world-check`: conformance test of a program with the world protocol.

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::RoundingRule;
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::text::Source;
use serde_json::json;

use crate::args::{ProblemArgs, WorldCheckArgs};
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::output::{self, Output};
use crate::terminal::{ERROR, HINT, SUCCESS, stdout_layout, styled};
use elbowroom::report::console::wrap;
use elbowroom_executive::messages::escape_control;
use elbowroom_executive::world_check::{Outcome, Row, check_world};
use elbowroom_executive::world_protocol::Greeting;

/// Default domain, for checks without a plan.
const DOMAIN: &str = "(define (domain world-check) (:requirements :durative-actions)
    (:predicates (waited))
    (:durative-action wait-a-second :parameters () :duration (= ?duration 1)
        :condition (and) :effect (at end (waited))))";
const PROBLEM: &str =
    "(define (problem world-check) (:domain world-check) (:init) (:goal (waited)))";
const ACTION: &str = "(wait-a-second)";

/// Runs the protocol with the world and prints the violations.
pub(crate) fn run(arguments: &WorldCheckArgs, output: &mut Output) -> Answer {
    let (task, actions) = script(arguments, output)?;
    let timeout = Duration::try_from_secs_f64(arguments.answer_within.to_f64());
    let timeout = timeout.unwrap_or(Duration::MAX);
    let result = check_world(&arguments.command, &Arc::new(task), &actions, timeout)?;
    let (conforms, greeting) = (result.conforms(), &result.greeting);
    if arguments.json {
        output.json(&json!({
            "format": "elbowroom-world-check",
            "version": 1,
            "command": arguments.command,
            "speaks": greeting.as_ref().map_or(1, |greeting| greeting.version),
            "name": greeting.as_ref().map(|greeting| &greeting.name),
            "can": greeting.as_ref().map(|greeting| &greeting.can),
            "conforms": conforms,
            "checks": result.rows,
        }))?;
    } else {
        output::print(&text(&result.rows, greeting.as_ref(), conforms))?;
    }
    Ok(if conforms { Exit::Yes } else { Exit::No })
}

/// Returns the problem, and the actions to start, with their durations.
fn script(
    arguments: &WorldCheckArgs,
    output: &mut Output,
) -> Result<(Task, Vec<(String, Rational)>), Failure> {
    let (Some(domain), Some(problem), Some(plan)) =
        (&arguments.domain, &arguments.problem, &arguments.plan)
    else {
        let [domain, problem] = [("domain", DOMAIN), ("problem", PROBLEM)];
        let source = |(name, text)| Source::new(name, text);
        let read = elbowroom::pddl::read_problem(&source(domain), &source(problem));
        let task = Task::new(input::with_warnings(read, output)?);
        return Ok((task, vec![(ACTION.to_owned(), Rational::ONE)]));
    };
    let files = ProblemArgs::new(domain.clone(), problem.clone());
    let task = input::task(&files, &Rational::new(1, 1000), output)?;
    let steps = input::time_triggered(
        &task,
        plan,
        &RoundingRule::default(),
        input::FIXED_TIMES_ADVICE,
        output,
    )?
    .steps;
    let actions = steps.into_iter().filter_map(|step| {
        let duration = step.duration?;
        Some((step.action.name.clone(), duration))
    });
    let actions: Vec<_> = actions.take(2).collect();
    if actions.is_empty() {
        return Err(Failure::new(
            "the plan has no durative action",
            "give a plan with durative actions, or none",
        ));
    }
    Ok((task, actions))
}

fn text(rows: &[Row], greeting: Option<&Greeting>, conforms: bool) -> String {
    let width = stdout_layout().width;
    let mut text = match greeting {
        Some(greeting) => {
            let name = match greeting.name.as_str() {
                "" => "the world".to_owned(),
                name => escape_control(name),
            };
            let can = if greeting.can.is_empty() {
                "none".to_owned()
            } else {
                escape_control(&greeting.can.join(", "))
            };
            format!(
                "{name} uses protocol version {}; capabilities: {can}\n",
                greeting.version
            )
        }
        None => "the world uses protocol version 1: it sent no greeting\n".to_owned(),
    };
    for row in rows {
        let mark = match row.outcome {
            Outcome::Passed => styled(SUCCESS, "ok"),
            Outcome::Wrong => styled(ERROR, "wrong"),
            Outcome::Skipped => styled(HINT, "skipped"),
        };
        let line = format!("{mark}  {}: {}", row.check, row.what);
        let _ = writeln!(text, "{}", wrap(&line, width, 2));
        for why in &row.why {
            let _ = writeln!(text, "{}", wrap(&escape_control(why), width, 6));
        }
    }
    let wrong = rows
        .iter()
        .filter(|row| row.outcome == Outcome::Wrong)
        .count();
    let verdict = if conforms {
        styled(SUCCESS, "no violations")
    } else {
        styled(ERROR, &format!("{wrong} of {} checks failed", rows.len()))
    };
    let _ = writeln!(text, "{verdict}");
    text
}
