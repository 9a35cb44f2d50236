//! A running executive, and a client that is independent of the command.

use std::fs;
use std::io::{BufRead as _, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use serde_json::Value;

use crate::command::root;
pub(crate) use crate::robots::folder;

pub(crate) const TOKEN: &str = "a-token-of-some-length";

/// Polling interval. With [`MAX_GLANCES`], polling ends after one minute.
const GLANCE: Duration = Duration::from_millis(20);
const MAX_GLANCES: usize = 3000;

/// Writes the token to a file that only its owner can read, and returns the path.
pub(crate) fn write_token(folder: &Path) -> String {
    let token = folder.join("token");
    fs::write(&token, TOKEN).expect("written");
    let for_owner = fs::Permissions::from_mode(0o600);
    fs::set_permissions(&token, for_owner).expect("allowed");
    token.display().to_string()
}

/// An executive.
pub(crate) struct Executive {
    child: Option<Child>,
    /// Reader of the rest of standard error.
    errors: Option<JoinHandle<String>>,
    folder: PathBuf,
    port: u16,
}

impl Drop for Executive {
    fn drop(&mut self) {
        self.kill();
    }
}

impl Executive {
    /// Starts an executive with token, socket and trace in `folder`.
    pub(crate) fn start(folder: &Path, line: &[&str]) -> Self {
        Self::with_token(folder, line, None)
    }

    /// Starts an executive that cannot write files longer than `kilobytes`.
    pub(crate) fn confined(folder: &Path, line: &[&str], kilobytes: u32) -> Self {
        Self::with_token(folder, line, Some(kilobytes))
    }

    fn with_token(folder: &Path, line: &[&str], most_blocks: Option<u32>) -> Self {
        let token = write_token(folder);
        Self::launch(folder, &[line, &["--token", &token]].concat(), most_blocks)
    }

    pub(crate) fn without_token(folder: &Path, line: &[&str]) -> Self {
        Self::launch(folder, line, None)
    }

    /// Starts a run that ends with its goal and serves its page.
    pub(crate) fn single_run(folder: &Path, line: &[&str]) -> Self {
        Self::spawn(folder, &[&["run", "--serve"], line].concat(), None)
    }

    fn launch(folder: &Path, line: &[&str], most_blocks: Option<u32>) -> Self {
        let file = |name: &str| folder.join(name).display().to_string();
        let (socket, trace) = (file("socket"), file("trace.jsonl"));
        let has_journal = line.iter().any(|it| ["--journal", "--resume"].contains(it));
        let kept = ["--trace", &trace];
        let kept: &[&str] = if has_journal { &[] } else { &kept };
        let serve = ["serve", "--http", "0", "--socket", &socket];
        Self::spawn(folder, &[&serve, line, kept].concat(), most_blocks)
    }

    fn spawn(folder: &Path, line: &[&str], most_blocks: Option<u32>) -> Self {
        let mut command = Command::new("env");
        if let Some(most) = most_blocks {
            // Writing fails without the signal, which would end the program.
            let script = format!("trap '' XFSZ; ulimit -f {most}; exec \"$@\"");
            command.args(["bash", "-c", &script, "bash"]);
        }
        let mut child = command
            .current_dir(root())
            .env("NO_COLOR", "1")
            .arg(env!("CARGO_BIN_EXE_elbowroom"))
            .args(line)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command can be started");
        let mut said = BufReader::new(child.stderr.take().expect("it is piped"));
        let mut text = String::new();
        let port = loop {
            let before = text.len();
            let count = said.read_line(&mut text).expect("UTF-8");
            assert!(count > 0, "it does not listen: {text}");
            let port = text[before..].split("127.0.0.1:").nth(1);
            if let Some(port) = port.and_then(|it| it.split('/').next()) {
                break port.parse().expect("a port");
            }
        };
        // Drains standard error, so that the pipe does not fill up.
        let errors = std::thread::spawn(move || {
            let mut rest = String::new();
            let _ = said.read_to_string(&mut rest);
            rest
        });
        Self {
            child: Some(child),
            errors: Some(errors),
            folder: folder.to_owned(),
            port,
        }
    }

    pub(crate) fn address(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    pub(crate) fn socket(&self) -> String {
        self.folder.join("socket").display().to_string()
    }

    pub(crate) fn token(&self) -> String {
        self.folder.join("token").display().to_string()
    }

    pub(crate) fn kill(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }

    /// Returns the process number.
    pub(crate) fn process(&self) -> u32 {
        self.child.as_ref().expect("it runs").id()
    }

    /// Waits for the end of the process.
    pub(crate) fn end(&mut self) -> Output {
        let mut child = self.child.take().expect("it runs");
        let mut is_over = || child.try_wait().expect("it can be asked").is_some();
        let in_time = (0..MAX_GLANCES).any(|_| {
            std::thread::sleep(GLANCE);
            is_over()
        });
        if !in_time {
            let _ = child.kill();
        }
        let mut output = child.wait_with_output().expect("its output");
        assert!(in_time, "it does not end: {output:?}");
        let errors = self.errors.take().map(|it| it.join().expect("its words"));
        output.stderr = errors.unwrap_or_default().into_bytes();
        output
    }

    pub(crate) fn get(&self, path: &str) -> (u16, Value) {
        self.ask("GET", path, None, "")
    }

    pub(crate) fn get_by_socket(&self, path: &str) -> (u16, Value) {
        let stream = UnixStream::connect(self.socket()).expect("it listens");
        talk(stream, "GET", path, None, "")
    }

    pub(crate) fn post(&self, path: &str, body: &Value) -> (u16, Value) {
        self.ask("POST", path, Some(TOKEN), &body.to_string())
    }

    pub(crate) fn put(&self, path: &str, body: &Value) -> (u16, Value) {
        self.ask("PUT", path, Some(TOKEN), &body.to_string())
    }

    pub(crate) fn delete(&self, path: &str) -> (u16, Value) {
        self.ask("DELETE", path, Some(TOKEN), "")
    }

    pub(crate) fn ask(
        &self,
        verb: &str,
        path: &str,
        token: Option<&str>,
        body: &str,
    ) -> (u16, Value) {
        let stream = TcpStream::connect(self.address()).expect("it listens");
        talk(stream, verb, path, token, body)
    }

    /// The same for an executive that may be killed in the meantime. Returns `None` without an
    /// answer.
    pub(crate) fn ask_if_there(
        &self,
        verb: &str,
        path: &str,
        body: &Value,
    ) -> Option<(u16, Value)> {
        let mut stream = TcpStream::connect(self.address()).ok()?;
        let body = body.to_string();
        let length = body.len();
        let request = format!(
            "{verb} {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {TOKEN}\r\n\
             Content-Length: {length}\r\n\r\n{body}"
        );
        stream.write_all(request.as_bytes()).ok()?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).ok()?;
        let (head, text) = answer.split_once("\r\n\r\n")?;
        let status = head.split(' ').nth(1)?.parse().ok()?;
        Some((status, serde_json::from_str(text).ok()?))
    }

    /// Returns the current response at the address of the page of the run, with its status.
    pub(crate) fn page_now(&self) -> (u16, String) {
        let stream = TcpStream::connect(self.address()).expect("it listens");
        said(stream, "GET", "/run", None, "")
    }

    /// Waits for the page, which exists once the executive has accepted the problem.
    pub(crate) fn page(&self) -> String {
        let mut last = String::new();
        for _ in 0..MAX_GLANCES {
            let (status, text) = self.page_now();
            match status {
                200 => return text,
                409 => last = text,
                _ => panic!("{status}: {text}"),
            }
            std::thread::sleep(GLANCE);
        }
        panic!("there is no page: {last}");
    }

    /// Waits for a state with this property.
    #[track_caller]
    pub(crate) fn await_state(&self, is_so: impl Fn(&Value) -> bool) -> Value {
        let mut last = Value::Null;
        for _ in 0..MAX_GLANCES {
            let (status, state) = self.get("/v1/state");
            if status == 200 && is_so(&state) {
                return state;
            }
            last = state;
            std::thread::sleep(GLANCE);
        }
        panic!("it stays like this: {last}");
    }

    pub(crate) fn trace_lines(&self) -> Vec<Value> {
        let text = fs::read_to_string(self.folder.join("trace.jsonl")).expect("a trace");
        let lines = text.lines().map(serde_json::from_str);
        lines.collect::<Result<_, _>>().expect("JSON")
    }
}

fn talk(
    stream: impl Read + Write,
    verb: &str,
    path: &str,
    token: Option<&str>,
    body: &str,
) -> (u16, Value) {
    let (status, text) = said(stream, verb, path, token, body);
    let value = serde_json::from_str(&text);
    (status, value.unwrap_or_else(|_| Value::String(text)))
}

fn said(
    mut stream: impl Read + Write,
    verb: &str,
    path: &str,
    token: Option<&str>,
    body: &str,
) -> (u16, String) {
    let token = token.map_or(String::new(), |it| {
        format!("Authorization: Bearer {it}\r\n")
    });
    let length = body.len();
    let request = format!(
        "{verb} {path} HTTP/1.1\r\nHost: localhost\r\n{token}Content-Length: {length}\r\n\r\n{body}"
    );
    stream.write_all(request.as_bytes()).expect("it reads");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("it answers");
    let (head, text) = answer.split_once("\r\n\r\n").expect("HTTP");
    let status = head.split(' ').nth(1).expect("HTTP");
    (status.parse().expect("a status"), text.to_owned())
}
