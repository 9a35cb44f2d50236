//! The whole region of values for which a plan works, as a union of polyhedra.
//!
//! Eliminating the times from the network's bounds (Fourier and Motzkin) gives the polyhedron of
//! the values that have a schedule. Eliminating them from these bounds and one of a requirement's
//! bad cases gives the values that have a schedule with this violation. The region is the first
//! polyhedron minus the others. Strict inequalities stay strict.
//!
//! The polyhedra of the union are disjoint.

mod polyhedron;
mod projection;
mod volume;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use elbowroom_num::{End, Rational};
use elbowroom_plan::{NodeId, ParameterId, ParametrizedPlan};

use crate::linear::Linear;
use crate::obligations::{Inequality, Obligation};
use polyhedron::{Halfspace, Polyhedron};

pub use projection::Polygon;
pub use volume::{BoundedRegion, Component};

/// The limit on polyhedra of the union.
const MAX_PIECES: usize = 256;

/// All values for which a plan works: the union of the pieces.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Region {
    /// Disjoint polyhedra; empty if there are no such values.
    pub pieces: Vec<Piece>,
    /// Reason why the pieces may not cover the whole region; `None` if they do.
    pub missing: Option<ExactError>,
}

/// Polyhedron of values, without redundant rows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Piece {
    /// Inequalities that the values satisfy.
    pub rows: Vec<RegionRow>,
}

/// `Σ factor · parameter <= bound`, or `<` when strict.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RegionRow {
    /// The factor of each parameter; none is zero, and all are whole numbers without a common
    /// divisor.
    pub factors: BTreeMap<ParameterId, Rational>,
    /// The upper bound of the sum.
    pub bound: Rational,
    /// `true` if the bound itself is excluded.
    pub is_strict: bool,
    /// Origins of the row.
    pub sources: BTreeSet<RegionSource>,
}

/// The origin of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RegionSource {
    /// The natural range of a parameter.
    Range(ParameterId),
    /// The bound of the network at this position.
    Network(usize),
    /// The requirement at this position.
    Requirement(usize),
}

/// Error for a region that is not a union of polyhedra, or that is too large.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExactError {
    /// A condition is not linear.
    #[error(
        "a condition multiplies open quantities, so the region is not polyhedral; vary fewer \
         quantities"
    )]
    NotLinear {
        /// The position of the requirement; `None` if it is a bound of the network.
        requirement: Option<usize>,
    },
    /// The elimination takes too many inequalities.
    #[error("the region needs more than {limit} inequalities; vary fewer quantities")]
    TooManyRows {
        /// Limit on the number kept.
        limit: usize,
    },
    /// Too many polyhedra.
    #[error("the region has more than {limit} pieces; vary fewer quantities")]
    TooManyPieces {
        /// Limit on the number kept.
        limit: usize,
    },
    /// The caller ended the computation.
    #[error("the time limit was reached before the region was complete")]
    Stopped,
}

impl RegionRow {
    /// Returns `true` if the row holds for these values, by parameter.
    pub fn holds(&self, value: &dyn Fn(ParameterId) -> Rational) -> bool {
        let terms = self.factors.iter();
        let sum: Rational = terms.map(|(id, factor)| factor * &value(*id)).sum();
        sum < self.bound || (sum == self.bound && !self.is_strict)
    }
}

impl Region {
    /// Returns `true` if the plan works with these values, by parameter.
    pub fn contains(&self, value: &dyn Fn(ParameterId) -> Rational) -> bool {
        let has = |piece: &Piece| piece.rows.iter().all(|row| row.holds(value));
        self.pieces.iter().any(has)
    }
}

/// Computes the region of a plan, provided that happenings keep the order that the requirements
/// assume: all values for which `network` has a schedule, and no bad case of `obligations` holds in
/// any schedule. Bad cases may use the node after the plan's last, which is a moment inside an
/// action.
///
/// `flow` is polled often. If it breaks, or a limit is reached, the pieces found so far are
/// returned with the [missing](Region::missing) part's reason. They are a part of the region.
///
/// # Errors
/// If something is not linear, or if no piece was found before a limit or the end.
pub fn exact(
    plan: &ParametrizedPlan,
    network: &[Inequality],
    obligations: &[Obligation],
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Region, ExactError> {
    let coordinates = Coordinates {
        // One more for a moment inside an action.
        times: plan.plan.nodes.len() + 1,
    };
    let mut bounds = Polyhedron::default();
    for (index, inequality) in network.iter().enumerate() {
        let source = RegionSource::Network(index);
        let row = coordinates.row(inequality, source);
        bounds.push(row.ok_or(ExactError::NotLinear { requirement: None })?);
    }
    for (index, parameter) in plan.parameters.iter().enumerate() {
        for row in coordinates.range(ParameterId::from(index), parameter) {
            bounds.push(row);
        }
    }
    let mut scheduled = bounds.clone().without(coordinates.times, flow)?;
    scheduled.reduce(flow)?;
    if !scheduled.is_feasible() {
        return Ok(Region::default());
    }
    // The polyhedra of violations, each with the number of its rows that the schedules do not
    // imply.
    let mut bad: Vec<(usize, Polyhedron)> = Vec::new();
    for (index, obligation) in obligations.iter().enumerate() {
        let source = RegionSource::Requirement(index);
        for case in &obligation.bad_cases {
            let differences = case.differences.iter().map(difference);
            let mut rows = bounds.clone();
            for inequality in differences.chain(case.inequalities.iter().cloned()) {
                let row = coordinates.row(&inequality, source);
                let requirement = Some(index);
                rows.push(row.ok_or(ExactError::NotLinear { requirement })?);
            }
            if flow().is_break() {
                return Err(ExactError::Stopped);
            }
            if !rows.is_feasible() {
                continue;
            }
            let mut broken = rows.without(coordinates.times, flow)?;
            broken.reduce(flow)?;
            broken.retain(|row| scheduled.with(row.negated()).is_feasible());
            bad.push((broken.rows().len(), broken));
        }
    }
    // Those that cut off a half-space come first, because they do not split a piece.
    bad.sort_by_key(|(count, _)| *count);
    let bad: Vec<Polyhedron> = bad.into_iter().map(|(_, broken)| broken).collect();
    let (pieces, missing) = subtract_all(scheduled, &bad, flow);
    match missing {
        Some(limit) if pieces.is_empty() => Err(limit),
        missing => Ok(Region {
            pieces: pieces.iter().map(|own| coordinates.piece(own)).collect(),
            missing,
        }),
    }
}

/// Subtracts polyhedra from another one, and returns disjoint parts. Each part is completed before
/// the next one, so that the completed parts are correct when a limit is reached.
fn subtract_all(
    whole: Polyhedron,
    bad: &[Polyhedron],
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> (Vec<Polyhedron>, Option<ExactError>) {
    let mut done = Vec::new();
    let mut open = vec![(whole, 0)];
    while let Some((piece, next)) = open.pop() {
        if flow().is_break() {
            return (done, Some(ExactError::Stopped));
        }
        let Some(broken) = bad.get(next) else {
            if done.len() == MAX_PIECES {
                let limit = MAX_PIECES;
                return (done, Some(ExactError::TooManyPieces { limit }));
            }
            done.push(piece);
            continue;
        };
        let before = open.len();
        for mut part in piece.subtract(broken) {
            if let Err(ended) = part.reduce(flow) {
                return (done, Some(ended));
            }
            open.push((part, next + 1));
        }
        open[before..].reverse();
    }
    (done, None)
}

/// Converts `to - from <= bound` to an inequality.
fn difference(difference: &crate::obligations::Difference) -> Inequality {
    let mut expression = Linear::difference(difference.from, difference.to);
    expression.constant = -&difference.bound;
    Inequality {
        expression,
        is_strict: difference.is_strict,
    }
}

/// Numbering of times and parameters: the times first, by node.
struct Coordinates {
    times: usize,
}

impl Coordinates {
    /// Converts an inequality; `None` if it is not linear.
    fn row(&self, inequality: &Inequality, source: RegionSource) -> Option<Halfspace> {
        let expression = &inequality.expression;
        if !expression.products.is_empty() {
            return None;
        }
        let time = |(node, factor): &(NodeId, Rational)| (node.index(), factor.clone());
        let times = expression.times.iter().map(time);
        let parameters = expression.parameters.iter();
        let parameters = parameters.map(|(id, factor)| (self.times + id.index(), factor.clone()));
        Some(Halfspace {
            factors: times.chain(parameters).collect(),
            bound: -&expression.constant,
            is_strict: inequality.is_strict,
            sources: [source].into(),
        })
    }

    /// Returns the half-spaces of the natural range of a parameter.
    fn range(&self, id: ParameterId, parameter: &elbowroom_plan::Parameter) -> Vec<Halfspace> {
        let range = &parameter.range;
        let sides = [(&range.lower, -1), (&range.upper, 1)];
        let row = |(end, sign): (&End, i64)| {
            let sign = Rational::from(sign);
            Some(Halfspace {
                bound: end.value()? * &sign,
                factors: [(self.times + id.index(), sign)].into(),
                is_strict: matches!(end, End::Open(_)),
                sources: [RegionSource::Range(id)].into(),
            })
        };
        sides.into_iter().filter_map(row).collect()
    }

    fn piece(&self, polyhedron: &Polyhedron) -> Piece {
        let row = |row: &Halfspace| {
            let parameter = |index: usize| ParameterId::from(index - self.times);
            let factors = row.factors.iter();
            RegionRow {
                factors: factors
                    .map(|(index, factor)| (parameter(*index), factor.clone()))
                    .collect(),
                bound: row.bound.clone(),
                is_strict: row.is_strict,
                sources: row.sources.clone(),
            }
        };
        Piece {
            rows: polyhedron.rows().iter().map(row).collect(),
        }
    }
}
