//! The interface as an `OpenAPI` document.

use serde_json::{Map, Value, json};

use super::documents::{
    GoalNow, GoalsNow, GuaranteeNow, HistoryNow, NewFact, NewGoal, NewNumber, NewOutcome,
    NewProblem, NextNow, PlanNow, Refusal, State, Taken, WhatIf,
};
use super::schema::Described;

/// A method of the interface.
pub struct Method {
    /// `GET`, `POST`, `PUT` or `DELETE`.
    pub verb: &'static str,
    /// The path; `{name}` is a placeholder for a part of it.
    pub path: &'static str,
    /// Description of the method.
    pub about: &'static str,
    body: Option<Schema>,
    answer: Answer,
}

type Schema = fn(&mut Map<String, Value>) -> Value;

enum Answer {
    Json(Schema),
    Other(&'static str, &'static str),
}

impl Method {
    /// Returns `true` if it changes something, which requires a token.
    pub fn changes(&self) -> bool {
        self.verb != "GET"
    }
}

const fn get(path: &'static str, about: &'static str, answer: Answer) -> Method {
    Method {
        verb: "GET",
        path,
        about,
        body: None,
        answer,
    }
}

const fn change(
    verb: &'static str,
    path: &'static str,
    about: &'static str,
    body: Option<Schema>,
) -> Method {
    Method {
        verb,
        path,
        about,
        body,
        answer: Answer::Json(Taken::schema),
    }
}

/// All methods of the interface.
pub const METHODS: &[Method] = &[
    get(
        "/v1/state",
        "Status of the executive",
        Answer::Json(State::schema),
    ),
    get(
        "/v1/goals",
        "The open goals, and the goals that were closed most recently",
        Answer::Json(GoalsNow::schema),
    ),
    get(
        "/v1/goals/{name}",
        "The open goal with that name, or otherwise the one that was closed last",
        Answer::Json(GoalNow::schema),
    ),
    get(
        "/v1/plan",
        "The plan, with the states of its actions",
        Answer::Json(PlanNow::schema),
    ),
    get(
        "/v1/guarantee",
        "The remaining guarantee, and how far each quantity may deviate",
        Answer::Json(GuaranteeNow::schema),
    ),
    get(
        "/v1/history",
        "Closed goals and ended actions, the latest first, also from earlier segments of the journal; with \
         `?before=T&limit=N`, N of them before the time T",
        Answer::Json(HistoryNow::schema),
    ),
    get(
        "/v1/next",
        "The next action and its reason",
        Answer::Json(NextNow::schema),
    ),
    get(
        "/v1/events",
        "Every line of the trace from now on, as server-sent events; with `?after=N`, or the \
         header Last-Event-ID, the lines after N",
        Answer::Other(
            "text/event-stream",
            "Events named `entry`; `over` after the last one",
        ),
    ),
    get(
        "/v1/state/events",
        "The state, goals, plan, guarantee and last decision as one document, and then its differences, as \
         server-sent events",
        Answer::Other(
            "text/event-stream",
            "`document` with the document, without facts and numbers; `change` with a JSON merge patch \
             (RFC 7396) at least every half second; `over` at the end",
        ),
    ),
    get(
        "/v1/health",
        "200 as long as the executive serves requests",
        Answer::Other("text/plain", "ok"),
    ),
    get(
        "/v1/ready",
        "200 if the executive can start actions; 503 with the reason if it has not begun, has ended, or the \
         world does not answer",
        Answer::Other("text/plain", "ready, or the reason"),
    ),
    get(
        "/metrics",
        "Metrics for Prometheus: time, activity, goals by state, running actions, plans, doubts, silence of the \
         world",
        Answer::Other("text/plain", "Prometheus text format, version 0.0.4"),
    ),
    get(
        "/v1/openapi.json",
        "This description",
        Answer::Other("application/json", "An OpenAPI document"),
    ),
    change(
        "PUT",
        "/v1/problem",
        "A problem, for an executive that was started without one",
        Some(NewProblem::schema),
    ),
    change("POST", "/v1/goals", "Adds a goal", Some(NewGoal::schema)),
    change("DELETE", "/v1/goals/{name}", "Abandons the goal", None),
    Method {
        answer: Answer::Json(WhatIf::schema),
        ..change(
            "POST",
            "/v1/what-if",
            "The outcome of a goal if it were given now and everything went as planned; the run does not change",
            Some(NewGoal::schema),
        )
    },
    change(
        "POST",
        "/v1/actions",
        "Reports that a running action has ended or failed, or cancels it",
        Some(NewOutcome::schema),
    ),
    change("POST", "/v1/facts", "Sets a fact", Some(NewFact::schema)),
    change(
        "POST",
        "/v1/numbers",
        "Sets a number",
        Some(NewNumber::schema),
    ),
    change(
        "POST",
        "/v1/pause",
        "No further actions are started; running actions continue",
        None,
    ),
    change("POST", "/v1/resume", "Ends a pause", None),
    change(
        "POST",
        "/v1/stop",
        "Shuts down the executive; running actions are cancelled",
        None,
    ),
];

/// Returns the interface as a document of `OpenAPI` 3.1.
pub fn openapi() -> Value {
    let mut schemas = Map::new();
    let refusal = Refusal::schema(&mut schemas);
    let mut paths = Map::new();
    for method in METHODS {
        let (kind, answer) = match &method.answer {
            Answer::Json(schema) => (
                "application/json",
                json!({ "schema": schema(&mut schemas) }),
            ),
            Answer::Other(kind, about) => (
                *kind,
                json!({ "schema": { "type": "string", "description": about } }),
            ),
        };
        let mut content = Map::new();
        content.insert(kind.to_owned(), answer);
        let mut operation = json!({
            "summary": method.about,
            "responses": {
                "200": { "description": "Done", "content": content.clone() },
                "default": {
                    "description": "Refused",
                    "content": { "application/json": { "schema": refusal.clone() } },
                },
            },
        });
        if method.changes() {
            operation["responses"]["202"] = json!({
                "description": "Received, but not processed yet, because the executive plans or waits for the world",
                "content": content,
            });
            operation["security"] = json!([{ "token": [] }]);
        }
        if let Some(body) = method.body {
            operation["requestBody"] = json!({
                "required": true,
                "content": { "application/json": { "schema": body(&mut schemas) } },
            });
        }
        if method.path.contains("{name}") {
            operation["parameters"] = json!([{
                "name": "name", "in": "path", "required": true, "schema": { "type": "string" },
            }]);
        }
        let path = paths.entry(method.path).or_insert_with(|| json!({}));
        path[method.verb.to_lowercase()] = operation;
    }
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "elbowroom serve",
            "version": "1",
            "description": "A long-lived executive of temporal plans.",
        },
        "paths": paths,
        "components": {
            "schemas": schemas,
            "securitySchemes": { "token": { "type": "http", "scheme": "bearer" } },
        },
    })
}

#[cfg(test)]
mod tests {
    use super::{METHODS, openapi};
    use serde_json::Value;

    /// Collects all references in a document.
    fn references<'v>(value: &'v Value, found: &mut Vec<&'v str>) {
        match value {
            Value::Object(members) => {
                for (name, member) in members {
                    match member.as_str() {
                        Some(to) if name == "$ref" => found.push(to),
                        _ => references(member, found),
                    }
                }
            }
            Value::Array(members) => members.iter().for_each(|it| references(it, found)),
            _ => {}
        }
    }

    #[test]
    fn all_references_are_defined() {
        let document = openapi();
        let mut found = Vec::new();
        references(&document, &mut found);
        assert!(found.len() > 20);
        for reference in found {
            let pointer = reference.strip_prefix('#').expect("local");
            assert!(document.pointer(pointer).is_some(), "{reference}");
        }
    }

    #[test]
    fn modifying_methods_require_a_token() {
        let document = openapi();
        for method in METHODS {
            let operation = &document["paths"][method.path][method.verb.to_lowercase()];
            assert!(operation.is_object(), "{}", method.path);
            assert_eq!(
                operation["security"].is_array(),
                method.verb != "GET",
                "{}",
                method.path
            );
        }
    }

    #[test]
    fn optional_members_are_not_required() {
        let goal = &openapi()["components"]["schemas"]["NewGoal"];
        assert_eq!(goal["required"], serde_json::json!(["goal"]));
        assert!(goal["properties"]["name"]["description"].as_str().is_some());
    }
}
