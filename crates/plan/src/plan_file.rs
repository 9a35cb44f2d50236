//! The two kinds of plans, and their detection in a text.

use elbowroom_model::TimeTriggeredPlan;

use crate::ParametrizedPlan;

/// A plan of either kind.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyPlan {
    /// Actions with fixed times.
    TimeTriggered(TimeTriggeredPlan),
    /// Action instances and constraints.
    Stn(ParametrizedPlan),
}

impl From<TimeTriggeredPlan> for AnyPlan {
    fn from(plan: TimeTriggeredPlan) -> Self {
        Self::TimeTriggered(plan)
    }
}

impl From<ParametrizedPlan> for AnyPlan {
    fn from(plan: ParametrizedPlan) -> Self {
        Self::Stn(plan)
    }
}

/// The two kinds of plan that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanKind {
    /// Actions with fixed times: `0.000: (drive rover depot shelf) [10.000]`.
    TimeTriggered,
    /// An STN plan file: action instances and constraints.
    Stn,
}

impl PlanKind {
    /// Detects the kind of a plan by its content.
    ///
    /// An STN plan file declares action instances (`durative-action instance n0 : …`); no line of a
    /// planner's output has this form. A text without declarations is a plan with fixed times; the
    /// empty plan is one.
    pub fn of_text(text: &str) -> Self {
        let is_declaration = |line: &str| {
            let mut words = line.split_ascii_whitespace();
            let (first, second) = (words.next(), words.next());
            matches!(first, Some("durative-action" | "action")) && second == Some("instance")
        };
        if text.split(['\n', '\r', ';']).any(is_declaration) {
            Self::Stn
        } else {
            Self::TimeTriggered
        }
    }
}

#[cfg(test)]
mod tests {
    use super::PlanKind;

    #[test]
    fn plan_kind_is_detected_from_content() {
        let kind = PlanKind::of_text;
        assert_eq!(kind("0.0: (go a) [1]\n"), PlanKind::TimeTriggered);
        assert_eq!(kind(""), PlanKind::TimeTriggered);
        assert_eq!(
            kind("; an action instance\n0: (action instance) [1]"),
            PlanKind::TimeTriggered
        );
        assert_eq!(
            kind("# a file\nparameter p;durative-action  instance n0 : (go a);"),
            PlanKind::Stn
        );
        assert_eq!(
            kind("\u{0}\u{fffd}garbage (action instance)"),
            PlanKind::TimeTriggered
        );
    }
}
