//! Parser of one line of a plan, or of a planner's log. It does not know the domain.

mod cursor;

use std::ops::Range;

use crate::plan_text::form::Form;
use cursor::Cursor;

/// The kind of a line of a planner's log, for programs that read a log while it is being written.
///
/// A plan is a run of [`LineKind::Timed`] and [`LineKind::Broken`] lines, perhaps with blank ones
/// between; separators and noise end it. [`read_plan`](crate::read_plan) reads such a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineKind {
    /// Nothing, or a comment without information.
    Blank,
    /// The start of a plan, or of the next plan.
    Separator,
    /// Any other output of a planner.
    Noise,
    /// Actions with times.
    Timed,
    /// A line that begins like an action with a time. Whether it is an action depends on the names
    /// in the domain.
    Broken,
    /// Actions without times: a classical plan, or something else in parentheses.
    Untimed,
}

impl LineKind {
    /// Returns the kind of this line.
    pub fn of(text: &str) -> Self {
        match line(text.trim_end(), 0) {
            Line::Blank | Line::Rule => Self::Blank,
            Line::Heading(_) => Self::Separator,
            Line::Noise => Self::Noise,
            Line::Broken(..) => Self::Broken,
            Line::Steps(steps) => match steps.first() {
                Some(step) if step.form == Form::Words => Self::Broken,
                Some(step) if step.time.is_some() => Self::Timed,
                Some(step) if step.form == Form::Ipc => Self::Untimed,
                _ => Self::Noise,
            },
        }
    }
}

/// The kind of a line.
#[derive(Debug, PartialEq)]
pub(super) enum Line<'s> {
    /// Nothing, or a comment without information.
    Blank,
    /// The line begins another plan of the same log. The range is that of the heading's own words.
    Heading(Range<usize>),
    /// A ruler, such as `-----`.
    Rule,
    /// Any other output of a planner.
    Noise,
    /// Actions.
    Steps(Vec<RawStep<'s>>),
    /// A line that begins like an action but is none: the position of the error, and the expected
    /// text.
    Broken(usize, &'static str),
}

/// An action as written. Positions are bytes from the beginning of the text.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RawStep<'s> {
    /// The notation.
    pub(super) form: Form,
    /// The number before the action: its time, or its position where [`Form::is_sequential`].
    pub(super) time: Option<Word<'s>>,
    /// The action's name and arguments; at least the name.
    pub(super) words: Vec<Word<'s>>,
    /// The duration.
    pub(super) duration: Option<Word<'s>>,
    /// The unit after the duration, which is ignored.
    pub(super) unit: Option<Word<'s>>,
    /// Counter of equal actions in happenings.
    pub(super) counter: Option<Word<'s>>,
}

impl RawStep<'_> {
    /// Returns the range of the action's name and arguments.
    pub(super) fn range(&self) -> Range<usize> {
        let first = self.words.first().map_or(0, |word| word.range.start);
        first..self.words.last().map_or(first, |word| word.range.end)
    }
}

/// A word and its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Word<'s> {
    pub(super) text: &'s str,
    pub(super) range: Range<usize>,
}

/// Parses a line that begins at byte `start` of its text.
pub(super) fn line(text: &str, start: usize) -> Line<'_> {
    let mut cursor = Cursor::new(text, start);
    cursor.skip_space();
    if cursor.is_done_or_comment() {
        return if is_heading_comment(text) {
            let indent = text.len() - text.trim_start().len();
            Line::Heading(start + indent..start + text.trim_end().len())
        } else {
            Line::Blank
        };
    }
    if is_rule(text) {
        return Line::Rule;
    }
    if !text.trim_start().starts_with('(')
        && let Some(own) = heading(text)
    {
        return Line::Heading(start + own.start..start + own.end);
    }
    let mut steps: Vec<RawStep<'_>> = Vec::new();
    while !cursor.is_done_or_comment() {
        let at = cursor.place();
        match cursor.step() {
            Ok(Some(step)) => steps.push(step),
            Ok(None) if steps.iter().any(|step| step.time.is_some()) => {
                return Line::Broken(at, "expected the end of the line after the action");
            }
            Ok(None) => return Line::Noise,
            Err((at, expected)) => return Line::Broken(at, expected),
        }
        cursor.skip_space();
    }
    match steps.as_slice() {
        [] => Line::Noise,
        // ENHSP prints the time that passes between two actions.
        [step] if step.form == Form::Words && is_wait_action(step) => Line::Blank,
        _ => Line::Steps(steps),
    }
}

/// Returns `true` for `0.0: -----waiting---- [10.0]`.
fn is_wait_action(step: &RawStep<'_>) -> bool {
    let name = step.words.first().map_or("", |word| word.text);
    step.words.len() == 1 && name.starts_with("--") && name.trim_matches('-') == "waiting"
}

/// Returns `true` for three or more times the same sign.
fn is_rule(text: &str) -> bool {
    let text = text.trim();
    ['-', '=', '*', '_', '~', '#']
        .iter()
        .any(|&sign| text.len() >= 3 && text.chars().all(|c| c == sign))
}

/// Returns `true` for the comments that POPF and OPTIC print before each plan: `;;;; Solution
/// Found`, `; Plan found with metric 5.0`, `; States evaluated: 12`, `; States evaluated so far:
/// 12`; and for `; Plan found`, which this project's program for the engines of unified-planning
/// prints. Any other comment concerns the steps around it.
fn is_heading_comment(text: &str) -> bool {
    const BEFORE_NUMBERS: &[&str] = &[
        "; Plan found with metric ",
        "; States evaluated: ",
        "; States evaluated so far: ",
    ];
    let text = text.trim();
    let mut numbers = BEFORE_NUMBERS
        .iter()
        .filter_map(|own| text.strip_prefix(own));
    let is_number = |own: &str| own.trim().parse::<f64>().is_ok();
    matches!(text, ";;;; Solution Found" | "; Plan found") || numbers.any(is_number)
}

/// Returns the range of the words that planners print before a plan, or between a plan and a better
/// one, relative to the beginning of `text`, which is not a comment. An action may follow them:
/// `Solution found: film`.
fn heading(text: &str) -> Option<Range<usize>> {
    /// Beginnings of headings, after signs.
    const BEGINNINGS: &[&str] = &[
        "all goal deadlines now no later than",
        "ff: found legal plan",
        "ff: found plan",
        "found new plan",
        "found plan",
        "found solution",
        "plan computed",
        "plan found",
        "sequentialplan:",
        "solution found",
        "solution number",
        "timetriggeredplan:",
    ];
    /// Headings that are whole lines, without signs.
    const LINES: &[&str] = &["plan", "rescheduled plan"];
    let whole = text.trim_end();
    let mut text = whole.trim_start();
    // Fast Downward: `[t=0.003s, 10084 KB] Solution found!`.
    if let Some((_, behind)) = text.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
        text = behind;
    }
    let text = text.trim_start_matches(|c: char| !c.is_alphanumeric());
    let begin = whole.len() - text.len();
    // Steps are longer than all of these words.
    let head: String = text
        .chars()
        .take(48)
        .collect::<String>()
        .to_ascii_lowercase();
    // unified-planning: `plan: TimeTriggeredPlan:`.
    let own = head.strip_prefix("plan: ").unwrap_or(&head);
    let skipped = head.len() - own.len();
    if let Some(words) = BEGINNINGS.iter().find(|words| own.starts_with(**words)) {
        return Some(begin..begin + skipped + words.len());
    }
    let is_line = LINES.contains(&own.trim_end_matches(|c: char| !c.is_alphanumeric()));
    is_line.then_some(begin..whole.len())
}

#[cfg(test)]
mod tests;
