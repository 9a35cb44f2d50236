//! The part of a certificate that proves that the box is inside the envelope.

use serde::{Deserialize, Serialize};

use super::{End, Exact};

/// Why the box is inside the envelope.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sound {
    /// The ends of the box that are infinite; the others are as far out as the slacks say.
    pub endless: Vec<Endless>,
    /// Why there are times for all points, as the guarantee demands.
    pub control: Control,
    /// Why each condition of the plan holds in every schedule for values in the box; none if that
    /// is taken for granted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub conditions: Option<Vec<Condition>>,
}

/// An end of an interval that is infinite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Endless {
    /// The parameter, by position.
    pub parameter: usize,
    /// Which end of its interval.
    pub end: End,
}

/// Why there are times for all points, whatever the values in the box are.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Control {
    /// These do, for the strong guarantee: of each point that the executor chooses its time, and
    /// nothing for one that the world decides on.
    Times(Vec<Option<Exact>>),
    /// Rules, for an executor that knows all values: the first case is split into the others.
    Schedules(Vec<Schedules>),
    /// A network that an executor can keep to that learns the values as they come about.
    Strategy(Strategy),
    /// No proof: it is taken for granted.
    Assumed,
}

/// Schedules for the values in a part of the box.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Schedules {
    /// Those in the first case are for a parameter at its least value, those in the second one for
    /// it at its greatest. Between a schedule for the one and a schedule for the other lie schedules
    /// for all values between, because everything is linear.
    Split {
        /// The parameter, by position.
        parameter: usize,
        /// The cases, by position.
        cases: [usize; 2],
    },
    /// Of each point how its time depends on the values.
    Rule(Vec<Affine>),
}

/// `constant + Σ factor · value of the parameter`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Affine {
    /// What depends on no value.
    #[serde(with = "crate::number")]
    pub constant: elbowroom_num::Rational,
    /// What values count.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<Factor>,
}

/// What the value of a parameter counts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// The parameter, by position.
    pub parameter: usize,
    /// How often it counts.
    #[serde(with = "crate::number")]
    pub factor: elbowroom_num::Rational,
}

/// What an executor has to keep to beside the network's own bounds, so that what an event means for
/// the future shows at the points next to it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Strategy {
    /// Bounds on differences.
    pub edges: Vec<Edge>,
    /// Points that wait.
    pub waits: Vec<Wait>,
}

/// `time of to - time of from <= most`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edge {
    /// The point that is subtracted.
    pub from: usize,
    /// The point it is subtracted from.
    pub to: usize,
    /// The greatest difference.
    #[serde(with = "crate::number")]
    pub most: elbowroom_num::Rational,
}

/// A point that waits for the end of a duration, but not longer than `delay` after its beginning.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wait {
    /// The point.
    pub point: usize,
    /// The duration, by the position of its constraint.
    pub duration: usize,
    /// For how long at most; none for however long the duration takes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay: Option<Exact>,
}

/// A condition of the plan, with all ways in which it could fail.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// What has to hold, in words.
    pub why: String,
    /// For what has to hold throughout: between which points. It fails at some moment strictly between
    /// these, whose time is that of one point more than there are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub during: Option<[usize; 2]>,
    /// Why it cannot fail: the first case is split into the others. Without any, that is taken for
    /// granted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cases: Vec<Failing>,
}

/// Why a condition cannot fail, in one case.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Failing {
    /// The moment is at or after the time of this point (in the first case), or before it.
    Either {
        /// The point.
        event: usize,
        /// The cases, by position.
        cases: [usize; 2],
    },
    /// There is no such moment: a sum of bounds and differences that cannot be.
    Never(Vec<Summand>),
    /// It could fail in these ways, none of which is possible.
    Ways(Vec<Way>),
}

/// One way in which a condition could fail: all of these at once.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Way {
    /// Bounds on differences of times.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub differences: Vec<Difference>,
    /// Other inequalities.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inequalities: Vec<Inequality>,
    /// Parameters that are multiplied in the inequalities: there is a sum for each combination of
    /// their ends, the last parameter's ends first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corners: Vec<usize>,
    /// Why that cannot be: sums of bounds, differences and inequalities.
    pub sums: Vec<Vec<Summand>>,
}

/// `time of to - time of from <= most`, or less than that.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Difference {
    /// The point that is subtracted.
    pub from: usize,
    /// The point it is subtracted from.
    pub to: usize,
    /// The greatest difference.
    #[serde(with = "crate::number")]
    pub most: elbowroom_num::Rational,
    /// Whether it is less than that.
    #[serde(default, skip_serializing_if = "is_no")]
    pub strict: bool,
}

/// `constant + Σ factor · time + Σ factor · value + Σ factor · value · time or value <= 0`, or less
/// than 0.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inequality {
    /// What depends on nothing.
    #[serde(with = "crate::number")]
    pub constant: elbowroom_num::Rational,
    /// What times count.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub times: Vec<Timed>,
    /// What values count.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<Factor>,
    /// What products count.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub products: Vec<Product>,
    /// Whether it is less than 0.
    #[serde(default, skip_serializing_if = "is_no")]
    pub strict: bool,
}

/// What the time of a point counts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timed {
    /// The point.
    pub point: usize,
    /// How often it counts.
    #[serde(with = "crate::number")]
    pub factor: elbowroom_num::Rational,
}

/// What a product counts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Product {
    /// The parameter, by position.
    pub parameter: usize,
    /// What its value is multiplied by.
    pub by: Multiplied,
    /// How often the product counts.
    #[serde(with = "crate::number")]
    pub factor: elbowroom_num::Rational,
}

/// What a value is multiplied by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Multiplied {
    /// The time of this point.
    Time(usize),
    /// The value of this parameter.
    Parameter(usize),
}

/// An inequality that is added, and how often.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summand {
    /// Which inequality.
    pub of: Ground,
    /// How often; positive.
    #[serde(with = "crate::number")]
    pub factor: elbowroom_num::Rational,
}

/// An inequality that holds in every schedule, or in a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ground {
    /// This point comes at time 0 or later.
    Beginning(usize),
    /// The lower bound of the constraint at this position.
    Least(usize),
    /// The upper bound of the constraint at this position.
    Most(usize),
    /// This difference: those of the moment and its place first, then those of the way.
    Difference(usize),
    /// This inequality of the way.
    Inequality(usize),
}

/// What need not be said.
#[allow(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde hands references out"
)]
fn is_no(told: &bool) -> bool {
    !told
}
