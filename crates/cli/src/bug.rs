//! What happens when this program is wrong.

use std::panic::{self, PanicHookInfo};

use crate::exit::Exit;
use crate::output;

/// From now on a panic ends the program with exit code 70 and asks for a report.
pub(crate) fn install_hook() {
    panic::set_hook(Box::new(|panic| {
        output::tell(&message(panic));
        std::process::exit(Exit::Bug as i32);
    }));
}

fn message(panic: &PanicHookInfo<'_>) -> String {
    let what = panic.payload_as_str().unwrap_or("no further explanation");
    let place = panic
        .location()
        .map_or_else(String::new, |location| format!(" ({location})"));
    format!(
        "bug: elbowroom {version} contradicts itself: {what}{place}\n  \
         This is not your fault. Please report it at {repository}/issues\n  \
         with this message, the command line and the files you gave.",
        version = env!("CARGO_PKG_VERSION"),
        repository = env!("CARGO_PKG_REPOSITORY"),
    )
}
