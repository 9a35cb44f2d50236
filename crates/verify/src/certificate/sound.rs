//! Part of a certificate that proves that the box is inside the envelope.

use serde::{Deserialize, Serialize};

use super::{End, Exact};

/// Proof that the box is inside the envelope.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sound {
    /// Ends of the box that are infinite. The slacks give the others.
    pub endless: Vec<Endless>,
    /// Proof that all points can be scheduled, as the guarantee requires.
    pub control: Control,
    /// Proofs that each condition of the plan holds in every schedule for values in the box; `None`
    /// if this is assumed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub conditions: Option<Vec<Condition>>,
}

/// An end of an interval that is infinite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Endless {
    /// The parameter, by position.
    pub parameter: usize,
    /// End of its interval.
    pub end: End,
}

/// Proof that all points can be scheduled for all values in the box.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Control {
    /// Fixed times, for the strong guarantee: one for each point that the executor schedules,
    /// `None` for points that the world decides.
    Times(Vec<Option<Exact>>),
    /// Rules, for an executor that knows all values. The first case is split into the others.
    Schedules(Vec<Schedules>),
    /// A network that an executor can satisfy while it observes the values during execution.
    Strategy(Strategy),
    /// No proof: the property is assumed.
    Assumed,
}

/// Schedules for the values in a part of the box.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Schedules {
    /// The first case is for the least value of the parameter, the second one for its greatest
    /// value. For a value between them, interpolating between the two schedules gives a schedule,
    /// because all constraints are linear.
    Split {
        /// The parameter, by position.
        parameter: usize,
        /// The cases, by position.
        cases: [usize; 2],
    },
    /// Time of each point as a function of the values.
    Rule(Vec<Affine>),
}

/// `constant + Σ factor · value of the parameter`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Affine {
    /// Constant term.
    #[serde(with = "crate::number")]
    pub constant: elbowroom_num::Rational,
    /// Terms in values of parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<Factor>,
}

/// Term of an [`Affine`] function: a parameter with its factor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// The parameter, by position.
    pub parameter: usize,
    /// Factor.
    #[serde(with = "crate::number")]
    pub factor: elbowroom_num::Rational,
}

/// Bounds that an executor has to satisfy in addition to those of the network. With them, the
/// effect of an event on the future shows in the bounds on its neighbouring points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Strategy {
    /// Bounds on differences of times.
    pub edges: Vec<Edge>,
    /// Conditional bounds.
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

/// A point that waits for the end of a duration, but at most for `delay` after its start.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wait {
    /// The point.
    pub point: usize,
    /// The duration, by the position of its constraint.
    pub duration: usize,
    /// Longest wait; `None` if the point waits until the duration ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay: Option<Exact>,
}

/// A condition of the plan, with all possible violations.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// The condition, in words.
    pub why: String,
    /// For an over-all condition: the start and the end point of its action. It fails at some
    /// moment strictly between these. The moment is an additional point, with the position after
    /// the last point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub during: Option<[usize; 2]>,
    /// Proof that the condition cannot fail. The first case is split into the others. If there are
    /// none, the condition is assumed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cases: Vec<FailureCase>,
}

/// Proof that a condition cannot fail, in one case.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FailureCase {
    /// The moment is at or after the time of this point (in the first case), or before it.
    Either {
        /// The point.
        event: usize,
        /// The cases, by position.
        cases: [usize; 2],
    },
    /// There is no such moment: a contradictory sum of bounds and differences.
    Never(Vec<Summand>),
    /// Possible violations, each refuted.
    Ways(Vec<Violation>),
}

/// Possible violation of a condition: all of these inequalities hold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Violation {
    /// Bounds on differences of times.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub differences: Vec<Difference>,
    /// Other inequalities.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inequalities: Vec<Inequality>,
    /// Parameters that are multiplied in the inequalities. There is a sum for each combination of
    /// their ends; the ends of the last parameter vary fastest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corners: Vec<usize>,
    /// Refutation: sums of bounds, differences and inequalities.
    pub sums: Vec<Vec<Summand>>,
}

/// `time of to - time of from <= most`, or `<` if strict.
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
    /// `true` if the inequality is strict.
    #[serde(default, skip_serializing_if = "is_no")]
    pub strict: bool,
}

/// `constant + Σ factor · time + Σ factor · value + Σ factor · value · time or value <= 0`, or `<
/// 0` if strict.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inequality {
    /// Constant term.
    #[serde(with = "crate::number")]
    pub constant: elbowroom_num::Rational,
    /// Terms in times.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub times: Vec<TimeTerm>,
    /// Terms in values of parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<Factor>,
    /// Terms in products.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub products: Vec<Product>,
    /// `true` if the inequality is strict.
    #[serde(default, skip_serializing_if = "is_no")]
    pub strict: bool,
}

/// Term in the time of a point.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeTerm {
    /// The point.
    pub point: usize,
    /// Factor.
    #[serde(with = "crate::number")]
    pub factor: elbowroom_num::Rational,
}

/// Term in a product of a parameter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Product {
    /// The parameter, by position.
    pub parameter: usize,
    /// Second factor of the product.
    pub by: Multiplied,
    /// Constant factor.
    #[serde(with = "crate::number")]
    pub factor: elbowroom_num::Rational,
}

/// Second factor of a product.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Multiplied {
    /// The time of this point.
    Time(usize),
    /// The value of this parameter.
    Parameter(usize),
}

/// An inequality that is added, with its multiplier.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summand {
    /// The inequality.
    pub of: Ground,
    /// Multiplier; positive.
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
    /// The difference at this position: first those of the moment and its case, then those of the
    /// violation.
    Difference(usize),
    /// The inequality of the violation at this position.
    Inequality(usize),
}

/// Returns `true` if the field is omitted from the output.
#[allow(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde hands references out"
)]
fn is_no(told: &bool) -> bool {
    !told
}
