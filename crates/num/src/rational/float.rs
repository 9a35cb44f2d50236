//! Conversions from floating-point numbers.

use dashu_ratio::RBig;

use super::Rational;

impl Rational {
    /// Returns the exact value of the float: 0.1 is 3602879701896397/36028797018963968. `None` for
    /// infinities and NaN.
    ///
    /// ```
    /// use elbowroom_num::Rational;
    ///
    /// assert_eq!(Rational::from_f64_exactly(0.75), Some(Rational::new(3, 4)));
    /// assert_ne!(Rational::from_f64_exactly(0.1), Some(Rational::new(1, 10)));
    /// ```
    pub fn from_f64_exactly(value: f64) -> Option<Self> {
        RBig::try_from(value).ok().map(Self::from_big)
    }

    /// Returns the multiple of `grid` nearest to the float, and the one larger in magnitude if two
    /// are equally near. `None` for infinities and NaN, and for a grid that is not positive.
    ///
    /// ```
    /// use elbowroom_num::Rational;
    ///
    /// let thousandth = Rational::new(1, 1000);
    /// assert_eq!(Rational::from_f64_rounded(0.1, &thousandth), Some(Rational::new(1, 10)));
    /// ```
    pub fn from_f64_rounded(value: f64, grid: &Self) -> Option<Self> {
        if !grid.is_positive() {
            return None;
        }
        let steps = Self::from_f64_exactly(value)? / grid;
        let magnitude = (steps.abs() + Self::new(1, 2)).floor() * grid;
        Some(if steps.is_negative() {
            -magnitude
        } else {
            magnitude
        })
    }

    /// Returns the shortest decimal that parses to this float: 0.1 is 1/10. `None` for infinities
    /// and NaN.
    ///
    /// ```
    /// use elbowroom_num::Rational;
    ///
    /// assert_eq!(Rational::from_f64_as_written(0.1), Some(Rational::new(1, 10)));
    /// ```
    pub fn from_f64_as_written(value: f64) -> Option<Self> {
        value.is_finite().then(|| value.to_string().parse().ok())?
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::Rational;

    proptest! {
        #[test]
        fn float_round_trips(value in any::<f64>()) {
            let exact = Rational::from_f64_exactly(value);
            prop_assert_eq!(exact.map(|it| it.to_f64()), Some(value).filter(|it| it.is_finite()));
        }

        #[test]
        fn written_decimal_is_nearest_to_its_float(value in any::<f64>()) {
            let written = Rational::from_f64_as_written(value);
            let exact = Rational::from_f64_exactly(value);
            prop_assert_eq!(written.is_some(), value.is_finite());
            if let (Some(written), Some(exact), true) = (written, exact, value.is_normal()) {
                let half_a_step = exact.abs() * Rational::new(1, 1 << 53);
                prop_assert!((written - exact).abs() <= half_a_step);
            }
        }

        #[test]
        fn rounding_gives_nearest_grid_value(
            value in -1e12..1e12_f64,
            (numerator, denominator) in (1..10_000_i64, 1..10_000_i64),
        ) {
            let grid = Rational::new(numerator, denominator);
            let exact = Rational::from_f64_exactly(value).expect("finite");
            let rounded = Rational::from_f64_rounded(value, &grid).expect("finite");
            let steps = &rounded / &grid;
            prop_assert_eq!(steps.floor(), steps);
            prop_assert!((&rounded - &exact).abs() * Rational::from(2) <= grid);
        }
    }

    #[test]
    fn ties_go_away_from_zero() {
        let rounded = |value| Rational::from_f64_rounded(value, &Rational::ONE);
        assert_eq!(rounded(2.5), Some(Rational::from(3)));
        assert_eq!(rounded(-2.5), Some(Rational::from(-3)));
        assert_eq!(rounded(-0.4), Some(Rational::ZERO));
    }

    #[test]
    fn rounding_to_invalid_grid_is_refused() {
        for grid in [Rational::ZERO, Rational::from(-1)] {
            assert_eq!(Rational::from_f64_rounded(1.0, &grid), None);
        }
        assert_eq!(Rational::from_f64_rounded(f64::NAN, &Rational::ONE), None);
        assert_eq!(
            Rational::from_f64_rounded(f64::INFINITY, &Rational::ONE),
            None
        );
    }

    #[test]
    fn the_smallest_and_the_largest_floats_are_exact() {
        for value in [f64::MIN_POSITIVE, 5e-324, f64::MAX, -f64::MAX] {
            let exact = Rational::from_f64_exactly(value).expect("finite");
            assert_eq!(exact.to_f64().to_bits(), value.to_bits());
        }
    }
}
