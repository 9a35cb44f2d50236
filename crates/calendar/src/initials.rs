//! Problem with the calendar's timed initials.

use std::fmt::Write as _;

use elbowroom_num::Rational;
use elbowroom_pddl::with_initials;
use elbowroom_text::Source;

use crate::Calendar;

impl Calendar {
    /// Returns the text of the problem with the calendar's facts and values at the end of its
    /// `:init`. The names of both files are the name of the text.
    pub fn timed_problem(&self, problem: &Source, calendar: &Source) -> Source {
        let name = format!("{} with {}", problem.name(), calendar.name());
        let lines = self.initials(calendar.name());
        Source::new(name, with_initials(problem.text(), &lines))
    }

    /// Returns the facts and values at time 0, then the timed initials by time, one a line.
    fn initials(&self, name: &str) -> String {
        let mut text = String::new();
        // A line break in a file's name must not end the comment.
        let name = name.replace(char::is_control, " ");
        let _ = writeln!(text, "; {name}: {}", self.origin());
        let mut timed: Vec<(Rational, String)> = Vec::new();
        let mut add = |time: Rational, what: String| {
            if time.is_zero() {
                let _ = writeln!(text, "{what}");
            } else {
                timed.push((time, what));
            }
        };
        for (fact, windows) in self.windows() {
            for window in windows {
                add(window.opens, fact.to_owned());
                if let Some(closes) = window.closes {
                    add(closes, format!("(not {fact})"));
                }
            }
        }
        for (fluent, values) in self.values() {
            for (time, value) in values {
                add(time, format!("(= {fluent} {})", number(&value)));
            }
        }
        timed.sort_by(|(one, _), (other, _)| one.cmp(other));
        for (time, what) in timed {
            let _ = writeln!(text, "(at {} {what}) ; {}", number(&time), self.date(&time));
        }
        text
    }
}

/// Returns the number as a decimal if that is exact, and as a fraction otherwise.
fn number(value: &Rational) -> String {
    let decimal = value.to_decimal(60);
    match decimal.parse::<Rational>() {
        Ok(read) if read == *value => decimal,
        _ => value.to_string(),
    }
}
