//! `elbowroom envelope --faults`: the failures that a plan affords.

use std::fmt::Write as _;
use std::sync::Arc;

use elbowroom::answers::faults::{
    Afforded, Faults, FaultsAnswer, FaultsFinding, FaultsRequest, faults, partial_result,
};
use elbowroom::num::Rational;
use elbowroom::report::console::push_wrapped;
use elbowroom::report::decimal::{Rounding, rounded_inwards};

use super::{failure, request};
use crate::args::{EnvelopeArgs, FaultCount};
use crate::deadline::run_with_deadline;
use crate::exit::{Answer, Exit};
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use crate::terminal::{EMPHASIS, ERROR, HINT, SUCCESS, TextLayout, stdout_layout, styled};
use crate::time_limit::{Stopwatch, duration};

/// Number of digits printed; `--json` has exact numbers.
const DIGITS: u32 = 3;
/// Maximum number of actions without retries that are printed; `--json` has all.
const ACTIONS_SHOWN: usize = 6;

/// Prints the failures that a plan affords.
pub(super) fn run(arguments: &EnvelopeArgs, count: FaultCount, output: &mut Output) -> Answer {
    arguments.check_faults()?;
    let limit = arguments.time_limit.as_ref().map(duration);
    let stopwatch = Stopwatch::start(&Interrupt::listen()).with_limit(limit);
    let recovery = arguments.recovery.clone();
    let request = FaultsRequest {
        envelope: request(arguments, output)?,
        faults: count.0,
        retries: arguments
            .retries
            .map(|retries| usize::try_from(retries).unwrap_or(usize::MAX)),
        recovery: recovery.map_or([Rational::ZERO, Rational::ZERO], |times| times.0),
    };
    let (request, mut watch) = (Arc::new(request), stopwatch.clone());
    let theirs = Arc::clone(&request);
    let answer = run_with_deadline(
        stopwatch,
        move || faults(&theirs, &mut watch),
        |_| Ok(partial_result(&request)),
    )
    .map_err(failure)?;
    if arguments.json {
        output.document(&answer)?;
    } else {
        output::print(&text(&answer, stdout_layout()))?;
    }
    Ok(exit(&answer))
}

fn exit(answer: &FaultsAnswer) -> Exit {
    match (&answer.finding, answer.faults) {
        (FaultsFinding::Fails { .. }, _) => Exit::No,
        (FaultsFinding::None { .. }, _) => Exit::Limit,
        (FaultsFinding::Faults(_), None) => Exit::Yes,
        (FaultsFinding::Faults(own), Some(count)) => match verdict(own, count) {
            Some(true) => Exit::Yes,
            Some(false) => Exit::No,
            None => Exit::Limit,
        },
    }
}

/// Returns `true` if the plan affords this number of failures with the planned durations; `None` if that is undecided.
fn verdict(faults: &Faults, count: usize) -> Option<bool> {
    let Afforded {
        at_least, at_most, ..
    } = faults.as_planned;
    if at_least.is_some_and(|least| least >= count) {
        return Some(true);
    }
    at_most.is_some_and(|most| most < count).then_some(false)
}

fn text(answer: &FaultsAnswer, look: TextLayout) -> String {
    let mut text = String::new();
    let file = &answer.plan;
    let own = match &answer.finding {
        FaultsFinding::Faults(own) => own,
        FaultsFinding::Fails { reason } => {
            let no = styled(ERROR, "no");
            let _ = writeln!(text, "{no}: {file} does not work, even without failures");
            push_wrapped(&mut text, reason, 2, look.width);
            return text;
        }
        FaultsFinding::None { reason } => {
            let unknown = styled(HINT, "undecided");
            let _ = writeln!(text, "{unknown}: {file}");
            push_wrapped(&mut text, &format!("{reason}."), 2, look.width);
            return text;
        }
    };
    if let Some(count) = answer.faults {
        let failures = number_of(count);
        let line = match verdict(own, count) {
            Some(true) => format!("{}: {file} affords {failures}", styled(SUCCESS, "yes")),
            Some(false) => format!("{}: {file} does not afford {failures}", styled(ERROR, "no")),
            None => format!(
                "{}: whether {file} affords {failures}",
                styled(HINT, "undecided")
            ),
        };
        let _ = writeln!(text, "{line}\n");
    } else {
        let _ = writeln!(
            text,
            "{}\n",
            styled(EMPHASIS, &format!("Failures that {file} affords"))
        );
    }
    let planned = describe(own.as_planned);
    let in_box = describe(own.in_box);
    let planned =
        format!("For all durations from the lower ends of the box to the planned ones: {planned}.");
    push_wrapped(&mut text, &planned, 0, look.width);
    push_defeat(&mut text, own, look);
    let in_box =
        format!("For all durations in the box of `elbowroom envelope` without --faults: {in_box}.");
    push_wrapped(&mut text, &in_box, 0, look.width);
    push_not_longer(&mut text, own, look);
    push_table(&mut text, own);
    push_box(&mut text, own);
    if !own.without_retries.is_empty() {
        let _ = writeln!(text, "\n{}", styled(EMPHASIS, "No failure is covered of"));
        for action in own.without_retries.iter().take(ACTIONS_SHOWN) {
            let line = format!("{}: {}", action.action, action.reason);
            push_wrapped(&mut text, &line, 2, look.width);
        }
        if own.without_retries.len() > ACTIONS_SHOWN {
            let more = own.without_retries.len() - ACTIONS_SHOWN;
            let _ = writeln!(text, "  and {more} more (--json)");
        }
    }
    text.push('\n');
    let each = match answer.retries {
        None => String::new(),
        Some(most) => format!(", at most {} of each action", number_of(most)),
    };
    let recovery = [&answer.recovery_at_least, &answer.recovery_at_most];
    let recovery = match recovery.map(|time| time.to_decimal(DIGITS)) {
        [least, most] if least == most => least,
        [least, most] => format!("{least} to {most}"),
    };
    push_wrapped(
        &mut text,
        &format!(
            "One strategy of the executor works for all of these failures{each}, whenever they \
             occur. A failed attempt takes no longer than its action may take, and reverts the \
             effects of its start; {recovery} later the action can start again."
        ),
        0,
        look.width,
    );
    text
}

/// Appends the failures that defeat every strategy.
fn push_defeat(text: &mut String, own: &Faults, look: TextLayout) {
    if own.defeated_by.is_empty() {
        return;
    }
    let failed = own.defeated_by.iter();
    let failed = failed.map(|one| match one.failures {
        1 => one.action.clone(),
        many => format!("{} ({many} times)", one.action),
    });
    let failed: Vec<String> = failed.collect();
    let line = format!(
        "No strategy works for all of these durations if these actions fail: {}.",
        failed.join(", ")
    );
    push_wrapped(text, &line, 0, look.width);
}

/// Appends the durations that cannot be longer.
fn push_not_longer(text: &mut String, own: &Faults, look: TextLayout) {
    let count = own.not_longer.len();
    if count == 0 {
        return;
    }
    let action_of = |name: &String| {
        let row = own.box_with_faults.iter().find(|row| row.name == *name);
        let action = row.and_then(|row| row.action.clone());
        action.unwrap_or_else(|| name.clone())
    };
    let shown = own.not_longer.iter().take(ACTIONS_SHOWN);
    let mut names: Vec<String> = shown.map(action_of).collect();
    if count > ACTIONS_SHOWN {
        names.push(format!("{} more (--json)", count - ACTIONS_SHOWN));
    }
    let line = format!("Never longer than planned: {}.", names.join(", "));
    push_wrapped(text, &line, 0, look.width);
}

fn push_table(text: &mut String, own: &Faults) {
    if own.table.is_empty() {
        return;
    }
    let headline = if own.not_longer.is_empty() {
        "failures  all durations may be longer by"
    } else {
        "failures  all other durations may be longer by"
    };
    let _ = writeln!(text, "\n{}", styled(EMPHASIS, headline));
    for row in &own.table {
        let percent = (&row.slack * Rational::from(100)).to_decimal(1);
        let mark = if row.exact { "" } else { " or more" };
        let _ = writeln!(text, "{:>8}  {percent} %{mark}", row.faults);
    }
}

fn push_box(text: &mut String, own: &Faults) {
    let Some(faults) = own.box_faults else {
        return;
    };
    let headline = format!("Box with {}", number_of(faults));
    let _ = writeln!(text, "\n{}", styled(EMPHASIS, &headline));
    let width = own.box_with_faults.iter().map(|row| row.name.len()).max();
    for row in &own.box_with_faults {
        let _ = writeln!(
            text,
            "  {:width$}  [{}, {}]  {}",
            row.name,
            rounded_inwards(&row.lower, &row.nominal, Rounding::Up),
            rounded_inwards(&row.upper, &row.nominal, Rounding::Down),
            row.action.as_deref().unwrap_or_default(),
            width = width.unwrap_or(0)
        );
    }
}

fn describe(afforded: Afforded) -> String {
    match (afforded.at_least, afforded.at_most) {
        (Some(least), Some(most)) if least == most => format!("{}, exactly", number_of(least)),
        (Some(least), Some(most)) => format!("at least {}, at most {most}", number_of(least)),
        (Some(least), None) if least == afforded.searched => {
            format!("{} or more", number_of(least))
        }
        (Some(least), None) => format!("at least {}", number_of(least)),
        (None, Some(most)) => format!("at most {}", number_of(most)),
        (None, None) => "none is proved".to_owned(),
    }
}

fn number_of(count: usize) -> String {
    match count {
        1 => "1 failure".to_owned(),
        many => format!("{many} failures"),
    }
}
