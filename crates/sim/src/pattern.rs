//! Patterns for the actions, fluents and facts to which a rule applies.

use std::fmt;

use elbowroom_model::Problem;

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

/// The kind of name that a pattern matches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NameKind {
    Actions,
    Functions,
    Predicates,
}

impl ActionPattern {
    /// Reads a pattern, and checks that its names exist.
    pub(crate) fn read(text: &str, names: NameKind, problem: &Problem) -> Result<Self, String> {
        let text = text.trim();
        if text == "*" {
            return Ok(Self {
                name: None,
                arguments: None,
            });
        }
        let (inner, has_arguments) = match text.strip_prefix('(').and_then(|t| t.strip_suffix(')'))
        {
            Some(inner) => (inner, true),
            None => (text, false),
        };
        let mut words = inner.split_whitespace().map(str::to_ascii_lowercase);
        let name = words
            .next()
            .ok_or_else(|| format!("expected a name, `(name _ object)` or `*`, found `{text}`"))?;
        let arguments: Vec<Option<String>> =
            words.map(|word| (word != "_").then_some(word)).collect();
        if !has_arguments && !arguments.is_empty() {
            return Err(format!("write `({text})` with parentheses"));
        }
        let expected = names.arity(&name, problem)?;
        if has_arguments && arguments.len() != expected {
            return Err(format!(
                "`{name}` takes {expected} arguments, not {}",
                arguments.len()
            ));
        }
        if let Some(unknown) = arguments
            .iter()
            .flatten()
            .find(|object| problem.object(object).is_none())
        {
            return Err(format!("unknown object `{unknown}`"));
        }
        Ok(Self {
            name: Some(name),
            arguments: has_arguments.then_some(arguments),
        })
    }

    /// Returns the name; `None` if it matches any name.
    pub(crate) fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// Returns `true` if the pattern may match something of that name, for some objects.
    pub(crate) fn may_match(&self, name: &str) -> bool {
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

impl NameKind {
    fn arity(self, name: &str, problem: &Problem) -> Result<usize, String> {
        let same = |other: &str| other.eq_ignore_ascii_case(name);
        let (what, found, all): (_, _, Vec<&str>) = match self {
            Self::Actions => (
                "action",
                problem
                    .schemas
                    .iter()
                    .find(|s| same(&s.name))
                    .map(|s| s.parameters.len()),
                problem.schemas.iter().map(|s| s.name.as_str()).collect(),
            ),
            Self::Functions => (
                "function",
                problem
                    .functions
                    .iter()
                    .find(|f| same(&f.name))
                    .map(|f| f.parameters.len()),
                problem.functions.iter().map(|f| f.name.as_str()).collect(),
            ),
            Self::Predicates => (
                "predicate",
                problem
                    .predicates
                    .iter()
                    .find(|p| same(&p.name))
                    .map(|p| p.parameters.len()),
                problem.predicates.iter().map(|p| p.name.as_str()).collect(),
            ),
        };
        found.ok_or_else(|| {
            format!(
                "the domain has no {what} `{name}`; it has {}",
                all.join(", ")
            )
        })
    }
}
