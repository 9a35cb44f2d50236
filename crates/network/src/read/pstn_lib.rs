//! Time points and constraints in JSON, as PSTN-lib reads and writes them.
//!
//! `timepoints`: `id`, `label`; `constraints`: `source`, `sink`, `type`, and either a
//! `duration_bound` (`lb`, `ub`) or a `distribution` (`mean`, `sd`); `correlations`: groups of
//! probabilistic constraints with their correlation matrix. 1000000000 means infinity.

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_stn::NodeId;
use elbowroom_stn::uncertain::LinkId;

use super::{bound, list, number, point_name, required};
use crate::builder::{Builder, GivenLink};
use crate::file::{Correlation, Duration, Format, NetworkFile};
use crate::json::Json;
use crate::number::Bound;
use crate::report::Report;

/// The number that the library writes for infinity.
const INFINITY: i64 = 1_000_000_000;

pub(super) fn read(document: &Json<'_>, report: &mut Report) -> Option<NetworkFile> {
    let mut builder = Builder::new(Format::PstnLib);
    if let Some(name) = document.member("name").and_then(Json::text) {
        name.clone_into(&mut builder.name);
    }
    let ids = points(&mut builder, document, report);
    for constraint in list(document, "constraints", report) {
        read_constraint(&mut builder, &ids, constraint, report);
    }
    if let Some(correlations) = document.member("correlations") {
        for group in correlations.list().unwrap_or_default() {
            read_correlation(&mut builder, &ids, group, report);
        }
    }
    builder.finish(report)
}

/// Reads the time points, by their numbers. The first one is the reference point.
fn points(
    builder: &mut Builder,
    document: &Json<'_>,
    report: &mut Report,
) -> BTreeMap<String, NodeId> {
    let mut ids = BTreeMap::new();
    for point in list(document, "timepoints", report) {
        let Some(id) = required(point, "id", report) else {
            continue;
        };
        let Some(number) = point_name(id, report) else {
            continue;
        };
        // Labels of repeated actions are not unique, so the number is added.
        let label = point
            .member("label")
            .and_then(Json::text)
            .unwrap_or(&number);
        let name = match builder.find(label) {
            Some(_) => format!("{label} #{number}"),
            None => label.to_owned(),
        };
        builder.point(&name, id.at, report);
        let Some(node) = builder.find(&name) else {
            continue;
        };
        if ids.insert(number.clone(), node).is_some() {
            report.mistake(
                id.at,
                format!("there are two time points with the id {number}"),
                "give each a unique number",
            );
        }
    }
    builder.reference = builder.nodes().next();
    ids
}

fn ends(
    ids: &BTreeMap<String, NodeId>,
    constraint: &Json<'_>,
    report: &mut Report,
) -> Option<(NodeId, NodeId)> {
    let mut end = |name| {
        let json = required(constraint, name, report)?;
        let id = point_name(json, report)?;
        let node = ids.get(&id).copied();
        if node.is_none() {
            report.mistake(
                json.at,
                format!("there is no time point with the id {id}"),
                "list it under `timepoints`, or correct the number",
            );
        }
        node
    };
    let (source, sink) = (end("source"), end("sink"));
    source.zip(sink)
}

fn read_constraint(
    builder: &mut Builder,
    ids: &BTreeMap<String, NodeId>,
    constraint: &Json<'_>,
    report: &mut Report,
) {
    let Some((source, sink)) = ends(ids, constraint, report) else {
        return;
    };
    let duration = match constraint.member("distribution") {
        Some(given) => match normal(given, report) {
            Some(duration) => Some(duration),
            None => return,
        },
        None => None,
    };
    let Some((lower, upper)) = duration_bound(constraint, duration.is_none(), report) else {
        return;
    };
    let is_contingent = match constraint.member("type").map(|kind| (kind.at, kind.text())) {
        None | Some((_, Some("stc"))) => duration.is_some(),
        Some((_, Some("stcu" | "pstc"))) => true,
        Some((at, _)) => {
            report.mistake(
                at,
                "unknown type of constraint",
                "expected \"stc\", \"stcu\" or \"pstc\"",
            );
            return;
        }
    };
    if is_contingent {
        let at = constraint.at;
        let link = GivenLink {
            at,
            activation: source,
            end: sink,
            lower,
            upper,
            duration,
        };
        builder.link(link, report);
    } else {
        builder.requirement((source, sink), (lower, upper), constraint.at, report);
    }
}

/// Reads `duration_bound`, which is optional for probabilistic constraints.
fn duration_bound(
    constraint: &Json<'_>,
    is_required: bool,
    report: &mut Report,
) -> Option<(Bound, Bound)> {
    let given = match constraint.member("duration_bound") {
        Some(given) => given,
        None if !is_required => return Some((Bound::NegativeInfinity, Bound::Infinity)),
        None => required(constraint, "duration_bound", report)?,
    };
    let mut side = |name| {
        let json = required(given, name, report)?;
        Some(match bound(json, report)? {
            Bound::Finite(number) if number >= Rational::from(INFINITY) => Bound::Infinity,
            Bound::Finite(number) if number <= Rational::from(-INFINITY) => Bound::NegativeInfinity,
            other => other,
        })
    };
    let (lower, upper) = (side("lb"), side("ub"));
    lower.zip(upper)
}

/// Reads `{ "mean": …, "sd": … }`.
fn normal(given: &Json<'_>, report: &mut Report) -> Option<Duration> {
    let mut part = |name| {
        let json = required(given, name, report)?;
        number(json, report)
    };
    let (mean, deviation) = (part("mean"), part("sd"));
    let (mean, deviation) = mean.zip(deviation)?;
    if deviation.is_negative() {
        report.mistake(
            given.at,
            "the deviation is negative",
            "write it without its sign",
        );
        return None;
    }
    Some(Duration::Normal { mean, deviation })
}

fn read_correlation(
    builder: &mut Builder,
    ids: &BTreeMap<String, NodeId>,
    group: &Json<'_>,
    report: &mut Report,
) {
    let mut links = Vec::new();
    for constraint in list(group, "constraints", report) {
        let Some((source, sink)) = ends(ids, constraint, report) else {
            return;
        };
        match normal_link(builder, source, sink) {
            Some(link) if !links.contains(&link) => links.push(link),
            _ => {
                report.mistake(
                    constraint.at,
                    "this is not one of the probabilistic constraints, or it is listed twice",
                    "list it under `constraints` with its distribution",
                );
                return;
            }
        }
    }
    let matrix = super::correlation_matrix(group, "correlation", links.len(), report);
    if let Some(matrix) = matrix {
        builder.correlations.push(Correlation { links, matrix });
    }
}

/// Returns the link from one point to another, if its duration is normally distributed.
fn normal_link(builder: &Builder, source: NodeId, sink: NodeId) -> Option<LinkId> {
    let link = builder.link_ending_at(sink)?;
    let is_normal = matches!(builder.duration_of(link), Some(Duration::Normal { .. }));
    (is_normal && builder.link_of(link).activation == source).then_some(link)
}
