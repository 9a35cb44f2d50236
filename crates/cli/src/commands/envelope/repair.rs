//! `elbowroom envelope --repair`: the cheapest change that makes the plan work.

use std::fmt::Write as _;
use std::sync::Arc;

use elbowroom::answers::RequestError;
use elbowroom::answers::repair::{
    Change, Orders, RepairFinding, RepairOutcome, RepairRequest, partial_result, repair,
};
use elbowroom::model::TimeTriggeredPlan;
use elbowroom::num::Rational;
use elbowroom::{AnyPlan, plan_text};

use super::failure;
use crate::args::EnvelopeArgs;
use crate::deadline::run_with_deadline;
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use crate::terminal::{EMPHASIS, ERROR, HINT, SUCCESS, TextLayout, stdout_layout, styled};
use crate::time_limit::{Stopwatch, duration};
use elbowroom::report::console::push_wrapped;

/// Number of digits printed; `--json` has exact numbers.
const DIGITS: u32 = 6;
/// Maximum number of reasons printed; `--json` has all.
const REASONS_SHOWN: usize = 8;
/// Limitation of the answer if not all other orders were searched.
const OTHER_ORDERS: &str =
    "The search of other orders of interfering actions was incomplete; one may cost less.";

/// Prints the cheapest repair.
pub(super) fn run(arguments: &EnvelopeArgs, output: &mut Output) -> Answer {
    arguments.check_repair()?;
    let limit = arguments.time_limit.as_ref().map(duration);
    let stopwatch = Stopwatch::start(&Interrupt::listen()).with_limit(limit);
    let task = input::task(&arguments.problem, &arguments.epsilon, output)?;
    let read = |option: &str, texts: &[String]| {
        let specs = super::specifications(texts);
        specs.map_err(|_| invalid_specification(option, texts))
    };
    let request = RepairRequest {
        name: arguments.plan.display().to_string(),
        change: read("--change", &arguments.change)?,
        keep: read("--keep", &arguments.keep)?,
        guarantee: arguments.guarantee.unwrap_or_default(),
        ..RepairRequest::new(
            &Arc::new(task.clone()),
            input::any_plan(&task, &arguments.plan, &arguments.rounding(), output)?,
        )
    };
    let (request, mut watch) = (Arc::new(request), stopwatch.clone());
    let theirs = Arc::clone(&request);
    let outcome = run_with_deadline(
        stopwatch,
        move || repair(&theirs, &mut watch),
        |halt| Ok(partial_result(&request, halt)),
    )
    .map_err(refused)?;
    if arguments.json {
        output.document(&outcome.answer)?;
    } else {
        output::print(&text(&outcome, &request.plan, stdout_layout()))?;
    }
    Ok(match &outcome.answer.finding {
        RepairFinding::Repaired { .. } => Exit::Yes,
        RepairFinding::Impossible {
            orders: Orders::All,
            ..
        } => Exit::No,
        // A repair may exist in another order.
        RepairFinding::Impossible {
            orders: Orders::Kept,
            ..
        }
        | RepairFinding::None { .. } => Exit::Limit,
    })
}

/// Returns the failure to parse one of the specifications of an option.
fn invalid_specification(option: &str, texts: &[String]) -> Failure {
    let mut failures = texts.iter().filter_map(|text| {
        let error = text
            .parse::<elbowroom::plan::parametrize::VarySpec>()
            .err()?;
        Some(error.to_string().replace("--vary", option))
    });
    Failure::new(failures.next().unwrap_or_default(), "")
}

/// Converts a request error to a failure. Messages about `--vary` name `--change` and `--keep`
/// instead.
fn refused(error: RequestError) -> Failure {
    match error {
        RequestError::Pipeline(error) => {
            let message = error.to_string();
            Failure::new(message.replace("`--vary ", "`--change/--keep "), "")
        }
        error => failure(error),
    }
}

fn text(outcome: &RepairOutcome, given: &AnyPlan, look: TextLayout) -> String {
    let file = &outcome.answer.plan;
    let mut text = String::new();
    let mut say = |words: &str, indent: usize| push_wrapped(&mut text, words, indent, look.width);
    match &outcome.answer.finding {
        RepairFinding::Impossible { because, orders } => {
            let no = styled(ERROR, "no repair");
            let order = match orders {
                Orders::All => "",
                Orders::Kept => " in the order of its interfering actions",
            };
            say(
                &format!("{no}: no allowed change makes {file} work{order}"),
                0,
            );
            for reason in because.iter().take(REASONS_SHOWN) {
                say(reason, 2);
            }
            if *orders == Orders::Kept {
                say(OTHER_ORDERS, 0);
            }
        }
        RepairFinding::None { reason, bound } => {
            let unknown = styled(HINT, "undecided");
            say(&format!("{unknown}: {file}"), 0);
            let bound = bound.to_decimal(DIGITS);
            say(&format!("{reason}; no repair costs less than {bound}."), 2);
        }
        RepairFinding::Repaired {
            changes,
            cost,
            bound,
            because,
            keeps,
            not_guaranteed,
            orders,
            reordered,
            ..
        } => {
            let works = styled(SUCCESS, "repaired");
            match (&changes[..], &keeps[..]) {
                ([], []) if has_other_times(outcome, given) => say(
                    &format!(
                        "{works}: {file} works with the times and durations below; domain and problem need not change"
                    ),
                    0,
                ),
                ([], []) => say(
                    &format!("{works}: {file} works, and nothing has to change"),
                    0,
                ),
                ([], _) => say(
                    &format!(
                        "{works}: {file} works if the dispatcher enforces the bounds below; \
                         nothing else has to change"
                    ),
                    0,
                ),
                _ => say(&format!("{works}: {file} works with"), 0),
            }
            for change in changes {
                say(&describe_change(change), 2);
            }
            if !changes.is_empty() {
                say(&optimality_text(cost, bound, *orders), 0);
                if *orders == Orders::Kept {
                    say(OTHER_ORDERS, 0);
                }
            }
            if *reordered {
                say(
                    "The order of interfering actions differs from that of the plan.",
                    0,
                );
            }
            section(&mut text, "Reasons for the changes", because, changes, look);
            section(&mut text, "Bounds to enforce", keeps, &[()], look);
            if let Some(why_not) = not_guaranteed {
                let caution =
                    format!("The plan is valid at these times, but not guaranteed: {why_not}");
                push_wrapped(&mut text, &caution, 0, look.width);
            }
            if let Some((task, plan)) = &outcome.repaired {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "\n{}", styled(EMPHASIS, "The plan, as validated"));
                for line in plan_text(task, plan).lines() {
                    let _ = writeln!(text, "  {line}");
                }
            }
        }
    }
    text
}

/// Returns `true` if the repaired plan has another time or duration than the given one.
fn has_other_times(outcome: &RepairOutcome, given: &AnyPlan) -> bool {
    let (Some((_, repaired)), AnyPlan::TimeTriggered(given)) = (&outcome.repaired, given) else {
        return false;
    };
    let steps = |plan: &TimeTriggeredPlan| -> Vec<_> {
        let steps = plan.steps.iter();
        let steps = steps.map(|it| {
            (
                it.start.clone(),
                it.action.name.clone(),
                it.duration.clone(),
            )
        });
        let mut steps: Vec<_> = steps.collect();
        steps.sort();
        steps
    };
    steps(repaired) != steps(given)
}

/// `deadline of (open shop): 120 instead of 100`.
fn describe_change(change: &Change) -> String {
    format!(
        "{}: {} instead of {}",
        change.quantity,
        change.to.to_decimal(DIGITS),
        change.from.to_decimal(DIGITS)
    )
}

fn optimality_text(cost: &Rational, bound: &Rational, orders: Orders) -> String {
    let costs = bound.to_decimal(DIGITS);
    let order = match orders {
        Orders::All => "",
        Orders::Kept => " in this order of interfering actions",
    };
    if cost == bound {
        format!("No cheaper change makes it work{order} (cost {costs}).")
    } else {
        format!(
            "Each change that makes it work{order} costs more than {costs}; the excess can be \
             arbitrarily small."
        )
    }
}

/// Appends a list with a headline, unless `items` or `about` is empty.
fn section<T>(text: &mut String, headline: &str, items: &[String], about: &[T], look: TextLayout) {
    if items.is_empty() || about.is_empty() {
        return;
    }
    // Writing to a string cannot fail.
    let _ = writeln!(text, "\n{}", styled(EMPHASIS, headline));
    for item in items.iter().take(REASONS_SHOWN) {
        push_wrapped(text, item, 2, look.width);
    }
    if items.len() > REASONS_SHOWN {
        let more = format!("and {} more (--json)", items.len() - REASONS_SHOWN);
        push_wrapped(text, &more, 2, look.width);
    }
}
