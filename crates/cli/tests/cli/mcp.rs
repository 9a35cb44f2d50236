//! `mcp` with a scripted client.

use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use crate::command::root;
use serde_json::{Value, json};

/// A client with its server.
struct Client {
    server: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    count: u64,
}

impl Client {
    fn start() -> Self {
        let mut server = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
            .arg("mcp")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the command can be started");
        let input = server.stdin.take().expect("a pipe");
        let output = BufReader::new(server.stdout.take().expect("a pipe"));
        Self {
            server,
            input,
            output,
            count: 0,
        }
    }

    fn write(&mut self, line: &str) {
        writeln!(self.input, "{line}").expect("the server reads");
    }

    fn read(&mut self) -> Value {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("a reply");
        serde_json::from_str(&line).unwrap_or_else(|_| panic!("no reply: {line:?}"))
    }

    /// Sends a request, without waiting for the reply.
    fn send(&mut self, method: &str, parameters: &Value) -> u64 {
        self.count += 1;
        let id = self.count;
        let message = json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": parameters });
        self.write(&message.to_string());
        id
    }

    fn ask(&mut self, method: &str, parameters: &Value) -> Value {
        let id = self.send(method, parameters);
        let reply = self.read();
        assert_eq!(reply["id"], id, "{reply}");
        assert_eq!(reply["jsonrpc"], "2.0", "{reply}");
        reply
    }

    fn call(&mut self, tool: &str, arguments: &Value) -> Value {
        let reply = self.ask(
            "tools/call",
            &json!({ "name": tool, "arguments": arguments }),
        );
        assert!(reply.get("error").is_none(), "{reply}");
        reply["result"].clone()
    }

    /// Ends the input, and checks that the server ends.
    fn close(mut self) {
        drop(self.input);
        let status = self.server.wait().expect("the server ends");
        assert!(status.success(), "{status}");
    }
}

fn text(path: &str) -> String {
    fs::read_to_string(root().join("cases/delivery").join(path)).expect("a file of the case")
}

/// The texts of the case, with a plan.
fn delivery(plan: &str) -> Value {
    json!({ "domain": text("domain.pddl"), "problem": text("problem.pddl"), "plan": text(plan) })
}

#[test]
fn client_lists_and_calls_the_tools() {
    let mut client = Client::start();
    let begin = json!({ "protocolVersion": "2025-03-26", "capabilities": {}, "clientInfo": {} });
    let reply = client.ask("initialize", &begin);
    assert_eq!(reply["result"]["protocolVersion"], "2025-03-26", "{reply}");
    assert_eq!(
        reply["result"]["serverInfo"]["name"], "elbowroom",
        "{reply}"
    );
    client.write(r#"{"jsonrpc":"2.0","method":"notifications/initialized"}"#);
    let reply = client.ask("tools/list", &json!({}));
    let tools = reply["result"]["tools"].as_array().expect("a list");
    let names: Vec<&Value> = tools.iter().map(|tool| &tool["name"]).collect();
    assert_eq!(names, ["check", "plan", "envelope", "explain"]);
    assert!(
        tools
            .iter()
            .all(|tool| tool["inputSchema"]["type"] == "object")
    );

    let valid = client.call("check", &delivery("plan.plan"));
    assert_eq!(valid["isError"], false, "{valid}");
    assert_eq!(valid["structuredContent"]["exit"], 0, "{valid}");
    let late = client.call("check", &delivery("late.plan"));
    assert_eq!(late["structuredContent"]["exit"], 1, "{late}");
    let envelope = client.call("envelope", &delivery("plan.plan"));
    let answer = &envelope["structuredContent"]["answer"];
    assert_eq!(answer["format"], "elbowroom-envelope", "{envelope}");
    let mut box_question = delivery("plan.plan");
    box_question["contains"] = json!("drive=[5,30]");
    let outside = client.call("envelope", &box_question);
    assert_eq!(outside["structuredContent"]["exit"], 1, "{outside}");
    let mut problem = delivery("plan.plan");
    problem.as_object_mut().expect("an object").remove("plan");
    let plan = client.call("plan", &problem);
    assert_eq!(plan["structuredContent"]["exit"], 0, "{plan}");
    let limits = client.call("explain", &delivery("plan.plan"));
    let limits = limits["structuredContent"]["text"]
        .as_str()
        .expect("a text");
    assert!(limits.contains("Limiting constraints"), "{limits}");
    let repair = client.call("explain", &delivery("late.plan"));
    let repair = repair["structuredContent"]["text"]
        .as_str()
        .expect("a text");
    assert!(repair.contains("counter-open"), "{repair}");
    client.close();
}

#[test]
fn wrong_messages_and_inputs_are_refused_and_the_server_continues() {
    let mut client = Client::start();
    for (line, code) in [
        ("{", -32700),
        ("[]", -32600),
        ("{\"id\":1}", -32600),
        ("{\"id\":[1],\"method\":\"ping\"}", -32600),
        ("{\"id\":1,\"method\":\"resources/list\"}", -32601),
        ("{\"id\":1,\"method\":\"tools/call\"}", -32602),
        (
            "{\"id\":1,\"method\":\"tools/call\",\"params\":{\"name\":\"check\"}}",
            -32602,
        ),
    ] {
        client.write(line);
        let reply = client.read();
        assert_eq!(reply["error"]["code"], code, "{line}: {reply}");
    }
    for (key, value) in [
        ("time_limit", json!(-1)),
        ("time_limit", json!(1e9)),
        ("plan", json!(3)),
        ("colour", json!("red")),
    ] {
        let mut arguments = delivery("plan.plan");
        arguments[key] = value;
        let reply = client.ask(
            "tools/call",
            &json!({ "name": "check", "arguments": arguments }),
        );
        assert_eq!(reply["error"]["code"], -32602, "{reply}");
    }
    let mut misspelt = delivery("plan.plan");
    misspelt["problem"] = json!(text("problem.pddl").replace("(idle rover)", "(idel rover)"));
    let wrong = client.call("check", &misspelt);
    assert_eq!(wrong["isError"], true, "{wrong}");
    let message = wrong["content"][0]["text"].as_str().expect("a text");
    assert!(message.contains("did you mean `idle`?"), "{message}");
    // The path of an argument is no path of the server.
    let mut path = delivery("plan.plan");
    path["domain"] = json!("/etc/passwd");
    assert_eq!(client.call("check", &path)["isError"], true);
    assert_eq!(client.ask("ping", &json!({}))["result"], json!({}));
    client.close();
}

/// A counter that must reach a million.
const COUNTER: [&str; 2] = [
    "(define (domain count) (:requirements :durative-actions :fluents) (:functions (n))
      (:durative-action step :parameters () :duration (= ?duration 1) :condition ()
        :effect (at end (increase (n) 1))))",
    "(define (problem long) (:domain count) (:init (= (n) 0)) (:goal (>= (n) 1000000)))",
];

#[test]
fn question_ends_at_its_limit_or_when_it_is_cancelled() {
    let mut client = Client::start();
    let arguments = json!({ "domain": COUNTER[0], "problem": COUNTER[1], "time_limit": 0.2 });
    let limited = client.call("plan", &arguments);
    let is_limit = limited["structuredContent"]["exit"] == 3 || limited["isError"] == true;
    assert!(is_limit, "{limited}");
    let arguments = json!({ "domain": COUNTER[0], "problem": COUNTER[1], "time_limit": 600 });
    let id = client.send(
        "tools/call",
        &json!({ "name": "plan", "arguments": arguments }),
    );
    let cancel = json!({
        "jsonrpc": "2.0", "method": "notifications/cancelled", "params": { "requestId": id },
    });
    client.write(&cancel.to_string());
    // A cancelled question has no reply, so the next one belongs to the next request.
    assert_eq!(client.ask("ping", &json!({}))["result"], json!({}));
    client.close();
}
