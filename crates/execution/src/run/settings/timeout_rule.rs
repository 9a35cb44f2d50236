//! The rule that sets the time-outs of actions.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use elbowroom_num::Rational;

use super::UnknownSetting;

/// The rule that sets the time-out of each action: the longest time from its start, or from its
/// last progress, to its end. An action that reaches its time-out is cancelled and counts as
/// failed.
///
/// ```
/// use elbowroom_execution::run::TimeoutRule;
/// use elbowroom_num::Rational;
///
/// let rule: TimeoutRule = "10x,600".parse()?;
/// assert_eq!(rule, TimeoutRule::default());
/// assert_eq!(rule.of("(drive a b)", &Rational::from(90)), Some(Rational::from(900)));
/// assert_eq!(rule.of("(drive a b)", &Rational::from(5)), Some(Rational::from(600)));
///
/// let rule: TimeoutRule = "10x,600; drive=40; (drive b a)=none".parse()?;
/// assert_eq!(rule.of("(drive a b)", &Rational::from(5)), Some(Rational::from(40)));
/// assert_eq!(rule.of("(drive b a)", &Rational::from(5)), None);
/// assert_eq!(rule.of("(pick a)", &Rational::from(5)), Some(Rational::from(600)));
/// # Ok::<(), elbowroom_execution::run::UnknownSetting>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TimeoutRule {
    /// No action ever times out.
    Off,
    /// An action times out after `factor` times its planned duration, but not before `at_least`
    /// seconds.
    After {
        /// Multiple of the planned duration.
        factor: Rational,
        /// Shortest time-out; positive.
        at_least: Rational,
    },
    /// Separate rules for some actions.
    ByAction {
        /// The rule of each named action: a ground action, `(drive a b)`, or all actions of one
        /// name, `drive`. The rule of the ground action takes precedence. These rules are not
        /// `ByAction` themselves.
        actions: BTreeMap<String, TimeoutRule>,
        /// The rule of the other actions.
        others: Box<TimeoutRule>,
    },
}

impl Default for TimeoutRule {
    /// Ten times the planned duration, at least 600 seconds.
    fn default() -> Self {
        Self::After {
            factor: Rational::from(10),
            at_least: Rational::from(600),
        }
    }
}

impl TimeoutRule {
    const OFF: &str = "none";

    /// Returns the time-out of an action, `(drive a b)`, with this planned duration, or `None` if it never times out.
    pub fn of(&self, action: &str, planned: &Rational) -> Option<Rational> {
        match self {
            Self::Off => None,
            Self::After { factor, at_least } => Some((planned * factor).max(at_least.clone())),
            Self::ByAction { actions, others } => {
                let own = actions.get(action).or_else(|| actions.get(name_of(action)));
                own.unwrap_or(others).of(action, planned)
            }
        }
    }

    /// Returns the names of actions with separate rules.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let actions = match self {
            Self::ByAction { actions, .. } => Some(actions),
            Self::Off | Self::After { .. } => None,
        };
        actions.into_iter().flatten().map(|(name, _)| name.as_str())
    }

    /// Returns the rule in words: `10 times the planned duration, at least 600`.
    pub fn in_words(&self) -> String {
        match self {
            Self::Off => "none".to_owned(),
            Self::After { factor, at_least } if factor.is_zero() => at_least.to_decimal(3),
            Self::After { factor, at_least } => {
                let (factor, at_least) = (factor.to_decimal(3), at_least.to_decimal(3));
                format!("{factor} times the planned duration, at least {at_least}")
            }
            Self::ByAction { actions, others } => {
                let own = actions.iter();
                let own = own.map(|(name, rule)| format!("{name}: {}", rule.in_words()));
                let all: Vec<String> = std::iter::once(others.in_words()).chain(own).collect();
                all.join("; ")
            }
        }
    }

    /// Parses one rule.
    fn parse_rule(text: &str) -> Option<Self> {
        let number = |text: &str| text.trim().parse::<Rational>().ok();
        let rule = match text.trim().split_once("x,") {
            _ if text.trim() == Self::OFF => Some(Self::Off),
            None => number(text).map(|at_least| Self::After {
                factor: Rational::ZERO,
                at_least,
            }),
            Some((factor, at_least)) => {
                let numbers = number(factor).zip(number(at_least));
                numbers.map(|(factor, at_least)| Self::After { factor, at_least })
            }
        };
        rule.filter(|rule| match rule {
            Self::After { factor, at_least } => !factor.is_negative() && at_least.is_positive(),
            _ => true,
        })
    }

    /// Parses rules: the general one first, then those of actions.
    fn read(text: &str) -> Option<Self> {
        let mut parts = text.split(';').peekable();
        let others = match parts.next_if(|first| !first.contains('=')) {
            Some(first) => Self::parse_rule(first)?,
            None => Self::default(),
        };
        if parts.peek().is_none() {
            return Some(others);
        }
        let mut actions = BTreeMap::new();
        for part in parts {
            let (name, rule) = part.split_once('=')?;
            let name = name.trim().to_ascii_lowercase();
            let words: Vec<&str> = name.split_whitespace().collect();
            let is_name = match (name.strip_prefix('('), words.as_slice()) {
                (Some(ground), _) => ground.ends_with(')') && name_of(&name) != ")",
                (None, words) => words.len() == 1,
            };
            let is_new = actions
                .insert(words.join(" "), Self::parse_rule(rule)?)
                .is_none();
            if !is_name || !is_new {
                return None;
            }
        }
        Some(Self::ByAction {
            actions,
            others: Box::new(others),
        })
    }
}

/// Returns the name in a ground action: `drive` in `(drive a b)`.
fn name_of(action: &str) -> &str {
    let inner = action.strip_prefix('(').unwrap_or(action);
    let name = inner.split_whitespace().next().unwrap_or(inner);
    name.strip_suffix(')')
        .filter(|name| !name.is_empty())
        .unwrap_or(name)
}

/// Formats a number as a decimal, or as a fraction if the decimal would be rounded.
fn format_number(number: &Rational) -> String {
    let decimal = number.to_decimal(6);
    if decimal.parse::<Rational>().as_ref() == Ok(number) {
        decimal
    } else {
        number.to_string()
    }
}

impl fmt::Display for TimeoutRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => f.write_str(Self::OFF),
            Self::After { factor, at_least } if factor.is_zero() => {
                f.write_str(&format_number(at_least))
            }
            Self::After { factor, at_least } => {
                write!(f, "{}x,{}", format_number(factor), format_number(at_least))
            }
            Self::ByAction { actions, others } => {
                others.fmt(f)?;
                for (name, rule) in actions {
                    write!(f, "; {name}={rule}")?;
                }
                Ok(())
            }
        }
    }
}

impl FromStr for TimeoutRule {
    type Err = UnknownSetting;

    /// Parses `none`, a positive number of seconds, or `10x,600`; then optional rules of actions,
    /// `; drive=40`.
    fn from_str(text: &str) -> Result<Self, UnknownSetting> {
        Self::read(text).ok_or_else(|| UnknownSetting {
            text: text.to_owned(),
            expected: "a time-out: `none`, a positive number of seconds, or `10x,600` for 10 times \
                       the planned duration, but at least 600 seconds; time-outs of single actions \
                       follow: `10x,600; drive=40; (pick a)=3x,5`",
        })
    }
}
