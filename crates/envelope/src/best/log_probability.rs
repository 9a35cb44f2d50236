//! The logarithm of an interval's probability in floating-point numbers, used for proposals only.

use elbowroom_num::Rational;
use elbowroom_num::log_concave::{
    Cell, CutPosition, Dense, Density, LogConcaveDistribution, Reach, Steps,
};

use super::barrier::Concave;

/// One parameter's interval in a case; lengths are relative to its scale.
pub(super) struct LogProbability {
    ends: [usize; 2],
    scale: f64,
    kind: Kind,
}

enum Kind {
    /// A density between two cuts.
    Dense {
        density: [f64; 3],
        shape: Density,
        nominal: f64,
        margin: f64,
        /// Limits of the lower and the upper end, and flags for sides that count as a whole.
        stops: [f64; 2],
        is_whole: [bool; 2],
        /// Gain per unit of length, in addition to the density.
        gains: [f64; 2],
    },
    /// Share of the values that all intervals contain, and for each side the corners of the concave
    /// hull of the share that they may contain in addition.
    Values {
        center: f64,
        hulls: [Vec<(f64, f64)>; 2],
    },
    /// No approximation is available.
    Unknown,
}

impl LogProbability {
    pub(super) fn new(
        chance: &LogConcaveDistribution,
        (nominal, scale): (&Rational, &Rational),
        cell: &Cell,
        ends: [usize; 2],
    ) -> Self {
        let kind = match chance {
            LogConcaveDistribution::Dense(dense) => {
                dense_kind(dense, nominal, cell).unwrap_or(Kind::Unknown)
            }
            LogConcaveDistribution::Values(values) => {
                let steps = Steps::new(values, nominal, cell);
                let spans = [&cell.below, &cell.above];
                let mut hulls = [Vec::new(), Vec::new()];
                for ((hull, steps), span) in hulls.iter_mut().zip(&steps.sides).zip(spans) {
                    let first = (span[0].to_f64(), 0.0);
                    let corners = steps
                        .iter()
                        .map(|(place, share)| (place.to_f64(), share.to_f64()));
                    *hull = concave(std::iter::once(first).chain(corners));
                }
                Kind::Values {
                    center: steps.center.to_f64(),
                    hulls,
                }
            }
        };
        Self {
            ends,
            scale: scale.to_f64(),
            kind,
        }
    }

    /// Returns approximately the share of a list of values that an interval contains, and the
    /// derivatives of its logarithm by the ends. `None` without such a list.
    pub(super) fn hull_at(&self, at: &Reach) -> Option<(Rational, Reach)> {
        let Kind::Values { center, hulls } = &self.kind else {
            return None;
        };
        let mut mass = *center;
        let mut slopes = [0.0; 2];
        for side in 0..2 {
            let (value, slope) = on_hull(&hulls[side], at[side].to_f64());
            mass += value;
            slopes[side] = slope;
        }
        let fine = Rational::new(1, 1_000_000_000_000);
        let mass = Rational::from_f64_rounded(mass, &fine)?;
        if !mass.is_positive() {
            return None;
        }
        let [one, other] = slopes.map(|slope| {
            let slope = Rational::from_f64_exactly(slope)?;
            slope.checked_div(&mass)
        });
        Some((mass, [one?, other?]))
    }

    /// Returns the logarithm, its derivatives by either end, and the negated second derivatives: of
    /// the lower end, mixed, of the upper end. The unit is that of the plan.
    fn at(&self, reach: [f64; 2]) -> (f64, [f64; 2], [f64; 3]) {
        match &self.kind {
            Kind::Unknown => (0.0, [0.0; 2], [0.0; 3]),
            Kind::Values { center, hulls } => {
                let (left, up) = on_hull(&hulls[0], reach[0]);
                let (right, over) = on_hull(&hulls[1], reach[1]);
                let mass = center + left + right;
                if mass <= 0.0 {
                    return (f64::NEG_INFINITY, [0.0; 2], [0.0; 3]);
                }
                let (a, b) = (up / mass, over / mass);
                (mass.ln(), [a, b], [a * a, a * b, b * b])
            }
            Kind::Dense {
                density,
                shape,
                nominal,
                margin,
                stops,
                is_whole,
                gains,
            } => {
                let lower = (nominal - reach[0]).max(stops[0]) - margin;
                let upper = (nominal + reach[1]).min(stops[1]) + margin;
                let shape = (shape, density);
                let low = if is_whole[0] {
                    0.0
                } else {
                    at_most(shape, lower)
                };
                let high = if is_whole[1] {
                    1.0
                } else {
                    at_most(shape, upper)
                };
                let mass = high - low;
                if mass <= 0.0 {
                    return (f64::NEG_INFINITY, [0.0; 2], [0.0; 3]);
                }
                let moves = [
                    !is_whole[0] && nominal - reach[0] >= stops[0],
                    !is_whole[1] && nominal + reach[1] <= stops[1],
                ];
                let at = |moves: bool, end: f64| {
                    if moves {
                        density_at(shape, end)
                    } else {
                        (0.0, 0.0)
                    }
                };
                let ((a, fall), (b, rise)) = (at(moves[0], lower), at(moves[1], upper));
                let (a, b) = (a / mass, b / mass);
                let value = mass.ln() + gains[0] * reach[0] + gains[1] * reach[1];
                let bends = [a * a + fall / mass, a * b, b * b - rise / mass];
                (value, [a + gains[0], b + gains[1]], bends)
            }
        }
    }
}

fn dense_kind(dense: &Dense, nominal: &Rational, cell: &Cell) -> Option<Kind> {
    let seen = dense.cut_positions(nominal, cell)?;
    let mut gains = [0.0; 2];
    for (own, seen) in gains.iter_mut().zip(&seen) {
        if let CutPosition::Open { place, gain } = seen {
            *own = gain.to_f64() / place.to_f64();
        }
    }
    let nominal = nominal.to_f64();
    // An end gains nothing beyond its span.
    let far = [cell.below[1].to_f64(), cell.above[1].to_f64()];
    Some(Kind::Dense {
        density: numbers(&dense.density),
        shape: dense.density.clone(),
        nominal,
        margin: dense.margin.to_f64(),
        stops: [nominal - far[0], nominal + far[1]],
        is_whole: [
            seen[0] == CutPosition::AlwaysReached,
            seen[1] == CutPosition::AlwaysReached,
        ],
        gains,
    })
}

/// Returns the corners of the concave hull of these points, which are increasing.
fn concave(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut hull: Vec<(f64, f64)> = Vec::new();
    for point in points {
        while let [.., before, last] = hull[..] {
            let turns = (last.0 - before.0) * (point.1 - before.1)
                - (last.1 - before.1) * (point.0 - before.0);
            if turns < 0.0 {
                break;
            }
            hull.pop();
        }
        match hull.last_mut() {
            Some(last) if last.0 >= point.0 => last.1 = last.1.max(point.1),
            _ => hull.push(point),
        }
    }
    hull
}

/// Returns the value of such a function, and its slope to the right.
fn on_hull(hull: &[(f64, f64)], at: f64) -> (f64, f64) {
    for pair in hull.windows(2) {
        let [(x, y), (next, more)] = [pair[0], pair[1]];
        if at < next {
            let slope = (more - y) / (next - x);
            return (y + slope * (at - x).max(0.0), slope);
        }
    }
    (hull.last().map_or(0.0, |last| last.1), 0.0)
}

fn numbers(density: &Density) -> [f64; 3] {
    let number = Rational::to_f64;
    match density {
        Density::Uniform { from, to } => [number(from), number(to), 0.0],
        Density::Triangular { from, mode, to } => [number(from), number(mode), number(to)],
        Density::Normal { mean, deviation } => [number(mean), number(deviation), 0.0],
        Density::Exponential { from, mean } => [number(from), number(mean), 0.0],
        Density::Lognormal { location, spread } => [number(location), number(spread), 0.0],
    }
}

/// Returns the probability of at most `at`.
fn at_most((shape, [a, b, c]): (&Density, &[f64; 3]), at: f64) -> f64 {
    match shape {
        Density::Uniform { .. } => ((at - a) / (b - a)).clamp(0.0, 1.0),
        Density::Triangular { .. } => {
            if at <= *a {
                0.0
            } else if at >= *c {
                1.0
            } else if at < *b {
                (at - a).powi(2) / ((c - a) * (b - a))
            } else {
                1.0 - (c - at).powi(2) / ((c - a) * (c - b))
            }
        }
        Density::Normal { .. } => normal((at - a) / b),
        Density::Exponential { .. } => -(-((at - a) / b).max(0.0)).exp_m1(),
        Density::Lognormal { .. } if at > 0.0 => normal((at.ln() - a) / b),
        Density::Lognormal { .. } => 0.0,
    }
}

/// Returns the density, and its derivative.
fn density_at((shape, [a, b, c]): (&Density, &[f64; 3]), at: f64) -> (f64, f64) {
    let bell = |z: f64| (-z * z / 2.0).exp() / std::f64::consts::TAU.sqrt();
    match shape {
        Density::Uniform { .. } if at < *a || at > *b => (0.0, 0.0),
        Density::Uniform { .. } => (1.0 / (b - a), 0.0),
        Density::Triangular { .. } if at < *a || at > *c => (0.0, 0.0),
        Density::Triangular { .. } if at < *b => {
            let slope = 2.0 / ((c - a) * (b - a));
            (slope * (at - a), slope)
        }
        Density::Triangular { .. } if c > b => {
            let slope = 2.0 / ((c - a) * (c - b));
            (slope * (c - at), -slope)
        }
        Density::Triangular { .. } => (2.0 / (c - a), 0.0),
        Density::Normal { .. } => {
            let z = (at - a) / b;
            let own = bell(z) / b;
            (own, -z / b * own)
        }
        Density::Exponential { .. } if at < *a => (0.0, 0.0),
        Density::Exponential { .. } => {
            let own = (-(at - a) / b).exp() / b;
            (own, -own / b)
        }
        Density::Lognormal { .. } if at > 0.0 => {
            let z = (at.ln() - a) / b;
            let own = bell(z) / (b * at);
            (own, -own / at * (1.0 + z / b))
        }
        Density::Lognormal { .. } => (0.0, 0.0),
    }
}

/// Returns the normal distribution function.
fn normal(at: f64) -> f64 {
    /// Distance beyond which the tail is 0 in floating-point numbers.
    const TAIL_CUTOFF: f64 = 9.0;
    if at.abs() > TAIL_CUTOFF {
        return if at > 0.0 { 1.0 } else { 0.0 };
    }
    let (mut sum, mut term, mut odd) = (0.0_f64, at, 1.0);
    while term.abs() > 1e-17 * sum.abs() {
        sum += term;
        odd += 2.0;
        term *= at * at / odd;
    }
    0.5 + sum * (-at * at / 2.0).exp() / std::f64::consts::TAU.sqrt()
}

impl Concave for Vec<LogProbability> {
    fn derive(&self, at: &[f64], gradient: &mut [f64], curvature: &mut [Vec<f64>]) -> f64 {
        let mut sum = 0.0;
        for own in self {
            let reach = own.ends.map(|variable| at[variable] * own.scale);
            let (value, rises, bends) = own.at(reach);
            sum += value;
            let [one, other] = own.ends;
            let square = own.scale * own.scale;
            gradient[one] += rises[0] * own.scale;
            gradient[other] += rises[1] * own.scale;
            curvature[one][one] += bends[0] * square;
            curvature[one][other] += bends[1] * square;
            curvature[other][one] += bends[1] * square;
            curvature[other][other] += bends[2] * square;
        }
        sum
    }

    fn value(&self, at: &[f64]) -> f64 {
        let values = self.iter().map(|own| {
            let reach = own.ends.map(|variable| at[variable] * own.scale);
            own.at(reach).0
        });
        values.sum()
    }
}
