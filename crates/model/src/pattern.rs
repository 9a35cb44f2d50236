//! Patterns for the actions, fluents and facts to which a rule applies.

use std::fmt;

/// `*`, a name, or `(name object _ …)`; `_` matches any object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ActionPattern {
    /// `None` matches any name.
    name: Option<String>,
    /// `None` matches any arguments.
    arguments: Option<Vec<Option<String>>>,
}

impl fmt::Display for ActionPattern {
    /// Writes the pattern in the syntax of world files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.name.as_deref().unwrap_or("*");
        let Some(arguments) = &self.arguments else {
            return f.write_str(name);
        };
        write!(f, "({name}")?;
        for argument in arguments {
            write!(f, " {}", argument.as_deref().unwrap_or("_"))?;
        }
        f.write_str(")")
    }
}

impl ActionPattern {
    /// Creates a pattern: `None` matches any name, any arguments, or any object.
    pub fn new(name: Option<String>, arguments: Option<Vec<Option<String>>>) -> Self {
        Self { name, arguments }
    }

    /// Returns the name; `None` if it matches any name.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// Returns `true` if the pattern may match something of that name, for some objects.
    pub fn may_match(&self, name: &str) -> bool {
        let mine = self.name.as_deref();
        mine.is_none_or(|mine| mine.eq_ignore_ascii_case(name))
    }

    /// Returns `true` if the pattern matches a ground name, `(name object …)`.
    pub fn matches(&self, ground: &str) -> bool {
        let Some(name) = &self.name else {
            return true;
        };
        let mut words = ground.trim_matches(['(', ')']).split_whitespace();
        if !words
            .next()
            .is_some_and(|word| word.eq_ignore_ascii_case(name))
        {
            return false;
        }
        self.arguments.as_ref().is_none_or(|arguments| {
            arguments.iter().zip(words).all(|(asked, word)| {
                asked
                    .as_ref()
                    .is_none_or(|asked| asked.eq_ignore_ascii_case(word))
            })
        })
    }
}
