//! Time as whole numbers of ticks.

use elbowroom_num::{CommonDenominator, Rational};

/// A time or a span of time, in ticks.
pub(crate) type Ticks = i64;

/// Later than any time that occurs; sums of two of them still fit.
pub(crate) const NEVER: Ticks = i64::MAX / 4;

/// The finest useful grid: times up to some hundred million units still fit.
const FINEST: i64 = 10_000_000_000;

/// The grid used when the exact one would be too fine: it fits times of milliseconds and of a
/// third of a unit.
const ROUNDED: i64 = 3_000_000;

/// The time grid: ticks per unit of time.
///
/// The grid contains all times and constant durations of the problem if possible. Otherwise, or if
/// a duration that depends on the state falls between two ticks, the search works with rounded
/// numbers. The times of its plans are then computed exactly afterwards, and the search claims no
/// proof.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    ticks_per_unit: i64,
}

impl Scale {
    /// Returns the coarsest grid that contains all of these numbers, or a fine one if there is
    /// none.
    pub(crate) fn of<'a>(numbers: impl Iterator<Item = &'a Rational>) -> Self {
        let mut common = CommonDenominator::default();
        let mut largest = 1.0_f64;
        for number in numbers {
            largest = largest.max(number.to_f64().abs());
            if common.include(number).is_none() || common.get() > FINEST {
                return Self::rounded();
            }
        }
        #[allow(clippy::cast_precision_loss, reason = "an estimate of magnitudes")]
        let is_too_large = largest * common.get() as f64 > 1e14;
        if is_too_large {
            return Self::rounded();
        }
        Self {
            ticks_per_unit: common.get(),
        }
    }

    fn rounded() -> Self {
        Self {
            ticks_per_unit: ROUNDED,
        }
    }

    /// Returns the number in ticks, if it is on the grid and not too large.
    pub(crate) fn exactly(self, number: &Rational) -> Option<Ticks> {
        let (numerator, denominator) = number.as_small()?;
        if self.ticks_per_unit % denominator != 0 {
            return None;
        }
        let ticks = numerator.checked_mul(self.ticks_per_unit / denominator)?;
        (ticks.abs() < NEVER).then_some(ticks)
    }

    /// Returns the largest number of ticks not above the number, and whether it is exact.
    pub(crate) fn floor(self, number: &Rational) -> (Ticks, bool) {
        if let Some(ticks) = self.exactly(number) {
            return (ticks, true);
        }
        let scaled = (number * Rational::from(self.ticks_per_unit)).floor();
        match scaled.as_small() {
            Some((ticks, _)) => (ticks.clamp(-NEVER, NEVER), false),
            None if number.is_negative() => (-NEVER, false),
            None => (NEVER, false),
        }
    }

    /// Returns the smallest number of ticks not below the number, and whether it is exact.
    pub(crate) fn ceil(self, number: &Rational) -> (Ticks, bool) {
        let (ticks, exact) = self.floor(&-number);
        (-ticks, exact)
    }

    /// Returns the time as a number of units.
    pub(crate) fn units(self, ticks: Ticks) -> Rational {
        Rational::new(ticks, self.ticks_per_unit)
    }
}

#[cfg(test)]
mod tests {
    use super::Scale;
    use elbowroom_num::Rational;

    #[test]
    fn grid_represents_its_input_numbers_exactly() {
        let numbers = [
            Rational::new(1, 1000),
            Rational::new(1, 3),
            Rational::new(52_548_684_307, 125_000_000),
        ];
        let scale = Scale::of(numbers.iter());
        for number in &numbers {
            let ticks = scale.exactly(number).expect("on the grid");
            assert_eq!(scale.units(ticks), *number);
        }
        assert!(!scale.floor(&Rational::new(1, 7)).1);
    }

    #[test]
    fn rounding_works_in_both_directions() {
        let scale = Scale::of([Rational::ONE].iter());
        assert_eq!(scale.floor(&Rational::new(-3, 2)), (-2, false));
        assert_eq!(scale.ceil(&Rational::new(-3, 2)), (-1, false));
        assert_eq!(scale.ceil(&Rational::new(3, 1)), (3, true));
    }
}
