//! `:types`

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::problem::{Type, TypeId};

use crate::lower::Reader;
use crate::lower::sections::Section;
use crate::source::Span;

/// Maximum number of paths from one type to `object`, since computing the supertypes may walk them
/// all.
const MAX_PATHS: u64 = 1000;
/// In larger hierarchies, [`Reader::can_fit`] does not search for common subtypes.
const MAX_COMPARED: usize = 1000;
/// Maximum length of a path to `object`.
const HIGHEST: u32 = 200;

impl Reader {
    /// Reads the types; without a section there is only `object`.
    pub(super) fn types(&mut self, section: Option<&Section>) {
        self.declare_type("object");
        let Some(section) = section else { return };
        let entries = self.typed_list(section.content);
        let mut declared: BTreeMap<String, Span> = BTreeMap::new();
        for entry in &entries {
            match entry.node.lower() {
                Some(name) => {
                    self.declare_type(&name);
                    declared.entry(name.into_owned()).or_insert(entry.node.span);
                }
                None => {
                    self.report
                        .error(
                            entry.node.span,
                            format!("`{}` is not a type", entry.node.quote()),
                        )
                        .advise("expected a name");
                }
            }
        }
        for entry in &entries {
            let Some(name) = entry.node.lower() else {
                continue;
            };
            for (parent, span) in entry.types.iter() {
                self.warn_of_undeclared_parent(parent, *span, &declared);
                self.declare_type(parent);
                let parent = self.names.types[parent];
                let child = self.names.types[name.as_ref()];
                let parents = &mut self.problem.types[child.index()].parents;
                // Some domains contain `object - object`.
                if child != TypeId::OBJECT && child != parent && !parents.contains(&parent) {
                    parents.push(parent);
                }
            }
        }
        for ty in self.problem.types.iter_mut().skip(1) {
            if ty.parents.is_empty() {
                ty.parents.push(TypeId::OBJECT);
            }
        }
        self.check_hierarchy(&declared, section.span);
    }

    fn declare_type(&mut self, name: &str) {
        if !self.names.types.contains_key(name) {
            let id = TypeId::from(self.problem.types.len());
            self.names.types.insert(name.to_owned(), id);
            self.problem.types.push(Type {
                name: name.to_owned(),
                parents: Vec::new(),
            });
        }
    }

    /// Warns of a supertype that is not declared. PDDL permits it, but it may be a typing error.
    fn warn_of_undeclared_parent(
        &mut self,
        name: &str,
        span: Span,
        declared: &BTreeMap<String, Span>,
    ) {
        if name == "object" || declared.contains_key(name) || self.names.types.contains_key(name) {
            return;
        }
        if let Some(near) = self
            .report
            .nearest(name, declared.keys().map(String::as_str))
        {
            self.report
                .warning(
                    span,
                    format!("`{name}` is not declared; it is added as a new type"),
                )
                .suggest(Some(near));
        }
    }

    /// Reports cycles and hierarchies with too many paths, and flattens them.
    fn check_hierarchy(&mut self, declared: &BTreeMap<String, Span>, section: Span) {
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); self.problem.types.len()];
        let mut missing: Vec<usize> = Vec::new();
        for (child, ty) in self.problem.types.iter().enumerate() {
            missing.push(ty.parents.len());
            for parent in &ty.parents {
                children[parent.index()].push(child);
            }
        }
        let mut paths: Vec<u64> = vec![0; children.len()];
        let mut height: Vec<u32> = vec![0; children.len()];
        let mut ready = vec![0];
        let mut reached = BTreeSet::new();
        paths[0] = 1;
        while let Some(ty) = ready.pop() {
            reached.insert(ty);
            for &child in &children[ty] {
                paths[child] = paths[child].saturating_add(paths[ty]);
                height[child] = height[child].max(height[ty] + 1);
                missing[child] -= 1;
                if missing[child] == 0 {
                    ready.push(child);
                }
            }
        }
        let place = |name: &str| declared.get(name).copied().unwrap_or(section);
        for index in 1..children.len() {
            let ty = &self.problem.types[index];
            if !reached.contains(&index) {
                self.report
                    .error(
                        place(&ty.name),
                        format!("`{}` is in a cycle of subtypes, or below one", ty.name),
                    )
                    .advise("remove the cycle");
            } else if paths[index] > MAX_PATHS || height[index] > HIGHEST {
                self.report
                    .error(
                        place(&ty.name),
                        format!("`{}` is too deep in the type hierarchy", ty.name),
                    )
                    .advise(format!(
                        "at most {HIGHEST} levels, and {MAX_PATHS} paths to supertypes"
                    ));
            } else {
                continue;
            }
            self.problem.types[index].parents = vec![TypeId::OBJECT];
        }
    }

    /// Returns `true` if every object of one of the types in `own` is of one of the types in
    /// `asked`.
    pub(super) fn always_fits(&self, own: &[TypeId], asked: &[TypeId]) -> bool {
        own.iter().all(|&own| {
            asked
                .iter()
                .any(|&asked| self.problem.is_subtype(own, asked))
        })
    }

    /// Returns `true` if some object can be of one of the types in `own` and of one in `asked`.
    pub(super) fn can_fit(&self, own: &[TypeId], asked: &[TypeId]) -> bool {
        if self.problem.types.len() > MAX_COMPARED {
            return true;
        }
        let all = (0..self.problem.types.len()).map(TypeId::from);
        all.into_iter().any(|ty| {
            let is_below = |of: &[TypeId]| of.iter().any(|&of| self.problem.is_subtype(ty, of));
            is_below(own) && is_below(asked)
        })
    }

    /// Returns `a` or `either a b`, for messages.
    pub(super) fn type_list(&self, types: &[TypeId]) -> String {
        let names: Vec<_> = types
            .iter()
            .map(|ty| self.problem.types[ty.index()].name.as_str())
            .collect();
        names.join(" or ")
    }
}
