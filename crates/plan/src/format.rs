//! STN plan files (`.stn`): [`read()`] and [`write()`].
//!
//! One item, ended by `;`, is a parameter, an action instance or a constraint; a `#` begins a
//! comment. The order of items is free.
//!
//! ```text
//! parameter dur_1 weight 1 default 112 lb 0 ub 500;      # all four are optional
//! durative-action instance n0 : (do_hover auv wp1 wp2);
//! action instance r : (refuel gen tank1);
//! c: n0.end - n0.start in [dur_1, dur_1];
//! c: r - .zero in [0.001, inf];                          # decimals, p/q, a parameter, inf, -inf
//! ```
//!
//! Time points are `.zero`, `LABEL.start`, `LABEL.end`, and `LABEL` for instantaneous actions.
//! Names of actions and objects compare without case, labels and parameters with it.
//!
//! What a parameter stands for follows from its use. As both bounds of `X.end - X.start` it is
//! the duration of `X`, which the domain's duration constraints then no longer bind. Named like
//! one of the domain's `:synth-parameters` (`?s`), or like an action's for one of its instances
//! (`n0.?r`), it is that number. Anything else is a bound between two time points.
//!
//! Without `default`, the nominal value of a duration is what the domain fixes it to, if it does;
//! that of a bound is what the difference is in the earliest schedule. Open numbers of the domain
//! need a `default`.
//!
//! Without `lb` and `ub`, durations and open numbers keep their sign, and other bounds have no
//! limits.

mod nominal;
mod parameters;
mod resolve;
mod syntax;
mod tokens;
mod write;

use elbowroom_model::Task;

pub(crate) use syntax::{Limit, limit};
pub(crate) use tokens::{Token, tokens};
pub use write::{WriteError, write};

use crate::parameter::ParametrizedPlan;

/// One mistake in an STN plan file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {message}")]
pub struct FormatError {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// How many characters the mistake spans; 0 at the end of the file.
    pub length: usize,
    /// The text of the line around the mistake.
    pub excerpt: String,
    /// What is wrong.
    pub message: String,
    /// What was expected there, or what to do.
    pub expected: Option<String>,
}

/// The mistakes found in an STN plan file, by position. At least one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", listed(.errors))]
pub struct FormatErrors {
    /// Each mistake; the first hundred of them.
    pub errors: Vec<FormatError>,
}

fn listed(errors: &[FormatError]) -> String {
    let mut text = String::new();
    for error in errors {
        if !text.is_empty() {
            text.push('\n');
        }
        text.push_str(&error.to_string());
        if let Some(expected) = &error.expected {
            text.push_str(": ");
            text.push_str(expected);
        }
    }
    text
}

/// Reads an STN plan file: any bytes, which must be UTF-8 outside of comments.
///
/// # Errors
/// All mistakes found, those of syntax and those of names that the task does not know.
pub fn read(bytes: &[u8], task: &mut Task) -> Result<ParametrizedPlan, FormatErrors> {
    let text = String::from_utf8_lossy(bytes);
    let (file, mut mistakes) = syntax::parse(&text);
    let plan = resolve::resolve(&file, task, &mut mistakes);
    match plan {
        Some(plan) if mistakes.is_empty() => Ok(plan),
        _ => Err(FormatErrors {
            errors: mistakes.located(&text),
        }),
    }
}

/// `(did you mean …)`, or nothing.
fn did_you_mean(nearest: Option<&str>) -> Option<String> {
    nearest.map(|name| format!("did you mean `{name}`?"))
}

#[cfg(test)]
mod tests;
