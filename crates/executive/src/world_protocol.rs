//! Protocol of worlds that are processes: `docs/reference/formats/world-protocol.md`.

mod belief_message;
mod clock_sync;
mod message_parser;
mod pipe_io;

pub use belief_message::belief_message;
pub use message_parser::{Capability, Greeting, Message, MessageParser, hello, is_time};
pub use pipe_io::{LineReader, LineWriter, MAX_ANSWER, MAX_LINE, ReadResult, WriteResult};

use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use crate::clock::Clock;
use crate::messages::io_error_message;

/// Starts a program and connects to its standard input and output. The words of `command` are the program and its
/// arguments.
///
/// # Errors
/// When the program cannot be started; the error is a message.
pub fn launch(command: &str) -> Result<(Child, LineWriter, LineReader), String> {
    let mut words = command.split_whitespace();
    let name = words.next().ok_or("the command is empty")?;
    let mut program = Command::new(name);
    program
        .args(words)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped());
    // Ctrl-C is sent to this program only, which then stops the child in order.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut program, 0);
    let mut child = program.spawn().map_err(|error| no_program(name, &error))?;
    match (child.stdin.take(), child.stdout.take()) {
        (Some(stdin), Some(stdout)) => Ok((child, LineWriter::new(stdin), LineReader::new(stdout))),
        _ => Err("its standard input and output are missing".to_owned()),
    }
}

/// Checks that there is such a program, without starting it.
///
/// # Errors
/// When there is none; the error is a message.
pub fn find_program(command: &str) -> Result<(), String> {
    let name = command
        .split_whitespace()
        .next()
        .ok_or("the command is empty")?;
    // On other systems, file names of programs have suffixes that the command omits.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let look = |path: &Path| {
            let found = std::fs::metadata(path)?;
            if found.is_file() && found.permissions().mode() & 0o111 != 0 {
                return Ok(());
            }
            Err(io::Error::from(io::ErrorKind::PermissionDenied))
        };
        let found = if name.contains('/') {
            look(Path::new(name))
        } else {
            let none = Err(io::Error::from(io::ErrorKind::NotFound));
            std::env::var_os("PATH").map_or(Ok(()), |folders| {
                std::env::split_paths(&folders)
                    .map(|folder| look(&folder.join(name)))
                    .find(Result::is_ok)
                    .unwrap_or(none)
            })
        };
        found.map_err(|error| no_program(name, &error))?;
    }
    #[cfg(not(unix))]
    let _ = name;
    Ok(())
}

/// Returns the message for a program that cannot be started. The system reports a folder as a missing permission.
fn no_program(name: &str, error: &io::Error) -> String {
    let path = Path::new(name);
    if path.is_dir() && path.components().count() > 1 {
        return format!("`{name}` is a folder, not a program");
    }
    match error.kind() {
        io::ErrorKind::PermissionDenied if path.is_file() => {
            format!("`{name}` is not executable; `chmod +x` makes a script executable")
        }
        io::ErrorKind::NotFound if path.components().count() > 1 => {
            "there is no such file; paths are relative to the current folder".to_owned()
        }
        io::ErrorKind::NotFound => {
            format!("there is no program `{name}` on the search path (PATH)")
        }
        _ => io_error_message(error),
    }
}

/// Waits for a program to exit. Returns its status, or `None` if it still runs after `timeout`.
pub fn wait_for_exit(child: &mut Child, timeout: Duration) -> Option<ExitStatus> {
    let clock = Clock::start();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if clock.elapsed() < timeout => {
                std::thread::sleep(Duration::from_millis(20));
            }
            _ => return None,
        }
    }
}
