//! Failures of actions, and their outcomes.

use elbowroom_model::pattern::ActionPattern;
use elbowroom_model::problem::{Schema, TypeId, Variable};
use elbowroom_num::Rational;
use toml::Spanned;

use super::section::{OutcomeSection, Section};
use super::{Read, Reader};
use crate::model::outcome::TemplateArgument;
use crate::model::{FactOutcome, FailureRule, FailureTime, Outcome, OutcomeChange, Template};
use crate::pattern::{NameKind, read_pattern};

/// Operation of a number on a fluent.
#[derive(Clone, Copy)]
enum FluentOperation {
    Assign,
    Increase,
    Decrease,
}

impl Reader<'_> {
    pub(super) fn failing(&self, section: &Spanned<Section>) -> Read<FailureRule> {
        let given = section.get_ref();
        let own = ["action", "probability", "when", "undone", "outcome"];
        if let Some((span, message)) = given.first_superfluous_key("[[failure]]", &own, false) {
            return Err(self.error_at(&span, message));
        }
        let probability = given.probability.as_ref();
        let probability = probability
            .ok_or_else(|| self.error_at(&section.span(), "`probability` is missing"))?;
        let when = match &given.when {
            None => FailureTime::AtEnd,
            Some(when) => match when.get_ref().as_str() {
                "start" => FailureTime::AtStart,
                "midway" => FailureTime::Midway,
                "end" => FailureTime::AtEnd,
                _ => {
                    return Err(
                        self.error_at(&when.span(), "write \"start\", \"midway\" or \"end\"")
                    );
                }
            },
        };
        if let (FailureTime::AtStart, Some(undone)) = (when, &given.undone) {
            let message =
                "an action that does not start has no effects to undo; leave out `undone`";
            return Err(self.error_at(&undone.span(), message));
        }
        let action = self.action(section)?;
        let mut outcomes = Vec::new();
        let mut sum = 0.0;
        for outcome in given.outcome.iter().flat_map(Spanned::get_ref) {
            let found = self.outcome(outcome, &action)?;
            sum += found.probability;
            // Decimal fractions do not add up to exactly 1 in binary.
            if sum > 1.0 + 1e-9 {
                let message = format!(
                    "with this outcome the probabilities add up to {sum}; as shares of the \
                     failures they must not exceed 1"
                );
                let at = outcome.get_ref().probability.as_ref();
                return Err(
                    self.error_at(&at.map_or_else(|| outcome.span(), Spanned::span), message)
                );
            }
            outcomes.push(found);
        }
        Ok(FailureRule {
            probability: self.probability(probability)?,
            when,
            is_undone: given.undone.as_ref().is_some_and(|it| *it.get_ref()),
            outcomes,
            action,
        })
    }

    fn outcome(&self, section: &Spanned<OutcomeSection>, action: &ActionPattern) -> Read<Outcome> {
        let given = section.get_ref();
        let probability = given.probability.as_ref().ok_or_else(|| {
            let message = "`probability` is missing: the share of the failures that have this \
                           outcome";
            self.error_at(&section.span(), message)
        })?;
        let mut changes: Vec<OutcomeChange> = Vec::new();
        let mut add = |text: &Spanned<String>, what: Template, becomes| {
            if changes.iter().any(|change| change.target == what) {
                let message = format!("one outcome changes `{}` twice", text.get_ref());
                return Err(self.error_at(&text.span(), message));
            }
            changes.push(OutcomeChange {
                target: what,
                change: becomes,
            });
            Ok(())
        };
        for (facts, truth) in [(&given.becomes_true, true), (&given.becomes_false, false)] {
            for fact in facts {
                let what = self.template(fact, NameKind::Predicates, action)?;
                add(fact, what, FactOutcome::Truth(truth))?;
            }
        }
        for (numbers, how) in [
            (&given.assign, FluentOperation::Assign),
            (&given.increase, FluentOperation::Increase),
            (&given.decrease, FluentOperation::Decrease),
        ] {
            for (fluent, value) in numbers {
                let what = self.template(fluent, NameKind::Functions, action)?;
                let number = value.get_ref().exact();
                let number = number
                    .ok_or_else(|| self.error_at(&value.span(), "the number must be finite"))?;
                let becomes = match how {
                    FluentOperation::Assign => FactOutcome::Value(number),
                    FluentOperation::Increase => FactOutcome::ChangedBy(number),
                    FluentOperation::Decrease => FactOutcome::ChangedBy(-number),
                };
                add(fluent, what, becomes)?;
            }
        }
        let delay = match &given.delay {
            None => Rational::ZERO,
            Some(delay) => {
                let seconds = delay.get_ref().exact();
                let seconds = seconds.filter(|seconds| !seconds.is_negative());
                let message = "a delay is a number of seconds, and never negative";
                seconds.ok_or_else(|| self.error_at(&delay.span(), message))?
            }
        };
        if changes.is_empty() && !delay.is_positive() {
            let message = "this outcome changes nothing; expected becomes_true, becomes_false, \
                           assign, increase, decrease or delay. Failures without any change need \
                           no outcome: they are the remaining share";
            return Err(self.error_at(&section.span(), message));
        }
        Ok(Outcome {
            probability: self.probability(probability)?,
            changes,
            delay,
            is_reported: given.reported.as_ref().is_none_or(|it| *it.get_ref()),
        })
    }

    /// Reads a fact or a fluent with objects and parameters of the action: `(at ?box table)`.
    fn template(
        &self,
        text: &Spanned<String>,
        names: NameKind,
        action: &ActionPattern,
    ) -> Read<Template> {
        let wrong = |message: String| Err(self.error_at(&text.span(), message));
        let inner = text.get_ref().trim();
        let inner = match inner.strip_prefix('(') {
            Some(rest) => rest.strip_suffix(')').unwrap_or(rest),
            None => inner,
        };
        let mut words = inner.split_whitespace().map(str::to_ascii_lowercase);
        let name = words.next().unwrap_or_default();
        if name.is_empty() || name == "*" {
            return wrong("name one fact or fluent, with its objects".to_owned());
        }
        let words: Vec<String> = words.collect();
        // Checks that the predicate or function exists, with that number of arguments.
        let blanks = vec!["_"; words.len()].join(" ");
        let pattern = format!("({name} {blanks})");
        read_pattern(&pattern, names, self.problem)
            .map_err(|problem| self.error_at(&text.span(), problem))?;
        let parameters = self.parameters(&name, names);
        let schema = self.schema_of(action);
        let mut objects = Vec::new();
        for (word, parameter) in words.iter().zip(parameters) {
            objects.push(if word.starts_with('?') {
                let Some(schema) = schema else {
                    return wrong(format!(
                        "`{word}` is a parameter, but no action is named; give `action` a name"
                    ));
                };
                match self.argument(word, schema, &parameter.types) {
                    Ok(place) => TemplateArgument::Argument(place),
                    Err(message) => return wrong(message),
                }
            } else {
                let object = self.problem.object(word);
                match object {
                    None if word == "_" => {
                        return wrong(
                            "write an object, or a parameter of the action such as `?x`".to_owned(),
                        );
                    }
                    None => return wrong(format!("unknown object `{word}`")),
                    Some(object) if !self.problem.has_type(object, &parameter.types) => {
                        return wrong(format!(
                            "the type of `{name}` does not match that of `{word}`"
                        ));
                    }
                    Some(_) => TemplateArgument::Object(word.clone()),
                }
            });
        }
        let mut rules = self.problem.rules.iter();
        if names == NameKind::Predicates
            && rules.any(|rule| Some(rule.predicate) == self.problem.predicate(&name))
        {
            return wrong(format!(
                "`{name}` is derived from other facts; change those"
            ));
        }
        Ok(Template { name, objects })
    }

    fn parameters(&self, name: &str, names: NameKind) -> &[Variable] {
        let found = match names {
            NameKind::Predicates => self
                .problem
                .predicate(name)
                .map(|predicate| &self.problem.predicates[predicate.index()].parameters),
            NameKind::Functions => self
                .problem
                .function(name)
                .map(|function| &self.problem.functions[function.index()].parameters),
            NameKind::Actions => None,
        };
        found.map_or(&[], Vec::as_slice)
    }

    fn schema_of(&self, action: &ActionPattern) -> Option<&Schema> {
        let name = action.name()?;
        let mut schemas = self.problem.schemas.iter();
        schemas.find(|schema| schema.name.eq_ignore_ascii_case(name))
    }

    /// Returns the index of a parameter of an action, if some object fits both the parameter and
    /// `types`.
    fn argument(&self, word: &str, schema: &Schema, types: &[TypeId]) -> Result<usize, String> {
        let mut parameters = schema.parameters.iter();
        let place = parameters.position(|parameter| parameter.name.eq_ignore_ascii_case(word));
        let Some(place) = place else {
            let names = schema
                .parameters
                .iter()
                .map(|parameter| parameter.name.as_str());
            let names: Vec<&str> = names.collect();
            return Err(format!(
                "`{}` has no parameter `{word}`; it has {}",
                schema.name,
                if names.is_empty() {
                    "none".to_owned()
                } else {
                    names.join(", ")
                }
            ));
        };
        let mut objects = self.problem.objects_of(&schema.parameters[place].types);
        // Without any objects, no action is started.
        let fits = objects.any(|object| self.problem.has_type(object, types));
        if fits
            || self
                .problem
                .objects_of(&schema.parameters[place].types)
                .next()
                .is_none()
        {
            Ok(place)
        } else {
            Err(format!(
                "no object of the type of `{word}` has the type required here"
            ))
        }
    }
}
