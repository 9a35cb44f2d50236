//! Feasibility of a bad case in a box.

use std::collections::BTreeMap;

use elbowroom_num::{Delta, Rational};
use elbowroom_stn::{
    Checkpoint, ConsistentNetwork, Constraint, NegativeCycle, Network, NodeId as ClassId, Schedule,
    Weight,
};

use super::Counterexample;
use super::certificate::{Certificate, Term};
use super::corner::corners;
use super::flow::{self, Demand};
use super::linear_program;
use super::scale::{ExactScale, Scale};
use crate::linear::Linear;
use crate::obligations::{BadCase, Difference, Inequality};
use crate::reduction::Reduction;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, NodeId, ParameterId, Side, Valuation};

/// Schedules of a box: a network that can be tightened temporarily.
pub(crate) struct Schedules<'a, S: Scale> {
    pub(crate) reduction: &'a Reduction,
    pub(crate) envelope: &'a DecoupledEnvelope,
    network: ConsistentNetwork<S::Weight>,
    scale: S,
    /// Schedule that the next check starts from, as differences to the current one. It is the
    /// maximum of the last check that a flow decided, because the checks of a plan resemble each
    /// other.
    next: Vec<(ClassId, S::Weight)>,
    /// Schedule with long durations, if there is one; dropped at the first check of inequalities.
    longest: Option<Schedule<S::Weight>>,
    workspace: flow::Workspace<S::Weight>,
    /// For the first constraints of the network, a position in [`Reduction::edges`].
    edges: Vec<usize>,
    /// The constraints after these: the assumptions.
    assumed: Vec<Constraint<Delta>>,
    /// `true` if proofs list the constraints that they add up.
    explains: bool,
}

/// State to return to.
pub(crate) struct SavedState {
    checkpoint: Checkpoint,
    assumed: usize,
}

/// The result of a feasibility check of a bad case.
pub(crate) enum Outcome {
    /// Impossible; one proof for each combination of values of multiplied parameters.
    Impossible(Vec<Certificate>),
    /// Possible.
    Possible,
    /// Unknown: a parameter multiplies something in several inequalities, or also moves the times,
    /// so the corners of the box do not decide.
    Unknown(ParameterId),
}

impl<'a, S: Scale> Schedules<'a, S> {
    /// Creates the network of all schedules for values in the box; `None` if there are none.
    pub(crate) fn new(
        reduction: &'a Reduction,
        envelope: &'a DecoupledEnvelope,
        scale: S,
    ) -> Option<Self> {
        let parameters = (0..envelope.intervals().len()).map(ParameterId::from);
        let reaches: Vec<[Option<S::Weight>; 2]> = parameters
            .map(|parameter| {
                Side::BOTH.map(|side| {
                    let reach = BoxEnd { parameter, side }.reach(envelope)?;
                    Some(scale.weight(&Delta::from(reach)))
                })
            })
            .collect();
        let mut network = Network::with_nodes(reduction.class_count());
        let mut longest = network.clone();
        let mut edges = Vec::with_capacity(reduction.edges().len());
        for (index, edge) in reduction.edges().iter().enumerate() {
            let constant = scale.weight(&Delta::from(edge.constant.clone()));
            let bound = match edge.end {
                None => constant.clone(),
                Some(end) => match &reaches[end.parameter.index()][end.side.index()] {
                    Some(reach) => constant.plus(reach),
                    None => continue,
                },
            };
            let most = edge.end.filter(|end| end.side == Side::Lower);
            let most = most.and_then(|end| reaches[end.parameter.index()][1].as_ref());
            longest.add(Constraint {
                from: edge.from,
                to: edge.to,
                bound: most.map_or(bound.clone(), |most| constant.minus(most)),
            });
            network.add(Constraint {
                from: edge.from,
                to: edge.to,
                bound,
            });
            edges.push(index);
        }
        let mut network = ConsistentNetwork::try_from(network).ok()?;
        network.record_times();
        let longest = longest.consistency().ok();
        let longest = longest.filter(|schedule| schedule.holds_in(network.network()));
        Some(Self {
            reduction,
            envelope,
            network,
            scale,
            next: Vec::new(),
            longest,
            workspace: flow::Workspace::default(),
            edges,
            assumed: Vec::new(),
            explains: false,
        })
    }

    /// Makes proofs list the constraints that they add up, from now on.
    pub(crate) fn enable_explanations(&mut self) {
        self.explains = true;
    }

    /// Adds a difference to the network.
    ///
    /// # Errors
    /// The proof that this leaves no schedule; the network does not change.
    pub(crate) fn assume(&mut self, difference: &Difference) -> Result<(), Certificate> {
        let constraint = constraint(self.reduction, difference);
        let weighted = Constraint {
            from: constraint.from,
            to: constraint.to,
            bound: self.scale.weight(&constraint.bound),
        };
        match self.network.add(weighted) {
            Ok(_) => {
                self.assumed.push(constraint);
                Ok(())
            }
            Err(cycle) => Err(self.certificate(&cycle, &constraint.bound)),
        }
    }

    /// Returns the current state, for [`undo_to`](Self::undo_to).
    pub(crate) fn save(&self) -> SavedState {
        SavedState {
            checkpoint: self.network.checkpoint(),
            assumed: self.assumed.len(),
        }
    }

    /// Undoes all assumptions made since.
    pub(crate) fn undo_to(&mut self, before: &SavedState) {
        self.assumed.truncate(before.assumed);
        self.network.restore(before.checkpoint);
        if before.assumed == 0 && !self.next.is_empty() {
            self.network.reschedule(self.next.drain(..));
            self.network.record_times();
        }
    }

    /// Adds a time point: the moment of an over-all condition, which ends with this node.
    pub(crate) fn add_moment(&mut self, end: NodeId) {
        let (class, offset) = self.reduction.class_of(end);
        let offset = self.scale.weight(&Delta::from(offset));
        let time = self.network.schedule()[class].plus(&offset);
        self.network.add_node_at(time);
    }

    /// Returns the proof given by a negative cycle; its first constraint, with bound `added`, was
    /// rejected.
    fn certificate(&self, cycle: &NegativeCycle<S::Weight>, added: &Delta) -> Certificate {
        let mut certificate = Certificate::default();
        for id in &cycle.constraints {
            let assumed = id.index().checked_sub(self.edges.len());
            if self.explains {
                let edge = || Term::Edge(self.edges[id.index()]);
                let term = assumed.map_or_else(edge, Term::Assumed);
                certificate.terms.push((term, Rational::ONE));
            }
            match assumed.map(|index| self.assumed.get(index)) {
                None => {
                    let edge = self.edges[id.index()];
                    certificate.add_edge(&self.reduction.edges()[edge], &Rational::ONE);
                }
                Some(Some(constraint)) => {
                    certificate.add_constant(&constraint.bound, &Rational::ONE);
                }
                Some(None) => certificate.add_constant(added, &Rational::ONE),
            }
        }
        certificate.complete()
    }

    /// Decides whether all constraints of the case can hold at once.
    pub(crate) fn possible(&mut self, case: &BadCase) -> Outcome {
        let before = self.save();
        let mut refuted = None;
        for difference in &case.differences {
            if let Err(certificate) = self.assume(difference) {
                refuted = Some(Outcome::Impossible(vec![certificate]));
                break;
            }
        }
        let outcome = refuted.unwrap_or_else(|| self.inequalities_possible(case));
        self.undo_to(&before);
        outcome
    }

    /// Sets the schedule that the next check starts from: the present one with these changes. Its
    /// times are relative to the beginning of the plan. It is ignored if its times are so large
    /// that sums might overflow.
    fn start_from(&mut self, moved: Vec<(ClassId, S::Weight)>) {
        let present = self.network.schedule();
        let mut times: BTreeMap<ClassId, S::Weight> = self
            .network
            .moved()
            .map(|class| (class, present[class].clone()))
            .collect();
        times.extend(moved);
        // The nodes of assumptions come last.
        times.retain(|class, _| class.index() < self.reduction.class_count());
        let zero = times.get(&ClassId(0)).unwrap_or(&present[ClassId(0)]);
        if *zero != S::Weight::zero() {
            let zero = zero.clone();
            let classes = self.network.network().nodes();
            for class in classes.take(self.reduction.class_count()) {
                let time = times.entry(class).or_insert_with(|| present[class].clone());
                *time = time.minus(&zero);
            }
        }
        if times.values().all(|time| self.scale.is_moderate(time)) {
            self.next = Vec::from_iter(times);
        }
    }

    /// Decides whether the inequalities can hold in the current network, which includes the
    /// differences.
    pub(crate) fn inequalities_possible(&mut self, case: &BadCase) -> Outcome {
        if case.inequalities.is_empty() && self.reduction.coupled.is_empty() {
            return Outcome::Possible;
        }
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
        let corners = corners(self.envelope, &multiplied);
        if let (Some(parameter), true) =
            (self.reduction.undecided_at_corners(case), corners.len() > 1)
        {
            return self.each_possible(case, parameter);
        }
        // Usually one, and as many of these lists as conditions, so the capacity is exact.
        let mut certificates = Vec::with_capacity(corners.len());
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
                        .flat_map(|&parameter| Side::BOTH.map(|side| BoxEnd { parameter, side }))
                        .collect();
                    certificates.push(certificate);
                }
                None => return Outcome::Possible,
            }
        }
        Outcome::Impossible(certificates)
    }

    /// Checks each inequality on its own, for cases where the corners do not decide several
    /// inequalities at once.
    fn each_possible(&mut self, case: &BadCase, parameter: ParameterId) -> Outcome {
        if case.inequalities.len() > 1 {
            for (index, inequality) in case.inequalities.iter().enumerate() {
                let alone = BadCase {
                    differences: Vec::new(),
                    inequalities: vec![inequality.clone()],
                };
                if let Outcome::Impossible(mut proofs) = self.inequalities_possible(&alone) {
                    let terms = proofs.iter_mut().flat_map(|proof| &mut proof.terms);
                    for (term, _) in terms {
                        if matches!(term, Term::Inequality(_)) {
                            *term = Term::Inequality(index);
                        }
                    }
                    return Outcome::Impossible(proofs);
                }
            }
        }
        Outcome::Unknown(parameter)
    }

    /// Returns a proof that the inequalities, free of products, cannot all hold; `None` if they
    /// can.
    fn linear_possible(&mut self, inequalities: &[Inequality]) -> Option<Certificate> {
        // Each inequality alone, without coupled parameters, is a flow problem.
        for (index, inequality) in inequalities.iter().enumerate() {
            if let Some(mut certificate) = self.flow_certificate(inequality) {
                if self.explains {
                    let own = (Term::Inequality(index), Rational::ONE);
                    certificate.terms.push(own);
                }
                return Some(certificate);
            }
        }
        // A parameter that is a difference of times has been replaced by it; a parameter that only
        // bounds a difference occurs twice.
        let is_shared = inequalities
            .iter()
            .flat_map(|inequality| inequality.expression.parameters.keys())
            .any(|parameter| self.reduction.is_in_network(parameter));
        if inequalities.len() <= 1 && self.reduction.coupled.is_empty() && !is_shared {
            return None;
        }
        linear_program::refute(self.reduction, self.envelope, &self.assumed, inequalities)
    }

    /// Returns the proof that `expression <= 0` fails in all schedules, if it does.
    fn flow_certificate(&mut self, inequality: &Inequality) -> Option<Certificate> {
        // It can hold exactly if the greatest value of `-expression` is at least zero.
        let negated = inequality.expression.scaled(&Rational::from(-1));
        let (constant, demand) = self.by_class(&negated);
        let mut certificate = Certificate::default();
        certificate.add_constant(&Delta::from(constant), &Rational::ONE);
        if inequality.is_strict {
            certificate.add_constant(&Delta::just_below(Rational::ZERO), &Rational::ONE);
        }
        for &(parameter, ref coefficient) in &negated.parameters {
            let side = if coefficient.is_positive() {
                Side::Upper
            } else {
                Side::Lower
            };
            certificate.add_end(BoxEnd { parameter, side }, &coefficient.abs());
        }
        let longest = self.longest.take();
        let longest = longest.filter(|longest| self.is_greater_at(longest, &demand));
        let lasting = self.edges.len();
        let found = flow::cheapest(&self.network, lasting, demand, &mut self.workspace);
        if let Some(longest) = longest {
            let times = longest.into_times().into_iter();
            let classes = self.network.network().nodes();
            self.start_from(classes.zip(times).collect());
        } else if let Some((_, moved)) = &found {
            self.start_from(moved.clone());
        }
        let (flow, _) = found?;
        for (id, amount) in flow.iter().filter(|(_, amount)| amount.is_positive()) {
            let index = id.index();
            if self.explains {
                let edge = self.edges.get(index).copied().map(Term::Edge);
                let term = edge.unwrap_or_else(|| Term::Assumed(index - self.edges.len()));
                certificate.terms.push((term, amount.clone()));
            }
            if let Some(&edge) = self.edges.get(index) {
                certificate.add_edge(&self.reduction.edges()[edge], amount);
            } else {
                let assumed = &self.assumed[index - self.edges.len()];
                certificate.add_constant(&assumed.bound, amount);
            }
        }
        let certificate = certificate.complete();
        certificate
            .holds_in(self.envelope, None)
            .then_some(certificate)
    }

    /// Returns `true` if an expression is likely to be greater in this schedule than in the present
    /// one: its coefficients are replaced by their signs. Always `true` if the expression reads a
    /// moment inside an action.
    fn is_greater_at(&self, other: &Schedule<S::Weight>, demand: &Demand) -> bool {
        let present = self.network.schedule();
        let mut gain = S::Weight::zero();
        for (&class, amount) in demand {
            if class.index() >= self.reduction.class_count() {
                return true;
            }
            let later = other[class].minus(&present[class]);
            if amount.is_positive() {
                gain = gain.plus(&later);
            } else if amount.is_negative() {
                gain = gain.minus(&later);
            }
        }
        gain > S::Weight::zero()
    }

    /// Returns the expression's constant and its coefficients for classes; times are relative to
    /// class 0.
    fn by_class(&self, expression: &Linear) -> (Rational, Demand) {
        let mut demand = Demand::new();
        let constant = add_times(self.reduction, expression, |class: ClassId, coefficient| {
            *demand.entry(class).or_default() += coefficient;
        });
        demand.remove(&ClassId(0));
        let rest = -demand.values().sum::<Rational>();
        demand.insert(ClassId(0), rest);
        (constant, demand)
    }
}

/// Returns the constraint `to - from <= bound` over classes.
fn constraint(reduction: &Reduction, difference: &Difference) -> Constraint<Delta> {
    let (from, from_offset) = reduction.class_of(difference.from);
    let (to, to_offset) = reduction.class_of(difference.to);
    let bound = &difference.bound + &from_offset - &to_offset;
    let bound = if difference.is_strict {
        Delta::just_below(bound)
    } else {
        Delta::from(bound)
    };
    Constraint { from, to, bound }
}

/// Calls `add` with each class and its share of the expression's times. Returns the constant, which
/// includes the nodes' offsets.
pub(crate) fn add_times(
    reduction: &Reduction,
    expression: &Linear,
    mut add: impl FnMut(ClassId, &Rational),
) -> Rational {
    let mut constant = expression.constant.clone();
    for &(node, ref coefficient) in &expression.times {
        let (class, offset) = reduction.class_of(node);
        constant += coefficient * &offset;
        add(class, coefficient);
    }
    constant
}

/// Returns values and a schedule in the box for which the case holds. Among these, it chooses those
/// that minimise `least` or, without it, violate the case's only inequality most.
pub(crate) fn witness(
    reduction: &Reduction,
    envelope: &DecoupledEnvelope,
    case: &BadCase,
    least: Option<&Linear>,
) -> Option<Counterexample> {
    // Without any schedule there is no witness.
    Schedules::new(reduction, envelope, ExactScale)?;
    let assumed: Vec<_> = case
        .differences
        .iter()
        .map(|d| constraint(reduction, d))
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
    corners(envelope, &multiplied)
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
                valuation[parameter] = value.clone();
            }
            let moment = &class_times[reduction.class_count()] - &class_times[0];
            let schedule = reduction.times(&class_times);
            let with_moment = schedule.iter().chain([&moment]).cloned().collect();
            let comes_about = |valuation: &Valuation| {
                envelope.contains(valuation)
                    && case
                        .inequalities
                        .iter()
                        .all(|i| i.holds(&with_moment, valuation))
            };
            let valuation = corner.far_out(valuation, &comes_about)?;
            let reads_moment = case
                .differences
                .iter()
                .flat_map(|difference| [difference.from, difference.to])
                .any(|node| node.index() == reduction.node_count());
            Some(Counterexample {
                valuation,
                schedule,
                moment: reads_moment.then_some(moment),
            })
        })
}
