//! Features that a random problem may use.

use std::fmt::{self, Display, Formatter};

use super::random::Random;

macro_rules! features {
    ($($(#[$doc:meta])* $name:ident: $percent:literal,)*) => {
        /// Switches for the features of a problem.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub(crate) struct Features {
            $($(#[$doc])* pub(crate) $name: bool,)*
        }

        impl Features {
            /// Draws each feature independently.
            pub(crate) fn draw(random: &mut Random) -> Self {
                Self { $($name: random.chance($percent),)* }
            }
        }

        impl Display for Features {
            fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
                $(if self.$name { write!(f, "{} ", stringify!($name))?; })*
                Ok(())
            }
        }
    };
}

features! {
    /// Numeric fluents, with effects and comparisons.
    numbers: 60,
    /// Timed initial literals, and timed initial fluents where there are numbers.
    timed: 35,
    /// Negated facts.
    negation: 60,
    /// Disjunctions.
    disjunction: 35,
    /// `forall` and `exists` in conditions, `forall` in effects.
    quantifiers: 25,
    /// `when`.
    conditional: 35,
    /// Continuous effects.
    continuous: 25,
    /// `?duration` in effects.
    reads_duration: 25,
    /// Durations between bounds.
    inequalities: 35,
    /// Durations of 0.
    zero: 20,
    /// Actions without duration.
    instantaneous: 25,
    /// Derived predicates.
    derived: 30,
    /// PDDL 3 constraints.
    constraints: 15,
    /// Numbers between 1e-9 and 1e10.
    extreme: 20,
    /// Several happenings at one moment.
    together: 35,
    /// Instances of one action that overlap.
    overlap: 25,
    /// Exactly one numeric fluent, so that effects on numbers meet.
    one_number: 0,
    /// More actions, effects and steps.
    busy: 0,
    /// Goals that the number just meets at the end of the plan.
    exact_goal: 0,
}

impl Features {
    /// Draws features for problems about one changing number: continuous effects, effects that read `?duration`,
    /// conditional effects, and starts at one moment.
    pub(crate) fn draw_numeric(random: &mut Random) -> Self {
        Self {
            numbers: true,
            continuous: random.chance(75),
            reads_duration: random.chance(75),
            conditional: random.chance(60),
            inequalities: random.chance(50),
            together: random.chance(60),
            overlap: random.chance(25),
            zero: random.chance(10),
            negation: random.chance(40),
            one_number: true,
            busy: random.chance(50),
            exact_goal: random.chance(60),
            ..Self::default()
        }
    }
}
