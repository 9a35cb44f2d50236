//! Text that may contain an action, although the reader cannot parse it.
//!
//! Log text around a plan is skipped. A mistyped action must not be skipped with it, because the
//! verdict would be about another plan than the one written. So text that looks like an action
//! in any way is an error.

use std::ops::Range;

use super::form::Form;
use super::line::{LineKind, RawStep, Word};
use super::vocabulary::Vocabulary;

/// Phrases of planners that may contain the name of an action or words in parentheses, in lower
/// case. They are blanked before the line is searched.
const HARMLESS: &[&str] = &[
    "(ignoring no-moving-targets-rule)",
    "(real) bound",
    "as follows",
    "best first search",
    "during search (zero-crossing)",
    "int hash set load factor",
    "metric (search)",
    "plan cost",
    "plan length",
    "plan quality",
    "search configuration",
    "search steps",
    "search time",
    "state(s)",
    "step(s)",
    "with cost",
    "with metric",
];

/// Words that planners print at the beginning or end of a line of prose, in lower case: `Running search`, `Plan Succeeded`.
const LOG_WORDS: &[&str] = &[
    "action",
    "actions",
    "best",
    "complete",
    "cost",
    "defined",
    "done",
    "end",
    "failed",
    "file",
    "finish",
    "finished",
    "found",
    "goal",
    "goals",
    "init",
    "initial",
    "limit",
    "limits",
    "metric",
    "no",
    "none",
    "number",
    "plan",
    "planner",
    "planning",
    "problem",
    "run",
    "search",
    "solution",
    "solved",
    "start",
    "state",
    "states",
    "step",
    "steps",
    "stop",
    "succeeded",
    "time",
];

/// Opening and closing brackets apart from parentheses.
const BRACKETS: &str = "[]{}<>（）［］｛｝＜＞【】「」〈〉《》⟨⟩";

/// A piece of a line.
#[derive(Clone, Copy)]
enum Piece<'s> {
    Word {
        text: &'s str,
        at: usize,
    },
    /// An opening parenthesis; `is_attached` to the word before, as in `step(s)`.
    Open {
        at: usize,
        is_attached: bool,
    },
    Close,
    Bracket,
    /// A sign that may separate the arguments of an action: a comma, a bar, a quotation mark.
    Separator,
    Other,
}

impl Piece<'_> {
    fn is_word(&self) -> bool {
        matches!(self, Self::Word { .. })
    }

    fn is_object(&self, vocabulary: &Vocabulary) -> bool {
        matches!(self, Self::Word { text, .. } if vocabulary.object(text).is_some())
    }
}

/// Returns the range of a possible action in `text`, relative to its beginning.
///
/// Possible actions are:
///
/// - an action of the domain ([`known`]);
/// - a line that begins with the name of an action, and has one of the objects, or nothing but
///   numbers;
/// - words in parentheses on a line with a number;
/// - a number, words, and a number in brackets;
/// - words and a whole number in parentheses, or a word and nothing but objects;
/// - a row of a table with objects and one other word;
/// - the name of an action without parameters at the beginning or end of prose, or after a colon.
pub(super) fn possible_action(text: &str, vocabulary: &Vocabulary) -> Option<Range<usize>> {
    let text = &blank_phrases(text);
    let pieces = pieces(text);
    known(&pieces, vocabulary)
        .or_else(|| words_and_number(text, &pieces))
        .or_else(|| words_and_duration(text, &pieces))
        .or_else(|| leading_name(&pieces, vocabulary))
        .or_else(|| words_and_cost(text, &pieces))
        .or_else(|| word_and_objects(&pieces, vocabulary))
        .or_else(|| table_row(text, &pieces, vocabulary))
        .or_else(|| name_in_prose(text, &pieces, vocabulary))
}

/// Returns the range of a possible action in the text before or after a heading's own words: one
/// that [`possible_action`] finds by its name or its objects, the name of any action, or an action
/// with a time.
pub(super) fn action_beside_heading(text: &str, vocabulary: &Vocabulary) -> Option<Range<usize>> {
    let text = &blank_phrases(text);
    let pieces = pieces(text);
    let named = pieces.iter().find_map(|piece| match *piece {
        Piece::Word { text, at } => vocabulary.schema(text).map(|_| at..at + text.len()),
        _ => None,
    });
    let timed = || {
        let step = text.trim_start_matches(|c: char| !c.is_alphanumeric());
        matches!(LineKind::of(step), LineKind::Timed | LineKind::Broken)
            .then_some(text.len() - step.len()..text.trim_end().len())
    };
    named
        .or_else(|| known(&pieces, vocabulary))
        .or_else(|| word_and_objects(&pieces, vocabulary))
        .or_else(timed)
}

/// Returns the range of a text that is a single word, such as the name of an action without
/// arguments.
pub(super) fn single_word(text: &str) -> Option<Range<usize>> {
    match pieces(text)[..] {
        [Piece::Word { text, at }] if text.starts_with(char::is_alphabetic) => {
            Some(at..at + text.len())
        }
        _ => None,
    }
}

/// Returns the range of the name of an action that has a number or a bracket anywhere on the line,
/// or as many objects after it as it has parameters.
fn known(pieces: &[Piece<'_>], vocabulary: &Vocabulary) -> Option<Range<usize>> {
    let is_sign = |piece: &Piece<'_>| match piece {
        Piece::Open { .. } | Piece::Close | Piece::Bracket => true,
        Piece::Word { text, .. } => is_numbered(text, vocabulary),
        Piece::Separator | Piece::Other => false,
    };
    let has_sign = pieces.iter().any(is_sign);
    // Counted once, so that reading takes linear time in the length of a line.
    let mut objects = pieces.iter().filter(|it| it.is_object(vocabulary)).count();
    pieces.iter().find_map(|piece| {
        objects -= usize::from(piece.is_object(vocabulary));
        let &Piece::Word { text, at } = piece else {
            return None;
        };
        let is_action = match vocabulary.parameters(text) {
            Some(parameters) => has_sign || parameters > 0 && objects >= parameters,
            None => is_number_attached(text, vocabulary) || vocabulary.is_joined(text, has_sign),
        };
        is_action.then_some(at..at + text.len())
    })
}

/// Returns `true` for a word with a digit that is not a name of the task: `3`, `12:30`, `t1`.
fn is_numbered(word: &str, vocabulary: &Vocabulary) -> bool {
    word.contains(char::is_numeric)
        && vocabulary.object(word).is_none()
        && vocabulary.parameters(word).is_none()
        && !vocabulary.is_joined(word, true)
}

/// Returns `true` for a number attached to the name of an action: `6snap`.
fn is_number_attached(word: &str, vocabulary: &Vocabulary) -> bool {
    let name = word.trim_start_matches(|c: char| !c.is_alphabetic());
    is_number(word) && vocabulary.parameters(name).is_some()
}

/// Returns an action at the beginning of the line with a part of its arguments: `charge [3]`,
/// `go: r1`.
fn leading_name(pieces: &[Piece<'_>], vocabulary: &Vocabulary) -> Option<Range<usize>> {
    let first = pieces.iter().position(Piece::is_word)?;
    let Piece::Word { text, at } = pieces[first] else {
        return None;
    };
    vocabulary.parameters(text)?;
    let mut words = pieces[first + 1..].iter().filter(|piece| piece.is_word());
    let has_object = words.clone().any(|piece| piece.is_object(vocabulary));
    let has_numbers_only =
        words.all(|piece| matches!(piece, Piece::Word { text, .. } if is_number(text)));
    (has_object || has_numbers_only).then_some(at..at + text.len())
}

/// Returns the range of `jump high (1)`: Fast Downward prints the cost after each action.
fn words_and_cost(text: &str, pieces: &[Piece<'_>]) -> Option<Range<usize>> {
    let (before, cost) = text.trim_end().strip_suffix(')')?.rsplit_once('(')?;
    let is_cost = !cost.is_empty() && cost.bytes().all(|byte| byte.is_ascii_digit());
    let is_plain = |c: char| c.is_alphanumeric() || c.is_whitespace() || matches!(c, '-' | '_');
    let Some(&Piece::Word { text, at }) = pieces.first() else {
        return None;
    };
    let is_name = text.starts_with(char::is_alphabetic);
    (is_cost && is_name && before.chars().all(is_plain)).then_some(at..at + text.len())
}

/// Returns the range of `jump r1 l2`, `- jump(r1, l2)` or `40.0 jump r1 l2`: every word after the
/// first is an object. A bullet or a number may precede it, and brackets and commas may separate
/// the words.
fn word_and_objects(pieces: &[Piece<'_>], vocabulary: &Vocabulary) -> Option<Range<usize>> {
    let is_before = |piece: &Piece<'_>| match piece {
        Piece::Word { text, .. } => is_number(text),
        _ => true,
    };
    let first = pieces.iter().position(|piece| !is_before(piece))?;
    let Piece::Word { text, at } = pieces[first] else {
        return None;
    };
    let mut objects = pieces[first + 1..].iter().filter(|piece| {
        let is_bracket = matches!(piece, Piece::Open { .. } | Piece::Close | Piece::Bracket);
        !is_bracket && !matches!(piece, Piece::Separator)
    });
    let is_action = text.starts_with(char::is_alphabetic)
        && objects.clone().next().is_some()
        && objects.all(|piece| piece.is_object(vocabulary));
    is_action.then_some(at..at + text.len())
}

/// Returns the range of `|40|jump|r1 l2|20|`: apart from numbers, every word but one is an object.
fn table_row(text: &str, pieces: &[Piece<'_>], vocabulary: &Vocabulary) -> Option<Range<usize>> {
    let is_row = text.contains('|') && !pieces.iter().any(|it| matches!(it, Piece::Other));
    if !is_row || !pieces.iter().any(|piece| piece.is_object(vocabulary)) {
        return None;
    }
    let mut others = pieces.iter().filter_map(|piece| match *piece {
        Piece::Word { text, at } if !is_number(text) && !piece.is_object(vocabulary) => {
            Some(at..at + text.len())
        }
        _ => None,
    });
    others.next().filter(|_| others.next().is_none())
}

/// Returns the range of a name in prose: `executing: film`, `then film`, `film again`.
fn name_in_prose(
    text: &str,
    pieces: &[Piece<'_>],
    vocabulary: &Vocabulary,
) -> Option<Range<usize>> {
    let words = || pieces.iter().filter(|piece| piece.is_word());
    let last = words().count().checked_sub(1)?;
    words().enumerate().find_map(|(index, piece)| {
        let &Piece::Word { text: name, at } = piece else {
            return None;
        };
        let is_behind_sign = || text[..at].trim_end().ends_with([':', '=', '>']);
        let is_action = vocabulary.parameters(name) == Some(0)
            && (index == 0 || index == last || is_behind_sign())
            && !LOG_WORDS.contains(&name.to_ascii_lowercase().as_str());
        (last > 0 && is_action).then_some(at..at + name.len())
    })
}

/// Returns the range of words in parentheses on a line with a number.
fn words_and_number(text: &str, pieces: &[Piece<'_>]) -> Option<Range<usize>> {
    let mut group = None;
    let mut has_number = false;
    for piece in pieces {
        match *piece {
            Piece::Open { at, is_attached } => {
                // Up to the next parenthesis, so that all groups together take linear time.
                let inside = text[at + 1..].split(['(', ')']).next().unwrap_or("");
                let behind = text[at + 1 + inside.len()..].strip_prefix(')');
                let begin = inside.trim_start_matches(|c: char| !c.is_alphanumeric());
                let is_named = begin.starts_with(char::is_alphabetic);
                let is_word = !inside.trim().contains(char::is_whitespace);
                // A unit or kind, as in `Planning Time (msec): 200`; a plural, as in `step(s)`.
                let is_label = is_word && behind.is_some_and(|it| it.starts_with([':', '=']))
                    || is_attached && matches!(inside, "s" | "es" | "n");
                // As in ROSPlan's log: `KCL: (/rosplan_planner_interface) (problem.pddl) Planning complete`.
                let is_path = inside.starts_with('/') || inside.contains(".pddl");
                if is_named && !is_label && !(is_word && is_path) {
                    group.get_or_insert(at..at + 1);
                }
            }
            Piece::Word { text, .. } => has_number |= is_number(text),
            Piece::Close | Piece::Bracket | Piece::Separator | Piece::Other => {}
        }
    }
    group.filter(|_| has_number)
}

/// Returns the range of `6 launch rocket [3]`.
fn words_and_duration(text: &str, pieces: &[Piece<'_>]) -> Option<Range<usize>> {
    let mut words = pieces.iter().filter_map(|piece| match *piece {
        Piece::Word { text, at } => Some((text, at)),
        _ => None,
    });
    let ((time, _), (name, at)) = (words.next()?, words.next()?);
    let is_action = is_number(time) && name.starts_with(char::is_alphabetic);
    let mut brackets = text.split('[').skip(1);
    let has_duration = brackets.any(|inside| is_number(inside.trim_start()));
    (is_action && has_duration).then_some(at..at + name.len())
}

/// Reads the whole text as the step of a plan without times: `name argument …`, optionally with a
/// cost in the notation of Fast Downward, `(1)`.
pub(super) fn classical<'s>(
    text: &'s str,
    start: usize,
    vocabulary: &Vocabulary,
) -> Option<RawStep<'s>> {
    let text = match text.split_once(';') {
        Some((before, _)) => before,
        None => text,
    };
    let trimmed = text.trim_end();
    let is_cost = |cost: &str| !cost.is_empty() && cost.bytes().all(|byte| byte.is_ascii_digit());
    let text = match trimmed.strip_suffix(')').and_then(|it| it.rsplit_once('(')) {
        Some((before, cost)) if is_cost(cost) => before,
        Some(_) => return None,
        None => trimmed,
    };
    let words: Vec<Word<'_>> = pieces(text)
        .into_iter()
        .map(|piece| match piece {
            Piece::Word { text, at } => Some(Word {
                text,
                range: start + at..start + at + text.len(),
            }),
            _ => None,
        })
        .collect::<Option<_>>()?;
    let (name, arguments) = words.split_first()?;
    let is_action = vocabulary.parameters(name.text)? == arguments.len()
        && arguments
            .iter()
            .all(|it| vocabulary.object(it.text).is_some());
    is_action.then_some(RawStep {
        form: Form::FastDownward,
        time: None,
        words,
        duration: None,
        unit: None,
        counter: None,
    })
}

/// Returns the text with blanks in place of planners' phrases and of POPF's progress,
/// `b (10.000 | 0.100)`. Positions are preserved.
fn blank_phrases(text: &str) -> String {
    let mut shown = text.to_owned();
    let lower = text.to_ascii_lowercase();
    for phrase in HARMLESS {
        for (at, _) in lower.match_indices(phrase) {
            shown.replace_range(at..at + phrase.len(), &" ".repeat(phrase.len()));
        }
    }
    let mut at = 0;
    while let Some(found) = shown[at..].find("b (") {
        let begin = at + found;
        let inside = begin + "b (".len();
        let length = shown[inside..].find(|c: char| !(c.is_ascii_digit() || " .|-".contains(c)));
        let end = inside + length.unwrap_or(0);
        if shown[end..].starts_with(')') && shown[inside..end].contains('|') {
            shown.replace_range(begin..=end, &" ".repeat(end + 1 - begin));
        }
        at = inside.max(end);
    }
    shown
}

fn pieces(text: &str) -> Vec<Piece<'_>> {
    let mut pieces = Vec::new();
    let mut word: Option<usize> = None;
    for (at, character) in text.char_indices().chain([(text.len(), ' ')]) {
        // Names consist of letters, digits and signs of ASCII; any other sign separates them.
        let is_part = character.is_alphanumeric()
            || character.is_ascii_graphic() && !"()[]{}<>,;:=\"'`|#*".contains(character);
        if is_part {
            word.get_or_insert(at);
            continue;
        }
        let mut is_attached = false;
        if let Some(from) = word.take() {
            let whole = &text[from..at];
            // A full stop, a bullet or a dash is not part of a name.
            let trimmed = whole.trim_end_matches(['.', '!', '?']);
            if trimmed.chars().any(char::is_alphanumeric) {
                is_attached = trimmed.len() == whole.len();
                let text = trimmed.trim_start_matches(['+', '-', '~', '.']);
                let at = from + trimmed.len() - text.len();
                pieces.push(Piece::Word { text, at });
            } else {
                pieces.push(Piece::Other);
            }
        }
        match character {
            '(' => pieces.push(Piece::Open { at, is_attached }),
            ')' => pieces.push(Piece::Close),
            ',' | '|' | '"' | '\'' | '`' => pieces.push(Piece::Separator),
            _ if BRACKETS.contains(character) => pieces.push(Piece::Bracket),
            _ if character.is_whitespace() => {}
            _ => pieces.push(Piece::Other),
        }
    }
    pieces
}

/// Returns `true` if the word is a number, optionally with a sign before and a unit after it.
fn is_number(word: &str) -> bool {
    word.trim_start_matches(|c: char| !c.is_alphanumeric())
        .starts_with(char::is_numeric)
}
