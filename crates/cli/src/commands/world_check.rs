//! `elbowroom world-check`: conformance test of a program with the world protocol.

mod protocol_driver;
mod restart_check;
mod table;

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
use crate::terminal::{ERROR, HINT, SUCCESS, TextLayout, styled};
use crate::wrap::wrap;
use elbowroom_executive::messages::{escape_control, excerpt};
use elbowroom_executive::world_protocol::{Capability, Greeting, launch};
use protocol_driver::{ProtocolDriver, WorldLost};
use restart_check::check_restart;
use table::{Check, Findings, Outcome, Row};

/// Default domain, for checks without a plan.
const DOMAIN: &str = "(define (domain world-check) (:requirements :durative-actions)
    (:predicates (waited))
    (:durative-action wait-a-second :parameters () :duration (= ?duration 1)
        :condition (and) :effect (at end (waited))))";
const PROBLEM: &str =
    "(define (problem world-check) (:domain world-check) (:init) (:goal (waited)))";
const ACTION: &str = "(wait-a-second)";

/// Maximum time of an action beyond three times its planned duration, in seconds of the world.
const END_TOLERANCE: i64 = 10;

/// Maximum time from a cancel to the end of the action, in seconds of the world.
const CANCEL_TOLERANCE: i64 = 5;

/// Runs the protocol with the world and prints the violations.
pub(crate) fn run(arguments: &WorldCheckArgs, output: &mut Output) -> Answer {
    let (task, actions) = script(arguments, output)?;
    let program = launch(&arguments.command).map_err(|why| {
        Failure::new(
            format!("cannot start the world `{}`: {why}", arguments.command),
            "give a program and its arguments, separated by spaces, as one argument",
        )
    })?;
    let patience = Duration::try_from_secs_f64(arguments.answer_within.to_f64());
    let patience = patience.unwrap_or(Duration::MAX);
    let task = Arc::new(task);
    let (rows, greeting) = match ProtocolDriver::new(program, &task, patience) {
        Ok(mut player) => {
            let outcome = run_actions(&mut player, &task, &actions);
            let greeting = player.greeting().cloned();
            let is_over = outcome.is_err();
            if !is_over {
                player.skip_unclaimed_checks();
            }
            let last = if is_over {
                Err(player.abandon())
            } else if player.can(Capability::Resume) {
                check_restart(player, &arguments.command, &task, &actions[0])
            } else {
                Ok(player)
            };
            let rows = match last {
                Ok(player) => player.stop().rows(None),
                Err(findings) => rows_of_aborted_check(findings),
            };
            (rows, greeting)
        }
        Err((WorldLost, findings)) => (rows_of_aborted_check(findings), None),
    };
    let conforms = rows.iter().all(|row| row.outcome != Outcome::Wrong);
    if arguments.json {
        output.json(&json!({
            "format": "elbowroom-world-check",
            "version": 1,
            "command": arguments.command,
            "speaks": greeting.as_ref().map_or(1, |greeting| greeting.version),
            "name": greeting.as_ref().map(|greeting| &greeting.name),
            "can": greeting.as_ref().map(|greeting| &greeting.can),
            "conforms": conforms,
            "checks": rows,
        }))?;
    } else {
        output::print(&text(&rows, greeting.as_ref(), conforms))?;
    }
    Ok(if conforms { Exit::Yes } else { Exit::No })
}

fn rows_of_aborted_check(findings: Findings) -> Vec<Row> {
    findings.rows(Some("the conversation ended before this check"))
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

fn run_actions(
    player: &mut ProtocolDriver,
    task: &Task,
    actions: &[(String, Rational)],
) -> Result<(), WorldLost> {
    // Time must pass although no action was started.
    advance_until(player, &Rational::ONE, &Rational::ONE, |_| false)?;
    if player.can(Capability::Beliefs) {
        let faults = player.findings.violation_count();
        player.findings.mark_done(Check::AcceptsBeliefs);
        let heard = send_beliefs(player, task);
        if heard.is_err() || player.findings.violation_count() > faults {
            let why = "it failed after a message `believed`, which needs no answer";
            player.findings.record_violation(Check::AcceptsBeliefs, why);
        }
        heard?;
    }
    let (name, duration) = &actions[0];
    let (other, other_duration) = actions.last().unwrap_or(&actions[0]);
    let long = longest(duration).max(longest(other_duration));
    let step = (duration / Rational::from(10)).max(Rational::ONE);

    // One action until its end.
    player.start(0, name, Some(duration))?;
    wait_for_starts(player, &[0], &long, &step)?;
    wait_for_ends(player, &[0], &long, &step)?;
    if let Some(why) = player.failure(0) {
        let why = format!("{} failed, so this was not checked: {}", name, excerpt(why));
        player.findings.record_violation(Check::Starts, why);
        return player.poll();
    }

    // Messages about a finished start and about unknown ones.
    player.findings.mark_done(Check::IgnoresUnknownMessages);
    player.cancel(0)?;
    player.send_unknown_message()?;
    player.poll()?;
    advance_until(player, &Rational::ONE, &Rational::ONE, |_| false)?;

    // Two actions at a time. If the plan has only one action, it is started twice.
    player.start(1, name, Some(duration))?;
    player.start(2, other, Some(other_duration))?;
    wait_for_starts(player, &[1, 2], &long, &step)?;
    player.findings.mark_done(Check::RunsConcurrently);
    if player.failure(1).or(player.failure(2)).is_some() {
        let why = "one of two actions that were started together was refused";
        player
            .findings
            .record_violation(Check::RunsConcurrently, why);
    }
    wait_for_ends(player, &[1, 2], &long, &step)?;

    // An action that is cancelled.
    if player.can_cancel() {
        player.start(3, name, Some(duration))?;
        wait_for_starts(player, &[3], &long, &step)?;
        player.cancel(3)?;
        let limit = Rational::from(CANCEL_TOLERANCE);
        advance_until(player, &limit, &Rational::ONE, |player| player.has_ended(3))?;
        player.findings.mark_done(Check::Cancels);
        if !player.has_ended(3) {
            let why = format!("{name} had not ended {CANCEL_TOLERANCE} s after it was cancelled");
            player.findings.record_violation(Check::Cancels, why);
        }
    }
    // Repeated reports would arrive within this time.
    advance_until(player, &Rational::ONE, &Rational::ONE, |_| false)?;
    player.findings.mark_done(Check::EndsOnce);
    Ok(())
}

/// Sends the initial beliefs, then that a value is unknown, then that it is known again.
fn send_beliefs(player: &mut ProtocolDriver, task: &Task) -> Result<(), WorldLost> {
    let initial = task.initial();
    let values = || initial.values.iter();
    let known = values().map(|(fluent, value)| (*fluent, Some(value)));
    player.send_beliefs(task, initial.facts.iter().copied(), known)?;
    player.poll()?;
    for is_known in [false, true] {
        let one = values().take(1);
        let one = one.map(|(fluent, value)| (*fluent, is_known.then_some(value)));
        player.send_beliefs(task, std::iter::empty(), one)?;
        player.poll()?;
    }
    Ok(())
}

fn longest(duration: &Rational) -> Rational {
    duration * Rational::from(3) + Rational::from(END_TOLERANCE)
}

/// Waits until the start or the refusal of each action is reported.
fn wait_for_starts(
    player: &mut ProtocolDriver,
    tickets: &[u64],
    long: &Rational,
    step: &Rational,
) -> Result<(), WorldLost> {
    let have_begun = |player: &ProtocolDriver| tickets.iter().all(|it| player.has_begun(*it));
    advance_until(player, long, step, have_begun)?;
    player.findings.mark_done(Check::Starts);
    for ticket in tickets {
        if player.has_begun(*ticket) {
            continue;
        }
        let why = format!("start {ticket} was not reported within {} s", long.to_f64());
        player.findings.record_violation(Check::Starts, why);
    }
    Ok(())
}

/// Waits until each action has ended.
fn wait_for_ends(
    player: &mut ProtocolDriver,
    tickets: &[u64],
    long: &Rational,
    step: &Rational,
) -> Result<(), WorldLost> {
    let have_ended = |player: &ProtocolDriver| {
        tickets
            .iter()
            .all(|it| player.has_ended(*it) || !player.is_running(*it))
    };
    advance_until(player, long, step, have_ended)?;
    player.findings.mark_done(Check::Ends);
    for ticket in tickets {
        if !player.is_running(*ticket) {
            continue;
        }
        let why = format!("start {ticket} had not ended {} s later", long.to_f64());
        player.findings.record_violation(Check::Ends, why);
    }
    Ok(())
}

/// Lets time pass in steps until `is_enough`, at most for `long`.
fn advance_until(
    player: &mut ProtocolDriver,
    long: &Rational,
    step: &Rational,
    is_enough: impl Fn(&ProtocolDriver) -> bool,
) -> Result<(), WorldLost> {
    let last = &player.now + long;
    // Answers without progress of the clock are limited, because each of them should contain a
    // report.
    let mut idle = 0;
    while !is_enough(player) && player.now < last {
        let before = player.now.clone();
        let until = (&before + step).min(last.clone());
        player.wait(&until)?;
        idle = if player.now > before { 0 } else { idle + 1 };
        if idle > MOST_IDLE {
            let why = format!(
                "its clock does not advance beyond {}: {MOST_IDLE} answers brought no progress",
                before.to_f64()
            );
            player.findings.record_violation(Check::KeepsTime, why);
            return Err(WorldLost);
        }
    }
    Ok(())
}

/// Maximum number of consecutive answers that leave the time unchanged.
const MOST_IDLE: usize = 100;

fn text(rows: &[Row], greeting: Option<&Greeting>, conforms: bool) -> String {
    let width = TextLayout::of_stdout().width;
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
