//! The validator: decides whether a time-triggered plan is valid, and reports the first violation.
//!
//! The definition is PDDL 2.1's (Fox & Long 2003), with timed initial literals and fluents, derived
//! facts, and continuous effects whose values are polynomials in time. All arithmetic is exact. The
//! module shares no code with networks, encodings or solvers, so it can check every claim that the
//! rest of the project makes about a plan.
//!
//! - All happenings at one time form a *group*. The conditions of its happenings, the guards of
//!   conditional effects and the values of effects read the same state: the one on arrival, after
//!   continuous change and before any effect of the group. Deletions come before additions.
//! - Over-all conditions hold at every moment strictly between start and end. At the time of a
//!   happening group in between, the state after the group counts.
//! - Happenings that interfere ([`Footprint`](crate::Footprint)) are at least [`Task::epsilon`]
//!   apart. This includes timed initials, but two of these may be closer to each other.
//! - Trajectory constraints ([`Modal`](crate::Modal)) are evaluated at the end of the plan. The
//!   state at a moment is the one after all happenings of the moment; the initial state counts as
//!   well.
//! - Processes and events (PDDL+) happen without actions of the plan. An event happens as soon as
//!   its condition holds: after the group, or the event, that makes it true, and before the group
//!   at that time. A process is active whenever its condition holds. An event happens once at a
//!   moment.
//! - Preferences never make a plan invalid; [`Report::preferences`] lists those it violates.
//! - The goal holds at the end: after the last happening of the plan's actions, and after all timed
//!   initials, unless [`Settings::counts_later_timed`] is `false`.
//!
//! An undefined part of a condition (it reads a fluent without a value, or divides by zero) is a
//! violation, unless the other parts decide the condition.
//!
//! ```
//! use elbowroom_model::validate::{Settings, Verdict, validate};
//! use elbowroom_model::{Problem, Task, TimeTriggeredPlan};
//!
//! let task = Task::new(Problem::default());
//! match validate(&task, &TimeTriggeredPlan::default(), &Settings::default()) {
//!     Verdict::Valid(report) => assert_eq!(report.makespan.to_string(), "0"),
//!     Verdict::Invalid(violation) => println!("invalid: {violation}"),
//!     Verdict::Undecided(undecided) => println!("cannot tell: {undecided}"),
//! }
//! ```

mod abort;
mod autonomous;
mod constraint_monitor;
mod display;
mod effects;
mod evaluate;
mod execution;
mod explain;
mod instant;
mod interference;
mod judge;
mod margin;
mod metric;
mod polynomial;
mod preferences;
mod segment;
mod sign_cells;
mod state;
mod timeline;
mod trajectory;
mod violation;

use std::cell::OnceCell;
use std::collections::BTreeMap;

use elbowroom_num::Rational;

pub use execution::{Execution, MeasuredAmount};
pub use margin::Margin;
pub use preferences::{Preferences, ViolatedPreference};
pub use violation::{
    ActionInstance, ConditionTime, Occurrence, Point, Reason, Undecided, UndecidedReason,
    Violation, ViolationKind,
};

use crate::ground::{Body, Condition};
use crate::plan::TimeTriggeredPlan;
use crate::problem::Comparison;
use crate::situation::Situation;
use crate::state::State;
use crate::task::Task;

/// Settings of the validator.
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a rule of its own, on or off"
)]
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// `true` if interfering happenings must be [`Task::epsilon`] apart. Otherwise, they only must
    /// not be in the same group, as in VAL.
    pub needs_separation: bool,
    /// VAL's `-t`. Happenings no more than a tenth of it after the first of their group belong to
    /// that group, and happen at its time; durations may miss their bounds by it, strict bounds
    /// excepted.
    pub tolerance: Rational,
    /// Tolerance of numeric comparisons in conditions of one moment. Strict comparisons fail at exactly
    /// the slack. Under `not` it makes the condition harder to satisfy. Over-all conditions have no
    /// slack. VAL uses 0.0001 for each `-t`.
    pub slack: Rational,
    /// `true` if timed initials after the last happening of the plan's actions count, so that the
    /// goal has to hold after all of them. This is the usual meaning (VAL, unified-planning and
    /// Tamer agree), and networks, envelopes, planner and executors rely on it. Otherwise, the goal
    /// is read after the last happening of the plan's actions.
    pub counts_later_timed: bool,
    /// Allows simultaneous happenings to change facts and numbers that other happenings of the same
    /// time read. All conditions read the state before these happenings.
    /// [`refuses_equal_writes`](Self::refuses_equal_writes) rejects contradictory writes. This is
    /// the rule of unified-planning for problems without an ε.
    pub allows_simultaneous_reads: bool,
    /// Rejects plans in which two steps, or a step and a timed initial, write the same fact at the
    /// same time, even the same value. This is the rule of unified-planning; PDDL 2.1 allows equal
    /// writes.
    pub refuses_equal_writes: bool,
}

impl Default for Settings {
    /// Returns the strictest settings: tolerance 0, interfering happenings ε apart, the goal after
    /// all timed initials.
    fn default() -> Self {
        Self {
            needs_separation: true,
            tolerance: Rational::ZERO,
            slack: Rational::ZERO,
            counts_later_timed: true,
            allows_simultaneous_reads: false,
            refuses_equal_writes: false,
        }
    }
}

impl Settings {
    /// Returns the settings that correspond to VAL's `-t tolerance`.
    pub fn like_val(tolerance: Rational) -> Self {
        Self {
            needs_separation: false,
            tolerance,
            slack: Rational::new(1, 10_000),
            ..Self::default()
        }
    }

    /// Returns the settings of unified-planning for a problem without an ε: simultaneous happenings
    /// read the state before, no separation is needed, and no two steps write the same fact at one
    /// time.
    pub fn like_unified_planning() -> Self {
        Self {
            needs_separation: false,
            allows_simultaneous_reads: true,
            refuses_equal_writes: true,
            ..Self::default()
        }
    }

    /// Returns `true` if a happening at `later` belongs to the group that begins at `first`.
    pub fn counts_as_equal(&self, first: &Rational, later: &Rational) -> bool {
        later - first <= self.group_width()
    }

    /// Returns the largest time between the first and the last happening of a group.
    fn group_width(&self) -> Rational {
        &self.tolerance / Rational::from(10)
    }

    /// Returns `true` if a duration satisfies a bound.
    fn allows(&self, comparison: Comparison, duration: &Rational, bound: &Rational) -> bool {
        let gap = (duration - bound).abs();
        comparison.holds(duration, bound)
            || match comparison {
                Comparison::Less | Comparison::Greater => false,
                _ => gap <= self.tolerance,
            }
    }
}

/// Result of the validation.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The plan is valid.
    Valid(Report),
    /// The plan is invalid; this is the first violation.
    Invalid(Violation),
    /// The validator cannot decide.
    Undecided(Undecided),
}

impl Verdict {
    /// Returns `true` if the plan is valid.
    pub fn is_valid(&self) -> bool {
        matches!(self, Self::Valid(_))
    }

    /// Returns the violation, if the plan is invalid.
    pub fn violation(&self) -> Option<&Violation> {
        match self {
            Self::Invalid(violation) => Some(violation),
            _ => None,
        }
    }
}

/// Final state of a valid plan, and its margins.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Time of the last happening of the plan's actions.
    pub makespan: Rational,
    /// Final state, without derived facts. The goal holds in it.
    pub state: State,
    /// Margins of all comparisons that an action, or the goal, needs by itself (not as part of a
    /// disjunction), sorted by step; the goal's come last.
    pub margins: Vec<Margin>,
    /// Violated preferences.
    pub preferences: Preferences,
}

/// Validates a plan. The plan's actions must have been instantiated from this task.
pub fn validate(task: &Task, plan: &TimeTriggeredPlan, settings: &Settings) -> Verdict {
    make_judge(task, None, plan, settings)
}

/// Validates a plan that continues from `situation`; see [`Situation`] for the form of such a plan.
/// Earlier happenings are not checked.
pub fn validate_from(
    task: &Task,
    situation: &Situation,
    plan: &TimeTriggeredPlan,
    settings: &Settings,
) -> Verdict {
    make_judge(task, Some(situation), plan, settings)
}

fn make_judge(
    task: &Task,
    situation: Option<&Situation>,
    plan: &TimeTriggeredPlan,
    settings: &Settings,
) -> Verdict {
    let running = situation.map_or(0, |situation| situation.running.len());
    // All facts that the preferences mention must be in the table before the rules are read.
    let preferences = preferences::ActionPreferenceMonitor::of(task, plan, running);
    let Some(derivation) = task.derivation() else {
        return Verdict::Undecided(Undecided {
            time: None,
            reason: UndecidedReason::Unstratified,
        });
    };
    if let Some(violation) = malformed_step(situation, plan) {
        return Verdict::Invalid(violation);
    }
    let groups = timeline::timeline(task, situation, plan, settings);
    let state = situation.map_or(task.initial(), |situation| &situation.state);
    let is_begun = situation.is_some_and(|situation| *situation != Situation::initial(task));
    let mut constraints = std::sync::Arc::clone(&task.constraints);
    if is_begun && !constraints.is_empty() && !constraints.ignores_past {
        std::sync::Arc::make_mut(&mut constraints).depends_on_unknown_past = true;
    }
    let mut judge = judge::Judge {
        task,
        plan,
        settings,
        derivation,
        now: state::BasicState::of(task, state),
        derived: OnceCell::new(),
        running: situation.map_or_else(BTreeMap::new, judge::running),
        last_changes: BTreeMap::new(),
        margins: margin::Margins::default(),
        trajectory: (!constraints.is_empty())
            .then(|| trajectory::TrajectoryMonitor::new(&constraints)),
        preferences,
        event_history: autonomous::EventHistory::of(task),
    };
    let from = situation.map(|situation| &situation.time);
    match judge.run(from, &groups) {
        Ok(()) => Verdict::Valid(Report {
            makespan: plan.makespan(),
            state: judge.now.to_state(),
            preferences: judge.preferences_of(&groups),
            margins: margins(task, plan, judge.margins),
        }),
        Err(abort::Abort::Violation(violation)) => Verdict::Invalid(*violation),
        Err(abort::Abort::Undecided(undecided)) => Verdict::Undecided(*undecided),
    }
}

/// Returns the first step with invalid times, or that does not continue the running action.
fn malformed_step(situation: Option<&Situation>, plan: &TimeTriggeredPlan) -> Option<Violation> {
    let running = situation.map_or(&[][..], |situation| &situation.running);
    let earliest = situation.map_or(Rational::ZERO, |situation| situation.time.clone());
    if let Some(missing) = running.get(plan.steps.len()) {
        return Some(Violation {
            time: earliest,
            action: None,
            kind: ViolationKind::Abandoned(missing.action.name.clone()),
        });
    }
    plan.steps.iter().enumerate().find_map(|(position, step)| {
        let continued = running.get(position);
        let mistake = match (&step.action.body, &step.duration) {
            _ if continued.is_some_and(|running| !running.is_continued_by(step)) => {
                ViolationKind::Abandoned(running[position].action.name.clone())
            }
            _ if continued.is_none() && step.start < earliest => {
                ViolationKind::TooEarly(earliest.clone())
            }
            (Body::Durative(_), None) => ViolationKind::NoDuration,
            (Body::Durative(_), Some(duration)) if duration.is_negative() => {
                ViolationKind::NegativeDuration(duration.clone())
            }
            (_, Some(duration))
                if continued.is_some_and(|running| !running.can_last(duration, &earliest)) =>
            {
                ViolationKind::Elapsed {
                    duration: duration.clone(),
                    possible: running[position].duration.clone(),
                    now: earliest.clone(),
                }
            }
            _ => return None,
        };
        Some(Violation {
            time: step.start.clone(),
            action: Some(ActionInstance::of(plan, position)),
            kind: mistake,
        })
    })
}

fn margins(task: &Task, plan: &TimeTriggeredPlan, margins: margin::Margins) -> Vec<Margin> {
    let (goal, steps): (Vec<_>, Vec<_>) = margins
        .into_entries()
        .partition(|((step, _, _), _)| step.is_none());
    let mut listed = Vec::new();
    for ((step, when, index), (margin, time)) in steps.into_iter().chain(goal) {
        let condition = match step {
            None => task.goal(),
            Some(position) => match condition_of(&plan.steps[position].action.body, when) {
                Some(condition) => condition,
                None => continue,
            },
        };
        let conjunct = condition.conjuncts()[index];
        listed.push(Margin {
            action: step.map(|position| ActionInstance::of(plan, position)),
            when,
            condition: task.describe_condition(conjunct),
            margin,
            time,
            is_strict: margin::Demand::of(conjunct).is_some_and(|demand| demand.is_strict),
        });
    }
    listed
}

fn condition_of(body: &Body, when: ConditionTime) -> Option<&Condition> {
    match (body, when) {
        (Body::Instantaneous(snap), ConditionTime::Now) => Some(&snap.condition),
        (Body::Durative(body), ConditionTime::Start) => Some(&body.start.condition),
        (Body::Durative(body), ConditionTime::OverAll) => Some(&body.over_all),
        (Body::Durative(body), ConditionTime::End) => Some(&body.end.condition),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
