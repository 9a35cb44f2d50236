//! Wall-clock times of journal records. A resumed run computes the elapsed time from them.

use std::borrow::Cow;
use std::fmt;
use std::time::UNIX_EPOCH;

use elbowroom::num::Rational;

use crate::clock;

/// Member of a record with its wall-clock time: the last member.
const MEMBER: &str = ",\"recorded\":";

/// Wall-clock time, in milliseconds since 1970.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct WallTime(i64);

impl WallTime {
    /// Returns the current time.
    pub fn now() -> Self {
        let since = clock::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self(i64::try_from(since.as_millis()).unwrap_or(i64::MAX))
    }

    /// Returns the seconds from `earlier` to this time, negative if this one is earlier.
    pub fn seconds_since(self, earlier: Self) -> Rational {
        Rational::new(self.0.saturating_sub(earlier.0), 1000)
    }

    /// Returns a line of a trace, which ends with its line feed, with this time as its last member. A text that is no
    /// object with members is returned as it is.
    pub(super) fn stamped(self, line: &str) -> Cow<'_, str> {
        match line.strip_suffix("}\n") {
            Some(members) if members.len() > 1 => format!("{members}{MEMBER}{}}}\n", self.0).into(),
            _ => line.into(),
        }
    }
}

impl fmt::Display for WallTime {
    /// Writes the milliseconds since 1970.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Splits a record, without its checksum and line feed, into the line of the trace and the time of recording.
pub(super) fn split(line: &str) -> (Cow<'_, str>, Option<WallTime>) {
    let parts = line.strip_suffix('}').and_then(|line| {
        let (members, digits) = line.rsplit_once(MEMBER)?;
        Some((members, digits.parse().ok()?))
    });
    match parts {
        Some((members, milliseconds)) => {
            (format!("{members}}}").into(), Some(WallTime(milliseconds)))
        }
        None => (line.into(), None),
    }
}

/// The world's time and the wall-clock time at one record.
#[derive(Clone, Debug)]
pub struct Reading {
    /// The world's time.
    pub world: Rational,
    /// The wall-clock time.
    pub wall: WallTime,
}

impl Reading {
    /// Returns `true` if the world's time has passed faster than the wall clock since `earlier`: the world is a
    /// simulation. A record may be written late by a second, and clocks may differ by a tenth.
    pub fn is_ahead_since(&self, earlier: &Self) -> bool {
        let real = self.wall.seconds_since(earlier.wall);
        &self.world - &earlier.world > real * Rational::new(11, 10) + Rational::ONE
    }
}

#[cfg(test)]
mod tests {
    use super::{Reading, WallTime, split};
    use elbowroom::num::Rational;

    #[test]
    fn stamped_line_splits_into_line_and_time() {
        let time = WallTime(1_764_440_000_123);
        for line in ["{\"a\":1}", "{\"recorded\":{\"recorded\":7}}"] {
            let stamped = time.stamped(&format!("{line}\n")).into_owned();
            let (read, recorded) = split(stamped.trim_end());
            assert_eq!((read.as_ref(), recorded), (line, Some(time)));
        }
        assert_eq!(split("{\"a\":1}"), ("{\"a\":1}".into(), None));
    }

    #[test]
    fn world_faster_than_wall_clock_is_ahead() {
        let at = |world: i64, wall: i64| Reading {
            world: Rational::from(world),
            wall: WallTime(wall * 1000),
        };
        let first = at(0, 100);
        assert!(!at(10, 110).is_ahead_since(&first));
        assert!(!at(10, 200).is_ahead_since(&first), "a slow world");
        assert!(at(50, 110).is_ahead_since(&first));
        assert!(at(10, 90).is_ahead_since(&first), "the clock was set back");
    }
}
