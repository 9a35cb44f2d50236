//! Parser of the actions in one line.

use super::{RawStep, Word};
use crate::plan_text::form::Form;

/// A step, `None` for other text, or the place of a mistake with the expected form.
type Step<'s> = Result<Option<RawStep<'s>>, Mistake>;
type Mistake = (usize, &'static str);

const NO_PARENTHESIS: &str = "expected `(` after the time";
const NO_COLON: &str = "expected `:` after the time";

/// A place in a line.
pub(super) struct Cursor<'s> {
    text: &'s str,
    at: usize,
    /// Offset of the line in its text.
    start: usize,
}

impl<'s> Cursor<'s> {
    pub(super) fn new(text: &'s str, start: usize) -> Self {
        Self { text, at: 0, start }
    }

    /// Returns the position in the text.
    pub(super) fn place(&self) -> usize {
        self.start + self.at
    }

    fn rest(&self) -> &'s str {
        &self.text[self.at..]
    }

    /// Returns `true` if nothing follows but a comment.
    pub(super) fn is_done_or_comment(&self) -> bool {
        self.rest().is_empty() || self.rest().starts_with(';')
    }

    pub(super) fn skip_space(&mut self) {
        let rest = self.rest();
        let trimmed = rest.trim_start_matches(|c: char| c.is_whitespace() || c == '\0');
        self.at += rest.len() - trimmed.len();
    }

    fn eat(&mut self, text: &str) -> bool {
        let found = self.rest().starts_with(text);
        if found {
            self.at += text.len();
        }
        found
    }

    fn word(&mut self, ends: impl Fn(char) -> bool) -> Word<'s> {
        let rest = self.rest();
        let text = &rest[..rest.find(ends).unwrap_or(rest.len())];
        let from = self.place();
        self.at += text.len();
        Word {
            text,
            range: from..from + text.len(),
        }
    }

    /// Reads one action with its time and its duration.
    pub(super) fn step(&mut self) -> Step<'s> {
        let begin = self.at;
        let step = self.any_step()?;
        if step.is_none() {
            self.at = begin;
        }
        Ok(step)
    }

    fn any_step(&mut self) -> Step<'s> {
        if let Some(number) = self.step_number() {
            let Some(mut step) = self.action(Some(number))? else {
                return Err((
                    self.place(),
                    "expected an action after the number of the step",
                ));
            };
            step.form = Form::Ff;
            return self.with_duration(step);
        }
        if let Some((level, node)) = self.node() {
            return self.contingent(level, node).map(Some);
        }
        let begin = self.at;
        let time = self.word(is_delimiter);
        if !is_number(time.text) {
            self.at = begin;
            let Some(step) = self.action(None)? else {
                return Ok(None);
            };
            return self.with_duration(step);
        }
        self.skip_space();
        if self.eat(":") {
            return self.timed(time);
        }
        let is_first = self.text[..begin].trim().is_empty();
        if !is_first || !self.rest().starts_with('(') {
            return Ok(None);
        }
        // Columns without a colon. A number without a duration may number the actions.
        let Some(mut step) = self.action(Some(time.clone()))? else {
            return Ok(None);
        };
        step.form = Form::PlanSys2;
        match self.with_duration(step)? {
            Some(step) if step.duration.is_some() => Ok(Some(step)),
            _ => Err((time.range.end, NO_COLON)),
        }
    }

    /// Reads an action after `time:`.
    fn timed(&mut self, time: Word<'s>) -> Step<'s> {
        let is_spaced = !self.rest().starts_with(|c: char| c.is_ascii_digit());
        self.skip_space();
        let begin = self.at;
        let moment = match self.word(is_delimiter).text.to_ascii_lowercase().as_str() {
            "start" => Some(Form::Start),
            "end" => Some(Form::End),
            _ => None,
        };
        self.skip_space();
        if let Some(form) = moment.filter(|_| self.rest().starts_with('(')) {
            let Some(mut step) = self.action(Some(time))? else {
                return Err((self.place(), NO_PARENTHESIS));
            };
            step.form = form;
            self.skip_space();
            step.counter = self.eat("#").then(|| self.word(is_delimiter));
            return Ok(Some(step));
        }
        self.at = begin;
        let from = time.range.start;
        match self.action(Some(time))? {
            Some(step) => self.with_duration(step),
            // A clock, such as `12:30:45`.
            None if !is_spaced => Ok(None),
            None => Err((from, NO_PARENTHESIS)),
        }
    }

    /// Reads `step 0:`.
    fn step_number(&mut self) -> Option<Word<'s>> {
        let begin = self.at;
        if self.word(is_delimiter).text.eq_ignore_ascii_case("step") {
            self.skip_space();
            let number = self.word(is_delimiter);
            self.skip_space();
            if is_count(number.text) && self.eat(":") {
                self.skip_space();
                return Some(number);
            }
        }
        self.at = begin;
        None
    }

    /// Reads `3||0 ---`.
    fn node(&mut self) -> Option<(Word<'s>, Word<'s>)> {
        let begin = self.at;
        let level = self.word(|c| c.is_whitespace() || c == '|');
        if is_count(level.text) && self.eat("||") {
            let node = self.word(char::is_whitespace);
            self.skip_space();
            if self.eat("---") {
                self.skip_space();
                return Some((level, node));
            }
        }
        self.at = begin;
        None
    }

    /// Reads `NAME ARGUMENT … --- SON: 4||0`.
    fn contingent(&mut self, level: Word<'s>, node: Word<'s>) -> Result<RawStep<'s>, Mistake> {
        let mut words = Vec::new();
        loop {
            let word = self.word(char::is_whitespace);
            self.skip_space();
            if word.text == "---" || word.text.is_empty() {
                break;
            }
            words.push(word);
        }
        let at = self.place();
        if words.is_empty() {
            return Err((at, "expected the name of an action"));
        }
        let son = self.word(char::is_whitespace);
        if son.text.eq_ignore_ascii_case("TRUESON:") {
            return Err((
                at,
                "the plan branches here: only plans without branches are supported",
            ));
        }
        self.skip_space();
        self.word(char::is_whitespace);
        self.skip_space();
        if !son.text.eq_ignore_ascii_case("SON:") || !self.rest().is_empty() {
            return Err((at, "expected `SON:` and the number of the next step"));
        }
        Ok(RawStep {
            counter: Some(node),
            ..step(Form::ContingentFf, Some(level), words)
        })
    }

    /// Reads `(name argument …)`, `name(argument, …)`, or, after a time, `name argument …`.
    fn action(&mut self, time: Option<Word<'s>>) -> Step<'s> {
        let begin = self.place();
        if self.eat("(") {
            let Some(words) = self.arguments(false) else {
                return self.broken(time.as_ref(), "expected `)` at the end of the action");
            };
            if words.is_empty() {
                self.at = begin - self.start;
                return self.broken(
                    time.as_ref(),
                    "expected the name of an action in the parentheses",
                );
            }
            self.skip_space();
            while self.eat(")") {
                self.skip_space();
            }
            return Ok(Some(step(Form::Ipc, time, words)));
        }
        let name = self.word(is_delimiter);
        if name.text.is_empty() || name.text.starts_with(|c: char| c.is_ascii_digit()) {
            return Ok(None);
        }
        let mut words = vec![name];
        if self.eat("(") {
            let Some(arguments) = self.arguments(true) else {
                return self.broken(time.as_ref(), "expected `)` at the end of the action");
            };
            words.extend(arguments);
            return Ok(Some(step(Form::UnifiedPlanning, time, words)));
        }
        if time.is_none() {
            return Ok(None);
        }
        loop {
            self.skip_space();
            if self.is_done_or_comment() || self.rest().starts_with('[') {
                return Ok(Some(step(Form::Words, time, words)));
            }
            let word = self.word(is_delimiter);
            if word.text.is_empty() {
                return Err((
                    self.place(),
                    "expected an argument, or `[` and the duration",
                ));
            }
            words.push(word);
        }
    }

    /// Returns the words up to the closing parenthesis, or `None` if there is none.
    fn arguments(&mut self, with_commas: bool) -> Option<Vec<Word<'s>>> {
        let mut words = Vec::new();
        loop {
            self.skip_space();
            if self.eat(")") {
                return Some(words);
            }
            let word = self.word(|c| {
                c.is_whitespace() || matches!(c, '(' | ')' | '[' | ';') || (with_commas && c == ',')
            });
            if word.text.is_empty() {
                return None;
            }
            words.push(word);
            self.skip_space();
            if with_commas {
                self.eat(",");
            }
        }
    }

    /// Reads `[10.0]`, `[D:10.0; C:0.1]`, or a number without brackets at the end of the line.
    ///
    /// The plan files of LPG-td have a superfluous closing parenthesis: `0: (NAME) [10.0])`.
    fn with_duration(&mut self, mut step: RawStep<'s>) -> Step<'s> {
        self.skip_space();
        let begin = self.at;
        if !self.eat("[") {
            let number = self.word(is_delimiter);
            self.skip_space();
            if step.time.is_some() && is_number(number.text) && self.is_done_or_comment() {
                step.duration = Some(number);
                if step.form == Form::Ipc {
                    step.form = Form::PlanSys2;
                }
            } else {
                self.at = begin;
            }
            return Ok(Some(step));
        }
        self.skip_space();
        let is_lpg = self.rest().starts_with(['D', 'd']);
        if is_lpg {
            self.at += 1;
            self.skip_space();
            self.eat(":");
            self.skip_space();
        }
        let duration = self.word(|c| c.is_whitespace() || matches!(c, '[' | ']' | ';' | '('));
        if duration.text.is_empty() {
            return self.broken(step.time.as_ref(), "expected a duration in the brackets");
        }
        self.skip_space();
        if is_lpg && self.eat(";") {
            self.skip_space();
            self.word(|c| matches!(c, '[' | ']' | '(' | ';'));
        } else if self.rest().starts_with(char::is_alphabetic) {
            step.unit = Some(self.word(|c| !c.is_alphabetic()));
            self.skip_space();
        }
        if !self.eat("]") {
            return self.broken(step.time.as_ref(), "expected `]` after the duration");
        }
        step.duration = Some(duration);
        let end = self.at;
        self.skip_space();
        if !self.eat(")") {
            self.at = end;
        }
        Ok(Some(step))
    }

    /// Returns a mistake for a line with a time, which is meant as an action. Other lines may be
    /// anything.
    fn broken(&self, time: Option<&Word<'s>>, expected: &'static str) -> Step<'s> {
        match time {
            Some(_) => Err((self.place(), expected)),
            None => Ok(None),
        }
    }
}

fn step<'s>(form: Form, time: Option<Word<'s>>, words: Vec<Word<'s>>) -> RawStep<'s> {
    RawStep {
        form,
        time,
        words,
        duration: None,
        unit: None,
        counter: None,
    }
}

fn is_delimiter(c: char) -> bool {
    c.is_whitespace() || matches!(c, ':' | '(' | ')' | '[' | ']' | ';')
}

/// Returns `true` if the word begins like a number. Malformed numbers are reported later.
fn is_number(word: &str) -> bool {
    word.trim_start_matches(['-', '+', '.'])
        .starts_with(|c: char| c.is_ascii_digit())
}

/// Returns `true` for digits only.
fn is_count(word: &str) -> bool {
    !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit())
}
