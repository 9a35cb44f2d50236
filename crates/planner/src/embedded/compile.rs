//! The ground problem in the form used by the search.
//!
//! Every action becomes one or two *snaps* (Fox & Long's name for starts, ends and instants).
//! Facts, fluents and tests become small integers. Separations of happenings become a list of
//! *annotations* (POPF; Coles, Coles, Fox & Long, ICAPS 2010). An annotation is the latest time of
//! a kind of event, such as "fact 7 was read". Each snap lists the annotations that it must be
//! separated from, with the distances, and the annotations that it sets. So the order required by
//! PDDL's no-moving-targets rule and by over-all conditions is computed once, and the search only
//! takes maxima.

mod builder;
mod calendars;
mod completeness;
mod compressibility;
mod compression;
mod directions;
mod exclusive;
mod fixed_durations;
mod full_form;
mod guarded;
mod initial_state;
mod interference;
mod macros;
mod metric;
mod own_start;
mod reads;
mod rules;
mod symbols;
mod tariffs;
mod times;
mod unfolded;
mod unsupported;
mod without_duration;

use std::borrow::Borrow;
use std::sync::Arc;

use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_model::problem::{Comparison, ObjectId, SchemaId, UpdateOperator};
use elbowroom_num::Rational;

pub(crate) use builder::{CompileInput, Failure, compile};
pub(crate) use calendars::{Calendar, Dates, spans};
pub(crate) use initial_state::InitialState;
pub(crate) use macros::Macro;
pub(crate) use metric::Metric;
pub(super) use reads::visit_changes;
pub use unsupported::Unsupported;

use super::formula::{Formula, Numeric, Test};
use super::time::{NEVER, Scale, Ticks};
use super::tuning::Tuning;
use super::windows::Windows;

/// No snap or action.
pub(crate) const NONE: u32 = u32::MAX;

/// A compiled problem that begins in a situation.
#[derive(Debug)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a property of the whole problem"
)]
pub(crate) struct Compiled {
    pub(crate) scale: Scale,
    pub(crate) epsilon: Ticks,
    /// Settings of the search.
    pub(crate) tuning: Tuning,
    /// Longest distance from any annotation.
    pub(crate) longest_distance: Ticks,
    /// Time of the situation. New happenings are no earlier.
    pub(crate) now: Ticks,
    /// The facts that some condition reads.
    pub(crate) facts: Vec<FactId>,
    /// The fluents that matter to some condition, duration or rate.
    pub(crate) fluents: Vec<FluentId>,
    /// For each fluent, `true` if at most one action at a time is affected by its continuous
    /// changes.
    pub(crate) exclusive_fluents: Vec<bool>,
    pub(crate) tests: Vec<Test>,
    pub(crate) snaps: Vec<Snap>,
    pub(crate) actions: Vec<Action>,
    /// By envelope and content.
    pub(crate) macros: Vec<Macro>,
    /// For each fact the annotations of its latest addition and deletion; [`NONE`] if no happening
    /// depends on them.
    pub(crate) fact_annotations: Vec<[u32; 2]>,
    /// The number of annotations.
    pub(crate) annotation_count: usize,
    /// The future timed initials by time, without those of calendars.
    pub(crate) timed: Vec<Timed>,
    /// The literals that change at fixed times only, and restrict the times of happenings.
    pub(crate) calendars: Vec<Calendar>,
    /// The windows given by conditions on calendars; `None` if there are none.
    pub(crate) windows: Option<Arc<Windows>>,
    pub(crate) goal: Formula,
    /// The metric to minimize, if one other than the makespan was requested.
    pub(crate) metric: Option<Metric>,
    /// Number of timed initials up to the last one that writes a fact or fluent of the goal. The
    /// goal is not decided before.
    pub(crate) timed_until_goal: u32,
    /// The rules of derived facts. A fact that a stratum negates is decided in an earlier stratum.
    pub(crate) strata: Vec<Vec<Rule>>,
    /// The derived facts, by stratum.
    pub(crate) derived: Vec<Vec<u32>>,
    pub(crate) initial: InitialState,
    /// `true` if the compilation is exact. Only then does an exhausted search prove that no plan
    /// exists.
    pub(crate) is_exact: bool,
    /// Reason why a plan may need an instance of an action that the compiled form cannot express.
    /// Also an obstacle to proofs.
    pub(crate) incomplete_because: Option<&'static str>,
    /// The same reason for a relaxation without numbers that never loses reached facts.
    pub(crate) relaxation_incomplete_because: Option<&'static str>,
    /// `true` if several happenings of one moment may keep an over-all condition that none of them keeps
    /// alone, in any order.
    pub(crate) needs_joining: bool,
    /// `true` if starts of one moment may need each other's effects.
    pub(crate) starts_depend_on_each_other: bool,
    /// `true` if some value depends on the times of happenings.
    pub(crate) is_symbolic: bool,
}

/// A start, an end, or an instantaneous action.
#[derive(Clone, Debug, Default)]
pub(crate) struct Snap {
    pub(crate) condition: Formula,
    /// The conditions on calendars.
    pub(crate) dates: Dates,
    pub(crate) adds: Vec<u32>,
    pub(crate) deletes: Vec<u32>,
    pub(crate) updates: Vec<Update>,
    pub(crate) conditional: Vec<Conditional>,
    /// Its addition to `State::cost`.
    pub(crate) cost: Option<Numeric>,
    /// Annotations that the snap must follow, with the distances.
    pub(crate) after: Vec<(u32, Ticks)>,
    /// Annotations that the snap sets.
    pub(crate) marks: Vec<u32>,
    /// Timed initials that must follow the snap, if they come later, with the distances; ascending.
    pub(crate) before_timed: Vec<(u32, Ticks)>,
}

/// A numeric effect.
#[derive(Clone, Debug)]
pub(crate) struct Update {
    pub(crate) fluent: u32,
    pub(crate) operator: UpdateOperator,
    pub(crate) value: Numeric,
}

/// A conditional effect.
#[derive(Clone, Debug)]
pub(crate) struct Conditional {
    /// Index among [`Action::guards`] of the part that was read at the start.
    pub(crate) at_start: Option<u8>,
    pub(crate) now: Formula,
    pub(crate) change: Change,
}

/// The change of a conditional effect.
#[derive(Clone, Debug)]
pub(crate) enum Change {
    Add(u32),
    Delete(u32),
    Update(Update),
    /// Adds to `State::cost`.
    Cost(Numeric),
}

/// A ground action.
#[derive(Clone, Debug)]
pub(crate) struct Action {
    pub(crate) schema: SchemaId,
    pub(crate) arguments: Vec<ObjectId>,
    /// Its start, or the instantaneous action; [`NONE`] if it is already running in the situation.
    pub(crate) start: u32,
    /// [`NONE`] for an instantaneous action.
    pub(crate) end: u32,
    pub(crate) over_all: Formula,
    /// The over-all conditions on calendars.
    pub(crate) dates: Dates,
    /// The conditions that end effects read at the start.
    pub(crate) guards: Vec<Formula>,
    pub(crate) duration: Duration,
    pub(crate) flows: Vec<Flow>,
    /// Timed initials that would break the over-all condition while the action runs; ascending.
    pub(crate) breaking_timed: Vec<u32>,
    /// Loss of plans when the search compresses the action.
    pub(crate) compressibility: Compressibility,
    /// `true` if its end only adds facts that matter only when true; see `compression`.
    pub(crate) is_compression_safe: bool,
    /// `true` if it cannot start while another instance of it is running.
    pub(crate) excludes_itself: bool,
    /// The annotation of the latest end of the ground action, which no instance may overlap; [`NONE`] if
    /// instances may overlap, or never do. All forms of the ground action share it.
    pub(crate) exclusion: u32,
    /// `true` if a condition or effect reads `?duration`, or if the action has continuous effects.
    pub(crate) uses_duration: bool,
}

/// Loss of plans from *compressing* an action: ending it before any other happening, in the order
/// of happenings (compression-safe actions; Coles, Coles, Fox & Long, ICAPS 2009). In ascending
/// order of safety.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Compressibility {
    /// An envelope: other actions may need its effects while it runs (Coles, Fox, Halsey, Long &
    /// Smith, "Managing concurrency in temporal planning", AIJ 173, 2009).
    Envelope,
    /// The action takes an amount of a quantity at its start and returns it at its end (a renewable
    /// resource; Laborie, AIJ 143, 2003). Meanwhile, others can use only the remaining amount.
    HoldsResource,
    /// Few plans are lost.
    Safe,
}

/// The duration bounds of an action.
#[derive(Clone, Debug)]
pub(crate) struct Duration {
    /// The constant bounds.
    pub(crate) least: Rational,
    pub(crate) most: Option<Rational>,
    /// The bounds that depend on the state.
    pub(crate) bounds: Vec<Bound>,
}

/// `?duration comparison value`.
#[derive(Clone, Debug)]
pub(crate) struct Bound {
    pub(crate) comparison: Comparison,
    pub(crate) value: Numeric,
    /// `true` if it is evaluated at the end.
    pub(crate) at_end: bool,
}

/// A continuous effect.
#[derive(Clone, Debug)]
pub(crate) struct Flow {
    pub(crate) fluent: u32,
    pub(crate) rate: Numeric,
    /// Index among [`Action::guards`] of its condition.
    pub(crate) guard: Option<u8>,
}

/// Timed initials of one time.
#[derive(Clone, Debug)]
pub(crate) struct Timed {
    pub(crate) time: Ticks,
    pub(crate) adds: Vec<u32>,
    pub(crate) deletes: Vec<u32>,
    pub(crate) assigns: Vec<(u32, Rational)>,
    pub(crate) marks: Vec<u32>,
}

/// A rule: `head` holds if `body` holds.
#[derive(Clone, Debug)]
pub(crate) struct Rule {
    pub(crate) head: u32,
    pub(crate) body: Formula,
}

impl Compiled {
    /// Returns `true` if plans with self-overlap are excluded.
    pub(crate) fn excludes_self_overlap(&self) -> bool {
        self.actions.iter().any(|action| action.exclusion != NONE)
    }

    /// Returns `true` if a goal that a relaxation cannot reach is unreachable.
    pub(crate) fn is_relaxation_exact(&self) -> bool {
        self.is_exact && self.relaxation_incomplete_because.is_none()
    }

    /// Returns the earliest time that a tick represents. The tick of [`now`](Self::now) is rounded
    /// down if the situation's time is not on the grid, and nothing happens before the situation's
    /// time.
    pub(crate) fn earliest(&self, tick: Ticks) -> Rational {
        if tick == self.now {
            self.initial.time.clone()
        } else {
            self.scale.units(tick)
        }
    }

    /// Returns the latest end of a running action by the windows of its over-all condition, if they
    /// bound it. Outside of these windows, it can only end immediately.
    pub(crate) fn latest_end_in_window(&self, action: u32) -> Option<Ticks> {
        let list = self.action(action).dates.windows?;
        let intervals = self.windows.as_ref()?.list(list);
        let current = intervals.iter().find(|(begin, _)| *begin <= self.now);
        let is_on_grid = self.scale.exactly(&self.initial.time).is_some();
        let at_once = self.now + Ticks::from(!is_on_grid);
        let end = current.map_or(at_once, |&(_, end)| end);
        (end < NEVER).then_some(end)
    }

    /// Returns the snap with that number.
    pub(crate) fn snap(&self, number: u32) -> &Snap {
        &self.snaps[number as usize]
    }

    /// Returns the action with that number.
    pub(crate) fn action(&self, number: u32) -> &Action {
        &self.actions[number as usize]
    }
}

/// Returns `true` if a fluent has several updates that do not commute. The validator rejects them.
pub(super) fn is_conflict<U: Borrow<Update>>(updates: &[U]) -> bool {
    updates.iter().enumerate().any(|(place, update)| {
        let update = update.borrow();
        let mut others = updates[..place].iter().map(Borrow::borrow);
        others.any(|other| {
            let is_additive = other.operator.is_additive() && update.operator.is_additive();
            other.fluent == update.fluent && !is_additive
        })
    })
}
