//! Upper bounds from a world with fewer harmful events.

use elbowroom_sim::Distribution;

use super::process::action_model::{Event, Occurs};
use super::process::world::TimedWorld;
use super::refinement::bound;
use super::settings::{NotTabulated, Settings, Side};

impl TimedWorld {
    /// Returns the world without uncertain events that only make facts false. `None` if there are
    /// no such events, or if fewer facts may be better.
    ///
    /// Certain events at known times are kept: they do not multiply states, and deadlines are such
    /// events.
    pub(super) fn without_uncertain_harm(&self) -> Option<Self> {
        let is_chance_of_harm = |event: &Event| event.is_harmful() && !event.is_certain();
        if !self.is_monotone || !self.events.iter().any(is_chance_of_harm) {
            return None;
        }
        let mut kinder = self.clone();
        kinder.events.retain(|event| !is_chance_of_harm(event));
        kinder.compute_changes();
        Some(kinder)
    }
}

impl Event {
    /// Returns `true` if it happens for certain, at a known time.
    fn is_certain(&self) -> bool {
        match &self.occurs {
            Occurs::Once { probability, time } => {
                *probability >= 1.0 && matches!(time.distribution, Distribution::Constant(_))
            }
            Occurs::Rate(_) => false,
        }
    }
}

/// Returns the least of the upper bounds on this grid and finer ones; 1 if no bound could be
/// computed.
pub(super) fn bound_from(
    world: &TimedWorld,
    first_cells: usize,
    lower: f64,
    settings: &Settings,
    may_continue: &dyn Fn() -> bool,
) -> Result<f64, NotTabulated> {
    let mut least: f64 = 1.0;
    let mut cells = first_cells;
    while cells < usize::from(u16::MAX) && least - lower > settings.gap {
        let mut left = settings.most_states;
        match bound(world, (cells, Side::Above), &mut left, may_continue)? {
            Ok(upper) => least = least.min(upper),
            Err(_) => break,
        }
        cells *= 2;
    }
    Ok(least)
}
