//! A plan that is given as a temporal network: [`GivenPlan`].

use elbowroom_model::problem::{ObjectId, SchemaId};
use elbowroom_num::Rational;

use crate::certificate::Limit;

/// A plan with the constraints of its file, such as an STN plan file.
///
/// Its time points are time zero, then the start and the end of each instance (or its one point), in this
/// order, then the timed initials of the problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenPlan {
    /// The action instances.
    pub instances: Vec<GivenInstance>,
    /// The constraints of the file, in its order.
    pub constraints: Vec<GivenConstraint>,
    /// The parameters of the file, in its order.
    pub parameters: Vec<GivenParameter>,
}

/// An action instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenInstance {
    /// The label of the instance in constraints.
    pub label: String,
    /// The action.
    pub schema: SchemaId,
    /// Its arguments.
    pub arguments: Vec<ObjectId>,
}

/// `lower <= time of to - time of from <= upper`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenConstraint {
    /// The point that is subtracted.
    pub from: usize,
    /// The point it is subtracted from.
    pub to: usize,
    /// The least difference.
    pub lower: Limit,
    /// The greatest difference.
    pub upper: Limit,
}

/// A quantity that the file leaves open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenParameter {
    /// Its name. `?s` is a number of the domain, and `LABEL.?r` one of an action instance.
    pub name: String,
    /// Its nominal value.
    pub nominal: Rational,
    /// The weight of its width.
    pub weight: Rational,
    /// The least and the greatest value that it can take at all; `None`: no limit.
    pub range: [Option<Rational>; 2],
}
