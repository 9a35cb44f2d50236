//! Atoms, fluents and their arguments: objects and variables.

use elbowroom_model::problem::{Atom, Fluent, FunctionId, ObjectId, PredicateId, Term, Variable};

use elbowroom_num::Rational;

use crate::lower::Reader;
use crate::lower::constraints::proper_place;
use crate::lower::scope::Scope;
use crate::source::Span;
use crate::syntax::Node;

impl Reader {
    /// Reads `(predicate term …)`. Returns `None`, with a report, if it is not understood.
    pub(super) fn atom(&mut self, node: &Node, scope: &Scope) -> Option<Atom> {
        let Some((name, arguments)) = node.form() else {
            self.report
                .error(node.span, format!("unexpected `{}`", node.quote()))
                .advise("expected `(predicate argument …)`");
            return None;
        };
        let Some(overloads) = self.names.predicates.get(name.as_ref()) else {
            self.unknown_predicate(&name, node);
            return None;
        };
        let predicate = *overloads
            .iter()
            .find(|id| self.predicate_parameters(**id).len() == arguments.len())
            .unwrap_or(&overloads[0]);
        let parameters = self.predicate_parameters(predicate).to_vec();
        let arguments = self.arguments(&name, node, arguments, &parameters, scope)?;
        Some(Atom {
            predicate,
            arguments,
        })
    }

    /// Reads `(function term …)`, or the bare name of a function without arguments. Returns `None`
    /// if it is not understood, with a report unless it is an object fluent.
    pub(super) fn fluent(&mut self, node: &Node, scope: &Scope) -> Option<Fluent> {
        let no_arguments: &[Node] = &[];
        let form = node.form().or_else(|| Some((node.lower()?, no_arguments)));
        let Some((name, arguments)) = form else {
            self.report
                .error(node.span, format!("unexpected `{}`", node.quote()))
                .advise("expected `(function argument …)`");
            return None;
        };
        let Some(overloads) = self.names.functions.get(name.as_ref()) else {
            self.unknown_function(&name, node);
            return None;
        };
        let function = *overloads
            .iter()
            .find(|id| self.function_parameters(**id).len() == arguments.len())
            .unwrap_or(&overloads[0]);
        let parameters = self.function_parameters(function).to_vec();
        let arguments = self.arguments(&name, node, arguments, &parameters, scope)?;
        Some(Fluent {
            function,
            arguments,
        })
    }

    /// Reads a variable or an object. Returns `None`, with a report, if it is neither.
    pub(super) fn term(&mut self, node: &Node, scope: &Scope) -> Option<Term> {
        let Some(word) = node.lower() else {
            if let Some(value) = scope.values.get(&(node.span.start, node.span.end)) {
                return Some(Term::Variable(*value));
            }
            if self.is_application(node) {
                self.refuse_value(node);
            } else {
                self.report
                    .error(node.span, format!("unexpected `{}`", node.quote()))
                    .advise("expected the name of an object, or a `?variable`");
            }
            return None;
        };
        if word.starts_with('?') {
            if let Some((term, _)) = scope.variable(&word) {
                return Some(term);
            }
            let near = self
                .report
                .nearest(&word, scope.variables.iter().map(|v| v.name.as_str()));
            let is_number = scope.unknown(&word).is_some() || word == "?duration";
            let diagnostic = self.report.error(
                node.span,
                if is_number {
                    format!("`{word}` is a number, not an object")
                } else {
                    format!("unknown variable `{word}`")
                },
            );
            if !is_number {
                diagnostic
                    .advise("declare it under `:parameters`, or by `forall` or `exists`")
                    .suggest(near);
            }
            return None;
        }
        if let Some(&object) = self.names.objects.get(word.as_ref()) {
            return Some(Term::Object(object));
        }
        if word.parse::<Rational>().is_ok() {
            self.report
                .error(
                    node.span,
                    format!("`{}` is a number, not an object", node.quote()),
                )
                .advise("expected the name of an object, or a `?variable`");
            return None;
        }
        let near = self
            .report
            .nearest(&word, self.names.objects.keys().map(String::as_str));
        let near = near.and_then(|near| self.names.objects.get(near));
        let near = near.map(|id| self.problem.objects[id.index()].name.as_str());
        self.report
            .error(node.span, format!("unknown object `{}`", node.quote()))
            .advise("declare it under `:objects` or `:constants`")
            .suggest(near);
        None
    }

    /// Reads the arguments. Their number and types must match the parameters.
    pub(super) fn arguments(
        &mut self,
        name: &str,
        node: &Node,
        arguments: &[Node],
        parameters: &[Variable],
        scope: &Scope,
    ) -> Option<Vec<Term>> {
        let terms: Vec<_> = arguments.iter().map(|a| self.term(a, scope)).collect();
        if arguments.len() != parameters.len() {
            let expected: Vec<_> = parameters.iter().map(|p| p.name.as_str()).collect();
            let expected = expected.join(" ");
            self.report
                .error(
                    node.span,
                    format!(
                        "`{name}` takes {}, not {}",
                        count(parameters.len()),
                        arguments.len()
                    ),
                )
                .advise(format!(
                    "expected `({})`",
                    [name, &expected].join(" ").trim_end()
                ));
            return None;
        }
        let terms = terms.into_iter().collect::<Option<Vec<_>>>()?;
        for ((term, argument), parameter) in terms.iter().zip(arguments).zip(parameters) {
            self.check_type(*term, argument.span, name, parameter, scope);
        }
        Some(terms)
    }

    /// Warns of an argument that may not be of the parameter's type.
    pub(super) fn check_type(
        &mut self,
        term: Term,
        span: Span,
        name: &str,
        parameter: &Variable,
        scope: &Scope,
    ) {
        let (own, shown) = match term {
            Term::Object(object) => {
                if self.problem.has_type(object, &parameter.types) {
                    return;
                }
                let object = &self.problem.objects[object.index()];
                (object.types.as_slice(), object.name.as_str())
            }
            Term::Variable(position) => {
                let variable = &scope.variables[position];
                (variable.types.as_slice(), variable.name.as_str())
            }
        };
        if self.always_fits(own, &parameter.types) {
            return;
        }
        let asked = self.type_list(&parameter.types);
        let given = self.type_list(own);
        let message = if self.can_fit(own, &parameter.types) {
            format!("`{shown}` of type {given} need not be of type {asked}, as `{name}` asks")
        } else {
            format!("`{shown}` is of type {given}, but `{name}` asks for {asked}")
        };
        self.report.warning(span, message);
    }

    /// Returns the terms as objects, in contexts without variables.
    pub(super) fn objects_only(terms: &[Term]) -> Option<Vec<ObjectId>> {
        terms
            .iter()
            .map(|term| match term {
                Term::Object(object) => Some(*object),
                Term::Variable(_) => None,
            })
            .collect()
    }

    fn predicate_parameters(&self, id: PredicateId) -> &[Variable] {
        &self.problem.predicates[id.index()].parameters
    }

    fn function_parameters(&self, id: FunctionId) -> &[Variable] {
        &self.problem.functions[id.index()].parameters
    }

    fn unknown_predicate(&mut self, name: &str, node: &Node) {
        let near = self
            .report
            .nearest(name, self.names.predicates.keys().map(String::as_str));
        if self.names.object_functions.contains_key(name) {
            self.report
                .error(
                    node.head_span(),
                    format!("`{name}` is a function, not a predicate"),
                )
                .advise("compare its value with an object, as in `(= (f) object)`");
            return;
        }
        if let Some(advice) = proper_place(name) {
            let message = format!("`{}` does not belong here", node.quote());
            self.report.error(node.head_span(), message).advise(advice);
            return;
        }
        let is_function = self.names.functions.contains_key(name);
        let diagnostic = self
            .report
            .error(node.head_span(), format!("unknown predicate `{name}`"));
        if is_function {
            diagnostic.advise("it is a function: compare it with a number, as in `(>= (f) 1)`");
        } else {
            diagnostic
                .advise("declare it under `:predicates`")
                .suggest(near);
        }
    }

    fn unknown_function(&mut self, name: &str, node: &Node) {
        let near = self
            .report
            .nearest(name, self.names.functions.keys().map(String::as_str));
        let is_predicate = self.names.predicates.contains_key(name);
        if self.names.object_functions.contains_key(name) {
            self.report
                .error(
                    node.head_span(),
                    format!("the values of `{name}` are objects, not numbers"),
                )
                .advise("compare it with an object, as in `(= (f) object)`");
            return;
        }
        let diagnostic = self
            .report
            .error(node.head_span(), format!("unknown function `{name}`"));
        if let Some(number) = with_point(name) {
            diagnostic.advise(format!("write {number}"));
        } else if is_predicate {
            diagnostic.advise("it is a predicate, which has no numeric value");
        } else {
            diagnostic
                .advise("declare it under `:functions`")
                .suggest(near);
        }
    }

    /// Reports an effect on, or an initial value of, a derived predicate.
    pub(super) fn refuse_derived(&mut self, predicate: PredicateId, span: Span) {
        let predicate = &self.problem.predicates[predicate.index()];
        if predicate.is_derived {
            self.report
                .error(
                    span,
                    format!(
                        "`{}` is a derived predicate and cannot be set",
                        predicate.name
                    ),
                )
                .advise("change the facts that its rules read");
        }
    }
}

fn count(arguments: usize) -> String {
    match arguments {
        0 => "no arguments".to_owned(),
        1 => "1 argument".to_owned(),
        n => format!("{n} arguments"),
    }
}

/// Returns the number with a decimal point instead of a decimal comma.
fn with_point(word: &str) -> Option<String> {
    let (whole, fraction) = word.split_once(',')?;
    let is_number =
        |digits: &str| !digits.is_empty() && digits.chars().all(|digit| digit.is_ascii_digit());
    let is_meant = is_number(whole.trim_start_matches(['-', '+'])) && is_number(fraction);
    is_meant.then(|| format!("{whole}.{fraction}"))
}
