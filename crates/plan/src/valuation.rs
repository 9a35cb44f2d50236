//! Parameters of a plan, and values for them.

use elbowroom_num::Rational;

use crate::numbers::numbers_by_id;

/// A parameter of a [`ParametrizedPlan`](crate::ParametrizedPlan), by position in its list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ParameterId(pub u32);

impl ParameterId {
    /// Returns the position in
    /// [`ParametrizedPlan::parameters`](crate::ParametrizedPlan::parameters).
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl From<usize> for ParameterId {
    fn from(index: usize) -> Self {
        Self(u32::try_from(index).expect("fewer than 2^32 parameters"))
    }
}

/// A value for each parameter, by position. The default is for a plan without parameters.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Valuation {
    numbers: Vec<Rational>,
}

numbers_by_id!(Valuation, ParameterId);
