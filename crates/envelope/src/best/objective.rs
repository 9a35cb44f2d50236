//! Objectives of the search by cases ([`branch`](super::branch)).

use std::ops::ControlFlow;

use elbowroom_num::Rational;
use elbowroom_plan::ParametrizedPlan;

use super::concave_maximum::CaseContext;
use super::master::{Master, Solved, Span};
use super::probability::Probability;
use super::volume::Volume;
use super::{BoundSource, TangentPoint, Variables};

/// Objective over the ends of a box.
pub(super) enum ObjectiveFunction {
    /// The sum of the variables, each with its weight.
    Sum(Vec<Rational>),
    /// The product of the widths.
    Volume(Volume),
    /// The product of the probabilities of the intervals.
    Probability(Probability),
}

/// The best values of a case, possibly approximate.
pub(super) enum Outcome {
    /// The best values.
    Best {
        values: Vec<Rational>,
        /// Upper bound on the objective in this case.
        bound: Rational,
        /// Proof of the bound.
        proof: Vec<(BoundSource, Rational)>,
        /// The slope of the proof's tangent for each parameter; empty if the objective is linear.
        slopes: Vec<Rational>,
        /// For probabilities, the points of contact of the tangents.
        touches: Vec<TangentPoint>,
    },
    /// There are no values; with the proof.
    Impossible(Vec<(BoundSource, Rational)>),
    /// The caller ended the search.
    Unknown,
}

impl ObjectiveFunction {
    /// Creates the weighted sum of widths.
    pub(super) fn widths(plan: &ParametrizedPlan, variables: &Variables) -> Self {
        let worths = variables.ends.iter().map(|ends| {
            let weights = ends.iter().map(|end| &plan.parameter(end.parameter).weight);
            weights.sum()
        });
        Self::Sum(worths.collect())
    }

    /// Returns the tolerance: a box counts as best if its value is at most this much below the best
    /// one.
    pub(super) fn tolerance(&self) -> Rational {
        match self {
            Self::Sum(_) => Rational::ZERO,
            Self::Volume(_) | Self::Probability(_) => super::tolerance(),
        }
    }

    /// Returns a lower bound on the value of a box.
    pub(super) fn lower_bound(&self, values: &[Rational]) -> Rational {
        match self {
            Self::Sum(worths) => worths.iter().zip(values).map(|(w, v)| w * v).sum(),
            Self::Volume(volume) => volume.lower_value(values),
            Self::Probability(probability) => probability.value(values),
        }
    }

    /// Returns an upper bound on the value of any box, without cuts.
    pub(super) fn upper_bound(&self, variables: &Variables) -> Rational {
        match self {
            Self::Sum(_) => self.lower_bound(&variables.max_distances),
            Self::Volume(volume) => volume.upper_value(&variables.max_distances),
            // No probability is more than 1.
            Self::Probability(_) => Rational::ZERO,
        }
    }

    /// Returns the ranges of the variables in which the objective is defined, or still increases;
    /// empty if there are no limits.
    pub(super) fn spans(&self, variables: &Variables) -> Vec<Span> {
        match self {
            Self::Sum(_) | Self::Volume(_) => Vec::new(),
            Self::Probability(probability) => probability.spans(variables),
        }
    }

    /// Returns a variable and a value that split a case into two parts with tighter bounds on the
    /// objective; `None` if there is none.
    pub(super) fn split_point(
        &self,
        spans: &[Span],
        touches: &[TangentPoint],
    ) -> Option<(usize, Rational)> {
        match self {
            Self::Sum(_) | Self::Volume(_) => None,
            Self::Probability(probability) => probability.split_point(spans, touches),
        }
    }

    /// Computes the best values in a case.
    pub(super) fn solve(
        &self,
        master: &mut Master,
        variables: &Variables,
        case: CaseContext<'_>,
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Outcome {
        match self {
            Self::Sum(worths) => match master.solve(case.chosen, &[], worths) {
                Solved::Impossible(proof) => Outcome::Impossible(proof),
                Solved::Best {
                    values,
                    worth: bound,
                    proof,
                } => Outcome::Best {
                    values,
                    bound,
                    proof,
                    slopes: Vec::new(),
                    touches: Vec::new(),
                },
            },
            Self::Volume(volume) => volume.solve(master, variables, case, flow),
            Self::Probability(probability) => probability.solve(master, variables, case, flow),
        }
    }
}
