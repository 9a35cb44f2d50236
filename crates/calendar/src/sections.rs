//! The `[[window]]` and `[[value]]` sections of a calendar file.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use elbowroom_model::Problem;
use elbowroom_num::Rational;
use elbowroom_text::{Report, Span};
use toml::{Spanned, Value};

use crate::days::{Days, NamedDays};
use crate::file::{File, Section, texts};
use crate::frame::{Frame, instant, noted};
use crate::hours;
use crate::names::{Kind, ground};
use crate::ranges::Ranges;
use crate::rule::Rule;
use crate::{CalendarFact, CalendarFluent};

/// Maximum number of days of a rule: a hundred years.
const MAX_DAYS: i64 = 36_600;

/// Maximum number of windows of all facts, and of those of all values. Planners cannot handle more.
const MAX_WINDOWS: usize = 200_000;

/// Returns the facts of the `[[window]]` sections with their windows, in the order of the file.
pub(crate) fn facts(
    file: &File,
    problem: &Problem,
    frame: &Frame,
    report: &mut Report,
) -> Vec<CalendarFact> {
    let mut order = Vec::new();
    let mut windows: BTreeMap<String, (Span, Vec<Range<i64>>)> = BTreeMap::new();
    let mut count = 0;
    for section in &file.window {
        let given = section.get_ref();
        let excess = [("fluent", &given.fluent), ("value", &given.value)];
        refuse("[[window]]", &excess, report);
        let names = names("fact", given.fact.as_ref(), section, problem, frame, report);
        let Some(rule) = rule(section, frame, report) else {
            continue;
        };
        if rule.is_always() {
            let error = report.error(section.span(), "the window has neither begin nor end");
            error.advise("add `days`, `except`, `hours`, `from` or `to`; `days = \"every day\"` for all times");
            continue;
        }
        let found = rule.windows(&frame.zone, &frame.within);
        count += found.len() * names.len();
        if too_many(count, section, report) {
            return Vec::new();
        }
        for (name, span) in names {
            let (_, all) = windows.entry(name.clone()).or_insert_with(|| {
                order.push(name);
                (span, Vec::new())
            });
            all.extend(found.iter().cloned());
        }
    }
    let mut facts = Vec::new();
    for name in order {
        let Some((span, all)) = windows.remove(&name) else {
            continue;
        };
        let windows = Ranges::union(all);
        if windows.is_empty() && !report.is_failed() {
            let end = if frame.has_horizon() {
                " before the horizon"
            } else {
                ""
            };
            report.warning(span, format!("{name} is never true{end}"));
        }
        facts.push(CalendarFact { name, windows });
    }
    facts
}

/// Returns the fluents of the `[[value]]` sections with their values, in the order of the file.
pub(crate) fn fluents(
    file: &File,
    problem: &Problem,
    frame: &Frame,
    report: &mut Report,
) -> Vec<CalendarFluent> {
    let mut order = Vec::new();
    let mut layers: BTreeMap<String, Vec<(Rational, Ranges)>> = BTreeMap::new();
    // Fluents of invalid sections, for which a missing default value is not reported in addition.
    let mut mistaken = BTreeSet::new();
    let mut count = 0;
    for section in &file.value {
        let given = section.get_ref();
        refuse("[[value]]", &[("fact", &given.fact)], report);
        let names = names(
            "fluent",
            given.fluent.as_ref(),
            section,
            problem,
            frame,
            report,
        );
        let value = number(section, report);
        let (Some(rule), Some(value)) = (rule(section, frame, report), value) else {
            mistaken.extend(names.into_iter().map(|(name, _)| name));
            continue;
        };
        let windows = rule.windows(&frame.zone, &frame.within);
        count += windows.len() * names.len();
        if too_many(count, section, report) {
            return Vec::new();
        }
        for (name, span) in names {
            let below = layers.entry(name.clone()).or_default();
            if below.is_empty() {
                order.push(name.clone());
            }
            if below.is_empty() != rule.is_always() && !mistaken.contains(&name) {
                let message = if rule.is_always() {
                    format!("{name} already has a value for all other times")
                } else {
                    format!("{name} does not yet have a value for all other times")
                };
                let advice = "the first [[value]] of a fluent must have none of `days`, `hours`, \
                              `from` and `to`; the others must have at least one";
                report.error(span, message).advise(advice);
            }
            below.push((value.clone(), windows.clone()));
        }
    }
    let changes = |name: String| {
        let layers = layers.get(&name)?;
        let values = values(layers, frame.within.start);
        Some(CalendarFluent { name, values })
    };
    order.into_iter().filter_map(changes).collect()
}

/// Returns the instants at which the value changes, with the new values. If several layers cover an
/// instant, the last one counts.
fn values(layers: &[(Rational, Ranges)], begin: i64) -> Vec<(i64, Rational)> {
    let ends = |range: &Range<i64>| [range.start, range.end];
    let instants: BTreeSet<i64> = layers
        .iter()
        .flat_map(|(_, ranges)| ranges.iter().flat_map(ends))
        .collect();
    let mut values: Vec<(i64, Rational)> = Vec::new();
    for instant in instants.range(begin..) {
        let covering = layers
            .iter()
            .rev()
            .find(|(_, ranges)| ranges.contains(*instant));
        // No layer covers the horizon, where the last value remains.
        let Some((value, _)) = covering else {
            continue;
        };
        if values.last().is_none_or(|(_, last)| last != value) {
            values.push((*instant, value.clone()));
        }
    }
    values
}

/// Returns `true`, and adds an error to the report, if there are more windows than
/// [`MAX_WINDOWS`].
fn too_many(count: usize, section: &Spanned<Section>, report: &mut Report) -> bool {
    if count > MAX_WINDOWS {
        let message =
            format!("the calendar has more than {MAX_WINDOWS} windows (counted up to here)");
        let error = report.error(section.span(), message);
        error.advise("choose a nearer `horizon`, or name fewer objects");
    }
    count > MAX_WINDOWS
}

/// Reports keys without a meaning in a section.
fn refuse(section: &str, excess: &[(&str, &Option<Spanned<Value>>)], report: &mut Report) {
    for (key, value) in excess {
        if let Some(value) = value {
            let error = report.error(value.span(), format!("`{key}` is not a key of {section}"));
            error.advise("leave it out");
        }
    }
}

/// Returns the ground names of a section, each with its place in the file.
fn names(
    key: &str,
    value: Option<&Spanned<Value>>,
    section: &Spanned<Section>,
    problem: &Problem,
    frame: &Frame,
    report: &mut Report,
) -> Vec<(String, Span)> {
    let Some(value) = value else {
        let error = report.error(section.span(), format!("`{key}` is missing"));
        error.advise(format!("add `{key} = \"(name object)\"`"));
        return Vec::new();
    };
    let kind = if key == "fact" {
        Kind::Fact
    } else {
        Kind::Fluent
    };
    let Some((span, patterns)) = noted(texts(value), &value.span(), report) else {
        return Vec::new();
    };
    let mut names = BTreeSet::new();
    for pattern in patterns {
        for name in noted(ground(&pattern, kind, problem), &span, report)
            .into_iter()
            .flatten()
        {
            if let Some(when) = frame.set_by_problem.get(&name) {
                let message = format!("the problem itself sets {name} {when}");
                let error = report.error(span.clone(), message);
                error.advise("remove it from the problem's `:init`, or from the calendar");
            }
            names.insert(name);
        }
    }
    names.into_iter().map(|name| (name, span.clone())).collect()
}

fn number(section: &Spanned<Section>, report: &mut Report) -> Option<Rational> {
    let Some(value) = &section.get_ref().value else {
        let error = report.error(section.span(), "`value` is missing");
        error.advise("add `value = 1.5`");
        return None;
    };
    let number = match value.get_ref() {
        Value::Integer(number) => Some(Rational::from(*number)),
        Value::Float(number) => Rational::from_f64_as_written(*number),
        _ => None,
    };
    if number.is_none() {
        report.error(value.span(), "expected a number");
    }
    number
}

/// Adds the days named by a value. Returns `false`, and adds an error to the report, if it names
/// something else.
pub(crate) fn add_days(
    value: &Spanned<Value>,
    days: &mut Days,
    named: &NamedDays,
    report: &mut Report,
) -> bool {
    let Some((span, texts)) = noted(texts(value), &value.span(), report) else {
        return false;
    };
    let mut is_read = true;
    for text in texts {
        is_read &= noted(days.add(&text, named), &span, report).is_some();
    }
    is_read
}

/// Returns the rule of a section, or `None` after adding an error to the report.
fn rule(section: &Spanned<Section>, frame: &Frame, report: &mut Report) -> Option<Rule> {
    let given = section.get_ref();
    let mut rule = Rule::default();
    let mut is_read = true;
    if let Some(value) = &given.days {
        let mut days = Days::default();
        is_read &= add_days(value, &mut days, &frame.named, report);
        rule.days = Some(days);
    }
    if let Some(value) = &given.except {
        is_read &= add_days(value, &mut rule.except, &frame.named, report);
    }
    if let Some(value) = &given.hours {
        let read = noted(texts(value), &value.span(), report);
        is_read &= read.is_some();
        for (span, text) in read
            .iter()
            .flat_map(|(span, all)| all.iter().map(move |it| (span, it)))
        {
            let hours = noted(hours::read(text), span, report);
            is_read &= hours.is_some();
            rule.hours.extend(hours);
        }
    }
    for (value, end) in [(&given.from, &mut rule.from), (&given.to, &mut rule.to)] {
        if let Some(value) = value {
            *end = instant(value, &frame.zone, report);
            is_read &= end.is_some();
        }
    }
    if !is_read {
        return None;
    }
    if let (Some(from), Some(to), Some(value)) = (rule.from, rule.to, &given.to)
        && to <= from
    {
        let error = report.error(value.span(), "the window is empty");
        error.advise("`to` must be later than `from`");
        return None;
    }
    if rule.is_endless() && !frame.has_horizon() {
        let error = report.error(section.span(), "the window recurs without an end");
        error.advise("add `horizon = \"7 days\"` to the head of the file, or `to` here");
        return None;
    }
    if rule.day_count(&frame.within) > MAX_DAYS {
        let error = report.error(
            section.span(),
            "the window recurs for more than a hundred years",
        );
        error.advise("choose a nearer `horizon` or `to`");
        return None;
    }
    Some(rule)
}
