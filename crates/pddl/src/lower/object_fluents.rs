//! Functions whose values are objects (PDDL 3.1), as predicates with the value as last argument.
//!
//! `(= (f a) v)` is a fact, and an assignment deletes all values and adds one. In conditions, the
//! value of such a function may be used as an argument: `(p (f a))` means that some value of
//! `(f a)` has `p`.

use elbowroom_model::problem::{
    Atom, Change, Condition, Effect, ObjectId, PredicateId, Term, TimedChange, TimedInitial,
    Variable,
};
use elbowroom_num::Rational;

use crate::feature::Feature;
use crate::lower::Reader;
use crate::lower::effect::{EffectContext, Effects, Moment};
use crate::lower::scope::Scope;
use crate::source::Span;
use crate::syntax::Node;

/// The value of a function that has no value (PDDL 3.1).
pub(super) const UNDEFINED: &str = "undefined";

impl Reader {
    /// Returns `true` if the node applies an object function.
    pub(super) fn is_application(&self, node: &Node) -> bool {
        !self.names.object_functions.is_empty()
            && node.form().is_some_and(|(head, _)| {
                self.names.object_functions.contains_key(head.as_ref())
                    // A predicate of that name has one argument more or less, or is used in another
                    // place.
                    && !self.names.functions.contains_key(head.as_ref())
            })
    }

    /// Returns the predicate of an application, and its arguments without the value.
    fn application(&mut self, node: &Node, scope: &Scope) -> Option<(PredicateId, Vec<Term>)> {
        let (name, arguments) = node.form()?;
        let overloads = self.names.object_functions.get(name.as_ref())?;
        let predicate = self.overload(overloads, arguments.len());
        let parameters = &self.problem.predicates[predicate.index()].parameters;
        let parameters = parameters[..parameters.len() - 1].to_vec();
        let arguments = self.arguments(&name, node, arguments, &parameters, scope)?;
        Some((predicate, arguments))
    }

    /// Returns the function of that name with the given number of arguments, or the first one if
    /// none matches.
    fn overload(&self, overloads: &[PredicateId], arguments: usize) -> PredicateId {
        let count = |id: PredicateId| self.problem.predicates[id.index()].parameters.len();
        let fits = |id: &&PredicateId| count(**id) == arguments + 1;
        *overloads.iter().find(fits).unwrap_or(&overloads[0])
    }

    /// Returns the variable for the value of a function.
    fn value_variable(&self, predicate: PredicateId) -> Variable {
        let parameters = &self.problem.predicates[predicate.index()].parameters;
        parameters
            .last()
            .expect("an object function has a value")
            .clone()
    }

    /// Reads the value that a function is compared with or gets.
    fn assigned_value(&mut self, fluent: &Node, value: &Node, scope: &Scope) -> Option<Term> {
        let given = self.term(value, scope)?;
        let (name, arguments) = fluent.form()?;
        let overloads = self.names.object_functions.get(name.as_ref())?;
        let predicate = self.overload(overloads, arguments.len());
        let asked = self.value_variable(predicate);
        self.check_type(given, value.span, &name, &asked, scope);
        Some(given)
    }

    /// Reads a condition whose arguments may be applications of object functions.
    pub(super) fn with_values<'n, 's: 'n>(
        &mut self,
        parts: impl IntoIterator<Item = &'n Node<'s>>,
        scope: &mut Scope,
        read: impl FnOnce(&mut Self, &mut Scope) -> Condition,
    ) -> Condition {
        if self.names.object_functions.is_empty() {
            return read(self, scope);
        }
        let outside = scope.variables.len();
        let mut all = Vec::new();
        for part in parts {
            self.name_values(part, scope, &mut all);
        }
        let condition = read(self, scope);
        let variables = scope.variables.split_off(outside);
        scope.values.retain(|_, variable| *variable < outside);
        if variables.is_empty() {
            return condition;
        }
        all.push(condition);
        Condition::Exists(variables, Box::new(Condition::And(all)))
    }

    /// Introduces a variable for each function value in a node, inner ones first, and adds the
    /// condition that defines it.
    fn name_values(&mut self, node: &Node, scope: &mut Scope, all: &mut Vec<Condition>) {
        for part in node.list().unwrap_or_default() {
            self.name_values(part, scope, all);
        }
        if !self.is_application(node) {
            return;
        }
        let Some((predicate, mut arguments)) = self.application(node, scope) else {
            return;
        };
        let position = scope.variables.len();
        scope.variables.push(self.value_variable(predicate));
        scope
            .values
            .insert((node.span.start, node.span.end), position);
        arguments.push(Term::Variable(position));
        all.push(Condition::Atom(Atom {
            predicate,
            arguments,
        }));
    }

    /// Reads `(= (f a) v)`, or `(= (f a) undefined)`.
    pub(super) fn has_value(
        &mut self,
        fluent: &Node,
        value: &Node,
        scope: &mut Scope,
    ) -> Condition {
        let arguments = fluent.form().map_or(&[][..], |(_, arguments)| arguments);
        let parts = arguments.iter().chain([value]);
        self.with_values(parts, scope, |reader, scope| {
            let Some((predicate, mut arguments)) = reader.application(fluent, scope) else {
                return Condition::TRUE;
            };
            let is_undefined = value.is(UNDEFINED);
            arguments.push(if is_undefined {
                Term::Variable(scope.variables.len())
            } else {
                match reader.assigned_value(fluent, value, scope) {
                    Some(value) => value,
                    None => return Condition::TRUE,
                }
            });
            let atom = Condition::Atom(Atom {
                predicate,
                arguments,
            });
            if is_undefined {
                let value = reader.value_variable(predicate);
                Condition::Not(Box::new(Condition::Exists(vec![value], Box::new(atom))))
            } else {
                atom
            }
        })
    }

    /// Refuses the value of a function where only names are permitted.
    pub(super) fn refuse_value(&mut self, node: &Node) {
        self.report
            .unsupported(
                Feature::ObjectFluents,
                node.span,
                format!("the value of `{}` is not allowed here", node.quote()),
            )
            .advise("add a parameter `?x` and the condition `(= (f …) ?x)`, and write `?x` here");
    }

    /// Reads `(assign (f a) v)`, or `(change (f a) v)` of TFD. Without a time specifier, the
    /// function has no value from the start of a durative action until its end.
    pub(super) fn object_assignment(
        &mut self,
        head: &str,
        node: &Node,
        parts: &[Node],
        moment: Moment,
        (scope, around): (&Scope, &EffectContext),
        effects: &mut Effects,
    ) {
        let [fluent, value] = parts else {
            self.report
                .error(node.span, format!("`{head}` takes a fluent and a value"))
                .advise(format!("expected `({head} (function argument …) object)`"));
            return;
        };
        let application = self.application(fluent, scope);
        let value = if value.is(UNDEFINED) {
            Some(None)
        } else {
            self.assigned_value(fluent, value, scope).map(Some)
        };
        let (Some((predicate, arguments)), Some(value)) = (application, value) else {
            return;
        };
        let [lost, gained] = match moment {
            Moment::Instant | Moment::Start | Moment::End => [moment, moment],
            Moment::Unspecified if head == "change" => [Moment::Start, Moment::End],
            Moment::Unspecified | Moment::Process => {
                self.missing_moment(node);
                return;
            }
        };
        self.delete_values(predicate, &arguments, node, lost, (scope, around), effects);
        let Some(value) = value else {
            return;
        };
        if let Some(guard) = self.guard(around, gained, scope, node) {
            let mut arguments = arguments;
            arguments.push(value);
            let atom = Atom {
                predicate,
                arguments,
            };
            effects.at(gained).push(Effect {
                variables: around.variables.clone(),
                guard,
                change: Change::Add(atom),
            });
        }
    }

    /// Deletes all values of a function.
    fn delete_values(
        &mut self,
        predicate: PredicateId,
        arguments: &[Term],
        node: &Node,
        moment: Moment,
        (scope, around): (&Scope, &EffectContext),
        effects: &mut Effects,
    ) {
        let value = self.value_variable(predicate);
        let mut inner = Scope {
            variables: scope.variables.clone(),
            ..Scope::default()
        };
        let mut arguments = arguments.to_vec();
        arguments.push(Term::Variable(inner.variables.len()));
        inner.variables.push(value.clone());
        let Some(guard) = self.guard(around, moment, &inner, node) else {
            return;
        };
        let mut variables = around.variables.clone();
        variables.push(value);
        let atom = Atom {
            predicate,
            arguments,
        };
        effects.at(moment).push(Effect {
            variables,
            guard,
            change: Change::Delete(atom),
        });
    }

    /// Returns the function, its arguments, and its new value; no value for `undefined`.
    fn object_value(
        &mut self,
        node: &Node,
    ) -> Option<(PredicateId, Vec<ObjectId>, Option<ObjectId>)> {
        let [fluent, value] = node.form()?.1 else {
            return None;
        };
        let scope = Scope::default();
        let (predicate, arguments) = self.application(fluent, &scope)?;
        let arguments = Self::objects_only(&arguments)?;
        if value.is(UNDEFINED) {
            return Some((predicate, arguments, None));
        }
        match self.assigned_value(fluent, value, &scope)? {
            Term::Object(value) => Some((predicate, arguments, Some(value))),
            Term::Variable(_) => None,
        }
    }

    /// Reads `(= (f a) v)` in the initial state.
    pub(super) fn initial_object(&mut self, node: &Node) {
        let Some((predicate, mut arguments, value)) = self.object_value(node) else {
            return;
        };
        let facts = &mut self.problem.initial_facts;
        let before = facts.len();
        facts.retain(|(other, own)| *other != predicate || !own.starts_with(&arguments));
        if facts.len() < before {
            self.report
                .warning(node.span, "a second initial value of this fluent")
                .advise("the last one counts");
        }
        if let Some(value) = value {
            arguments.push(value);
            self.problem.initial_facts.push((predicate, arguments));
        }
    }

    /// Reads `(at 10 (= (f a) v))`: all other values are lost at that time.
    pub(super) fn timed_object(&mut self, time: &Rational, span: Span, node: &Node) {
        if time.is_zero() {
            self.report
                .warning(span, "at time 0: read as part of the initial state");
            self.initial_object(node);
            return;
        }
        let Some((predicate, arguments, value)) = self.object_value(node) else {
            return;
        };
        let types = self.value_variable(predicate).types;
        let objects: Vec<_> = self.problem.objects_of(&types).collect();
        for object in objects {
            let mut arguments = arguments.clone();
            arguments.push(object);
            let change = if value == Some(object) {
                TimedChange::Add(predicate, arguments)
            } else {
                TimedChange::Delete(predicate, arguments)
            };
            self.refuse_contradiction(time, &change, node);
            self.problem.timed.push(TimedInitial {
                time: time.clone(),
                change,
            });
        }
    }
}

impl Effects {
    /// Returns the effects of a moment.
    fn at(&mut self, moment: Moment) -> &mut Vec<Effect> {
        match moment {
            Moment::Start => &mut self.start,
            Moment::End => &mut self.end,
            Moment::Instant | Moment::Unspecified | Moment::Process => &mut self.instant,
        }
    }
}
