//! Quantities to change on the page of an envelope, or of a region.

use std::collections::BTreeMap;

use elbowroom::answers::envelope::timeline::Timeline;
use elbowroom::answers::envelope::{Inequalities, Quantity, Range};
use elbowroom::num::Rational;

use super::tables::ends;
use crate::document::{Slider, Sliders};

/// More sliders than anybody would look through.
const MOST: usize = 100;

/// A quantity, as far as it may go, and that in words. An interval without ends has no words.
pub(crate) struct Reach<'a> {
    pub(crate) quantity: &'a Quantity,
    pub(crate) lower: Option<&'a Rational>,
    pub(crate) upper: Option<&'a Rational>,
    pub(crate) words: String,
}

impl<'a> Reach<'a> {
    /// Its interval in the envelope.
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

/// Sliders for the quantities of a plan; `None` if there are none, or too many.
pub(crate) fn sliders(
    timeline: &Timeline,
    reaches: &[Reach<'_>],
    inequalities: &Inequalities,
) -> Option<Sliders> {
    if reaches.is_empty() || reaches.len() > MOST {
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
        note: "Move a slider: the page works out exactly whether the plan still works when each quantity \
               takes the value chosen here, and draws the plan at these values above."
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

/// From half to five times the nominal value or, if the envelope reaches further, a bit further
/// than that.
fn slider(reach: &Reach<'_>) -> Slider {
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
    // Whole steps from zero, so that what is read is what is checked.
    let down = |value: &Rational| (value / &step).floor() * &step;
    Slider {
        name: reach.quantity.name.clone(),
        quantity: reach.quantity.quantity.clone(),
        nominal: nominal.to_string(),
        room: reach.words.clone(),
        from: decimal(&down(&from)),
        to: decimal(&(down(&to) + &step)),
        step: decimal(&step),
    }
}

/// The greatest of 1, 2 and 5 times a power of ten that is no greater, but not below a millionth.
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

/// A multiple of a millionth.
fn decimal(value: &Rational) -> String {
    value.to_decimal(6)
}
