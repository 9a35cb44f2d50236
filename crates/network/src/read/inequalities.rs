//! Inequalities listed by node, in JSON.
//!
//! `{ "0": [[0, 1, 10.0], [1, 0, -5.0]], "1": … }`: `[u, v, w]` means `v - u <= w`. Each inequality
//! is listed at both of its nodes.

use std::collections::BTreeSet;

use super::{bound, point_name};
use crate::builder::Builder;
use crate::file::{Format, NetworkFile};
use crate::json::Json;
use crate::number::Bound;
use crate::report::Report;

/// Returns `true` if a document has this form: an object that maps node numbers to lists.
pub(super) fn are_in(document: &Json<'_>) -> bool {
    let is_node = |name: &str| !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_digit());
    document.members().is_some_and(|members| {
        !members.is_empty()
            && members
                .iter()
                .all(|(name, value)| is_node(name) && value.list().is_some())
    })
}

pub(super) fn read(document: &Json<'_>, report: &mut Report) -> Option<NetworkFile> {
    let mut builder = Builder::new(Format::Inequalities);
    let members = document.members().unwrap_or_default();
    for (name, value) in members {
        builder.point(name, value.at, report);
    }
    builder.reference = builder.find("0");
    let mut seen = BTreeSet::new();
    for inequality in members
        .iter()
        .flat_map(|(_, value)| value.list().unwrap_or_default())
    {
        let Some([from, to, most]) = inequality.list() else {
            report.mistake(
                inequality.at,
                "this is not an inequality",
                "write `[u, v, w]` for `v - u <= w`",
            );
            continue;
        };
        let mut end = |json: &Json<'_>| {
            let name = point_name(json, report)?;
            builder.named(&name, json.at, report)
        };
        let (Some(from), Some(to)) = (end(from), end(to)) else {
            continue;
        };
        let Some(most_bound) = bound(most, report) else {
            continue;
        };
        let key = match &most_bound {
            Bound::Finite(number) => Some(number.clone()),
            Bound::Infinity | Bound::NegativeInfinity => None,
        };
        if seen.insert((from, to, key)) {
            let bounds = (Bound::NegativeInfinity, most_bound);
            builder.requirement((from, to), bounds, most.at, report);
        }
    }
    builder.finish(report)
}
