//! Guarantee of an envelope, and the time-outs of its actions.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use elbowroom::answers::envelope::{ChosenDuration, LimitedRange, QuantityKind};
use elbowroom::execution::run::TimeoutRule;
use elbowroom::num::Rational;

use crate::number;
use elbowroom::report::console::tolerance_table::{self as table, Row};
use elbowroom_executive::messages::count_with_noun;

/// Describes the guarantee.
pub(super) fn guarantee_text(parameters: &[LimitedRange], rows: &[Row]) -> String {
    let is_duration = |room: &LimitedRange| room.range.quantity.kind == QuantityKind::Duration;
    let has_timeouts = parameters.iter().any(|room| room.range.timeout.is_some());
    let before = match (parameters, has_timeouts) {
        (_, false) => "",
        ([_], _) => ", as long as the action ends before its time-out",
        (all, _) if all.iter().all(is_duration) => " and ends before its time-out",
        _ => " and each action ends before its time-out",
    };
    let mut meaning = if parameters.len() == 1 {
        format!("The plan works for any value in the interval{before}.")
    } else {
        format!(
            "The plan works as long as each of these stays inside its interval{before}, \
             independently of the others."
        )
    };
    let critical = rows.iter().filter(|row| row.is_critical()).count();
    if critical > 0 {
        let _ = write!(
            meaning,
            " Critical (!), with less than {} % slack: {critical} of {}.",
            table::CRITICAL,
            rows.len()
        );
    }
    meaning
}

/// Describes the time-outs of actions, and their rule.
pub(super) fn timeout_line(
    rule: &TimeoutRule,
    parameters: &[LimitedRange],
    chosen: &[ChosenDuration],
) -> Option<String> {
    /// Maximum number of different time-outs listed, the most frequent ones.
    const MAX_LISTED: usize = 4;
    let open = parameters.iter().filter_map(|room| {
        let name = room.range.quantity.name.clone();
        Some((room.range.timeout.clone()?, name))
    });
    let told = chosen.iter().filter_map(|one| {
        let timeout = one.timeout.clone()?;
        Some((timeout.0, one.action.clone()))
    });
    let mut groups: BTreeMap<Rational, Vec<String>> = BTreeMap::new();
    for (timeout, name) in open.chain(told) {
        groups.entry(timeout).or_default().push(name);
    }
    if groups.is_empty() {
        return None;
    }
    let rule = rule.in_words();
    let mut groups: Vec<(Rational, Vec<String>)> = groups.into_iter().collect();
    groups.sort_by_key(|(_, names)| std::cmp::Reverse(names.len()));
    if let [(timeout, _)] = groups.as_slice() {
        let timeout = number::nearest(timeout);
        return Some(if rule == timeout {
            format!("Time-out of each action: {timeout} (--timeout changes it).")
        } else {
            format!("Time-out of each action: {timeout} ({rule}; --timeout changes it).")
        });
    }
    let mut listed: Vec<String> = Vec::new();
    for (timeout, names) in groups.iter().take(MAX_LISTED) {
        let named = names.iter().take(MAX_LISTED).cloned();
        let mut named: Vec<String> = named.collect();
        if names.len() > MAX_LISTED {
            named.push(format!("{} more", names.len() - MAX_LISTED));
        }
        listed.push(format!(
            "{} for {}",
            number::nearest(timeout),
            named.join(", ")
        ));
    }
    if groups.len() > MAX_LISTED {
        listed.push(format!(
            "{} (--json lists them)",
            count_with_noun(groups.len() - MAX_LISTED, "other time-out")
        ));
    }
    Some(format!(
        "Time-outs ({rule}; --timeout changes them): {}.",
        listed.join("; ")
    ))
}
