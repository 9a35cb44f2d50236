//! Moves the ends of a box to their limits.

use std::ops::ControlFlow;

use crate::obligations::Refusal;
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParameterId, Side};

use crate::irr::max_reach;
use crate::oracle::Oracle;

/// The largest distance between an end and a limit that is not found exactly: 10⁻¹².
const RESOLUTION: (i64, i64) = (1, 1_000_000_000_000);

/// Moves each end of the box out until it reaches its limit: upper before lower, parameter by
/// parameter, each as far as the previous ones allow.
///
/// A limit is a fraction, usually one with a small denominator or few decimals. Bisection encloses
/// it. The simplest fraction and the shortest decimal in the enclosing interval are tried as well,
/// and one of them is the limit as soon as no simpler one remains. The result always lies inside
/// the envelope, and less than 10⁻¹² from the limit.
///
/// Returns `None` if `envelope` is not inside the robustness envelope. `on_step` is called after
/// every check and can end the work at any moment.
///
/// # Errors
/// If there are too many cases to decide.
pub fn sharpen(
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    on_step: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Option<DecoupledEnvelope>, Refusal> {
    if oracle.start(envelope)?.is_some() {
        return Ok(None);
    }
    let parameters = (0..oracle.plan().parameters.len()).map(ParameterId::from);
    let ends = parameters
        .flat_map(|parameter| [Side::Upper, Side::Lower].map(|side| BoxEnd { parameter, side }));
    for end in ends {
        if push(oracle, end, on_step).is_break() {
            break;
        }
    }
    Ok(oracle.accepted().cloned())
}

/// Moves one end of the accepted box out to its limit.
fn push(
    oracle: &mut Oracle,
    end: BoxEnd,
    on_step: &mut dyn FnMut() -> ControlFlow<()>,
) -> ControlFlow<()> {
    let Some(mut inside) = oracle.accepted().and_then(|accepted| end.reach(accepted)) else {
        return ControlFlow::Continue(());
    };
    let border = end
        .side
        .reach(&oracle.plan().parameter(end.parameter).range);
    if border.as_ref() == Some(&inside) {
        return ControlFlow::Continue(());
    }
    let farthest = max_reach(oracle.plan().parameter(end.parameter));
    // An undecided box counts as rejected.
    let mut accepts = |reach| oracle.try_reach(end, reach).unwrap_or(false);
    if accepts(border.clone()) {
        return on_step();
    }
    let mut outside = if let Some(border) = border {
        border
    } else {
        // There is a limit: move out until it is enclosed.
        let mut step = Rational::ONE;
        loop {
            if inside > farthest {
                return ControlFlow::Continue(());
            }
            let farther = &inside + &step;
            if !accepts(Some(farther.clone())) {
                break farther;
            }
            inside = farther;
            step = &step + &step;
            if on_step().is_break() {
                return ControlFlow::Break(());
            }
        }
    };
    let resolution = Rational::new(RESOLUTION.0, RESOLUTION.1);
    let half = Rational::new(1, 2);
    let mut guesses = (0..3).cycle();
    while &outside - &inside > resolution {
        let candidate = match guesses.next() {
            Some(1) => simplest_between(&inside, &outside),
            Some(2) => shortest_decimal_between(&inside, &outside),
            _ => &(&inside + &outside) * &half,
        };
        if accepts(Some(candidate.clone())) {
            inside = candidate;
        } else {
            outside = candidate;
        }
        if on_step().is_break() {
            return ControlFlow::Break(());
        }
    }
    ControlFlow::Continue(())
}

/// Returns the fraction with the smallest denominator strictly between two numbers, `low < high`.
fn simplest_between(low: &Rational, high: &Rational) -> Rational {
    if low.is_negative() {
        if high.is_positive() {
            return Rational::ZERO;
        }
        return -simplest_between(&-high, &-low);
    }
    let whole = low.floor();
    let next = &whole + &Rational::ONE;
    if next < *high {
        return next;
    }
    // Both lie between `whole` and `next`: compare the reciprocals of the remainders.
    let (low, high) = (low - &whole, high - &whole);
    let least = high
        .reciprocal()
        .expect("greater than `low`, which is not negative");
    let fraction = match low.reciprocal() {
        Some(most) => simplest_between(&least, &most),
        None => &least.floor() + &Rational::ONE,
    };
    &whole
        + &fraction
            .reciprocal()
            .expect("greater than `least`, which is positive")
}

/// Returns a number with as few decimals as possible strictly between two numbers, `low < high`.
fn shortest_decimal_between(low: &Rational, high: &Rational) -> Rational {
    let tenth = Rational::new(1, 10);
    let mut unit = Rational::ONE;
    loop {
        let scaled = low * &unit.reciprocal().expect("a power of ten");
        let next = (&scaled.floor() + &Rational::ONE) * &unit;
        if next < *high {
            return next;
        }
        unit = &unit * &tenth;
    }
}

#[cfg(test)]
mod tests {
    use elbowroom_num::Rational;

    use super::{shortest_decimal_between, simplest_between};

    #[test]
    fn the_shortest_decimal_has_no_more_places_than_it_takes() {
        let between = |low: &str, high: &str| {
            let number = |text: &str| text.parse::<Rational>().unwrap();
            let found = shortest_decimal_between(&number(low), &number(high));
            assert!(number(low) < found && found < number(high));
            found
        };
        let number = |text: &str| text.parse::<Rational>().unwrap();
        assert_eq!(between("0", "5"), number("1"));
        assert_eq!(between("-1.5", "-0.2"), number("-1"));
        assert_eq!(between("-0.5", "-0.2"), number("-0.4"));
        assert_eq!(between("2.49", "2.51"), number("2.5"));
        assert_eq!(
            between("240.3864744559", "240.3864744561"),
            number("240.386474456")
        );
    }

    #[test]
    fn the_simplest_fraction_has_the_smallest_denominator() {
        let between = |low: &str, high: &str| {
            let number = |text: &str| text.parse::<Rational>().unwrap();
            simplest_between(&number(low), &number(high)).to_string()
        };
        assert_eq!(between("0", "5"), "1");
        assert_eq!(between("-1", "1"), "0");
        assert_eq!(between("0", "1"), "1/2");
        assert_eq!(between("0", "1/3"), "1/4");
        assert_eq!(between("2.49", "2.51"), "5/2");
        assert_eq!(between("39.997999", "39.998001"), "19999/500");
        assert_eq!(between("-3.2", "-3.1"), "-19/6");
        assert_eq!(between("3.1415", "3.1416"), "333/106");
    }
}
