//! `elbowroom stn`: the plan without its needless times and orderings.

use elbowroom::flow::{self, FlowError};
use elbowroom::model::Task;
use elbowroom::model::validate::Violation;
use elbowroom::plan::{Bound, Node, ParametrizedPlan, format};
use elbowroom::{graph, num::Rational};
use serde_json::{Value, json};

use crate::args::StnArgs;
use crate::commands::check::violation_document;
use crate::exit::{Answer, Exit, Failure};
use crate::input::{self, AnyPlan};
use crate::limits::push_wrapped;
use crate::look::{BAD, Look, styled};
use crate::{json, output};

/// Writes the STN plan, and what else was asked for.
pub(crate) fn run(arguments: &StnArgs) -> Answer {
    let mut task = input::task(&arguments.problem)?;
    let plan = match input::any_plan(&mut task, &arguments.plan)? {
        AnyPlan::Stn(plan) => plan,
        AnyPlan::TimeTriggered(plan) => match flow::free(&task, &plan, &arguments.epsilon) {
            Ok(freed) => {
                input::tell_repair(&arguments.plan, &freed);
                flow::closed(&task, freed, &arguments.epsilon)
            }
            Err(FlowError::Invalid(violation)) => {
                return invalid(arguments, &violation);
            }
            Err(error) => return Err(Failure::new(error, "")),
        },
    };
    if let Some(path) = &arguments.dot {
        output::write_file(path, &graph::to_dot(&task, &plan))?;
    }
    let is_dot_on_stdout = arguments
        .dot
        .as_ref()
        .is_some_and(|path| path.as_os_str() == "-");
    if let Some(path) = &arguments.output {
        output::write_file(path, &stn_text(&task, &plan)?)?;
    }
    if arguments.json {
        output::print_json(&document(&task, &plan))?;
    } else if arguments.output.is_none() && !is_dot_on_stdout {
        output::print(&stn_text(&task, &plan)?)?;
    }
    Ok(Exit::Yes)
}

/// A plan that is not valid has no room. Standard output is for the network alone.
fn invalid(arguments: &StnArgs, violation: &Violation) -> Answer {
    let file = arguments.plan.display();
    if arguments.json {
        output::print_json(&json!({
            "format": "elbowroom-stn",
            "version": 1,
            "answer": "invalid",
            "violation": violation_document(violation),
        }))?;
    } else {
        let mut text = format!("{}: {file} does not work\n", styled(BAD, "invalid"));
        push_wrapped(&mut text, &violation.to_string(), 2, Look::PLAIN.width);
        output::tell(text.trim_end());
    }
    Ok(Exit::No)
}

fn stn_text(task: &Task, plan: &ParametrizedPlan) -> Result<String, Failure> {
    format::write(task, plan).map_err(|error| Failure::new(error, ""))
}

fn document(task: &Task, plan: &ParametrizedPlan) -> Value {
    let network = &plan.plan;
    let bound = |bound: &Bound, infinity: &str| match bound {
        Bound::Infinite => json!({ "exact": infinity, "decimal": null }),
        Bound::Finite(value) => json::number(value),
        Bound::Parameter(id) => json!({ "parameter": plan.parameter(*id).name }),
    };
    let nodes: Vec<Value> = network
        .nodes()
        .map(|(id, node)| {
            let time: Option<&Rational> = match node {
                Node::Timed(index) => Some(&task.timed()[index].time),
                _ => None,
            };
            json!({
                "name": network.node_label(id),
                "what": network.node_words(task, id),
                "time": time.map(json::number),
            })
        })
        .collect();
    let constraints: Vec<Value> = network
        .constraints
        .iter()
        .map(|constraint| {
            json!({
                "from": network.node_label(constraint.from),
                "to": network.node_label(constraint.to),
                "lower": bound(&constraint.lower, "-inf"),
                "upper": bound(&constraint.upper, "inf"),
                "reason": graph::reason(&constraint.reason),
            })
        })
        .collect();
    json!({
        "format": "elbowroom-stn",
        "version": 1,
        "answer": "network",
        "domain": task.problem().domain,
        "problem": task.problem().name,
        "nodes": nodes,
        "constraints": constraints,
    })
}
