//! Check that no box has a greater product of widths, by sums of tangents.
//!
//! `ln x <= ln(1/c) - 1 + c·x` for all positive `x` and `c`. So if the sum of the widths, each
//! times a slope, is limited by a bound, the sum of their logarithms is limited by that of the
//! tangents with these slopes.

use elbowroom_num::{Rational, enclosures};

use crate::certificate::{Exact, Parameter};

/// Returns the objective value of the widths, rounded down: `Σ weight · ln(width / scale + foot)`;
/// `None` if it is not defined.
pub(crate) fn objective_value<'a>(
    foot: &Rational,
    widths: impl Iterator<Item = (&'a Parameter, Rational)>,
) -> Option<Rational> {
    let mut worth = Rational::ZERO;
    for (parameter, width) in widths {
        let footed = width.checked_div(&parameter.scale)? + foot;
        let [below, _] = enclosures::ln(&footed)?;
        worth += below * &parameter.weight;
    }
    Some(enclosures::floor_to_billionth(&worth))
}

/// Returns an upper bound of the objective, rounded up, for all boxes whose widths, each times the
/// slope of its parameter, have at most the sum `sum`. Returns `None` if nothing follows.
pub(crate) fn bound(
    foot: &Rational,
    parameters: &[Parameter],
    slopes: &[Exact],
    sum: &Rational,
) -> Option<Rational> {
    if slopes.len() != parameters.len() {
        return None;
    }
    let mut bound = sum.clone();
    for (parameter, Exact(slope)) in parameters.iter().zip(slopes) {
        if parameter.weight.is_zero() {
            if !slope.is_zero() {
                return None;
            }
            continue;
        }
        let scaled = slope * &parameter.scale;
        if !scaled.is_positive() {
            return None;
        }
        let [_, above] = enclosures::ln(&parameter.weight.checked_div(&scaled)?)?;
        bound += (above - Rational::ONE) * &parameter.weight + foot * &scaled;
    }
    Some(enclosures::ceil_to_billionth(&bound))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(weight: i64, scale: i64) -> Parameter {
        Parameter {
            name: "drive".to_owned(),
            nominal: Rational::from(scale),
            scale: Rational::from(scale),
            weight: Rational::from(weight),
            most_below: None,
            most_above: None,
            chance: None,
        }
    }

    #[test]
    fn tangent_is_never_below_objective() {
        let foot = Rational::new(1, 1_000_000);
        let parameters = [parameter(1, 4), parameter(3, 10)];
        for slope in 1..40_i64 {
            for other in 1..40_i64 {
                let slopes = [Rational::new(slope, 7), Rational::new(other, 7)].map(Exact);
                for width in [0, 1, 5, 30_i64] {
                    let widths = [Rational::from(width), Rational::new(width * 3 + 1, 2)];
                    let sum = widths.iter().zip(&slopes).map(|(w, c)| w * &c.0).sum();
                    let worth = objective_value(&foot, parameters.iter().zip(widths)).unwrap();
                    assert!(bound(&foot, &parameters, &slopes, &sum).unwrap() >= worth);
                }
            }
        }
    }

    #[test]
    fn touching_tangent_exceeds_objective_only_by_rounding() {
        let foot = Rational::new(1, 1_000_000);
        let parameters = [parameter(3, 10)];
        let width = Rational::from(25);
        let slope = Rational::from(3) / (&width + &foot * &Rational::from(10));
        let above = bound(
            &foot,
            &parameters,
            &[Exact(slope.clone())],
            &(&width * &slope),
        );
        let worth = objective_value(&foot, parameters.iter().zip([width])).unwrap();
        assert!(above.unwrap() - worth <= Rational::new(1, 100_000_000));
    }

    #[test]
    fn missing_or_nonpositive_slopes_give_no_bound() {
        let foot = Rational::new(1, 1_000_000);
        let parameters = [parameter(1, 1)];
        for slopes in [
            vec![],
            vec![Exact(Rational::ZERO)],
            vec![Exact(Rational::from(-1))],
        ] {
            assert_eq!(bound(&foot, &parameters, &slopes, &Rational::ONE), None);
        }
    }
}
