//! The plan's network with rigidly connected nodes merged, and weights that depend on a box.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_num::{CommonDenominator, Delta, Rational};
use elbowroom_stn::{
    ConsistentNetwork, Constraint, ConstraintId, Network, NodeId as ClassId, Schedule as Times,
    Weight,
};

use crate::obligations::{BadCase, Substitution};
use elbowroom_plan::{
    Bound, BoxEnd, DecoupledEnvelope, NodeId, Origin, ParameterId, ParametrizedPlan, Schedule, Side,
};

/// `t_to - t_from <= constant + reach(end)`, over classes.
#[derive(Clone, Debug)]
pub struct Edge {
    /// The class subtracted.
    pub from: ClassId,
    /// The class it is subtracted from.
    pub to: ClassId,
    /// The part of the bound that does not depend on the box.
    pub constant: Rational,
    /// The end whose reach is added.
    pub end: Option<BoxEnd>,
    /// The bound of the plan that it comes from.
    pub origin: Origin,
    /// The node at which that bound begins.
    pub node: NodeId,
}

/// The plan's network over classes of rigidly connected nodes.
///
/// Two nodes are in one class if constraints without parameters fix their difference. Plans contain
/// many such pairs (fixed durations, timed initials), and the remaining network is often tiny.
#[derive(Clone, Debug)]
pub struct Reduction {
    /// For each node its class, and its offset from the time of the class.
    places: Vec<(ClassId, Rational)>,
    class_count: usize,
    edges: Arc<Vec<Edge>>,
    /// Parameters that are differences of times, defined by a constraint `[p, p]`.
    pub substitution: Substitution,
    /// Parameters that bound more than the one difference they are.
    pub coupled: Vec<ParameterId>,
    /// Parameters in constraints.
    mentioned: BTreeSet<ParameterId>,
}

/// Network of a box, with the edge that each of its constraints comes from.
pub struct BoxNetwork {
    /// The network over classes.
    pub network: Network<Delta>,
    /// For each constraint of the network, a position in [`Reduction::edges`].
    pub edges: Vec<usize>,
}

impl Reduction {
    /// Computes the reduced network of a plan.
    pub fn new(plan: &ParametrizedPlan) -> Self {
        let places = classes(plan);
        let class_count = 1 + places
            .iter()
            .map(|(class, _)| class.index())
            .max()
            .unwrap_or(0);
        let mut reduction = Self {
            places,
            class_count,
            edges: Arc::default(),
            substitution: Substitution::new(),
            coupled: Vec::new(),
            mentioned: BTreeSet::new(),
        };
        for (node, _) in plan.plan.nodes().skip(1) {
            let ends = (node, NodeId::ZERO);
            reduction.add_edge(ends, Rational::ZERO, None, Origin::Beginning);
        }
        for (index, constraint) in plan.plan.constraints.iter().enumerate() {
            let (most, least) = (Origin::AtMost(index), Origin::AtLeast(index));
            let (from, to) = (constraint.from, constraint.to);
            reduction.note_parameters(plan, from, to, &constraint.lower, &constraint.upper);
            match &constraint.upper {
                Bound::Infinite => {}
                Bound::Finite(upper) => {
                    reduction.add_edge((from, to), upper.clone(), None, most);
                }
                Bound::Parameter(parameter) => {
                    let end = BoxEnd {
                        parameter: *parameter,
                        side: Side::Upper,
                    };
                    reduction.add_edge((from, to), Rational::ZERO, Some(end), most);
                }
            }
            match &constraint.lower {
                Bound::Infinite => {}
                Bound::Finite(lower) => reduction.add_edge((to, from), -lower, None, least),
                Bound::Parameter(parameter) => {
                    let end = BoxEnd {
                        parameter: *parameter,
                        side: Side::Lower,
                    };
                    reduction.add_edge((to, from), Rational::ZERO, Some(end), least);
                }
            }
        }
        reduction.coupled.sort_unstable();
        reduction.coupled.dedup();
        reduction.keep_tightest();
        reduction.drop_implied(plan);
        Arc::make_mut(&mut reduction.edges).shrink_to_fit();
        reduction
    }

    /// Drops constraints that the others imply for all values of the parameters in their ranges.
    ///
    /// This saves work, and reveals the constraints that a parameter really affects: a constraint
    /// "the end comes after time 0" would put the duration before it on a cycle of constraints.
    fn drop_implied(&mut self, plan: &ParametrizedPlan) {
        let ranges = DecoupledEnvelope::ranges(plan);
        let BoxNetwork { network, edges } = self.network(&ranges);
        let nominal = DecoupledEnvelope::point(&plan.nominal());
        let nominal = self.network(&nominal).network;
        let has_parameter = |id: ConstraintId| self.edges[edges[id.index()]].end.is_some();
        // Whole numbers are several times faster, and small enough that sums of paths do not
        // overflow.
        let implied = match scaled([&network, &nominal]) {
            Some([network, nominal]) => implied(network, nominal, has_parameter),
            None => implied(network, nominal, has_parameter),
        };
        let implied: Vec<usize> = implied.into_iter().map(|id| edges[id.index()]).collect();
        let mut index = 0;
        Arc::make_mut(&mut self.edges).retain(|_| {
            index += 1;
            implied.binary_search(&(index - 1)).is_err()
        });
    }

    /// Records the parameters of a constraint.
    fn note_parameters(
        &mut self,
        plan: &ParametrizedPlan,
        from: NodeId,
        to: NodeId,
        lower: &Bound,
        upper: &Bound,
    ) {
        let mut parameters = Vec::new();
        parameters.extend(lower.parameter());
        parameters.extend(upper.parameter());
        let equal = lower == upper && parameters.len() == 2;
        parameters.dedup();
        for parameter in parameters {
            debug_assert!(parameter.index() < plan.parameters.len());
            if !self.mentioned.insert(parameter) {
                self.coupled.push(parameter);
            } else if equal {
                self.substitution.insert(parameter, (from, to));
            }
        }
    }

    /// Returns `true` if the parameter bounds a difference of times.
    pub fn is_in_network(&self, parameter: ParameterId) -> bool {
        self.mentioned.contains(&parameter)
    }

    /// Returns a parameter in a product that the corners of a box do not decide.
    ///
    /// Products are exact only for one inequality at a time, only if the multiplied parameter does
    /// not also move the times, and only if it is not multiplied by itself: a square is least
    /// between the ends of an interval, unless its coefficient is negative.
    pub(crate) fn undecided_at_corners(&self, case: &BadCase) -> Option<ParameterId> {
        let is_joint = case.inequalities.len() > 1;
        let expressions = case.inequalities.iter().map(|i| &i.expression);
        expressions
            .flat_map(|expression| {
                let squared = expression.squared_parameter();
                let multiplied = expression
                    .multiplied_parameters()
                    .filter(|&id| is_joint || self.is_in_network(id));
                squared.into_iter().chain(multiplied)
            })
            .next()
    }

    /// Adds `to - from <= constant + reach(end)`.
    fn add_edge(
        &mut self,
        (from, to): (NodeId, NodeId),
        constant: Rational,
        end: Option<BoxEnd>,
        origin: Origin,
    ) {
        let node = from;
        let (from_class, from_offset) = &self.places[from.index()];
        let (to_class, to_offset) = &self.places[to.index()];
        let constant = constant + from_offset - to_offset;
        let is_idle = from_class == to_class && end.is_none() && !constant.is_negative();
        if !is_idle {
            Arc::make_mut(&mut self.edges).push(Edge {
                from: *from_class,
                to: *to_class,
                constant,
                end,
                origin,
                node,
            });
        }
    }

    /// Keeps only the tightest of parallel edges that depend on the same end.
    fn keep_tightest(&mut self) {
        let edges = Arc::make_mut(&mut self.edges);
        edges.sort_by(|a, b| {
            let place = |edge: &Edge| (edge.from, edge.to, edge.end);
            place(a)
                .cmp(&place(b))
                .then_with(|| a.constant.cmp(&b.constant))
        });
        edges.dedup_by(|b, a| (a.from, a.to, a.end) == (b.from, b.to, b.end));
    }

    /// Returns the node's class, and the node's offset from it. The node after the plan's last is
    /// the moment of an over-all condition; it has its own class, the last.
    pub fn class_of(&self, node: NodeId) -> (ClassId, Rational) {
        match self.places.get(node.index()) {
            Some((class, offset)) => (*class, offset.clone()),
            None => (self.moment_class(), Rational::ZERO),
        }
    }

    /// Returns the offsets of nodes from their classes.
    pub(crate) fn offsets(&self) -> impl Iterator<Item = &Rational> {
        self.places.iter().map(|(_, offset)| offset)
    }

    /// Returns the class of the moment at which an over-all condition is read.
    pub fn moment_class(&self) -> ClassId {
        ClassId(u32::try_from(self.class_count).expect("fewer classes than nodes"))
    }

    /// Returns the constraints.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Returns a shared reference to the constraints.
    pub(crate) fn shared_edges(&self) -> Arc<Vec<Edge>> {
        Arc::clone(&self.edges)
    }

    /// Returns the number of classes.
    pub fn class_count(&self) -> usize {
        self.class_count
    }

    /// Returns the number of nodes of the plan.
    pub fn node_count(&self) -> usize {
        self.places.len()
    }

    /// Returns the network for a box, with every parameter at the worst end of its interval,
    /// separately for each edge.
    pub fn network(&self, envelope: &DecoupledEnvelope) -> BoxNetwork {
        let mut network = Network::with_nodes(self.class_count);
        let mut edges = Vec::with_capacity(self.edges.len());
        for (index, edge) in self.edges.iter().enumerate() {
            let Some(bound) = edge.bound(envelope) else {
                continue;
            };
            network.add(Constraint {
                from: edge.from,
                to: edge.to,
                bound: Delta::from(bound),
            });
            edges.push(index);
        }
        BoxNetwork { network, edges }
    }

    /// Converts the times of all nodes to those of the classes.
    pub(crate) fn class_times(&self, schedule: &Schedule) -> Vec<Rational> {
        let mut times = vec![Rational::ZERO; self.class_count];
        for ((class, offset), time) in self.places.iter().zip(schedule.iter()) {
            times[class.index()] = time - offset;
        }
        times
    }

    /// Converts the times of the classes to those of all nodes; class 0 contains time zero.
    pub fn times(&self, class_times: &[Rational]) -> Schedule {
        self.places
            .iter()
            .map(|(class, offset)| &class_times[class.index()] - &class_times[0] + offset)
            .collect()
    }
}

impl Edge {
    /// Returns the bound in a box; `None` if there is none.
    pub fn bound(&self, envelope: &DecoupledEnvelope) -> Option<Rational> {
        match self.end {
            None => Some(self.constant.clone()),
            Some(end) => end.reach(envelope).map(|reach| &self.constant + reach),
        }
    }
}

/// Returns the constraints that others imply; none if the network is inconsistent (the check of the
/// nominal values will then fail anyway).
///
/// The search uses the nominal schedule of the plan. In a schedule of the whole network many nodes
/// may coincide, so that each search would visit all of it.
fn implied<W: Weight>(
    network: Network<W>,
    nominal: Network<W>,
    keep: impl Fn(ConstraintId) -> bool,
) -> Vec<ConstraintId> {
    let Ok(network) = ConsistentNetwork::try_from(network) else {
        return Vec::new();
    };
    let nominal = ConsistentNetwork::try_from(nominal).ok();
    let schedule = nominal.map(|nominal| nominal.earliest_schedule(ClassId(0)));
    let Some(schedule) = schedule.filter(|schedule| schedule.holds_in(network.network())) else {
        return network.implied(keep);
    };
    // Searches among nodes that are close in time are fast, but searches along constraints back to
    // the beginning are not. So those constraints are handled first.
    let late = implied_by_earlier(network.network(), &schedule, &keep);
    let mut left = Network::with_nodes(network.network().node_count());
    let mut ids = Vec::new();
    for (id, constraint) in network
        .network()
        .constraint_ids()
        .zip(network.network().constraints())
    {
        if !late[id.index()] {
            left.add(constraint.clone());
            ids.push(id);
        }
    }
    let is_late = network
        .network()
        .constraint_ids()
        .filter(|id| late[id.index()]);
    let mut implied: Vec<ConstraintId> = is_late.collect();
    if let Ok(left) = ConsistentNetwork::try_from(left) {
        let more = left.implied_seen_from(&schedule, |id| keep(ids[id.index()]));
        implied.extend(more.into_iter().map(|id| ids[id.index()]));
    }
    implied.sort_unstable();
    implied
}

/// Returns, for each constraint, `true` if it is a lower bound on the time from the first node to
/// another one, and follows from such a bound of a node that is no later in the schedule.
///
/// All of them can be removed. If they implied each other in a cycle, all nodes of the cycle would
/// be at one time, the bounds between them would add up to 0, and so each would be 0. Nodes on such
/// cycles are skipped.
fn implied_by_earlier<W: Weight>(
    network: &Network<W>,
    schedule: &Times<W>,
    keep: &impl Fn(ConstraintId) -> bool,
) -> Vec<bool> {
    let zero = ClassId(0);
    let least = |known: &mut Option<W>, bound: W| {
        if known.as_ref().is_none_or(|known| bound < *known) {
            *known = Some(bound);
        }
    };
    let mut own: Vec<Option<W>> = vec![None; network.node_count()];
    for constraint in network.constraints().iter().filter(|own| own.to == zero) {
        least(&mut own[constraint.from.index()], constraint.bound.clone());
    }
    let mut tight = Network::with_nodes(network.node_count());
    for constraint in network.constraints() {
        if constraint.slack_in(schedule) == W::zero() {
            tight.add(constraint.clone());
        }
    }
    let circle = tight.components();
    let mut by_earlier: Vec<Option<W>> = vec![None; network.node_count()];
    for constraint in network.constraints() {
        let (from, to) = (constraint.from, constraint.to);
        if to != zero
            && schedule[to] <= schedule[from]
            && circle[to.index()] != circle[from.index()]
            && let Some(further) = &own[to.index()]
        {
            let bound = constraint.bound.plus(further);
            least(&mut by_earlier[from.index()], bound);
        }
    }
    let constraints = network.constraint_ids().zip(network.constraints());
    constraints
        .map(|(id, constraint)| {
            let by_earlier = &by_earlier[constraint.from.index()];
            constraint.to == zero
                && !keep(id)
                && by_earlier
                    .as_ref()
                    .is_some_and(|bound| *bound <= constraint.bound)
        })
        .collect()
}

/// Returns the networks with all bounds multiplied by their common denominator, if no sum of the
/// results overflows.
fn scaled(networks: [&Network<Delta>; 2]) -> Option<[Network<i128>; 2]> {
    let bounds = networks.into_iter().flat_map(Network::constraints);
    let unit = CommonDenominator::of(bounds.map(|constraint| &constraint.bound.real))?;
    let whole = |network: &Network<Delta>| {
        let mut whole = Network::with_nodes(network.node_count());
        for constraint in network.constraints() {
            whole.add(Constraint {
                from: constraint.from,
                to: constraint.to,
                bound: i128::from(unit.to_integer(&constraint.bound.real)?),
            });
        }
        Some(whole)
    };
    let [one, other] = networks.map(whole);
    Some([one?, other?])
}

/// Returns each node's class and offset: a union-find over constraints of the form `[c, c]`.
fn classes(plan: &ParametrizedPlan) -> Vec<(ClassId, Rational)> {
    // The parent of `n`, and the offset of `n` from it.
    let mut parents: Vec<(usize, Rational)> = (0..plan.plan.nodes.len())
        .map(|node| (node, Rational::ZERO))
        .collect();
    for constraint in &plan.plan.constraints {
        let (Bound::Finite(lower), Bound::Finite(upper)) = (&constraint.lower, &constraint.upper)
        else {
            continue;
        };
        if lower != upper {
            continue;
        }
        let (from_root, from_offset) = root(&parents, constraint.from.index());
        let (to_root, to_offset) = root(&parents, constraint.to.index());
        // The smaller index stays the root, so that zero is the root of its class.
        if from_root < to_root {
            parents[to_root] = (from_root, from_offset + lower - to_offset);
        } else if to_root < from_root {
            parents[from_root] = (to_root, to_offset - lower - from_offset);
        }
    }
    let mut numbers = BTreeMap::new();
    (0..parents.len())
        .map(|node| {
            let (root, offset) = root(&parents, node);
            let next = numbers.len();
            let class = *numbers.entry(root).or_insert(next);
            (
                ClassId(u32::try_from(class).expect("fewer classes than nodes")),
                offset,
            )
        })
        .collect()
}

/// Returns the node's root, and the node's offset from it.
fn root(parents: &[(usize, Rational)], node: usize) -> (usize, Rational) {
    let (mut at, mut offset) = (node, Rational::ZERO);
    while parents[at].0 != at {
        offset += &parents[at].1;
        at = parents[at].0;
    }
    (at, offset)
}
