//! `a b - type c - (either d e) f`

use std::rc::Rc;

use elbowroom_model::problem::{TypeId, Variable};

use crate::lower::Reader;
use crate::source::Span;
use crate::syntax::Node;

/// Maximum length of an `either`; the list is stored for each name that it types.
const LONGEST_EITHER: usize = 100;

/// Names of types in lower case, with their positions; empty if there are none. Shared by all
/// entries typed together.
pub(super) type TypeNames = Rc<[(String, Span)]>;

/// Maximum number of variables in one list, since their lookup takes linear time.
pub(super) const MAX_VARIABLES: usize = 1000;

/// An entry of a typed list.
#[derive(Debug)]
pub(super) struct Typed<'t, 's> {
    /// The typed node: a name, or a function's head.
    pub(super) node: &'t Node<'s>,
    pub(super) types: TypeNames,
}

impl Reader {
    /// Reads a typed list.
    pub(super) fn typed_list<'t, 's>(&mut self, nodes: &'t [Node<'s>]) -> Vec<Typed<'t, 's>> {
        let untyped: TypeNames = Rc::new([]);
        let mut entries: Vec<Typed> = Vec::new();
        let mut first_untyped = 0;
        let mut nodes = nodes.iter();
        while let Some(node) = nodes.next() {
            let types = if node.is("-") {
                if let Some(types) = nodes.next() {
                    self.type_names(types)
                } else {
                    self.report.error(node.span, "expected a type after `-`");
                    Rc::clone(&untyped)
                }
            } else if let Some(name) = node.word().and_then(type_after_dash) {
                // `?x -type` without a space.
                Rc::new([(name.to_ascii_lowercase(), node.span)])
            } else {
                entries.push(Typed {
                    node,
                    types: Rc::clone(&untyped),
                });
                continue;
            };
            if first_untyped == entries.len() {
                self.report
                    .error(node.span, "`-` and a type without a name before it");
            }
            for entry in &mut entries[first_untyped..] {
                entry.types = Rc::clone(&types);
            }
            first_untyped = entries.len();
        }
        entries
    }

    /// Reads `type` or `(either type …)`.
    fn type_names(&mut self, node: &Node) -> TypeNames {
        if let Some(name) = node.lower() {
            return Rc::new([(name.into_owned(), node.span)]);
        }
        match node.form() {
            Some((head, names))
                if head == "either"
                    && (1..=LONGEST_EITHER).contains(&names.len())
                    && names.iter().all(|name| name.word().is_some()) =>
            {
                names
                    .iter()
                    .filter_map(|name| Some((name.lower()?.into_owned(), name.span)))
                    .collect()
            }
            _ => {
                self.report
                    .error(node.span, format!("`{}` is not a type", node.quote()))
                    .advise(format!(
                        "expected a name, or `(either a b)` with at most {LONGEST_EITHER} names"
                    ));
                Rc::new([])
            }
        }
    }

    /// Returns the ids of the types, or `object` if there are none. Reports undeclared ones.
    pub(super) fn resolve_types(&mut self, types: &TypeNames) -> Vec<TypeId> {
        // Entries typed together also share one report.
        match &self.resolved_types {
            Some((last, ids)) if Rc::ptr_eq(last, types) => return ids.clone(),
            _ => {}
        }
        let mut ids = Vec::with_capacity(types.len().max(1));
        for (name, span) in types.iter() {
            if let Some(&id) = self.names.types.get(name) {
                ids.push(id);
                continue;
            }
            let near = self
                .report
                .nearest(name, self.names.types.keys().map(String::as_str));
            self.report
                .error(*span, format!("unknown type `{name}`"))
                .advise("declare it under `:types`")
                .suggest(near);
        }
        if ids.is_empty() {
            ids.push(TypeId::OBJECT);
        }
        self.resolved_types = Some((Rc::clone(types), ids.clone()));
        ids
    }

    /// Reads a list of variables: parameters, or the variables of a quantifier.
    pub(super) fn variables(&mut self, nodes: &[Node]) -> Vec<Variable> {
        let mut variables: Vec<Variable> = Vec::new();
        for entry in self.typed_list(nodes) {
            if variables.len() == MAX_VARIABLES {
                self.report.error(
                    entry.node.span,
                    format!("more than {MAX_VARIABLES} variables in one list"),
                );
                break;
            }
            let Some(name) = entry.node.lower().filter(|name| name.starts_with('?')) else {
                self.report
                    .error(
                        entry.node.span,
                        format!("`{}` is not a variable", entry.node.quote()),
                    )
                    .advise("expected `?name` or `?name - type`");
                continue;
            };
            if name == "?duration" {
                self.report
                    .error(entry.node.span, "`?duration` cannot be a parameter")
                    .advise("it is reserved for the action's duration");
            }
            if variables.iter().any(|v| v.name == *name) {
                self.report
                    .error(entry.node.span, format!("`{name}` is declared twice"));
            }
            let types = self.resolve_types(&entry.types);
            variables.push(Variable {
                name: name.into_owned(),
                types,
            });
        }
        variables
    }

    /// Reads the variables of `node`, which should be a list of variables.
    pub(super) fn variable_list(&mut self, node: &Node) -> Vec<Variable> {
        if let Some(nodes) = node.list() {
            return self.variables(nodes);
        }
        self.report
            .error(node.span, "expected a list of variables")
            .advise("write `(?x - type)`, or `()` for none");
        Vec::new()
    }
}

fn type_after_dash(word: &str) -> Option<&str> {
    word.strip_prefix('-')
        .filter(|name| name.starts_with(|c: char| c.is_alphabetic()))
}
