//! Settings, progress reports and answers of the planner.

use std::collections::BTreeSet;

use elbowroom_model::validate::Report;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::compile::Unsupported;
use super::tuning::Tuning;

/// Settings of the planner.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Approximate memory limit for the searches, in bytes. When it is reached, the search that
    /// uses most is abandoned and the others continue. When none is left, the run ends as if it had
    /// been interrupted.
    pub max_memory: usize,
    /// `true` to stop at the first plan. Otherwise the search continues with better plans until it
    /// is interrupted or no better plan exists.
    pub first_plan_only: bool,
    /// The objective that compares plans.
    pub objective: Objective,
    /// The names of ground actions, `(drive rover depot shelf)`, that plans must not contain.
    /// Proofs then hold for plans without these actions only.
    pub without: BTreeSet<String>,
    /// `true` if a ground action may overlap itself: two of its instances each start before the other one has
    /// ended.
    pub self_overlap: bool,
    /// Maximum number of threads. The answer and the reports do not depend on it. More than two are
    /// useful only before the first plan. WebAssembly has one.
    pub threads: usize,
    /// The constants of the search.
    pub tuning: Tuning,
}

/// The objective that compares plans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Objective {
    /// The problem's metric if it has one that can be evaluated, otherwise the makespan. Plans with
    /// equal metric are compared by makespan.
    #[default]
    Metric,
    /// The makespan, regardless of the problem's metric.
    Makespan,
}

impl Default for Settings {
    /// Returns the defaults: memory 2 GiB, improvement of plans with any action, no self-overlap,
    /// the problem's own metric, one thread.
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
    /// Number of generated and evaluated states.
    pub counts: Counts,
    /// The best plan so far, if this report is about a new best plan.
    pub plan: Option<FoundPlan>,
    /// The objective's value of the best plan so far; smaller is better. Values to be maximized are
    /// negated.
    pub best: Option<Rational>,
}

/// The phase of the search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Phase {
    /// Computing the reachable actions.
    #[default]
    Grounding,
    /// Searching for a first plan with incomplete methods.
    Incomplete,
    /// Searching the complete space.
    Complete,
    /// Searching for better plans.
    Improving,
}

/// Statistics of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of ground actions.
    pub actions: u64,
    /// Number of states whose successors were listed.
    pub expanded: u64,
    /// Number of successors listed.
    pub generated: u64,
    /// Number of states that were generated and evaluated. Includes states generated again for
    /// candidate plans that the validator rejected, or that were no better than the best plan.
    pub evaluated: u64,
    /// The work so far, in the units of [`elbowroom_num::work`].
    pub work: u64,
    /// Approximate memory of the states, in bytes.
    pub memory: usize,
}

impl Counts {
    /// Returns the counts of a search after an earlier one, together with those of the earlier one.
    pub(super) fn after(mut self, earlier: &Self) -> Self {
        self.expanded += earlier.expanded;
        self.generated += earlier.generated;
        self.evaluated += earlier.evaluated;
        self.work += earlier.work;
        self
    }
}

/// A valid plan and its values.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundPlan {
    /// The plan. If it begins in a situation, its first steps continue the running actions.
    pub plan: TimeTriggeredPlan,
    /// The time of its last happening, on the task's clock.
    pub makespan: Rational,
    /// The value of the problem's metric, as the problem states it. `None` if there is no metric
    /// that can be evaluated.
    pub metric: Option<Rational>,
    /// The objective's value; smaller is better. Values to be maximized are negated.
    pub value: Rational,
}

impl FoundPlan {
    /// Creates it from a plan of the task and the validator's report about it.
    pub(super) fn new(
        task: &Task,
        objective: Objective,
        plan: TimeTriggeredPlan,
        verdict: &Report,
    ) -> Self {
        let makespan = verdict.makespan.clone();
        let metric = verdict.metric(task);
        let wanted = task.problem().metric.as_ref();
        let is_maximized = wanted.is_some_and(|metric| metric.maximize);
        let value = match (&metric, objective) {
            (Some(metric), Objective::Metric) if is_maximized => -metric,
            (Some(metric), Objective::Metric) => metric.clone(),
            _ => makespan.clone(),
        };
        Self {
            plan,
            makespan,
            metric,
            value,
        }
    }
}

/// The answer to a planning problem.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// A plan that the validator has accepted.
    Plan {
        /// The best plan found.
        found: FoundPlan,
        /// Reason for the end of the search.
        stopped: Stopped,
        /// Statistics.
        counts: Counts,
    },
    /// The search proved that no plan exists; for [`Proof::WithoutSelfOverlap`], that none exists
    /// without self-overlap. Front ends report this only with a certificate of `elbowroom-verify`.
    Unsolvable {
        /// The reason.
        proof: Proof,
        /// Statistics.
        counts: Counts,
    },
    /// No plan was found, and nothing was proved.
    NoneFound {
        /// Reason for the end of the search.
        stopped: Stopped,
        /// `true` if plans with self-overlap were excluded.
        without_self_overlap: bool,
        /// Statistics.
        counts: Counts,
    },
    /// The problem uses a feature that this planner does not support.
    Unsupported(Unsupported),
}

impl Answer {
    /// Returns the statistics, or `None` if there was no search.
    pub fn counts(&self) -> Option<&Counts> {
        match self {
            Self::Plan { counts, .. }
            | Self::Unsolvable { counts, .. }
            | Self::NoneFound { counts, .. } => Some(counts),
            Self::Unsupported(_) => None,
        }
    }

    /// Returns the plan, if one was found.
    pub fn found(&self) -> Option<&FoundPlan> {
        match self {
            Self::Plan { found, .. } => Some(found),
            _ => None,
        }
    }
}

/// Reason for the end of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped {
    /// The observer ended the search, for example because of a time limit.
    Interrupted,
    /// [`Settings::max_memory`] is exhausted, or there are too many ground actions.
    OutOfMemory,
    /// Only the first plan was requested.
    FirstPlan,
    /// The search space is exhausted. If there is neither a plan nor a proof, the search could not
    /// reach some plans.
    Exhausted,
}

/// Reason why no plan exists.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Proof {
    /// A conjunct of the goal cannot become true even if reached facts are never lost.
    #[error("no plan exists: {}", .0.join("; "))]
    Unreachable(Vec<String>),
    /// A conjunct of the goal becomes true too late even if reached facts are never lost and every
    /// happening is as early as possible.
    #[error("no plan exists: {goal} cannot be reached before {deadline}")]
    TooLate {
        /// The parts of the goal.
        goal: String,
        /// The action and its deadline.
        deadline: String,
    },
    /// All orders of happenings were tried.
    #[error("no plan exists: all orders of happenings were searched ({states} states)")]
    Exhausted {
        /// The number of states.
        states: u64,
    },
    /// All orders of happenings were tried without self-overlap.
    #[error(
        "no plan exists without self-overlap: all orders of happenings were searched ({states} \
         states)"
    )]
    WithoutSelfOverlap {
        /// The number of states.
        states: u64,
    },
}
