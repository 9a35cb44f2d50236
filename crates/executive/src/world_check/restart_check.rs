//! Check of a world that is killed during an action and restarted: it must report the outcome of
//! that action.

use std::sync::Arc;

use elbowroom::model::Task;
use elbowroom::num::Rational;

use super::protocol_driver::{ProtocolDriver, WorldLost};
use super::table::{Check, Findings};
use super::{advance_until, longest, wait_for_starts};
use crate::messages::excerpt;
use crate::world_protocol::{Capability, launch};

/// Ticket of a start that has ended before the world is killed. `RUNNING_TICKET` is running then, and
/// `UNKNOWN_TICKET` was never sent to the world.
const ENDED_TICKET: u64 = 0;
const RUNNING_TICKET: u64 = 4;
const UNKNOWN_TICKET: u64 = 5;

/// Kills the world during an action and restarts it. Returns the restarted world, or `Err` if the
/// conversation has ended.
pub(super) fn check_restart(
    mut player: ProtocolDriver,
    command: &str,
    task: &Arc<Task>,
    (name, duration): &(String, Rational),
) -> Result<ProtocolDriver, Findings> {
    let step = duration / Rational::from(10);
    let begun = player
        .start(RUNNING_TICKET, name, Some(duration))
        .and_then(|()| wait_for_starts(&mut player, &[RUNNING_TICKET], &longest(duration), &step));
    if begun.is_err() {
        return Err(player.abandon());
    }
    if !player.is_running(RUNNING_TICKET) {
        // The action was refused or takes no time, so nothing is running.
        return Ok(player);
    }
    let mut rest = player.kill();
    let killed = rest.now.clone();
    let program = match launch(command) {
        Ok(program) => program,
        Err(why) => {
            let why = format!("it cannot be restarted: {why}");
            rest.findings.record_violation(Check::Resumes, why);
            return Err(rest.findings);
        }
    };
    let name = name.as_str();
    let open = [
        (ENDED_TICKET, name, true),
        (RUNNING_TICKET, name, true),
        (UNKNOWN_TICKET, name, false),
    ];
    let again = ProtocolDriver::resumed(program, task, rest, &open);
    let mut player = again.map_err(|(WorldLost, findings)| findings)?;
    player.record_begun(ENDED_TICKET);
    match check_recalled(&mut player, &killed, duration) {
        Ok(()) => Ok(player),
        Err(WorldLost) => Err(player.abandon()),
    }
}

/// Checks what the restarted world reports of its earlier starts.
fn check_recalled(
    player: &mut ProtocolDriver,
    killed: &Rational,
    duration: &Rational,
) -> Result<(), WorldLost> {
    player.recall(&[ENDED_TICKET, RUNNING_TICKET, UNKNOWN_TICKET])?;
    player.findings.mark_done(Check::Resumes);
    if !player.can(Capability::Resume) {
        let why = "it no longer claims `resume` after the restart";
        player.findings.record_violation(Check::Resumes, why);
    }
    if !player.has_ended(ENDED_TICKET) {
        let why = if player.is_unknown(ENDED_TICKET) {
            format!(
                "it had reported the end of start {ENDED_TICKET}, but answers `unknown` for it \
                 after the restart"
            )
        } else {
            format!(
                "start {ENDED_TICKET} had ended, but it does not answer `ended` for it after the \
                 restart"
            )
        };
        player.findings.record_violation(Check::Resumes, why);
    }
    for ticket in [RUNNING_TICKET, UNKNOWN_TICKET] {
        if !player.has_begun(ticket) && !player.is_unknown(ticket) {
            let why = format!(
                "it answers neither `started` nor `ended` nor `unknown` for start {ticket} after \
                 the restart"
            );
            player.findings.record_violation(Check::Resumes, why);
        }
    }
    if player.is_unknown(RUNNING_TICKET) {
        let why = format!(
            "it had reported start {RUNNING_TICKET}, but answers `unknown` for it after the \
             restart; record each start before it begins (in Python: `World(…, ledger=FILE)`), or \
             do not claim `resume`"
        );
        player.findings.record_violation(Check::Resumes, why);
    }
    let long = longest(duration);
    let step = (duration / Rational::from(10)).max(Rational::ONE);
    advance_until(player, &long, &step, |player| {
        !player.is_running(RUNNING_TICKET)
    })?;
    if player.is_running(RUNNING_TICKET) {
        let why = format!(
            "start {RUNNING_TICKET} had not ended {} s after the restart",
            long.to_f64()
        );
        player.findings.record_violation(Check::Resumes, why);
    }
    // The start was reported before the kill, so it cannot be later.
    let began = player.started(RUNNING_TICKET).cloned();
    if let Some(began) = began.filter(|began| began > killed) {
        let why = format!(
            "an action that was running at {} started a second time at {}; no action may start twice",
            killed.to_f64(),
            began.to_f64()
        );
        player.findings.record_violation(Check::Resumes, why);
    }
    if player.has_begun(UNKNOWN_TICKET) {
        let name = excerpt(player.name_of(UNKNOWN_TICKET));
        let why = format!(
            "it never received start {UNKNOWN_TICKET}, but reports that {name} was started for it"
        );
        player.findings.record_violation(Check::Resumes, why);
    }
    Ok(())
}
