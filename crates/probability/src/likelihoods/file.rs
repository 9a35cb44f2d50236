//! Elbowroom's likelihood files, in TOML: [`read()`]. `docs/reference/formats/likelihoods.md` defines the
//! format.

mod complete;
mod failure_entries;

use std::ops::Range;

use elbowroom_model::Task;
use elbowroom_model::problem::{ObjectId, PredicateId, Problem, SchemaId};
use elbowroom_text::{Diagnostics, Report, Source, nearest};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{FailureModel, Likelihoods, PartialChange, Success, names};

/// Value of `format` in these files.
pub(super) const FORMAT: &str = "elbowroom-likelihoods";
/// The value of `version`.
pub(super) const VERSION: &str = "1";

/// Reads a likelihood file in Elbowroom's format.
///
/// # Errors
/// All mistakes found: syntax errors, unknown names, invalid numbers, and missing entries.
pub(super) fn read(source: impl Into<Source>, task: &Task) -> Result<Likelihoods, Diagnostics> {
    let source = source.into();
    let text = source.text();
    let (document, errors) = DeTable::parse_recoverable(text);
    let mut reader = Reader {
        problem: task.problem(),
        likelihoods: Likelihoods::default(),
        mistakes: Report::new(&source),
        failure_sections: Vec::new(),
    };
    for error in &errors {
        let span = error.span().unwrap_or(0..0);
        reader.mistakes.mistake(span, error.message(), None);
    }
    if errors.is_empty() {
        reader.document(document.get_ref());
    }
    let read = reader.mistakes.finish(Some(reader.likelihoods));
    read.map(|(likelihoods, _warnings)| likelihoods)
}

type Key<'a> = Spanned<std::borrow::Cow<'a, str>>;
type Value<'a> = Spanned<DeValue<'a>>;

/// A mistake that has been recorded.
struct AlreadyReported;

struct Reader<'a> {
    problem: &'a Problem,
    likelihoods: Likelihoods,
    mistakes: Report,
    /// Sections with effects of failures.
    failure_sections: Vec<(Range<usize>, failure_entries::SectionSubject)>,
}

impl Reader<'_> {
    fn report_objection(&mut self, span: Range<usize>, (message, expected): names::NameError) {
        self.mistakes.mistake(span, message, expected);
    }

    fn document(&mut self, document: &DeTable<'_>) {
        const SECTIONS: [&str; 6] = [
            "format", "version", "defaults", "facts", "actions", "beliefs",
        ];
        self.header(document);
        for (key, value) in document {
            match key.get_ref().as_ref() {
                "format" | "version" => {}
                "defaults" => self.defaults(key, value),
                "facts" => self.for_each_entry(key, value, &mut Self::fact),
                "actions" => self.for_each_entry(key, value, &mut Self::action),
                "beliefs" => self.for_each_entry(key, value, &mut Self::belief),
                _ => self.unknown(key, &SECTIONS),
            }
        }
        if !self.mistakes.is_failed() {
            self.check_complete(document);
            self.check_failure_effects();
        }
    }

    fn header(&mut self, document: &DeTable<'_>) {
        match document.get("format") {
            Some(value) if value.get_ref().as_str() == Some(FORMAT) => {}
            Some(value) => self.mistakes.mistake(
                value.span(),
                "this is not a likelihood file",
                format!("format = \"{FORMAT}\""),
            ),
            None => self.mistakes.mistake(
                0..0,
                "the file does not state its format",
                format!("format = \"{FORMAT}\""),
            ),
        }
        match document.get("version") {
            Some(value) => match value.get_ref() {
                DeValue::Integer(number) if number.as_str() == VERSION => {}
                _ => self.mistakes.mistake(
                    value.span(),
                    "unsupported version",
                    format!("version = {VERSION}"),
                ),
            },
            None => self.mistakes.mistake(
                0..0,
                "the version of the format is missing",
                format!("version = {VERSION}"),
            ),
        }
    }

    fn unknown(&mut self, key: &Key<'_>, known: &[&str]) {
        let name = key.get_ref().as_ref();
        let expected = match nearest(name, known.iter().copied()) {
            Some(name) => format!("did you mean `{name}`?"),
            None => format!("one of {}", known.join(", ")),
        };
        let message = format!("unknown entry `{name}`");
        self.mistakes.mistake(key.span(), message, expected);
    }

    /// Calls `entry` for each entry of a table.
    fn for_each_entry(
        &mut self,
        key: &Key<'_>,
        value: &Value<'_>,
        entry: &mut impl FnMut(&mut Self, &Key<'_>, &Value<'_>),
    ) {
        match value.get_ref() {
            DeValue::Table(table) => {
                // In the order of the file, so that the second of two conflicting entries is
                // reported.
                let mut entries: Vec<_> = table.iter().collect();
                entries.sort_by_key(|(key, _)| key.span().start);
                for (key, value) in entries {
                    entry(self, key, value);
                }
            }
            other => {
                let message = format!("`{}` is {}", key.get_ref(), described(other));
                let expected = format!("a table: [{}]", key.get_ref());
                self.mistakes.mistake(value.span(), message, expected);
            }
        }
    }

    fn defaults(&mut self, section: &Key<'_>, value: &Value<'_>) {
        let mut failing = FailureModel::default();
        self.for_each_entry(section, value, &mut |reader, key, value| {
            let name = key.get_ref().as_ref();
            let known = [
                "becomes_true",
                "becomes_false",
                "becomes_true_per_second",
                "becomes_false_per_second",
                "start",
                "effect",
                "end",
                "during_per_second",
                "undone",
                "outcome",
            ];
            if !known.contains(&name) {
                return reader.unknown(key, &known);
            }
            if failure_entries::KEYS.contains(&name) {
                return reader.failing(None, key, value, &mut failing);
            }
            if name.ends_with("_per_second") {
                let rate = reader.rate(value);
                let defaults = &mut reader.likelihoods.defaults;
                match name {
                    "becomes_true_per_second" => defaults.becomes_true_per_second = rate,
                    _ => defaults.becomes_false_per_second = rate,
                }
                return;
            }
            let probability = reader.probability(value);
            let defaults = &mut reader.likelihoods.defaults;
            match name {
                "becomes_true" => defaults.becomes_true = probability,
                "becomes_false" => defaults.becomes_false = probability,
                "start" => defaults.start = probability,
                _ => defaults.effect = probability,
            }
        });
        self.note_failure_effects(section, &failing, failure_entries::SectionSubject::Defaults);
        self.likelihoods.defaults.failing = failing;
    }

    fn fact(&mut self, key: &Key<'_>, value: &Value<'_>) {
        let Some((predicate, arguments)) = self.fact_named(key) else {
            return;
        };
        let mut flip = PartialChange::default();
        self.for_each_entry(
            key,
            value,
            &mut |reader, key, value| match key.get_ref().as_ref() {
                "becomes_true" => flip.becomes_true = reader.probability(value),
                "becomes_false" => flip.becomes_false = reader.probability(value),
                "becomes_true_per_second" => flip.becomes_true_per_second = reader.rate(value),
                "becomes_false_per_second" => flip.becomes_false_per_second = reader.rate(value),
                _ => reader.unknown(
                    key,
                    &[
                        "becomes_true",
                        "becomes_false",
                        "becomes_true_per_second",
                        "becomes_false_per_second",
                    ],
                ),
            },
        );
        let is_new = match arguments {
            Some(arguments) => {
                let key = (predicate, arguments);
                self.likelihoods.facts.insert(key, flip).is_none()
            }
            None => self
                .likelihoods
                .predicates
                .insert(predicate, flip)
                .is_none(),
        };
        self.check_new(is_new, key);
    }

    fn action(&mut self, key: &Key<'_>, value: &Value<'_>) {
        let mut words = key.get_ref().split_whitespace();
        let name = words.next().unwrap_or_default();
        let schema = match names::schema(self.problem, name) {
            Ok(schema) => schema,
            Err(objection) => return self.report_objection(key.span(), objection),
        };
        let parameters = &self.problem.schemas[schema.index()].parameters;
        let Ok(arguments) = self.arguments(key, name, parameters, words) else {
            return;
        };
        let mut success = Success::default();
        self.for_each_entry(
            key,
            value,
            &mut |reader, key, value| match key.get_ref().as_ref() {
                "start" => success.start = reader.probability(value),
                "effects" => reader.for_each_entry(key, value, &mut |reader, key, value| {
                    reader.effect(schema, key, value, &mut success);
                }),
                name if failure_entries::KEYS.contains(&name) => {
                    reader.failing(Some(schema), key, value, &mut success.failing);
                }
                _ => {
                    let known = [&["start", "effects"][..], &failure_entries::KEYS].concat();
                    reader.unknown(key, &known);
                }
            },
        );
        let about = failure_entries::SectionSubject::Action(schema, arguments.clone());
        self.note_failure_effects(key, &success.failing, about);
        let is_new = match arguments {
            Some(arguments) => {
                let key = (schema, arguments);
                self.likelihoods.actions.insert(key, success).is_none()
            }
            None => self.likelihoods.schemas.insert(schema, success).is_none(),
        };
        self.check_new(is_new, key);
    }

    fn effect(
        &mut self,
        schema: SchemaId,
        key: &Key<'_>,
        value: &Value<'_>,
        success: &mut Success,
    ) {
        let words: Vec<&str> = key.get_ref().split_whitespace().collect();
        let (name, is_deletion) = match words.as_slice() {
            [name] => (*name, false),
            [not, name] if not.eq_ignore_ascii_case("not") => (*name, true),
            _ => {
                let message = format!("`{}` is not an effect", key.get_ref());
                let expected = "a predicate, or `not` and a predicate".to_owned();
                return self.mistakes.mistake(key.span(), message, expected);
            }
        };
        let predicate = match names::predicate(self.problem, name) {
            Ok(predicate) => predicate,
            Err(objection) => return self.report_objection(key.span(), objection),
        };
        let (adds, deletes) = names::effects_on(self.problem, schema, predicate);
        if !deletes && (is_deletion || !adds) {
            let objection = names::no_such_effect(self.problem, schema, key.get_ref());
            return self.report_objection(key.span(), objection);
        }
        if let Some(probability) = self.probability(value) {
            let stated = if is_deletion {
                &mut success.deletions
            } else {
                &mut success.effects
            };
            let is_new = stated.insert(predicate, probability).is_none();
            self.check_new(is_new, key);
        }
    }

    fn belief(&mut self, key: &Key<'_>, value: &Value<'_>) {
        let Some((predicate, arguments)) = self.fact_named(key) else {
            return;
        };
        let Some(arguments) = arguments else {
            let message = format!("`{}` is a predicate, not a fact", key.get_ref());
            let expected = "a predicate with its objects".to_owned();
            return self.mistakes.mistake(key.span(), message, expected);
        };
        if let Some(probability) = self.probability(value) {
            let key_of = (predicate, arguments);
            let beliefs = &mut self.likelihoods.beliefs;
            let is_new = beliefs.insert(key_of, probability).is_none();
            self.check_new(is_new, key);
        }
    }

    /// Returns the predicate that a key names, with its arguments; `None` for arguments if the key
    /// means all facts.
    fn fact_named(&mut self, key: &Key<'_>) -> Option<(PredicateId, Option<Vec<ObjectId>>)> {
        let mut words = key.get_ref().split_whitespace();
        let name = words.next().unwrap_or_default();
        match names::predicate(self.problem, name) {
            Ok(predicate) => {
                let parameters = &self.problem.predicates[predicate.index()].parameters;
                let arguments = self.arguments(key, name, parameters, words).ok()?;
                Some((predicate, arguments))
            }
            Err(objection) => {
                self.report_objection(key.span(), objection);
                None
            }
        }
    }

    /// Returns the objects in a key; `None` if there are none where there could be some.
    fn arguments<'k>(
        &mut self,
        key: &Key<'_>,
        of: &str,
        parameters: &[elbowroom_model::problem::Variable],
        words: impl Iterator<Item = &'k str>,
    ) -> Result<Option<Vec<ObjectId>>, AlreadyReported> {
        let mut words = words.peekable();
        if words.peek().is_none() && !parameters.is_empty() {
            return Ok(None);
        }
        match names::arguments(self.problem, of, parameters, words) {
            Ok(objects) => Ok(Some(objects)),
            Err(objection) => {
                self.report_objection(key.span(), objection);
                Err(AlreadyReported)
            }
        }
    }

    /// Reports a repeated key. TOML rejects equal keys, but names here ignore case and spaces.
    fn check_new(&mut self, is_new: bool, key: &Key<'_>) {
        if !is_new {
            let message = format!("`{}` is there twice", key.get_ref());
            self.mistakes.mistake(key.span(), message, None);
        }
    }

    fn probability(&mut self, value: &Value<'_>) -> Option<f64> {
        let read = match value.get_ref() {
            DeValue::Float(number) => names::probability(number.as_str()),
            DeValue::Integer(number) => names::probability(number.as_str()),
            other => Err((
                format!("found {}", described(other)),
                Some("a probability, from 0 to 1".to_owned()),
            )),
        };
        read.map_err(|objection| self.report_objection(value.span(), objection))
            .ok()
    }

    /// Reads a number of changes per second.
    fn rate(&mut self, value: &Value<'_>) -> Option<f64> {
        let read = match value.get_ref() {
            DeValue::Float(number) => number.as_str().replace('_', "").parse::<f64>().ok(),
            DeValue::Integer(number) => number.as_str().replace('_', "").parse::<f64>().ok(),
            _ => None,
        };
        let rate = read.filter(|rate| rate.is_finite() && *rate >= 0.0);
        if rate.is_none() {
            let message = "this is not a number of changes per second".to_owned();
            let expected = "a rate, 0 or more: 0.1 is once in ten seconds on average";
            self.mistakes
                .mistake(value.span(), message, expected.to_owned());
        }
        rate
    }
}

fn described(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "a truth value",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}
