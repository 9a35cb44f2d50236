//! Data shared by all sections of a calendar file, and the recording of mistakes.

use std::collections::BTreeMap;
use std::ops::Range;

use elbowroom_text::{Report, Span};
use toml::{Spanned, Value};

use crate::days::NamedDays;
use crate::file::text;
use crate::zone::{TextError, Zone};

/// Data shared by all sections of a calendar file.
pub(crate) struct Frame {
    pub(crate) zone: Zone,
    /// Instants from time 0 to the horizon, or to [`i64::MAX`] without a horizon.
    pub(crate) within: Range<i64>,
    pub(crate) named: NamedDays,
    /// Facts and fluents that the problem sets itself, each with its time in words.
    pub(crate) set_by_problem: BTreeMap<String, &'static str>,
}

impl Frame {
    pub(crate) fn has_horizon(&self) -> bool {
        self.within.end < i64::MAX
    }
}

/// Returns a value, or adds its error to the report.
pub(crate) fn noted<T>(
    outcome: Result<T, TextError>,
    span: &Span,
    report: &mut Report,
) -> Option<T> {
    outcome
        .map_err(|(message, advice)| {
            report.error(span.clone(), message).advise(advice);
        })
        .ok()
}

/// Returns the instant of a date, or adds an error to the report.
pub(crate) fn instant(value: &Spanned<Value>, zone: &Zone, report: &mut Report) -> Option<i64> {
    let written = text(value.get_ref()).unwrap_or_else(|| value.get_ref().to_string());
    noted(zone.instant(&written), &value.span(), report)
}
