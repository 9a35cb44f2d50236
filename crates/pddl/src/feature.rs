//! Features of PDDL that are recognized but not supported.

use elbowroom_text::{Diagnostic, Diagnostics};

/// A feature that is refused, or ignored with a warning where it cannot affect validity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Feature {
    /// Values of object functions (PDDL 3.1) as arguments outside of conditions
    ObjectFluents,
    /// Continuous change that is not linear in `#t`
    NonlinearTime,
    /// `<` and `>` on `?duration`
    StrictDurations,
    /// `or`, `not`, `exists` over conditions read at different times
    MixedTimes,
    /// `:modules` with external code
    Modules,
    /// Sections without influence on validity, such as `:length`
    OtherSections,
    /// Unknown requirement flags
    UnknownRequirements,
}

impl Feature {
    /// All features, in the order of the documentation.
    pub const ALL: &[Self] = &[
        Self::ObjectFluents,
        Self::NonlinearTime,
        Self::StrictDurations,
        Self::MixedTimes,
        Self::Modules,
        Self::OtherSections,
        Self::UnknownRequirements,
    ];

    /// Returns the name of the feature.
    pub fn name(self) -> &'static str {
        match self {
            Self::ObjectFluents => "object fluents",
            Self::NonlinearTime => "change not linear in #t",
            Self::StrictDurations => "strict duration bounds",
            Self::MixedTimes => "disjunction over several times",
            Self::Modules => "modules",
            Self::OtherSections => "other sections",
            Self::UnknownRequirements => "unknown requirements",
        }
    }

    /// Returns its identifier: the [`code`](Diagnostic::code) of diagnostics about it.
    pub fn code(self) -> &'static str {
        match self {
            Self::ObjectFluents => "object-fluents",
            Self::NonlinearTime => "nonlinear-time",
            Self::StrictDurations => "strict-durations",
            Self::MixedTimes => "mixed-times",
            Self::Modules => "modules",
            Self::OtherSections => "other-sections",
            Self::UnknownRequirements => "unknown-requirements",
        }
    }

    /// Returns the feature that a diagnostic refuses or ignores, or `None` for a mistake in the
    /// text.
    pub fn of(diagnostic: &Diagnostic) -> Option<Self> {
        let code = diagnostic.code?;
        let mut all = Self::ALL.iter().copied();
        all.find(|feature| feature.code() == code)
    }

    /// Returns a description of its syntax and its treatment.
    pub fn summary(self) -> &'static str {
        match self {
            Self::ObjectFluents => {
                "the value of an object fluent as an argument in effects, durations and initial \
                 values, and as the new value of another: refused; in conditions it is executed"
            }
            Self::NonlinearTime => "a product of two `#t`, a division by `#t`: refused",
            Self::StrictDurations => "`(< ?duration …)`, `(> ?duration …)`: refused",
            Self::MixedTimes => {
                "`or`, `not`, `imply`, `exists` over parts with different time specifiers: refused"
            }
            Self::Modules => "`:modules`, external code (TFD/M): refused",
            Self::OtherSections => {
                "`:length`, `:time` and unknown sections: ignored with a warning"
            }
            Self::UnknownRequirements => "unknown requirement flags: ignored with a warning",
        }
    }
}

/// Returns `true` if all errors are unsupported features, that is, the texts contain no known
/// mistakes.
pub fn is_unsupported(diagnostics: &Diagnostics) -> bool {
    let mut errors = diagnostics.errors();
    errors.all(|error| Feature::of(error).is_some())
}
