//! Deciding whether a bad case is possible in a box.

use std::collections::BTreeMap;

use elbowroom_num::{Delta, Rational};
use elbowroom_stn::{ConsistentNetwork, Constraint, NegativeCycle, NodeId as ClassId};

use super::Counterexample;
use super::certificate::Certificate;
use super::flow;
use super::linear_program;
use crate::decoupled::DecoupledEnvelope;
use crate::linear::{Factor, Linear};
use crate::obligations::{BadCase, Difference, Inequality};
use crate::parameter::{ParameterId, Valuation};
use crate::reduction::{BoxEnd, BoxNetwork, Reduction, Side};

/// The schedules of a box: a network that can be tightened for a while.
pub(crate) struct Schedules<'a> {
    pub(crate) reduction: &'a Reduction,
    pub(crate) envelope: &'a DecoupledEnvelope,
    pub(crate) network: ConsistentNetwork<Delta>,
    edges: Vec<usize>,
}

/// Whether a bad case is possible.
pub(crate) enum Outcome {
    /// No; one proof for each combination of values of multiplied parameters.
    Impossible(Vec<Certificate>),
    /// Yes.
    Possible,
    /// Nobody knows: a parameter multiplies something in several inequalities, or moves the times
    /// as well, so the corners of the box do not decide.
    Unknown(ParameterId),
}

impl<'a> Schedules<'a> {
    /// All schedules for values in the box, or `None` if there are none at all.
    pub(crate) fn new(reduction: &'a Reduction, envelope: &'a DecoupledEnvelope) -> Option<Self> {
        let BoxNetwork { network, edges } = reduction.network(envelope);
        let network = ConsistentNetwork::try_from(network).ok()?;
        Some(Self {
            reduction,
            envelope,
            network,
            edges,
        })
    }

    /// Tightens by a difference.
    ///
    /// # Errors
    /// The proof that this leaves no schedule; the network is as before.
    pub(crate) fn assume(&mut self, difference: &Difference) -> Result<(), Certificate> {
        let constraint = self.constraint(difference);
        let bound = constraint.bound.clone();
        self.network
            .add(constraint)
            .map(|_| ())
            .map_err(|cycle| self.certificate(&cycle, &bound))
    }

    /// `to - from <= bound` over classes.
    fn constraint(&self, difference: &Difference) -> Constraint<Delta> {
        let (from, from_offset) = self.reduction.place(difference.from);
        let (to, to_offset) = self.reduction.place(difference.to);
        let bound = &difference.bound + &from_offset - &to_offset;
        let bound = if difference.is_strict {
            Delta::just_below(bound)
        } else {
            Delta::from(bound)
        };
        Constraint { from, to, bound }
    }

    /// The proof a negative cycle is; its first constraint, with bound `added`, was refused.
    fn certificate(&self, cycle: &NegativeCycle<Delta>, added: &Delta) -> Certificate {
        let mut certificate = Certificate::default();
        let constraints = self.network.network().constraints();
        for id in &cycle.constraints {
            match (self.edges.get(id.index()), constraints.get(id.index())) {
                (Some(&edge), _) => {
                    certificate.add_edge(&self.reduction.edges()[edge], &Rational::ONE);
                }
                (None, Some(constraint)) => {
                    certificate.add_constant(&constraint.bound, &Rational::ONE);
                }
                (None, None) => certificate.add_constant(added, &Rational::ONE),
            }
        }
        certificate
    }

    /// Whether all of the case can be at once, on top of what is assumed.
    pub(crate) fn possible(&mut self, case: &BadCase) -> Outcome {
        let before = self.network.checkpoint();
        let mut refuted = None;
        for difference in &case.differences {
            if let Err(certificate) = self.assume(difference) {
                refuted = Some(Outcome::Impossible(vec![certificate]));
                break;
            }
        }
        let outcome = refuted.unwrap_or_else(|| self.inequalities_possible(case));
        self.network.undo_to(before);
        outcome
    }

    /// Whether the inequalities can hold in the network as it is now, differences included.
    pub(crate) fn inequalities_possible(&mut self, case: &BadCase) -> Outcome {
        if case.inequalities.is_empty() && self.reduction.coupled.is_empty() {
            return Outcome::Possible;
        }
        let mut certificates = Vec::new();
        let multiplied: Vec<ParameterId> = {
            let mut ids: Vec<_> = case
                .inequalities
                .iter()
                .flat_map(|inequality| inequality.expression.multiplied_parameters())
                .collect();
            ids.sort_unstable();
            ids.dedup();
            ids
        };
        let corners = self.corners(&multiplied);
        if let (Some(parameter), true) =
            (self.reduction.undecided_at_corners(case), corners.len() > 1)
        {
            return self.each_possible(case, parameter);
        }
        for corner in corners {
            let fixed: Vec<Inequality> = case
                .inequalities
                .iter()
                .map(|inequality| corner.apply(inequality))
                .collect();
            match self.linear_possible(&fixed) {
                Some(mut certificate) => {
                    certificate.fixed = multiplied
                        .iter()
                        .flat_map(|&parameter| {
                            [Side::Lower, Side::Upper].map(|side| BoxEnd { parameter, side })
                        })
                        .collect();
                    certificates.push(certificate);
                }
                None => return Outcome::Possible,
            }
        }
        Outcome::Impossible(certificates)
    }

    /// Where corners do not decide several inequalities at once, one of them may be impossible by
    /// itself.
    fn each_possible(&mut self, case: &BadCase, parameter: ParameterId) -> Outcome {
        if case.inequalities.len() > 1 {
            for inequality in &case.inequalities {
                let alone = BadCase {
                    differences: Vec::new(),
                    inequalities: vec![inequality.clone()],
                };
                let outcome = self.inequalities_possible(&alone);
                if matches!(outcome, Outcome::Impossible(_)) {
                    return outcome;
                }
            }
        }
        Outcome::Unknown(parameter)
    }

    /// A proof that the inequalities, free of products, cannot all hold; `None` if they can.
    fn linear_possible(&mut self, inequalities: &[Inequality]) -> Option<Certificate> {
        // Each inequality alone, without what couples parameters, is a problem of flows.
        for inequality in inequalities {
            if let Some(certificate) = self.flow_certificate(inequality) {
                return Some(certificate);
            }
        }
        // A parameter that is a difference of times has been replaced by it; one that only bounds a
        // difference occurs twice.
        let is_shared = inequalities
            .iter()
            .flat_map(|inequality| inequality.expression.parameters.keys())
            .any(|&parameter| self.reduction.is_in_network(parameter));
        if inequalities.len() <= 1 && self.reduction.coupled.is_empty() && !is_shared {
            return None;
        }
        let assumed = &self.network.network().constraints()[self.edges.len()..];
        linear_program::refute(self.reduction, self.envelope, assumed, inequalities)
    }

    /// The proof that `expression <= 0` fails in all schedules, if it does.
    fn flow_certificate(&self, inequality: &Inequality) -> Option<Certificate> {
        // It can hold exactly if the greatest value of `-expression` is at least zero.
        let negated = inequality.expression.scaled(&Rational::from(-1));
        let (constant, demand) = self.by_class(&negated);
        let mut certificate = Certificate::default();
        certificate.add_constant(&Delta::from(constant), &Rational::ONE);
        if inequality.is_strict {
            certificate.add_constant(&Delta::just_below(Rational::ZERO), &Rational::ONE);
        }
        for (&parameter, coefficient) in &negated.parameters {
            let side = if coefficient.is_positive() {
                Side::Upper
            } else {
                Side::Lower
            };
            certificate.add_end(BoxEnd { parameter, side }, &coefficient.abs());
        }
        let flow = flow::cheapest(&self.network, &demand)?;
        let constraints = self.network.network().constraints();
        for (index, amount) in flow
            .iter()
            .enumerate()
            .filter(|(_, amount)| amount.is_positive())
        {
            match self.edges.get(index) {
                Some(&edge) => certificate.add_edge(&self.reduction.edges()[edge], amount),
                None => certificate.add_constant(&constraints[index].bound, amount),
            }
        }
        certificate
            .holds_in(self.envelope, None)
            .then_some(certificate)
    }

    /// The expression's constant and its coefficient for each class; times count from class 0.
    fn by_class(&self, expression: &Linear) -> (Rational, Vec<Rational>) {
        let mut demand = vec![Rational::ZERO; self.network.network().node_count()];
        let constant = spread(self.reduction, expression, |class: ClassId, coefficient| {
            demand[class.index()] += coefficient;
        });
        demand[0] = Rational::ZERO;
        demand[0] = -demand.iter().sum::<Rational>();
        (constant, demand)
    }

    /// The combinations of ends of the parameters' intervals. Where an end is infinite, the
    /// combination says what becomes of an expression as the parameter grows without bound.
    fn corners(&self, parameters: &[ParameterId]) -> Vec<Corner> {
        let mut corners = vec![Corner::default()];
        for &parameter in parameters {
            let interval = self.envelope.interval(parameter);
            let zero = Rational::ZERO;
            let (lower, upper) = (interval.lower.value(), interval.upper.value());
            let mut ends = vec![lower.ok_or(false), upper.ok_or(true)];
            if lower.is_none() && upper.is_none() {
                // Where the factor vanishes, any value shows what is left.
                ends.push(Ok(&zero));
            }
            ends.dedup();
            corners = corners
                .iter()
                .flat_map(|corner| {
                    ends.iter().map(move |end| {
                        let mut corner = corner.clone();
                        match *end {
                            Ok(value) => {
                                corner.values.insert(parameter, value.clone());
                            }
                            Err(is_upper) => corner.infinite.push((parameter, is_upper)),
                        }
                        corner
                    })
                })
                .collect();
        }
        corners
    }
}

/// Values for multiplied parameters.
#[derive(Clone, Debug, Default, PartialEq)]
struct Corner {
    values: BTreeMap<ParameterId, Rational>,
    /// Parameters at an infinite end, and whether it is the upper one.
    infinite: Vec<(ParameterId, bool)>,
}

impl Corner {
    /// The inequality with these values put in.
    fn apply(&self, inequality: &Inequality) -> Inequality {
        let mut expression = inequality.expression.with_values(&self.values);
        let mut is_strict = inequality.is_strict;
        for &(parameter, is_upper) in &self.infinite {
            // As the parameter grows, its coefficient alone decides. The expression gets below
            // zero if the coefficient can be negative (for a parameter that goes down: positive).
            let coefficient = coefficient_of(&expression, parameter);
            if coefficient == Linear::default() {
                continue;
            }
            let sign = Rational::from(if is_upper { 1 } else { -1 });
            expression = coefficient.scaled(&sign);
            is_strict = true;
        }
        Inequality {
            expression,
            is_strict,
        }
    }
}

impl Corner {
    /// The valuation with the parameters at infinite ends so far out that it will do.
    ///
    /// As in [`apply`](Self::apply), the first of them outgrows the second, and so on.
    fn far_out(
        &self,
        mut valuation: Valuation,
        will_do: &dyn Fn(&Valuation) -> bool,
    ) -> Option<Valuation> {
        let mut step = Rational::ONE;
        for _ in 0..MOST_DOUBLINGS {
            let mut reach = step.clone();
            for &(parameter, is_upper) in self.infinite.iter().rev() {
                valuation[parameter.index()] = if is_upper { reach.clone() } else { -&reach };
                reach *= &step;
            }
            if will_do(&valuation) {
                return Some(valuation);
            }
            step = &step + &step;
        }
        None
    }
}

/// How often values are doubled to show what becomes of an expression as they grow.
const MOST_DOUBLINGS: usize = 256;

/// The factor of a parameter in an expression.
fn coefficient_of(expression: &Linear, parameter: ParameterId) -> Linear {
    let mut coefficient = Linear::default();
    if let Some(constant) = expression.parameters.get(&parameter) {
        coefficient.constant = constant.clone();
    }
    for (&(first, factor), amount) in &expression.products {
        match factor {
            Factor::Time(node) if first == parameter => coefficient.add_time(node, amount),
            Factor::Parameter(second) if first == parameter => {
                coefficient.add_scaled(&Linear::parameter(second), amount);
            }
            Factor::Parameter(second) if second == parameter => {
                coefficient.add_scaled(&Linear::parameter(first), amount);
            }
            Factor::Time(_) | Factor::Parameter(_) => {}
        }
    }
    coefficient
}

/// Calls `add` with each class and its share of the expression's times, and returns the constant
/// with the nodes' offsets in it.
pub(crate) fn spread(
    reduction: &Reduction,
    expression: &Linear,
    mut add: impl FnMut(ClassId, &Rational),
) -> Rational {
    let mut constant = expression.constant.clone();
    for (&node, coefficient) in &expression.times {
        let (class, offset) = reduction.place(node);
        constant += coefficient * &offset;
        add(class, coefficient);
    }
    constant
}

/// Values and a schedule in the box for which the case comes about. Among these, the ones that
/// make `least` smallest, or, failing that, break the case's only inequality by most.
pub(crate) fn witness(
    reduction: &Reduction,
    envelope: &DecoupledEnvelope,
    case: &BadCase,
    least: Option<&Linear>,
) -> Option<Counterexample> {
    let schedules = Schedules::new(reduction, envelope)?;
    let assumed: Vec<_> = case
        .differences
        .iter()
        .map(|d| schedules.constraint(d))
        .collect();
    let multiplied: Vec<ParameterId> = case
        .inequalities
        .iter()
        .flat_map(|i| i.expression.multiplied_parameters())
        .collect();
    let least = |fixed: &'_ [Inequality]| match (least, fixed) {
        (Some(least), _) => Some(least.clone()),
        (None, [inequality]) => Some(inequality.expression.clone()),
        (None, _) => None,
    };
    schedules
        .corners(&multiplied)
        .into_iter()
        .find_map(|corner| {
            let fixed: Vec<Inequality> =
                case.inequalities.iter().map(|i| corner.apply(i)).collect();
            let (class_times, mut valuation) = linear_program::witness(
                reduction,
                envelope,
                &assumed,
                &fixed,
                least(&fixed).as_ref(),
            )?;
            for (&parameter, value) in &corner.values {
                valuation[parameter.index()] = value.clone();
            }
            let moment = &class_times[reduction.class_count()] - &class_times[0];
            let mut times = reduction.times(&class_times);
            times.push(moment.clone());
            let comes_about = |valuation: &Valuation| {
                envelope.contains(valuation)
                    && case.inequalities.iter().all(|i| i.holds(&times, valuation))
            };
            let valuation = corner.far_out(valuation, &comes_about)?;
            times.pop();
            let reads_moment = case
                .differences
                .iter()
                .flat_map(|difference| [difference.from, difference.to])
                .any(|node| node.index() == reduction.node_count());
            Some(Counterexample {
                valuation,
                schedule: times,
                moment: reads_moment.then_some(moment),
            })
        })
}
