//! Hours of a day: `8 to 17`.

use std::ops::Range;

use crate::zone::{DAY, SECOND, TextError};

/// Reads hours as a range of milliseconds since the beginning of the day. The range ends on the
/// next day if its end is not later than its start: `22 to 6`.
///
/// # Errors
/// The text has another form, or the hours are empty.
pub(crate) fn read(text: &str) -> Result<Range<i64>, TextError> {
    let ends = text.split_once(" to ");
    let ends = ends.and_then(|(start, end)| Some((time(start)?, time(end)?)));
    let Some((start, end)) = ends.filter(|(start, _)| *start < DAY) else {
        let message = format!("`{text}` is not a range of hours");
        return Err((
            message,
            "write them like `8 to 17` or `8:30 to 12`".to_owned(),
        ));
    };
    if start == end {
        let message = format!("the window `{text}` is empty");
        return Err((message, "for the whole day, write `0 to 24`".to_owned()));
    }
    Ok(start..if start < end { end } else { end + DAY })
}

/// Reads `H`, `H:MM` or `H:MM:SS`, at most 24:00.
fn time(text: &str) -> Option<i64> {
    let mut parts = text.trim().split(':').map(|part| {
        let is_number = !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
        is_number.then(|| part.parse::<i64>().ok()).flatten()
    });
    let hours = parts.next()??;
    let minutes = parts.next().unwrap_or(Some(0))?;
    let seconds = parts.next().unwrap_or(Some(0))?;
    let is_time = parts.next().is_none() && hours <= 24 && minutes < 60 && seconds < 60;
    let time = is_time.then(|| ((hours * 60 + minutes) * 60 + seconds) * SECOND)?;
    (time <= DAY).then_some(time)
}

#[cfg(test)]
mod tests {
    use super::read;

    const MINUTE: i64 = 60_000;

    #[test]
    fn hours_may_pass_midnight() {
        assert_eq!(read("8 to 17"), Ok(480 * MINUTE..1020 * MINUTE));
        assert_eq!(read("8:30 to 12:15"), Ok(510 * MINUTE..735 * MINUTE));
        assert_eq!(read("22 to 6"), Ok(1320 * MINUTE..1800 * MINUTE));
        assert_eq!(read("0 to 24"), Ok(0..1440 * MINUTE));
    }

    #[test]
    fn texts_that_are_no_hours_are_refused() {
        for text in [
            "8 - 17",
            "8 to 25",
            "24 to 8",
            "8:60 to 9",
            "8: to 9",
            "+8 to 9",
            "8 to",
        ] {
            assert!(
                read(text).is_err_and(|it| it.0.ends_with("is not a range of hours")),
                "{text}"
            );
        }
        assert!(read("8 to 8:00").is_err_and(|it| it.0.contains("is empty")));
    }
}
