//! Reader of calendar files.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{SystemTime, UNIX_EPOCH};

use elbowroom_model::Problem;
use elbowroom_text::{Diagnostic, Diagnostics, Report, Source};
use toml::{Spanned, Value};

use crate::days::{Days, NamedDays};
use crate::file::{File, text, texts};
use crate::frame::{Frame, instant, noted};
use crate::sections;
use crate::unit::{Length, Unit, length};
use crate::zone::Zone;
use crate::{Calendar, Origin};

/// Text that stands for the current time.
const NOW: &str = "now";

/// Reads a calendar file (`docs/reference/calendars.md`) for a problem. Returns the calendar with the warnings.
///
/// # Errors
/// All mistakes found: of syntax, of names, dates and windows, and facts that the problem sets itself.
pub fn read(
    source: &Source,
    problem: &Problem,
    origin: &Origin<'_>,
) -> Result<(Calendar, Vec<Diagnostic>), Diagnostics> {
    let file: File = elbowroom_text::toml::read(source)?;
    let mut report = Report::new(source);
    let calendar = calendar(&file, problem, origin, &mut report)?;
    report.finish(calendar)
}

/// Returns the calendar, or `None` if there are mistakes in the report.
///
/// # Errors
/// `begin` of the origin is not a date.
fn calendar(
    file: &File,
    problem: &Problem,
    origin: &Origin<'_>,
    report: &mut Report,
) -> Result<Option<Calendar>, Diagnostics> {
    header(file, report);
    let unit = Unit::named(file.unit.get_ref());
    if unit.is_none() {
        let message = format!("`{}` is not a unit of time", file.unit.get_ref());
        let error = report.error(file.unit.span(), message);
        error.advise("write `seconds`, `minutes`, `hours` or `days`");
    }
    let zone = Zone::named(file.time_zone.get_ref());
    let Some(zone) = noted(zone, &file.time_zone.span(), report) else {
        return Ok(None);
    };
    let Some((begin, begins_now)) = begin(file, &zone, origin, report)? else {
        return Ok(None);
    };
    let horizon = file.horizon.as_ref();
    let horizon = horizon.map(|horizon| self::horizon(horizon, begin, &zone, report));
    let mut named = NamedDays::new();
    for (name, dates) in &file.dates {
        if Days::are_named(name) {
            let message = format!("`{name}` is already a name of days");
            let error = report.error(dates.span(), message);
            error.advise("choose another name");
        }
        let mut days = Days::default();
        sections::add_days(dates, &mut days, &NamedDays::new(), report);
        named.insert(name.clone(), days);
    }
    let (Some(unit), Some(end)) = (unit, horizon.unwrap_or(Some(i64::MAX))) else {
        return Ok(None);
    };
    let frame = Frame {
        zone,
        within: begin..end,
        named,
        set_by_problem: set_by(problem),
    };
    let facts = sections::facts(file, problem, &frame, report);
    let fluents = sections::fluents(file, problem, &frame, report);
    if !report.is_failed() {
        warn_of_unused(file, report);
    }
    let Frame { zone, .. } = frame;
    Ok(Some(Calendar {
        zone,
        begin,
        begins_now,
        unit,
        facts,
        fluents,
    }))
}

/// Warns about a calendar without sections, and about unused names.
fn warn_of_unused(file: &File, report: &mut Report) {
    if file.window.is_empty() && file.value.is_empty() {
        let warning = report.warning(0..0, "the calendar has no [[window]] and no [[value]]");
        warning.advise("it changes nothing in the problem");
        return;
    }
    let sections = file.window.iter().chain(&file.value);
    let days = sections.flat_map(|section| [&section.get_ref().days, &section.get_ref().except]);
    let used: BTreeSet<String> = days
        .flatten()
        .filter_map(|value| texts(value).ok())
        .flat_map(|(_, texts)| texts)
        .map(|text| text.trim().to_owned())
        .collect();
    for (name, dates) in &file.dates {
        if !used.contains(name) {
            let message = format!("no `days` or `except` uses `{name}`");
            let warning = report.warning(dates.span(), message);
            warning.advise("use it in a section, or remove it");
        }
    }
}

fn header(file: &File, report: &mut Report) {
    if file.format.get_ref() != "elbowroom-calendar" {
        let error = report.error(file.format.span(), "this is not a calendar file");
        error.advise("write format = \"elbowroom-calendar\"");
    }
    if *file.version.get_ref() != 1 {
        let error = report.error(file.version.span(), "unsupported version");
        error.advise("write version = 1");
    }
}

/// Returns the instant of time 0, and `true` if it is the current time.
///
/// # Errors
/// `begin` of the origin is not a date.
fn begin(
    file: &File,
    zone: &Zone,
    origin: &Origin<'_>,
    report: &mut Report,
) -> Result<Option<(i64, bool)>, Diagnostics> {
    let now = (milliseconds(origin.now), true);
    if let Some(given) = origin.begin {
        if given == NOW {
            return Ok(Some(now));
        }
        let mut alone = Report::new(&Source::new("--begin", given));
        let begin = noted(zone.instant(given), &(0..given.len()), &mut alone);
        return Ok(Some((alone.finish(begin)?.0, false)));
    }
    match &file.begin {
        Some(begin) if begin.get_ref().as_str() == Some(NOW) => Ok(Some(now)),
        Some(begin) => Ok(instant(begin, zone, report).map(|begin| (begin, false))),
        None if origin.is_live => Ok(Some(now)),
        None => {
            let error = report.error(0..0, "`begin` is missing: the date of time 0");
            error.advise("add `begin = \"2026-11-30T07:30\"`, or give --begin");
            Ok(None)
        }
    }
}

fn milliseconds(time: SystemTime) -> i64 {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}

/// Returns the instant at which the calendar ends.
fn horizon(value: &Spanned<Value>, begin: i64, zone: &Zone, report: &mut Report) -> Option<i64> {
    let end = match text(value.get_ref()).as_deref().and_then(length) {
        Some(Length::Days(days)) => zone.days_later(begin, days),
        Some(Length::Milliseconds(length)) => begin.saturating_add(length),
        None => match text(value.get_ref()).map(|text| zone.instant(&text)) {
            Some(Ok(end)) => end,
            Some(Err((message, advice))) if message.ends_with("time of day") => {
                let advice = format!("{advice}, or as a length like `7 days`");
                report.error(value.span(), message).advise(advice);
                return None;
            }
            Some(Err((message, advice))) => {
                report.error(value.span(), message).advise(advice);
                return None;
            }
            None => {
                let error = report.error(value.span(), "expected a text in quotes");
                error.advise("write a length like `7 days`, or a date with a time of day");
                return None;
            }
        },
    };
    if end == i64::MAX {
        let error = report.error(value.span(), "the horizon is too far away");
        error.advise("leave it out if no window recurs");
        return None;
    }
    if end <= begin {
        let error = report.error(value.span(), "the horizon is not after time 0");
        error.advise(format!("time 0 is {}", zone.date(begin)));
        return None;
    }
    Some(end)
}

/// Returns the facts and fluents that the problem sets itself, each with its time in words.
fn set_by(problem: &Problem) -> BTreeMap<String, &'static str> {
    use elbowroom_model::problem::TimedChange;
    let name = |function: elbowroom_model::problem::FunctionId| {
        problem.functions[function.index()].name.as_str()
    };
    let facts = problem.initial_facts.iter();
    let facts = facts.map(|(predicate, of)| problem.apply_predicate(*predicate, of));
    let values = problem.initial_values.iter();
    let values = values.map(|(function, of, _)| problem.apply_name(name(*function), of));
    let initial = facts.chain(values).map(|name| (name, "at the beginning"));
    let timed = problem.timed.iter().map(|initial| match &initial.change {
        TimedChange::Add(predicate, of) | TimedChange::Delete(predicate, of) => {
            problem.apply_predicate(*predicate, of)
        }
        TimedChange::Assign(function, of, _) => problem.apply_name(name(*function), of),
    });
    initial
        .chain(timed.map(|name| (name, "with a timed initial")))
        .collect()
}
