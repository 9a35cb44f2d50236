//! Sufficient condition for dynamic controllability, in linear time: [`EarliestStrategy`].

use super::{LinkId, UncertainNetwork};
use crate::{NodeId, Weight};

/// The strategy that executes each node as soon as its lower bounds allow, for networks in which
/// it meets all upper bounds.
///
/// It applies if each requirement is a deadline (an upper bound on a time relative to node 0, which
/// is executed at 0), a lower bound on the distance from an earlier node, or implied by a
/// contingent link. Every time then increases with the durations, so the deadlines are met in all
/// cases if they are met when each link takes longest. Critical paths give the greatest duration of
/// each link.
///
/// Without such a strategy, nothing is decided.
#[derive(Clone, Debug)]
pub struct EarliestStrategy<W> {
    /// By link: the bounds that it may have while the others stay.
    limits: Vec<LinkLimits<W>>,
}

/// The bounds that a link may have.
#[derive(Clone, Debug)]
struct LinkLimits<W> {
    least: W,
    /// `None` without limit.
    most: Option<W>,
}

/// A lower bound: the target is executed at least this much after the source.
struct LowerBound<W> {
    source: NodeId,
    target: NodeId,
    /// `None` is infinite.
    distance: Option<W>,
}

impl<W: Weight> EarliestStrategy<W> {
    /// Returns the strategy if it applies and meets all bounds.
    pub fn new(network: &UncertainNetwork<W>) -> Option<Self> {
        let origin = NodeId(0);
        let requirements = network.requirements();
        let count = requirements.node_count();
        let mut limits: Vec<LinkLimits<W>> = Vec::with_capacity(network.links().len());
        let mut bounds = Vec::with_capacity(requirements.constraints().len() + limits.len());
        for link in network.links() {
            limits.push(LinkLimits {
                least: W::zero(),
                most: None,
            });
            bounds.push(LowerBound {
                source: link.activation,
                target: link.end,
                distance: link.upper.clone(),
            });
        }
        let fixed = fixed_times(network);
        let mut deadlines: Vec<Option<W>> = vec![None; count];
        for requirement in requirements.constraints() {
            // `target` is executed at least `distance` after `source`.
            let (target, source) = (requirement.from, requirement.to);
            let distance = requirement.bound.negated();
            if target == source {
                (distance <= W::zero()).then_some(())?;
            } else if let Some(time) = &fixed[target.index()] {
                lower(&mut deadlines[source.index()], &time.minus(&distance));
                if source == origin {
                    bounds.push(LowerBound {
                        source,
                        target,
                        distance: Some(distance),
                    });
                }
            } else if let Some(time) = &fixed[source.index()] {
                let distance = time.plus(&distance);
                // No time is negative.
                if distance > W::zero() {
                    (!network.is_contingent(target)).then_some(())?;
                    bounds.push(LowerBound {
                        source: origin,
                        target,
                        distance: Some(distance),
                    });
                }
            } else if let Some(link) = network.ending_at(target) {
                (network.link(link).activation == source).then_some(())?;
                let least = &mut limits[link.index()].least;
                if distance > *least {
                    *least = distance;
                }
            } else if let Some(link) = network.ending_at(source)
                && network.link(link).activation == target
            {
                lower(&mut limits[link.index()].most, &requirement.bound);
            } else {
                // The executor cannot react to a node before it happens.
                (distance >= W::zero()).then_some(())?;
                bounds.push(LowerBound {
                    source,
                    target,
                    distance: Some(distance),
                });
            }
        }
        let order = order(&bounds, count)?;
        // The times in the worst case; `None` is infinite.
        let mut times = vec![Some(W::zero()); count];
        for bound in order.iter().map(|&index| &bounds[index]) {
            let time = match (&times[bound.source.index()], &bound.distance) {
                (Some(time), Some(distance)) => Some(time.plus(distance)),
                _ => None,
            };
            let known = &mut times[bound.target.index()];
            if known.is_some() && time.as_ref().is_none_or(|time| Some(time) > known.as_ref()) {
                *known = time;
            }
        }
        let is_late = |(time, deadline): (&Option<W>, &Option<W>)| {
            let deadline = deadline.as_ref();
            deadline.is_some_and(|deadline| time.as_ref().is_none_or(|time| time > deadline))
        };
        let origin_moves = times[origin.index()] != Some(W::zero());
        if origin_moves || times.iter().zip(&deadlines).any(is_late) {
            return None;
        }
        // The latest times that the deadlines allow.
        let mut latest = deadlines;
        for bound in order.iter().rev().map(|&index| &bounds[index]) {
            if let (Some(time), Some(distance)) = (&latest[bound.target.index()], &bound.distance) {
                let time = time.minus(distance);
                lower(&mut latest[bound.source.index()], &time);
            }
        }
        for (limits, link) in limits.iter_mut().zip(network.links()) {
            if let (Some(latest), Some(begin)) =
                (&latest[link.end.index()], &times[link.activation.index()])
            {
                lower(&mut limits.most, &latest.minus(begin));
            }
        }
        let strategy = Self { limits };
        let mut links = network.link_ids().zip(network.links());
        let fits = links.all(|(id, link)| strategy.allows(id, &link.lower, link.upper.as_ref()));
        fits.then_some(strategy)
    }

    /// Returns `true` if the strategy still meets all bounds when this link has other bounds.
    pub fn allows(&self, link: LinkId, lower: &W, upper: Option<&W>) -> bool {
        let LinkLimits { least, most } = &self.limits[link.index()];
        let fits = |most: &W| upper.is_some_and(|upper| upper <= most);
        lower >= least && upper.is_none_or(|upper| lower <= upper) && most.as_ref().is_none_or(fits)
    }
}

/// Returns the time of each node that requirements fix relative to node 0; node 0 is at 0.
fn fixed_times<W: Weight>(network: &UncertainNetwork<W>) -> Vec<Option<W>> {
    let origin = NodeId(0);
    let mut least: Vec<Option<W>> = vec![None; network.requirements().node_count()];
    let mut most = least.clone();
    for requirement in network.requirements().constraints() {
        if requirement.from == origin {
            lower(&mut most[requirement.to.index()], &requirement.bound);
        } else if requirement.to == origin {
            // The negated time has an upper bound.
            lower(&mut least[requirement.from.index()], &requirement.bound);
        }
    }
    let mut fixed: Vec<Option<W>> = least
        .into_iter()
        .zip(most)
        .map(|(least, most)| most.filter(|most| least == Some(most.negated())))
        .collect();
    fixed[origin.index()] = Some(W::zero());
    fixed
}

/// Lowers a limit.
fn lower<W: Weight>(limit: &mut Option<W>, to: &W) {
    if limit.as_ref().is_none_or(|limit| to < limit) {
        *limit = Some(to.clone());
    }
}

/// Returns the lower bounds in an order in which each source is complete; `None` if there is a
/// cycle.
fn order<W>(bounds: &[LowerBound<W>], node_count: usize) -> Option<Vec<usize>> {
    let mut leaving = vec![Vec::new(); node_count];
    let mut open_bounds = vec![0_usize; node_count];
    for (index, bound) in bounds.iter().enumerate() {
        leaving[bound.source.index()].push(index);
        open_bounds[bound.target.index()] += 1;
    }
    let mut ready: Vec<usize> = (0..node_count)
        .filter(|&node| open_bounds[node] == 0)
        .collect();
    let mut order = Vec::with_capacity(bounds.len());
    while let Some(node) = ready.pop() {
        for &index in &leaving[node] {
            order.push(index);
            let target = bounds[index].target.index();
            open_bounds[target] -= 1;
            if open_bounds[target] == 0 {
                ready.push(target);
            }
        }
    }
    (order.len() == bounds.len()).then_some(order)
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use super::*;
    use crate::uncertain::ContingentLink;
    use crate::{Constraint, Network};

    /// Pseudorandom numbers: `SplitMix64` (Steele, Lea and Flood, 2014).
    struct Random(u64);

    impl Random {
        /// Returns a number in the range, which is not empty.
        fn in_range(&mut self, range: Range<i64>) -> i64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut mixed = self.0;
            mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            mixed ^= mixed >> 31;
            range.start + i64::try_from(mixed >> 1).expect("63 bits") % (range.end - range.start)
        }
    }

    /// Returns a network of tasks after each other or in parallel, with deadlines and sometimes
    /// with bounds of other kinds.
    fn tasks(random: &mut Random) -> UncertainNetwork<i64> {
        let tasks = random.in_range(1..6);
        let count = usize::try_from(tasks).expect("positive");
        // The last node is a time that is known in advance.
        let mut network = Network::with_nodes(2 + 2 * count);
        let known = NodeId::from_index(1 + 2 * count);
        let time = random.in_range(6..20);
        network.add(Constraint::at_least(NodeId(0), known, time));
        network.add(Constraint::at_most(NodeId(0), known, time));
        let begin = |task: usize| NodeId::from_index(1 + 2 * task);
        let end = |task: usize| NodeId::from_index(2 + 2 * task);
        let mut links = Vec::new();
        for task in 0..count {
            let lower = random.in_range(0..5);
            let upper = lower + random.in_range(0..5);
            links.push(ContingentLink {
                activation: begin(task),
                end: end(task),
                lower,
                upper: (random.in_range(0..12) > 0).then_some(upper),
            });
            network.add(Constraint::at_least(
                NodeId(0),
                begin(task),
                random.in_range(0..4),
            ));
            for before in 0..task {
                if random.in_range(0..3) == 0 {
                    let least = random.in_range(0..3);
                    network.add(Constraint::at_least(end(before), begin(task), least));
                }
            }
            if random.in_range(0..2) == 0 {
                let most = random.in_range(8..30);
                network.add(Constraint::at_most(NodeId(0), end(task), most));
            }
            if random.in_range(0..3) == 0 {
                let least = random.in_range(0..3);
                network.add(Constraint::at_least(begin(task), end(task), least));
            }
            match random.in_range(0..6) {
                0 => drop(network.add(Constraint::at_least(end(task), known, 0))),
                1 => drop(network.add(Constraint::at_least(known, begin(task), 1))),
                _ => {}
            }
        }
        for _ in 0..random.in_range(0..2) {
            let [from, to] = [(); 2].map(|()| {
                let index = random.in_range(0..2 * tasks + 1);
                NodeId::from_index(usize::try_from(index).expect("not negative"))
            });
            let bound = random.in_range(-3..10);
            network.add(Constraint { from, to, bound });
        }
        UncertainNetwork::new(network, links).expect("links are in order")
    }

    /// The full algorithm agrees with each acceptance, of the network and of other bounds.
    #[test]
    fn accepted_bounds_are_controllable() {
        let mut random = Random(7);
        let (mut accepted, mut allowed, mut missed, mut refused) = (0, 0, 0, 0);
        for _ in 0..4_000 {
            let network = tasks(&mut random);
            let is_controllable = network.is_dynamically_controllable();
            let Some(strategy) = EarliestStrategy::new(&network) else {
                missed += usize::from(is_controllable);
                refused += usize::from(!is_controllable);
                continue;
            };
            assert!(is_controllable, "{network:?}");
            accepted += 1;
            for (id, link) in network.link_ids().zip(network.links()) {
                let lower = random.in_range(0..6);
                let upper = lower + random.in_range(0..6);
                let mut links = network.links().to_vec();
                links[id.index()] = ContingentLink {
                    lower,
                    upper: Some(upper),
                    ..link.clone()
                };
                let other = UncertainNetwork::new(network.requirements().clone(), links);
                let other = other.expect("links are in order");
                let allows = strategy.allows(id, &lower, Some(&upper));
                // A new strategy is found exactly for the allowed bounds.
                assert_eq!(allows, EarliestStrategy::new(&other).is_some(), "{other:?}");
                assert!(!allows || other.is_dynamically_controllable(), "{other:?}");
                allowed += usize::from(allows);
            }
        }
        assert!(
            accepted > 1_000 && allowed > 1_000 && missed > 50 && refused > 500,
            "{accepted} {allowed} {missed} {refused}"
        );
    }
}
