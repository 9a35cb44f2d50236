//! Conversion of words to nested lists.

use std::borrow::Cow;

use crate::report::Report;
use crate::source::{FileId, Span};
use crate::syntax::lexer::{Token, tokens};

/// Maximum depth of lists. Deeper ones are refused, so that recursion over trees is safe.
const DEEPEST: usize = 200;

/// A word or a list, with its position.
#[derive(Debug)]
pub(crate) struct Node<'s> {
    pub(crate) span: Span,
    pub(crate) kind: Kind<'s>,
}

/// The kind of a node.
#[derive(Debug)]
pub(crate) enum Kind<'s> {
    Word(&'s str),
    List(Vec<Node<'s>>),
}

impl<'s> Node<'s> {
    /// Returns the word as written, if it is one.
    pub(crate) fn word(&self) -> Option<&'s str> {
        match self.kind {
            Kind::Word(word) => Some(word),
            Kind::List(_) => None,
        }
    }

    /// Returns the word in lower case, if it is one.
    pub(crate) fn lower(&self) -> Option<Cow<'s, str>> {
        self.word().map(lower)
    }

    /// Returns `true` if the node is this word, ignoring case.
    pub(crate) fn is(&self, word: &str) -> bool {
        self.word()
            .is_some_and(|own| own.eq_ignore_ascii_case(word))
    }

    /// Returns the elements, if it is a list.
    pub(crate) fn list(&self) -> Option<&[Node<'s>]> {
        match &self.kind {
            Kind::Word(_) => None,
            Kind::List(nodes) => Some(nodes),
        }
    }

    /// Returns the first element's word in lower case, and the other elements.
    pub(crate) fn form(&self) -> Option<(Cow<'s, str>, &[Node<'s>])> {
        let (head, rest) = self.list()?.split_first()?;
        Some((head.lower()?, rest))
    }

    /// Returns `true` if the node is `()`.
    pub(crate) fn is_empty_list(&self) -> bool {
        self.list().is_some_and(<[_]>::is_empty)
    }

    /// Returns the span of the first element, or of the whole node if there is none.
    pub(crate) fn head_span(&self) -> Span {
        self.list()
            .and_then(<[_]>::first)
            .map_or(self.span, |head| head.span)
    }

    /// Returns a short quotation of the node for messages.
    pub(crate) fn quote(&self) -> String {
        match &self.kind {
            Kind::Word(word) => (*word).to_owned(),
            Kind::List(nodes) => match nodes.first() {
                None => "()".to_owned(),
                Some(first) if nodes.len() == 1 => match first.word() {
                    Some(word) => format!("({word})"),
                    None => "((…))".to_owned(),
                },
                Some(first) => format!("({} …)", first.word().unwrap_or("(…)")),
            },
        }
    }
}

/// Returns the word in lower case, without a copy if nothing changes.
pub(crate) fn lower(word: &str) -> Cow<'_, str> {
    if word.bytes().any(|byte| byte.is_ascii_uppercase()) {
        Cow::Owned(word.to_ascii_lowercase())
    } else {
        Cow::Borrowed(word)
    }
}

/// Returns the top-level lists and words of a text. Reports unbalanced parentheses.
pub(crate) fn parse<'s>(file: FileId, text: &'s str, report: &mut Report) -> Vec<Node<'s>> {
    let tokens = tokens(file, text, report);
    let mut builder = Builder::new();
    let mut tokens = tokens.into_iter().peekable();
    while let Some((token, span)) = tokens.next() {
        match token {
            Token::Open => {
                let next = tokens.peek().map(|(token, _)| *token);
                if let Some(Token::Word(word)) = next
                    && is_section(word)
                {
                    builder.expect_section(span, word, report);
                }
                builder.open(span, report);
            }
            Token::Close => builder.close(span, report),
            Token::Word(word) => builder.add(Node {
                span,
                kind: Kind::Word(word),
            }),
        }
    }
    builder.finish(report)
}

/// Returns `true` if a list that begins with the word can only occur directly inside `(define …)`.
fn is_section(word: &str) -> bool {
    const SECTIONS: &[&str] = &[
        ":action",
        ":constants",
        ":derived",
        ":domain",
        ":durative-action",
        ":functions",
        ":goal",
        ":init",
        ":metric",
        ":objects",
        ":predicates",
        ":requirements",
        ":types",
    ];
    word.starts_with(':') && SECTIONS.contains(&lower(word).as_ref())
}

/// The lists that are currently open, outermost first.
struct Builder<'s> {
    done: Vec<Node<'s>>,
    open: Vec<(Span, Vec<Node<'s>>)>,
    /// Number of open lists beyond the maximum depth.
    too_deep: usize,
}

impl<'s> Builder<'s> {
    fn new() -> Self {
        Self {
            done: Vec::new(),
            open: Vec::new(),
            too_deep: 0,
        }
    }

    fn add(&mut self, node: Node<'s>) {
        if self.too_deep == 0 {
            match self.open.last_mut() {
                Some((_, nodes)) => nodes.push(node),
                None => self.done.push(node),
            }
        }
    }

    fn open(&mut self, span: Span, report: &mut Report) {
        if self.too_deep > 0 {
            self.too_deep += 1;
        } else if self.open.len() == DEEPEST {
            self.too_deep = 1;
            report
                .error(span, format!("lists nested more than {DEEPEST} deep"))
                .label("this list is too deep")
                .advise("check the parentheses before this place");
        } else {
            self.open.push((span, Vec::new()));
        }
    }

    fn close(&mut self, span: Span, report: &mut Report) {
        if self.too_deep > 0 {
            self.too_deep -= 1;
            return;
        }
        match self.open.pop() {
            Some((start, nodes)) => self.add(list(start, span, nodes)),
            None => {
                report
                    .warning(span, "`)` without a matching `(`")
                    .label("nothing is open here")
                    .advise("remove it, or check the parentheses before it");
            }
        }
    }

    /// Checks at the start of a section that all lists but `(define` are closed.
    fn expect_section(&mut self, span: Span, word: &str, report: &mut Report) {
        if self.open.len() + self.too_deep <= 1 || !self.is_in_define() {
            return;
        }
        self.too_deep = 0;
        let (unclosed, _) = self.open[1];
        report
            .error(unclosed, "`(` without a matching `)`")
            .label("this list is still open …")
            .advise("close it before the next section");
        let label = report.label(span, format!("… where `({word}` begins"));
        report.attach(label);
        while self.open.len() > 1 {
            self.close_at(span);
        }
    }

    fn is_in_define(&self) -> bool {
        let first = self.open.first().and_then(|(_, nodes)| nodes.first());
        first.is_some_and(|head| head.is("define"))
    }

    /// Closes the innermost list as if there were a `)` just before `span`.
    fn close_at(&mut self, span: Span) {
        if let Some((start, nodes)) = self.open.pop() {
            let end = Span {
                end: span.start,
                ..span
            };
            self.add(list(start, end, nodes));
        }
    }

    fn finish(mut self, report: &mut Report) -> Vec<Node<'s>> {
        if let Some((unclosed, _)) = self.open.last() {
            report
                .error(*unclosed, "`(` without a matching `)`")
                .label("this list is never closed")
                .advise("add the missing `)`");
        }
        self.too_deep = 0;
        while let Some((start, nodes)) = self.open.pop() {
            let end = nodes.last().map_or(start, |last| last.span);
            self.add(list(start, end, nodes));
        }
        self.done
    }
}

fn list(start: Span, end: Span, nodes: Vec<Node>) -> Node {
    Node {
        span: Span {
            end: end.end,
            ..start
        },
        kind: Kind::List(nodes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elbowroom_text::Source;

    fn parsed(text: &str) -> (String, Vec<String>) {
        let source = Source::new("f", text);
        let mut report = Report::new(&source, &source);
        let nodes = parse(FileId::Domain, source.text(), &mut report);
        let shown: Vec<_> = nodes.iter().map(show).collect();
        let messages = report
            .into_diagnostics()
            .iter()
            .map(ToString::to_string)
            .collect();
        (shown.join(" "), messages)
    }

    fn show(node: &Node) -> String {
        match &node.kind {
            Kind::Word(word) => (*word).to_owned(),
            Kind::List(nodes) => {
                format!("[{}]", nodes.iter().map(show).collect::<Vec<_>>().join(" "))
            }
        }
    }

    #[test]
    fn nested_lists_are_read() {
        assert_eq!(parsed("(a (b) c)").0, "[a [b] c]");
    }

    #[test]
    fn nested_section_locates_missing_parenthesis() {
        let (tree, messages) =
            parsed("(define (domain d)\n (:action a :effect (and (p))\n (:action b))");
        assert_eq!(
            tree,
            "[define [domain d] [:action a :effect [and [p]]] [:action b]]"
        );
        assert_eq!(
            messages,
            ["f:2:2: error: `(` without a matching `)`; close it before the next section"]
        );
    }

    #[test]
    fn an_unclosed_list_is_closed_at_the_end() {
        let (tree, messages) = parsed("(a (b");
        assert_eq!(tree, "[a [b]]");
        assert_eq!(
            messages,
            ["f:1:4: error: `(` without a matching `)`; add the missing `)`"]
        );
    }

    #[test]
    fn a_million_parentheses_are_one_mistake() {
        let (_, messages) = parsed(&"(".repeat(1_000_000));
        assert_eq!(messages.len(), 2);
        assert_eq!(
            messages[0],
            "f:1:201: error: lists nested more than 200 deep; check the parentheses before this place"
        );
        let balanced = "(".repeat(1_000_000) + &")".repeat(1_000_000);
        assert_eq!(parsed(&balanced).1.len(), 1);
    }
}
