//! Sliders for the quantities of an envelope or a region.

use std::collections::BTreeMap;

use elbowroom::answers::envelope::timeline::Timeline;
use elbowroom::answers::envelope::{Inequalities, Quantity, Range};
use elbowroom::num::Rational;

use super::tables::ends;
use crate::document::{Slider, Sliders};

/// Maximum number of sliders.
const MAX_SLIDERS: usize = 100;

/// A quantity with its interval, also as text. The text is empty if the interval is unbounded.
pub(crate) struct SliderInterval<'a> {
    pub(crate) quantity: &'a Quantity,
    pub(crate) lower: Option<&'a Rational>,
    pub(crate) upper: Option<&'a Rational>,
    pub(crate) words: String,
}

impl<'a> SliderInterval<'a> {
    /// Returns the quantity's interval in the envelope.
    pub(super) fn of(range: &'a Range) -> Self {
        let (lower, upper) = ends(range);
        Self {
            quantity: &range.quantity,
            lower: range.lower.value(),
            upper: range.upper.value(),
            words: format!("in the envelope: {lower} to {upper}"),
        }
    }
}

/// Returns sliders for the quantities of a plan; `None` if there are none or too many.
pub(crate) fn sliders(
    timeline: &Timeline,
    reaches: &[SliderInterval<'_>],
    inequalities: &Inequalities,
) -> Option<Sliders> {
    if reaches.is_empty() || reaches.len() > MAX_SLIDERS {
        return None;
    }
    let labels = inequalities.times.iter().enumerate();
    let places: BTreeMap<&str, usize> = labels.map(|(place, it)| (it.as_str(), place)).collect();
    let place = |label: String| places.get(label.as_str()).copied();
    let bars = timeline.actions.iter().map(|action| {
        if action.end.is_none() {
            let instant = place(action.instance.clone())?;
            return Some((instant, instant));
        }
        let start = place(format!("{}.start", action.instance))?;
        Some((start, place(format!("{}.end", action.instance))?))
    });
    Some(Sliders {
        heading: "What if?".to_owned(),
        note: "Move a slider: the page computes exactly whether the plan works with the chosen \
               values of all quantities, and draws the plan with these values above."
            .to_owned(),
        sliders: reaches.iter().map(slider).collect(),
        bars: bars.collect::<Option<_>>()?,
        names: timeline
            .actions
            .iter()
            .map(|action| action.action.as_str().into())
            .collect(),
        system: inequalities.clone(),
    })
}

/// Returns a slider from half to five times the nominal value, or slightly beyond the envelope if
/// that is larger.
fn slider(reach: &SliderInterval<'_>) -> Slider {
    let nominal = &reach.quantity.nominal;
    let half = Rational::new(1, 2);
    let size = nominal.abs();
    let size = if size.is_zero() { Rational::ONE } else { size };
    let margin = &size * &Rational::new(1, 10);
    let far = &size * &Rational::from(10);
    let wider = |end: Option<&Rational>, side: Rational| {
        let end = end.filter(|end| (*end - nominal).abs() <= far)?;
        Some(end + &margin * side)
    };
    let from = nominal - &size * &half;
    let from = match wider(reach.lower, Rational::from(-1)) {
        Some(end) if end < from => end,
        _ => from,
    };
    let from = if nominal.is_negative() || !from.is_negative() {
        from
    } else {
        Rational::ZERO
    };
    let to = nominal + &size * &Rational::from(4);
    let to = match wider(reach.upper, Rational::ONE) {
        Some(end) if end > to => end,
        _ => to,
    };
    let step = step(&((&to - &from) * Rational::new(1, 500)));
    // Whole steps from zero, so that the displayed value is the checked one.
    let down = |value: &Rational| (value / &step).floor() * &step;
    Slider {
        name: reach.quantity.name.clone(),
        quantity: reach.quantity.quantity.clone(),
        nominal: nominal.to_string(),
        guaranteed: reach.words.clone(),
        from: decimal(&down(&from)),
        to: decimal(&(down(&to) + &step)),
        step: decimal(&step),
    }
}

/// Returns the greatest step that is at most `most`: 1, 2 or 5 times a power of ten, at least 10⁻⁶.
fn step(most: &Rational) -> Rational {
    let ten = Rational::from(10);
    let mut power = Rational::new(1, 1_000_000);
    while &power * &ten <= *most {
        power = &power * &ten;
    }
    let factors = [5, 2, 1].map(|factor| &power * Rational::from(factor));
    let fitting = factors.into_iter().find(|step| step <= most);
    fitting.unwrap_or(power)
}

/// Formats a multiple of 10⁻⁶.
fn decimal(value: &Rational) -> String {
    value.to_decimal(6)
}
