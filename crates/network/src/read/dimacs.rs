//! DIMACS text: comments `c …`, a problem line `p sp NODES ARCS`, and arcs `a U V W`.
//!
//! `a U V W` means `U - V <= W`; W may be `inf`. Comments of the forms `c <label> U NAME` and `c
//! <refine> U V W` are significant: they name nodes and tighten arcs. The generators write the arcs
//! of the graph without bounds, and the bounds as refinements.

use std::collections::BTreeSet;

use crate::builder::Builder;
use crate::file::{Format, NetworkFile};
use crate::number::Bound;
use crate::report::Report;

/// Limit on nodes: more than any such file has.
const MAX_NODES: usize = 1 << 20;

/// Returns `true` if a line belongs to this format.
pub(super) fn is_line(line: &str) -> bool {
    let mut words = line.split_whitespace();
    matches!(words.next(), Some("c" | "p"))
}

pub(super) fn read(text: &str, report: &mut Report) -> Option<NetworkFile> {
    let mut builder = Builder::new(Format::Dimacs);
    let count = node_count(text, report)?;
    let mut names: Vec<String> = (1..=count).map(|number| number.to_string()).collect();
    let mut labels = BTreeSet::new();
    for (at, line) in lines(text) {
        if let ["c", "<label>", number, name] = words(line)[..]
            && let Some(place) = number
                .parse::<usize>()
                .ok()
                .filter(|&n| 0 < n && n <= count)
        {
            // Names must be unique, so repeated labels are dropped.
            if !labels.insert(name) || is_number(name) {
                report.remark(format!(
                    "the label `{name}` occurs twice or is a number; it is ignored"
                ));
            } else {
                name.clone_into(&mut names[place - 1]);
            }
        } else if let ["c", "<label>", number, _] = words(line)[..]
            && number.bytes().all(|byte| byte.is_ascii_digit())
        {
            report.mistake(
                at,
                format!("there is no node {number}"),
                "nodes are numbered from 1 to NODES of the line `p sp NODES ARCS`",
            );
        }
    }
    for name in &names {
        builder.point(name, 0, report);
    }
    builder.reference = builder.find("z").or_else(|| builder.find("Z"));
    for (at, line) in lines(text) {
        match words(line)[..] {
            ["a", from, to, most] => arc(&mut builder, &names, [from, to, most], at, report),
            ["c", "<refine>", from, to, most] if is_number(from) => {
                arc(&mut builder, &names, [from, to, most], at, report);
            }
            [] | ["c" | "p", ..] => {}
            _ => report.mistake(
                at,
                "this line is neither an arc nor a comment",
                "arcs are `a U V W`, comments begin with `c`",
            ),
        }
    }
    builder.finish(report)
}

fn is_number(word: &str) -> bool {
    word.bytes().all(|byte| byte.is_ascii_digit())
}

fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Returns the lines with their positions.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.split('\n').scan(0, |at, line| {
        let begin = *at;
        *at += line.len() + 1;
        Some((begin, line))
    })
}

/// Returns the number of nodes from the problem line.
fn node_count(text: &str, report: &mut Report) -> Option<usize> {
    for (at, line) in lines(text) {
        if let ["p", _, count, ..] = words(line)[..] {
            let count = count.parse().ok().filter(|&count| count <= MAX_NODES);
            if count.is_none() {
                report.mistake(
                    at,
                    "the number of nodes is missing",
                    "write `p sp NODES ARCS`",
                );
            }
            return count;
        }
    }
    report.mistake(
        0,
        "there is no problem line",
        "add `p sp NODES ARCS` before the arcs",
    );
    None
}

fn arc(
    builder: &mut Builder,
    names: &[String],
    [from, to, most]: [&str; 3],
    at: usize,
    report: &mut Report,
) {
    let mut node = |number: &str| {
        let place = number.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
        let node = place.and_then(|place| builder.find(names.get(place)?));
        if node.is_none() {
            report.mistake(
                at,
                format!("there is no node {number}"),
                "nodes are numbered from 1 to NODES of the line `p sp NODES ARCS`",
            );
        }
        node
    };
    let (Some(from), Some(to)) = (node(from), node(to)) else {
        return;
    };
    match Bound::parse(most) {
        Some(most) => {
            let bounds = (Bound::NegativeInfinity, most);
            builder.requirement((to, from), bounds, at, report);
        }
        None => report.mistake(
            at,
            format!("`{most}` is not a number"),
            "write a decimal or `inf`",
        ),
    }
}
