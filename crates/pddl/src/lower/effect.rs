//! Effects, instantaneous and durative.

use elbowroom_model::problem::{Change, ContinuousEffect, Effect, Guard, UpdateOperator, Variable};

use crate::lower::Reader;
use crate::lower::condition::without_preferences;
use crate::lower::continuous::mentions_time;
use crate::lower::scope::Scope;
use crate::lower::shift::renumber_variables;
use crate::lower::timed::{Time, Timed, conjunction, near_specifier, time_specifier};
use crate::source::Span;
use crate::syntax::Node;

/// Upper limit on the text copied, over all effects, because it encloses more than one of them.
const MAX_COPIED: usize = 20_000_000;

/// The time at which an effect takes place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Moment {
    /// In an instantaneous action.
    Instant,
    Start,
    End,
    /// In a durative action, outside of `at start` and `at end`.
    Unspecified,
    /// In a process.
    Process,
}

/// The effects of an action.
#[derive(Debug, Default)]
pub(super) struct Effects {
    /// Of an instantaneous action.
    pub(super) instant: Vec<Effect>,
    pub(super) start: Vec<Effect>,
    pub(super) end: Vec<Effect>,
    pub(super) continuous: Vec<ContinuousEffect>,
}

/// The quantifiers and conditions that enclose an effect.
#[derive(Debug, Default)]
pub(super) struct EffectContext {
    pub(super) variables: Vec<Variable>,
    pub(super) conditions: Vec<When>,
}

#[derive(Debug)]
pub(super) struct When {
    /// Parts without a time specifier belong to the time of the enclosing `at`.
    condition: Timed,
    /// The number of variables that were in scope.
    scope: usize,
    span: Span,
}

impl Reader {
    /// Reads an effect and its nested effects into `effects`.
    pub(super) fn effect(
        &mut self,
        node: &Node,
        moment: Moment,
        scope: &mut Scope,
        around: &mut EffectContext,
        effects: &mut Effects,
    ) {
        if node.is_empty_list() {
            return;
        }
        let Some((head, parts)) = node.form() else {
            self.report
                .error(node.span, format!("unexpected `{}`", node.quote()))
                .advise("expected an effect such as `(predicate argument …)` or `(and …)`");
            return;
        };
        if let Some((time, inner)) = time_specifier(node) {
            match (moment, time) {
                (Moment::Unspecified, Time::Start) => {
                    self.effect(inner, Moment::Start, scope, around, effects);
                }
                (Moment::Unspecified, Time::End) => {
                    self.effect(inner, Moment::End, scope, around, effects);
                }
                _ => {
                    let advice = match moment {
                        Moment::Process => "time specifier in an effect of a process",
                        Moment::Instant => "only effects of durative actions have time specifiers",
                        _ => "effects of durative actions happen `at start` or `at end`",
                    };
                    self.report
                        .error(
                            node.span,
                            format!("`{}` does not belong here", node.quote()),
                        )
                        .advise(advice);
                }
            }
            return;
        }
        match (head.as_ref(), parts) {
            ("and", _) => {
                for part in parts {
                    self.effect(part, moment, scope, around, effects);
                }
            }
            ("forall", [variables, part]) => {
                let variables = self.variable_list(variables);
                let (outside, outer) = (scope.variables.len(), around.variables.len());
                scope.variables.extend(variables.iter().cloned());
                around.variables.extend(variables);
                self.effect(part, moment, scope, around, effects);
                around.variables.truncate(outer);
                scope.variables.truncate(outside);
            }
            ("when", _) if moment == Moment::Process => {
                self.report
                    .error(node.span, "a conditional effect of a process")
                    .advise("write a separate process with the condition as its precondition");
            }
            ("when", [condition, part]) => {
                let when = self.when(condition, moment, scope);
                around.conditions.push(when);
                self.effect(part, moment, scope, around, effects);
                around.conditions.pop();
            }
            ("forall" | "when", _) => self.wrong_parts(&head, node),
            _ => self.primitive_effect(&head, node, parts, moment, scope, around, effects),
        }
    }

    fn when(&mut self, node: &Node, moment: Moment, scope: &mut Scope) -> When {
        let condition = without_preferences(scope, |scope| match moment {
            Moment::Unspecified | Moment::Process => self.timed_condition(node, scope),
            Moment::Instant | Moment::Start => Timed {
                start: self.condition(node, scope),
                ..Timed::default()
            },
            Moment::End => Timed {
                end: self.condition(node, scope),
                ..Timed::default()
            },
        });
        When {
            condition,
            scope: scope.variables.len(),
            span: node.span,
        }
    }

    #[allow(
        clippy::too_many_arguments,
        reason = "the state of one walk over a tree; a struct of these would only rename them"
    )]
    fn primitive_effect(
        &mut self,
        head: &str,
        node: &Node,
        parts: &[Node],
        moment: Moment,
        scope: &Scope,
        around: &EffectContext,
        effects: &mut Effects,
    ) {
        if matches!(head, "change" | "assign")
            && parts.first().is_some_and(|part| self.is_application(part))
        {
            self.object_assignment(head, node, parts, moment, (scope, around), effects);
            return;
        }
        let operator = operator(head);
        if moment == Moment::Process {
            match operator {
                Some(operator) if operator.is_additive() && parts.iter().any(mentions_time) => {
                    self.continuous_effect(operator, node, parts, scope, around, effects);
                }
                _ => {
                    self.report
                        .error(
                            node.span,
                            format!("`{}` is not a continuous change", node.quote()),
                        )
                        .advise("effects of a process are `(increase (f) (* #t rate))`");
                }
            }
            return;
        }
        if moment == Moment::Unspecified {
            match operator {
                Some(operator) if operator.is_additive() => {
                    self.continuous_effect(operator, node, parts, scope, around, effects);
                }
                _ => self.missing_moment(node),
            }
            return;
        }
        let change = match operator {
            Some(operator) => self.update(operator, node, parts, scope),
            None => self.literal(head, node, parts, scope),
        };
        let guard = self.guard(around, moment, scope, node);
        if let (Some(change), Some(guard)) = (change, guard) {
            let list = match moment {
                Moment::Start => &mut effects.start,
                Moment::End => &mut effects.end,
                Moment::Instant | Moment::Unspecified | Moment::Process => &mut effects.instant,
            };
            list.push(Effect {
                variables: around.variables.clone(),
                guard,
                change,
            });
        }
    }

    /// Reads `(p …)` or `(not (p …))`.
    fn literal(
        &mut self,
        head: &str,
        node: &Node,
        parts: &[Node],
        scope: &Scope,
    ) -> Option<Change> {
        let (atom, change): (_, fn(_) -> _) = match (head, parts) {
            ("not", [atom]) => (atom, Change::Delete),
            ("not", _) => {
                self.wrong_parts(head, node);
                return None;
            }
            ("=" | "<" | "<=" | ">" | ">=" | "or" | "imply" | "exists", _) => {
                self.report
                    .error(node.span, format!("`{head}` is not an effect"))
                    .advise("numbers are changed by `(assign (f) value)`, `(increase (f) value)`");
                return None;
            }
            _ => (node, Change::Add),
        };
        let span = atom.span;
        let atom = self.atom(atom, scope)?;
        self.refuse_derived(atom.predicate, span);
        Some(change(atom))
    }

    /// Reads `(increase (f …) value)`.
    fn update(
        &mut self,
        operator: UpdateOperator,
        node: &Node,
        parts: &[Node],
        scope: &Scope,
    ) -> Option<Change> {
        let [fluent, value] = parts else {
            self.wrong_update(operator, node);
            return None;
        };
        let fluent = self.fluent(fluent, scope)?;
        Some(Change::Update {
            operator,
            fluent,
            value: self.expression(value, scope),
        })
    }

    fn continuous_effect(
        &mut self,
        operator: UpdateOperator,
        node: &Node,
        parts: &[Node],
        scope: &Scope,
        around: &EffectContext,
        effects: &mut Effects,
    ) {
        let [fluent, value] = parts else {
            self.wrong_update(operator, node);
            return;
        };
        let fluent = self.fluent(fluent, scope);
        let rate = self.rate(value, operator, node, scope);
        let guard = self.guard(around, Moment::Unspecified, scope, node);
        if let (Some(fluent), Some(rate), Some(guard)) = (fluent, rate, guard) {
            effects.continuous.push(ContinuousEffect {
                variables: around.variables.clone(),
                guard,
                fluent,
                rate,
            });
        }
    }

    /// Returns the conditions of the enclosing `when`s at the moment of the effect. Returns `None`,
    /// with a report, if the effect would depend on the future.
    pub(super) fn guard(
        &mut self,
        around: &EffectContext,
        moment: Moment,
        scope: &Scope,
        node: &Node,
    ) -> Option<Guard> {
        let size: usize = around
            .conditions
            .iter()
            .map(|w| w.span.end - w.span.start)
            .sum();
        self.copied += size + 50 * around.variables.len();
        if self.copied > MAX_COPIED {
            self.copied = 0;
            self.report
                .error(
                    node.span,
                    "too many effects under one condition or quantifier",
                )
                .advise("this domain is too large to be read");
            return None;
        }
        let mut guard = Guard::default();
        for when in &around.conditions {
            let by = scope.variables.len() - when.scope;
            let condition = when
                .condition
                .clone()
                .map(|part| renumber_variables(part, when.scope, by));
            let Timed {
                start,
                over_all,
                end,
            } = condition;
            let looks_ahead = match moment {
                Moment::Instant | Moment::Start => !over_all.is_trivial() || !end.is_trivial(),
                Moment::Unspecified | Moment::Process => !end.is_trivial(),
                Moment::End => false,
            };
            if looks_ahead {
                self.report
                    .error(when.span, "the condition is read after its effect happens")
                    .advise("only effects `at end` may depend on conditions `at end`");
                let label = self.report.label(node.span, "this is the effect");
                self.report.attach(label);
                return None;
            }
            match moment {
                Moment::Instant | Moment::Start => guard.now = conjunction(guard.now, start),
                Moment::End | Moment::Unspecified | Moment::Process => {
                    guard.at_start = conjunction(guard.at_start, start);
                    guard.over_all = conjunction(guard.over_all, over_all);
                    guard.now = conjunction(guard.now, end);
                }
            }
        }
        Some(guard)
    }

    pub(super) fn wrong_update(&mut self, operator: UpdateOperator, node: &Node) {
        let name = operator.name();
        self.report
            .error(node.span, format!("`{name}` takes a fluent and a value"))
            .advise(format!("expected `({name} (function argument …) value)`"));
    }

    pub(super) fn missing_moment(&mut self, node: &Node) {
        let near = near_specifier(node);
        self.report
            .error(
                node.span,
                format!("`{}` has no time specifier", node.quote()),
            )
            .advise(
                "expected `(at start …)` or `(at end …)`, or for continuous change \
                 `(increase (f) (* #t rate))`",
            )
            .suggest(near);
    }
}

fn operator(head: &str) -> Option<UpdateOperator> {
    Some(match head {
        "assign" => UpdateOperator::Assign,
        "increase" => UpdateOperator::Increase,
        "decrease" => UpdateOperator::Decrease,
        "scale-up" => UpdateOperator::ScaleUp,
        "scale-down" => UpdateOperator::ScaleDown,
        _ => return None,
    })
}
