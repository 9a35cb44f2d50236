//! `:process`, `:event` and `:constraint` (PDDL+)

use elbowroom_model::problem::{Condition, Constraint, Event, Modal, Process};

use crate::lower::Reader;
use crate::lower::condition::without_preferences;
use crate::lower::effect::Moment;
use crate::lower::scope::Scope;
use crate::lower::sections::Section;
use crate::source::Span;
use crate::syntax::Node;

/// The keywords of a process or an event.
const KEYWORDS: &[&str] = &[":parameters", ":precondition", ":effect"];
/// The keywords of a global constraint.
const OF_CONSTRAINT: &[&str] = &[":parameters", ":condition"];

impl Reader {
    /// Reads a process or an event.
    pub(super) fn autonomous(&mut self, section: &Section) {
        let is_process = section.keyword == ":process";
        let kind = if is_process { "a process" } else { "an event" };
        let Some((name, rest)) = self.named(section, kind) else {
            return;
        };
        let span = section.content[0].span;
        let fields = self.fields(
            &format!("{} `{name}`", &section.keyword[1..]),
            rest,
            KEYWORDS,
        );
        let mut scope = Scope::default();
        if let Some((_, Some(node))) = fields.get(":parameters") {
            scope.variables = self.variable_list(node);
        }
        let condition = match fields.get(":precondition") {
            Some((_, Some(node))) => {
                without_preferences(&mut scope, |scope| self.condition(node, scope))
            }
            _ => Condition::TRUE,
        };
        let moment = if is_process {
            Moment::Process
        } else {
            Moment::Instant
        };
        let effects = self.effects(&fields, moment, &mut scope);
        let parameters = scope.variables;
        let declared = if is_process {
            self.problem.processes.push(Process {
                name: name.clone(),
                parameters,
                condition,
                effects: effects.continuous,
            });
            &mut self.process_spans
        } else {
            self.problem.events.push(Event {
                name: name.clone(),
                parameters,
                condition,
                effects: effects.instant,
            });
            &mut self.event_spans
        };
        declared.push(span);
        self.report_duplicate(&name, kind, span);
    }

    /// Reports a second process, or a second event, of the same name. Names must be unique because
    /// the validator's messages use them.
    fn report_duplicate(&mut self, name: &str, kind: &str, span: Span) {
        let count = if kind == "a process" {
            let names = self.problem.processes.iter().map(|process| &process.name);
            names.filter(|other| *other == name).count()
        } else {
            let names = self.problem.events.iter().map(|event| &event.name);
            names.filter(|other| *other == name).count()
        };
        if count > 1 {
            self.report
                .error(span, format!("{kind} `{name}` is declared already"))
                .advise("give each a unique name");
        }
    }

    /// Reads a global constraint: a condition on every state.
    pub(super) fn global_constraint(&mut self, section: &Section) {
        let Some((name, rest)) = self.named(section, "a constraint") else {
            return;
        };
        let fields = self.fields(&format!("constraint `{name}`"), rest, OF_CONSTRAINT);
        let mut scope = Scope::default();
        if let Some((_, Some(node))) = fields.get(":parameters") {
            scope.variables = self.variable_list(node);
        }
        let variables = scope.variables.clone();
        let Some((_, Some(node))) = fields.get(":condition") else {
            self.report
                .error(
                    section.content[0].span,
                    format!("a constraint `{name}` without a condition"),
                )
                .advise("expected `:condition` and a condition on each state");
            return;
        };
        let condition = without_preferences(&mut scope, |scope| self.condition(node, scope));
        let mut constraint = Constraint::Modal(Modal::Always(condition));
        if !variables.is_empty() {
            constraint = Constraint::Forall(variables, Box::new(constraint));
        }
        self.add_constraint(Some(constraint), section.span);
    }

    /// Returns the name in lower case and the nodes after it. Returns `None`, with a report, if
    /// there is no name.
    fn named<'t, 's>(
        &mut self,
        section: &Section<'t, 's>,
        kind: &str,
    ) -> Option<(String, &'t [Node<'s>])> {
        let found = section.content.split_first().and_then(|(name, rest)| {
            let name = name.lower().filter(|name| !name.starts_with([':', '?']))?;
            Some((name.into_owned(), rest))
        });
        if found.is_none() {
            self.report
                .error(section.span, format!("{kind} without a name"))
                .advise(format!("expected `({} name …)`", section.keyword));
        }
        found
    }
}
