//! Writer of likelihoods as TOML: [`write()`].

use std::fmt::Write;

use elbowroom_model::problem::{ObjectId, Problem, SchemaId};

use super::file::{FORMAT, VERSION};
use super::{FailureModel, Likelihoods, Outcome, PartialChange, Success};

/// Returns the likelihoods in Elbowroom's format. [`read`](super::read) returns the same
/// likelihoods.
pub fn write(problem: &Problem, likelihoods: &Likelihoods) -> String {
    let mut text = format!("format = \"{FORMAT}\"\nversion = {VERSION}\n");
    let defaults = &likelihoods.defaults;
    let entries = [
        ("becomes_true", defaults.becomes_true),
        ("becomes_false", defaults.becomes_false),
        ("becomes_true_per_second", defaults.becomes_true_per_second),
        (
            "becomes_false_per_second",
            defaults.becomes_false_per_second,
        ),
        ("start", defaults.start),
        ("effect", defaults.effect),
    ];
    let failing = &defaults.failing;
    if entries.iter().any(|(_, value)| value.is_some()) || *failing != FailureModel::default() {
        text.push_str("\n[defaults]\n");
        numbers(&mut text, &entries);
        failures(&mut text, problem, None, failing);
    }
    for (predicate, flip) in &likelihoods.predicates {
        let name = &problem.predicates[predicate.index()].name;
        fact(&mut text, &key(problem, name, &[]), flip);
    }
    for ((predicate, arguments), flip) in &likelihoods.facts {
        let name = &problem.predicates[predicate.index()].name;
        fact(&mut text, &key(problem, name, arguments), flip);
    }
    for (schema, success) in &likelihoods.schemas {
        let name = &problem.schemas[schema.index()].name;
        header(&mut text, "actions", &key(problem, name, &[]));
        action(&mut text, problem, *schema, success);
    }
    for ((schema, arguments), success) in &likelihoods.actions {
        let name = &problem.schemas[schema.index()].name;
        header(&mut text, "actions", &key(problem, name, arguments));
        action(&mut text, problem, *schema, success);
    }
    if !likelihoods.beliefs.is_empty() {
        text.push_str("\n[beliefs]\n");
    }
    for ((predicate, arguments), probability) in &likelihoods.beliefs {
        let name = &problem.predicates[predicate.index()].name;
        number(&mut text, &key(problem, name, arguments), *probability);
    }
    text
}

/// Returns `"name object …"`, quoted because names may contain any characters except spaces.
fn key(problem: &Problem, name: &str, arguments: &[ObjectId]) -> String {
    let mut key = format!("\"{name}");
    for argument in arguments {
        key.push(' ');
        key.push_str(&problem.objects[argument.index()].name);
    }
    key.push('"');
    key
}

fn fact(text: &mut String, key: &str, flip: &PartialChange) {
    header(text, "facts", key);
    numbers(
        text,
        &[
            ("becomes_true", flip.becomes_true),
            ("becomes_false", flip.becomes_false),
            ("becomes_true_per_second", flip.becomes_true_per_second),
            ("becomes_false_per_second", flip.becomes_false_per_second),
        ],
    );
}

fn action(text: &mut String, problem: &Problem, schema: SchemaId, success: &Success) {
    numbers(text, &[("start", success.start)]);
    failures(text, problem, Some(schema), &success.failing);
    for (stated, prefix) in [(&success.effects, ""), (&success.deletions, "not ")] {
        for (predicate, probability) in stated {
            let name = &problem.predicates[predicate.index()].name;
            let key = format!("effects.\"{prefix}{name}\"");
            number(text, &key, *probability);
        }
    }
}

fn failures(
    text: &mut String,
    problem: &Problem,
    schema: Option<SchemaId>,
    failing: &FailureModel,
) {
    let entries = [
        ("end", failing.end),
        ("during_per_second", failing.during_per_second),
    ];
    numbers(text, &entries);
    // Writing into a string cannot fail.
    if let Some(undone) = failing.undone {
        let _ = writeln!(text, "undone = {undone}");
    }
    let Some(outcomes) = &failing.outcomes else {
        return;
    };
    let one = |outcome: &Outcome| {
        let facts = |truth| {
            let changes = outcome.changes.iter().filter(|it| it.becomes == truth);
            let facts = changes.map(|change| format!("\"{}\"", change.text(problem, schema)));
            facts.collect::<Vec<_>>().join(", ")
        };
        format!(
            "{{ probability = {:?}, becomes_true = [{}], becomes_false = [{}] }}",
            outcome.probability,
            facts(true),
            facts(false)
        )
    };
    let outcomes: Vec<String> = outcomes.iter().map(one).collect();
    let _ = writeln!(text, "outcome = [{}]", outcomes.join(", "));
}

fn header(text: &mut String, section: &str, key: &str) {
    // Writing into a string cannot fail.
    let _ = writeln!(text, "\n[{section}.{key}]");
}

fn numbers(text: &mut String, entries: &[(&str, Option<f64>)]) {
    for (key, value) in entries {
        if let Some(value) = value {
            number(text, key, *value);
        }
    }
}

/// Writes a number. `{:?}` gives the shortest decimal that is read as the same number, with a
/// decimal point.
fn number(text: &mut String, key: &str, value: f64) {
    let _ = writeln!(text, "{key} = {value:?}");
}
