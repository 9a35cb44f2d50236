//! Data types of certificates (`docs/reference/formats/certificate.md`).

pub mod sound;

use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use crate::number;
use sound::Sound;

pub use crate::chance::{Chance, Shape, Touch};
pub use crate::number::Exact;

/// Proof that no box inside an envelope is better than the box with these `slacks`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// Claim of the certificate, in words.
    pub proves: String,
    /// Assumptions of the certificate, in words. Each has to be established by other means.
    pub assumes: Vec<String>,
    /// Guarantee inside the envelope.
    pub guarantee: Guarantee,
    /// Parameters: the quantities that are left open.
    pub parameters: Vec<Parameter>,
    /// Names of the time points. The first is time zero; no other point comes before it.
    pub points: Vec<String>,
    /// The constraints of the plan's network.
    pub constraints: Vec<Constraint>,
    /// `true` if both ends of an interval move together.
    pub symmetric: bool,
    /// Largest deviation of an end that counts, in multiples of its parameter's scale.
    #[serde(with = "number")]
    pub counted: Rational,
    /// Deviation from the nominal value for each variable. Each parameter has one variable for its
    /// lower end and one for its upper end, or a single one if both ends move together.
    pub slacks: Vec<Exact>,
    /// Proofs of inequalities in the ends of boxes.
    pub proofs: Vec<Proof>,
    /// Proof that no box is better.
    pub reasons: Reasons,
    /// Proof that the box is inside the envelope; `None` if this is assumed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sound: Option<Sound>,
}

/// Guarantee inside an envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Guarantee {
    /// For all values there is a schedule.
    Weak,
    /// There is a strategy that observes the values during execution.
    Dynamic,
    /// One schedule works for all values.
    Strong,
}

/// A quantity that is left open.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its value in the plan.
    #[serde(with = "number")]
    pub nominal: Rational,
    /// Scale of the parameter. Slacks are compared as multiples of it.
    #[serde(with = "number")]
    pub scale: Rational,
    /// Weight of its width in the sum of widths.
    #[serde(with = "number")]
    pub weight: Rational,
    /// Largest deviation below the nominal value that counts, if the proof uses it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most_below: Option<Exact>,
    /// Largest deviation above the nominal value that counts, if the proof uses it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most_above: Option<Exact>,
    /// Distribution, for a probability; `None` if the parameter always has its nominal value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chance: Option<Chance>,
}

/// `lower <= time of to - time of from <= upper`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constraint {
    /// The point that is subtracted.
    pub from: usize,
    /// The point it is subtracted from.
    pub to: usize,
    /// The least difference.
    pub lower: Limit,
    /// The greatest difference.
    pub upper: Limit,
    /// `true` if the world decides the difference, which is observed when `to` happens.
    pub observed: bool,
}

/// One side of a [`Constraint`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Limit {
    /// No limit.
    None,
    /// A number.
    Number(Exact),
    /// The value of the parameter at this position.
    Parameter(usize),
}

/// Proof that all boxes inside the envelope satisfy an inequality, or one of several.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Proof {
    /// Bounds that form a cycle, for an executor that knows all values.
    Cycle(Vec<Part>),
    /// Bounds that form a cycle, for times that are fixed in advance.
    Fixed(Vec<Part>),
    /// A semi-reducible cycle, for an executor that observes the values during execution.
    Semireducible {
        /// All ways of the cycle. The parts of each refer only to earlier ways.
        ways: Vec<Path>,
        /// The cycle, as positions of ways. Each way begins where the previous one ends.
        cycle: Vec<usize>,
    },
    /// No proof from the network: one of these sums is not negative, for a reason outside the
    /// network.
    Assumed {
        /// Reason, in words.
        why: String,
        /// The sums.
        sums: Vec<Sum>,
    },
}

/// `constant + Σ factor · end`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sum {
    /// Constant term.
    #[serde(with = "number")]
    pub constant: Rational,
    /// Terms in ends of intervals.
    pub terms: Vec<Term>,
}

/// Term of a [`Sum`]: an end of an interval with its factor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// The parameter, by position.
    pub parameter: usize,
    /// End of the interval.
    pub end: End,
    /// Factor.
    #[serde(with = "number")]
    pub factor: Rational,
}

/// One end of an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// The least value.
    Lower,
    /// The greatest value.
    Upper,
}

/// Parts that follow each other, as one bound.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Path {
    /// The parts. Each begins where the previous one ends.
    pub parts: Vec<Part>,
    /// Position of the constraint whose duration ends the way at its latest time. The way counts
    /// for at least minus the shortest duration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unlabelled: Option<usize>,
}

/// One part of a way: a bound on the difference of two points, walked from one to the other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// This point comes at time 0 or later: from there to time zero.
    Beginning(usize),
    /// The lower bound of the constraint at this position: from its `to` to its `from`.
    Least(usize),
    /// The upper bound of the constraint at this position: from its `from` to its `to`.
    Most(usize),
    /// The observed difference of the constraint at this position is the shortest: from its `from`
    /// to its `to`.
    Early(usize),
    /// It is the longest: from its `to` to its `from`.
    Late(usize),
    /// The way at this position, counted as one bound. (It is a position because ways are nested as
    /// deeply as a proof is long.)
    Way(usize),
}

/// Derivation from the inequalities that no box is better.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reasons {
    /// No variable can have more slack, in relation to its scale, unless another variable with at
    /// most as much slack has less.
    LeastSlack(Vec<Stopped>),
    /// Upper bound of the weighted sum of widths in each of these cases. The first case is split
    /// into the others.
    Widths(Vec<Case>),
    /// Upper bound of the logarithm of the weighted product of widths in each of these cases.
    Volume {
        /// Constant added to each width in relation to its scale.
        #[serde(with = "number")]
        foot: Rational,
        /// Cases; the first is split into the others.
        cases: Vec<Case>,
    },
    /// Upper bound of the logarithm of the probability that all parameters are inside the box, in
    /// each of these cases.
    Probability(Vec<Case>),
}

impl Reasons {
    /// Returns the cases; empty for [`Self::LeastSlack`].
    pub fn cases(&self) -> &[Case] {
        match self {
            Self::LeastSlack(_) => &[],
            Self::Widths(cases) | Self::Volume { cases, .. } | Self::Probability(cases) => cases,
        }
    }
}

/// Reason why a variable cannot have more slack.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stopped {
    /// The variable, by position in [`Certificate::slacks`].
    pub variable: usize,
    /// Position of the proof that limits the variable; `None` if the variable is at its largest
    /// counted deviation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proof: Option<usize>,
    /// Violation of each inequality of the proof when no other variable has more slack than this
    /// one; not negative.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub over: Vec<Exact>,
}

/// One case of a tree.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Case {
    /// One of the inequalities of this proof holds. Each inequality has a case.
    Either {
        /// The proof, by position.
        proof: usize,
        /// The cases, by position.
        cases: Vec<usize>,
    },
    /// The variable is less than a number, or not. At this number, the probability jumps.
    Split {
        /// The variable, by position.
        variable: usize,
        /// The number.
        #[serde(with = "number")]
        at: Rational,
        /// The cases, by position.
        cases: [usize; 2],
    },
    /// These inequalities, each times its multiplier, add up to a bound on the objective.
    Sum(Total),
    /// These inequalities, each times its multiplier, add up to: 0 is at most a negative number.
    Impossible(Total),
}

/// Inequalities that are added up.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Total {
    /// The inequalities.
    pub of: Vec<Multiplier>,
    /// Sum of their bounds.
    #[serde(with = "number")]
    pub bound: Rational,
    /// Slopes of the tangent of the objective's logarithm. For a product: the factor of each
    /// parameter's width in the sum. For a probability: the factors of the lower end and of the
    /// upper end of each parameter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub slopes: Vec<Exact>,
    /// For a probability: the point of contact of the tangent, for each parameter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub touches: Vec<Touch>,
    /// For a probability: the upper bound of its logarithm, rounded up to 10^-18.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<Exact>,
}

/// An inequality with its multiplier.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Multiplier {
    /// The inequality.
    pub source: Source,
    /// Multiplier; not negative.
    #[serde(with = "number")]
    pub factor: Rational,
}

/// An inequality in the variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// Inequality of a proof: position of the proof, position of the inequality in it.
    Row(usize, usize),
    /// The variable at this position is at most its largest counted deviation.
    Most(usize),
    /// The variable at this position is not negative.
    Least(usize),
}
