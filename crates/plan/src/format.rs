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
use elbowroom_text::{Diagnostics, Source};

pub(crate) use syntax::{Limit, limit};
pub(crate) use tokens::{Token, tokens};
pub use write::{WriteError, write};

use crate::parameter::ParametrizedPlan;

/// Reads an STN plan file: a text, or any bytes, which must be UTF-8 outside of comments.
///
/// # Errors
/// All mistakes found, those of syntax and those of names that the task does not know. And when the
/// problem has what the boxes of networks do not respect ([`Task::beyond_boxes`]).
pub fn read(source: impl Into<Source>, task: &Task) -> Result<ParametrizedPlan, Diagnostics> {
    let source = source.into();
    let (file, mut mistakes) = syntax::parse(&source);
    if let Some(feature) = task.beyond_boxes() {
        let message = format!("networks do not respect {feature} yet, which the problem has");
        mistakes.error(0..0, message);
    }
    let plan = resolve::resolve(&file, task, &mut mistakes);
    // A reader that gives up has noted why.
    mistakes.finish(plan).map(|(plan, _warnings)| plan)
}

/// `(did you mean …)`, or nothing.
fn did_you_mean(nearest: Option<&str>) -> Option<String> {
    nearest.map(|name| format!("did you mean `{name}`?"))
}

#[cfg(test)]
mod tests;
