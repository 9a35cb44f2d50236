//! `elbowroom envelope --method exact`: with which values does the plan work?

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::answers::region::{PieceAnswer, RegionFinding, RegionOutcome, region};
use elbowroom::answers::{EnvelopeRequest, Event, Halt, Watcher};

use super::{failure, specifications};
use crate::args::{self, EnvelopeArgs};
use crate::exit::{Answer, Exit};
use crate::input;
use crate::interrupt::Interrupt;
use crate::limits::push_wrapped;
use crate::look::{BAD, FAINT, GOOD, HINT, Look, styled};
use crate::output::{self, Output};
use crate::stopwatch::{Stopwatch, duration};
use crate::words::counted;

/// So many of the reasons for an inequality are printed; `--json` has all.
const REASONS_SHOWN: usize = 2;

/// Prints the region.
pub(super) fn run(arguments: &EnvelopeArgs, output: &mut Output) -> Answer {
    let limit = arguments.time_limit.as_ref().map(duration);
    let stopwatch = Stopwatch::start(&Interrupt::listen()).until(limit);
    let task = input::task(&arguments.problem, &arguments.epsilon, output)?;
    let mut vary = specifications(&arguments.vary)?;
    vary.extend(specifications(&args::controllable(
        &arguments.controllable,
    ))?);
    let plan = input::any_plan(&task, &arguments.plan, output)?;
    let request = EnvelopeRequest {
        name: arguments.plan.display().to_string(),
        vary,
        enforce: arguments.enforce,
        ..EnvelopeRequest::new(&Arc::new(task), plan)
    };
    let mut watch = Watch {
        stopwatch,
        plan: &arguments.plan,
    };
    let outcome = region(&request, &mut watch).map_err(failure)?;
    if arguments.json {
        output.document(&outcome.answer)?;
    } else {
        output::print(&text(&outcome, Look::of_stdout()))?;
    }
    Ok(match &outcome.answer.finding {
        RegionFinding::Region { pieces, .. } if !pieces.is_empty() => Exit::Yes,
        RegionFinding::None { .. } => Exit::Limit,
        _ => Exit::No,
    })
}

/// Obeys the clock and Ctrl-C, and tells of plans whose times are taken otherwise than they stand
/// there.
struct Watch<'a> {
    stopwatch: Stopwatch,
    plan: &'a Path,
}

impl Watcher for Watch<'_> {
    fn elapsed(&mut self) -> Duration {
        self.stopwatch.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<Halt> {
        self.stopwatch.flow()
    }

    fn notice(&mut self, event: &Event<'_>) {
        if let Event::Repaired(violation) = event {
            input::tell_repair(self.plan, violation);
        }
    }
}

fn text(outcome: &RegionOutcome, look: Look) -> String {
    let file = &outcome.answer.plan;
    let mut text = String::new();
    let mut say = |words: &str, indent: usize| push_wrapped(&mut text, words, indent, look.width);
    match &outcome.answer.finding {
        RegionFinding::Invalid { violation } => {
            say(
                &format!("{}: {file} does not work", styled(BAD, "invalid")),
                0,
            );
            say(&violation.message, 2);
        }
        RegionFinding::Unscheduled => {
            say(&format!("{}: {file}", styled(BAD, "no region")), 0);
            say(
                "The plan has no schedule at its nominal values, and the region goes by the order \
                 that happenings have there.",
                2,
            );
        }
        RegionFinding::None { reason } => {
            say(&format!("{}: {file}", styled(HINT, "not known")), 0);
            say(&format!("{reason}."), 2);
        }
        RegionFinding::Region { parameters, pieces } => {
            if parameters.is_empty() {
                say(&format!("{file}: there is nothing that may vary."), 0);
                return text;
            }
            match &pieces[..] {
                [] => say(
                    &format!("{}: {file} works with no values.", styled(BAD, "empty")),
                    0,
                ),
                [_] => say(
                    &format!(
                        "{}: {file} works with all values that satisfy",
                        styled(GOOD, "exact")
                    ),
                    0,
                ),
                several => say(
                    &format!(
                        "{}: {file} works with all values that satisfy one of {}",
                        styled(GOOD, "exact"),
                        counted(several.len(), "list")
                    ),
                    0,
                ),
            }
            for (index, piece) in pieces.iter().enumerate() {
                if pieces.len() > 1 {
                    // Writing to a string cannot fail.
                    let _ = writeln!(text, "list {}", index + 1);
                }
                rows(piece, look, &mut text);
            }
            text.push('\n');
            for parameter in parameters {
                let words = format!(
                    "{}: {}, {} as planned",
                    parameter.name, parameter.quantity, parameter.nominal
                );
                push_wrapped(&mut text, &words, 0, look.width);
            }
        }
    }
    text
}

fn rows(piece: &PieceAnswer, look: Look, text: &mut String) {
    for row in &piece.rows {
        push_wrapped(text, &row.text, 2, look.width);
        for reason in row.because.iter().take(REASONS_SHOWN) {
            let mut line = String::new();
            push_wrapped(&mut line, reason, 4, look.width);
            text.push_str(&styled(FAINT, line.trim_end()));
            text.push('\n');
        }
    }
}
