//! File format of Olisipo's authors: [`read()`].
//!
//! ```text
//! file      := factLine+ "-" actionLine*
//! factLine  := predicate("#"object)* P(becomes true) P(becomes false)
//! actionLine:= action("#"object)* P(start succeeds) (predicate"%"P(effect takes place))*
//! ```
//!
//! One probability applies to all effects of an action on a predicate, at start or end, making true
//! or false, with any arguments. Facts and actions are listed in full. Where the authors' programs
//! stop at a missing fact, or treat a missing effect as one that never takes place, this reader
//! reports an error.

use std::collections::BTreeMap;
use std::ops::Range;

use elbowroom_model::Task;
use elbowroom_model::problem::{PredicateId, Problem};
use elbowroom_text::{Diagnostics, Report, Source};

use super::{Likelihoods, PartialChange, Success, is_changed, names};

/// Part of the text without white space.
#[derive(Clone, Debug)]
struct Word<'a> {
    text: &'a str,
    span: Range<usize>,
}

/// Reads a file of likelihoods in the authors' format.
///
/// # Errors
/// All mistakes found: syntax errors, unknown names, invalid numbers, and missing entries.
pub fn read(source: impl Into<Source>, task: &Task) -> Result<Likelihoods, Diagnostics> {
    let source = source.into();
    let text = source.text();
    let mut reader = Reader {
        problem: task.problem(),
        likelihoods: Likelihoods::default(),
        mistakes: Report::new(&source),
    };
    let mut separator = None;
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let words = words(line, at);
        match words.as_slice() {
            [] => {}
            [only] if only.text == "-" && separator.is_none() => {
                separator = Some(only.span.clone());
            }
            [first, rest @ ..] if separator.is_none() => reader.fact(first, rest),
            [first, rest @ ..] => reader.action(first, rest),
        }
        at += line.len();
    }
    if separator.is_none() {
        let end = text.trim_end().len();
        reader.mistakes.mistake(
            end..end,
            "the line `-` between facts and actions is missing",
            None,
        );
    }
    reader.check_facts(&separator.unwrap_or(0..0));
    let read = reader.mistakes.finish(Some(reader.likelihoods));
    read.map(|(likelihoods, _warnings)| likelihoods)
}

fn words(line: &str, at: usize) -> Vec<Word<'_>> {
    let offset = |word: &str| at + (word.as_ptr().addr() - line.as_ptr().addr());
    line.split_whitespace()
        .map(|text| Word {
            text,
            span: offset(text)..offset(text) + text.len(),
        })
        .collect()
}

struct Reader<'a> {
    problem: &'a Problem,
    likelihoods: Likelihoods,
    mistakes: Report,
}

impl Reader<'_> {
    fn report_objection(&mut self, span: &Range<usize>, (message, expected): names::NameError) {
        self.mistakes.mistake(span.clone(), message, expected);
    }

    fn fact(&mut self, name: &Word<'_>, numbers: &[Word<'_>]) {
        let [becomes_true, becomes_false] = numbers else {
            self.mistakes.mistake(
                name.span.clone(),
                format!("{} numbers after the fact `{}`", numbers.len(), name.text),
                "two: P(false becomes true) P(true becomes false)".to_owned(),
            );
            return;
        };
        let becomes_true = self.probability(becomes_true.text, &becomes_true.span);
        let becomes_false = self.probability(becomes_false.text, &becomes_false.span);
        let fact = self.fact_named(name);
        let (Some(fact), Some(_), Some(_)) = (fact, becomes_true, becomes_false) else {
            return;
        };
        let flip = PartialChange {
            becomes_true,
            becomes_false,
            ..PartialChange::default()
        };
        if self.likelihoods.facts.insert(fact, flip).is_some() {
            let message = format!("`{}` is listed twice", name.text);
            self.mistakes.mistake(name.span.clone(), message, None);
        }
    }

    fn fact_named(
        &mut self,
        name: &Word<'_>,
    ) -> Option<(PredicateId, Vec<elbowroom_model::problem::ObjectId>)> {
        let mut parts = name.text.split('#');
        let predicate_name = parts.next().unwrap_or_default();
        let found = names::predicate(self.problem, predicate_name).and_then(|id| {
            let parameters = &self.problem.predicates[id.index()].parameters;
            let objects = names::arguments(self.problem, predicate_name, parameters, parts)?;
            Ok((id, objects))
        });
        found
            .map_err(|objection| self.report_objection(&name.span, objection))
            .ok()
    }

    fn action(&mut self, name: &Word<'_>, rest: &[Word<'_>]) {
        let mut parts = name.text.split('#');
        let schema_name = parts.next().unwrap_or_default();
        let found = names::schema(self.problem, schema_name).and_then(|id| {
            let parameters = &self.problem.schemas[id.index()].parameters;
            let objects = names::arguments(self.problem, schema_name, parameters, parts)?;
            Ok((id, objects))
        });
        let (schema, objects) = match found {
            Ok(found) => found,
            Err(objection) => return self.report_objection(&name.span, objection),
        };
        let Some((start, effects)) = rest.split_first() else {
            self.mistakes.mistake(
                name.span.clone(),
                format!("no number after the action `{}`", name.text),
                "P(start succeeds)".to_owned(),
            );
            return;
        };
        let mut success = Success {
            start: self.probability(start.text, &start.span),
            ..Success::default()
        };
        for effect in effects {
            self.effect(schema, effect, &mut success.effects);
        }
        let lacking = names::affected(self.problem, schema)
            .into_iter()
            .find(|(predicate, _)| !success.effects.contains_key(predicate));
        if let Some((predicate, _)) = lacking {
            let predicate = &self.problem.predicates[predicate.index()].name;
            self.mistakes.mistake(
                name.span.clone(),
                format!(
                    "the effect of `{}` on {predicate} has no probability",
                    name.text
                ),
                format!("add `{predicate}%P`"),
            );
        }
        let key = (schema, objects);
        if self.likelihoods.actions.insert(key, success).is_some() {
            let message = format!("`{}` is listed twice", name.text);
            self.mistakes.mistake(name.span.clone(), message, None);
        }
    }

    fn effect(
        &mut self,
        schema: elbowroom_model::problem::SchemaId,
        word: &Word<'_>,
        effects: &mut BTreeMap<PredicateId, f64>,
    ) {
        let Some((name, number)) = word.text.split_once('%') else {
            self.mistakes.mistake(
                word.span.clone(),
                format!("`{}` is not an effect with its probability", word.text),
                "predicate%P".to_owned(),
            );
            return;
        };
        let split = word.span.start + name.len();
        let name_span = word.span.start..split;
        let predicate = match names::predicate(self.problem, name) {
            Ok(predicate) => predicate,
            Err(objection) => return self.report_objection(&name_span, objection),
        };
        if names::effects_on(self.problem, schema, predicate) == (false, false) {
            let objection = names::no_such_effect(self.problem, schema, name);
            return self.report_objection(&name_span, objection);
        }
        let probability = self.probability(number, &(split + 1..word.span.end));
        if let Some(probability) = probability
            && effects.insert(predicate, probability).is_some()
        {
            let message = format!("two probabilities for the effect on {name}");
            self.mistakes.mistake(name_span, message, None);
        }
    }

    fn probability(&mut self, text: &str, span: &Range<usize>) -> Option<f64> {
        names::probability(text)
            .map_err(|objection| self.report_objection(span, objection))
            .ok()
    }

    /// Checks that every fact that something can change, or whose predicate occurs, has a line.
    fn check_facts(&mut self, separator: &Range<usize>) {
        for (index, predicate) in self.problem.predicates.iter().enumerate() {
            let id = PredicateId::from(index);
            let is_mentioned = self.likelihoods.facts.keys().any(|(p, _)| *p == id);
            if predicate.is_derived || !(is_mentioned || is_changed(self.problem, id)) {
                continue;
            }
            let mut missing = Vec::new();
            names::for_each_tuple(self.problem, &predicate.parameters, &mut |tuple| {
                if self.likelihoods.spontaneous_change_of(id, tuple).is_none() {
                    missing.push(self.problem.apply_name(&predicate.name, tuple));
                }
                missing.len() < 4
            });
            if let [first, more @ ..] = missing.as_slice() {
                let others = if more.is_empty() {
                    ""
                } else {
                    ", and of others"
                };
                self.mistakes.mistake(
                    separator.clone(),
                    format!("the file has no line for {first}{others}"),
                    "one line for each fact, before this one".to_owned(),
                );
            }
        }
        // A fact that nothing changes, and that is not mentioned, never changes by itself.
        for (index, predicate) in self.problem.predicates.iter().enumerate() {
            let id = PredicateId::from(index);
            let is_mentioned = self.likelihoods.facts.keys().any(|(p, _)| *p == id);
            if !predicate.is_derived && !is_mentioned && !is_changed(self.problem, id) {
                let never = PartialChange::NEVER;
                self.likelihoods.predicates.insert(id, never);
            }
        }
    }
}
