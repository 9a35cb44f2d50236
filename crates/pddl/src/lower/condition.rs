//! Conditions without time specifiers.

use elbowroom_model::problem::{Comparison, Condition, Variable};

use crate::lower::Reader;
use crate::lower::expression::number;
use crate::lower::scope::Scope;
use crate::lower::timed::{Timed, time_specifier};
use crate::syntax::Node;

impl Reader {
    /// Reads a condition on one state.
    pub(super) fn condition(&mut self, node: &Node, scope: &mut Scope) -> Condition {
        if node.is_empty_list() {
            return Condition::TRUE;
        }
        let Some((head, parts)) = node.form() else {
            self.report
                .error(node.span, format!("unexpected `{}`", node.quote()))
                .advise("expected a condition such as `(predicate argument …)` or `(and …)`");
            return Condition::TRUE;
        };
        if let Some(comparison) = comparison(&head) {
            if let (Comparison::Equal, [left, right]) = (comparison, parts) {
                for (fluent, value) in [(left, right), (right, left)] {
                    if self.is_application(fluent) {
                        return self.has_value(fluent, value, scope);
                    }
                }
            }
            return self.with_values(parts, scope, |reader, scope| {
                reader.comparison(comparison, node, parts, scope)
            });
        }
        let has_time = time_specifier(node).is_some_and(|(_, what)| !self.is_application(what));
        if self.names.predicates.contains_key(head.as_ref()) && !is_connective(&head) && !has_time {
            return self.with_values(parts, scope, |reader, scope| {
                reader
                    .atom(node, scope)
                    .map_or(Condition::TRUE, Condition::Atom)
            });
        }
        match (head.as_ref(), parts) {
            ("and", _) => {
                let mut parts = self.conditions(parts, scope);
                parts.retain(|part| !part.is_trivial());
                Condition::And(parts)
            }
            ("or", _) => {
                without_preferences(scope, |scope| Condition::Or(self.conditions(parts, scope)))
            }
            ("not", [part]) => without_preferences(scope, |scope| {
                Condition::Not(Box::new(self.condition(part, scope)))
            }),
            ("imply", [premise, conclusion]) => without_preferences(scope, |scope| {
                Condition::Or(vec![
                    Condition::Not(Box::new(self.condition(premise, scope))),
                    self.condition(conclusion, scope),
                ])
            }),
            ("exists", [variables, part]) => without_preferences(scope, |scope| {
                let (variables, part) = self.quantified(variables, part, scope);
                Condition::Exists(variables, Box::new(part))
            }),
            ("forall", [variables, part]) => {
                let (variables, part) = self.quantified(variables, part, scope);
                if part.is_trivial() {
                    part
                } else {
                    Condition::Forall(variables, Box::new(part))
                }
            }
            ("not" | "imply" | "exists" | "forall", _) => {
                self.wrong_parts(&head, node);
                Condition::TRUE
            }
            ("preference", _) => {
                self.preference(node, scope, |reader, part, scope| Timed {
                    start: reader.condition(part, scope),
                    ..Timed::default()
                });
                Condition::TRUE
            }
            _ if time_specifier(node).is_some() => {
                self.report
                    .error(
                        node.span,
                        format!("`{}` does not belong here", node.quote()),
                    )
                    .advise(
                        "time specifiers are allowed only in durative actions, and not inside \
                             each other",
                    );
                Condition::TRUE
            }
            _ => self
                .atom(node, scope)
                .map_or(Condition::TRUE, Condition::Atom),
        }
    }

    fn conditions(&mut self, parts: &[Node], scope: &mut Scope) -> Vec<Condition> {
        parts
            .iter()
            .map(|part| self.condition(part, scope))
            .collect()
    }

    fn quantified(
        &mut self,
        variables: &Node,
        part: &Node,
        scope: &mut Scope,
    ) -> (Vec<Variable>, Condition) {
        let variables = self.variable_list(variables);
        let outside = scope.variables.len();
        scope.variables.extend(variables.iter().cloned());
        let part = self.condition(part, scope);
        scope.variables.truncate(outside);
        (variables, part)
    }

    /// Reads `(< a b)`, or `(= a b)` of numbers or of objects.
    fn comparison(
        &mut self,
        comparison: Comparison,
        node: &Node,
        operands: &[Node],
        scope: &Scope,
    ) -> Condition {
        let [left, right] = operands else {
            self.report
                .error(
                    node.span,
                    format!("`{}` takes two operands", comparison.symbol()),
                )
                .advise(format!("expected `({} a b)`", comparison.symbol()));
            return Condition::TRUE;
        };
        if comparison == Comparison::Equal {
            let is_object = |node: &Node| self.is_term(node, scope);
            if is_object(left) && (is_object(right) || !self.is_number(right, scope))
                || is_object(right) && !self.is_number(left, scope)
            {
                return match (self.term(left, scope), self.term(right, scope)) {
                    (Some(left), Some(right)) => Condition::Equal(left, right),
                    _ => Condition::TRUE,
                };
            }
        }
        Condition::Compare(
            comparison,
            self.expression(left, scope),
            self.expression(right, scope),
        )
    }

    /// Returns `true` if a word denotes an object here.
    fn is_term(&self, node: &Node, scope: &Scope) -> bool {
        node.lower().is_some_and(|word| {
            scope.variable(&word).is_some()
                || self.names.objects.contains_key(word.as_ref())
                    && !self.names.functions.contains_key(word.as_ref())
        })
    }

    /// Returns `true` if the node can only denote a number here.
    fn is_number(&self, node: &Node, scope: &Scope) -> bool {
        match node.lower() {
            Some(word) => {
                number(node).is_some()
                    || word == "?duration"
                    || scope.unknown(&word).is_some()
                    || self.names.functions.contains_key(word.as_ref())
                    || self.problem.unknowns.contains(&word.into_owned())
            }
            None => node.form().is_some() && !self.is_application(node),
        }
    }

    /// Reports the wrong number of parts of a connective.
    pub(super) fn wrong_parts(&mut self, head: &str, node: &Node) {
        let expected = match head {
            "imply" => "(imply condition condition)",
            "exists" => "(exists (?x - type) condition)",
            "forall" => "(forall (?x - type) …)",
            "when" => "(when condition effect)",
            _ => "(not …)",
        };
        self.report
            .error(node.span, format!("`{head}` has the wrong number of parts"))
            .advise(format!("expected `{expected}`"));
    }
}

/// Runs `read` in a context where ignoring a preference would change the hard conditions.
pub(super) fn without_preferences<T>(scope: &mut Scope, read: impl FnOnce(&mut Scope) -> T) -> T {
    scope.without_preferences += 1;
    let read = read(scope);
    scope.without_preferences -= 1;
    read
}

/// Returns the comparison of a symbol.
pub(super) fn comparison(symbol: &str) -> Option<Comparison> {
    Some(match symbol {
        "<" => Comparison::Less,
        "<=" => Comparison::AtMost,
        "=" => Comparison::Equal,
        ">=" => Comparison::AtLeast,
        ">" => Comparison::Greater,
        _ => return None,
    })
}

fn is_connective(head: &str) -> bool {
    matches!(head, "and" | "or" | "not" | "imply" | "exists" | "forall")
}
