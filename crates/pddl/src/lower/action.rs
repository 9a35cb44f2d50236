//! `:action` and `:durative-action`

use std::collections::BTreeMap;

use elbowroom_model::problem::{Body, Condition, Schema, SchemaId};

use crate::lower::Reader;
use crate::lower::effect::{EffectContext, Effects, Moment};
use crate::lower::scope::Scope;
use crate::lower::sections::Section;
use crate::lower::timed::Timed;
use crate::source::Span;
use crate::syntax::Node;
use elbowroom_text::nearest;

/// The keywords of an action.
const INSTANTANEOUS: &[&str] = &[
    ":parameters",
    ":synth-parameters",
    ":control",
    ":precondition",
    ":effect",
];
/// The keywords of a durative action.
const DURATIVE: &[&str] = &[
    ":parameters",
    ":synth-parameters",
    ":control",
    ":duration",
    ":condition",
    ":effect",
];

/// The keywords of an action, each with its position and the node that follows it.
pub(super) type Fields<'t, 's> = BTreeMap<&'static str, (Span, Option<&'t Node<'s>>)>;

impl Reader {
    /// Reads an action.
    pub(super) fn action(&mut self, section: &Section) {
        let is_durative = section.keyword == ":durative-action";
        let Some((name, rest)) = section
            .content
            .split_first()
            .and_then(|(name, rest)| Some((name.lower()?, rest)))
        else {
            self.report
                .error(section.span, "an action without a name")
                .advise(format!("expected `({} name …)`", section.keyword));
            return;
        };
        let allowed = if is_durative { DURATIVE } else { INSTANTANEOUS };
        let fields = self.fields(&format!("action `{name}`"), rest, allowed);
        let mut scope = self.action_scope(&fields);
        scope.has_duration = is_durative;
        scope.parameters = scope.variables.len();
        let body = if is_durative {
            self.durative_body(&fields, section, &mut scope)
        } else {
            self.instantaneous_body(&fields, &mut scope)
        };
        let id = SchemaId::from(self.problem.schemas.len());
        let span = section.content[0].span;
        if self.names.schemas.insert(name.to_string(), id).is_some() {
            self.report
                .error(span, format!("an action `{name}` is declared already"))
                .advise("give each action a unique name");
        }
        self.schema_spans.push(span);
        if !scope.controls.is_empty() {
            self.problem
                .controls
                .insert(id, std::mem::take(&mut scope.controls));
        }
        self.action_preferences(std::mem::take(&mut scope.soft), id);
        self.problem.schemas.push(Schema {
            name: name.into_owned(),
            parameters: scope.variables,
            unknowns: scope.unknowns,
            body,
        });
    }

    /// Pairs each keyword with the node that follows it.
    pub(super) fn fields<'t, 's>(
        &mut self,
        whose: &str,
        nodes: &'t [Node<'s>],
        allowed: &[&'static str],
    ) -> Fields<'t, 's> {
        let mut fields = Fields::new();
        let mut nodes = nodes.iter().peekable();
        while let Some(node) = nodes.next() {
            let Some(word) = node.lower().filter(|word| word.starts_with(':')) else {
                self.report
                    .error(
                        node.span,
                        format!("unexpected `{}` in {whose}", node.quote()),
                    )
                    .advise(format!("expected one of {}", allowed.join(", ")));
                continue;
            };
            let is_keyword = |node: &Node| node.word().is_some_and(|word| word.starts_with(':'));
            let value = nodes.next_if(|next| !is_keyword(next));
            let Some(&keyword) = allowed.iter().find(|keyword| **keyword == word) else {
                let near = match word.as_ref() {
                    // `:condition` and `:precondition` are often confused.
                    ":precondition" => Some(":condition"),
                    ":condition" => Some(":precondition"),
                    _ => nearest(&word, allowed.iter().copied()),
                };
                self.report
                    .error(node.span, format!("unknown keyword `{word}` in {whose}"))
                    .advise(format!("expected one of {}", allowed.join(", ")))
                    .suggest(near);
                continue;
            };
            if value.is_none() {
                self.report
                    .warning(node.span, format!("expected a value after `{keyword}`"));
            }
            if fields.insert(keyword, (node.span, value)).is_some() {
                self.report
                    .error(node.span, format!("a second `{keyword}` in {whose}"))
                    .advise("join them by `and`");
            }
        }
        fields
    }

    fn action_scope(&mut self, fields: &Fields) -> Scope {
        let mut scope = Scope::default();
        if let Some((_, Some(node))) = fields.get(":parameters") {
            scope.variables = self.variable_list(node);
        }
        if let Some((_, Some(node))) = fields.get(":synth-parameters") {
            scope.unknowns = self.unknowns(node.list().unwrap_or(std::slice::from_ref(node)));
        }
        if let Some((_, Some(node))) = fields.get(":control") {
            let first = scope.unknowns.len();
            for name in self.unknowns(node.list().unwrap_or(std::slice::from_ref(node))) {
                if scope.unknowns.contains(&name) {
                    self.report
                        .error(node.span, format!("`{name}` is declared twice"));
                }
                scope.unknowns.push(name);
            }
            for name in &scope.unknowns[first..] {
                if scope.variable(name).is_some() {
                    self.report
                        .error(node.span, format!("`{name}` is a parameter already"))
                        .advise("give each number that the plan chooses a unique name");
                }
            }
            let all = (0_u32..).take(scope.unknowns.len());
            scope.controls = all.skip(first).collect();
        }
        scope
    }

    fn instantaneous_body(&mut self, fields: &Fields, scope: &mut Scope) -> Body {
        let condition = match fields.get(":precondition") {
            Some((_, Some(node))) => self.condition(node, scope),
            _ => Condition::TRUE,
        };
        let effects = self.effects(fields, Moment::Instant, scope);
        Body::Instantaneous {
            condition,
            effects: effects.instant,
        }
    }

    fn durative_body(&mut self, fields: &Fields, section: &Section, scope: &mut Scope) -> Body {
        let mut duration = Vec::new();
        match fields.get(":duration") {
            Some((_, Some(node))) => self.duration(node, false, scope, &mut duration),
            Some(_) => {}
            None => {
                self.report
                    .warning(section.span, "a durative action without `:duration`")
                    .advise("any duration is allowed; write `:duration ()` if that is intended");
            }
        }
        let condition = match fields.get(":condition") {
            Some((_, Some(node))) => self.timed_condition(node, scope),
            _ => Timed::default(),
        };
        let effects = self.effects(fields, Moment::Unspecified, scope);
        Body::Durative {
            duration,
            at_start: condition.start,
            over_all: condition.over_all,
            at_end: condition.end,
            start_effects: effects.start,
            end_effects: effects.end,
            continuous: effects.continuous,
        }
    }

    pub(super) fn effects(
        &mut self,
        fields: &Fields,
        moment: Moment,
        scope: &mut Scope,
    ) -> Effects {
        let mut effects = Effects::default();
        if let Some((_, Some(node))) = fields.get(":effect") {
            self.effect(
                node,
                moment,
                scope,
                &mut EffectContext::default(),
                &mut effects,
            );
        }
        effects
    }
}
