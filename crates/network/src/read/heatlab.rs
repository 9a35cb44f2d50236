//! Nodes and constraints in JSON, as the HEATlab programs read and write them.
//!
//! `nodes`: `node_id`, optionally `min_domain` and `max_domain`; `constraints`: `first_node`,
//! `second_node`, `min_duration`, `max_duration`, optionally a `type` (`stc`, `stcu` or `pstc`) and
//! a `distribution`. Node 0 is the reference point; it need not be listed, and no other node comes
//! before it unless `min_domain` allows that.

use elbowroom_stn::NodeId;

use super::{distribution, list, optional_bound, point_name, required};
use crate::builder::{Builder, GivenLink};
use crate::file::{Duration, Format, NetworkFile};
use crate::json::Json;
use crate::number::Bound;
use crate::report::Report;

/// Name of the node that serves as time zero.
const REFERENCE: &str = "0";

pub(super) fn read(document: &Json<'_>, report: &mut Report) -> Option<NetworkFile> {
    let mut builder = Builder::new(Format::Heatlab);
    if let Some(name) = document.member("name").and_then(Json::text) {
        name.clone_into(&mut builder.name);
    }
    builder.point(REFERENCE, document.at, report);
    let reference = builder.find(REFERENCE);
    builder.reference = reference;
    for node in list(document, "nodes", report) {
        let Some(id) = required(node, "node_id", report) else {
            continue;
        };
        let Some(name) = point_name(id, report) else {
            continue;
        };
        if name != REFERENCE {
            builder.point(&name, id.at, report);
            let point = builder.find(&name);
            if let Some(ends) = reference.zip(point) {
                domain(&mut builder, ends, node, report);
            }
        }
    }
    for constraint in list(document, "constraints", report) {
        read_constraint(&mut builder, constraint, report);
    }
    builder.finish(report)
}

/// Adds the bounds on the time of a node, relative to the reference point.
fn domain(builder: &mut Builder, ends: (NodeId, NodeId), node: &Json<'_>, report: &mut Report) {
    let least = Bound::Finite(elbowroom_num::Rational::ZERO);
    let lower = optional_bound(node, "min_domain", least, report);
    let upper = optional_bound(node, "max_domain", Bound::Infinity, report);
    if let (Some(lower), Some(upper)) = (lower, upper) {
        builder.requirement(ends, (lower, upper), node.at, report);
    }
}

/// Reads a constraint; reports all mistakes in it.
fn read_constraint(builder: &mut Builder, constraint: &Json<'_>, report: &mut Report) {
    let mut end = |name| {
        let json = required(constraint, name, report)?;
        let name = point_name(json, report)?;
        builder.named(&name, json.at, report)
    };
    let (first, second) = (end("first_node"), end("second_node"));
    let lower = optional_bound(constraint, "min_duration", Bound::NegativeInfinity, report);
    let upper = optional_bound(constraint, "max_duration", Bound::Infinity, report);
    let (Some(first), Some(second), Some(lower), Some(upper)) = (first, second, lower, upper)
    else {
        return;
    };
    let given = constraint.member("distribution");
    let is_contingent = match constraint.member("type") {
        None => given.is_some(),
        Some(kind) => match kind.text() {
            Some("stc") => given.is_some(),
            Some("stcu" | "pstc") => true,
            _ => {
                report.mistake(
                    kind.at,
                    "unknown type of constraint",
                    "expected \"stc\", \"stcu\" or \"pstc\"",
                );
                return;
            }
        },
    };
    if !is_contingent {
        builder.requirement((first, second), (lower, upper), constraint.at, report);
        return;
    }
    let duration = match given {
        Some(given) => match named_distribution(given, &lower, &upper, report) {
            Some(duration) => Some(duration),
            None => return,
        },
        None => None,
    };
    builder.link(
        GivenLink {
            at: constraint.at,
            activation: first,
            end: second,
            lower,
            upper,
            duration,
        },
        report,
    );
}

/// Reads `{ "name": "N_12_3" }`, or the name alone.
fn named_distribution(
    given: &Json<'_>,
    lower: &Bound,
    upper: &Bound,
    report: &mut Report,
) -> Option<Duration> {
    let name = match given.text() {
        Some(_) => given,
        None => required(given, "name", report)?,
    };
    let text = name.text().unwrap_or_default();
    match distribution::by_name(text, lower, upper) {
        Ok(duration) => Some(duration),
        Err(message) => {
            report.mistake(
                name.at,
                message,
                "expected N_mean_deviation, U_from_to, E_rate_from or G_shape_(rate,from)",
            );
            None
        }
    }
}
