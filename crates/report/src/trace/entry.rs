//! One entry as JSON.

use elbowroom_execution::run::{ExecutedStep, Report};
use elbowroom_execution::{Decided, Decision, Ending, Entry, Mission, Order, Planned, Reason};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{Bound, ParametrizedPlan};
use serde_json::{Value, json};

use crate::wire::{command, number, observation, optional};

/// An entry as the object that its line holds.
pub fn entry(task: &Task, entry: &Entry<'_>) -> Value {
    match entry {
        Entry::Mission(mission) => mission_entry(mission),
        Entry::Decided { now, decided } => json!({
            "event": "decided",
            "now": number(now),
            "decision": decision(decided),
            "reason": reason(&decided.reason),
        }),
        Entry::Command {
            now,
            command: given,
            planned,
        } => json!({
            "event": "command",
            "now": number(now),
            "command": command(given),
            "planned": window(planned),
        }),
        Entry::Passed {
            until,
            now,
            observations,
        } => json!({
            "event": "passed",
            "until": number(until),
            "now": number(now),
            "observations": observations.iter().map(|it| observation(task, it)).collect::<Value>(),
        }),
        Entry::Looked { now, observations } => json!({
            "event": "looked",
            "now": number(now),
            "observations": observations.iter().map(|it| observation(task, it)).collect::<Value>(),
        }),
        Entry::Taken {
            now,
            observation: taken,
            planned,
            remark,
        } => json!({
            "event": "observed",
            "now": number(now),
            "observation": observation(task, taken),
            "planned": window(planned),
            "remark": remark,
        }),
        Entry::Planning {
            now,
            reason: why,
            situation,
        } => json!({
            "event": "planning",
            "now": number(now),
            "reason": reason(why),
            "situation": situation_entry(task, situation),
        }),
        Entry::Planned {
            now,
            took,
            plan,
            why_not,
            is_unsolvable,
        } => json!({
            "event": "planned",
            "now": number(now),
            "took": number(took),
            "plan": plan.map(steps),
            "why_not": why_not,
            "unsolvable": is_unsolvable,
        }),
        Entry::Interrupted { now } => json!({
            "event": "interrupted",
            "now": number(now),
        }),
        Entry::Over(over) => {
            let mut over = report(over);
            over["event"] = "over".into();
            over
        }
    }
}

/// What came of a run.
pub fn report(report: &Report) -> Value {
    json!({
        "verdict": report.verdict.name(),
        "why": report.verdict.why(),
        "time": number(&report.time),
        "replans": report.replans,
        "reasons": report.reasons.iter().map(reason).collect::<Value>(),
        "dead_end": report.dead_end.iter().map(reason).collect::<Value>(),
        "starts": report.starts,
        "executed": report.executed.iter().map(executed).collect::<Value>(),
    })
}

/// A reason: its words, and its parts.
pub(crate) fn reason(reason: &Reason) -> Value {
    let mut value = json!({
        "cause": reason.cause.name(),
        "words": reason.to_string(),
        "action": reason.action,
        "about": reason.about,
        "observed": optional(reason.observed.as_ref()),
        "allowed": reason.allowed.as_ref().map(interval),
        "behind": reason.behind,
        "by": optional(reason.by.as_ref()),
        "since": optional(reason.since.as_ref()),
    });
    if let Some(promise) = reason.promise {
        value["promise"] = promise.name().into();
    }
    value
}

fn executed(executed: &ExecutedStep) -> Value {
    let mut value = step(
        &executed.step.start,
        &executed.step.action.name,
        executed.step.duration.as_ref(),
    );
    value["ticket"] = executed.ticket.0.into();
    value["outcome"] = executed.ending.as_ref().map(Ending::name).into();
    value
}

fn decision(decided: &Decided) -> Value {
    let name = decided.decision.name();
    match &decided.decision {
        Decision::Start(orders) => json!({
            "type": name,
            "orders": orders.iter().map(order).collect::<Value>(),
        }),
        Decision::Wait { until } => json!({ "type": name, "until": optional(until.as_ref()) }),
        Decision::Cancel(steps) => json!({
            "type": name,
            "steps": steps.iter().map(|step| step.0).collect::<Value>(),
        }),
        Decision::Replan | Decision::GoalReached => json!({ "type": name }),
    }
}

fn order(order: &Order) -> Value {
    json!({
        "step": order.step.0,
        "action": order.action.name,
        "duration": optional(order.duration.as_ref()),
        "planned": window(&order.planned),
    })
}

fn window(planned: &Planned) -> Value {
    json!({
        "earliest": optional(planned.earliest.as_ref()),
        "latest": optional(planned.latest.as_ref()),
    })
}

fn mission_entry(mission: &Mission) -> Value {
    json!({
        "event": "plan",
        "now": number(&mission.now),
        "origin": number(&mission.origin),
        "steps": steps(&mission.time_triggered),
        "network": network(&mission.plan),
        "parameters": parameters(mission),
    })
}

fn network(plan: &ParametrizedPlan) -> Value {
    let label = |node| plan.plan.node_label(node);
    let bound = |bound: &Bound| match bound {
        Bound::Infinite => Value::Null,
        Bound::Finite(value) => number(value),
        Bound::Parameter(id) => json!({ "parameter": plan.parameter(*id).name }),
    };
    let constraints = plan.plan.constraints.iter().map(|constraint| {
        json!({
            "from": label(constraint.from),
            "to": label(constraint.to),
            "lower": bound(&constraint.lower),
            "upper": bound(&constraint.upper),
        })
    });
    let instances = plan
        .plan
        .instances
        .iter()
        .map(|instance| json!({ "label": instance.label, "action": instance.action.name }));
    json!({
        "instances": instances.collect::<Value>(),
        "constraints": constraints.collect::<Value>(),
    })
}

fn parameters(mission: &Mission) -> Value {
    let numbered = mission.plan.parameters.iter().enumerate();
    let parameters = numbered.map(|(index, parameter)| {
        let allowed = mission.envelope.as_ref();
        let allowed = allowed.map(|envelope| interval(&envelope.intervals[index]));
        json!({
            "name": parameter.name,
            "nominal": number(&parameter.nominal),
            "envelope": allowed,
        })
    });
    parameters.collect()
}

/// An interval: its ends, `null` where infinite.
pub(crate) fn interval(interval: &Interval) -> Value {
    json!([
        optional(interval.lower.value()),
        optional(interval.upper.value())
    ])
}

fn steps(plan: &TimeTriggeredPlan) -> Value {
    let steps = plan.steps.iter();
    steps
        .map(|it| step(&it.start, &it.action.name, it.duration.as_ref()))
        .collect()
}

fn step(start: &Rational, action: &str, duration: Option<&Rational>) -> Value {
    json!({
        "start": number(start),
        "action": action,
        "duration": optional(duration),
    })
}

fn situation_entry(task: &Task, situation: &Situation) -> Value {
    let facts = situation
        .state
        .facts
        .iter()
        .map(|&fact| task.fact_name(fact));
    let values = situation.state.values.iter();
    let values = values.map(|(&fluent, value)| (task.fluent_name(fluent), number(value)));
    let running = situation.running.iter().map(|running| {
        json!({
            "action": running.action.name,
            "start": number(&running.start),
            "duration": interval(&running.duration),
        })
    });
    json!({
        "time": number(&situation.time),
        "facts": facts.collect::<Value>(),
        "values": Value::Object(values.collect()),
        "running": running.collect::<Value>(),
    })
}
