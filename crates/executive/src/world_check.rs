//! Conformance test of a program with the world protocol: [`check_world`].

mod protocol_driver;
mod restart_check;
mod table;

use std::sync::Arc;
use std::time::Duration;

use elbowroom::model::Task;
use elbowroom::num::Rational;

use crate::error::Error;
use crate::messages::excerpt;
use crate::world_protocol::{Capability, Greeting, launch};
use protocol_driver::{ProtocolDriver, WorldLost};
use restart_check::check_restart;
use table::{Check, Findings};

pub use table::{Outcome, Row};

/// Maximum time of an action beyond three times its planned duration, in seconds of the world.
const END_TOLERANCE: i64 = 10;

/// Maximum time from a cancel to the end of the action, in seconds of the world.
const CANCEL_TOLERANCE: i64 = 5;

/// Result of the conformance test.
#[derive(Clone, Debug)]
pub struct WorldCheckResult {
    /// The checks, with their outcomes.
    pub rows: Vec<Row>,
    /// The greeting of the world, if it sent one.
    pub greeting: Option<Greeting>,
}

impl WorldCheckResult {
    /// Returns `true` if no violation was found.
    pub fn conforms(&self) -> bool {
        self.rows.iter().all(|row| row.outcome != Outcome::Wrong)
    }
}

/// Starts the world, runs the protocol with these actions, and checks its answers. `actions` are one or two durative
/// actions with their durations.
///
/// # Errors
/// When the world cannot be started.
pub fn check_world(
    command: &str,
    task: &Arc<Task>,
    actions: &[(String, Rational)],
    answer_timeout: Duration,
) -> Result<WorldCheckResult, Error> {
    let program = launch(command).map_err(|why| {
        Error::new(
            format!("cannot start the world `{command}`: {why}"),
            "give a program and its arguments, separated by spaces, as one argument",
        )
    })?;
    let (rows, greeting) = match ProtocolDriver::new(program, task, answer_timeout) {
        Ok(mut driver) => {
            let outcome = run_actions(&mut driver, task, actions);
            let greeting = driver.greeting().cloned();
            let is_over = outcome.is_err();
            if !is_over {
                driver.skip_unclaimed_checks();
            }
            let last = if is_over {
                Err(driver.abandon())
            } else if driver.can(Capability::Resume) {
                check_restart(driver, command, task, &actions[0])
            } else {
                Ok(driver)
            };
            let rows = match last {
                Ok(driver) => driver.stop().rows(None),
                Err(findings) => rows_of_aborted_check(findings),
            };
            (rows, greeting)
        }
        Err((WorldLost, findings)) => (rows_of_aborted_check(findings), None),
    };
    Ok(WorldCheckResult { rows, greeting })
}

fn rows_of_aborted_check(findings: Findings) -> Vec<Row> {
    findings.rows(Some("the conversation ended before this check"))
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
        if idle > MAX_IDLE {
            let why = format!(
                "its clock does not advance beyond {}: {MAX_IDLE} answers brought no progress",
                before.to_f64()
            );
            player.findings.record_violation(Check::KeepsTime, why);
            return Err(WorldLost);
        }
    }
    Ok(())
}

/// Maximum number of consecutive answers that leave the time unchanged.
const MAX_IDLE: usize = 100;
