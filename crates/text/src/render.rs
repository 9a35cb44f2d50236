//! Diagnostics for terminals.

use annotate_snippets::{AnnotationKind, Element, Level, Origin, Renderer, Snippet};

use crate::diagnostic::{Diagnostic, Diagnostics, Label, Severity};
use crate::source::{Source, Span};

/// Columns of a terminal. Longer lines are cut to the part around the place.
const WIDTH: usize = 100;
/// Maximum length of a shown line. Cutting longer ones takes time, and they are usually generated.
const LONGEST_LINE: usize = 20_000;
/// Maximum number of lines shown of one place.
const MAX_LINES: usize = 4;

impl Diagnostic {
    /// Returns the finding with an excerpt of the text, for a terminal.
    pub fn render(&self, colored: bool) -> String {
        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let mut group = level.primary_title(self.message.as_str()).elements(
            self.labels
                .iter()
                .enumerate()
                .map(|(index, label)| excerpt(label, index == 0)),
        );
        if let Some(advice) = &self.advice {
            group = group.element(Level::HELP.message(advice.as_str()));
        }
        let renderer = if colored {
            Renderer::styled()
        } else {
            Renderer::plain()
        };
        renderer.term_width(WIDTH).render(&[group])
    }
}

impl Diagnostics {
    /// Returns all findings with excerpts, for a terminal.
    pub fn render(&self, colored: bool) -> String {
        self.iter()
            .map(|diagnostic| diagnostic.render(colored))
            .collect::<Vec<_>>()
            .join("\n\n")
    }
}

/// Returns the lines around a label, or only its position if they are too long.
fn excerpt(label: &Label, is_primary: bool) -> Element<'_> {
    let source = &label.source;
    let (first, column) = source.position(label.span.start);
    let (last, _) = source.position(label.span.end);
    let last = last.min(first + MAX_LINES - 1);
    let shown = source.line(first).start..source.line(last).end;
    if shown.len() > LONGEST_LINE {
        return Origin::path(source.name())
            .line(first)
            .char_column(column)
            .into();
    }
    let kind = if is_primary {
        AnnotationKind::Primary
    } else {
        AnnotationKind::Context
    };
    let annotation = kind.span(within(source, &label.span, &shown));
    let annotation = if label.text.is_empty() {
        annotation
    } else {
        annotation.label(label.text.as_str())
    };
    Snippet::source(&source.text()[shown])
        .path(source.name())
        .line_start(first)
        .annotation(annotation)
        .into()
}

/// Returns the shown part of `span`, relative to `shown`.
fn within(source: &Source, span: &Span, shown: &Span) -> Span {
    let start = source.boundary(span.start).clamp(shown.start, shown.end);
    let end = source.boundary(span.end).clamp(start, shown.end);
    start - shown.start..end - shown.start
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shown(text: &str, span: Span) -> String {
        let source = Source::new("f", text);
        let mut found = Diagnostic::new(Severity::Error, &source, span, "wrong");
        found.advise("write it otherwise");
        found.render(false)
    }

    #[test]
    fn label_marks_its_span() {
        insta::assert_snapshot!(shown("one\ntwo three\n", 8..13), @r"
error: wrong
 --> f:2:5
  |
2 | two three
  |     ^^^^^
  |
  = help: write it otherwise
");
    }

    #[test]
    fn long_line_is_shortened_around_the_label() {
        let text = format!("a\n{}XYZ{}", "b".repeat(500), "c".repeat(500));
        insta::assert_snapshot!(shown(&text, 502..505), @r"
error: wrong
 --> f:2:501
  |
2 | ...bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbXYZcccccccccccccccccccccccccccccccccccccccccccc...
  |                                               ^^^
  |
  = help: write it otherwise
");
    }

    proptest! {
        #[test]
        fn rendering_never_panics(
            text in "[a-c\u{e9}\u{1f600}\n\r\t]{0,30}",
            start in 0_usize..40,
            length in 0_usize..40,
        ) {
            shown(&text, start..start + length);
            let long = text.replace('a', &"x\u{e9}".repeat(120));
            shown(&long, start * 20..start * 20 + length);
        }
    }
}
