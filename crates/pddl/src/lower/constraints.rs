//! `:constraints`

use crate::feature::Feature;
use crate::lower::Reader;
use crate::lower::sections::Section;
use crate::syntax::Node;

impl Reader {
    /// Trajectory constraints decide validity, so they are refused, unless all are preferences.
    pub(super) fn constraints(&mut self, section: &Section) {
        if section.content.iter().all(is_preference) {
            if let Some(first) = section.content.first() {
                self.report.ignored(
                    Feature::Preferences,
                    first.span,
                    "preferences do not make plans invalid, and are ignored",
                );
            }
            return;
        }
        let place = section
            .content
            .iter()
            .find_map(first_hard)
            .unwrap_or(&section.content[0]);
        self.report
            .unsupported(
                Feature::TrajectoryConstraints,
                place.span,
                format!(
                    "`{}`: trajectory constraints are not supported",
                    place.quote()
                ),
            )
            .help("express them by timed initial literals, or by an action that lasts");
    }
}

/// Whether nothing in it must hold.
fn is_preference(node: &Node) -> bool {
    first_hard(node).is_none()
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
