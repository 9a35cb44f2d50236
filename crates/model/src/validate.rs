//! The judge: whether a time-triggered plan is valid, and if not, why not.
//!
//! The definition is PDDL 2.1's (Fox & Long 2003), with timed initial literals and fluents,
//! derived facts, and continuous effects whose values are polynomials in time. All arithmetic is
//! exact. Nothing is shared with networks, encodings or solvers: every claim that the rest of the
//! project makes about a plan can be attacked with this module alone.
//!
//! - All that happens at one time forms a *group*. The conditions of its happenings, the guards
//!   of conditional effects and the values of effects read the same state: the one on arrival,
//!   after continuous change and before any effect of the group. Deletions come before additions.
//! - Over-all conditions hold at every moment strictly between start and end. At the time of a
//!   happening group in between, the state after the group counts.
//! - Happenings that interfere ([`Footprint`](crate::Footprint)) are at least
//!   [`Task::epsilon`] apart. Timed initials take part, but not against each other.
//! - Constraints on the course ([`Modal`](crate::Modal)) are judged when the plan is over, against
//!   the state at each moment: the one after all that happens then, and the initial state before.
//! - Processes and events (PDDL+) need no plan. An event happens as soon as its condition holds:
//!   after the group, or the event, that makes it true, and before the group that happens at that
//!   time; a process is at work whenever its condition holds. An event happens once at a moment.
//! - Preferences never make a plan invalid; [`Report::preferences`] lists those it violates.
//! - The goal holds in the end: after the last happening of the plan's actions, and after all timed
//!   initials, unless [`Settings::counts_later_timed`] says otherwise.
//!
//! A part of a condition that says nothing (it reads a fluent without a value, divides by zero)
//! is a violation, unless the other parts decide whatever it would say.
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

mod autonomous;
mod cells;
mod display;
mod effects;
mod execution;
mod explain;
mod instant;
mod interference;
mod judge;
mod margin;
mod metric;
mod piece;
mod polynomial;
mod preferences;
mod reading;
mod state;
mod stop;
mod timeline;
mod track;
mod trajectory;
mod violation;

use std::cell::OnceCell;
use std::collections::BTreeMap;

use elbowroom_num::Rational;

pub use execution::{Execution, MeasuredAmount};
pub use margin::Margin;
pub use preferences::{Preferences, ViolatedPreference};
pub use violation::{
    ActionInstance, Difficulty, Mistake, Occurrence, Point, Reason, Undecided, Violation, When,
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
    /// Whether interfering happenings must be [`Task::epsilon`] apart. If not, they only must not
    /// fall into one group, which is what VAL asks for.
    pub needs_separation: bool,
    /// VAL's `-t`. Happenings no more than a tenth of it after the first of their group belong to
    /// that group, and happen at its time; durations may miss their bounds by it, strict bounds
    /// excepted.
    pub tolerance: Rational,
    /// Tolerance of numeric comparisons in conditions of one moment. Strict comparisons fail at exactly
    /// the slack. Under `not` it makes the condition harder to satisfy. Over-all conditions have no
    /// slack. VAL uses 0.0001 for each `-t`.
    pub slack: Rational,
    /// Whether timed initials after the last happening of the plan's actions count, so that the
    /// goal holds after all of them. That is the meaning in the field (VAL, unified-planning and
    /// Tamer agree), and what networks, envelopes, planner and executors rely on. Without it, the
    /// goal is read after the last happening of the plan's actions.
    pub counts_later_timed: bool,
    /// Allows happenings of one time to change facts and numbers that others of that time read. All conditions
    /// read the state before. Contradictory writes are refused by
    /// [`refuses_equal_writes`](Self::refuses_equal_writes). This is the rule of unified-planning for problems
    /// without an ε.
    pub allows_simultaneous_reads: bool,
    /// Refuses that two steps, or a step and a timed initial, write the same fact at one time, even the same
    /// value. This is the rule of unified-planning; PDDL 2.1 allows equal writes.
    pub refuses_equal_writes: bool,
}

impl Default for Settings {
    /// As exact as can be: tolerance 0, interfering happenings ε apart, the goal after all timed
    /// initials.
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
    /// The settings that correspond to VAL's `-t tolerance`.
    pub fn like_val(tolerance: Rational) -> Self {
        Self {
            needs_separation: false,
            tolerance,
            slack: Rational::new(1, 10_000),
            ..Self::default()
        }
    }

    /// What unified-planning does with a problem without an ε: what happens at one time reads the
    /// state before, nothing needs to be apart, and no two steps write the same fact at one time.
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

    /// How much later than the first of its group a happening can be.
    fn group_width(&self) -> Rational {
        &self.tolerance / Rational::from(10)
    }

    /// Whether a duration satisfies a bound.
    fn allows(&self, comparison: Comparison, duration: &Rational, bound: &Rational) -> bool {
        let gap = (duration - bound).abs();
        comparison.holds(duration, bound)
            || match comparison {
                Comparison::Less | Comparison::Greater => false,
                _ => gap <= self.tolerance,
            }
    }
}

/// The answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The plan works.
    Valid(Report),
    /// The plan does not work; this is the first thing that is wrong.
    Invalid(Violation),
    /// The judge cannot tell.
    Undecided(Undecided),
}

impl Verdict {
    /// Whether the plan works.
    pub fn is_valid(&self) -> bool {
        matches!(self, Self::Valid(_))
    }

    /// The violation, if the plan is invalid.
    pub fn violation(&self) -> Option<&Violation> {
        match self {
            Self::Invalid(violation) => Some(violation),
            _ => None,
        }
    }
}

/// The final state of a valid plan, and its margins.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The time of the last happening of the plan's actions.
    pub makespan: Rational,
    /// The state in the end, in which the goal holds. Derived facts are not listed.
    pub state: State,
    /// For each comparison that some action, or the goal, needs by itself (not as part of a
    /// disjunction), how close it came to failing: by step, the goal's last.
    pub margins: Vec<Margin>,
    /// What the plan violates of the preferences.
    pub preferences: Preferences,
}

/// Judges a plan. The plan's actions must have been instantiated from this task.
pub fn validate(task: &Task, plan: &TimeTriggeredPlan, settings: &Settings) -> Verdict {
    judge(task, None, plan, settings)
}

/// Judges a plan that goes on from `situation`: see [`Situation`] for what such a plan looks like.
/// What happened before is not judged.
pub fn validate_from(
    task: &Task,
    situation: &Situation,
    plan: &TimeTriggeredPlan,
    settings: &Settings,
) -> Verdict {
    judge(task, Some(situation), plan, settings)
}

fn judge(
    task: &Task,
    situation: Option<&Situation>,
    plan: &TimeTriggeredPlan,
    settings: &Settings,
) -> Verdict {
    let running = situation.map_or(0, |situation| situation.running.len());
    // What it mentions must be in the table before derived facts are looked at.
    let preferences = preferences::OfActions::of(task, plan, running);
    let Some(derivation) = task.derivation() else {
        return Verdict::Undecided(Undecided {
            time: None,
            difficulty: Difficulty::Unstratified,
        });
    };
    if let Some(violation) = malformed_step(situation, plan) {
        return Verdict::Invalid(violation);
    }
    let groups = timeline::timeline(task, situation, plan, settings);
    let state = situation.map_or(task.initial(), |situation| &situation.state);
    let is_begun = situation.is_some_and(|situation| *situation != Situation::initial(task));
    let mut constraints = std::sync::Arc::clone(&task.constraints);
    if is_begun && !constraints.is_empty() && !constraints.begin_now {
        std::sync::Arc::make_mut(&mut constraints).is_past_lost = true;
    }
    let mut judge = judge::Judge {
        task,
        plan,
        settings,
        derivation,
        now: state::Now::of(task, state),
        derived: OnceCell::new(),
        running: situation.map_or_else(BTreeMap::new, judge::running),
        since: BTreeMap::new(),
        margins: margin::Margins::default(),
        course: (!constraints.is_empty()).then(|| trajectory::Course::new(&constraints)),
        preferences,
        nature: autonomous::Nature::of(task),
    };
    let from = situation.map(|situation| &situation.time);
    match judge.run(from, &groups) {
        Ok(()) => Verdict::Valid(Report {
            makespan: plan.makespan(),
            state: judge.now.to_state(),
            preferences: judge.preferences_of(&groups),
            margins: margins(task, plan, judge.margins),
        }),
        Err(stop::Stop::Violation(violation)) => Verdict::Invalid(*violation),
        Err(stop::Stop::Undecided(undecided)) => Verdict::Undecided(*undecided),
    }
}

/// The first step whose times make no sense by themselves, or do not continue what is running.
fn malformed_step(situation: Option<&Situation>, plan: &TimeTriggeredPlan) -> Option<Violation> {
    let running = situation.map_or(&[][..], |situation| &situation.running);
    let earliest = situation.map_or(Rational::ZERO, |situation| situation.time.clone());
    if let Some(missing) = running.get(plan.steps.len()) {
        return Some(Violation {
            time: earliest,
            action: None,
            mistake: Mistake::Abandoned(missing.action.name.clone()),
        });
    }
    plan.steps.iter().enumerate().find_map(|(position, step)| {
        let continued = running.get(position);
        let mistake = match (&step.action.body, &step.duration) {
            _ if continued.is_some_and(|running| !running.is_continued_by(step)) => {
                Mistake::Abandoned(running[position].action.name.clone())
            }
            _ if continued.is_none() && step.start < earliest => {
                Mistake::TooEarly(earliest.clone())
            }
            (Body::Durative(_), None) => Mistake::NoDuration,
            (Body::Durative(_), Some(duration)) if duration.is_negative() => {
                Mistake::NegativeDuration(duration.clone())
            }
            (_, Some(duration))
                if continued.is_some_and(|running| !running.may_last(duration, &earliest)) =>
            {
                Mistake::Elapsed {
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
            mistake,
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

fn condition_of(body: &Body, when: When) -> Option<&Condition> {
    match (body, when) {
        (Body::Instantaneous(snap), When::Now) => Some(&snap.condition),
        (Body::Durative(body), When::Start) => Some(&body.start.condition),
        (Body::Durative(body), When::OverAll) => Some(&body.over_all),
        (Body::Durative(body), When::End) => Some(&body.end.condition),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
