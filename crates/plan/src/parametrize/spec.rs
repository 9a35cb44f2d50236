//! Specifications of `--vary`: one quantity, or several of the same kind, to replace by parameters.

use std::fmt;
use std::str::FromStr;

use elbowroom_num::Rational;
use elbowroom_text::nearest;

use super::ParametrizeError;
use crate::format::{Limit, Token, limit, tokens};

/// A specification of `--vary`: quantities to leave open, with weight and range.
///
/// The module's documentation has the grammar.
#[derive(Clone, Debug, PartialEq)]
pub struct VarySpec {
    /// Original text, for messages.
    pub text: String,
    /// The quantities.
    pub target: Target,
    /// Weight in a search; 1 if not given.
    pub weight: Option<Rational>,
    /// Range: finite ends, `None` for no limit. If not given, the natural range.
    pub range: Option<(Option<Rational>, Option<Rational>)>,
}

/// Quantities that a [`VarySpec`] leaves open.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// The durations of all durative instances.
    Durations,
    /// The durations of these instances.
    Duration(Selection),
    /// No quantity: the executor chooses the durations of these instances, so they are not left
    /// open.
    Controllable(Selection),
    /// A constant in the effects of these instances on a function.
    Constant(ConstantTarget),
    /// A constant that the conditions of these instances compare a function with.
    Condition(ConstantTarget),
    /// The value of a fluent at time 0: function and arguments.
    Initial(Vec<String>),
    /// Times of timed initials that change a fact or fluent: predicate or function, and arguments.
    Timed {
        /// The fact or fluent.
        atom: Vec<String>,
        /// Only those that make it false.
        only_deletions: bool,
    },
    /// One of the domain's `:synth-parameters`, with its nominal value.
    Unknown {
        /// `?s`, `n0.?r`, or `?r` for all instances.
        name: String,
        /// The nominal value.
        nominal: Rational,
    },
}

/// Some of a plan's instances.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Selection {
    /// All instances of the action with that name, or the one with that label.
    Named(String),
    /// All instances with these arguments; `_` matches any object.
    Exactly(Vec<String>),
}

/// See [`Target::Constant`].
#[derive(Clone, Debug, PartialEq)]
pub struct ConstantTarget {
    /// The instances.
    pub instances: Selection,
    /// The name of the function.
    pub function: String,
    /// The constant, if there are several.
    pub value: Option<Rational>,
    /// `true` if all instances share one parameter, `false` if each has its own.
    pub is_shared: bool,
}

impl fmt::Display for VarySpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for VarySpec {
    type Err = ParametrizeError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let tokens = tokens(text);
        let mut words = Words {
            text,
            tokens: &tokens,
        };
        let target = words.target()?;
        let mut spec = Self {
            text: text.trim().to_owned(),
            target,
            weight: None,
            range: None,
        };
        while let Some(word) = words.peek() {
            words.skip();
            match word.to_ascii_lowercase().as_str() {
                "weight" => {
                    let weight = words.number()?.filter(Rational::is_positive);
                    spec.weight = Some(weight.ok_or_else(|| words.wrong("a positive weight"))?);
                }
                "in" => spec.range = Some(words.range()?),
                _ => return Err(words.surplus(&spec.target, word)),
            }
        }
        Ok(spec)
    }
}

/// First words of specifications.
const KINDS: [&str; 7] = [
    "duration",
    "controllable",
    "constant",
    "condition",
    "initial",
    "deadline",
    "timed",
];

/// Unread words.
struct Words<'a> {
    text: &'a str,
    tokens: &'a [Token<'a>],
}

impl<'a> Words<'a> {
    fn target(&mut self) -> Result<Target, ParametrizeError> {
        const TARGETS: &str = "`durations`, an action or a label, `constant`, `condition`, \
                               `initial`, `deadline`, `timed` or `NAME=VALUE`";
        let first = self.peek().ok_or_else(|| self.wrong(TARGETS))?;
        if let Some(unknown) = self.unknown()? {
            return Ok(unknown);
        }
        // An action may have the name of a keyword. In parentheses, the word is not a keyword.
        let keyword = first.to_ascii_lowercase();
        self.skip();
        match keyword.as_str() {
            "durations" => Ok(Target::Durations),
            "duration" => Ok(Target::Duration(self.selection()?)),
            "controllable" => Ok(Target::Controllable(self.selection()?)),
            "constant" => Ok(Target::Constant(self.constant()?)),
            "condition" => Ok(Target::Condition(self.constant()?)),
            "initial" => Ok(Target::Initial(self.atom()?)),
            "timed" | "deadline" => Ok(Target::Timed {
                atom: self.atom()?,
                only_deletions: keyword == "deadline",
            }),
            "(" => Ok(Target::Duration(Selection::Exactly(self.rest_of_list()?))),
            _ if is_word(first) => Ok(Target::Duration(Selection::Named(first.to_owned()))),
            _ => Err(self.wrong(TARGETS)),
        }
    }

    /// Parses `NAME=VALUE`, with or without spaces.
    fn unknown(&mut self) -> Result<Option<Target>, ParametrizeError> {
        let Some(first) = self.peek() else {
            return Ok(None);
        };
        let (name, mut value) = match first.split_once('=') {
            Some((name, value)) => (name, value),
            None => match self
                .tokens
                .get(1)
                .and_then(|next| next.text.strip_prefix('='))
            {
                Some(value) => {
                    self.skip();
                    (first, value)
                }
                None => return Ok(None),
            },
        };
        self.skip();
        if value.is_empty() {
            value = self.peek().unwrap_or_default();
            self.skip();
        }
        match limit(value) {
            Some(Limit::Number(nominal)) if !name.is_empty() => Ok(Some(Target::Unknown {
                name: name.to_owned(),
                nominal,
            })),
            _ => Err(self.wrong("`NAME=VALUE` with a number")),
        }
    }

    fn constant(&mut self) -> Result<ConstantTarget, ParametrizeError> {
        let instances = self.selection()?;
        let function = self.word("the name of a function")?;
        let value = match self.peek().and_then(limit) {
            Some(Limit::Number(value)) => {
                self.skip();
                Some(value)
            }
            _ => None,
        };
        let is_shared = self.accept("shared");
        Ok(ConstantTarget {
            instances,
            function,
            value,
            is_shared,
        })
    }

    fn selection(&mut self) -> Result<Selection, ParametrizeError> {
        if self.accept("(") {
            Ok(Selection::Exactly(self.rest_of_list()?))
        } else {
            Ok(Selection::Named(self.word("an action or a label")?))
        }
    }

    /// Parses `(name arg …)`, or a single `name`.
    fn atom(&mut self) -> Result<Vec<String>, ParametrizeError> {
        if self.accept("(") {
            self.rest_of_list()
        } else {
            Ok(vec![self.word("`(name object …)`")?])
        }
    }

    fn rest_of_list(&mut self) -> Result<Vec<String>, ParametrizeError> {
        let mut list = vec![self.word("a name")?];
        while !self.accept(")") {
            list.push(self.word("an object or `)`")?);
        }
        Ok(list)
    }

    /// Parses `[lb, ub]`. Either bound may be infinite.
    fn range(&mut self) -> Result<(Option<Rational>, Option<Rational>), ParametrizeError> {
        const RANGE: &str = "`[LB, UB]`";
        let is_bracketed = self.accept("[");
        let lower = self.number()?;
        let is_pair = self.accept(",");
        let upper = self.number()?;
        let is_whole = is_bracketed && is_pair && self.accept("]");
        let is_ordered = lower.is_none() || upper.is_none() || lower <= upper;
        if is_whole && is_ordered {
            Ok((lower, upper))
        } else {
            Err(self.wrong(RANGE))
        }
    }

    /// Parses a number; `None` for an infinity.
    fn number(&mut self) -> Result<Option<Rational>, ParametrizeError> {
        let limit = self.peek().and_then(limit);
        match limit {
            Some(Limit::Number(number)) => {
                self.skip();
                Ok(Some(number))
            }
            Some(Limit::Infinity | Limit::MinusInfinity) => {
                self.skip();
                Ok(None)
            }
            None => Err(self.wrong("a number such as 12.5 or 25/2")),
        }
    }

    fn word(&mut self, what: &str) -> Result<String, ParametrizeError> {
        let word = self.peek().filter(|text| is_word(text));
        let word = word.ok_or_else(|| self.wrong(what))?.to_owned();
        self.skip();
        Ok(word)
    }

    fn accept(&mut self, text: &str) -> bool {
        let is_there = self
            .peek()
            .is_some_and(|next| next.eq_ignore_ascii_case(text));
        if is_there {
            self.skip();
        }
        is_there
    }

    fn peek(&self) -> Option<&'a str> {
        self.tokens.first().map(|token| token.text)
    }

    fn skip(&mut self) {
        self.tokens = self.tokens.get(1..).unwrap_or_default();
    }

    /// Returns the error for a word after the end of a specification.
    fn surplus(&self, target: &Target, word: &str) -> ParametrizeError {
        match target {
            // A list or a name cannot follow an action, so the first word is probably a misspelt
            // keyword.
            Target::Duration(Selection::Named(name))
                if word == "(" || is_word(word) && nearest(name, KINDS).is_some() =>
            {
                ParametrizeError::UnknownKind {
                    spec: self.text.trim().to_owned(),
                    name: name.clone(),
                    nearest: nearest(name, KINDS).map(str::to_owned),
                }
            }
            Target::Initial(atom) | Target::Timed { atom, .. }
                if atom.len() == 1 && is_word(word) && !self.text.contains('(') =>
            {
                let mut words = self.text.split_whitespace();
                let kind = words.next().unwrap_or_default();
                let atom: Vec<&str> = words.collect();
                self.wrong(&format!("parentheses, as in `{kind} ({})`", atom.join(" ")))
            }
            _ => self.wrong("`weight W`, `in [LB, UB]` or the end"),
        }
    }

    fn wrong(&self, expected: &str) -> ParametrizeError {
        ParametrizeError::Syntax {
            spec: self.text.trim().to_owned(),
            expected: expected.to_owned(),
        }
    }
}

fn is_word(text: &str) -> bool {
    !text.starts_with(['(', ')', '[', ']', ',', ';', ':'])
}
