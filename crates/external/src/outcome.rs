//! What came of a run.

use std::fmt;
use std::time::Duration;

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;

use super::supervise::Ending;

/// A plan that the judge has accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The plan, in the terms of the task that was given. In mid-execution its first steps
    /// continue what is running.
    pub plan: TimeTriggeredPlan,
    /// The end time of its last action.
    pub makespan: Rational,
    /// The value of the problem's metric, if it has one that can be evaluated.
    pub metric: Option<Rational>,
    /// The judge's objection to the planner's own times, if they had to be repaired.
    pub repaired: Option<String>,
}

/// An event while a planner runs.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// It is still running.
    Running {
        /// The time since its start.
        elapsed: Duration,
        /// How much memory it uses, in bytes; 0 where that cannot be measured.
        memory: u64,
    },
    /// It found a plan that the judge accepts.
    Plan {
        /// The plan.
        found: &'a Found,
        /// The time.
        elapsed: Duration,
    },
    /// It printed a plan that the judge refuses, or that is none.
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
    /// The last plan that the judge accepted.
    Plan(Found),
    /// The planner says that there is no plan. That is its claim, not a proof of ours.
    Unsolvable {
        /// Its words.
        says: String,
    },
    /// No plan before the time limit.
    NoneInTime,
    /// No plan before it was asked to stop.
    Stopped,
    /// The planner ended without a plan, and says so.
    GaveUp {
        /// Its words.
        says: String,
    },
    /// The planner says that the problem is beyond it.
    Unsupported {
        /// Its words.
        says: String,
    },
    /// The planner was ended by a signal, or says that its child was.
    Crashed {
        /// The signal's number.
        signal: i32,
        /// The end of what it printed.
        excerpt: String,
    },
    /// The planner needed more memory than it may have.
    OutOfMemory {
        /// The most memory that it was seen to use, in bytes.
        peak: u64,
    },
    /// The planner ended without a plan, and what it printed does not tell why.
    NotUnderstood {
        /// Its exit code.
        code: i32,
        /// The end of what it printed.
        excerpt: String,
    },
    /// There is no such program, or it cannot be started, or this situation cannot be told to it.
    NotStarted {
        /// The reason.
        reason: String,
        /// Advice.
        help: String,
    },
    /// All plans that it printed were refused; this is about the last of them.
    Refused {
        /// The judge's objection, or the reason why it is no plan.
        reason: String,
        /// The plan as printed.
        plan: String,
    },
}

impl Outcome {
    /// A word for tables and programs.
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

    /// The plan, if there is one.
    pub fn found(&self) -> Option<&Found> {
        match self {
            Self::Plan(found) => Some(found),
            _ => None,
        }
    }
}

/// One sentence; excerpts and plans are left to who has room for them.
impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plan(found) => write!(f, "a plan that ends at {}", found.makespan),
            Self::Unsolvable { says } => write!(f, "it says that there is no plan: {says}"),
            Self::NoneInTime => f.write_str("no plan within the time limit"),
            Self::Stopped => f.write_str("no plan before it was stopped"),
            Self::GaveUp { says } => write!(f, "it found no plan: {says}"),
            Self::Unsupported { says } => write!(f, "it does not take this problem: {says}"),
            Self::Crashed { signal, .. } => write!(f, "it crashed ({})", signal_name(*signal)),
            Self::OutOfMemory { peak: 0 } => f.write_str("it ran out of memory"),
            Self::OutOfMemory { peak } => {
                write!(f, "it ran out of memory (it used {} MB)", peak >> 20)
            }
            Self::NotUnderstood { code, .. } => write!(
                f,
                "it ended with exit code {code} and without a plan, and does not say why"
            ),
            Self::NotStarted { reason, .. } => write!(f, "it cannot be started: {reason}"),
            Self::Refused { reason, .. } => write!(f, "its plan is not valid: {reason}"),
        }
    }
}

/// The name of a signal.
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
    /// How it went.
    pub statistics: Statistics,
}

/// Statistics of a planner's run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// From the start of the process to its end.
    pub elapsed: Duration,
    /// The time at which the first plan was accepted.
    pub first_plan: Option<Duration>,
    /// The number of plans accepted.
    pub plans: usize,
    /// The number of plans that were refused or could not be read.
    pub refused: usize,
    /// The processor time that its processes were seen to use together; Linux only.
    pub work: Duration,
    /// The most memory that its processes were seen to use together, in bytes.
    pub peak_memory: u64,
    /// How many bytes it printed.
    pub printed: u64,
    /// How the process ended; `None` if it was not started.
    pub ending: Option<Ending>,
}
