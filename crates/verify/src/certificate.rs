//! What a certificate consists of (`docs/formats/certificate.md`).

pub mod sound;

use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use crate::number;
use sound::Sound;

pub use crate::chance::{Chance, Shape, Touch};
pub use crate::number::Exact;

/// That no box inside an envelope is better than the one with these `slacks`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// What it proves, in words.
    pub proves: String,
    /// What it takes for granted, in words: each is to be known from elsewhere.
    pub assumes: Vec<String>,
    /// What is guaranteed inside the envelope.
    pub guarantee: Guarantee,
    /// What is left open.
    pub parameters: Vec<Parameter>,
    /// The time points, in words; the first is time zero, before which no other one comes.
    pub points: Vec<String>,
    /// The constraints of the plan's network.
    pub constraints: Vec<Constraint>,
    /// Whether both ends of an interval move together.
    pub symmetric: bool,
    /// Ends count up to a deviation of so many times the scale of their parameter.
    #[serde(with = "number")]
    pub counted: Rational,
    /// How far each variable moves its ends out from the nominal value: for each parameter its
    /// lower end, then its upper end; or both, if these move together.
    pub slacks: Vec<Exact>,
    /// Proofs of inequalities in the ends of boxes.
    pub proofs: Vec<Proof>,
    /// How it follows that no box is better.
    pub reasons: Reasons,
    /// Why the box is inside the envelope; none if that is taken for granted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sound: Option<Sound>,
}

/// What is guaranteed inside the envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Guarantee {
    /// For all values there is a schedule.
    Weak,
    /// There is a strategy that learns the values as they come about.
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
    /// The size by which its slack is measured.
    #[serde(with = "number")]
    pub scale: Rational,
    /// What its width counts in the sum of widths.
    #[serde(with = "number")]
    pub weight: Rational,
    /// How far below the nominal value its lower end counts at most, where the proof uses that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most_below: Option<Exact>,
    /// How far above it its upper end counts at most, where the proof uses that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most_above: Option<Exact>,
    /// How it is distributed, for a probability; none if it always has its nominal value.
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
    /// Whether the world decides on the difference, and shows it when `to` happens.
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

/// Why all boxes inside the envelope satisfy an inequality, or one of several.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Proof {
    /// Bounds that follow each other in a circle, for an executor that knows all values.
    Cycle(Vec<Part>),
    /// The same for times that are fixed in advance.
    Fixed(Vec<Part>),
    /// A semi-reducible cycle, for an executor that learns the values as they come about.
    Semireducible {
        /// All ways that it consists of; the parts of each mention only earlier ones.
        ways: Vec<Way>,
        /// The cycle: ways by position, each of which begins where the one before ends.
        cycle: Vec<usize>,
    },
    /// No proof from the network: one of these sums is not negative because of something that the
    /// network does not show.
    Assumed {
        /// Why it holds, in words.
        why: String,
        /// The sums.
        sums: Vec<Sum>,
    },
}

/// `constant + Σ factor · end`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sum {
    /// What depends on no end.
    #[serde(with = "number")]
    pub constant: Rational,
    /// What ends of intervals count.
    pub terms: Vec<Term>,
}

/// What an end of an interval counts in a [`Sum`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// The parameter, by position.
    pub parameter: usize,
    /// Which end of its interval.
    pub end: End,
    /// How often it counts.
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

/// Parts one after the other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Way {
    /// Each begins where the one before ends.
    pub parts: Vec<Part>,
    /// The way ends with the latest end of the duration of this constraint, and counts for at least
    /// minus its shortest.
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
    /// The way at this position, which counts as one bound. (Not the way itself: they are nested as
    /// deeply as a proof is long.)
    Way(usize),
}

/// How it follows from the inequalities that no box is better.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reasons {
    /// No variable can have more slack, in relation to its scale, unless one with no more has less.
    LeastSlack(Vec<Stopped>),
    /// The weighted sum of widths is at most so much in each of these cases, of which the first is
    /// split into the others.
    Widths(Vec<Case>),
    /// The logarithm of the weighted product of widths is at most so much in each of these cases.
    Volume {
        /// What is added to each width in relation to its scale.
        #[serde(with = "number")]
        foot: Rational,
        /// The first is split into the others.
        cases: Vec<Case>,
    },
    /// The logarithm of the probability that all parameters are inside is at most so much in each of
    /// these cases.
    Probability(Vec<Case>),
}

impl Reasons {
    /// The cases of a tree, if that is what follows.
    pub fn cases(&self) -> &[Case] {
        match self {
            Self::LeastSlack(_) => &[],
            Self::Widths(cases) | Self::Volume { cases, .. } | Self::Probability(cases) => cases,
        }
    }
}

/// Why a variable can have no more slack.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stopped {
    /// The variable, by position in [`Certificate::slacks`].
    pub variable: usize,
    /// The proof of what stops it, by position; none if it is as far out as counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proof: Option<usize>,
    /// By how much each inequality of the proof is broken if no other variable has more slack than
    /// this one; not negative.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub over: Vec<Exact>,
}

/// One case of a tree.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Case {
    /// One of the inequalities of this proof holds: for each, the position of its case.
    Either {
        /// The proof, by position.
        proof: usize,
        /// The cases, by position.
        cases: Vec<usize>,
    },
    /// The variable is less than a number, or not: where what it moves jumps to a greater
    /// probability.
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
    /// What their bounds add up to.
    #[serde(with = "number")]
    pub bound: Rational,
    /// Where the objective is a product: what the width of each parameter counts in the sum, which
    /// is the slope of a tangent of its logarithm. Where it is a probability: the same for the lower
    /// end and the upper end of each parameter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub slopes: Vec<Exact>,
    /// Where the objective is a probability: of each parameter where the tangent touches.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub touches: Vec<Touch>,
    /// Where the objective is a probability: what its logarithm is at most, rounded up to 10^-18.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<Exact>,
}

/// An inequality, and how often it is added.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Multiplier {
    /// Which inequality.
    pub source: Source,
    /// How often; not negative.
    #[serde(with = "number")]
    pub factor: Rational,
}

/// An inequality in the variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// Of this proof, by position, the inequality at this position.
    Row(usize, usize),
    /// The variable at this position is at most as far out as counts.
    Most(usize),
    /// The variable at this position is not negative.
    Least(usize),
}
