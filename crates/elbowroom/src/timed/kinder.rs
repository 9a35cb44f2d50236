//! A bound from above in a world with fewer mishaps.

use elbowroom_sim::Distribution;

use super::act::Occurs;
use super::world::TimedWorld;
use super::{Event, NotTabulated, Settings, Side, bound};

impl TimedWorld {
    /// The world without what may or may not happen, or at one time or another, and only makes facts
    /// false; `None` if there is no such thing, or if fewer facts may be better.
    ///
    /// What happens for certain at a known time stays: it multiplies no states, and deadlines are of
    /// this kind.
    pub(super) fn without_chances_of_harm(&self) -> Option<Self> {
        let is_chance_of_harm = |event: &Event| event.is_harmful() && !event.is_certain();
        if !self.is_monotone || !self.events.iter().any(is_chance_of_harm) {
            return None;
        }
        let mut kinder = self.clone();
        kinder.events.retain(|event| !is_chance_of_harm(event));
        kinder.see_what_changes();
        Some(kinder)
    }
}

impl Event {
    /// Whether it happens for certain, at a known time.
    fn is_certain(&self) -> bool {
        match &self.occurs {
            Occurs::Once { probability, time } => {
                *probability >= 1.0 && matches!(time.distribution, Distribution::Constant(_))
            }
            Occurs::Rate(_) => false,
        }
    }
}

/// The least bound from above on this grid and finer ones; 1 if none is finished.
pub(super) fn bound_from(
    world: &TimedWorld,
    first_cells: usize,
    lower: f64,
    settings: &Settings,
    goes_on: &dyn Fn() -> bool,
) -> Result<f64, NotTabulated> {
    let mut least: f64 = 1.0;
    let mut cells = first_cells;
    while cells < usize::from(u16::MAX) && least - lower > settings.gap {
        let mut left = settings.most_states;
        match bound(world, (cells, Side::Above), &mut left, goes_on)? {
            Ok(upper) => least = least.min(upper),
            Err(_) => break,
        }
        cells *= 2;
    }
    Ok(least)
}
