//! STN plan files (`.stn`): [`read()`] and [`write()`].
//!
//! Each item is a parameter, an action instance or a constraint, and ends with `;`. A `#` begins a
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
//! Names of actions and objects ignore case, labels and parameters do not.
//!
//! The kind of a parameter follows from its use. If it is both bounds of `X.end - X.start`, it is
//! the duration of `X`, and the domain's duration constraints no longer apply. If it has the name
//! of one of the domain's `:synth-parameters` (`?s`), or of an action's for one of its instances
//! (`n0.?r`), it is that number. Any other parameter is a bound between two time points.
//!
//! Without `default`, the nominal value of a duration is the one that the domain fixes, if it does.
//! The nominal value of a bound is the difference in the earliest schedule. Open numbers of the
//! domain need a `default`.
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
/// All mistakes found, in syntax and in names that the task does not have. Also a feature of the
/// problem that the boxes of networks do not support ([`Task::unsupported_by_boxes`]).
pub fn read(source: impl Into<Source>, task: &Task) -> Result<ParametrizedPlan, Diagnostics> {
    let source = source.into();
    let (file, mut mistakes) = syntax::parse(&source);
    if let Some(feature) = task.unsupported_by_boxes() {
        let message = format!("the problem has {feature}, which networks do not support yet");
        mistakes.error(0..0, message);
    }
    let plan = resolve::resolve(&file, task, &mut mistakes);
    // `resolve` records a mistake before it returns `None`.
    mistakes.finish(plan).map(|(plan, _warnings)| plan)
}

/// Returns `did you mean …`, if there is a similar name.
fn did_you_mean(nearest: Option<&str>) -> Option<String> {
    nearest.map(|name| format!("did you mean `{name}`?"))
}

#[cfg(test)]
mod tests;
