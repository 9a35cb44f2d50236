//! Diagnostics as a terminal shows them.

use std::ops::Range;

use annotate_snippets::{AnnotationKind, Element, Level, Origin, Renderer, Snippet};

use crate::diagnostic::{Diagnostic, Label, Severity};

/// Longer lines are not shown: the excerpt would help nobody, and a machine wrote them.
const LONGEST_LINE: usize = 500;
/// Most lines shown of one stretch.
const MOST_LINES: usize = 4;

/// The diagnostic with an excerpt of its text.
pub(crate) fn render(diagnostic: &Diagnostic, colored: bool) -> String {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let mut group = level.primary_title(diagnostic.message.as_str()).elements(
        diagnostic
            .labels
            .iter()
            .enumerate()
            .map(|(index, label)| excerpt(label, index == 0)),
    );
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(help.as_str()));
    }
    let renderer = if colored {
        Renderer::styled()
    } else {
        Renderer::plain()
    };
    renderer.render(&[group])
}

/// The lines around a label, or only its position where they are too long.
fn excerpt(label: &Label, is_primary: bool) -> Element<'_> {
    let source = &label.source;
    let (first, column) = source.position(label.range.start);
    let (last, _) = source.position(label.range.end);
    let last = last.min(first + MOST_LINES - 1);
    let shown = source.line_range(first).start..source.line_range(last).end;
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
    let annotation = kind.span(within(&label.range, &shown));
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

/// The part of `range` that is shown, relative to what is shown.
fn within(range: &Range<usize>, shown: &Range<usize>) -> Range<usize> {
    let start = range.start.clamp(shown.start, shown.end);
    let end = range.end.clamp(start, shown.end);
    start - shown.start..end - shown.start
}
