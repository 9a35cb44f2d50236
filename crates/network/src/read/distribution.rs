//! Distributions by the names that the HEATlab programs give them.

use elbowroom_num::Rational;

use crate::file::Duration;
use crate::number::Bound;

/// Factor between the numbers in the names (seconds) and the bounds (milliseconds).
const MILLISECONDS: i64 = 1000;

/// Parses the name of a distribution, such as `N_12.5_0.25`. The result is in the unit of the
/// bounds.
///
/// Names are in seconds and bounds in milliseconds. If the bounds contain a typical value of the
/// distribution only without conversion, the name is taken to be in the unit of the bounds.
///
/// # Errors
/// A description of the mistake in the name.
pub(super) fn by_name(name: &str, lower: &Bound, upper: &Bound) -> Result<Duration, String> {
    let seconds = NamedDistribution::parse(name)?;
    let scaled = seconds.scaled(&Rational::from(MILLISECONDS));
    let contains = |duration: &Duration| {
        let typical = typical(duration);
        let above = match lower {
            Bound::Finite(lower) => typical >= *lower,
            _ => true,
        };
        let below = match upper {
            Bound::Finite(upper) => typical <= *upper,
            _ => true,
        };
        above && below
    };
    if contains(&scaled) {
        return Ok(scaled);
    }
    let unscaled = seconds.scaled(&Rational::ONE);
    Ok(if contains(&unscaled) {
        unscaled
    } else {
        scaled
    })
}

/// Returns a value that should lie between the bounds.
fn typical(duration: &Duration) -> Rational {
    match duration {
        Duration::Normal { mean, .. } => mean.clone(),
        Duration::Uniform { from, to } => (from + to) / Rational::from(2),
        Duration::Exponential { from, mean } => {
            // The median, which is 0.69 of the mean. Rare long durations make the mean too large.
            from + mean * Rational::new(69, 100)
        }
        Duration::Gamma { from, shape, scale } => from + shape * scale,
    }
}

/// Distribution with the numbers of its name.
struct NamedDistribution {
    kind: Kind,
    first: Rational,
    second: Rational,
    third: Rational,
}

enum Kind {
    Normal,
    Uniform,
    Exponential,
    Gamma,
}

impl NamedDistribution {
    fn parse(name: &str) -> Result<Self, String> {
        let wrong = || format!("unknown distribution `{name}`");
        let (letter, rest) = name.split_once('_').ok_or_else(wrong)?;
        // Gamma distributions have their second and third number in parentheses.
        let rest = rest.replace(['(', ')', ' '], "").replace(',', "_");
        let numbers: Vec<Rational> = rest
            .split('_')
            .map(|number| {
                Bound::parse(number)
                    .and_then(Bound::finite)
                    .ok_or_else(wrong)
            })
            .collect::<Result<_, _>>()?;
        let kind = match letter {
            "N" => Kind::Normal,
            "U" => Kind::Uniform,
            "E" => Kind::Exponential,
            "G" => Kind::Gamma,
            _ => return Err(wrong()),
        };
        let named = match (&kind, &numbers[..]) {
            (Kind::Normal | Kind::Uniform | Kind::Exponential, [first, second]) => Self {
                kind,
                first: first.clone(),
                second: second.clone(),
                third: Rational::ZERO,
            },
            (Kind::Exponential, [rate]) => Self {
                kind,
                first: rate.clone(),
                second: Rational::ZERO,
                third: Rational::ZERO,
            },
            (Kind::Gamma, [shape, rate]) => Self {
                kind,
                first: shape.clone(),
                second: rate.clone(),
                third: Rational::ZERO,
            },
            (Kind::Gamma, [shape, rate, from]) => Self {
                kind,
                first: shape.clone(),
                second: rate.clone(),
                third: from.clone(),
            },
            _ => return Err(wrong()),
        };
        named.checked(name)
    }

    fn checked(self, name: &str) -> Result<Self, String> {
        let problem = match self.kind {
            Kind::Normal if self.second.is_negative() => "its deviation is negative",
            Kind::Uniform if self.first > self.second => "its first number is above its second",
            Kind::Exponential if !self.first.is_positive() => "its rate is not positive",
            Kind::Gamma if !self.first.is_positive() || !self.second.is_positive() => {
                "its shape or its rate is not positive"
            }
            _ => return Ok(self),
        };
        Err(format!("invalid distribution `{name}`: {problem}"))
    }

    /// Returns the distribution with its times multiplied by `unit`.
    fn scaled(&self, unit: &Rational) -> Duration {
        let per = |rate: &Rational| rate.reciprocal().unwrap_or_default() * unit;
        match self.kind {
            Kind::Normal => Duration::Normal {
                mean: &self.first * unit,
                deviation: &self.second * unit,
            },
            Kind::Uniform => Duration::Uniform {
                from: &self.first * unit,
                to: &self.second * unit,
            },
            Kind::Exponential => Duration::Exponential {
                from: &self.second * unit,
                mean: per(&self.first),
            },
            Kind::Gamma => Duration::Gamma {
                from: &self.third * unit,
                shape: self.first.clone(),
                scale: per(&self.second),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unbounded(name: &str) -> Result<Duration, String> {
        by_name(name, &Bound::NegativeInfinity, &Bound::Infinity)
    }

    #[test]
    fn named_parameters_are_seconds_and_bounds_milliseconds() {
        assert_eq!(
            unbounded("N_12.5_2."),
            Ok(Duration::Normal {
                mean: Rational::from(12_500),
                deviation: Rational::from(2000),
            })
        );
        assert_eq!(
            unbounded("G_3_(0.5,18)"),
            Ok(Duration::Gamma {
                from: Rational::from(18_000),
                shape: Rational::from(3),
                scale: Rational::from(2000),
            })
        );
        assert_eq!(
            unbounded("E_4_7"),
            Ok(Duration::Exponential {
                from: Rational::from(7000),
                mean: Rational::from(250),
            })
        );
    }

    #[test]
    fn bounds_that_fit_unscaled_are_reported() {
        let bounds = |lower, upper| {
            let finite = |number: i64| Bound::Finite(Rational::from(number));
            by_name("U_2_6", &finite(lower), &finite(upper))
        };
        let uniform = |from: i64, to: i64| {
            Ok(Duration::Uniform {
                from: Rational::from(from),
                to: Rational::from(to),
            })
        };
        assert_eq!(bounds(2, 6), uniform(2, 6));
        assert_eq!(bounds(2000, 6000), uniform(2000, 6000));
    }

    #[test]
    fn other_names_and_impossible_numbers_are_refused() {
        for name in [
            "", "N", "N_1", "N_a_b", "L_1_2", "U_3_2", "E_0_1", "G_0_1", "N_1_-2", "N_1_2_3",
        ] {
            assert!(unbounded(name).is_err(), "{name}");
        }
    }
}
