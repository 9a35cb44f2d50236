//! Answers as JSON: `docs/formats/envelope-json.md`.

use elbowroom::model::Task;
use elbowroom::model::validate::Violation;
use elbowroom::plan::{DecoupledEnvelope, Node, ParameterId, ParameterKind, Side};
use elbowroom::{Explanation, Shortfall};
use serde_json::{Map, Value, json};

use super::Subject;
use super::search::Outcome;
use super::watch::Stop;
use crate::args::{EnvelopeArgs, Growth};
use crate::commands::check::violation_document;
use crate::json;

/// The answer "this is the envelope".
pub(super) fn envelope(subject: &Subject<'_>, outcome: &Outcome) -> Value {
    let mut document = header(subject.arguments, subject.task, "envelope");
    let mut parameters = parameters(subject, Some(&outcome.envelope));
    for (parameter, [lower, upper]) in parameters.iter_mut().zip(&outcome.limits) {
        parameter["lower_limit"] = json!(lower);
        parameter["upper_limit"] = json!(upper);
    }
    document["parameters"] = Value::Array(parameters);
    document["stop"] = json!(outcome.stop.name());
    document["checks"] = json!(outcome.checks);
    document["seconds"] = json!(outcome.seconds);
    document["widenings"] = outcome
        .widenings
        .iter()
        .map(|step| {
            let (end, infinity) = match step.end.side {
                Side::Lower => ("lower", "-inf"),
                Side::Upper => ("upper", "inf"),
            };
            json!({
                "seconds": step.seconds,
                "checks": step.checks,
                "parameter": subject.plan.parameter(step.end.parameter).name,
                "end": end,
                "value": match &step.value {
                    Some(value) => json::number(value),
                    None => json!({ "exact": infinity, "decimal": null }),
                },
            })
        })
        .collect();
    document
}

/// The answer to `--contains`.
pub(super) fn contains(
    subject: &Subject<'_>,
    envelope: &DecoupledEnvelope,
    why_not: Option<&Explanation>,
) -> Value {
    let answer = if why_not.is_some() {
        "outside"
    } else {
        "inside"
    };
    let mut document = header(subject.arguments, subject.task, answer);
    document["parameters"] = Value::Array(parameters(subject, Some(envelope)));
    if let Some(explanation) = why_not {
        document["counterexample"] = counterexample(subject, explanation);
    }
    document
}

/// The answer "it fails even as planned".
pub(super) fn fails(subject: &Subject<'_>, explanation: &Explanation) -> Value {
    let mut document = header(subject.arguments, subject.task, "fails");
    document["parameters"] = Value::Array(parameters(subject, None));
    document["counterexample"] = counterexample(subject, explanation);
    document
}

/// The answer "nothing is known yet".
pub(super) fn none(subject: &Subject<'_>, stop: Stop) -> Value {
    let mut document = header(subject.arguments, subject.task, "none");
    document["stop"] = json!(stop.name());
    document
}

/// The answer "the judge rejects the plan".
pub(super) fn judged_invalid(
    arguments: &EnvelopeArgs,
    task: &Task,
    violation: &Violation,
) -> Value {
    let mut document = header(arguments, task, "fails");
    document["violation"] = violation_document(violation);
    document
}

fn header(arguments: &EnvelopeArgs, task: &Task, answer: &str) -> Value {
    let problem = task.problem();
    json!({
        "format": "elbowroom-envelope",
        "version": 1,
        "domain": problem.domain,
        "problem": problem.name,
        "plan": arguments.plan.display().to_string(),
        "settings": {
            "method": "irr",
            "guarantee": elbowroom::envelope::Guarantee::from(arguments.guarantee).name(),
            "growth": match arguments.growth {
                Growth::Doubling => "doubling",
                Growth::Constant => "constant",
            },
            "precision": json::number(&arguments.precision),
            "epsilon": json::number(&arguments.epsilon),
            "sharpen": arguments.sharpen,
        },
        "answer": answer,
    })
}

fn parameters(subject: &Subject<'_>, envelope: Option<&DecoupledEnvelope>) -> Vec<Value> {
    let each = |(index, parameter): (usize, &elbowroom::plan::Parameter)| {
        let mut value = json!({
            "name": parameter.name,
            "quantity": subject.explainer.quantity(ParameterId::from(index)),
            "kind": kind(parameter.kind),
            "nominal": json::number(&parameter.nominal),
            "weight": json::number(&parameter.weight),
        });
        if let Some(envelope) = envelope {
            let interval = &envelope.intervals[index];
            value["lower"] = json::lower(&interval.lower);
            value["upper"] = json::upper(&interval.upper);
        }
        value
    };
    subject
        .plan
        .parameters
        .iter()
        .enumerate()
        .map(each)
        .collect()
}

fn kind(kind: ParameterKind) -> &'static str {
    match kind {
        ParameterKind::Duration(_) => "duration",
        ParameterKind::Constant(_) => "constant",
        ParameterKind::Domain => "domain",
        ParameterKind::Initial(_) => "initial",
        ParameterKind::Timed(_) => "timed",
        ParameterKind::Bound => "bound",
    }
}

fn counterexample(subject: &Subject<'_>, explanation: &Explanation) -> Value {
    let names = subject.plan.parameters.iter().map(|p| p.name.clone());
    let values: Map<String, Value> = names
        .zip(explanation.valuation.iter().map(json::number))
        .collect();
    json!({
        "message": explanation.reason,
        "shortfall": explanation.shortfall.as_ref().and_then(Shortfall::value).map(json::number),
        "verdict": explanation.verdict,
        "values": values,
        "schedule": schedule(subject, explanation),
    })
}

fn schedule(subject: &Subject<'_>, explanation: &Explanation) -> Vec<Value> {
    let Some(times) = &explanation.schedule else {
        return Vec::new();
    };
    let plan = &subject.plan.plan;
    let mut happenings = Vec::new();
    for (id, instance) in plan.instances.iter().enumerate() {
        let mut entry = json!({ "instance": instance.label, "action": instance.action.name });
        for (node, what) in plan.nodes() {
            let member = match what {
                Node::Start(of) | Node::Instant(of) if of.index() == id => "start",
                Node::End(of) if of.index() == id => "end",
                _ => continue,
            };
            entry[member] = json::number(&times[node.index()]);
        }
        happenings.push(entry);
    }
    happenings
}
