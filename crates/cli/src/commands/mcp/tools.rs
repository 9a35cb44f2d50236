//! Tools of the server: questions about domain, problem and plan, with their command lines.

use std::time::Duration;

use serde_json::{Map, Value, json};

use super::process::{Finished, Question, Stopped};
use super::{INVALID_PARAMETERS, Refusal};

/// Default and maximum time for a question, in seconds.
const DEFAULT_LIMIT: u32 = 60;
const MAX_LIMIT: u32 = 600;

/// Names of the files of a question.
const DOMAIN: &str = "domain.pddl";
const PROBLEM: &str = "problem.pddl";
const PLAN: &str = "plan.plan";

/// A tool.
struct Tool {
    name: &'static str,
    description: &'static str,
    plan: PlanUse,
}

/// Use of the parameter `plan`.
#[derive(Clone, Copy, PartialEq, Eq)]
enum PlanUse {
    None,
    Optional,
    Required,
}

const TOOLS: [Tool; 4] = [
    Tool {
        name: "check",
        description: "Validate a temporal plan exactly, or read domain and problem if there is no plan. An invalid plan \
                      is reported with the action, the time and the violated condition.",
        plan: PlanUse::Optional,
    },
    Tool {
        name: "plan",
        description: "Find a plan for a temporal planning problem with the embedded planner. That no plan exists is \
                      reported only with a proof.",
        plan: PlanUse::None,
    },
    Tool {
        name: "envelope",
        description: "Compute the interval in which each duration of a plan may vary while the plan is guaranteed to \
                      work, with the limiting constraints. With `contains`, decide whether a box is inside, such as \
                      `drive=[8,20]` or `all=±10%`.",
        plan: PlanUse::Required,
    },
    Tool {
        name: "explain",
        description: "Explain a plan as text: for a valid plan what limits it, the tightest quantity first; for an \
                      invalid plan why it fails, and the cheapest repair.",
        plan: PlanUse::Required,
    },
];

/// Returns the descriptions of the tools.
pub(super) fn list() -> Vec<Value> {
    TOOLS.iter().map(describe).collect()
}

fn describe(tool: &Tool) -> Value {
    let text = |description: &str| json!({ "type": "string", "description": description });
    let mut properties = Map::new();
    properties.insert("domain".to_owned(), text("The domain, as PDDL text"));
    properties.insert("problem".to_owned(), text("The problem, as PDDL text"));
    let mut required = vec!["domain", "problem"];
    if tool.plan != PlanUse::None {
        let description = "The plan: one line `start: (action objects) [duration]` for each action";
        properties.insert("plan".to_owned(), text(description));
    }
    if tool.plan == PlanUse::Required {
        required.push("plan");
    }
    if tool.name == "envelope" {
        properties.insert("contains".to_owned(), text("The box to decide about"));
    }
    let limit = json!({
        "type": "number", "exclusiveMinimum": 0, "maximum": MAX_LIMIT, "default": DEFAULT_LIMIT,
        "description": "Time limit in seconds",
    });
    properties.insert("time_limit".to_owned(), limit);
    json!({
        "name": tool.name,
        "description": tool.description,
        "inputSchema": {
            "type": "object", "properties": properties, "required": required, "additionalProperties": false,
        },
        "outputSchema": {
            "type": "object",
            "properties": {
                "exit": { "type": "integer", "description": "0 yes, 1 no, 2 wrong input, 3 limit reached" },
                "answer": { "type": "object", "description": "The document of `elbowroom --json`" },
                "text": { "type": "string", "description": "The explanation" },
            },
            "required": ["exit"],
        },
        "annotations": { "readOnlyHint": true, "openWorldHint": false },
    })
}

/// Answers a question. Returns `None` if `must_end` has ended it.
///
/// # Errors
/// When there is no such tool, or its parameters are wrong.
pub(super) fn call(
    parameters: &Value,
    must_end: &mut dyn FnMut() -> bool,
) -> Result<Option<Value>, Refusal> {
    let wrong = |text: String| (INVALID_PARAMETERS, text);
    let name = parameters["name"].as_str().unwrap_or_default();
    let tool = TOOLS.iter().find(|tool| tool.name == name);
    let tool = tool.ok_or_else(|| wrong(format!("there is no tool `{name}`")))?;
    let none = Map::new();
    let arguments = match &parameters["arguments"] {
        Value::Null => &none,
        Value::Object(arguments) => arguments,
        _ => return Err(wrong("`arguments` is an object".to_owned())),
    };
    let schema = describe(tool);
    let known = &schema["inputSchema"]["properties"];
    if let Some(unknown) = arguments
        .keys()
        .find(|key| known.get(key.as_str()).is_none())
    {
        return Err(wrong(format!("`{name}` has no argument `{unknown}`")));
    }
    let text = |key: &str| match arguments.get(key) {
        None => Ok(None),
        Some(Value::String(text)) => Ok(Some(text.as_str())),
        Some(_) => Err(wrong(format!("`{key}` is a text"))),
    };
    let needed = |key: &str| text(key)?.ok_or_else(|| wrong(format!("`{key}` is missing")));
    let limit = match arguments.get("time_limit") {
        None => Duration::from_secs(DEFAULT_LIMIT.into()),
        Some(limit) => limit
            .as_f64()
            .filter(|seconds| *seconds > 0.0 && *seconds <= f64::from(MAX_LIMIT))
            .map(Duration::from_secs_f64)
            .ok_or_else(|| {
                wrong(format!(
                    "`time_limit` is a number of seconds, at most {MAX_LIMIT}"
                ))
            })?,
    };
    let mut files = vec![(DOMAIN, needed("domain")?), (PROBLEM, needed("problem")?)];
    if tool.plan == PlanUse::Required {
        files.push((PLAN, needed("plan")?));
    } else {
        files.extend(text("plan")?.map(|plan| (PLAN, plan)));
    }
    let mut options: Vec<String> = files.iter().map(|(name, _)| (*name).to_owned()).collect();
    // The command ends at the limit with its best answer so far. It is killed only if it does not.
    let own_limit = format!("--time-limit={}", limit.as_secs_f64());
    match tool.name {
        "plan" => options.extend(["--first".to_owned(), own_limit.clone()]),
        "envelope" => options.push(own_limit.clone()),
        _ => {}
    }
    if let Some(contains) = text("contains")? {
        options.push(format!("--contains={contains}"));
    }
    let mut question = Question::new(&files, limit, must_end);
    let outcome = match tool.name {
        "explain" => explain(&mut question, &options, &own_limit),
        command => question.ask(command, &options, true),
    };
    match outcome {
        Ok(finished) => Ok(Some(result(&finished))),
        Err(Stopped::Ended) => Ok(None),
        Err(Stopped::Failed(why)) => Ok(Some(failure(&why))),
    }
}

/// Explains a plan: its limits, or its error and a repair.
fn explain(
    question: &mut Question<'_>,
    files: &[String],
    limit: &str,
) -> Result<Finished, Stopped> {
    let mut verdict = question.ask("check", files, false)?;
    let option = match verdict.exit {
        0 => "--order=tightness",
        1 => "--repair",
        _ => return Ok(verdict),
    };
    let options = [option, limit].map(str::to_owned);
    let more = question.ask("envelope", &[files, &options].concat(), false)?;
    verdict.text = format!("{}\n{}", verdict.text.trim_end(), more.text);
    Ok(verdict)
}

fn result(finished: &Finished) -> Value {
    let document: Option<Value> = serde_json::from_str(&finished.text).ok();
    let structured = match document {
        Some(document) => json!({ "exit": finished.exit, "answer": document }),
        None => json!({ "exit": finished.exit, "text": finished.text }),
    };
    json!({
        "content": [{ "type": "text", "text": finished.text }],
        "structuredContent": structured,
        "isError": !matches!(finished.exit, 0 | 1 | 3),
    })
}

fn failure(why: &str) -> Value {
    json!({ "content": [{ "type": "text", "text": why }], "isError": true })
}
