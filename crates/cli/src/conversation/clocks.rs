//! The clocks that a world's reports are stamped with.

use std::collections::BTreeMap;

use elbowroom::num::Rational;

/// How far apart two readings must be, in seconds, for a rate to be taken from them.
const FAR_APART: i64 = 10;

/// The limits of a rate that can be believed: a clock that is further off is none.
const RATES: [(i64, i64); 2] = [(1, 2), (2, 1)];

/// Times are rounded to so many parts of a second: no clock of a robot is more exact.
const PARTS: i64 = 1_000_000;

/// What is known of each clock: which time of the world it shows.
#[derive(Debug, Default)]
pub(super) struct Clocks(BTreeMap<String, Clock>);

#[derive(Debug)]
struct Clock {
    /// What it showed when it was read first, and the time of the world then.
    first: (Rational, Rational),
    /// The same for the last time.
    last: (Rational, Rational),
    /// How many of its seconds pass in one of the world's, where that was said.
    stated: Option<Rational>,
}

impl Clocks {
    /// A clock was read: it showed `reads` at `time`. `rate`, if given, is how many of its seconds
    /// pass in one of the world's.
    ///
    /// # Errors
    /// In words, when no clock can run like that.
    pub(super) fn read(
        &mut self,
        name: &str,
        reads: Rational,
        time: Rational,
        rate: Option<Rational>,
    ) -> Result<(), String> {
        if let Some(rate) = rate.as_ref().filter(|rate| !is_credible(rate)) {
            return Err(implausible(name, rate));
        }
        let now = (reads, time);
        let Some(clock) = self.0.get_mut(name) else {
            let first = now.clone();
            let clock = Clock {
                first,
                last: now,
                stated: rate,
            };
            self.0.insert(name.to_owned(), clock);
            return Ok(());
        };
        let elapsed = &now.1 - &clock.first.1;
        if rate.is_none() && elapsed >= Rational::from(FAR_APART) {
            let measured = (&now.0 - &clock.first.0) / &elapsed;
            if !is_credible(&measured) {
                // It was set: what it showed before says nothing any more.
                clock.first.clone_from(&now);
            }
        }
        clock.last = now;
        clock.stated = rate.or(clock.stated.take());
        Ok(())
    }

    /// The time of the world at which the clock showed `stamp`.
    ///
    /// # Errors
    /// In words, when the clock was never read.
    pub(super) fn time(&self, name: &str, stamp: &Rational) -> Result<Rational, String> {
        let clock = self.0.get(name).ok_or_else(|| {
            format!(
                "nothing is known of the clock `{name}`; say first what it shows: \
                 {{\"type\":\"clock\",\"clock\":\"{name}\",\"reads\":…,\"time\":…}}"
            )
        })?;
        let (reads, time) = &clock.last;
        let exact = time + (stamp - reads) / clock.rate();
        Ok(rounded(&exact).max(Rational::ZERO))
    }
}

impl Clock {
    fn rate(&self) -> Rational {
        if let Some(stated) = &self.stated {
            return stated.clone();
        }
        let elapsed = &self.last.1 - &self.first.1;
        if elapsed < Rational::from(FAR_APART) {
            return Rational::ONE;
        }
        (&self.last.0 - &self.first.0) / &elapsed
    }
}

fn is_credible(rate: &Rational) -> bool {
    let [least, most] = RATES.map(|(number, of)| Rational::new(number, of));
    *rate >= least && *rate <= most
}

fn implausible(name: &str, rate: &Rational) -> String {
    format!(
        "the clock `{name}` cannot run {} times as fast as time passes; `rate` is close to 1",
        rate.to_f64()
    )
}

fn rounded(time: &Rational) -> Rational {
    let parts = Rational::from(PARTS);
    (time * &parts + Rational::new(1, 2)).floor() / parts
}

#[cfg(test)]
mod tests {
    use super::Clocks;
    use elbowroom::num::Rational;

    fn number(text: &str) -> Rational {
        text.parse().expect("a number")
    }

    fn read(clocks: &mut Clocks, reads: &str, time: &str) {
        let done = clocks.read("arm", number(reads), number(time), None);
        done.expect("a credible clock");
    }

    #[test]
    fn a_clock_that_was_read_once_is_off_by_a_constant() {
        let mut clocks = Clocks::default();
        read(&mut clocks, "1700000012.5", "12.5");
        let time = clocks.time("arm", &number("1700000010.25"));
        assert_eq!(time, Ok(number("10.25")));
    }

    /// 100 s on this clock are 101 s of the world's, so 1 s before the last reading is 1.01 s
    /// before.
    #[test]
    fn drift_is_taken_from_readings_far_apart() {
        let mut clocks = Clocks::default();
        read(&mut clocks, "0", "0");
        read(&mut clocks, "100", "101");
        assert_eq!(clocks.time("arm", &number("99")), Ok(number("99.99")));
    }

    #[test]
    fn readings_close_together_say_nothing_of_drift() {
        let mut clocks = Clocks::default();
        read(&mut clocks, "0", "0");
        read(&mut clocks, "1.5", "1");
        assert_eq!(clocks.time("arm", &number("0.5")), Ok(number("0")));
        assert_eq!(clocks.time("arm", &number("2.5")), Ok(number("2")));
    }

    #[test]
    fn a_clock_that_was_set_begins_anew() {
        let mut clocks = Clocks::default();
        read(&mut clocks, "0", "0");
        read(&mut clocks, "5000", "20");
        assert_eq!(clocks.time("arm", &number("5001")), Ok(number("21")));
    }

    #[test]
    fn what_no_clock_can_do_is_refused() {
        let mut clocks = Clocks::default();
        let stopped = clocks.read("arm", number("0"), number("0"), Some(number("0")));
        assert!(stopped.is_err());
        assert!(clocks.time("arm", &number("1")).is_err());
        let stated = clocks.read("arm", number("0"), number("0"), Some(number("1.25")));
        assert_eq!(stated, Ok(()));
        assert_eq!(clocks.time("arm", &number("10")), Ok(number("8")));
    }
}
