//! The ground problem in the form in which the search reads it.
//!
//! Every action becomes one or two *snaps* (Fox & Long's name for starts, ends and instants);
//! facts, fluents and tests become small numbers; and what keeps happenings apart becomes a list of
//! *annotations* (POPF; Coles, Coles, Fox & Long, ICAPS 2010). An annotation is the latest time at
//! which something of a kind happened, such as "fact 7 was read". Each snap says which annotations
//! it must keep what distance from, and which ones it sets; so the order that PDDL's
//! no-moving-targets rule and over-all conditions ask for is settled here once, and the search only
//! takes maxima.

mod beginning;
mod builder;
mod calendars;
mod completeness;
mod compressibility;
mod compression;
mod directions;
mod exclusive;
mod fixed_durations;
mod guarded;
mod interference;
mod macros;
mod metric;
mod own_start;
mod reads;
mod rules;
mod shortened;
mod symbols;
mod times;
mod unfolded;
mod unsupported;
mod without_duration;

use std::borrow::Borrow;
use std::sync::Arc;

use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_model::problem::{Comparison, ObjectId, SchemaId, UpdateOperator};
use elbowroom_num::Rational;

pub(crate) use beginning::Beginning;
pub(crate) use builder::{Failure, Wanted, compile};
pub(crate) use calendars::{Calendar, Dates, spans};
pub(crate) use macros::Macro;
pub(crate) use metric::Metric;
pub use unsupported::Unsupported;

use super::formula::{Formula, Numeric, Test};
use super::time::{NEVER, Scale, Ticks};
use super::tuning::Tuning;
use super::windows::Windows;

/// No snap, action or the like.
pub(crate) const NONE: u32 = u32::MAX;

/// A problem from a situation on.
#[derive(Debug)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a property of the whole problem"
)]
pub(crate) struct Compiled {
    pub(crate) scale: Scale,
    pub(crate) epsilon: Ticks,
    /// How it is searched.
    pub(crate) tuning: Tuning,
    /// The longest distance from any annotation.
    pub(crate) longest_distance: Ticks,
    /// When the situation is; nothing new happens earlier.
    pub(crate) now: Ticks,
    /// The facts that some condition reads.
    pub(crate) facts: Vec<FactId>,
    /// The fluents that matter to some condition, duration or rate.
    pub(crate) fluents: Vec<FluentId>,
    /// For each fluent, `true` if continuous changes of it are known to concern one action at a time.
    pub(crate) exclusive_fluents: Vec<bool>,
    pub(crate) tests: Vec<Test>,
    pub(crate) snaps: Vec<Snap>,
    pub(crate) actions: Vec<Action>,
    /// By envelope and content.
    pub(crate) macros: Vec<Macro>,
    /// For each fact the annotations of its latest addition and deletion; [`NONE`] if nothing waits
    /// for them.
    pub(crate) fact_annotations: Vec<[u32; 2]>,
    /// The number of annotations.
    pub(crate) annotation_count: usize,
    /// The timed initials to come, by time, but for those of calendars.
    pub(crate) timed: Vec<Timed>,
    /// The literals that change at fixed times only, and restrict when things happen.
    pub(crate) calendars: Vec<Calendar>,
    /// The windows that conditions on calendars leave; `None` if there are none.
    pub(crate) windows: Option<Arc<Windows>>,
    pub(crate) goal: Formula,
    /// The metric to minimize, if one other than the makespan was asked for.
    pub(crate) metric: Option<Metric>,
    /// How many timed initials come before the goal is settled, as far as they go: those up to the
    /// last that writes something the goal reads.
    pub(crate) timed_until_goal: u32,
    /// The rules of derived facts: what a stratum negates is settled in an earlier one.
    pub(crate) strata: Vec<Vec<Rule>>,
    /// The derived facts, by stratum.
    pub(crate) derived: Vec<Vec<u32>>,
    pub(crate) beginning: Beginning,
    /// Whether all of this is exact, so that a search that finds nothing proves something.
    pub(crate) is_exact: bool,
    /// Whether an instance of some action could be needed that this form cannot express; also an
    /// obstacle to proofs. Says why.
    pub(crate) incomplete_because: Option<&'static str>,
    /// The same for a form in which numbers, and what is reached once, are never lost.
    pub(crate) relaxation_incomplete_because: Option<&'static str>,
    /// `true` if several happenings of one moment may keep an over-all condition that none of them keeps
    /// alone, in any order.
    pub(crate) needs_joining: bool,
    /// `true` if starts of one moment may need each other's effects.
    pub(crate) starts_depend_on_each_other: bool,
    /// Whether some value depends on when things happen.
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
    /// Annotations, and how long after them this must happen.
    pub(crate) after: Vec<(u32, Ticks)>,
    /// Annotations that this sets.
    pub(crate) marks: Vec<u32>,
    /// Timed initials, and how long before them this must happen if it comes first; ascending.
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
    /// The position among [`Action::guards`] of what was read at the start.
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
    /// Something is added to `State::cost`.
    Cost(Numeric),
}

/// A ground action.
#[derive(Clone, Debug)]
pub(crate) struct Action {
    pub(crate) schema: SchemaId,
    pub(crate) arguments: Vec<ObjectId>,
    /// Its start, or the instantaneous action; [`NONE`] if it is under way in the situation.
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
    /// Whether a search may compress it.
    pub(crate) compressibility: Compressibility,
    /// Whether its end only adds facts that matter where they are true; see `compression`.
    pub(crate) is_compression_safe: bool,
    /// Whether it cannot start while another instance of it runs.
    pub(crate) excludes_itself: bool,
    /// The annotation of the latest end of the ground action, which no instance may overlap; [`NONE`] if
    /// instances may overlap, or never do. All forms of the ground action share it.
    pub(crate) exclusion: u32,
    /// Whether something reads `?duration`, or changes continuously.
    pub(crate) uses_duration: bool,
}

/// How much is lost by *compressing* an action: ending it before anything else happens, in the
/// order of happenings (compression-safe actions; Coles, Coles, Fox & Long, ICAPS 2009). The safer
/// ones come later.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Compressibility {
    /// Others may need what it offers while it runs: it is an envelope (Coles, Fox, Halsey, Long &
    /// Smith, "Managing concurrency in temporal planning", AIJ 173, 2009).
    Envelope,
    /// Others can use only what it leaves of a quantity: it takes some at its start and gives it
    /// back at its end (a renewable resource; Laborie, AIJ 143, 2003).
    HoldsResource,
    /// Little.
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
    /// Whether it is read at the end.
    pub(crate) at_end: bool,
}

/// A continuous effect.
#[derive(Clone, Debug)]
pub(crate) struct Flow {
    pub(crate) fluent: u32,
    pub(crate) rate: Numeric,
    /// The position among [`Action::guards`] of its condition.
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

/// `head` holds where `body` does.
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

    /// Whether a goal that is out of reach of a relaxation is out of reach.
    pub(crate) fn is_relaxation_exact(&self) -> bool {
        self.is_exact && self.relaxation_incomplete_because.is_none()
    }

    /// The earliest time that a tick stands for. That of now is rounded down where the situation's
    /// time is not on the grid, and nothing happens before that.
    pub(crate) fn earliest(&self, tick: Ticks) -> Rational {
        if tick == self.now {
            self.beginning.time.clone()
        } else {
            self.scale.units(tick)
        }
    }

    /// The latest end of a running action by the windows of its over-all condition, if they bound
    /// it. Outside of them it can only end at once.
    pub(crate) fn latest_end_in_window(&self, action: u32) -> Option<Ticks> {
        let list = self.action(action).dates.windows?;
        let intervals = self.windows.as_ref()?.list(list);
        let current = intervals.iter().find(|(begin, _)| *begin <= self.now);
        let is_on_grid = self.scale.exactly(&self.beginning.time).is_some();
        let at_once = self.now + Ticks::from(!is_on_grid);
        let end = current.map_or(at_once, |&(_, end)| end);
        (end < NEVER).then_some(end)
    }

    /// The snap of that number.
    pub(crate) fn snap(&self, number: u32) -> &Snap {
        &self.snaps[number as usize]
    }

    /// The action of that number.
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
