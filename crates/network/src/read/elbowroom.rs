//! Reader for Elbowroom's own JSON format (`docs/reference/formats/network.md`), which [`crate::write`]
//! writes.

use elbowroom_num::Rational;
use elbowroom_stn::NodeId;

use super::{bound, list, number, optional_bound, required};
use crate::builder::{Builder, GivenLink};
use crate::file::{Correlation, Duration, Format, GivenWait, NetworkFile};
use crate::json::{Json, Value};
use crate::number::Bound;
use crate::report::Report;

/// The value of the member `format`.
pub(crate) const FORMAT: &str = "elbowroom-network";

pub(super) fn read(document: &Json<'_>, report: &mut Report) -> Option<NetworkFile> {
    let version = required(document, "version", report)?;
    if number(version, report)? != Rational::ONE {
        report.mistake(
            version.at,
            "unsupported version of the format",
            "expected version 1",
        );
        return None;
    }
    let mut builder = Builder::new(Format::Elbowroom);
    if let Some(name) = document.member("name").and_then(Json::text) {
        name.clone_into(&mut builder.name);
    }
    for point in list(document, "points", report) {
        match point.text() {
            Some(name) => builder.point(name, point.at, report),
            None => report.mistake(point.at, "this is not a name", "write a string"),
        }
    }
    if let Some(reference) = document.member("reference").filter(|json| !is_null(json)) {
        builder.reference = node(&builder, reference, report);
    }
    for requirement in list(document, "requirements", report) {
        let ends = ends(&builder, requirement, ["from", "to"], report);
        if let Some((ends, bounds)) = ends.zip(bounds(requirement, report)) {
            builder.requirement(ends, bounds, requirement.at, report);
        }
    }
    for link in list(document, "links", report) {
        read_link(&mut builder, link, report);
    }
    if report.is_failed() {
        return None; // the links that the rest is about may be missing
    }
    for wait in document
        .member("waits")
        .and_then(Json::list)
        .unwrap_or_default()
    {
        read_wait(&mut builder, wait, report);
    }
    for group in document
        .member("correlations")
        .and_then(Json::list)
        .unwrap_or_default()
    {
        read_correlation(&mut builder, group, report);
    }
    builder.finish(report)
}

fn is_null(json: &Json<'_>) -> bool {
    matches!(json.value, Value::Null)
}

fn node(builder: &Builder, json: &Json<'_>, report: &mut Report) -> Option<NodeId> {
    let Some(name) = json.text() else {
        report.mistake(
            json.at,
            "this is not a name of a time point",
            "write a string",
        );
        return None;
    };
    builder.named(name, json.at, report)
}

fn ends(
    builder: &Builder,
    json: &Json<'_>,
    names: [&str; 2],
    report: &mut Report,
) -> Option<(NodeId, NodeId)> {
    let [from, to] = names.map(|name| {
        let end = required(json, name, report)?;
        node(builder, end, report)
    });
    from.zip(to)
}

fn bounds(json: &Json<'_>, report: &mut Report) -> Option<(Bound, Bound)> {
    let lower = optional_bound(json, "lower", Bound::NegativeInfinity, report);
    let upper = optional_bound(json, "upper", Bound::Infinity, report);
    lower.zip(upper)
}

fn read_link(builder: &mut Builder, json: &Json<'_>, report: &mut Report) {
    let ends = ends(builder, json, ["activation", "end"], report);
    let bounds = bounds(json, report);
    let duration = match json.member("duration").filter(|json| !is_null(json)) {
        None => None,
        Some(given) => match read_duration(given, report) {
            Some(duration) => Some(duration),
            None => return,
        },
    };
    if let Some(((activation, end), (lower, upper))) = ends.zip(bounds) {
        let at = json.at;
        let link = GivenLink {
            at,
            activation,
            end,
            lower,
            upper,
            duration,
        };
        builder.link(link, report);
    }
}

/// Reads `{ "normal": { "mean": …, "deviation": … } }` and similar objects.
fn read_duration(json: &Json<'_>, report: &mut Report) -> Option<Duration> {
    let Some([(kind, numbers)]) = json.members() else {
        report.mistake(
            json.at,
            "this is not a distribution",
            "write `{ \"normal\": { \"mean\": …, \"deviation\": … } }`",
        );
        return None;
    };
    let mut part = |name| {
        let json = required(numbers, name, report)?;
        number(json, report)
    };
    let duration = match &**kind {
        "normal" => Duration::Normal {
            mean: part("mean")?,
            deviation: part("deviation")?,
        },
        "uniform" => Duration::Uniform {
            from: part("from")?,
            to: part("to")?,
        },
        "exponential" => Duration::Exponential {
            from: part("from")?,
            mean: part("mean")?,
        },
        "gamma" => Duration::Gamma {
            from: part("from")?,
            shape: part("shape")?,
            scale: part("scale")?,
        },
        _ => {
            report.mistake(
                json.at,
                format!("unknown distribution `{kind}`"),
                "expected normal, uniform, exponential or gamma",
            );
            return None;
        }
    };
    let is_sound = match &duration {
        Duration::Normal { deviation, .. } => !deviation.is_negative(),
        Duration::Uniform { from, to } => from <= to,
        Duration::Exponential { mean, .. } => !mean.is_negative(),
        Duration::Gamma { shape, scale, .. } => shape.is_positive() && scale.is_positive(),
    };
    if !is_sound {
        report.mistake(
            json.at,
            "the numbers of this distribution are invalid",
            "deviations and means must not be negative, shapes and scales must be positive, and \
             from <= to",
        );
        return None;
    }
    Some(duration)
}

fn read_wait(builder: &mut Builder, json: &Json<'_>, report: &mut Report) {
    let Some((waiting, end)) = ends(builder, json, ["point", "until"], report) else {
        return;
    };
    let Some(link) = builder.link_ending_at(end) else {
        report.mistake(
            json.at,
            "this wait does not refer to the end of a contingent link",
            "name the end of a link under `until`",
        );
        return;
    };
    let delay = match json.member("delay").filter(|json| !is_null(json)) {
        None => None,
        Some(given) => match bound(given, report) {
            Some(Bound::Finite(delay)) => Some(delay),
            Some(Bound::Infinity) => None,
            Some(Bound::NegativeInfinity) | None => return,
        },
    };
    builder.waits.push(GivenWait {
        node: waiting,
        link,
        delay,
    });
}

fn read_correlation(builder: &mut Builder, json: &Json<'_>, report: &mut Report) {
    let mut links = Vec::new();
    for end in list(json, "ends", report) {
        let link = node(builder, end, report).and_then(|node| builder.link_ending_at(node));
        let is_normal = |&link: &_| {
            matches!(builder.duration_of(link), Some(Duration::Normal { .. }))
                && !links.contains(&link)
        };
        let Some(link) = link.filter(is_normal) else {
            report.mistake(
                end.at,
                "no link with a normal duration ends here, or it is listed twice",
                "list the ends of links with normal durations, each once",
            );
            return;
        };
        links.push(link);
    }
    let matrix = super::correlation_matrix(json, "matrix", links.len(), report);
    if let Some(matrix) = matrix {
        builder.correlations.push(Correlation { links, matrix });
    }
}
