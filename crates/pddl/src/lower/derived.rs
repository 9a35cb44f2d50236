//! `:derived`

use elbowroom_model::problem::{PredicateId, Rule, TypeId, Variable};

use crate::lower::Reader;
use crate::lower::scope::Scope;
use crate::lower::sections::Section;
use crate::lower::stratify::negative_cycles;
use crate::source::Span;
use crate::syntax::Node;

/// A rule whose head has been read.
pub(super) struct Head<'t, 's> {
    predicate: PredicateId,
    parameters: Vec<Variable>,
    body: &'t Node<'s>,
    span: Span,
}

impl Reader {
    /// Reads the head of a rule. All heads are read before any body or effect, because those
    /// may mention what rules define.
    pub(super) fn rule_head<'t, 's>(&mut self, section: &Section<'t, 's>) -> Option<Head<'t, 's>> {
        let [head, body] = section.content else {
            self.report
                .error(section.span, "a rule needs a head and a condition")
                .advise("expected `(:derived (predicate ?x …) condition)`");
            return None;
        };
        let Some((name, parameters)) = head.form() else {
            self.report
                .error(head.span, format!("unexpected `{}`", head.quote()))
                .advise("expected `(predicate ?x …)`");
            return None;
        };
        let mut parameters_read = self.variables(parameters);
        let overloads = self.names.predicates.get(name.as_ref());
        let predicate = overloads.and_then(|ids| {
            ids.iter().copied().find(|id| {
                self.problem.predicates[id.index()].parameters.len() == parameters_read.len()
            })
        });
        let Some(predicate) = predicate else {
            // Reports a wrong name or a wrong number of arguments.
            let scope = Scope {
                variables: parameters_read,
                ..Scope::default()
            };
            if scope.variables.len() == parameters.len() || overloads.is_none() {
                self.atom(head, &scope);
            } else {
                self.report
                    .error(head.span, "the arguments do not fit the predicate");
            }
            return None;
        };
        let declared = &mut self.problem.predicates[predicate.index()];
        declared.is_derived = true;
        for (own, declared) in parameters_read.iter_mut().zip(&declared.parameters) {
            if own.types == [TypeId::OBJECT] {
                own.types.clone_from(&declared.types);
            }
        }
        Some(Head {
            predicate,
            parameters: parameters_read,
            body,
            span: head.span,
        })
    }

    /// Reads the bodies of rules, and refuses rules that depend on their own negation.
    pub(super) fn rules(&mut self, heads: Vec<Head>) {
        for head in heads {
            let mut scope = Scope {
                variables: head.parameters,
                without_preferences: 1,
                ..Scope::default()
            };
            let body = self.condition(head.body, &mut scope);
            self.rule_spans.push(head.span);
            self.problem.rules.push(Rule {
                predicate: head.predicate,
                parameters: scope.variables,
                body,
            });
        }
        for rule in negative_cycles(&self.problem) {
            let name = &self.problem.predicates[self.problem.rules[rule].predicate.index()].name;
            self.report
                .error(
                    self.rule_spans[rule],
                    format!("`{name}` depends on its own negation"),
                )
                .advise("a derived predicate may not be negated in its own definition");
        }
    }
}
