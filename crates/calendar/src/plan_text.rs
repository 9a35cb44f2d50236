//! Plans with the dates of their times.

use std::fmt::Write as _;

use elbowroom_num::Rational;

use crate::Calendar;

impl Calendar {
    /// Returns the text of a plan with the date of each start as a comment, and the date of time 0
    /// before it.
    pub fn dated_plan(&self, plan: &str) -> String {
        let date = |line: &str| {
            let (time, _) = line.split_once(':')?;
            let time: Rational = time.trim().parse().ok()?;
            Some(self.date(&time))
        };
        let lines: Vec<(&str, Option<String>)> =
            plan.lines().map(|line| (line, date(line))).collect();
        let dated = lines.iter().filter(|(_, date)| date.is_some());
        let width = dated
            .map(|(line, _)| line.chars().count())
            .max()
            .unwrap_or(0);
        let mut text = format!(
            "; {}
",
            self.origin()
        );
        for (line, date) in lines {
            // Writing to a string cannot fail.
            let _ = match date {
                Some(date) => writeln!(text, "{line:width$} ; {date}"),
                None => writeln!(text, "{line}"),
            };
        }
        text
    }
}
