//! The parts of a calendar file that all its sections need, and the notes of mistakes.

use std::collections::BTreeMap;
use std::ops::Range;

use elbowroom_text::{Report, Span};
use toml::{Spanned, Value};

use crate::days::NamedDays;
use crate::file::text;
use crate::zone::{Objection, Zone};

/// The parts of a calendar file that all its sections need.
pub(crate) struct Frame {
    pub(crate) zone: Zone,
    /// The instants from time 0 to the horizon; [`i64::MAX`] where there is none.
    pub(crate) within: Range<i64>,
    pub(crate) named: NamedDays,
    /// The facts and fluents that the problem sets itself, and when.
    pub(crate) set_by_problem: BTreeMap<String, &'static str>,
}

impl Frame {
    pub(crate) fn has_horizon(&self) -> bool {
        self.within.end < i64::MAX
    }
}

/// Returns a value, or notes why there is none.
pub(crate) fn noted<T>(
    outcome: Result<T, Objection>,
    span: &Span,
    report: &mut Report,
) -> Option<T> {
    outcome
        .map_err(|(message, advice)| {
            report.error(span.clone(), message).advise(advice);
        })
        .ok()
}

/// Returns the instant of a date, or notes why there is none.
pub(crate) fn instant(value: &Spanned<Value>, zone: &Zone, report: &mut Report) -> Option<i64> {
    let written = text(value.get_ref()).unwrap_or_else(|| value.get_ref().to_string());
    noted(zone.instant(&written), &value.span(), report)
}
