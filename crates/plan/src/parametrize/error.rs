//! Errors in specifications of parameters.

/// Reason why a quantity cannot become a parameter as specified.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParametrizeError {
    /// The specification has a syntax error.
    #[error("invalid `--vary {spec}`: expected {expected}")]
    Syntax {
        /// The text.
        spec: String,
        /// The expected form.
        expected: String,
    },
    /// There is no such kind of quantity.
    #[error("`--vary {spec}`: there is no kind of quantity `{name}`{}", suggestion(.nearest.as_ref()))]
    UnknownKind {
        /// The text.
        spec: String,
        /// The word in place of a kind.
        name: String,
        /// A similar kind that exists.
        nearest: Option<String>,
    },
    /// A name is unknown in the domain, the problem or the plan.
    #[error("`--vary {spec}`: there is no {kind} `{name}`{}", suggestion(.nearest.as_ref()))]
    UnknownName {
        /// The text.
        spec: String,
        /// The expected kind of name: `action or label`, `function`, …
        kind: &'static str,
        /// The name.
        name: String,
        /// A similar name that exists.
        nearest: Option<String>,
    },
    /// All names are known, but the plan has no such quantity.
    #[error("`--vary {spec}`: {why}")]
    NothingMatches {
        /// The text.
        spec: String,
        /// Reason, in words.
        why: String,
    },
    /// Several numbers match.
    #[error("`--vary {spec}` is ambiguous: {}; {advice}", choices.join(", "))]
    Ambiguous {
        /// The text.
        spec: String,
        /// The possible meanings.
        choices: Vec<String>,
        /// Advice on how to select one of them.
        advice: &'static str,
    },
    /// The domain leaves a number open, and its nominal value is not given.
    #[error("the domain leaves `{name}` open: give its nominal value with `--vary '{name}=VALUE'`")]
    NoNominal {
        /// The number.
        name: String,
    },
    /// The nominal value is outside of the range.
    #[error("`{name}` is nominally {nominal}, which is not in its range {range}")]
    OutOfRange {
        /// The parameter.
        name: String,
        /// Its nominal value.
        nominal: String,
        /// Its range.
        range: String,
    },
    /// A derived predicate depends on an open number. Its rules are the same in all schedules.
    #[error("a derived predicate depends on `:synth-parameters`, which is not supported")]
    OpenRule,
}

fn suggestion(nearest: Option<&String>) -> String {
    nearest.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}
