//! Learnt model as a world file (`docs/reference/formats/world.md`).

use std::collections::BTreeSet;
use std::fmt::Write as _;

use elbowroom_report::statistics::Proportion;
use elbowroom_sim::{Distribution, FailureTime};
use toml::{Table, Value};

use crate::changes::{Changes, Rate};
use crate::fit::Fit;
use crate::learn::{Durations, Group, Learnt, constant};

/// Writes the world file. A comment on each section states the data on which it is based.
pub fn write(learnt: &[Learnt], changes: &[Changes], resolution: f64) -> String {
    let mut text = String::from("format = \"elbowroom-world\"\nversion = 1\n");
    let _ = writeln!(text, "resolution = {}", Value::Float(resolution));
    for action in learnt {
        durations(&mut text, action);
        if let Some(fit) = &action.delay {
            let remark = format!("delays of {}", action.name);
            section(&mut text, "delay", &action.name, fit, false, &remark);
        }
        failures(&mut text, action);
    }
    for of_one in changes.chunk_by(|a, b| a.predicate == b.predicate) {
        hazards(&mut text, of_one);
    }
    text
}

/// Writes the rates of a predicate's facts: one section for all facts, or one for each fact if at
/// least one direction has separate rates. A section contains the rates of both directions.
fn hazards(text: &mut String, changes: &[Changes]) {
    let mut section = |fact: &str, rates: &[(bool, Rate)]| {
        let changing = rates.iter().filter(|(_, rate)| rate.changes > 0);
        let changing: Vec<_> = changing.collect();
        if changing.is_empty() {
            return;
        }
        text.push('\n');
        for (becomes, rate) in &changing {
            let (lower, upper) = rate.interval().unwrap_or((0.0, f64::INFINITY));
            let Rate { changes, seconds } = rate;
            let _ = writeln!(
                text,
                "# becomes {becomes}: {changes} in {seconds:.1} s; 95 % interval {lower:.5} to {upper:.5}"
            );
        }
        text.push_str("[[hazard]]\n");
        push(text, "fact", Value::String(fact.to_owned()));
        for (becomes, rate) in changing {
            let key = format!("becomes_{becomes}_per_second");
            push(text, &key, Value::Float(rate.per_second().unwrap_or(0.0)));
        }
    };
    if !changes.iter().any(|change| change.has_rate_per_fact) {
        let rates: Vec<_> = changes.iter().map(|it| (it.becomes, it.all)).collect();
        return section(&changes[0].predicate, &rates);
    }
    let facts = changes.iter().flat_map(|change| &change.facts);
    let facts: BTreeSet<&str> = facts.map(|(fact, _)| fact.as_str()).collect();
    for fact in facts {
        let rates: Vec<_> = changes
            .iter()
            .map(|change| (change.becomes, change.rate_of(fact)))
            .collect();
        section(fact, &rates);
    }
}

fn durations(text: &mut String, learnt: &Learnt) {
    match &learnt.durations {
        Durations::Unknown => {}
        Durations::Pooled(group) => {
            section(
                text,
                "duration",
                &learnt.name,
                &group.fit,
                false,
                &describe_samples(group),
            );
        }
        Durations::Relative(group) => {
            // Durations as planned need no rule.
            let is_as_planned =
                constant(&group.fit.distribution).is_some_and(|share| (share - 1.0).abs() < 1e-9);
            if !is_as_planned {
                section(
                    text,
                    "duration",
                    &learnt.name,
                    &group.fit,
                    true,
                    &describe_samples(group),
                );
            }
        }
        Durations::PerAction(groups) => {
            for (action, group) in groups {
                section(
                    text,
                    "duration",
                    action,
                    &group.fit,
                    false,
                    &describe_samples(group),
                );
            }
        }
    }
}

fn describe_samples(group: &Group) -> String {
    match group.counts() {
        (observed, 0) => format!("from {observed} durations"),
        (observed, censored) => format!(
            "from {observed} complete and {censored} censored \
                                         durations"
        ),
    }
}

fn failures(text: &mut String, learnt: &Learnt) {
    let (Some(share), Some((lower, upper))) = (learnt.failures.share(), learnt.failures.wilson())
    else {
        return;
    };
    if learnt.failures.successes == 0 {
        return;
    }
    let when = match learnt.failure_time {
        FailureTime::AtStart => "start",
        FailureTime::Midway => "midway",
        FailureTime::AtEnd => "end",
    };
    let (failed, of) = (learnt.failures.successes, learnt.failures.count);
    let _ = write!(
        text,
        "\n# {failed} of {of}; 95 % interval {lower:.3} to {upper:.3}"
    );
    let Proportion { successes, count } = learnt.undone;
    if count > 0 {
        let _ = write!(text, "; {successes} of {count} undone");
    }
    text.push_str("\n[[failure]]\n");
    push(text, "action", Value::String(learnt.name.clone()));
    push(text, "probability", Value::Float(share));
    push(text, "when", Value::String(when.to_owned()));
    if learnt.is_undone() {
        push(text, "undone", Value::Boolean(true));
    }
}

fn section(
    text: &mut String,
    kind: &str,
    action: &str,
    fit: &Fit,
    is_relative: bool,
    remark: &str,
) {
    let _ = write!(text, "\n# {remark}");
    if let Some(error) = fit.standard_error {
        let _ = write!(text, "; standard error of the mean {error:.3}");
    }
    let _ = writeln!(text, "\n[[{kind}]]");
    push(text, "action", Value::String(action.to_owned()));
    let table = |pairs: &[(&str, f64)]| {
        let pairs = pairs
            .iter()
            .map(|(key, value)| ((*key).to_owned(), Value::Float(*value)));
        Value::Table(pairs.collect::<Table>())
    };
    match &fit.distribution {
        Distribution::Constant(value) => push(text, "constant", Value::Float(*value)),
        Distribution::Normal { mean, deviation } => {
            push(
                text,
                "normal",
                table(&[("mean", *mean), ("deviation", *deviation)]),
            );
        }
        Distribution::LogNormal { mean, deviation } => {
            push(
                text,
                "lognormal",
                table(&[("mean", *mean), ("deviation", *deviation)]),
            );
        }
        Distribution::Uniform { from, to } => {
            push(text, "uniform", table(&[("from", *from), ("to", *to)]));
        }
        Distribution::Triangular { from, mode, to } => {
            let numbers = [("from", *from), ("mode", *mode), ("to", *to)];
            push(text, "triangular", table(&numbers));
        }
        Distribution::Empirical(values) => {
            let values = values.iter().map(|value| Value::Float(*value)).collect();
            push(text, "values", Value::Array(values));
        }
        // These families are never fitted here.
        Distribution::Exponential { .. } | Distribution::Gamma { .. } => {}
    }
    if is_relative {
        push(text, "relative", Value::Boolean(true));
    }
}

fn push(text: &mut String, key: &str, value: impl Into<Value>) {
    let value: Value = value.into();
    let _ = writeln!(text, "{key} = {value}");
}
