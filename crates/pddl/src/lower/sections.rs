//! The frame of a file: `(define (domain name) (:section …) …)`.

use std::borrow::Cow;

use crate::report::Report;
use crate::source::{FileId, Span};
use crate::syntax::Node;
use elbowroom_text::nearest;

/// A file split into its sections.
#[derive(Debug)]
pub(super) struct Sections<'t, 's> {
    /// The name of the domain or problem.
    pub(super) name: &'s str,
    /// Position of the name.
    pub(super) name_span: Span,
    all: Vec<Section<'t, 's>>,
}

/// One section.
#[derive(Debug)]
pub(super) struct Section<'t, 's> {
    /// Its keyword in lower case.
    pub(super) keyword: Cow<'s, str>,
    /// The nodes after the keyword.
    pub(super) content: &'t [Node<'s>],
    /// Position of the keyword.
    pub(super) span: Span,
}

impl<'t, 's> Sections<'t, 's> {
    /// Finds the frame. Returns `None`, with a report, if there is none.
    pub(super) fn find(file: FileId, nodes: &'t [Node<'s>], report: &mut Report) -> Option<Self> {
        let kind = kind(file);
        let defined = nodes
            .iter()
            .position(|node| node.form().is_some_and(|(head, _)| head == "define"));
        let Some(defined) = defined else {
            let span = nodes.first().map_or(start_of(file), |node| node.span);
            let is_plan = nodes.iter().any(is_time);
            let diagnostic = report.error(span, format!("this is not a PDDL {kind}"));
            if is_plan {
                diagnostic.advise("it looks like a plan; the order is DOMAIN PROBLEM PLAN");
            } else {
                diagnostic.advise(format!("expected `(define ({kind} name) …)`"));
            }
            return None;
        };
        let (_, content) = nodes[defined].form()?;
        let Some((name, name_span)) = name(file, content.first(), report) else {
            if content.is_empty() {
                report
                    .error(nodes[defined].span, format!("this {kind} is empty"))
                    .advise(format!("expected `(define ({kind} name) …)`"));
            }
            return None;
        };
        let mut found = Self {
            name,
            name_span,
            all: Vec::new(),
        };
        for node in &content[1..] {
            found.add(node, report);
        }
        for (index, node) in nodes.iter().enumerate() {
            if index != defined {
                found.add_from_outside(node, report);
            }
        }
        Some(found)
    }

    /// Returns the section of that keyword. Reports a second one.
    pub(super) fn single(&self, keyword: &str, report: &mut Report) -> Option<&Section<'t, 's>> {
        let mut same = self.all(keyword);
        let first = same.next()?;
        for second in same {
            report
                .error(second.span, format!("a second `{keyword}` section"))
                .advise("put everything into one section");
            let label = report.label(first.span, "the first is here");
            report.attach(label);
        }
        Some(first)
    }

    /// Returns the sections of that keyword.
    pub(super) fn all(&self, keyword: &str) -> impl Iterator<Item = &Section<'t, 's>> {
        self.iter()
            .filter(move |section| section.keyword == keyword)
    }

    /// Returns all sections.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Section<'t, 's>> {
        self.all.iter()
    }

    fn add(&mut self, node: &'t Node<'s>, report: &mut Report) {
        match node.form() {
            Some((keyword, content)) if keyword.starts_with(':') => self.all.push(Section {
                keyword,
                content,
                span: node.head_span(),
            }),
            _ => {
                report
                    .error(node.span, format!("unexpected `{}`", node.quote()))
                    .advise("expected a section such as `(:init …)` or `(:action …)`");
            }
        }
    }

    /// Reports a list outside of `(define …)`, usually due to a superfluous `)` before it, and adds
    /// it if it is a section.
    fn add_from_outside(&mut self, node: &'t Node<'s>, report: &mut Report) {
        report
            .error(
                node.head_span(),
                format!("`{}` is outside of `(define …)`", node.quote()),
            )
            .advise("check the parentheses before it: perhaps there is one `)` too many");
        if node.form().is_some_and(|(head, _)| head.starts_with(':')) {
            self.add(node, report);
        }
    }
}

/// Returns `true` for the time before an action of a plan, `0.000:`.
fn is_time(node: &Node) -> bool {
    let word = node.word().and_then(|word| word.strip_suffix(':'));
    word.is_some_and(|word| word.parse::<f64>().is_ok())
}

/// Reads `(domain name)` or `(problem name)`.
fn name<'s>(file: FileId, node: Option<&Node<'s>>, report: &mut Report) -> Option<(&'s str, Span)> {
    let node = node?;
    let kind = kind(file);
    match node.form() {
        Some((head, [name])) if head == kind && name.word().is_some() => {
            Some((name.word()?, name.span))
        }
        Some((head, _)) if head == self::kind(other(file)) => {
            report
                .error(node.span, format!("this is a {head}, not a {kind}"))
                .advise("are the two files given in the wrong order?");
            None
        }
        Some((head, _)) if nearest(&head, [kind]).is_some() || head == kind => {
            report
                .error(node.span, format!("expected `({kind} name)`"))
                .advise(format!("write one name after `{kind}`"));
            None
        }
        _ => {
            report
                .error(node.span, format!("unexpected `{}`", node.quote()))
                .advise(format!("expected `({kind} name)`"));
            None
        }
    }
}

fn kind(file: FileId) -> &'static str {
    match file {
        FileId::Domain => "domain",
        FileId::Problem => "problem",
    }
}

fn other(file: FileId) -> FileId {
    match file {
        FileId::Domain => FileId::Problem,
        FileId::Problem => FileId::Domain,
    }
}

fn start_of(file: FileId) -> Span {
    Span {
        file,
        start: 0,
        end: 0,
    }
}
