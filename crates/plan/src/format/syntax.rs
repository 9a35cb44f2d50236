//! Grammar of STN plan files: from words to items with unresolved names.

use elbowroom_num::Rational;
use elbowroom_text::{Report, Source};

use super::tokens::{Span, Token, tokens};

/// The contents of an STN plan file, by kind of item.
#[derive(Debug, Default)]
pub(super) struct File<'a> {
    pub(super) parameters: Vec<ParameterItem<'a>>,
    pub(super) instances: Vec<InstanceItem<'a>>,
    pub(super) constraints: Vec<ConstraintItem<'a>>,
}

/// `parameter NAME weight W default D lb L ub U;`
#[derive(Debug)]
pub(super) struct ParameterItem<'a> {
    pub(super) name: Token<'a>,
    pub(super) weight: Option<Rational>,
    pub(super) default: Option<Rational>,
    pub(super) lower: Option<Limit>,
    pub(super) upper: Option<Limit>,
}

/// A number or an infinity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Limit {
    MinusInfinity,
    Number(Rational),
    Infinity,
}

/// `durative-action instance LABEL : (name arg …);`
#[derive(Debug)]
pub(super) struct InstanceItem<'a> {
    pub(super) label: Token<'a>,
    pub(super) is_durative: bool,
    /// The name and the arguments.
    pub(super) action: Vec<Token<'a>>,
}

/// `c: to - from in [lower, upper];`
#[derive(Debug)]
pub(super) struct ConstraintItem<'a> {
    pub(super) to: Token<'a>,
    pub(super) from: Token<'a>,
    pub(super) lower: BoundText<'a>,
    pub(super) upper: BoundText<'a>,
}

/// A bound as written.
#[derive(Debug)]
pub(super) enum BoundText<'a> {
    Limit(Limit, Span),
    Name(Token<'a>),
}

/// Reads all items; those with mistakes are left out.
pub(super) fn parse(source: &Source) -> (File<'_>, Report) {
    let text = source.text();
    let mut parser = Parser {
        tokens: tokens(text),
        next: 0,
        end: text.len(),
        mistakes: Report::new(source),
    };
    let mut file = File::default();
    while parser.peek().is_some() {
        if parser.accept(";") {
            continue;
        }
        if parser.item(&mut file).is_none() {
            parser.skip_item();
        }
    }
    (file, parser.mistakes)
}

/// Returns the limit that a word denotes.
pub(crate) fn limit(text: &str) -> Option<Limit> {
    match text.to_ascii_lowercase().as_str() {
        "inf" | "+inf" | "infinity" | "+infinity" => Some(Limit::Infinity),
        "-inf" | "-infinity" => Some(Limit::MinusInfinity),
        number => number.parse().ok().map(Limit::Number),
    }
}

const ITEMS: &str = "`parameter`, `durative-action instance`, `action instance` or `c:`";

struct Parser<'a> {
    tokens: Vec<Token<'a>>,
    next: usize,
    /// End of the text.
    end: usize,
    mistakes: Report,
}

/// Methods that return an `Option` return `None` after recording a mistake.
impl<'a> Parser<'a> {
    fn item(&mut self, file: &mut File<'a>) -> Option<()> {
        let keyword = self.word(ITEMS)?;
        match keyword.text.to_ascii_lowercase().as_str() {
            "parameter" => {
                let item = self.parameter()?;
                file.parameters.push(item);
            }
            "durative-action" => {
                let item = self.instance(true)?;
                file.instances.push(item);
            }
            "action" => {
                let item = self.instance(false)?;
                file.instances.push(item);
            }
            "c" => {
                let item = self.constraint()?;
                file.constraints.push(item);
            }
            _ => {
                self.next -= 1;
                return self.fail(ITEMS);
            }
        }
        self.end_of_item()
    }

    fn parameter(&mut self) -> Option<ParameterItem<'a>> {
        const OPTIONS: &str = "`weight`, `default`, `lb`, `ub` or `;`";
        let mut item = ParameterItem {
            name: self.word("the parameter's name")?,
            weight: None,
            default: None,
            lower: None,
            upper: None,
        };
        while let Some(option) = self.peek().filter(Token::is_word) {
            let is_again = match option.text.to_ascii_lowercase().as_str() {
                "weight" => item.weight.is_some(),
                "default" => item.default.is_some(),
                "lb" => item.lower.is_some(),
                "ub" => item.upper.is_some(),
                _ if self.starts_item() => break,
                _ => return self.fail(OPTIONS),
            };
            if is_again {
                let message = format!("`{}` is given twice", option.text);
                self.mistakes.mistake(option.span, message, None);
            }
            self.next += 1;
            match option.text.to_ascii_lowercase().as_str() {
                "weight" => item.weight = Some(self.number()?),
                "default" => item.default = Some(self.number()?),
                "lb" => item.lower = Some(self.limit()?),
                _ => item.upper = Some(self.limit()?),
            }
        }
        Some(item)
    }

    fn instance(&mut self, is_durative: bool) -> Option<InstanceItem<'a>> {
        self.keyword("instance")?;
        let label = self.word("the instance's label")?;
        self.mark(":")?;
        self.mark("(")?;
        let mut action = vec![self.word("the action's name")?];
        while !self.accept(")") {
            action.push(self.word("an object or `)`")?);
        }
        Some(InstanceItem {
            label,
            is_durative,
            action,
        })
    }

    fn constraint(&mut self) -> Option<ConstraintItem<'a>> {
        self.mark(":")?;
        let (to, from) = self.difference()?;
        self.keyword("in")?;
        self.mark("[")?;
        let lower = self.bound(",")?;
        let upper = self.bound("]")?;
        Some(ConstraintItem {
            to,
            from,
            lower,
            upper,
        })
    }

    /// Parses `to - from`, with or without spaces around the sign.
    fn difference(&mut self) -> Option<(Token<'a>, Token<'a>)> {
        const POINT: &str = "a time point: `.zero`, `LABEL.start`, `LABEL.end` or `LABEL`";
        let first = self.word(POINT)?;
        let is_sign_ahead = self.peek().is_some_and(|token| token.text.starts_with('-'));
        if let Some(both) = split_difference(first).filter(|_| !is_sign_ahead) {
            return Some(both);
        }
        let joined = self.word("`-` and a second time point")?;
        if joined.text == "-" {
            return Some((first, self.word(POINT)?));
        }
        let Some(rest) = joined.text.strip_prefix('-') else {
            self.next -= 1;
            return self.fail("`-` and a second time point");
        };
        let start = joined.span.start + 1;
        let span = Span {
            start,
            ..joined.span
        };
        Some((first, Token { text: rest, span }))
    }

    /// Parses a bound and the mark after it. A number may contain spaces: `1 / 3`, `- 5`.
    fn bound(&mut self, mark: &str) -> Option<BoundText<'a>> {
        let first = self.word("a number, `inf`, `-inf` or a parameter")?;
        let mut text = first.text.to_owned();
        let mut span = first.span;
        while let Some(token) = self.peek().filter(Token::is_word) {
            if !text.ends_with(['/', '-', '+']) && !token.text.starts_with('/') {
                break;
            }
            text.push_str(token.text);
            span = span.to(token.span);
            self.next += 1;
        }
        self.mark(mark)?;
        Some(match limit(&text) {
            Some(limit) => BoundText::Limit(limit, span),
            None => BoundText::Name(Token { span, ..first }),
        })
    }

    fn number(&mut self) -> Option<Rational> {
        match self.limit()? {
            Limit::Number(number) => Some(number),
            Limit::Infinity | Limit::MinusInfinity => {
                self.next -= 1;
                self.fail("a finite number")
            }
        }
    }

    fn limit(&mut self) -> Option<Limit> {
        const NUMBER: &str = "a number such as 12.5 or 25/2";
        let word = self.word(NUMBER)?;
        if let Some(limit) = limit(word.text) {
            return Some(limit);
        }
        self.next -= 1;
        self.fail(NUMBER)
    }

    /// Reads the `;`. If it is missing before the next item, this is recorded, and both items are
    /// kept.
    fn end_of_item(&mut self) -> Option<()> {
        if self.accept(";") || self.peek().is_none() {
            return Some(());
        }
        if self.starts_item() {
            let end = self.tokens[self.next - 1].span.end;
            let span = Span { start: end, end };
            self.mistakes
                .mistake(span, "this item does not end", "expected `;`".to_owned());
            return Some(());
        }
        self.fail("`;`")
    }

    /// Returns `true` if the next words can only be the beginning of an item.
    fn starts_item(&self) -> bool {
        let Some(keyword) = self.peek() else {
            return false;
        };
        let follower = self.tokens.get(self.next + 1).map(|token| token.text);
        match keyword.text.to_ascii_lowercase().as_str() {
            "parameter" => true,
            "durative-action" | "action" => follower == Some("instance"),
            "c" => follower == Some(":"),
            _ => false,
        }
    }

    fn skip_item(&mut self) {
        while let Some(token) = self.peek() {
            if token.text == ";" || self.starts_item() {
                break;
            }
            self.next += 1;
        }
    }

    fn peek(&self) -> Option<Token<'a>> {
        self.tokens.get(self.next).copied()
    }

    fn accept(&mut self, mark: &str) -> bool {
        let is_there = self.peek().is_some_and(|token| token.text == mark);
        self.next += usize::from(is_there);
        is_there
    }

    fn mark(&mut self, mark: &str) -> Option<()> {
        if self.accept(mark) {
            Some(())
        } else {
            self.fail(&format!("`{mark}`"))
        }
    }

    fn keyword(&mut self, keyword: &str) -> Option<()> {
        let token = self.peek();
        if token.is_some_and(|token| token.text.eq_ignore_ascii_case(keyword)) {
            self.next += 1;
            Some(())
        } else {
            self.fail(&format!("`{keyword}`"))
        }
    }

    fn word(&mut self, what: &str) -> Option<Token<'a>> {
        if let Some(token) = self.peek().filter(Token::is_word) {
            self.next += 1;
            return Some(token);
        }
        self.fail(what)
    }

    /// Records that the next token is not the expected `what`.
    fn fail<T>(&mut self, what: &str) -> Option<T> {
        let expected = format!("expected {what}");
        if let Some(token) = self.peek() {
            let text: String = token.text.chars().take(60).collect();
            let message = format!("`{text}` is not expected here");
            self.mistakes.mistake(token.span, message, expected);
        } else {
            let (start, end) = (self.end, self.end);
            self.mistakes
                .mistake(Span { start, end }, "the file ends here", expected);
        }
        None
    }
}

/// Splits `n0.end-n0.start`. Labels may contain `-`, so the sign is the first one after a suffix,
/// or else the only one.
fn split_difference(word: Token<'_>) -> Option<(Token<'_>, Token<'_>)> {
    let signs = || word.text.match_indices('-').map(|(at, _)| at);
    let is_whole = |at: usize| {
        let left = &word.text[..at];
        matches!(left.rsplit_once('.'), Some((_, "zero" | "start" | "end")))
    };
    let only = || {
        let mut all = signs();
        all.next().filter(|_| all.next().is_none())
    };
    let right_is_whole = |at: &usize| word.text[at + 1..].contains('.');
    let at = signs()
        .find(|&at| is_whole(at))
        .or_else(|| only().filter(right_is_whole))?;
    if at == 0 || at + 1 == word.text.len() {
        return None;
    }
    let part = |start: usize, end: usize| Token {
        text: &word.text[start..end],
        span: Span {
            start: word.span.start + start,
            end: word.span.start + end,
        },
    };
    Some((part(0, at), part(at + 1, word.text.len())))
}
