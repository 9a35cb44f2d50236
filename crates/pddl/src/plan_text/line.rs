//! One line of a plan, or of a planner's log.

use std::ops::Range;

/// The kind of a line of a planner's log, for programs that read a log while it is being written.
///
/// A plan is a run of [`LineKind::Timed`] and [`LineKind::Broken`] lines, perhaps with blank ones
/// between; separators and noise end it. [`read_plan`](crate::read_plan) reads such a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineKind {
    /// Nothing, or a comment that says nothing.
    Blank,
    /// It announces a plan, or another one.
    Separator,
    /// Anything else a planner may say.
    Noise,
    /// Actions with times.
    Timed,
    /// It begins like an action with a time, but is none.
    Broken,
    /// Actions without times: a classical plan, or something else in parentheses.
    Untimed,
}

impl LineKind {
    /// The kind of this line.
    pub fn of(text: &str) -> Self {
        match line(text.trim_end(), 0) {
            Line::Blank => Self::Blank,
            Line::Separator => Self::Separator,
            Line::Noise => Self::Noise,
            Line::Steps(steps) if steps.iter().all(|step| step.time.is_none()) => Self::Untimed,
            Line::Steps(_) => Self::Timed,
            Line::Broken(..) => Self::Broken,
        }
    }
}

/// The kind of a line.
#[derive(Debug, PartialEq)]
pub(super) enum Line<'s> {
    /// Nothing, or a comment that says nothing.
    Blank,
    /// The line begins another plan of the same log.
    Separator,
    /// Anything else a planner may say.
    Noise,
    /// Actions.
    Steps(Vec<RawStep<'s>>),
    /// It begins like an action, but is none: where, and what is expected there.
    Broken(usize, &'static str),
}

/// An action as written. Places are bytes from the beginning of the text.
#[derive(Debug, PartialEq)]
pub(super) struct RawStep<'s> {
    /// The time before the colon.
    pub(super) time: Option<Word<'s>>,
    /// The action's name and arguments; at least the name.
    pub(super) words: Vec<Word<'s>>,
    /// The duration in brackets.
    pub(super) duration: Option<Word<'s>>,
    /// What stands beside the duration, or in its place, and is not read: a unit of time, or a
    /// number without brackets.
    pub(super) stray: Option<Word<'s>>,
}

/// A word and its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Word<'s> {
    pub(super) text: &'s str,
    pub(super) range: Range<usize>,
}

/// Takes a line apart that begins at byte `start` of its text.
pub(super) fn line(text: &str, start: usize) -> Line<'_> {
    let mut cursor = Cursor { text, at: 0, start };
    cursor.skip_space();
    if cursor.is_done() {
        return match text.find(';') {
            Some(comment) if is_announcement(&text[comment..]) => Line::Separator,
            _ => Line::Blank,
        };
    }
    let mut steps = Vec::new();
    while !cursor.is_done() {
        match cursor.step() {
            Ok(Some(step)) => steps.push(step),
            Ok(None) if steps.is_empty() && is_announcement(text) => return Line::Separator,
            Ok(None) if steps.is_empty() => return Line::Noise,
            // What planners add behind an action.
            Ok(None) => {
                let last = steps.last_mut();
                if let Some(step) = last.filter(|step: &&mut RawStep<'_>| step.duration.is_none()) {
                    step.stray = cursor.bare_number();
                }
                break;
            }
            Err((at, expected)) => return Line::Broken(start + at, expected),
        }
        cursor.skip_space();
    }
    Line::Steps(steps)
}

/// Whether planners print this before a plan, or between a plan and a better one.
fn is_announcement(text: &str) -> bool {
    const ANNOUNCEMENTS: &[&str] = &[
        "plan found",
        "solution found",
        "solution number",
        "plan computed",
        "found plan",
        "found new plan",
        "states evaluated",
    ];
    let text = text.to_ascii_lowercase();
    ANNOUNCEMENTS.iter().any(|words| text.contains(words))
}

/// The number in brackets, and what stands behind it.
type Duration<'s> = (Option<Word<'s>>, Option<Word<'s>>);

/// A place in a line.
struct Cursor<'s> {
    text: &'s str,
    at: usize,
    /// Where the line begins in its text.
    start: usize,
}

impl<'s> Cursor<'s> {
    fn rest(&self) -> &'s str {
        &self.text[self.at..]
    }

    fn is_done(&self) -> bool {
        self.rest().is_empty()
    }

    /// Skips spaces, and a comment.
    fn skip_space(&mut self) {
        let rest = self.rest();
        let trimmed = rest.trim_start_matches(|c: char| c.is_whitespace() || c == '\0');
        self.at += rest.len() - trimmed.len();
        if trimmed.starts_with(';') {
            self.at = self.text.len();
        }
    }

    fn eat(&mut self, character: char) -> bool {
        let found = self.rest().starts_with(character);
        if found {
            self.at += character.len_utf8();
        }
        found
    }

    fn word(&mut self, ends: impl Fn(char) -> bool) -> Word<'s> {
        let rest = self.rest();
        let text = &rest[..rest.find(ends).unwrap_or(rest.len())];
        let from = self.start + self.at;
        self.at += text.len();
        Word {
            text,
            range: from..from + text.len(),
        }
    }

    /// `time: (name argument …) [duration]`, all but the parenthesis optional. `None` if this
    /// is something else.
    fn step(&mut self) -> Result<Option<RawStep<'s>>, (usize, &'static str)> {
        let begin = self.at;
        let time = self.time();
        if !self.eat('(') {
            self.at = begin;
            return if time.is_some() {
                Err((begin, "expected `(` after the time"))
            } else {
                Ok(None)
            };
        }
        let mut words = Vec::new();
        loop {
            self.skip_space();
            if self.eat(')') {
                break;
            }
            let word = self.word(|c| c.is_whitespace() || matches!(c, '(' | ')' | '[' | ';'));
            if word.text.is_empty() {
                return broken(
                    time.is_some(),
                    self.at,
                    "expected `)` at the end of the action",
                );
            }
            words.push(word);
        }
        if words.is_empty() {
            return broken(
                time.is_some(),
                begin,
                "expected the name of an action in the parentheses",
            );
        }
        self.skip_space();
        while self.eat(')') {
            self.skip_space();
        }
        let (duration, stray) = self.duration()?;
        Ok(Some(RawStep {
            time,
            words,
            duration,
            stray,
        }))
    }

    /// `12.5 :`
    fn time(&mut self) -> Option<Word<'s>> {
        let begin = self.at;
        let word = self.word(|c| c.is_whitespace() || matches!(c, ':' | '(' | ';'));
        self.skip_space();
        let is_number = word
            .text
            .trim_start_matches(['-', '+', '.'])
            .starts_with(|c: char| c.is_ascii_digit());
        if is_number && self.eat(':') {
            self.skip_space();
            Some(word)
        } else {
            self.at = begin;
            None
        }
    }

    /// A number that stands alone, as a duration does to which somebody gave no brackets.
    fn bare_number(&mut self) -> Option<Word<'s>> {
        let word = self.word(char::is_whitespace);
        word.text.parse::<f64>().is_ok().then_some(word)
    }

    /// `[10.0]`, `[D:10.0; C:0.1]`; the second word is what stands behind the number.
    fn duration(&mut self) -> Result<Duration<'s>, (usize, &'static str)> {
        if !self.eat('[') {
            return Ok((None, None));
        }
        self.skip_space();
        if self.rest().starts_with(['D', 'd']) {
            self.at += 1;
            self.skip_space();
            self.eat(':');
            self.skip_space();
        }
        let duration = self.word(|c| c.is_whitespace() || matches!(c, ']' | ';'));
        let Some(end) = self.rest().find(']') else {
            return Err((self.at, "expected `]` after the duration"));
        };
        let behind = &self.rest()[..end];
        let unit = behind.trim();
        let from = self.start + self.at + (behind.len() - behind.trim_start().len());
        let stray = (!unit.is_empty() && !unit.starts_with(';')).then_some(Word {
            text: unit,
            range: from..from + unit.len(),
        });
        self.at += end + 1;
        if duration.text.is_empty() {
            return Err((self.at - 1, "expected a duration in the brackets"));
        }
        Ok((Some(duration), stray))
    }
}

/// A line with a time is meant as an action; others may be anything.
fn broken<T>(
    has_time: bool,
    at: usize,
    expected: &'static str,
) -> Result<Option<T>, (usize, &'static str)> {
    if has_time {
        Err((at, expected))
    } else {
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `time/word word/duration` of each step.
    fn shown(text: &str) -> String {
        match line(text, 0) {
            Line::Steps(steps) => steps
                .iter()
                .map(|step| {
                    let text =
                        |word: &Option<Word>| word.as_ref().map_or("", |w| w.text).to_owned();
                    let words: Vec<_> = step.words.iter().map(|w| w.text).collect();
                    format!(
                        "{}/{}/{}",
                        text(&step.time),
                        words.join(" "),
                        text(&step.duration)
                    )
                })
                .collect::<Vec<_>>()
                .join(", "),
            other => format!("{other:?}"),
        }
    }

    #[test]
    fn each_planner_has_its_own_way_to_write_an_action() {
        assert_eq!(
            shown("0.000: (move a b)  [12.000]"),
            "0.000/move a b/12.000"
        );
        assert_eq!(
            shown("0.0002:   (SWAP_6_7 Q6 Q7) [D:2.0000; C:0.1000]"),
            "0.0002/SWAP_6_7 Q6 Q7/2.0000"
        );
        assert_eq!(shown(" 3 : ( go )) ; home"), "3/go/");
        assert_eq!(shown("(a b)"), "/a b/");
        assert_eq!(shown("0: (a) [1] 1: (b) [2]"), "0/a/1, 1/b/2");
    }

    #[test]
    fn what_is_not_an_action_is_noise() {
        assert_eq!(shown("b (10.000 | 0.100)b (8.000 | 0.200)"), "Noise");
        assert_eq!(shown("; Plan found with metric 12.0"), "Separator");
        assert_eq!(shown(";;;; Solution Found"), "Separator");
        assert_eq!(shown("; then go home"), "Blank");
        assert_eq!(shown("Total time: 0.03"), "Noise");
    }

    #[test]
    fn a_broken_action_says_what_is_expected_where() {
        assert!(matches!(line("0.0: (a b", 0), Line::Broken(9, _)));
        assert!(matches!(line("0.0: a b", 0), Line::Broken(0, _)));
        assert!(matches!(line("0.0: (a b) [3", 0), Line::Broken(13, _)));
    }
}
