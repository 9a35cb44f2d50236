//! GraphML, as the CSTNU Tool reads and writes it.
//!
//! A directed graph whose edges have a `Type` and a `Value`, or a `LabeledValue` of the forms
//! `LC(C):4` and `UC(C):-7`. An edge `X -> Y` with the value v means `Y - X <= v`. A contingent
//! link from A to C is a pair of edges of type `contingent`: `A -> C` with the upper bound (or
//! `LC(C):` and the lower one), and `C -> A` with the lower bound negated (or `UC(C):` and the
//! upper one negated). `UC(C):-7` on another edge `X -> A` is a wait: X waits for C, but at most 7
//! after A.

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_stn::NodeId;

use super::REFUSED_HELP;
use crate::builder::{Builder, GivenLink};
use crate::file::{Format, GivenWait, NetworkFile};
use crate::number::Bound;
use crate::report::Report;
use crate::xml::{self, Element};

/// Name of the node that serves as time zero.
const REFERENCE: &str = "Z";
/// The label of nodes that happen in every case.
const EMPTY_LABEL: &str = "⊡";

pub(super) fn read(text: &str, ending: &str, report: &mut Report) -> Option<NetworkFile> {
    let elements = xml::parse(text, report)?;
    let graph = graph(&elements, report)?;
    if let Some((at, kind)) = unsupported(graph, ending) {
        report.mistake(at, format!("{kind} is not supported"), REFUSED_HELP);
        return None;
    }
    let mut builder = Builder::new(Format::GraphMl);
    if let Some(name) = data(graph, "Name") {
        name.text.trim().clone_into(&mut builder.name);
    }
    for node in graph.named("node") {
        match node.attribute("id") {
            Some(id) => builder.point(id, node.at, report),
            None => report.mistake(node.at, "this node has no id", "write `<node id=\"…\">`"),
        }
    }
    builder.reference = builder.find(REFERENCE);
    let edges: Vec<Edge> = graph
        .named("edge")
        .filter_map(|element| Edge::of(element, &builder, report))
        .collect();
    contingent_links(&mut builder, &edges, report);
    for edge in edges.iter().filter(|edge| !edge.is_contingent) {
        requirement(&mut builder, edge, report);
    }
    builder.finish(report)
}

/// Returns the only graph of the document.
fn graph<'e>(elements: &'e [Element], report: &mut Report) -> Option<&'e Element> {
    let roots = elements.iter().filter(|element| element.name == "graphml");
    let graphs: Vec<&Element> = roots.flat_map(|root| root.named("graph")).collect();
    match graphs[..] {
        [graph] => Some(graph),
        [] => {
            // The header may be missing, but the nodes can reveal an unsupported kind of network.
            let conditional = elements.iter().find(|element| is_conditional_node(element));
            match conditional {
                Some(node) => report.mistake(
                    node.at,
                    "a conditional network is not supported",
                    REFUSED_HELP,
                ),
                None => report.mistake(
                    0,
                    "this XML contains no graph",
                    "expected `<graphml …><graph …>` around the nodes and edges",
                ),
            }
            None
        }
        [_, second, ..] => {
            report.mistake(
                second.at,
                "there are several graphs",
                "put each into a separate file",
            );
            None
        }
    }
}

/// Returns the value under a key.
fn data<'e>(element: &'e Element, key: &str) -> Option<&'e Element> {
    let found = element
        .named("data")
        .find(|data| data.attribute("key") == Some(key));
    found.filter(|data| !data.text.trim().is_empty())
}

/// Returns the position and the description of an unsupported kind of network.
fn unsupported(graph: &Element, ending: &str) -> Option<(usize, String)> {
    if let Some(kind) = data(graph, "NetworkType") {
        let name = kind.text.trim().to_ascii_uppercase();
        if !matches!(name.as_str(), "STN" | "STNU") {
            return Some((kind.text_at, format!("a network of the type {name}")));
        }
    } else if !matches!(ending, "stn" | "stnu" | "graphml" | "xml" | "") {
        return Some((graph.at, format!("a file that ends in .{ending}")));
    }
    if let Some(node) = graph.named("node").find(|node| is_conditional_node(node)) {
        return Some((node.at, "a conditional network".to_owned()));
    }
    let labelled = [
        "LabeledValues",
        "LowerCaseLabeledValues",
        "UpperCaseLabeledValues",
    ];
    for edge in graph.named("edge") {
        let values = labelled.iter().find_map(|key| data(edge, key));
        if let Some(values) = values.filter(|values| values.text.trim() != "{}") {
            return Some((
                values.text_at,
                "an edge with values for several cases".to_owned(),
            ));
        }
    }
    None
}

/// Returns `true` if a node observes a proposition, or only happens in some cases.
fn is_conditional_node(node: &Element) -> bool {
    let label = data(node, "Label").map(|label| label.text.trim());
    node.name == "node"
        && (data(node, "Obs").is_some() || label.is_some_and(|label| label != EMPTY_LABEL))
}

/// Edge as given in the file.
struct Edge {
    at: usize,
    from: NodeId,
    to: NodeId,
    is_contingent: bool,
    value: Option<Bound>,
    labelled: Option<(Case, NodeId, Rational)>,
}

/// Case of a labelled value: the link ends at its lower bound, or at its upper bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Case {
    Lower,
    Upper,
}

impl Edge {
    /// Reads an edge. Returns `None` after reporting a mistake.
    fn of(element: &Element, builder: &Builder, report: &mut Report) -> Option<Self> {
        let mut end = |name| {
            let Some(id) = element.attribute(name) else {
                report.mistake(
                    element.at,
                    format!("this edge has no {name}"),
                    "write `<edge source=\"…\" target=\"…\">`",
                );
                return None;
            };
            builder.named(id, element.at, report)
        };
        let (from, to) = (end("source"), end("target"));
        let mut value = None;
        if let Some(data) = data(element, "Value") {
            value = Bound::parse(&data.text);
            if value.is_none() {
                report.mistake(data.text_at, "this value is not a number", "write a number");
                return None;
            }
        }
        let labelled = match data(element, "LabeledValue") {
            None => None,
            Some(data) => Some(labelled(data, builder, report)?),
        };
        let kind = data(element, "Type").map(|kind| kind.text.trim());
        Some(Self {
            at: element.at,
            from: from?,
            to: to?,
            is_contingent: kind.is_some_and(|kind| kind.eq_ignore_ascii_case("contingent")),
            value,
            labelled,
        })
    }

    /// Returns the value in one of the two cases of a link that ends at a node.
    fn in_case(&self, case: Case) -> Option<&Rational> {
        let (own, _, value) = self.labelled.as_ref()?;
        (*own == case).then_some(value)
    }

    fn finite(&self) -> Option<&Rational> {
        match &self.value {
            Some(Bound::Finite(value)) => Some(value),
            _ => None,
        }
    }
}

/// Reads `LC(C):4` or `UC(C):-7`.
fn labelled(
    data: &Element,
    builder: &Builder,
    report: &mut Report,
) -> Option<(Case, NodeId, Rational)> {
    let text = data.text.trim();
    let parts = text.rsplit_once(':').and_then(|(label, value)| {
        let (case, name) = label.trim().split_once('(')?;
        let case = match case.trim().to_ascii_uppercase().as_str() {
            "LC" => Case::Lower,
            "UC" => Case::Upper,
            _ => return None,
        };
        let value = Bound::parse(value).and_then(Bound::finite)?;
        Some((case, name.strip_suffix(')')?.trim(), value))
    });
    let Some((case, name, value)) = parts else {
        report.mistake(
            data.text_at,
            format!("`{text}` is not a labelled value"),
            "write `LC(C):4` or `UC(C):-7`, where C is the end of a contingent link",
        );
        return None;
    };
    let node = builder.named(name, data.text_at, report)?;
    Some((case, node, value))
}

/// Joins the contingent edges to links.
fn contingent_links(builder: &mut Builder, edges: &[Edge], report: &mut Report) {
    let contingent = || edges.iter().filter(|edge| edge.is_contingent);
    let mut by_ends: BTreeMap<(NodeId, NodeId), &Edge> = BTreeMap::new();
    for edge in contingent() {
        if by_ends.insert((edge.from, edge.to), edge).is_some() {
            report.mistake(
                edge.at,
                "there are two contingent edges from and to the same nodes",
                "a contingent link consists of one edge in each direction",
            );
        }
    }
    for edge in contingent() {
        let Some(back) = by_ends.get(&(edge.to, edge.from)) else {
            report.mistake(
                edge.at,
                "this contingent edge has no counterpart",
                "a contingent link consists of one edge in each direction",
            );
            continue;
        };
        // Each pair is visited twice.
        if leads_to_end(edge, back) {
            link(builder, edge, back, report);
        } else if !leads_to_end(back, edge) && edge.from < edge.to {
            report.mistake(
                edge.at,
                "this contingent edge and its counterpart do not define which node is the end",
                "the value of the edge from the end to the beginning must be negative or 0",
            );
        }
    }
}

/// Returns `true` if an edge leads from the activation of a link to its end, rather than back.
fn leads_to_end(edge: &Edge, back: &Edge) -> bool {
    if let Some((_, end, _)) = &edge.labelled {
        return *end == edge.to;
    }
    if let Some((_, end, _)) = &back.labelled {
        return *end == back.from;
    }
    let is_end = |value: Option<&Rational>| value.is_some_and(|value| !value.is_positive());
    let is_positive = match &edge.value {
        Some(Bound::Finite(value)) => value.is_positive(),
        Some(Bound::Infinity) => true,
        _ => false,
    };
    is_end(back.finite()) && is_positive
}

/// Adds a link, given its forward and its backward edge.
fn link(builder: &mut Builder, there: &Edge, back: &Edge, report: &mut Report) {
    let lower = there.in_case(Case::Lower).cloned();
    let lower = lower.or_else(|| back.finite().map(|value| -value));
    let upper = match back.in_case(Case::Upper) {
        Some(value) => Some(Bound::Finite(-value)),
        None => there.value.clone(),
    };
    let (Some(lower), Some(upper)) = (lower, upper) else {
        report.mistake(
            there.at,
            "this contingent edge and its counterpart do not define both bounds",
            "write the values of both, or `LC(C):` with the lower bound and `UC(C):` with the \
             upper one negated",
        );
        return;
    };
    let given = GivenLink {
        at: there.at,
        activation: there.from,
        end: there.to,
        lower: Bound::Finite(lower),
        upper,
        duration: None,
    };
    builder.link(given, report);
}

/// Adds the requirement, the wait, or both of an edge that is not contingent.
fn requirement(builder: &mut Builder, edge: &Edge, report: &mut Report) {
    if let Some(value) = &edge.value {
        let bounds = (Bound::NegativeInfinity, value.clone());
        builder.requirement((edge.from, edge.to), bounds, edge.at, report);
    }
    match &edge.labelled {
        None => {
            if edge.value.is_none() {
                report.remark("edges without a value are ignored");
            }
        }
        Some((Case::Upper, end, value)) => {
            let link = builder.link_ending_at(*end);
            let link = link.filter(|&link| builder.link_of(link).activation == edge.to);
            match link {
                Some(link) => builder.waits.push(GivenWait {
                    node: edge.from,
                    link,
                    delay: Some(-value),
                }),
                // Its link may be missing because of a mistake that was reported.
                None if report.is_failed() => {}
                None => report.mistake(
                    edge.at,
                    "no contingent link for this wait begins at the edge's target",
                    "`UC(C):-7` on an edge to A needs a contingent link from A to C",
                ),
            }
        }
        Some((Case::Lower, _, _)) => report.mistake(
            edge.at,
            "lower-case value on an edge that is not contingent",
            "write `contingent` as its type, or a plain value",
        ),
    }
}
