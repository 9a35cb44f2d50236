//! Outcome of a planner's run.

use std::fmt;
use std::time::Duration;

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;

use super::supervise::Ending;

/// A plan that the validator has accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The plan, in terms of the given task. In mid-execution its first steps continue the running
    /// actions.
    pub plan: TimeTriggeredPlan,
    /// The end time of its last action.
    pub makespan: Rational,
    /// The value of the problem's metric, if it has one that can be evaluated.
    pub metric: Option<Rational>,
    /// The validator's objection to the planner's own times, if they had to be repaired.
    pub repaired: Option<String>,
}

/// An event while a planner runs.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// It is still running.
    Running {
        /// The time since its start.
        elapsed: Duration,
        /// Memory in use, in bytes; 0 if it cannot be measured.
        memory: u64,
    },
    /// It printed a plan that the validator accepts.
    Plan {
        /// The plan.
        found: &'a Found,
        /// The time.
        elapsed: Duration,
    },
    /// It printed a plan that the validator rejects, or an unreadable one.
    Refused {
        /// The reason.
        reason: &'a str,
        /// The time.
        elapsed: Duration,
    },
}

/// The outcome of a planner's run. Only the first kind is a plan.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The last plan that the validator accepted.
    Plan(Found),
    /// The planner claims that there is no plan. The claim is not verified.
    Unsolvable {
        /// Its message.
        says: String,
    },
    /// No plan before the time limit.
    NoneInTime,
    /// No plan before the run was stopped on request.
    Stopped,
    /// The planner ended without a plan, with a message about it.
    GaveUp {
        /// Its message.
        says: String,
    },
    /// The planner reports that it does not support the problem.
    Unsupported {
        /// Its message.
        says: String,
    },
    /// A signal ended the planner, or a child of it according to its exit code.
    Crashed {
        /// The signal's number.
        signal: i32,
        /// The end of its output.
        excerpt: String,
    },
    /// The planner exceeded its memory limit.
    OutOfMemory {
        /// The largest measured memory use, in bytes.
        peak: u64,
    },
    /// The planner ended without a plan, for an unknown reason.
    NotUnderstood {
        /// Its exit code.
        code: i32,
        /// The end of its output.
        excerpt: String,
    },
    /// There is no such program, it cannot be started, or the situation cannot be expressed in its
    /// input.
    NotStarted {
        /// The reason.
        reason: String,
        /// Advice.
        help: String,
    },
    /// All printed plans were rejected. This is the last of them.
    Refused {
        /// The validator's objection, or the reason why the plan is unreadable.
        reason: String,
        /// The plan as printed.
        plan: String,
    },
}

impl Outcome {
    /// Returns a keyword for tables and programs.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Plan(_) => "plan",
            Self::Unsolvable { .. } => "unsolvable",
            Self::NoneInTime => "none in time",
            Self::Stopped => "stopped",
            Self::GaveUp { .. } => "gave up",
            Self::Unsupported { .. } => "unsupported",
            Self::Crashed { .. } => "crashed",
            Self::OutOfMemory { .. } => "out of memory",
            Self::NotUnderstood { .. } => "not understood",
            Self::NotStarted { .. } => "not started",
            Self::Refused { .. } => "refused",
        }
    }

    /// Returns the plan, if there is one.
    pub fn found(&self) -> Option<&Found> {
        match self {
            Self::Plan(found) => Some(found),
            _ => None,
        }
    }
}

/// Formats the outcome as one sentence, without excerpts and plans.
impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plan(found) => write!(f, "a plan that ends at {}", found.makespan),
            Self::Unsolvable { says } => write!(f, "it reports that no plan exists: {says}"),
            Self::NoneInTime => f.write_str("no plan within the time limit"),
            Self::Stopped => f.write_str("no plan before it was stopped"),
            Self::GaveUp { says } => write!(f, "it found no plan: {says}"),
            Self::Unsupported { says } => write!(f, "it does not support this problem: {says}"),
            Self::Crashed { signal, .. } => write!(f, "it crashed ({})", signal_name(*signal)),
            Self::OutOfMemory { peak: 0 } => f.write_str("it ran out of memory"),
            Self::OutOfMemory { peak } => {
                write!(f, "it ran out of memory (it used {} MB)", peak >> 20)
            }
            Self::NotUnderstood { code, .. } => write!(
                f,
                "it ended with exit code {code}, without a plan and without a reason"
            ),
            Self::NotStarted { reason, .. } => write!(f, "it cannot be started: {reason}"),
            Self::Refused { reason, .. } => write!(f, "its plan is not valid: {reason}"),
        }
    }
}

/// Returns the name of a signal.
pub(super) fn signal_name(signal: i32) -> String {
    #[cfg(unix)]
    {
        use rustix::process::Signal;
        let known = [
            (Signal::HUP, "SIGHUP"),
            (Signal::INT, "SIGINT"),
            (Signal::QUIT, "SIGQUIT"),
            (Signal::ILL, "SIGILL"),
            (Signal::TRAP, "SIGTRAP"),
            (Signal::ABORT, "SIGABRT"),
            (Signal::BUS, "SIGBUS"),
            (Signal::FPE, "SIGFPE"),
            (
                Signal::KILL,
                "SIGKILL, perhaps by the system for lack of memory",
            ),
            (Signal::SEGV, "SIGSEGV"),
            (Signal::PIPE, "SIGPIPE"),
            (Signal::TERM, "SIGTERM"),
            (Signal::XCPU, "SIGXCPU"),
            (Signal::XFSZ, "SIGXFSZ, a file of more than 2 GB"),
        ];
        let name = known.iter().find(|(known, _)| known.as_raw() == signal);
        if let Some((_, name)) = name {
            return (*name).to_owned();
        }
    }
    format!("signal {signal}")
}

/// The outcome of a planner's run, with statistics.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The outcome.
    pub outcome: Outcome,
    /// The statistics.
    pub statistics: Statistics,
}

/// Statistics of a planner's run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Time from the start of the process to its end.
    pub elapsed: Duration,
    /// The time at which the first plan was accepted.
    pub first_plan: Option<Duration>,
    /// The number of plans accepted.
    pub plans: usize,
    /// The number of plans that were refused or could not be read.
    pub refused: usize,
    /// The measured processor time of all its processes together; Linux only.
    pub work: Duration,
    /// The largest measured memory use of all its processes together, in bytes.
    pub peak_memory: u64,
    /// The number of bytes printed.
    pub printed: u64,
    /// The end of the process; `None` if it was not started.
    pub ending: Option<Ending>,
}
