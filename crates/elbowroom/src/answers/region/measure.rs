//! The volume of the region, and the boxes' shares of it.

use std::ops::ControlFlow;

use elbowroom_envelope::{BoundedRegion, Component, Region};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::ParametrizedPlan;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::sampling::estimate;
use super::{BoxAnswer, Exact};

/// Largest number of connected parameters that are measured exactly.
const MAX_EXACT: usize = 6;
/// Work limit of the exact measurement, in faces of faces. Beyond it, the volume is sampled.
const MAX_SIDES: usize = 300_000;
/// The quantile of the standard normal distribution for intervals of 95 %.
const NORMAL_QUANTILE: f64 = 1.96;

/// The volume of a region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measure {
    /// The box that contains the measured part, by parameter: the extent of the region, or a
    /// multiple of the nominal value where the region is unbounded.
    pub frame: IndexMap<String, [Exact; 2]>,
    /// The parameters that are unbounded on some side.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unbounded: Vec<String>,
    /// The volume as an exact number; `None` if it was estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<Exact>,
    /// Its decimal logarithm.
    pub log10: f64,
    /// Its 95 % interval, if it was estimated: from the spread of independent random walks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log10_interval: Option<[f64; 2]>,
}

/// A share of the region's volume.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// The exact number; `None` if it was estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<Exact>,
    /// The number.
    pub decimal: f64,
    /// Its 95 % interval, if it was estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<[f64; 2]>,
}

/// A volume: exact, or an estimated logarithm with its variance.
#[derive(Clone, Debug, PartialEq)]
enum Size {
    Exact(Rational),
    Estimate { logarithm: f64, variance: f64 },
}

/// Measures a region, and each box's share of it; `None` if it has no volume, or `flow` breaks.
/// Unbounded ends count up to a distance of `most` times the nominal value from it.
pub(super) fn measure(
    plan: &ParametrizedPlan,
    region: &Region,
    boxes: &mut [BoxAnswer],
    most: &Rational,
    seed: u64,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Measure> {
    let extent = region.extent(plan.parameters.len());
    let mut unbounded = Vec::new();
    let mut frame = Vec::new();
    for (parameter, own) in plan.parameters.iter().zip(&extent) {
        let far = parameter.nominal.abs() * most;
        if own.lower.is_infinite() || own.upper.is_infinite() {
            unbounded.push(parameter.name.clone());
        }
        let lower = own.lower.value().cloned();
        let upper = own.upper.value().cloned();
        frame.push((
            lower.unwrap_or_else(|| &parameter.nominal - &far),
            upper.unwrap_or_else(|| &parameter.nominal + &far),
        ));
    }
    let size = size_of(&region.body(&frame), seed, flow)?;
    for own in boxes {
        own.share = Share::of(&own.own, &frame, &size);
    }
    let spread = size.half_width();
    let log10 = size.logarithm() / std::f64::consts::LN_10;
    let names = plan
        .parameters
        .iter()
        .map(|parameter| parameter.name.clone());
    let sides = frame
        .iter()
        .map(|(lower, upper)| [Exact(lower.clone()), Exact(upper.clone())]);
    Some(Measure {
        frame: names.zip(sides).collect(),
        unbounded,
        log10,
        log10_interval: spread.map(|spread| {
            let far = spread / std::f64::consts::LN_10;
            [log10 - far, log10 + far]
        }),
        volume: match size {
            Size::Exact(volume) => Some(Exact(volume)),
            Size::Estimate { .. } => None,
        },
    })
}

/// Returns the volume; `None` if there is none, or `flow` breaks.
fn size_of(
    body: &BoundedRegion,
    seed: u64,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Size> {
    let mut pieces = Vec::new();
    for (index, components) in body.pieces.iter().enumerate() {
        let mut product = Size::Exact(Rational::ONE);
        for (place, component) in components.iter().enumerate() {
            let own = seed.wrapping_add(0x9E37_79B9 * (1 + place as u64) + ((index as u64) << 40));
            match size_of_component(component, own, flow) {
                Some(size) => product = product.times(&size),
                None if flow().is_break() => return None,
                // Flat: the piece has no volume.
                None => {
                    product = Size::Exact(Rational::ZERO);
                    break;
                }
            }
        }
        pieces.push(product);
    }
    let sum = sum(&pieces);
    (sum.logarithm() > f64::NEG_INFINITY).then_some(sum)
}

fn size_of_component(
    component: &Component,
    seed: u64,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Size> {
    if component.parameters.len() <= MAX_EXACT
        && let Some(volume) = component.volume(MAX_SIDES, flow)
    {
        return Some(Size::Exact(volume));
    }
    let found = estimate(component, seed, flow)?;
    Some(Size::Estimate {
        logarithm: found.logarithm,
        variance: found.variance,
    })
}

impl Size {
    /// Returns the natural logarithm.
    fn logarithm(&self) -> f64 {
        match self {
            Self::Exact(volume) => logarithm(volume),
            Self::Estimate { logarithm, .. } => *logarithm,
        }
    }

    fn variance(&self) -> f64 {
        match self {
            Self::Exact(_) => 0.0,
            Self::Estimate { variance, .. } => *variance,
        }
    }

    /// Returns the half-width of the 95 % interval of the logarithm; `None` if it is exact.
    fn half_width(&self) -> Option<f64> {
        match self {
            Self::Exact(_) => None,
            Self::Estimate { variance, .. } => Some(NORMAL_QUANTILE * variance.sqrt()),
        }
    }

    fn times(&self, other: &Self) -> Self {
        if let (Self::Exact(one), Self::Exact(two)) = (self, other) {
            return Self::Exact(one * two);
        }
        Self::Estimate {
            logarithm: self.logarithm() + other.logarithm(),
            variance: self.variance() + other.variance(),
        }
    }
}

fn sum(pieces: &[Size]) -> Size {
    let exact = |size: &Size| match size {
        Size::Exact(volume) => Some(volume.clone()),
        Size::Estimate { .. } => None,
    };
    if let Some(volumes) = pieces.iter().map(exact).collect::<Option<Vec<_>>>() {
        return Size::Exact(volumes.into_iter().sum());
    }
    let largest = pieces
        .iter()
        .map(Size::logarithm)
        .fold(f64::NEG_INFINITY, f64::max);
    let parts: Vec<(f64, f64)> = pieces
        .iter()
        .map(|piece| ((piece.logarithm() - largest).exp(), piece.variance()))
        .collect();
    let whole: f64 = parts.iter().map(|(part, _)| part).sum();
    let shares = parts
        .iter()
        .map(|(part, variance)| (part / whole).powi(2) * variance);
    Size::Estimate {
        logarithm: largest + whole.ln(),
        variance: shares.sum(),
    }
}

/// Returns the natural logarithm of a number that may be too large or too small for a float.
fn logarithm(value: &Rational) -> f64 {
    if !value.is_positive() {
        return f64::NEG_INFINITY;
    }
    let float = value.to_f64();
    if float.is_normal() {
        return float.ln();
    }
    // Scaled by powers of two until it fits.
    let step = Rational::from(1_i64 << 32);
    let (mut scaled, mut logarithm) = (value.clone(), 0.0);
    let bit = 32.0 * std::f64::consts::LN_2;
    while !scaled.to_f64().is_normal() {
        if scaled > Rational::ONE {
            scaled = scaled.checked_div(&step).unwrap_or(Rational::ONE);
            logarithm += bit;
        } else {
            scaled = &scaled * &step;
            logarithm -= bit;
        }
    }
    logarithm + scaled.to_f64().ln()
}

impl Share {
    fn of(own: &[Interval], frame: &[(Rational, Rational)], whole: &Size) -> Option<Self> {
        let mut volume = Rational::ONE;
        for (interval, (lower, upper)) in own.iter().zip(frame) {
            let inside = interval.intersection(&Interval::closed(lower.clone(), upper.clone()));
            volume = &volume * &inside.width()?;
        }
        if let Size::Exact(whole) = whole {
            let share = volume.checked_div(whole)?;
            return Some(Self {
                decimal: share.to_f64(),
                exact: Some(Exact(share)),
                interval: None,
            });
        }
        let middle = logarithm(&volume) - whole.logarithm();
        let spread = whole.half_width().unwrap_or_default();
        Some(Self {
            exact: None,
            decimal: middle.exp(),
            interval: Some([(middle - spread).exp(), (middle + spread).exp().min(1.0)]),
        })
    }
}
