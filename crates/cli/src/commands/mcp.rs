//! `elbowroom mcp`: a server of the Model Context Protocol (JSON-RPC 2.0, one message a line).
//!
//! Each question is answered by a process of this program, so that a limit or a cancellation ends it
//! at once, and a crash does not end the server.

mod process;
mod tools;

use std::collections::VecDeque;
use std::io::{self, BufRead as _, BufReader, Read as _};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};

use crate::exit::{Answer, Exit};
use crate::interrupt::Interrupt;
use crate::output;

/// Versions of the protocol, the latest one first.
const VERSIONS: [&str; 3] = ["2025-06-18", "2025-03-26", "2024-11-05"];
/// Maximum length of a message, in bytes.
const MAX_MESSAGE: u64 = 8 << 20;
/// Interval between checks of messages, time limit and Ctrl-C.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Codes of JSON-RPC.
const PARSE_ERROR: i32 = -32700;
const INVALID_REQUEST: i32 = -32600;
const METHOD_NOT_FOUND: i32 = -32601;
const INVALID_PARAMETERS: i32 = -32602;

/// An error of JSON-RPC: code and message.
type Refusal = (i32, String);

/// Answers messages until standard input ends, or Ctrl-C.
pub(crate) fn run() -> Answer {
    let interrupt = Interrupt::listen();
    let mut inbox = Inbox {
        received: receive(),
        postponed: VecDeque::new(),
        interrupt,
    };
    while let Some(message) = inbox.next() {
        if let Some(reply) = reply(&message, &mut inbox) {
            output::print(&format!("{reply}\n"))?;
        }
    }
    Ok(if inbox.interrupt.is_requested() {
        Exit::Interrupted
    } else {
        Exit::Yes
    })
}

/// Reads the lines of standard input in a separate thread. An overlong line is the last one.
fn receive() -> Receiver<Vec<u8>> {
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        let mut input = BufReader::new(io::stdin());
        loop {
            let mut line = Vec::new();
            let read = input
                .by_ref()
                .take(MAX_MESSAGE + 1)
                .read_until(b'\n', &mut line);
            let is_overlong = line.len() as u64 > MAX_MESSAGE;
            if !matches!(read, Ok(length) if length > 0)
                || sender.send(line).is_err()
                || is_overlong
            {
                return;
            }
        }
    });
    receiver
}

/// Messages of the client that were received, and those that wait until a question is answered.
struct Inbox {
    received: Receiver<Vec<u8>>,
    postponed: VecDeque<Vec<u8>>,
    interrupt: Interrupt,
}

impl Inbox {
    /// Waits for the next message. Returns `None` at the end of the input, or after Ctrl-C.
    fn next(&mut self) -> Option<Vec<u8>> {
        if let Some(message) = self.postponed.pop_front() {
            return Some(message);
        }
        while !self.interrupt.is_requested() {
            match self.received.recv_timeout(POLL_INTERVAL) {
                Ok(message) => return Some(message),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        }
        None
    }

    /// Returns `true` if the question must end: its client cancels it, or after Ctrl-C. All other
    /// messages are postponed.
    fn must_end(&mut self, id: &Value) -> bool {
        while let Ok(message) = self.received.try_recv() {
            let is_cancellation = serde_json::from_slice::<Value>(&message).is_ok_and(|message| {
                message["method"] == "notifications/cancelled"
                    && message["params"]["requestId"] == *id
            });
            if is_cancellation {
                return true;
            }
            self.postponed.push_back(message);
        }
        self.interrupt.is_requested()
    }
}

/// Returns the reply to a message, if it needs one.
fn reply(message: &[u8], inbox: &mut Inbox) -> Option<Value> {
    if message.len() as u64 > MAX_MESSAGE {
        let text = format!("the message has more than {} MB", MAX_MESSAGE >> 20);
        return Some(refusal(&Value::Null, &(INVALID_REQUEST, text)));
    }
    if message.trim_ascii().is_empty() {
        return None;
    }
    let message: Value = match serde_json::from_slice(message) {
        Ok(message) => message,
        Err(error) => {
            let text = format!("expected one JSON object a line: {error}");
            return Some(refusal(&Value::Null, &(PARSE_ERROR, text)));
        }
    };
    let id = &message["id"];
    let Some(method) = message["method"].as_str() else {
        // Replies of the client have no method. This server sends no requests.
        let is_reply = message.get("result").or(message.get("error")).is_some();
        let text = "expected an object with `method`".to_owned();
        return (!is_reply).then(|| refusal(id, &(INVALID_REQUEST, text)));
    };
    // Notifications have no `id`, and no reply.
    message.get("id")?;
    if !(id.is_string() || id.is_number()) {
        let text = "`id` is a text or a number".to_owned();
        return Some(refusal(&Value::Null, &(INVALID_REQUEST, text)));
    }
    let result = match method {
        "initialize" => Ok(initialize(&message["params"])),
        "ping" => Ok(json!({})),
        "tools/list" => Ok(json!({ "tools": tools::list() })),
        // A cancelled question gets no reply.
        "tools/call" => tools::call(&message["params"], &mut || inbox.must_end(id)).transpose()?,
        _ => Err((METHOD_NOT_FOUND, format!("there is no method `{method}`"))),
    };
    Some(match result {
        Ok(result) => json!({ "jsonrpc": "2.0", "id": id, "result": result }),
        Err(error) => refusal(id, &error),
    })
}

fn refusal(id: &Value, (code, message): &Refusal) -> Value {
    json!({ "jsonrpc": "2.0", "id": id, "error": { "code": code, "message": message } })
}

fn initialize(parameters: &Value) -> Value {
    let asked = parameters["protocolVersion"].as_str();
    let version = asked.filter(|version| VERSIONS.contains(version));
    json!({
        "protocolVersion": version.unwrap_or(VERSIONS[0]),
        "capabilities": { "tools": {} },
        "serverInfo": { "name": "elbowroom", "version": env!("CARGO_PKG_VERSION") },
        "instructions": "Domain, problem and plan are texts: PDDL 2.1 with durative actions, and plans \
                         with a line `start: (action objects) [duration]` for each action.",
    })
}
