//! Limiting reasons of the ends of intervals, grouped by reason.
//!
//! ```text
//! Limiting constraints
//!   deadline of (counter-open office) at 40
//!     upper bound of d0, d2, d3
//! ```

use elbowroom::answers::envelope::LimitGroup;
use elbowroom::report::console::push_wrapped;

use crate::terminal::{EMPHASIS, SECONDARY, TextLayout, styled};

/// Renders the limits, one reason after the other; empty without limits.
pub(crate) fn render(limits: &[LimitGroup], look: TextLayout) -> String {
    if limits.is_empty() {
        return String::new();
    }
    let mut text = format!("{}\n", styled(EMPHASIS, "Limiting constraints"));
    for limit in limits {
        push_wrapped(&mut text, &limit.reason, 2, look.width);
        for (names, label) in [
            (&limit.lower, "lower bound of"),
            (&limit.upper, "upper bound of"),
        ] {
            if !names.is_empty() {
                let mut line = String::new();
                push_wrapped(
                    &mut line,
                    &format!("{label} {}", names.join(", ")),
                    4,
                    look.width,
                );
                text.push_str(&styled(SECONDARY, line.trim_end()));
                text.push('\n');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use insta::assert_snapshot;

    use super::{LimitGroup, render};
    use crate::terminal::TextLayout;

    #[test]
    fn ends_with_the_same_reason_are_grouped() {
        let limit = |reason: &str, lower: &[&str], upper: &[&str]| LimitGroup {
            reason: reason.to_owned(),
            lower: lower.iter().map(ToString::to_string).collect(),
            upper: upper.iter().map(ToString::to_string).collect(),
        };
        let deadline = "deadline of (counter-open office) at 40: end of (drop rover parcel office) \
                        must come 0.001 before it";
        let limits = [
            limit("a duration is at least 0", &["d0", "d1"], &[]),
            limit(deadline, &[], &["d0", "d1"]),
        ];
        let text = anstream::adapter::strip_str(&render(&limits, TextLayout::PLAIN)).to_string();
        assert_snapshot!(text, @r"
        Limiting constraints
          a duration is at least 0
            lower bound of d0, d1
          deadline of (counter-open office) at 40: end of (drop rover parcel office)
            must come 0.001 before it
            upper bound of d0, d1
        ");
    }
}
