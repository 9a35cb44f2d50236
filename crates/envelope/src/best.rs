//! The largest box inside an envelope, with a proof that there is no larger one.
//!
//! The search approaches the envelope from outside. If the oracle rejects a box, the reason is a
//! [`Cut`]: a linear inequality in the ends of all boxes, or several inequalities, at least one of
//! which holds. The best box that satisfies all known cuts is at least as good as the best one
//! inside the envelope. The first such box that the oracle accepts is the best one, and the cuts
//! prove it.
//!
//! - [`Objective::LeastSlack`]: all ends move out together, relative to their nominal values, until
//!   one is stopped; the others continue. No linear program is needed ([`leximin`]).
//! - [`Objective::Widths`]: a linear program over the cuts, with branch and bound where a cut has
//!   alternatives ([`branch`]).
//! - [`Objective::Volume`]: the same, with linear programs over tangents of the logarithm
//!   ([`volume`]).
//! - [`Objective::Probability`]: the same with the logarithm of a probability, and with cases for
//!   values that have a positive probability ([`probability`]).

mod barrier;
mod branch;
mod concave_maximum;
mod leximin;
mod log_probability;
mod master;
mod objective;
mod probability;
mod volume;

use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_num::log_concave::LogConcaveDistribution;
use elbowroom_num::{Interval, Rational, terms};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParameterId, ParametrizedPlan, Side};
use serde::{Deserialize, Serialize};

use crate::cut::Cut;
use crate::irr::scales;
use crate::objection::Objection;
use crate::obligations::Refusal;
use crate::oracle::Oracle;
use crate::row::Row;

use objective::ObjectiveFunction;
use probability::Probability;
use volume::Volume;

pub use elbowroom_num::log_concave::TangentPoint;
pub use volume::width_offset as volume_foot;

terms! {
    /// The objective of a largest box.
    ///
    /// For the volume, a millionth is added to each width first, relative to its nominal value, so that the product is
    /// not 0 if one duration cannot deviate at all. The value of the volume and of the probability is the logarithm;
    /// [`LOG_OF_ZERO`] replaces the logarithm of 0. A box counts as best for them if no other is better by more than a
    /// millionth.
    #[derive(
        Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
    )]
    #[serde(rename_all = "kebab-case")]
    #[non_exhaustive]
    pub enum Objective {
        #[default]
        LeastSlack = "least-slack":
            "The least slack of any bound, relative to the nominal value; then the second least, and so on",
        Widths = "widths": "The sum of the widths of all intervals, times the weights of --vary",
        Volume = "volume":
            "The product of the widths of all intervals, with the weights of --vary as exponents",
        Probability = "probability":
            "The probability that independent durations, distributed as in the world file of --world, all stay inside",
    }
}

/// Value of a box with probability 0, in place of the logarithm.
pub const LOG_OF_ZERO: i64 = -1_000_000;

impl fmt::Display for Objective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Settings of [`best()`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BestSettings {
    /// The objective.
    pub objective: Objective,
    /// `true` if both ends of an interval are equally far from the nominal value.
    pub symmetric: bool,
    /// Greatest deviation that counts, as a multiple of the nominal value.
    pub max_deviation: Rational,
    /// For [`Objective::Probability`]: the distribution of each parameter, in their order. A
    /// parameter without a distribution, or missing in the list, always has its nominal value.
    pub distributions: Vec<Option<LogConcaveDistribution>>,
}

impl Default for BestSettings {
    /// Least slack, with deviations up to nine times the nominal value.
    fn default() -> Self {
        Self {
            objective: Objective::default(),
            symmetric: false,
            max_deviation: Rational::from(9),
            distributions: Vec::new(),
        }
    }
}

/// Returns the tolerance of objectives that are logarithms: a box counts as best if no other is
/// better by more than a millionth.
pub(crate) fn tolerance() -> Rational {
    Rational::new(1, 1_000_000)
}

/// The result of [`best`].
#[derive(Clone, Debug, PartialEq)]
pub struct BestRun {
    /// The box; `Err` if the plan does not work at the nominal values.
    pub envelope: Result<DecoupledEnvelope, Objection>,
    /// The value of the objective: the least slack, the sum of widths, or the logarithm of the
    /// volume, which is rounded down to a billionth.
    pub value: Rational,
    /// An upper bound on the objective of all boxes; equal to `value` if the box is proved to be
    /// the largest, except for at most a millionth if the objective is a logarithm.
    pub bound: Rational,
    /// `true` if there is no better box. With [`Objective::LeastSlack`], the second least slack is
    /// also proven to be the greatest possible, and so on.
    pub is_proved: bool,
    /// The number of boxes checked.
    pub checks: usize,
    /// `true` if the caller ended the search.
    pub is_cancelled: bool,
    /// Proof that there is no better box.
    pub proof: BestProof,
}

/// Proof that no box is better.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BestProof {
    /// Cuts: inequalities that all boxes inside the envelope satisfy.
    pub cuts: Vec<Cut>,
    /// Derivation of the best value from the cuts.
    pub reasons: OptimalityProof,
    /// Variables with their values in the best box; empty if there is no box.
    pub variables: Vec<BoxVariable>,
}

/// Variable that moves one end, or both ends of an interval if boxes are symmetric.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoxVariable {
    /// The ends.
    pub ends: Vec<BoxEnd>,
    /// Size that its slack is relative to.
    pub scale: Rational,
    /// Greatest distance from the nominal value to which it can move the ends.
    pub max_distance: Rational,
    /// Distance from the nominal value in the best box. An end at the limit that nothing stops is
    /// infinite in the returned box.
    pub value: Rational,
}

/// Derivation of the best value from the cuts.
#[derive(Clone, Debug, PartialEq)]
pub enum OptimalityProof {
    /// The variables in the order in which they were stopped, each with the cut that stopped it.
    Levels(Vec<BlockedVariable>),
    /// A tree of cases, the first its root.
    Tree(Vec<ProofCase>),
}

impl Default for OptimalityProof {
    fn default() -> Self {
        Self::Levels(Vec::new())
    }
}

/// Variable that can only gain slack if another one with no more slack loses some.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockedVariable {
    /// The ends that the variable moves.
    pub ends: Vec<BoxEnd>,
    /// Deviation relative to the nominal value.
    pub slack: Rational,
    /// The cut that stops it, by position; `None` if its own range or the greatest deviation does.
    pub cut: Option<usize>,
}

/// One case of a tree: a bound on the objective, or a distinction of cases.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ProofCase {
    /// One row of the cut at this position holds: one case for each row.
    AnyRow {
        /// The cut.
        cut: usize,
        /// The cases, by position in the tree.
        cases: Vec<usize>,
    },
    /// The objective is at most the sum of these bounds, each times its multiplier. With
    /// `is_impossible`, the bounds contradict each other.
    Bounded {
        /// The bounds.
        multipliers: Vec<(BoundSource, Rational)>,
        /// For an objective that is not linear, the slope of the tangent of each parameter; for a
        /// probability, those of its lower end and of its upper one.
        slopes: Vec<Rational>,
        /// For a probability, the point of contact of each parameter's tangent.
        touches: Vec<TangentPoint>,
        /// `true` if there is no box in this case.
        is_impossible: bool,
    },
    /// The variable is less than this, or not: one case for each.
    Split {
        /// The variable.
        variable: usize,
        /// The value.
        at: Rational,
        /// The cases, by position in the tree.
        cases: [usize; 2],
    },
}

/// The source of a bound on a variable of the master problem, or on a sum of variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BoundSource {
    /// A row of a cut: position of the cut, position of the row.
    Row(usize, usize),
    /// The upper bound of a variable.
    Most(usize),
    /// The lower bound 0 of a variable.
    Least(usize),
}

/// A step of the search.
#[derive(Clone, Debug)]
pub struct BestStep<'a> {
    /// The best box so far.
    pub envelope: &'a DecoupledEnvelope,
    /// The number of boxes checked.
    pub checks: usize,
}

/// Variables of the search: each moves one end, or both ends of a parameter if boxes are symmetric.
#[derive(Clone, Debug)]
pub(crate) struct Variables {
    /// The ends moved by each variable.
    pub(crate) ends: Vec<Vec<BoxEnd>>,
    /// Size of the nominal value that its slack is relative to.
    pub(crate) scales: Vec<Rational>,
    /// Greatest distance to which it can move the ends.
    pub(crate) max_distances: Vec<Rational>,
}

impl Variables {
    fn new(plan: &ParametrizedPlan, settings: &BestSettings) -> Self {
        let mut variables = Self {
            ends: Vec::new(),
            scales: Vec::new(),
            max_distances: Vec::new(),
        };
        let scales = scales(plan);
        for (index, parameter) in plan.parameters.iter().enumerate() {
            let id = ParameterId::from(index);
            let point = Interval::point(parameter.nominal.clone());
            let ends = Side::BOTH.map(|side| BoxEnd {
                parameter: id,
                side,
            });
            let most = ends.map(|end| {
                let counted = &scales[index] * &settings.max_deviation;
                let natural = end.side.reach(&parameter.range);
                let base = end.side.reach(&point).unwrap_or_default();
                natural.map_or(counted.clone(), |most| counted.min(most - base))
            });
            let [low, high] = most;
            let groups = if settings.symmetric {
                vec![(ends.to_vec(), low.min(high))]
            } else {
                vec![(vec![ends[0]], low), (vec![ends[1]], high)]
            };
            for (ends, most) in groups {
                variables.ends.push(ends);
                variables.scales.push(scales[index].clone());
                variables.max_distances.push(most);
            }
        }
        variables
    }

    /// Returns the variables with their values in a box.
    fn values_of(
        &self,
        nominal: &DecoupledEnvelope,
        envelope: &DecoupledEnvelope,
    ) -> Vec<BoxVariable> {
        let all = self.ends.iter().zip(&self.scales).zip(&self.max_distances);
        all.map(|((ends, scale), most)| {
            let far = ends[0].reach(envelope).zip(ends[0].reach(nominal));
            BoxVariable {
                ends: ends.clone(),
                scale: scale.clone(),
                max_distance: most.clone(),
                value: far.map_or_else(|| most.clone(), |(far, near)| far - near),
            }
        })
        .collect()
    }

    /// Returns the least slack of a box, up to the greatest deviation.
    fn least_slack(
        &self,
        nominal: &DecoupledEnvelope,
        envelope: &DecoupledEnvelope,
    ) -> Option<Rational> {
        let moved = self.values_of(nominal, envelope);
        let slacks = moved.iter().filter_map(|own| {
            let far = own.value.clone().min(own.max_distance.clone());
            far.checked_div(&own.scale)
        });
        slacks.min()
    }

    pub(crate) fn count(&self) -> usize {
        self.ends.len()
    }

    /// Returns the box for these values of the variables.
    pub(crate) fn envelope(
        &self,
        plan: &ParametrizedPlan,
        values: &[Rational],
    ) -> DecoupledEnvelope {
        let mut envelope = DecoupledEnvelope::point(&plan.nominal());
        for (ends, value) in self.ends.iter().zip(values) {
            for end in ends {
                let reach = end.reach(&envelope).map(|reach| reach + value);
                envelope = end.with_reach(&envelope, reach);
            }
        }
        envelope
    }

    /// Converts a row to `Σ factor · variable <= bound`.
    pub(crate) fn row(
        &self,
        plan: &ParametrizedPlan,
        row: &Row,
    ) -> (Vec<(usize, Rational)>, Rational) {
        let point = DecoupledEnvelope::point(&plan.nominal());
        let bound = &row.bound - &row.value(&point).unwrap_or_default();
        let mut factors = Vec::new();
        for (variable, ends) in self.ends.iter().enumerate() {
            let own = ends.iter().filter_map(|end| row.factors.get(*end));
            let factor: Rational = own.sum();
            if !factor.is_zero() {
                factors.push((variable, factor));
            }
        }
        (factors, bound)
    }
}

/// Searches for the best box by these settings.
///
/// `on_step` is called at every box checked, and can end the search at any moment. The result is
/// then the best box found so far, and `bound` limits how much better another could be. `start` is
/// a box inside the envelope to begin with, if one is known.
///
/// # Errors
/// If nothing can be decided about the nominal values.
pub fn best(
    oracle: &mut Oracle,
    settings: &BestSettings,
    start: Option<&DecoupledEnvelope>,
    on_step: &mut dyn FnMut(&BestStep<'_>) -> ControlFlow<()>,
) -> Result<BestRun, Refusal> {
    let plan = Arc::clone(oracle.plan());
    let already = oracle.checks();
    let nominal = DecoupledEnvelope::point(&plan.nominal());
    if let Some(objection) = oracle.objection(&nominal)? {
        return Ok(BestRun {
            envelope: Err(objection),
            value: Rational::ZERO,
            bound: Rational::ZERO,
            is_proved: true,
            checks: oracle.checks() - already,
            is_cancelled: false,
            proof: BestProof::default(),
        });
    }
    let variables = Variables::new(&plan, settings);
    let mut run = match settings.objective {
        Objective::LeastSlack => leximin::maximize_leximin(oracle, &plan, &variables, on_step)?,
        Objective::Widths => {
            let goal = ObjectiveFunction::widths(&plan, &variables);
            branch::branch(oracle, &plan, &variables, goal, start, on_step)?
        }
        Objective::Volume => {
            let goal = ObjectiveFunction::Volume(Volume::new(&plan, &variables));
            branch::branch(oracle, &plan, &variables, goal, start, on_step)?
        }
        Objective::Probability => {
            let probability = Probability::new(&plan, &variables, settings);
            let goal = ObjectiveFunction::Probability(probability);
            branch::branch(oracle, &plan, &variables, goal, start, on_step)?
        }
    };
    if run.is_cancelled && settings.objective == Objective::LeastSlack && !settings.symmetric {
        // A search that ends early may be worse than the start.
        if let (Some(start), Ok(envelope)) = (start, &mut run.envelope)
            && let Some(slack) = variables.least_slack(&nominal, start)
            && slack >= run.value
        {
            envelope.clone_from(start);
            run.bound = run.bound.max(slack.clone());
            run.value = slack;
        }
    }
    if let Ok(envelope) = &mut run.envelope {
        run.proof.variables = variables.values_of(&nominal, envelope);
        *envelope = extend_to_infinity(oracle, &plan, envelope, &variables)?;
    }
    run.checks = oracle.checks() - already;
    Ok(run)
}

/// Makes the ends at the greatest deviation infinite, if nothing stops them.
fn extend_to_infinity(
    oracle: &mut Oracle,
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
    variables: &Variables,
) -> Result<DecoupledEnvelope, Refusal> {
    let point = DecoupledEnvelope::point(&plan.nominal());
    let mut is_started = false;
    for (ends, most) in variables.ends.iter().zip(&variables.max_distances) {
        let is_far = ends.iter().all(|end| {
            let moved = end.reach(envelope).zip(end.reach(&point));
            let range = &plan.parameter(end.parameter).range;
            end.side.reach(range).is_none() && moved.is_some_and(|(far, near)| far - near >= *most)
        });
        if !is_far {
            continue;
        }
        if !is_started {
            is_started = true;
            if oracle.start(envelope)?.is_some() {
                return Ok(envelope.clone());
            }
        }
        if let [end] = ends[..] {
            // An undecided end stays where it is.
            let _ = oracle.try_reach(end, None);
        }
    }
    Ok(match (is_started, oracle.accepted()) {
        (true, Some(accepted)) => accepted.clone(),
        _ => envelope.clone(),
    })
}
