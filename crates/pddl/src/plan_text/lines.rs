//! Selection of the lines that form the last plan of a text.
//!
//! Each line that is not blank is one of: a comment, a heading that begins another plan, a step, a
//! mistake, or log text. Log text is skipped only before the first and after the last step, and
//! only if it contains nothing that may be an action.

use std::ops::Range;

use elbowroom_text::{Source, Span};

use super::action_like_text::{action_beside_heading, classical, possible_action, single_word};
use super::form::Form;
use super::line::{Line, RawStep, line};
use super::vocabulary::Vocabulary;

/// Steps of the last plan in a text, in their order, and the lines that are not read.
#[derive(Default)]
pub(super) struct LastPlan<'s> {
    pub(super) steps: Vec<RawStep<'s>>,
    pub(super) mistakes: Vec<Misread>,
    /// The number of plans in the text.
    pub(super) plans: usize,
    /// `true` if the text has other lines than comments and headings.
    pub(super) has_text: bool,
}

/// A line that is not read.
pub(super) struct Misread {
    pub(super) range: Range<usize>,
    pub(super) kind: MisreadKind,
}

pub(super) enum MisreadKind {
    /// It begins like an action. The text is the expected form.
    Broken(&'static str),
    /// It may contain an action.
    Possible,
    /// It is between two actions.
    Between,
}

/// A line that is not blank.
enum Entry<'s> {
    Steps(Vec<RawStep<'s>>),
    Misread(Misread),
    Rule(Range<usize>),
    Noise(Range<usize>),
}

/// Reads the lines of a text.
pub(super) fn last_plan<'s>(source: &'s Source, vocabulary: &Vocabulary) -> LastPlan<'s> {
    let mut sections = sections(source, vocabulary);
    let has_text = sections.iter().any(|section| !section.is_empty());
    sections.retain(|section| {
        let is_plan = |entry: &Entry<'_>| matches!(entry, Entry::Steps(_) | Entry::Misread(_));
        section.iter().any(is_plan)
    });
    let plans = sections.len();
    let mut plan = LastPlan {
        plans,
        has_text,
        ..LastPlan::default()
    };
    let mut last = sections.pop().unwrap_or_default();
    name_words_beside_steps(source, &mut last);
    for entry in strip_log_text(last) {
        match entry {
            Entry::Steps(steps) => plan.steps.extend(steps),
            Entry::Misread(misread) => plan.mistakes.push(misread),
            Entry::Rule(range) | Entry::Noise(range) => plan.mistakes.push(Misread {
                range,
                kind: MisreadKind::Between,
            }),
        }
    }
    plan
}

/// Returns the lines between headings.
fn sections<'s>(source: &'s Source, vocabulary: &Vocabulary) -> Vec<Vec<Entry<'s>>> {
    let text = source.text();
    let mut sections = vec![Vec::new()];
    for Span { start, end } in source
        .lines()
        .flat_map(|line| split_at_line_breaks(text, line))
    {
        let shown = text[start..end].trim_end();
        let indent = shown.len() - shown.trim_start().len();
        let range = start + indent..start + shown.len();
        let entry = match line(shown, start) {
            Line::Blank => None,
            Line::Heading(own) => {
                // The action `plan` has the same name as a heading.
                if let Some(step) = classical(shown, start, vocabulary) {
                    Some(Entry::Steps(vec![step]))
                } else {
                    sections.push(Vec::new());
                    action_next_to_heading(text, &range, &own, vocabulary)
                }
            }
            Line::Rule => Some(Entry::Rule(range)),
            Line::Noise => Some(match classical(shown, start, vocabulary) {
                Some(step) => Entry::Steps(vec![step]),
                None => noise(text, range, vocabulary),
            }),
            Line::Steps(steps) => Some(Entry::Steps(steps)),
            Line::Broken(at, expected) => Some(Entry::Misread(Misread {
                range: at..at,
                kind: MisreadKind::Broken(expected),
            })),
        };
        if let Some(section) = sections.last_mut() {
            section.extend(entry);
        }
    }
    sections
}

/// Splits a line at the other signs that Unicode defines as line breaks. An editor may show a line
/// break there, so a comment ends there.
fn split_at_line_breaks(text: &str, line: Span) -> Vec<Span> {
    const BREAKS: [char; 5] = ['\u{b}', '\u{c}', '\u{85}', '\u{2028}', '\u{2029}'];
    let mut parts = Vec::new();
    let mut start = line.start;
    for (at, sign) in text[line.clone()].match_indices(BREAKS) {
        parts.push(start..line.start + at);
        start = line.start + at + sign.len();
    }
    parts.push(start..line.end);
    parts
}

/// Returns log text, unless it may contain an action.
fn noise<'s>(text: &'s str, range: Range<usize>, vocabulary: &Vocabulary) -> Entry<'s> {
    match possible_action(&text[range.clone()], vocabulary) {
        Some(place) => possible_action_entry(&range, &place),
        None => Entry::Noise(range),
    }
}

/// Returns an action on the line of a heading, next to the heading's `own` words.
fn action_next_to_heading<'s>(
    text: &'s str,
    line: &Range<usize>,
    own: &Range<usize>,
    vocabulary: &Vocabulary,
) -> Option<Entry<'s>> {
    let sides = [line.start..own.start, own.end..line.end];
    sides.into_iter().find_map(|side| {
        let place = action_beside_heading(&text[side.clone()], vocabulary)?;
        Some(possible_action_entry(&side, &place))
    })
}

/// Returns a line that may contain an action, at a position relative to the line.
fn possible_action_entry<'s>(line: &Range<usize>, place: &Range<usize>) -> Entry<'s> {
    Entry::Misread(Misread {
        range: line.start + place.start..line.start + place.end,
        kind: MisreadKind::Possible,
    })
}

/// Marks a single word on the line before or after the steps of a plan without times, where it may
/// be an action without arguments.
fn name_words_beside_steps(source: &Source, section: &mut [Entry<'_>]) {
    let text = source.text();
    let is_untimed = |entry: &Entry<'_>| match entry {
        Entry::Steps(steps) => steps.iter().all(|step| step.time.is_none()),
        _ => false,
    };
    let place = |entry: &Entry<'_>| match entry {
        Entry::Noise(range) => Some((range.clone(), single_word(&text[range.clone()])?)),
        _ => None,
    };
    let line = |at: usize| source.position(at).0;
    for index in 0..section.len() {
        let Some((range, word)) = place(&section[index]) else {
            continue;
        };
        let beside = [index.checked_sub(1), Some(index + 1)];
        let mut beside = beside
            .into_iter()
            .flatten()
            .filter_map(|it| section.get(it));
        let is_beside = beside.any(|entry| {
            let Entry::Steps(steps) = entry else {
                return false;
            };
            let steps = steps.first().map_or(range.clone(), RawStep::range);
            let is_next = line(range.start).abs_diff(line(steps.start)) == 1;
            is_untimed(entry) && is_next
        });
        if is_beside {
            section[index] = possible_action_entry(&range, &word);
        }
    }
}

/// Returns the lines of a plan without log text before the first and after the last step.
fn strip_log_text(mut section: Vec<Entry<'_>>) -> Vec<Entry<'_>> {
    let is_step = |entry: &Entry<'_>| matches!(entry, Entry::Steps(_));
    let first = section.iter().position(is_step);
    let last = section.iter().rposition(is_step);
    // Contingent-FF separates the levels of its tree by rulers.
    let is_tree = section.iter().any(|entry| match entry {
        Entry::Steps(steps) => steps.iter().any(|step| step.form == Form::ContingentFf),
        _ => false,
    });
    let mut index = 0;
    section.retain(|entry| {
        let is_inside = first.is_some_and(|it| it <= index) && last.is_some_and(|it| index <= it);
        index += 1;
        match entry {
            Entry::Rule(_) => is_inside && !is_tree,
            Entry::Noise(_) => is_inside,
            Entry::Steps(_) | Entry::Misread(_) => true,
        }
    });
    section
}
