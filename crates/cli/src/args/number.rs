//! Numbers on the command line.

use elbowroom::execution::run::TimeoutRule;
use elbowroom::num::Rational;

fn number(text: &str) -> Result<Rational, String> {
    text.parse::<Rational>().map_err(|error| error.to_string())
}

pub(super) fn positive(text: &str) -> Result<Rational, String> {
    let value = number(text)?;
    if value.is_positive() {
        Ok(value)
    } else {
        Err("it must be greater than 0".to_owned())
    }
}

/// A count or a seed.
pub(super) fn integer(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("it must be a whole number from 0 to {}", u64::MAX))
}

/// Greatest number of failures of an action.
pub(super) fn retries(text: &str) -> Result<u64, String> {
    match integer(text)? {
        0 => Err("it must be at least 1: with 0, no action may fail".to_owned()),
        number => Ok(number),
    }
}

/// A count that can be held in memory.
pub(super) fn count(text: &str) -> Result<usize, String> {
    let count = integer(text)?;
    usize::try_from(count).map_err(|_| format!("it must be at most {}", usize::MAX))
}

pub(super) fn factor(text: &str) -> Result<Rational, String> {
    let value = number(text)?;
    // Beyond these limits, the world would take years, or its clock would have no resolution left.
    if value < Rational::new(1, 1_000_000) || value > Rational::from(1_000_000_000) {
        return Err("it must lie between 0.000001 and 1000000000".to_owned());
    }
    Ok(value)
}

/// Reads the rule that sets time-outs.
pub(super) fn timeout(text: &str) -> Result<TimeoutRule, String> {
    text.parse::<TimeoutRule>()
        .map_err(|error| format!("it must be {}", error.expected))
}

pub(super) fn positive_or_zero(text: &str) -> Result<Rational, String> {
    let value = number(text)?;
    if value.is_negative() {
        Err("it must not be negative".to_owned())
    } else {
        Ok(value)
    }
}

/// A number of failures, or `max`, the greatest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FaultCount(pub(crate) Option<usize>);

/// Reads the number of failures of `--faults`.
pub(super) fn fault_count(text: &str) -> Result<FaultCount, String> {
    if text == "max" {
        return Ok(FaultCount(None));
    }
    let most = elbowroom::envelope::faults::MAX_FAULTS;
    match text.parse::<usize>() {
        Ok(count) if count <= most => Ok(FaultCount(Some(count))),
        _ => Err(format!("expected a number from 0 to {most}, or `max`")),
    }
}

/// An interval of times, such as the recovery from a failure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Times(pub(crate) [Rational; 2]);

/// Reads `LOWER..UPPER`, or one time.
pub(super) fn times(text: &str) -> Result<Times, String> {
    let (lower, upper) = text.split_once("..").unwrap_or((text, text));
    let times = [
        positive_or_zero(lower.trim())?,
        positive_or_zero(upper.trim())?,
    ];
    if times[0] > times[1] {
        return Err("the lower end exceeds the upper end; write it as `LOWER..UPPER`".to_owned());
    }
    Ok(Times(times))
}
