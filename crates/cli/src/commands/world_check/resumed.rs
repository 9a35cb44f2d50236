//! Check of a world that is killed during an action and restarted: it must report the outcome of
//! that action.

use std::sync::Arc;

use elbowroom::model::Task;
use elbowroom::num::Rational;

use super::player::{Gone, Player};
use super::table::{Check, Findings};
use super::{longest, pass, until_begun};
use elbowroom_executive::messages::excerpt;
use elbowroom_executive::world_protocol::{Capability, launch};

/// Ticket of a start that has ended before the world is killed. `UNDER_WAY` is running then, and
/// `UNTOLD` was never sent to the world.
const OVER: u64 = 0;
const UNDER_WAY: u64 = 4;
const UNTOLD: u64 = 5;

/// Kills the world during an action and restarts it. Returns the restarted world, or `Err` if the
/// conversation has ended.
pub(super) fn resumed(
    mut player: Player,
    command: &str,
    task: &Arc<Task>,
    (name, duration): &(String, Rational),
) -> Result<Player, Findings> {
    let step = duration / Rational::from(10);
    let begun = player
        .start(UNDER_WAY, name, Some(duration))
        .and_then(|()| until_begun(&mut player, &[UNDER_WAY], &longest(duration), &step));
    if begun.is_err() {
        return Err(player.abandon());
    }
    if !player.is_running(UNDER_WAY) {
        // The action was refused or takes no time, so nothing is running.
        return Ok(player);
    }
    let mut rest = player.killed();
    let killed = rest.now.clone();
    let program = match launch(command) {
        Ok(program) => program,
        Err(why) => {
            let why = format!("it cannot be started again: {why}");
            rest.findings.wrong(Check::Resumes, why);
            return Err(rest.findings);
        }
    };
    let name = name.as_str();
    let open = [
        (OVER, name, true),
        (UNDER_WAY, name, true),
        (UNTOLD, name, false),
    ];
    let again = Player::resumed(program, task, rest, &open);
    let mut player = again.map_err(|(Gone, findings)| findings)?;
    player.note_begun(OVER);
    match asked(&mut player, &killed, duration) {
        Ok(()) => Ok(player),
        Err(Gone) => Err(player.abandon()),
    }
}

/// Checks what the restarted world reports of its earlier starts.
fn asked(player: &mut Player, killed: &Rational, duration: &Rational) -> Result<(), Gone> {
    player.recall(&[OVER, UNDER_WAY, UNTOLD])?;
    player.findings.look_at(Check::Resumes);
    if !player.can(Capability::Resume) {
        let why = "started again, it does not claim `resume` any more";
        player.findings.wrong(Check::Resumes, why);
    }
    if !player.has_ended(OVER) {
        let why = if player.is_unknown(OVER) {
            format!(
                "it had reported the end of start {OVER}, and knows nothing of it when it is started again"
            )
        } else {
            format!(
                "start {OVER} was over, and it does not answer `ended` when asked about it again"
            )
        };
        player.findings.wrong(Check::Resumes, why);
    }
    for ticket in [UNDER_WAY, UNTOLD] {
        if !player.has_begun(ticket) && !player.is_unknown(ticket) {
            let why = format!(
                "asked for the outcome of start {ticket}, it answers neither `started` nor `ended` nor `unknown`"
            );
            player.findings.wrong(Check::Resumes, why);
        }
    }
    if player.is_unknown(UNDER_WAY) {
        let why = format!(
            "it had reported start {UNDER_WAY}, and knows nothing of it when it is started again; write each start down \
             before it begins (in Python: `World(…, ledger=FILE)`), or do not claim `resume`"
        );
        player.findings.wrong(Check::Resumes, why);
    }
    let long = longest(duration);
    let step = (duration / Rational::from(10)).max(Rational::ONE);
    pass(player, &long, &step, |player| !player.is_running(UNDER_WAY))?;
    if player.is_running(UNDER_WAY) {
        let why = format!(
            "start {UNDER_WAY} had not ended {} s after it was started again",
            long.to_f64()
        );
        player.findings.wrong(Check::Resumes, why);
    }
    // The start was reported before the kill, so it cannot be later.
    let began = player.started(UNDER_WAY).cloned();
    if let Some(began) = began.filter(|began| began > killed) {
        let why = format!(
            "an action that was running at {} started again at {}; no action may start twice",
            killed.to_f64(),
            began.to_f64()
        );
        player.findings.wrong(Check::Resumes, why);
    }
    if player.has_begun(UNTOLD) {
        let name = excerpt(player.name_of(UNTOLD));
        let why =
            format!("it never received start {UNTOLD}, and reports that {name} was started for it");
        player.findings.wrong(Check::Resumes, why);
    }
    Ok(())
}
