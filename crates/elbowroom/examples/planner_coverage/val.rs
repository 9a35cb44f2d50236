//! VAL's word on a plan.

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use elbowroom::model::TimeTriggeredPlan;

/// What `Validate` says of a plan at a tolerance of a thousandth, within a minute: `valid`, `failed`, or `error` where it
/// cannot judge. `docs/val-agreement.md` has what its tolerance means.
pub(crate) fn verdict(
    program: &Path,
    domain: &Path,
    problem: &Path,
    plan: &TimeTriggeredPlan,
) -> String {
    // It reads no fractions.
    let mut text = String::new();
    for step in &plan.steps {
        let _ = write!(text, "{}: {}", step.start.to_decimal(9), step.action.name);
        if let Some(duration) = &step.duration {
            let _ = write!(text, " [{}]", duration.to_decimal(9));
        }
        text.push('\n');
    }
    let asked = || -> std::io::Result<String> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("plan");
        std::fs::write(&file, &text)?;
        let output = Command::new("timeout")
            .arg("60")
            .arg(program)
            .args(["-t", "0.001"])
            .args([domain, problem, &file])
            .stdin(Stdio::null())
            .output()?;
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let Ok(said) = asked() else {
        return "error".to_owned();
    };
    let says = |words: &str| said.contains(words);
    if says("Plan valid") {
        "valid"
    } else if says("Bad plan description") {
        "error"
    } else if says("Failed plans") || says("Plan failed") || says("Goal not satisfied") {
        "failed"
    } else {
        "error"
    }
    .to_owned()
}
