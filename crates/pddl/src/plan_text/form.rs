//! Notations of plans, by tool.

/// The notation of one action of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Form {
    /// `0.000: (name argument …) [10.000]`, the notation of the planning competitions.
    Ipc,
    /// `0.001 (name argument …) 10`: columns without a colon, or a duration without brackets.
    PlanSys2,
    /// `0.0: name(argument, …) [10.0]`
    UnifiedPlanning,
    /// `0.0: name argument … [10.0]`
    Words,
    /// `step 0: NAME ARGUMENT …`, then `1: NAME ARGUMENT …`: the numbers are not times.
    Ff,
    /// `0||0 --- NAME ARGUMENT … --- SON: 1||0`: level and node of a tree.
    ContingentFf,
    /// `name argument … (1)`: the number is the cost.
    FastDownward,
    /// `0.000: start (name argument …) #1`
    Start,
    /// `10.000: end (name argument …) #1`
    End,
}

impl Form {
    /// Returns the tool that uses this notation, and how it is read, or `None` for the usual
    /// notation.
    pub(super) fn note(self) -> Option<&'static str> {
        Some(match self {
            Self::Ipc => return None,
            Self::PlanSys2 => {
                "read as a plan from the terminal of PlanSys2: time, action, duration"
            }
            Self::UnifiedPlanning => {
                "read as a plan of unified-planning: `time: action(argument, …) [duration]`"
            }
            Self::Words => {
                "read as a plan of Aries, without parentheses: `time: action argument … [duration]`"
            }
            Self::Ff => {
                "read as the steps of FF: the numbers are not times, each action starts when the \
                 one before it has ended"
            }
            Self::ContingentFf => {
                "read as the steps of Contingent-FF: each action starts when the one before it has ended"
            }
            Self::FastDownward => {
                "read as the steps of Fast Downward: `action argument … (cost)`, each action starts \
                 when the one before it has ended"
            }
            Self::Start | Self::End => {
                "read as happenings of vscode-pddl: an action lasts from its `start` to its `end`"
            }
        })
    }

    /// Returns `true` for the notation of one end of an action.
    pub(super) fn is_happening(self) -> bool {
        matches!(self, Self::Start | Self::End)
    }

    /// Returns `true` if the position in the text determines an action's time, not the number
    /// before it.
    pub(super) fn is_sequential(self) -> bool {
        matches!(self, Self::Ff | Self::ContingentFf | Self::FastDownward)
    }
}
