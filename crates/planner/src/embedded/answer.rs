//! What is asked of the planner, and what it answers.

use std::collections::BTreeSet;

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;

use super::compile::Unsupported;
use super::tuning::Tuning;

/// Settings of the planner.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// About how many bytes the searches may keep. When they are used up, the one that has taken the most
    /// gives its up, and the others go on; the run ends, as if it had been interrupted, when none is left.
    pub max_memory: usize,
    /// Whether to stop at the first plan, or to go on for better ones until interrupted or until
    /// there is none.
    pub first_plan_only: bool,
    /// The order of preference among plans.
    pub objective: Objective,
    /// The names of ground actions, `(drive rover depot shelf)`, that plans must do without. What is
    /// proved then is proved of plans without them.
    pub without: BTreeSet<String>,
    /// `true` if a ground action may overlap itself: two of its instances each start before the other one has
    /// ended.
    pub self_overlap: bool,
    /// How many threads may work at the same time. The answer and what is reported are the same
    /// whatever their number. More than two are of use before the first plan only. WebAssembly has one.
    pub threads: usize,
    /// The constants of the search.
    pub tuning: Tuning,
}

/// The objective by which plans are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Objective {
    /// The problem's metric where it has one that can be evaluated, else the makespan. Of plans of
    /// the same metric, the shorter one is better.
    #[default]
    Metric,
    /// The makespan, whatever the problem says.
    Makespan,
}

impl Default for Settings {
    /// Memory 2 GiB, any number of plans with any action, no self-overlap, the problem's own metric, one thread.
    fn default() -> Self {
        Self {
            max_memory: 2 << 30,
            first_plan_only: false,
            objective: Objective::Metric,
            without: BTreeSet::new(),
            self_overlap: false,
            threads: 1,
            tuning: Tuning::default(),
        }
    }
}

/// Progress of the search.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// The phase of the search.
    pub phase: Phase,
    /// States made and looked at.
    pub counts: Counts,
    /// The best plan so far, exactly when this report is about a new best plan.
    pub plan: Option<Found>,
    /// The objective's value of the best plan so far; less is better (what is to be maximized is
    /// negated).
    pub best: Option<Rational>,
}

/// The phase of the search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Phase {
    /// Finding out which actions are possible at all.
    #[default]
    Grounding,
    /// Searching for a first plan, quickly and not everywhere.
    Incomplete,
    /// Searching everywhere.
    Complete,
    /// Looking for better plans.
    Improving,
}

/// Statistics of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Ground actions.
    pub actions: u64,
    /// States whose successors were listed.
    pub expanded: u64,
    /// Successors listed.
    pub generated: u64,
    /// States made and estimated, and states made again for candidates that came to nothing: that the
    /// judge refused, or that were no better than the best plan.
    pub evaluated: u64,
    /// The work so far, in the units of [`elbowroom_num::work`].
    pub work: u64,
    /// About how many bytes the states take.
    pub memory: usize,
}

/// A valid plan, and what it is worth.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The plan. From a situation, its first steps continue what is under way.
    pub plan: TimeTriggeredPlan,
    /// The time of its last happening, on the task's clock.
    pub makespan: Rational,
    /// The value of the problem's metric, as the problem writes it; `None` if it has none that can
    /// be evaluated.
    pub metric: Option<Rational>,
    /// The objective's value; less is better (what is to be maximized is negated).
    pub value: Rational,
}

/// The answer to a planning problem.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// A plan. The judge has found it valid.
    Plan {
        /// The best plan found.
        found: Found,
        /// Why the search did not go on.
        stopped: Stopped,
        /// Statistics.
        counts: Counts,
    },
    /// No plan exists, as far as the search's own rules go; or, by [`Proof::WithoutSelfOverlap`], none
    /// without self-overlap. Front ends report it only with a certificate of
    /// `elbowroom-verify`.
    Unsolvable {
        /// The reason.
        proof: Proof,
        /// Statistics.
        counts: Counts,
    },
    /// No plan was found, and nothing is proved.
    NoneFound {
        /// Why the search did not go on.
        stopped: Stopped,
        /// `true` if plans were excluded with self-overlap.
        without_self_overlap: bool,
        /// Statistics.
        counts: Counts,
    },
    /// The problem uses something that this planner does not handle.
    Unsupported(Unsupported),
}

impl Answer {
    /// The statistics; `None` where nothing was searched.
    pub fn counts(&self) -> Option<&Counts> {
        match self {
            Self::Plan { counts, .. }
            | Self::Unsolvable { counts, .. }
            | Self::NoneFound { counts, .. } => Some(counts),
            Self::Unsupported(_) => None,
        }
    }

    /// The plan, if one was found.
    pub fn found(&self) -> Option<&Found> {
        match self {
            Self::Plan { found, .. } => Some(found),
            _ => None,
        }
    }
}

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped {
    /// The observer said so: a time limit, or an impatient user.
    Interrupted,
    /// [`Settings::max_memory`] is used up, or there are too many ground actions.
    OutOfMemory,
    /// The first plan was all that was asked for.
    FirstPlan,
    /// All that the search can reach was searched. Without a plan, and without a proof, some plans
    /// were out of its reach.
    Exhausted,
}

/// Why no plan exists.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Proof {
    /// A conjunct of the goal cannot become true even if nothing that was reached is ever lost.
    #[error("no plan exists: {}", .0.join("; "))]
    Unreachable(Vec<String>),
    /// A conjunct of the goal comes too late even if nothing that was reached is ever lost, and
    /// everything is as early as it can be.
    #[error("no plan exists: {goal} cannot be reached before {deadline}")]
    TooLate {
        /// The parts of the goal.
        goal: String,
        /// The action and its deadline.
        deadline: String,
    },
    /// All orders of happenings were tried.
    #[error("no plan exists: every order of happenings was tried, {states} states in all")]
    Exhausted {
        /// The number of states.
        states: u64,
    },
    /// All orders of happenings were tried without self-overlap.
    #[error(
        "no plan exists without self-overlap: every order in which things can happen was tried, {states} states \
         in all"
    )]
    WithoutSelfOverlap {
        /// The number of states.
        states: u64,
    },
}
