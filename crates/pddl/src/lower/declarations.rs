//! Constants, objects, predicates, functions, unknowns.

use elbowroom_model::problem::{
    Function, FunctionId, Object, ObjectId, Predicate, PredicateId, TypeId, Variable,
};

use crate::lower::Reader;
use crate::lower::sections::Section;
use crate::lower::typed_list::{MAX_VARIABLES, Typed};
use crate::source::Span;
use crate::syntax::Node;

impl Reader {
    /// Reads `:constants` or `:objects`.
    pub(super) fn objects(&mut self, section: &Section) {
        for entry in self.typed_list(section.content) {
            let Some(name) = entry.node.word() else {
                self.report
                    .error(entry.node.span, "expected the name of an object");
                continue;
            };
            if name.starts_with('?') {
                self.report
                    .error(entry.node.span, format!("`{name}` is a variable"))
                    .advise("names of objects have no question mark");
            }
            let types = self.resolve_types(&entry.types);
            let key = name.to_ascii_lowercase();
            if let Some(&id) = self.names.objects.get(&key) {
                self.redeclare(id, types, name, entry.node.span);
            } else {
                let id = ObjectId::from(self.problem.objects.len());
                self.names.objects.insert(key, id);
                self.problem.objects.push(Object {
                    name: name.to_owned(),
                    types,
                });
            }
        }
    }

    /// Warns of an object that is declared again, and adds the new types.
    fn redeclare(&mut self, id: ObjectId, types: Vec<TypeId>, name: &str, span: Span) {
        self.report
            .warning(span, format!("`{name}` is declared already"));
        let own = &mut self.problem.objects[id.index()].types;
        own.extend(types);
        own.sort_unstable();
        own.dedup();
    }

    /// Reads `:predicates`.
    pub(super) fn predicates(&mut self, section: &Section) {
        for node in section.content {
            let Some((name, parameters)) = self.declared_head(node) else {
                continue;
            };
            if name == "=" {
                continue;
            }
            let parameters = self.variables(parameters);
            let same = self.names.predicates.entry(name.clone()).or_default();
            let again = same.iter().find(|id| {
                self.problem.predicates[id.index()].parameters.len() == parameters.len()
            });
            if let Some(&again) = again {
                self.report
                    .warning(node.span, format!("`{name}` is declared already"))
                    .advise("its arguments may have the types of either declaration");
                let own = &mut self.problem.predicates[again.index()].parameters;
                for (own, more) in own.iter_mut().zip(parameters) {
                    own.types.extend(more.types);
                    own.types.sort_unstable();
                    own.types.dedup();
                }
            } else {
                same.push(PredicateId::from(self.problem.predicates.len()));
                self.problem.predicates.push(Predicate {
                    name,
                    parameters,
                    is_derived: false,
                });
            }
        }
    }

    /// Reads `:functions`.
    pub(super) fn functions(&mut self, section: &Section) {
        for entry in self.typed_list(section.content) {
            let Some((name, parameters)) = self.declared_head(entry.node) else {
                continue;
            };
            let is_object = entry.types.iter().any(|(ty, _)| ty != "number");
            let parameters = self.variables(parameters);
            if is_object {
                self.object_function(name, parameters, &entry);
                continue;
            }
            let same = self.names.functions.entry(name.clone()).or_default();
            let again = same
                .iter()
                .any(|id| self.problem.functions[id.index()].parameters.len() == parameters.len());
            if again {
                self.report
                    .warning(entry.node.span, format!("`{name}` is declared already"));
            } else {
                same.push(FunctionId::from(self.problem.functions.len()));
                self.problem.functions.push(Function { name, parameters });
            }
        }
    }

    /// Adds a function whose values are objects, as a predicate with the value as its last
    /// argument.
    fn object_function(&mut self, name: String, mut parameters: Vec<Variable>, entry: &Typed) {
        if let Some((_, span)) = entry.types.iter().find(|(ty, _)| ty == "number") {
            self.report
                .error(
                    *span,
                    format!("the values of `{name}` are numbers or objects"),
                )
                .advise("declare one function for each");
        }
        let types = self.resolve_types(&entry.types);
        let same = self.names.object_functions.entry(name.clone()).or_default();
        let count = parameters.len() + 1;
        let known = |id: &PredicateId| self.problem.predicates[id.index()].parameters.len();
        if same.iter().any(|id| known(id) == count) {
            self.report
                .warning(entry.node.span, format!("`{name}` is declared already"));
            return;
        }
        parameters.push(Variable {
            name: format!("?{name}"),
            types,
        });
        let id = PredicateId::from(self.problem.predicates.len());
        same.push(id);
        self.problem.object_functions.push(id);
        self.problem.predicates.push(Predicate {
            name,
            parameters,
            is_derived: false,
        });
    }

    /// Reads `(name parameter …)` of a predicate or function.
    fn declared_head<'t, 's>(&mut self, node: &'t Node<'s>) -> Option<(String, &'t [Node<'s>])> {
        if let Some((name, parameters)) = node.form()
            && !name.starts_with(['?', ':'])
        {
            return Some((name.into_owned(), parameters));
        }
        self.report
            .error(node.span, format!("unexpected `{}`", node.quote()))
            .advise("expected `(name ?parameter - type …)`");
        None
    }

    /// Reads `:synth-parameters` of the domain or of an action, optionally with `- number`.
    pub(super) fn unknowns(&mut self, nodes: &[Node]) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for entry in self.typed_list(nodes) {
            if names.len() == MAX_VARIABLES {
                self.report.error(
                    entry.node.span,
                    format!("more than {MAX_VARIABLES} unknowns in one list"),
                );
                break;
            }
            let name = entry.node.lower().filter(|name| name.starts_with('?'));
            match name {
                Some(name) if names.iter().any(|own| *own == name) => {
                    self.report
                        .error(entry.node.span, format!("`{name}` is declared twice"));
                }
                Some(name) => names.push(name.into_owned()),
                None => {
                    self.report
                        .error(
                            entry.node.span,
                            format!("`{}` cannot be an unknown", entry.node.quote()),
                        )
                        .advise("expected `?name`");
                }
            }
            if let Some((ty, span)) = entry.types.iter().find(|(ty, _)| ty != "number") {
                self.report
                    .error(*span, format!("an unknown of type `{ty}`"))
                    .advise("`:synth-parameters` are numbers");
            }
        }
        names
    }
}
