//! Exact decision where only deadlines bound the times from above.
//!
//! Then it is best to start each action as early as possible, and the world does the greatest harm
//! with the longest durations and all its failures on one path. Layer j of a time point is the
//! latest time at which it happens after at most j failures on the path to it. The layers are
//! longest paths, computed in topological order.
//!
//! A time point after the *start* of an action, but not after its end, waits for the start of the
//! last attempt. As long as failures are left, this is known only at the end of the action.

use elbowroom_num::Rational;
use elbowroom_stn::NodeId;

use super::FaultNetwork;

/// Precedence: `to` comes at least `least` after a node.
#[derive(Clone, Debug)]
struct Precedence {
    to: usize,
    least: Rational,
}

/// The network as longest paths; it exists only if nothing but deadlines bounds times from above.
#[derive(Clone, Debug)]
pub struct Layers<'a> {
    network: &'a FaultNetwork,
    releases: Vec<Rational>,
    deadlines: Vec<(usize, Rational)>,
    precedences: Vec<Vec<Precedence>>,
    /// The attempts that start at each node.
    starting: Vec<Vec<usize>>,
    order: Vec<usize>,
    /// `false` if an action starts later than necessary, so that a missed deadline proves nothing.
    is_exact: bool,
}

/// Failures that make the plan miss a deadline, if all durations are as long as possible.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeadlineFailure {
    /// The number of failures of each attempt.
    pub failures: Vec<usize>,
    /// A longest path to the time point that misses its deadline, with the number of failures
    /// before each time point.
    pub path: Vec<(NodeId, usize)>,
    /// Its earliest time; `None` if there is no limit.
    pub time: Option<Rational>,
    /// The deadline.
    pub deadline: Rational,
}

/// Time of a node in a layer, and its origin: the previous node, its layer, and the attempt that
/// failed in between, with the number of its failures.
#[derive(Clone, Debug)]
struct Latest {
    time: Option<Rational>,
    origin: Option<(usize, usize, usize, usize)>,
}

impl<'a> Layers<'a> {
    /// Returns `None` if the times have upper bounds other than deadlines.
    pub fn new(network: &'a FaultNetwork) -> Option<Self> {
        let count = network.nodes;
        let mut starting = vec![Vec::new(); count];
        let mut is_link = vec![false; count];
        let mut ending = vec![None; count];
        let mut fixed: Vec<Option<Rational>> = vec![None; count];
        fixed[0] = Some(Rational::ZERO);
        for (index, attempt) in network.attempts.iter().enumerate() {
            if attempt.start.index() == 0 {
                // The time of a timed initial.
                if attempt.upper.as_ref() != Some(&attempt.lower) {
                    return None;
                }
                fixed[attempt.end.index()] = Some(attempt.lower.clone());
                continue;
            }
            is_link[attempt.start.index()] = true;
            is_link[attempt.end.index()] = true;
            ending[attempt.end.index()] = Some(attempt);
            starting[attempt.start.index()].push(index);
        }
        let mut bounds = vec![[None, None]; count];
        for own in &network.requirements {
            let (node, side) = match (own.from.index(), own.to.index()) {
                (0, node) => (node, 0),
                (node, 0) => (node, 1),
                _ => continue,
            };
            let known: &mut Option<Rational> = &mut bounds[node][side];
            if known.as_ref().is_none_or(|known| own.bound < *known) {
                *known = Some(own.bound.clone());
            }
        }
        for (node, [upper, lower]) in bounds.iter().enumerate().skip(1) {
            if let (Some(upper), Some(lower)) = (upper, lower)
                && !is_link[node]
                && *upper == -lower
            {
                fixed[node] = Some(upper.clone());
            }
        }
        let mut layers = Self {
            network,
            releases: vec![Rational::ZERO; count],
            deadlines: Vec::new(),
            precedences: vec![Vec::new(); count],
            starting,
            order: Vec::new(),
            is_exact: true,
        };
        let mut before_ends = Vec::new();
        for own in &network.requirements {
            let (from, to) = (own.from.index(), own.to.index());
            match (&fixed[from], &fixed[to]) {
                (Some(one), Some(other)) => {
                    if *other > one + &own.bound {
                        return None;
                    }
                }
                (Some(time), None) => layers.deadlines.push((to, time + &own.bound)),
                (None, Some(time)) => {
                    let mut least = time - &own.bound;
                    let mut node = from;
                    if let Some(attempt) = ending[from] {
                        // The world decides the end, so the start has to be late enough.
                        least -= &attempt.lower;
                        node = attempt.start.index();
                    }
                    if least > layers.releases[node] {
                        layers.releases[node] = least;
                    }
                }
                (None, None) if own.bound.is_positive() => return None,
                // `to + (-bound) <= from`
                (None, None) if ending[from].is_some() => before_ends.push(own),
                (None, None) => layers.precedences[to].push(Precedence {
                    to: from,
                    least: -&own.bound,
                }),
            }
        }
        for own in before_ends {
            let attempt = ending[own.from.index()].expect("it ends an action");
            let (before, start) = (own.to.index(), attempt.start.index());
            let least = -&own.bound - &attempt.lower;
            let is_implied = !least.is_positive() && layers.leads_to(before, start);
            if !is_implied {
                layers.is_exact &= !least.is_negative();
                layers.precedences[before].push(Precedence {
                    to: start,
                    least: if least.is_negative() {
                        Rational::ZERO
                    } else {
                        least
                    },
                });
            }
        }
        layers.order = layers.topological_order()?;
        Some(layers)
    }

    /// Returns `true` if a missed deadline proves that no strategy works.
    pub fn is_exact(&self) -> bool {
        self.is_exact
    }

    /// Returns `true` if the one node comes before the other, or is it.
    fn leads_to(&self, before: usize, after: usize) -> bool {
        let mut seen = vec![false; self.network.nodes];
        let mut stack = vec![before];
        while let Some(node) = stack.pop() {
            if node == after {
                return true;
            }
            if !std::mem::replace(&mut seen[node], true) {
                stack.extend(self.successors(node));
            }
        }
        false
    }

    fn successors(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        let ends = self.starting[node].iter();
        let ends = ends.map(|&index| self.network.attempts[index].end.index());
        ends.chain(self.precedences[node].iter().map(|own| own.to))
    }

    fn topological_order(&self) -> Option<Vec<usize>> {
        let count = self.network.nodes;
        let mut open = vec![0_usize; count];
        for node in 0..count {
            self.successors(node).for_each(|next| open[next] += 1);
        }
        let mut order: Vec<usize> = (0..count).filter(|&node| open[node] == 0).collect();
        let mut done = 0;
        while done < order.len() {
            let node = order[done];
            done += 1;
            for next in self.successors(node) {
                open[next] -= 1;
                if open[next] == 0 {
                    order.push(next);
                }
            }
        }
        (order.len() == count).then_some(order)
    }

    /// Returns the layers of all time points for at most `k` failures; `None` is no limit.
    pub fn latest(&self, k: usize) -> Vec<Vec<Option<Rational>>> {
        let latest = self.compute(k).into_iter();
        latest
            .map(|layers| layers.into_iter().map(|own| own.time).collect())
            .collect()
    }

    /// Returns failures that make the plan miss a deadline; `None` if there are none with `k` in
    /// total. The decision is exact.
    pub fn failure(&self, k: usize) -> Option<DeadlineFailure> {
        let latest = self.compute(k);
        for (node, deadline) in &self.deadlines {
            let retried = self.starting[*node].iter().copied();
            let retried = retried.max_by_key(|&index| self.network.attempts[index].retries);
            for layer in 0..=k {
                let own = &latest[*node][layer].time;
                let (time, failures) = match retried {
                    None => (own.clone(), 0),
                    Some(index) => {
                        let count = self.network.attempts[index].retries.min(k - layer);
                        (self.later(own.as_ref(), index, count, false), count)
                    }
                };
                if time.as_ref().is_some_and(|time| time <= deadline) {
                    continue;
                }
                let mut counts = vec![0; self.network.attempts.len()];
                if let Some(index) = retried {
                    counts[index] += failures;
                }
                let mut at = (*node, layer);
                let mut path = vec![(node_id(at.0), at.1)];
                while let Some((before, layer, index, failures)) = latest[at.0][at.1].origin {
                    if failures > 0 {
                        counts[index] += failures;
                    }
                    at = (before, layer);
                    path.push((node_id(at.0), at.1));
                }
                path.reverse();
                return Some(DeadlineFailure {
                    failures: counts,
                    path,
                    time,
                    deadline: deadline.clone(),
                });
            }
        }
        None
    }

    /// Returns the time after a number of failures of an attempt, with or without the successful
    /// one.
    fn later(
        &self,
        time: Option<&Rational>,
        index: usize,
        failures: usize,
        and_success: bool,
    ) -> Option<Rational> {
        let attempt = &self.network.attempts[index];
        let mut later = time?.clone();
        if failures > 0 {
            let count = Rational::from(i64::try_from(failures).unwrap_or(i64::MAX));
            later += &(count * self.network.longest_failure(attempt)?);
        }
        if and_success {
            later += attempt.upper.as_ref()?;
        }
        Some(later)
    }

    fn compute(&self, k: usize) -> Vec<Vec<Latest>> {
        let initial = self.releases.iter().map(|release| {
            let own = Latest {
                time: Some(release.clone()),
                origin: None,
            };
            vec![own; k + 1]
        });
        let mut latest: Vec<Vec<Latest>> = initial.collect();
        for &node in &self.order {
            for layer in 0..=k {
                let time = latest[node][layer].time.clone();
                let mut raise = |to: usize, failures: usize, index, new: Option<Rational>| {
                    let known = &mut latest[to][layer + failures];
                    let is_later = match (&new, &known.time) {
                        (_, None) => false,
                        (None, Some(_)) => true,
                        (Some(new), Some(known)) => new > known,
                    };
                    if is_later {
                        *known = Latest {
                            time: new,
                            origin: Some((node, layer, index, failures)),
                        };
                    }
                };
                let mut retried = None;
                for &index in &self.starting[node] {
                    let attempt = &self.network.attempts[index];
                    if attempt.retries > 0 {
                        retried = Some(index);
                    }
                    for failures in 0..=attempt.retries.min(k - layer) {
                        let end = self.later(time.as_ref(), index, failures, true);
                        raise(attempt.end.index(), failures, index, end);
                    }
                }
                for own in &self.precedences[node] {
                    let after = |time: Option<Rational>| time.map(|time| time + &own.least);
                    let Some(index) = retried else {
                        raise(own.to, 0, 0, after(time.clone()));
                        continue;
                    };
                    let most = self.network.attempts[index].retries.min(k - layer);
                    for failures in 0..=most {
                        // As long as failures are left, the end shows which attempt is the last.
                        let last_start = self.later(time.as_ref(), index, failures, false);
                        let mut next = after(last_start);
                        if failures < most {
                            let end = self.later(time.as_ref(), index, failures, true);
                            next = next.zip(end).map(|(next, end)| next.max(end));
                        }
                        raise(own.to, failures, index, next);
                    }
                }
            }
        }
        latest
    }
}

fn node_id(index: usize) -> NodeId {
    NodeId(u32::try_from(index).expect("nodes are numbered with 32 bits"))
}
