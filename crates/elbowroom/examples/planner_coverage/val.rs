//! VAL's word on a plan.

use std::path::Path;
use std::process::{Command, Stdio};

/// What `Validate` says of a plan at a tolerance of a thousandth, within a minute: `valid`, `failed`, or `error` where it
/// cannot judge. `docs/val-agreement.md` has what its tolerance means.
pub(crate) fn verdict(program: &Path, domain: &Path, problem: &Path, plan: &str) -> String {
    let asked = || -> std::io::Result<String> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("plan");
        std::fs::write(&file, plan)?;
        let output = Command::new("timeout")
            .arg("60")
            .arg(program)
            .args(["-t", "0.001"])
            .args([domain, problem, &file])
            .stdin(Stdio::null())
            .output()?;
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let Ok(text) = asked() else {
        return "error".to_owned();
    };
    let says = |words: &str| text.contains(words);
    if says("Plan valid") {
        "valid"
    } else if says("Failed plans") || says("Plan failed") || says("Goal not satisfied") {
        "failed"
    } else {
        "error"
    }
    .to_owned()
}
