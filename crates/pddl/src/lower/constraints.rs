//! `:constraints`

use crate::feature::Feature;
use crate::lower::Reader;
use crate::lower::sections::Section;
use crate::syntax::Node;

impl Reader {
    /// Trajectory constraints decide validity, so they are refused, unless all are preferences.
    pub(super) fn constraints(&mut self, section: &Section) {
        let Some(place) = section.content.iter().find_map(first_hard) else {
            if section.content.iter().any(|node| !is_nothing(node)) {
                self.report.ignored(
                    Feature::Preferences,
                    section.span,
                    "preferences do not make plans invalid, and are ignored",
                );
            }
            return;
        };
        self.report
            .unsupported(
                Feature::TrajectoryConstraints,
                place.span,
                format!(
                    "`{}`: trajectory constraints are not supported",
                    place.quote()
                ),
            )
            .advise("express them by timed initial literals, or by an action that lasts");
    }
}

/// Whether it is `()` or `(and)`.
fn is_nothing(node: &Node) -> bool {
    node.list()
        .is_some_and(|nodes| nodes.is_empty() || nodes.len() == 1 && nodes[0].is("and"))
}

/// The first part of a constraint that must hold.
fn first_hard<'t, 's>(node: &'t Node<'s>) -> Option<&'t Node<'s>> {
    if node.is_empty_list() {
        return None;
    }
    match node.form() {
        Some((head, _)) if head == "preference" => None,
        Some((head, parts)) if head == "and" => parts.iter().find_map(first_hard),
        Some((head, [_, part])) if head == "forall" => first_hard(part),
        _ => Some(node),
    }
}
