//! Validation of a plan by VAL.

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use elbowroom::model::TimeTriggeredPlan;

/// Runs `Validate` on a plan with a tolerance of a thousandth and a time limit of a minute. Returns
/// `valid`, `failed`, or `error` if there is no verdict. `docs/research/val-agreement.md` explains the
/// meaning of the tolerance.
pub(crate) fn verdict(
    program: &Path,
    domain: &Path,
    problem: &Path,
    plan: &TimeTriggeredPlan,
) -> String {
    // VAL does not read fractions.
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
