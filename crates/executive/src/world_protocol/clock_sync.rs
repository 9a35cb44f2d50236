//! Synchronization of the clocks that stamp a world's reports.

use std::collections::BTreeMap;

use elbowroom::num::Rational;

/// Minimum time between two readings for an estimate of the rate, in seconds.
const MIN_INTERVAL: i64 = 10;

/// Smallest and largest credible rate.
const RATES: [(i64, i64); 2] = [(1, 2), (2, 1)];

/// Resolution of times, in parts of a second.
const RESOLUTION: i64 = 1_000_000;

/// Relation between each clock and the time of the world.
#[derive(Debug, Default)]
pub(super) struct Clocks(BTreeMap<String, Clock>);

#[derive(Debug)]
struct Clock {
    /// First reading: what the clock showed, and the time of the world.
    first: (Rational, Rational),
    /// Last reading.
    last: (Rational, Rational),
    /// Rate that the world has stated: seconds of the clock per second of the world.
    stated: Option<Rational>,
}

impl Clocks {
    /// Records that the clock `name` showed `reads` at `time`. `rate`, if given, is in seconds of the clock per second
    /// of the world.
    ///
    /// # Errors
    /// When the rate is not credible; the error is a message.
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
        if rate.is_none() && elapsed >= Rational::from(MIN_INTERVAL) {
            let measured = (&now.0 - &clock.first.0) / &elapsed;
            if !is_credible(&measured) {
                // The clock was set: earlier readings are obsolete.
                clock.first.clone_from(&now);
            }
        }
        clock.last = now;
        clock.stated = rate.or(clock.stated.take());
        Ok(())
    }

    /// Returns the time of the world at which the clock showed `stamp`.
    ///
    /// # Errors
    /// When the clock was never read; the error is a message.
    pub(super) fn time(&self, name: &str, stamp: &Rational) -> Result<Rational, String> {
        let clock = self.0.get(name).ok_or_else(|| {
            format!(
                "unknown clock `{name}`; send a reading of it first: \
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
        if elapsed < Rational::from(MIN_INTERVAL) {
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
        "the clock `{name}` cannot run at {} times the speed of the world's clock; `rate` must be close to 1",
        rate.to_f64()
    )
}

fn rounded(time: &Rational) -> Rational {
    let parts = Rational::from(RESOLUTION);
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
    fn single_reading_yields_constant_offset() {
        let mut clocks = Clocks::default();
        read(&mut clocks, "1700000012.5", "12.5");
        let time = clocks.time("arm", &number("1700000010.25"));
        assert_eq!(time, Ok(number("10.25")));
    }

    /// 100 s of this clock are 101 s of the world.
    #[test]
    fn drift_is_estimated_from_distant_readings() {
        let mut clocks = Clocks::default();
        read(&mut clocks, "0", "0");
        read(&mut clocks, "100", "101");
        assert_eq!(clocks.time("arm", &number("99")), Ok(number("99.99")));
    }

    #[test]
    fn close_readings_yield_no_drift() {
        let mut clocks = Clocks::default();
        read(&mut clocks, "0", "0");
        read(&mut clocks, "1.5", "1");
        assert_eq!(clocks.time("arm", &number("0.5")), Ok(number("0")));
        assert_eq!(clocks.time("arm", &number("2.5")), Ok(number("2")));
    }

    #[test]
    fn clock_that_was_set_is_read_afresh() {
        let mut clocks = Clocks::default();
        read(&mut clocks, "0", "0");
        read(&mut clocks, "5000", "20");
        assert_eq!(clocks.time("arm", &number("5001")), Ok(number("21")));
    }

    #[test]
    fn incredible_rate_is_rejected() {
        let mut clocks = Clocks::default();
        let stopped = clocks.read("arm", number("0"), number("0"), Some(number("0")));
        assert!(stopped.is_err());
        assert!(clocks.time("arm", &number("1")).is_err());
        let stated = clocks.read("arm", number("0"), number("0"), Some(number("1.25")));
        assert_eq!(stated, Ok(()));
        assert_eq!(clocks.time("arm", &number("10")), Ok(number("8")));
    }
}
