//! Writers for networks, in formats that [`crate::read()`] reads back.

use std::fmt::{self, Write as _};

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::ContingentLink;

use crate::file::{Duration, NetworkFile};

/// Writes a network in JSON (`docs/reference/formats/network.md`). Nothing is lost.
pub fn write_json(file: &NetworkFile) -> String {
    let mut text = String::from("{\n  \"format\": \"elbowroom-network\",\n  \"version\": 1,\n");
    // Writing to a string cannot fail.
    let _ = json_members(file, &mut text);
    text.push_str("}\n");
    text
}

fn json_members(file: &NetworkFile, text: &mut String) -> fmt::Result {
    let name = |node| quoted(file.point(node));
    writeln!(text, "  \"name\": {},", quoted(&file.name))?;
    if let Some(reference) = file.reference {
        writeln!(text, "  \"reference\": {},", name(reference))?;
    }
    let points = file.points.iter().map(|point| quoted(point));
    json_list(text, "points", points, true)?;
    let requirements = file.network.requirements().constraints().iter();
    let requirements = requirements.map(|constraint| {
        format!(
            "{{ \"from\": {}, \"to\": {}, \"upper\": {} }}",
            name(constraint.from),
            name(constraint.to),
            json_number(&constraint.bound)
        )
    });
    json_list(text, "requirements", requirements, true)?;
    let links = file.network.links().iter().zip(&file.durations);
    let links = links.map(|(link, duration)| json_link(file, link, duration.as_ref()));
    let has_more = !file.waits.is_empty() || !file.correlations.is_empty();
    json_list(text, "links", links, has_more)?;
    if !file.waits.is_empty() {
        let waits = file.waits.iter().map(|wait| {
            let delay = wait.delay.as_ref().map(json_number);
            format!(
                "{{ \"point\": {}, \"until\": {}, \"delay\": {} }}",
                name(wait.node),
                name(file.network.link(wait.link).end),
                delay.unwrap_or_else(|| "null".to_owned())
            )
        });
        json_list(text, "waits", waits, !file.correlations.is_empty())?;
    }
    if !file.correlations.is_empty() {
        let groups = file.correlations.iter().map(|group| {
            let ends = group
                .links
                .iter()
                .map(|&link| name(file.network.link(link).end));
            let rows = group.matrix.iter().map(|row| {
                let numbers: Vec<String> = row.iter().map(json_number).collect();
                format!("[{}]", numbers.join(", "))
            });
            format!(
                "{{ \"ends\": [{}], \"matrix\": [{}] }}",
                ends.collect::<Vec<_>>().join(", "),
                rows.collect::<Vec<_>>().join(", ")
            )
        });
        json_list(text, "correlations", groups, false)?;
    }
    Ok(())
}

fn json_list(
    text: &mut String,
    name: &str,
    items: impl Iterator<Item = String>,
    has_more: bool,
) -> fmt::Result {
    let items: Vec<String> = items.map(|item| format!("\n    {item}")).collect();
    let end = if items.is_empty() { "" } else { "\n  " };
    let comma = if has_more { "," } else { "" };
    writeln!(text, "  \"{name}\": [{}{end}]{comma}", items.join(","))
}

fn json_link(
    file: &NetworkFile,
    link: &ContingentLink<Rational>,
    duration: Option<&Duration>,
) -> String {
    let upper = link.upper.as_ref().map(json_number);
    let mut text = format!(
        "{{ \"activation\": {}, \"end\": {}, \"lower\": {}, \"upper\": {}",
        quoted(file.point(link.activation)),
        quoted(file.point(link.end)),
        json_number(&link.lower),
        upper.unwrap_or_else(|| "\"inf\"".to_owned())
    );
    if let Some(duration) = duration {
        let (kind, parts): (&str, Vec<(&str, &Rational)>) = match duration {
            Duration::Normal { mean, deviation } => {
                ("normal", vec![("mean", mean), ("deviation", deviation)])
            }
            Duration::Uniform { from, to } => ("uniform", vec![("from", from), ("to", to)]),
            Duration::Exponential { from, mean } => {
                ("exponential", vec![("from", from), ("mean", mean)])
            }
            Duration::Gamma { from, shape, scale } => (
                "gamma",
                vec![("from", from), ("shape", shape), ("scale", scale)],
            ),
        };
        let parts = parts
            .iter()
            .map(|(name, value)| format!("\"{name}\": {}", json_number(value)));
        let parts: Vec<String> = parts.collect();
        let _ = write!(
            text,
            ", \"duration\": {{ \"{kind}\": {{ {} }} }}",
            parts.join(", ")
        );
    }
    text.push_str(" }");
    text
}

/// Formats a number: a whole number as a number, others as a string with a fraction.
fn json_number(number: &Rational) -> String {
    if number.is_integer() {
        number.to_string()
    } else {
        format!("\"{number}\"")
    }
}

/// Quotes a string for JSON.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\n' => quoted.push_str("\\n"),
            letter if u32::from(letter) < 0x20 => {
                let _ = write!(quoted, "\\u{:04x}", u32::from(letter));
            }
            letter => quoted.push(letter),
        }
    }
    quoted.push('"');
    quoted
}

/// Writes a network as sections of plain text (`# KIND OF NETWORK`). This format has no
/// distributions and no waits. Returns `None` if a link has no upper bound, or if a time point's
/// name is empty or contains a space, a quote or `#`.
pub fn write_plain(file: &NetworkFile) -> Option<String> {
    let is_bad = |letter: char| letter.is_whitespace() || matches!(letter, '#' | '"' | '\'');
    let mut points = file.points.iter();
    if points.any(|point| point.is_empty() || point.contains(is_bad)) {
        return None;
    }
    let name = |node| file.point(node);
    let links = file.network.links().iter();
    let links: Option<Vec<String>> = links
        .map(|link| {
            let (begin, end) = (name(link.activation), name(link.end));
            let upper = link.upper.as_ref()?;
            Some(format!("{begin} {} {upper} {end}\n", link.lower))
        })
        .collect();
    let links = links?;
    let edges = file.network.requirements().constraints().iter();
    let edges: Vec<String> = edges
        .map(|edge| format!("{} {} {}\n", name(edge.from), edge.bound, name(edge.to)))
        .collect();
    let kind = if file.is_certain() { "STN" } else { "STNU" };
    Some(format!(
        "# KIND OF NETWORK\n{kind}\n# Num Time-Points\n{}\n# Num Ordinary Edges\n{}\n\
         # Num Contingent Links\n{}\n# Time-Point Names\n{}\n# Ordinary Edges\n{}\
         # Contingent Links\n{}",
        file.points.len(),
        edges.len(),
        links.len(),
        file.points.join(" "),
        edges.concat(),
        links.concat()
    ))
}

/// Writes a network in GraphML as the CSTNU Tool reads it. That tool knows whole numbers only;
/// files with others are only for this crate. Distributions are left out, because the format has
/// none. Returns `None` if a wait only ends with its link, which the format cannot express.
pub fn write_graphml(file: &NetworkFile) -> Option<String> {
    if file.waits.iter().any(|wait| wait.delay.is_none()) {
        return None;
    }
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = graphml(file, &mut text);
    Some(text)
}

fn graphml(file: &NetworkFile, text: &mut String) -> fmt::Result {
    text.push_str(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <graphml xmlns=\"http://graphml.graphdrawing.org/xmlns/graphml\">\n",
    );
    for (id, owner) in [
        ("NetworkType", "graph"),
        ("Name", "graph"),
        ("nContingent", "graph"),
        ("nVertices", "graph"),
        ("nEdges", "graph"),
        ("x", "node"),
        ("y", "node"),
        ("Type", "edge"),
        ("Value", "edge"),
        ("LabeledValue", "edge"),
    ] {
        writeln!(text, "<key id=\"{id}\" for=\"{owner}\"/>")?;
    }
    let kind = if file.is_certain() { "STN" } else { "STNU" };
    let links = file.network.links();
    let edges = graphml_edges(file);
    text.push_str("<graph edgedefault=\"directed\">\n");
    for (key, value) in [
        ("NetworkType", kind.to_owned()),
        ("Name", escaped(&file.name)),
        ("nContingent", links.len().to_string()),
        ("nVertices", file.points.len().to_string()),
        ("nEdges", edges.len().to_string()),
    ] {
        writeln!(text, "<data key=\"{key}\">{value}</data>")?;
    }
    for (index, point) in file.points.iter().enumerate() {
        let (x, y) = (index % 10 * 80, index / 10 * 80);
        writeln!(
            text,
            "<node id=\"{}\"><data key=\"x\">{x}</data><data key=\"y\">{y}</data></node>",
            escaped(point)
        )?;
    }
    for (index, (ends, kind, values)) in edges.iter().enumerate() {
        let [from, to] = ends;
        writeln!(
            text,
            "<edge id=\"e{index}\" source=\"{from}\" target=\"{to}\">\
             <data key=\"Type\">{kind}</data>{values}</edge>"
        )?;
    }
    text.push_str("</graph>\n</graphml>\n");
    Ok(())
}

/// Returns the edges, each with its ends, its type and its values.
fn graphml_edges(file: &NetworkFile) -> Vec<([String; 2], &'static str, String)> {
    let name = |node| escaped(file.point(node));
    let value = |value: &str| format!("<data key=\"Value\">{value}</data>");
    let mut edges = Vec::new();
    for link in file.network.links() {
        let (begin, end) = (name(link.activation), name(link.end));
        let upper = link
            .upper
            .as_ref()
            .map_or("inf".to_owned(), Rational::to_string);
        let there = [begin.clone(), end.clone()];
        edges.push((there, "contingent", value(&upper)));
        let lower = (-&link.lower).to_string();
        edges.push(([end, begin], "contingent", value(&lower)));
    }
    for constraint in file.network.requirements().constraints() {
        let ends = [name(constraint.from), name(constraint.to)];
        edges.push((ends, "requirement", value(&constraint.bound.to_string())));
    }
    for wait in &file.waits {
        let link = file.network.link(wait.link);
        let ends = [name(wait.node), name(link.activation)];
        let delay = wait.delay.as_ref().map(|delay| -delay).unwrap_or_default();
        let labelled = format!(
            "<data key=\"LabeledValue\">UC({}):{delay}</data>",
            name(link.end)
        );
        edges.push((ends, "derived", labelled));
    }
    edges
}

/// Escapes a string for XML.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for letter in text.chars() {
        match letter {
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '&' => escaped.push_str("&amp;"),
            '"' => escaped.push_str("&quot;"),
            letter => escaped.push(letter),
        }
    }
    escaped
}
