//! Units of a problem's time, and spans of time as texts.

use elbowroom_num::Rational;

use crate::zone::{DAY, SECOND};

/// Unit of a problem's times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Unit {
    pub(crate) name: &'static str,
    /// Length in milliseconds.
    pub(crate) length: i64,
}

const UNITS: [Unit; 4] = [
    Unit {
        name: "seconds",
        length: SECOND,
    },
    Unit {
        name: "minutes",
        length: 60 * SECOND,
    },
    Unit {
        name: "hours",
        length: 3600 * SECOND,
    },
    Unit {
        name: "days",
        length: DAY,
    },
];

/// Maximum number of decimals of a time.
pub(crate) const DECIMALS: u32 = 6;

/// Rounding direction of times without a short decimal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rounding {
    Up,
    Down,
}

impl Unit {
    pub(crate) fn named(name: &str) -> Option<Self> {
        let name = name.trim();
        UNITS.into_iter().find(|unit| unit.is_called(name))
    }

    /// Returns `true` if the text is the unit's name, singular or plural.
    fn is_called(self, name: &str) -> bool {
        self.name == name || self.name.strip_suffix('s') == Some(name)
    }

    /// Returns a number of milliseconds in this unit, rounded to [`DECIMALS`].
    pub(crate) fn time(self, milliseconds: i64, rounding: Rounding) -> Rational {
        let scale = Rational::from(10_i64.pow(DECIMALS));
        let scaled = Rational::new(milliseconds, self.length) * &scale;
        let whole = match rounding {
            Rounding::Up => scaled.ceil(),
            Rounding::Down => scaled.floor(),
        };
        whole / &scale
    }
}

/// Span of time given as a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Length {
    /// Calendar days, which are an hour shorter or longer when the clocks change.
    Days(i64),
    Milliseconds(i64),
}

/// Reads `3 days`, `2 weeks`, `36 hours`, `90 minutes` or `30 seconds`.
pub(crate) fn length(text: &str) -> Option<Length> {
    let (count, unit) = text.trim().split_once(' ')?;
    let count: i64 = count.parse().ok().filter(|count| *count > 0)?;
    let unit = unit.trim();
    if matches!(unit, "week" | "weeks") {
        return Some(Length::Days(count.checked_mul(7)?));
    }
    let unit = Unit::named(unit)?;
    if unit.length == DAY {
        return Some(Length::Days(count));
    }
    Some(Length::Milliseconds(count.checked_mul(unit.length)?))
}

#[cfg(test)]
mod tests {
    use elbowroom_num::Rational;

    use super::{Length, Rounding, Unit, length};

    #[test]
    fn times_without_a_short_decimal_are_rounded() {
        let minutes = Unit::named("minute").expect("a unit");
        assert_eq!(minutes.time(90_000, Rounding::Up), Rational::new(3, 2));
        let third = Rational::new(333_333, 1_000_000);
        assert_eq!(minutes.time(20_000, Rounding::Down), third);
        let above = Rational::new(333_334, 1_000_000);
        assert_eq!(minutes.time(20_000, Rounding::Up), above);
    }

    #[test]
    fn lengths_are_counts_of_units() {
        assert_eq!(length("2 weeks"), Some(Length::Days(14)));
        assert_eq!(length("1 day"), Some(Length::Days(1)));
        assert_eq!(length("36 hours"), Some(Length::Milliseconds(129_600_000)));
        for wrong in ["3", "0 days", "-1 days", "3 moons", "1.5 hours"] {
            assert_eq!(length(wrong), None, "{wrong}");
        }
    }
}
