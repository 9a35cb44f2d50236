//! Text output of an envelope.

mod best;
mod example;
mod timeouts;

use std::fmt::Write as _;

use elbowroom::answers::envelope::{
    Best, ChosenDuration, Conditions, Deviation, EnvelopeFinding, EnvelopeOutcome, EnvelopeRequest,
    LimitedRange, Makespans, NominalFailure, QuantityKind, Range, Stop, UniformSlack,
    ValueOfInformation,
};

use elbowroom::num::Rational;

use crate::args::Order;
use crate::limits::{self};
use crate::number::{self, Rounding};
use crate::terminal::{EMPHASIS, ERROR, SECONDARY, SUCCESS, TextLayout, styled};
use best::{best_relaxations, objective_text};
use elbowroom::report::console::tolerance_table::{self as table, Row};
use elbowroom::report::console::{push_paragraph, push_wrapped};
use elbowroom_executive::messages::count_with_noun;
use example::{example, reason_text};

/// Renders the answer.
pub(super) fn text(
    request: &EnvelopeRequest,
    outcome: &EnvelopeOutcome,
    order: Order,
    look: TextLayout,
) -> String {
    let file = &request.name;
    match &outcome.answer.finding {
        EnvelopeFinding::Envelope { .. } => envelope(request, outcome, order, look),
        EnvelopeFinding::Fails(NominalFailure::Invalid { violation }) => {
            let mut text = no_slack(file, FAILS);
            push_wrapped(&mut text, &violation.message, 2, look.width);
            text
        }
        EnvelopeFinding::Fails(NominalFailure::AsPlanned { .. }) => {
            failure_text(request, outcome, look)
        }
        EnvelopeFinding::Inside { .. } => format!(
            "{}: {file} works everywhere in this box\n",
            styled(SUCCESS, "inside"),
        ),
        EnvelopeFinding::Outside { .. } => {
            let mut text = format!(
                "{}: {file} does not work everywhere in this box\n",
                styled(ERROR, "outside"),
            );
            push_reason(&mut text, request, outcome, look);
            push_timeout(&mut text, outcome, look);
            text
        }
        EnvelopeFinding::None { .. } => {
            "no result yet: the search was stopped before its first check\n".to_owned()
        }
    }
}

const FAILS: &str = "fails even if everything goes as planned";
const CAN_FAIL: &str = "can fail even if everything goes as planned";

fn no_slack(file: &str, fails: &str) -> String {
    format!("{}: {file} {fails}\n", styled(ERROR, "no elbow room"))
}

/// Renders the answer for a plan that fails, or may fail, with nominal values.
fn failure_text(request: &EnvelopeRequest, outcome: &EnvelopeOutcome, look: TextLayout) -> String {
    let has_schedule = outcome
        .explanation
        .as_ref()
        .is_some_and(|why| why.schedule.is_some());
    let fails = if has_schedule { CAN_FAIL } else { FAILS };
    let mut text = no_slack(&request.name, fails);
    match &outcome.explanation {
        Some(why_not) if !has_schedule => {
            push_wrapped(&mut text, &reason_text(why_not), 2, look.width);
        }
        _ => push_reason(&mut text, request, outcome, look),
    }
    push_timeout(&mut text, outcome, look);
    text
}

/// Appends the time-out that an action reaches, if there is no other reason.
fn push_timeout(text: &mut String, outcome: &EnvelopeOutcome, look: TextLayout) {
    let (EnvelopeFinding::Outside { counterexample, .. }
    | EnvelopeFinding::Fails(NominalFailure::AsPlanned { counterexample, .. })) =
        &outcome.answer.finding
    else {
        return;
    };
    if outcome.explanation.is_none() {
        push_wrapped(text, &counterexample.message, 2, look.width);
    }
}

/// Appends the reason why the plan does not work, with an example.
fn push_reason(
    text: &mut String,
    request: &EnvelopeRequest,
    outcome: &EnvelopeOutcome,
    look: TextLayout,
) {
    if let (Some(why_not), Some(plan)) = (&outcome.explanation, &outcome.plan) {
        push_wrapped(text, &reason_text(why_not), 2, look.width);
        if why_not.strategies.is_empty() {
            text.push_str(&example(&request.task, plan, why_not, look));
            return;
        }
        let title = "Every execution strategy can fail";
        let _ = write!(text, "\n{}\n", styled(EMPHASIS, title));
        for play in &why_not.strategies {
            push_wrapped(text, play, 2, look.width);
        }
    }
}

/// Renders the tolerance table, its meaning, its limits and the end of the search.
fn envelope(
    request: &EnvelopeRequest,
    outcome: &EnvelopeOutcome,
    order: Order,
    look: TextLayout,
) -> String {
    let EnvelopeFinding::Envelope {
        parameters,
        makespans,
        timeline: _,
        inequalities: _,
        chosen,
        stop,
        checks,
        widenings,
        balance,
        best,
        conditions,
        foresight,
        seconds,
    } = &outcome.answer.finding
    else {
        return String::new();
    };
    let mut rows: Vec<Row> = parameters.iter().map(row).collect();
    if order == Order::Tightness {
        rows.sort_by_key(Row::smaller_deviation);
    }
    let title = format!("Elbow room of {}", request.name);
    let mut text = format!("{}\n\n", styled(EMPHASIS, &title));
    if rows.is_empty() {
        text.push_str(" No quantity of this plan may deviate. It works as it is.\n");
        if let Some(chosen) = chosen_durations_text(chosen) {
            push_paragraph(&mut text, &chosen, look.width);
        }
        return text;
    }
    if let Some(balance) = balance {
        push_paragraph(&mut text, &headline(balance, parameters), look.width);
        text.push('\n');
    }
    text.push_str(&table::render(&rows, look));
    text.push('\n');
    push_paragraph(
        &mut text,
        &timeouts::guarantee_text(parameters, &rows),
        look.width,
    );
    if let Some(timeouts) = timeouts::timeout_line(&request.timeout, parameters, chosen) {
        push_paragraph(&mut text, &timeouts, look.width);
    }
    if let Some(chosen) = chosen_durations_text(chosen) {
        push_paragraph(&mut text, &chosen, look.width);
    }
    text.push('\n');
    let limits = limits::render(&outcome.answer.limits(), look);
    if !limits.is_empty() {
        text.push_str(&limits);
        text.push('\n');
    }
    if let Some(foresight) = foresight {
        push_paragraph(&mut text, &foresight_text(foresight), look.width);
    }
    if let Some(makespans) = makespans {
        push_paragraph(&mut text, &makespan(makespans, parameters), look.width);
    }
    if let Some(met) = condition_text(conditions) {
        push_paragraph(&mut text, &met, look.width);
    }
    if let Some(worth) = best.as_ref().and_then(best_relaxations) {
        push_paragraph(&mut text, &worth, look.width);
    }
    let course = format!(
        "{} {}, {}, {}.",
        sentence(&search_end_text(request, *stop, parameters, best.as_ref())),
        count_with_noun(*checks, "check"),
        count_with_noun(widenings.len(), "widening"),
        duration(*seconds)
    );
    let mut how = String::new();
    push_paragraph(&mut how, &course, look.width);
    text.push_str(&styled(SECONDARY, how.trim_end()));
    text.push('\n');
    text
}

/// States the uniform deviation of all quantities that the plan tolerates.
fn headline(balance: &UniformSlack, parameters: &[LimitedRange]) -> String {
    let subject = match parameters {
        [_] => "Tolerated deviation".to_owned(),
        _ => format!("Uniform scaling of all {}", noun(parameters)),
    };
    let way = |deviation: &Deviation, sign: &str| {
        let share = &deviation.share * &Rational::from(100);
        let digits = u32::from(share < Rational::from(10));
        let percent = number::rounded(&share, digits, Rounding::Down);
        match &deviation.limit {
            // All quantities may have their least values.
            _ if sign == "-" && deviation.share >= Rational::ONE => "-100 %".to_owned(),
            _ if percent == "0" || percent == "0.0" => "0 %".to_owned(),
            None if !deviation.share.is_zero() => format!("beyond {sign}{percent} %"),
            _ => format!("{sign}{percent} %"),
        }
    };
    let mut line = format!(
        "{subject}: {} to {}",
        way(&balance.less, "-"),
        way(&balance.more, "+"),
    );
    let either = &balance.either;
    if either.share < balance.more.share.clone().min(balance.less.share.clone()) {
        let _ = write!(line, "; independent deviations: {}", way(either, "±"));
    }
    line.push('.');
    line
}

/// Returns a plural noun for the quantities.
fn noun(parameters: &[LimitedRange]) -> &'static str {
    let is_duration = |own: &LimitedRange| own.range.quantity.kind == QuantityKind::Duration;
    if parameters.iter().all(is_duration) {
        "durations"
    } else {
        "quantities"
    }
}

/// Describes how conditions that are not bounds on a single time difference are met, and which
/// bounds the dispatcher enforces in addition to the network.
fn condition_text(conditions: &Conditions) -> Option<String> {
    let mut met = Vec::new();
    if conditions.all_schedules > 0 {
        let count = conditions.all_schedules;
        met.push(format!(
            "Conditions on numbers or several facts, met by every schedule: {count}."
        ));
    }
    if conditions.enforced > 0 {
        let count = conditions.enforced;
        met.push(format!(
            "Bounds added for the dispatcher to enforce (--enforce): {count}."
        ));
    }
    (!met.is_empty()).then(|| met.join(" "))
}

/// States the benefit of knowing the values in advance, in one sentence.
fn foresight_text(foresight: &ValueOfInformation) -> String {
    /// Maximum number of entries of a list.
    const MAX_NAMED: usize = 4;
    let more = &foresight.weak_width.0 - &foresight.width.0;
    let much = if foresight.width.0.is_zero() {
        format!("{} wider", number::nearest(&more))
    } else {
        let share = more / &foresight.width.0 * Rational::from(100);
        format!("{} % wider", number::nearest(&share.ceil()))
    };
    let named: Vec<&str> = foresight
        .unknown
        .iter()
        .take(MAX_NAMED)
        .map(String::as_str)
        .collect();
    let others = foresight.unknown.len() - named.len();
    let others = match others {
        0 => String::new(),
        others => format!(" and {others} more"),
    };
    format!(
        "Knowing {}{others} in advance would make the intervals {much} in total (--guarantee weak).",
        named.join(", ")
    )
}

fn row(room: &LimitedRange) -> Row {
    Row {
        name: room.range.quantity.name.clone(),
        quantity: quantity(&room.range).to_owned(),
        nominal: room.range.quantity.nominal.clone(),
        interval: room.range.interval(),
    }
}

/// Describes a quantity; for the duration of an action, by the action alone.
fn quantity(range: &Range) -> &str {
    let words = &range.quantity.quantity;
    match range.quantity.kind {
        QuantityKind::Duration => words.strip_prefix("duration of ").unwrap_or(words),
        _ => words,
    }
}

/// Lists the durations that do not vary because the executor chooses them.
fn chosen_durations_text(chosen: &[ChosenDuration]) -> Option<String> {
    /// Maximum number of entries of a list.
    const MAX_NAMED: usize = 4;
    let mut named: Vec<String> = chosen
        .iter()
        .take(MAX_NAMED)
        .map(|one| format!("{} {}", one.action, number::nearest(&one.duration.0)))
        .collect();
    if chosen.len() > MAX_NAMED {
        named.push(format!("and {} more", chosen.len() - MAX_NAMED));
    }
    let named = named.join(", ");
    (!chosen.is_empty())
        .then(|| format!("Chosen by the executor, so not varied (--controllable): {named}."))
}

/// States the makespan of the plan with all actions started as early as possible.
fn makespan(makespans: &Makespans, parameters: &[LimitedRange]) -> String {
    let all = noun(parameters);
    let mut line = format!("Makespan {} (nominal)", number::nearest(&makespans.nominal));
    for (time, which) in [
        (&makespans.at_lower, "lower"),
        (&makespans.at_upper, "upper"),
    ] {
        if let Some(time) = time {
            let time = number::nearest(time);
            let _ = write!(line, ", {time} (all {all} at their {which} bounds)");
        }
    }
    line.push_str(", if started as early as possible.");
    line
}

/// Adds a full stop unless there is one.
fn sentence(text: &str) -> String {
    format!("{}.", text.trim_end_matches('.'))
}

/// Describes how the search ended.
fn search_end_text(
    request: &EnvelopeRequest,
    stop: Stop,
    parameters: &[LimitedRange],
    best: Option<&Best>,
) -> String {
    match stop {
        Stop::Converged if best.is_some() => {
            best.map_or_else(String::new, |best| objective_text(best, parameters))
        }
        Stop::Converged if request.search.sharpen => {
            let mut limits = parameters
                .iter()
                .flat_map(|room| [&room.lower_limit, &room.upper_limit]);
            let is_any = limits.any(|limit| limit.as_deref() == Some(elbowroom::ANY_FINITE));
            let any = if is_any { " or has none" } else { "" };
            // Bounds without a reason are at the farthest value that the search tries.
            let (which, untold) = if parameters.iter().any(has_unknown_limit) {
                (
                    "Each bound with a reason",
                    ". Bounds without a reason could move further",
                )
            } else {
                ("Each bound", "")
            };
            format!("{which} is at its limit{any}{untold}")
        }
        Stop::Converged => {
            let steps = match &request.search.relative {
                Some(share) => {
                    let percent = share * &Rational::from(100);
                    format!("{} % of the nominal values", number::nearest(&percent))
                }
                None => number::nearest(&request.search.precision),
            };
            let untold = if parameters.iter().any(has_unknown_limit) {
                " Bounds without a reason could move further."
            } else {
                ""
            };
            format!(
                "The search ended at step size {steps} (--precision); --sharpen moves each bound \
                 to its limit.{untold}"
            )
        }
        Stop::CheckLimit | Stop::TimeLimit => {
            "The time limit was reached before the search was complete; the intervals could be wider"
                .to_owned()
        }
        Stop::Undecided => {
            "Some wider boxes are undecided because they have too many cases; the intervals could \
             be wider"
                .to_owned()
        }
        Stop::Cancelled => {
            "Interrupted before the search was complete; the intervals could be wider".to_owned()
        }
    }
}

/// Returns `true` if a finite end of the interval has no known limiting reason.
fn has_unknown_limit(room: &LimitedRange) -> bool {
    let ends = [
        (&room.range.lower, &room.lower_limit),
        (&room.range.upper, &room.upper_limit),
    ];
    ends.into_iter()
        .any(|(end, limit)| !end.is_infinite() && limit.is_none())
}

fn duration(seconds: f64) -> String {
    if seconds < 1.0 {
        format!("{:.1} ms", seconds * 1000.0)
    } else {
        format!("{seconds:.1} s")
    }
}
