//! Malicious clients do not lock out clients with the token, and web pages of other origins cannot
//! send requests. @@ crates/cli/tests/cli/executive/hostile.rs Opens `count` connections over TCP, or
//! over the socket in every fifth case, that send incomplete requests or never read the answer.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;

use serde_json::Value;

use super::client::{Executive, folder};
use super::{DOMAIN, PROBLEM, TOKEN, ctl};

/// Opens `count` connections over TCP, or over the socket in every fifth case, that send incomplete
/// requests or never read the answer.
fn crowd(own: &Executive, count: usize) -> (Vec<TcpStream>, Vec<UnixStream>) {
    let words: [&[u8]; 5] = [
        b"",
        b"GET /v1/st",
        b"GET /v1/events?after=0 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"POST /v1/goals HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\n{",
    ];
    let (mut tcp, mut unix) = (Vec::new(), Vec::new());
    for number in 0..count {
        let said = words[number / 5 % words.len()];
        if number % 5 == 0 {
            let mut stream = UnixStream::connect(own.socket()).expect("it listens");
            let _ = stream.write_all(said);
            unix.push(stream);
        } else {
            let mut stream = TcpStream::connect(own.address()).expect("it listens");
            let _ = stream.write_all(said);
            tcp.push(stream);
        }
    }
    (tcp, unix)
}

#[test]
fn hostile_clients_do_not_block_authorized_client() {
    let mut own = Executive::start(&folder("hostile"), &[DOMAIN, PROBLEM, "--realtime", "1"]);
    own.await_state(|state| state["activity"] == "executing");
    let held = crowd(&own, 500);
    let by_socket = |words: &[&str]| {
        let (socket, token) = (own.socket(), own.token());
        ctl(&[&["--to", &socket, "--token", &token], words].concat())
    };
    for _ in 0..10 {
        assert_eq!(own.post("/v1/pause", &Value::Null).0, 200);
        let more = crowd(&own, 50);
        assert!(by_socket(&["state"]).status.success());
        assert!(by_socket(&["resume"]).status.success());
        drop(more);
    }
    drop(held);
    // Closed connections free their places.
    own.await_state(|state| state["activity"] != "paused");
    let (held, stopped) = (crowd(&own, 500), own.post("/v1/stop", &Value::Null));
    assert_eq!(stopped.0, 200, "{}", stopped.1);
    assert_eq!(own.end().status.code(), Some(0));
    drop(held);
}

/// Returns the status of the answer to these headers.
fn status(own: &Executive, headers: &str) -> u16 {
    let mut stream = TcpStream::connect(own.address()).expect("it listens");
    let request = format!("{headers}\r\n\r\n");
    stream.write_all(request.as_bytes()).expect("it reads");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("it answers");
    let status = answer.split(' ').nth(1).expect("HTTP");
    status.parse().expect("a status")
}

#[test]
fn foreign_origins_and_protocols_are_rejected() {
    let own = Executive::start(&folder("foreign"), &[DOMAIN, PROBLEM, "--realtime", "1"]);
    let (address, get) = (own.address(), "GET /v1/state HTTP/1.1\r\nHost: localhost");
    for (headers, expected) in [
        (get.to_owned(), 200),
        (format!("{get}\r\nOrigin: http://localhost"), 200),
        (format!("{get}\r\nOrigin: http://{address}"), 403),
        (format!("{get}\r\nOrigin: https://example.org"), 403),
        (format!("{get}\r\nOrigin: null"), 403),
        (format!("{get}\r\nSec-Fetch-Site: cross-site"), 403),
        (format!("{get}\r\nSec-Fetch-Site: same-origin"), 200),
        (
            format!("{get}\r\nSec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate"),
            200,
        ),
        (format!("{get}\r\nUpgrade: websocket"), 400),
        (format!("{get}\r\nHost: localhost"), 400),
        (
            format!("{get}\r\nContent-Length: 0\r\nContent-Length: 0"),
            400,
        ),
        (
            format!("{get}\r\nContent-Length: 0\r\nContent-Length: 5"),
            400,
        ),
        (
            format!("{get}\r\nAuthorization: Bearer {TOKEN}\r\nAuthorization: Bearer x"),
            400,
        ),
    ] {
        assert_eq!(status(&own, &headers), expected, "{headers}");
    }
}

#[test]
fn journals_are_readable_by_owner_only() {
    use std::os::unix::fs::PermissionsExt as _;
    if !super::python_is_there() {
        return;
    }
    let place = folder("owner");
    let journal = place.join("journal");
    let name = journal.display().to_string();
    let mut line = super::with_robot(&place, &name);
    line.extend(["--journal-size", "1K"].map(str::to_owned));
    let line: Vec<&str> = line.iter().map(String::as_str).collect();
    let own = Executive::start(&place, &line);
    own.await_state(|state| state["why"] == "reached: problem");
    let files = fs::read_dir(&place)
        .expect("a folder")
        .map(|it| it.expect("a file"));
    let journals = files.filter(|it| it.file_name().to_string_lossy().starts_with("journal"));
    let modes: Vec<u32> = journals
        .map(|it| it.metadata().expect("a file").permissions().mode() & 0o777)
        .collect();
    assert!(
        !modes.is_empty() && modes.iter().all(|mode| *mode == 0o600),
        "{modes:?}"
    );
}

#[test]
fn token_that_others_can_read_is_refused() {
    use std::os::unix::fs::PermissionsExt as _;
    let token = folder("shared-token").join("token");
    fs::write(&token, TOKEN).expect("written");
    let name = token.display().to_string();
    for mode in [0o644, 0o640, 0o602, 0o666] {
        fs::set_permissions(&token, fs::Permissions::from_mode(mode)).expect("allowed");
        for line in [
            &["serve", DOMAIN, PROBLEM, "--http", "0", "--token", &name][..],
            &["ctl", "--token", &name, "stop"],
        ] {
            let done = super::command::elbowroom(line);
            let said = String::from_utf8_lossy(&done.stderr);
            assert_eq!(done.status.code(), Some(2), "{mode:o}: {said}");
            assert!(said.contains("chmod 600"), "{mode:o}: {said}");
        }
    }
}
