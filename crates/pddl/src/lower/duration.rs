//! `:duration`

use elbowroom_model::problem::{Comparison, DurationConstraint};

use crate::feature::Feature;
use crate::lower::Reader;
use crate::lower::condition::comparison;
use crate::lower::scope::Scope;
use crate::lower::timed::{Time, time_specifier};
use crate::syntax::{Kind, Node};
use elbowroom_text::nearest;

impl Reader {
    /// Reads the constraints on a duration; none for `()`.
    pub(super) fn duration(
        &mut self,
        node: &Node,
        at_end: bool,
        scope: &Scope,
        constraints: &mut Vec<DurationConstraint>,
    ) {
        if node.is_empty_list() {
            return;
        }
        if let Some((time, inner)) = time_specifier(node)
            && time != Time::OverAll
        {
            self.duration(inner, time == Time::End, scope, constraints);
            return;
        }
        let form = node.form();
        if let Some((head, parts)) = &form
            && head == "and"
        {
            for part in *parts {
                self.duration(part, at_end, scope, constraints);
            }
            return;
        }
        let Some((comparison, left, right)) = form.and_then(|(head, parts)| match parts {
            [left, right] => Some((comparison(&head)?, left, right)),
            _ => None,
        }) else {
            self.wrong_duration(node);
            return;
        };
        let (comparison, bound) = match (left.is("?duration"), right.is("?duration")) {
            (true, false) => (comparison, right),
            (false, true) => (mirrored(comparison), left),
            _ => {
                self.wrong_duration(node);
                return;
            }
        };
        if mentions_duration(bound) {
            self.wrong_duration(node);
            return;
        }
        if matches!(comparison, Comparison::Less | Comparison::Greater) {
            self.report
                .unsupported(
                    Feature::StrictDurations,
                    node.span,
                    format!("`{}` on a duration is not supported", comparison.symbol()),
                )
                .advise(format!("PDDL allows `{}=` here", comparison.symbol()));
            return;
        }
        constraints.push(DurationConstraint {
            comparison,
            bound: self.expression(bound, scope),
            at_end,
        });
    }

    fn wrong_duration(&mut self, node: &Node) {
        let near = node
            .list()
            .into_iter()
            .flatten()
            .filter_map(Node::word)
            .find_map(|word| nearest(word, ["?duration"]))
            .filter(|_| !mentions_duration(node));
        self.report
            .error(
                node.span,
                format!("`{}` does not bound the duration", node.quote()),
            )
            .advise("expected `(= ?duration value)`, `(<= ?duration value)` or `(and …)` of such")
            .suggest(near);
    }
}

/// Returns the comparison with its sides exchanged.
fn mirrored(comparison: Comparison) -> Comparison {
    match comparison {
        Comparison::Less => Comparison::Greater,
        Comparison::AtMost => Comparison::AtLeast,
        Comparison::Equal => Comparison::Equal,
        Comparison::AtLeast => Comparison::AtMost,
        Comparison::Greater => Comparison::Less,
    }
}

fn mentions_duration(node: &Node) -> bool {
    match &node.kind {
        Kind::Word(word) => word.eq_ignore_ascii_case("?duration"),
        Kind::List(nodes) => nodes.iter().any(mentions_duration),
    }
}
