//! What a box is to be the greatest of, for the search by cases ([`branch`](super::branch)).

use std::ops::ControlFlow;

use elbowroom_num::Rational;
use elbowroom_plan::ParametrizedPlan;

use super::master::{Master, Solved};
use super::volume::Volume;
use super::{Source, Variables};

/// An objective over the ends of a box.
pub(super) enum Goal {
    /// The sum of the variables, each so many times.
    Sum(Vec<Rational>),
    /// The product of the widths.
    Volume(Volume),
}

/// The best values of a case, or about the best ones.
pub(super) enum Outcome {
    /// Of these values.
    Best {
        values: Vec<Rational>,
        /// Nothing in this case is worth more than this.
        bound: Rational,
        /// Why.
        proof: Vec<(Source, Rational)>,
        /// Of each parameter the slope of the tangent that the proof is about; none if the
        /// objective is linear itself.
        slopes: Vec<Rational>,
    },
    /// There are none, because of this.
    Impossible(Vec<(Source, Rational)>),
    /// Nobody wanted to wait for them.
    Unknown,
}

impl Goal {
    /// The weighted sum of widths.
    pub(super) fn widths(plan: &ParametrizedPlan, variables: &Variables) -> Self {
        let worths = variables.ends.iter().map(|ends| {
            let weights = ends.iter().map(|end| &plan.parameter(end.parameter).weight);
            weights.sum()
        });
        Self::Sum(worths.collect())
    }

    /// A box is as good as the best one if it is worth at most so much less.
    pub(super) fn tolerance(&self) -> Rational {
        match self {
            Self::Sum(_) => Rational::ZERO,
            Self::Volume(_) => super::tolerance(),
        }
    }

    /// What a box is worth, at least.
    pub(super) fn worth(&self, values: &[Rational]) -> Rational {
        match self {
            Self::Sum(worths) => worths.iter().zip(values).map(|(w, v)| w * v).sum(),
            Self::Volume(volume) => volume.worth(values),
        }
    }

    /// What no box can be worth more than, whatever the cuts.
    pub(super) fn most(&self, variables: &Variables) -> Rational {
        match self {
            Self::Sum(_) => self.worth(&variables.most),
            Self::Volume(volume) => volume.most(&variables.most),
        }
    }

    /// The best values in a case; `known` are those of a box inside the envelope.
    pub(super) fn solve(
        &self,
        master: &mut Master,
        variables: &Variables,
        (chosen, known): (&[(usize, usize)], &[Rational]),
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Outcome {
        match self {
            Self::Sum(worths) => match master.solve(chosen, worths) {
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
                },
            },
            Self::Volume(volume) => volume.solve(master, variables, (chosen, known), flow),
        }
    }
}
