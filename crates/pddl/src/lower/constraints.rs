//! `:constraints`, and preferences in all their contexts (PDDL 3).

use elbowroom_model::problem::{
    ActionPreference, Condition, Constraint, Modal, PreferenceId, SchemaId, Variable,
};
use elbowroom_num::Rational;

use crate::lower::Reader;
use crate::lower::condition::without_preferences;
use crate::lower::scope::Scope;
use crate::lower::sections::Section;
use crate::lower::timed::Timed;
use crate::syntax::Node;
use elbowroom_text::nearest;

/// Syntax of the trajectory constraints.
const MODALS: &[(&str, &str)] = &[
    ("always", "(always condition)"),
    ("sometime", "(sometime condition)"),
    ("within", "(within time condition)"),
    ("at-most-once", "(at-most-once condition)"),
    ("sometime-after", "(sometime-after condition condition)"),
    ("sometime-before", "(sometime-before condition condition)"),
    ("always-within", "(always-within time condition condition)"),
    ("hold-during", "(hold-during time time condition)"),
    ("hold-after", "(hold-after time condition)"),
];

/// Name of preferences without a name.
const ANONYMOUS: &str = "anonymous";

/// Returns the place where forms of that name belong if they are not conditions on a state.
pub(super) fn proper_place(name: &str) -> Option<&'static str> {
    if name == "preference" {
        return Some("preferences are allowed in conditions, in goals and under `:constraints`");
    }
    let is_modal = MODALS.iter().any(|(modal, _)| *modal == name);
    is_modal.then_some(
        "trajectory constraints are allowed only under `:constraints`, and not \
                        inside each other",
    )
}

/// A preference found in a condition.
#[derive(Debug)]
pub(super) struct FoundPreference {
    preference: PreferenceId,
    /// Variables of the enclosing quantifiers.
    variables: Vec<Variable>,
    /// A condition without time specifiers is stored as that of the start.
    condition: Timed,
}

impl Reader {
    /// Reads a section of constraints.
    pub(super) fn constraints(&mut self, section: &Section) {
        let mut scope = Scope::default();
        for node in section.content {
            let constraint = self.constraint(node, &mut scope);
            self.add_constraint(constraint, section.span);
        }
    }

    pub(super) fn add_constraint(
        &mut self,
        constraint: Option<Constraint>,
        span: crate::source::Span,
    ) {
        match constraint {
            None => {}
            Some(Constraint::And(parts)) => {
                for part in parts {
                    self.add_constraint(Some(part), span);
                }
            }
            Some(constraint) => {
                self.problem.constraints.push(constraint);
                self.constraint_spans.push(span);
            }
        }
    }

    fn constraint(&mut self, node: &Node, scope: &mut Scope) -> Option<Constraint> {
        if node.is_empty_list() {
            return None;
        }
        let Some((head, parts)) = node.form() else {
            self.wrong_constraint(node);
            return None;
        };
        Some(match (head.as_ref(), parts) {
            ("and", _) => Constraint::And(
                parts
                    .iter()
                    .filter_map(|part| self.constraint(part, scope))
                    .collect(),
            ),
            ("forall", [variables, part]) => {
                let variables = self.variable_list(variables);
                let outside = scope.variables.len();
                scope.variables.extend(variables.iter().cloned());
                let part = self.constraint(part, scope);
                scope.variables.truncate(outside);
                Constraint::Forall(variables, Box::new(part?))
            }
            ("preference", _) => {
                let (preference, part) = self.preference_parts(node, scope)?;
                let part = without_preferences(scope, |scope| self.constraint(part, scope));
                Constraint::Preference(preference, Box::new(part?))
            }
            ("forall", _) => {
                self.wrong_parts(&head, node);
                return None;
            }
            _ => Constraint::Modal(self.modal(node, &head, parts, scope)?),
        })
    }

    fn modal(
        &mut self,
        node: &Node,
        head: &str,
        parts: &[Node],
        scope: &mut Scope,
    ) -> Option<Modal<Condition>> {
        let is_predicate = self.names.predicates.contains_key(head);
        Some(match (head, parts) {
            ("at", [when, c]) if when.is("end") && c.list().is_some() => {
                Modal::AtEnd(self.hard_condition(c, scope))
            }
            ("always", [c]) => Modal::Always(self.hard_condition(c, scope)),
            ("sometime", [c]) => Modal::Sometime(self.hard_condition(c, scope)),
            ("within", [time, c]) => {
                Modal::Within(self.moment(time), self.hard_condition(c, scope))
            }
            ("at-most-once", [c]) => Modal::AtMostOnce(self.hard_condition(c, scope)),
            ("sometime-after", [c, d]) => {
                let c = self.hard_condition(c, scope);
                Modal::SometimeAfter(c, self.hard_condition(d, scope))
            }
            ("sometime-before", [c, d]) => {
                let c = self.hard_condition(c, scope);
                Modal::SometimeBefore(c, self.hard_condition(d, scope))
            }
            ("always-within", [time, c, d]) => {
                let time = self.moment(time);
                let c = self.hard_condition(c, scope);
                Modal::AlwaysWithin(time, c, self.hard_condition(d, scope))
            }
            ("hold-during", [from, until, c]) => {
                let (begin, end) = (self.moment(from), self.moment(until));
                if end <= begin {
                    self.report
                        .error(until.span, "this time must be later than the first one")
                        .advise("`hold-during` applies from the first time until the second");
                }
                Modal::HoldDuring(begin, end, self.hard_condition(c, scope))
            }
            ("hold-after", [time, c]) => {
                Modal::HoldAfter(self.moment(time), self.hard_condition(c, scope))
            }
            _ => {
                let form = MODALS.iter().find(|(name, _)| *name == head);
                match form {
                    Some((_, form)) => {
                        self.report
                            .error(node.span, format!("`{head}` has the wrong parts"))
                            .advise(format!("expected `{form}`"));
                    }
                    None if is_predicate
                        || matches!(head, "not" | "or" | "imply" | "exists" | "=") =>
                    {
                        self.wrong_constraint(node);
                    }
                    None => {
                        let near = nearest(head, MODALS.iter().map(|(name, _)| *name));
                        self.wrong_constraint(node);
                        if let Some(near) = near {
                            let label = self
                                .report
                                .label(node.head_span(), format!("perhaps `{near}`"));
                            self.report.attach(label);
                        }
                    }
                }
                return None;
            }
        })
    }

    fn wrong_constraint(&mut self, node: &Node) {
        self.report
            .error(
                node.span,
                format!("`{}` is not a trajectory constraint", node.quote()),
            )
            .advise(
                "expected `(always …)`, `(sometime …)`, `(within time …)`, `(at end …)` or the \
                 like; they cannot be nested, except in `and`, `forall` and `preference`",
            );
    }

    /// Reads a condition that must not contain preferences.
    fn hard_condition(&mut self, node: &Node, scope: &mut Scope) -> Condition {
        without_preferences(scope, |scope| self.condition(node, scope))
    }

    /// Reads a time, relative to the beginning of the plan or to another moment.
    fn moment(&mut self, node: &Node) -> Rational {
        let time = self.constant(node);
        if time.is_negative() {
            self.report.error(node.span, "a time below 0");
        }
        time
    }

    /// Returns the name and the content of `(preference name content)`.
    fn preference_parts<'t, 's>(
        &mut self,
        node: &'t Node<'s>,
        scope: &Scope,
    ) -> Option<(PreferenceId, &'t Node<'s>)> {
        if scope.without_preferences > 0 {
            self.report
                .error(node.span, "a preference is not allowed here")
                .advise("preferences are allowed under `and` and `forall` only");
            return None;
        }
        let (name, part) = match node.form()?.1 {
            [part] => (ANONYMOUS.to_owned(), part),
            [name, part] if name.word().is_some() => (name.lower()?.into_owned(), part),
            _ => {
                self.report
                    .error(node.span, "invalid preference")
                    .advise("expected `(preference name condition)`");
                return None;
            }
        };
        Some((self.preference_id(name), part))
    }

    fn preference_id(&mut self, name: String) -> PreferenceId {
        let names = &mut self.problem.preferences;
        let position = names.iter().position(|own| *own == name);
        PreferenceId::from(position.unwrap_or_else(|| {
            names.push(name);
            names.len() - 1
        }))
    }

    /// Reads a preference in a condition; `read` reads its content.
    pub(super) fn preference(
        &mut self,
        node: &Node,
        scope: &mut Scope,
        read: impl FnOnce(&mut Self, &Node, &mut Scope) -> Timed,
    ) {
        let Some((preference, part)) = self.preference_parts(node, scope) else {
            return;
        };
        let condition = without_preferences(scope, |scope| read(self, part, scope));
        let variables = scope.variables[scope.parameters..].to_vec();
        scope.soft.push(FoundPreference {
            preference,
            variables,
            condition,
        });
    }

    /// Adds the preferences found in an action's conditions.
    pub(super) fn action_preferences(&mut self, found: Vec<FoundPreference>, schema: SchemaId) {
        for soft in found {
            self.problem.action_preferences.push(ActionPreference {
                schema,
                preference: soft.preference,
                variables: soft.variables,
                at_start: soft.condition.start,
                over_all: soft.condition.over_all,
                at_end: soft.condition.end,
            });
        }
    }

    /// Adds the preferences found in the goal, as constraints on the end of the plan.
    pub(super) fn goal_preferences(
        &mut self,
        found: Vec<FoundPreference>,
        span: crate::source::Span,
    ) {
        for soft in found {
            let at_end = Constraint::Modal(Modal::AtEnd(soft.condition.start));
            let mut constraint = Constraint::Preference(soft.preference, Box::new(at_end));
            if !soft.variables.is_empty() {
                constraint = Constraint::Forall(soft.variables, Box::new(constraint));
            }
            self.add_constraint(Some(constraint), span);
        }
    }

    /// Reads `(is-violated name)` in the metric.
    pub(super) fn violations(&mut self, node: &Node, parts: &[Node]) -> Option<PreferenceId> {
        let [name] = parts else {
            self.report
                .error(node.span, "`is-violated` takes the name of a preference")
                .advise("expected `(is-violated name)`");
            return None;
        };
        let name = name.lower()?;
        let names = &self.problem.preferences;
        if let Some(position) = names.iter().position(|own| *own == name) {
            return Some(PreferenceId::from(position));
        }
        let near = nearest(&name, names.iter().map(String::as_str)).map(str::to_owned);
        self.report
            .error(node.span, format!("unknown preference `{name}`"))
            .advise("declare it as `(preference name condition)`")
            .suggest(near.as_deref());
        None
    }
}
