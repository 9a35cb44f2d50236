//! Sections about failures of actions after their start.

use std::ops::Range;

use elbowroom_model::problem::{Body, ObjectId, PredicateId, SchemaId, TypeId};
use toml::de::DeValue;

use super::super::{Argument, FailureModel, Outcome, OutcomeChange, Success, names};
use super::{Key, Reader, Value, described};

/// The keys of this module.
pub(super) const KEYS: [&str; 4] = ["end", "during_per_second", "undone", "outcome"];

/// The keys of an outcome.
const OUTCOME: [&str; 3] = ["probability", "becomes_true", "becomes_false"];

/// Subject of a section.
#[derive(Clone, Debug)]
pub(super) enum SectionSubject {
    Defaults,
    /// An action, with or without objects.
    Action(SchemaId, Option<Vec<ObjectId>>),
}

/// A mistake, and the expected form.
type EntryError = (String, Option<String>);

impl Reader<'_> {
    /// Reads one of [`KEYS`]; `schema` is `None` in the defaults.
    pub(super) fn failing(
        &mut self,
        schema: Option<SchemaId>,
        key: &Key<'_>,
        value: &Value<'_>,
        failing: &mut FailureModel,
    ) {
        let of = schema.map(|schema| &self.problem.schemas[schema.index()]);
        if let Some(schema) = of.filter(|it| matches!(it.body, Body::Instantaneous { .. })) {
            let message = format!(
                "`{}` takes no time, so it does not fail after its start",
                schema.name
            );
            let expected = "`start`: how likely it is to be done".to_owned();
            return self.mistakes.mistake(key.span(), message, expected);
        }
        match key.get_ref().as_ref() {
            "end" => failing.end = self.probability(value),
            "during_per_second" => failing.during_per_second = self.failures_per_second(value),
            "undone" => failing.undone = self.truth(value),
            _ => failing.outcomes = self.outcomes(schema, value),
        }
    }

    fn failures_per_second(&mut self, value: &Value<'_>) -> Option<f64> {
        let read = match value.get_ref() {
            DeValue::Float(number) => number.as_str().replace('_', "").parse::<f64>().ok(),
            DeValue::Integer(number) => number.as_str().replace('_', "").parse::<f64>().ok(),
            _ => None,
        };
        let rate = read.filter(|rate| rate.is_finite() && *rate >= 0.0);
        if rate.is_none() {
            let message = "this is not a number of failures per second";
            let expected = "a rate, 0 or more: 0.01 is once in a hundred seconds on average";
            self.mistakes
                .mistake(value.span(), message, expected.to_owned());
        }
        rate
    }

    fn truth(&mut self, value: &Value<'_>) -> Option<bool> {
        if let DeValue::Boolean(truth) = value.get_ref() {
            return Some(*truth);
        }
        let message = format!("found {}", described(value.get_ref()));
        let expected = "true or false".to_owned();
        self.mistakes.mistake(value.span(), message, expected);
        None
    }

    fn outcomes(&mut self, schema: Option<SchemaId>, value: &Value<'_>) -> Option<Vec<Outcome>> {
        let DeValue::Array(entries) = value.get_ref() else {
            let message = format!("`outcome` is {}", described(value.get_ref()));
            let expected = "tables: [[actions.NAME.outcome]]".to_owned();
            self.mistakes.mistake(value.span(), message, expected);
            return None;
        };
        let mut outcomes = Vec::new();
        let mut sum = 0.0;
        for entry in entries {
            let Some(outcome) = self.outcome(schema, entry) else {
                continue;
            };
            sum += outcome.probability;
            // Decimal fractions do not add up to exactly 1 in binary.
            if sum > 1.0 + 1e-9 {
                let message = format!("with this outcome the probabilities add up to {sum}");
                let expected = "shares of the failures, at most 1 in total".to_owned();
                self.mistakes.mistake(entry.span(), message, expected);
                return None;
            }
            outcomes.push(outcome);
        }
        Some(outcomes)
    }

    fn outcome(&mut self, schema: Option<SchemaId>, entry: &Value<'_>) -> Option<Outcome> {
        let DeValue::Table(table) = entry.get_ref() else {
            let message = format!("found {}", described(entry.get_ref()));
            let expected = "a table: [[actions.NAME.outcome]]".to_owned();
            self.mistakes.mistake(entry.span(), message, expected);
            return None;
        };
        let mut entries: Vec<_> = table.iter().collect();
        // In the order of the file, so that the second of two conflicting entries is reported.
        entries.sort_by_key(|(key, _)| key.span().start);
        let mut probability = None;
        let mut changes = Vec::new();
        for (key, value) in entries {
            match key.get_ref().as_ref() {
                "probability" => probability = Some(self.probability(value)?),
                "becomes_true" => self.changes(schema, value, true, &mut changes),
                "becomes_false" => self.changes(schema, value, false, &mut changes),
                _ => self.unknown(key, &OUTCOME),
            }
        }
        let Some(probability) = probability else {
            let message = "the outcome has no `probability`".to_owned();
            let expected = "how likely it is if the action fails".to_owned();
            self.mistakes.mistake(entry.span(), message, expected);
            return None;
        };
        if changes.is_empty() && !self.mistakes.is_failed() {
            let message = "this outcome changes nothing".to_owned();
            let expected = "becomes_true or becomes_false; the rest up to 1 is the probability of \
                            a failure without effects"
                .to_owned();
            self.mistakes.mistake(entry.span(), message, expected);
            return None;
        }
        // As in world files: first the facts that become true, then those that become false.
        changes.sort_by_key(|change| !change.becomes);
        Some(Outcome {
            probability,
            changes,
        })
    }

    /// Reads a list of facts.
    fn changes(
        &mut self,
        schema: Option<SchemaId>,
        value: &Value<'_>,
        becomes: bool,
        changes: &mut Vec<OutcomeChange>,
    ) {
        let entries: &[Value<'_>] = match value.get_ref() {
            DeValue::Array(entries) => entries,
            _ => std::slice::from_ref(value),
        };
        for entry in entries {
            let Some(text) = entry.get_ref().as_str() else {
                let message = format!("found {}", described(entry.get_ref()));
                let expected = "facts: [\"(on ?box floor)\"]".to_owned();
                self.mistakes.mistake(entry.span(), message, expected);
                continue;
            };
            match self.changed_fact(schema, text) {
                Ok((predicate, arguments)) => {
                    let is_known = |known: &OutcomeChange| {
                        known.predicate == predicate && known.arguments == arguments
                    };
                    if changes.iter().any(is_known) {
                        let message = format!("one outcome changes `{text}` twice");
                        self.mistakes.mistake(entry.span(), message, None);
                        continue;
                    }
                    changes.push(OutcomeChange {
                        predicate,
                        arguments,
                        becomes,
                    });
                }
                Err((message, expected)) => {
                    self.mistakes.mistake(entry.span(), message, expected);
                }
            }
        }
    }

    /// Reads a fact with objects and parameters of the action: `(on ?box floor)`.
    fn changed_fact(
        &self,
        schema: Option<SchemaId>,
        text: &str,
    ) -> Result<(PredicateId, Vec<Argument>), EntryError> {
        let inner = text.trim();
        let inner = inner
            .strip_prefix('(')
            .and_then(|rest| rest.strip_suffix(')'))
            .unwrap_or(inner);
        let mut words = inner.split_whitespace();
        let name = words.next().unwrap_or_default();
        let predicate = names::predicate(self.problem, name)?;
        let parameters = &self.problem.predicates[predicate.index()].parameters;
        let words: Vec<&str> = words.collect();
        if words.len() != parameters.len() {
            let message = format!(
                "`{name}` takes {} arguments, not {}",
                parameters.len(),
                words.len()
            );
            return Err((message, None));
        }
        let mut arguments = Vec::new();
        for (word, parameter) in words.into_iter().zip(parameters) {
            if word.starts_with('?') {
                let place = self.parameter(schema, word, &parameter.types)?;
                arguments.push(Argument::Parameter(place));
            } else {
                let one = std::slice::from_ref(parameter);
                let words = std::iter::once(word);
                let objects = names::arguments(self.problem, name, one, words)?;
                arguments.extend(objects.into_iter().map(Argument::Object));
            }
        }
        Ok((predicate, arguments))
    }

    /// Returns the position of a parameter of an action, if some object fits both it and `types`.
    fn parameter(
        &self,
        schema: Option<SchemaId>,
        word: &str,
        types: &[TypeId],
    ) -> Result<usize, EntryError> {
        let Some(schema) = schema else {
            let message = format!("`{word}` is not a parameter of any action named here");
            return Err((message, Some("[[actions.NAME.outcome]]".to_owned())));
        };
        let schema = &self.problem.schemas[schema.index()];
        let mut parameters = schema.parameters.iter();
        let place = parameters.position(|parameter| parameter.name.eq_ignore_ascii_case(word));
        let Some(place) = place else {
            let names = schema.parameters.iter();
            let names: Vec<&str> = names.map(|it| it.name.as_str()).collect();
            let expected = match names.as_slice() {
                [] => "it has none".to_owned(),
                names => format!("it has {}", names.join(", ")),
            };
            let message = format!("`{}` has no parameter `{word}`", schema.name);
            return Err((message, Some(expected)));
        };
        let own = &schema.parameters[place].types;
        let mut objects = self.problem.objects_of(own);
        // Without any objects, the action cannot be started, so any parameter is allowed.
        let is_empty = self.problem.objects_of(own).next().is_none();
        if is_empty || objects.any(|object| self.problem.has_type(object, types)) {
            Ok(place)
        } else {
            let message = format!(
                "no object that `{word}` can be bound to has the type required \
                                   here"
            );
            Err((message, None))
        }
    }

    /// Records a section with effects of failures.
    pub(super) fn note_failure_effects(
        &mut self,
        key: &Key<'_>,
        failing: &FailureModel,
        about: SectionSubject,
    ) {
        if failing.has_failure_effects() {
            self.failure_sections.push((key.span(), about));
        }
    }

    /// Checks that each section with effects of failures also has a failure probability.
    pub(super) fn check_failure_effects(&mut self) {
        let leftovers = std::mem::take(&mut self.failure_sections);
        for (span, about) in leftovers {
            self.check_failure_effect(span, &about);
        }
    }

    fn check_failure_effect(&mut self, span: Range<usize>, about: &SectionSubject) {
        let likelihoods = &self.likelihoods;
        let fails = |success: &Success| success.failing.has_failures();
        let can_fail = match about {
            SectionSubject::Defaults => {
                let mut all = likelihoods
                    .schemas
                    .values()
                    .chain(likelihoods.actions.values());
                all.any(fails)
            }
            SectionSubject::Action(schema, arguments) => {
                let mut own = likelihoods.actions.iter().filter(|((other, objects), _)| {
                    other == schema && arguments.as_ref().is_none_or(|own| own == objects)
                });
                likelihoods.schemas.get(schema).is_some_and(fails)
                    || own.any(|(_, success)| fails(success))
            }
        };
        if !can_fail && !likelihoods.defaults.failing.has_failures() {
            let message = "effects of failures without a probability that the action fails after \
                           its start";
            let expected = "`end`: how likely its end is to succeed".to_owned();
            self.mistakes.mistake(span, message, expected);
        }
    }
}
