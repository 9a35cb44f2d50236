//! Panic hook: prints a request for a bug report and exits with code 70.

use std::panic::{self, PanicHookInfo};

use crate::exit::Exit;
use crate::output;

/// Installs a panic hook that asks for a bug report and exits with code 70.
pub(crate) fn install_hook() {
    panic::set_hook(Box::new(|panic| {
        output::print_to_stderr(&message(panic));
        std::process::exit(Exit::Bug as i32);
    }));
}

fn message(panic: &PanicHookInfo<'_>) -> String {
    let payload = panic.payload();
    let what = payload
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no further explanation");
    let place = panic
        .location()
        .map_or_else(String::new, |location| format!(" ({location})"));
    format!(
        "bug: internal error in elbowroom {version}: {what}{place}\n  \
         This is not your fault. Please report it at {repository}/issues\n  \
         with this message, the command line and the files you gave.",
        version = env!("CARGO_PKG_VERSION"),
        repository = env!("CARGO_PKG_REPOSITORY"),
    )
}

#[cfg(test)]
mod tests {
    use std::env;
    use std::process::Command;

    /// Set in the child process, which runs the same test.
    const CHILD: &str = "ELBOWROOM_TEST_PANICS";

    #[test]
    fn a_panic_asks_for_a_report_and_ends_with_70() {
        if env::var_os(CHILD).is_some() {
            super::install_hook();
            panic!("two and two is five");
        }
        let output = Command::new(env::current_exe().unwrap())
            .args(["--exact", "--nocapture"])
            .arg("panic_hook::tests::a_panic_asks_for_a_report_and_ends_with_70")
            .env(CHILD, "1")
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(70), "{stderr}");
        assert!(stderr.contains("two and two is five"), "{stderr}");
        assert!(stderr.contains("Please report it"), "{stderr}");
    }
}
