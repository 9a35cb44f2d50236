//! The conversation with a program that is a world: `docs/formats/world-protocol.md`.

mod believed;
mod clocks;
mod listener;
mod pipes;

pub(crate) use believed::believed;
pub(crate) use listener::{Ability, Greeting, Listener, Said, hello, is_time};
pub(crate) use pipes::{Ears, Heard, LONGEST_ANSWER, LONGEST_LINE, Mouth, Told};

use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use crate::clock::Clock;
use crate::words::plain;

/// Starts a program, with the words of `command` as its arguments and both of its pipes.
///
/// # Errors
/// In words, when it cannot be started.
pub(crate) fn launch(command: &str) -> Result<(Child, Mouth, Ears), String> {
    let mut words = command.split_whitespace();
    let name = words.next().ok_or("the command is empty")?;
    let mut program = Command::new(name);
    program
        .args(words)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped());
    // Ctrl-C is for this program, which then ends that one in order.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut program, 0);
    let mut child = program.spawn().map_err(|error| no_program(name, &error))?;
    match (child.stdin.take(), child.stdout.take()) {
        (Some(stdin), Some(stdout)) => Ok((child, Mouth::new(stdin), Ears::new(stdout))),
        _ => Err("its standard input and output are not there".to_owned()),
    }
}

/// Whether there is such a program, as far as that can be said without starting it.
///
/// # Errors
/// In words, when there is none.
pub(crate) fn find(command: &str) -> Result<(), String> {
    let name = command
        .split_whitespace()
        .next()
        .ok_or("the command is empty")?;
    // Elsewhere, names of programs have endings that are not said.
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

/// Why this is no program that can be started: of a folder, the system only says that it is forbidden.
fn no_program(name: &str, error: &io::Error) -> String {
    let path = Path::new(name);
    if path.is_dir() && path.components().count() > 1 {
        return format!("`{name}` is a folder, not a program");
    }
    match error.kind() {
        io::ErrorKind::PermissionDenied if path.is_file() => {
            format!("you may not execute `{name}`; `chmod +x` makes a script a program")
        }
        _ => plain(error),
    }
}

/// How a program has ended, if it does so within `patience`.
pub(crate) fn ended(child: &mut Child, patience: Duration) -> Option<ExitStatus> {
    let clock = Clock::start();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if clock.elapsed() < patience => {
                std::thread::sleep(Duration::from_millis(20));
            }
            _ => return None,
        }
    }
}
