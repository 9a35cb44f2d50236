//! Constraints that the others imply.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

use crate::paths::ShortestPaths;
use crate::{ConsistentNetwork, ConstraintId, NodeId, Schedule, Weight};

impl<W: Weight> ConsistentNetwork<W> {
    /// Returns constraints that can all be removed without adding a schedule, in ascending order.
    /// Those for which `keep` holds stay. Of the remaining constraints, only those of `keep` may be
    /// implied by the others.
    ///
    /// If several constraints imply each other, the oldest stay.
    ///
    /// Lengths are slacks in a schedule, hence never negative. The nodes on a cycle of length zero
    /// form a *rigid* group and are contracted (Tsamardinos, Muscettola & Morris, AAAI 1998). No
    /// cycle between groups has length zero, so the set of constraints with a detour does not
    /// depend on the order of removal, and one run of Dijkstra's algorithm per group finds them.
    pub fn implied(&self, keep: impl Fn(ConstraintId) -> bool) -> Vec<ConstraintId> {
        self.implied_seen_from(self.schedule(), keep)
    }

    /// Computes [`implied`](Self::implied) with slacks in this schedule of the network.
    ///
    /// Every schedule gives the same constraints, but not in the same time: the search for a
    /// constraint explores nodes at distances up to its slack. That is a smaller region if few
    /// nodes coincide in the schedule.
    pub fn implied_seen_from(
        &self,
        schedule: &Schedule<W>,
        keep: impl Fn(ConstraintId) -> bool,
    ) -> Vec<ConstraintId> {
        let network = self.network();
        debug_assert!(schedule.holds_in(network));
        let constraints = network.constraints().iter();
        let slack: Vec<W> = constraints.map(|c| c.slack_in(schedule)).collect();
        let rigid = self.rigid_groups(&slack);
        let mut search = Search {
            network: self,
            schedule,
            slack,
            is_removable: network.constraint_ids().map(|id| !keep(id)).collect(),
            is_removed: vec![false; network.constraints().len()],
            rigid,
        };
        search.thin_within_groups();
        search.thin_between_groups();
        let gone = network.constraint_ids();
        gone.filter(|id| search.is_removed[id.index()]).collect()
    }

    /// Returns the nodes whose differences are fixed, group by group: the strongly connected
    /// components of the edges without slack (Kosaraju's algorithm).
    fn rigid_groups(&self, slack: &[W]) -> Rigid {
        let network = self.network();
        let is_tight = |id: ConstraintId| slack[id.index()] == W::zero();
        let finished = network.depth_first_postorder(is_tight);
        let mut group_of = vec![usize::MAX; network.node_count()];
        let mut groups: Vec<Vec<NodeId>> = Vec::new();
        for root in finished.into_iter().rev() {
            if group_of[root.index()] != usize::MAX {
                continue;
            }
            let mut members = vec![root];
            group_of[root.index()] = groups.len();
            let mut looked_at = 0;
            while let Some(&node) = members.get(looked_at) {
                looked_at += 1;
                for id in network.entering(node) {
                    let from = network.constraint(id).from;
                    if is_tight(id) && group_of[from.index()] == usize::MAX {
                        group_of[from.index()] = groups.len();
                        members.push(from);
                    }
                }
            }
            groups.push(members);
        }
        Rigid { group_of, groups }
    }
}

/// The rigid groups of a network.
struct Rigid {
    group_of: Vec<usize>,
    groups: Vec<Vec<NodeId>>,
}

struct Search<'a, W> {
    network: &'a ConsistentNetwork<W>,
    schedule: &'a Schedule<W>,
    slack: Vec<W>,
    /// `true` if the caller allows that a constraint is left out.
    is_removable: Vec<bool>,
    /// `true` for constraints removed so far. The remaining ones imply all of these.
    is_removed: Vec<bool>,
    rigid: Rigid,
}

impl<W: Weight> Search<'_, W> {
    /// Removes constraints between nodes of one group, newest first.
    ///
    /// Those with slack are never needed. Those without must keep the group strongly connected.
    fn thin_within_groups(&mut self) {
        let network = self.network.network();
        let mut inner: Vec<ConstraintId> = Vec::new();
        let mut tight_leaving = vec![0_usize; network.node_count()];
        let mut tight_entering = vec![0_usize; network.node_count()];
        for id in network.constraint_ids() {
            let edge = network.constraint(id);
            if self.group(edge.from) != self.group(edge.to) {
                continue;
            }
            if edge.from == edge.to || self.slack[id.index()] > W::zero() {
                self.is_removed[id.index()] = self.is_removable[id.index()];
                continue;
            }
            tight_leaving[edge.from.index()] += 1;
            tight_entering[edge.to.index()] += 1;
            inner.push(id);
        }
        let mut mark = vec![None; network.node_count()];
        for id in inner.into_iter().rev() {
            let edge = network.constraint(id);
            // The only edge out of a node, or into it, is needed. This check saves most of the
            // searches.
            let is_bridge =
                tight_leaving[edge.from.index()] < 2 || tight_entering[edge.to.index()] < 2;
            if self.is_removable[id.index()] && !is_bridge && self.has_tight_detour(id, &mut mark) {
                self.is_removed[id.index()] = true;
                tight_leaving[edge.from.index()] -= 1;
                tight_entering[edge.to.index()] -= 1;
            }
        }
    }

    /// Returns `true` if edges without slack lead from the constraint's `from` to its `to` without
    /// it.
    ///
    /// `mark` holds for each node the last search that visited it.
    fn has_tight_detour(&self, avoided: ConstraintId, mark: &mut [Option<ConstraintId>]) -> bool {
        let network = self.network.network();
        let edge = network.constraint(avoided);
        let mut stack = vec![edge.from];
        mark[edge.from.index()] = Some(avoided);
        while let Some(node) = stack.pop() {
            for id in network.leaving(node) {
                let to = network.constraint(id).to;
                let is_open = id != avoided
                    && !self.is_removed[id.index()]
                    && self.slack[id.index()] == W::zero()
                    && self.group(to) == self.group(node)
                    && mark[to.index()] != Some(avoided);
                if is_open {
                    if to == edge.to {
                        return true;
                    }
                    mark[to.index()] = Some(avoided);
                    stack.push(to);
                }
            }
        }
        false
    }

    /// Removes constraints between nodes of different groups.
    fn thin_between_groups(&mut self) {
        let group_count = self.rigid.groups.len();
        let mut sources: Vec<usize> = (0..group_count).collect();
        // Most edges lead back in time. With early sources first, later sources search through
        // edges that have already been thinned out.
        sources.sort_by(|&a, &b| {
            let time = |group: usize| &self.schedule[self.rigid.groups[group][0]];
            time(a).cmp(time(b)).then(a.cmp(&b))
        });
        let mut reach = Reach::new(group_count);
        let mut outgoing = self.outgoing();
        let hub = Hub::of(self, &outgoing);
        for source in sources {
            reach.find_detours(&outgoing, source, hub.as_ref(), &self.is_removable);
            for edges in outgoing.of(source).chunk_by(|a, b| a.target == b.target) {
                self.thin_out(edges, reach.has_detour[edges[0].target]);
            }
            outgoing.drop_removed(source, &self.is_removed);
        }
    }

    /// Keeps the oldest shortest edge between two groups if there is no detour, and removes the
    /// others.
    fn thin_out(&mut self, edges: &[Edge<W>], has_detour: bool) {
        // Constraints that must stay count as older than the rest, because they make the others
        // redundant.
        let age = |edge: &Edge<W>| (self.is_removable[edge.id.index()], edge.id);
        let shortest = edges
            .iter()
            .min_by(|a, b| a.length.cmp(&b.length).then_with(|| age(a).cmp(&age(b))));
        let needed = shortest.map(|edge| edge.id).filter(|_| !has_detour);
        for edge in edges {
            if self.is_removable[edge.id.index()] && Some(edge.id) != needed {
                self.is_removed[edge.id.index()] = true;
            }
        }
    }

    fn group(&self, node: NodeId) -> usize {
        self.rigid.group_of[node.index()]
    }

    /// Returns the edges between groups.
    fn outgoing(&self) -> Outgoing<W> {
        let network = self.network.network();
        let mut edges = Vec::new();
        let mut ranges = Vec::with_capacity(self.rigid.groups.len());
        for (group, members) in self.rigid.groups.iter().enumerate() {
            let first = edges.len();
            for id in members.iter().flat_map(|&node| network.leaving(node)) {
                let target = self.group(network.constraint(id).to);
                if target != group {
                    edges.push(Edge {
                        target,
                        length: self.slack[id.index()].clone(),
                        id,
                    });
                }
            }
            edges[first..].sort_unstable_by_key(|edge| (edge.target, edge.id));
            ranges.push(first..edges.len());
        }
        Outgoing { edges, ranges }
    }
}

/// The remaining edges between groups, stored contiguously by source group and then by target
/// group, because most of the work is to traverse them.
struct Outgoing<W> {
    edges: Vec<Edge<W>>,
    ranges: Vec<Range<usize>>,
}

struct Edge<W> {
    target: usize,
    length: W,
    id: ConstraintId,
}

impl<W> Outgoing<W> {
    fn of(&self, group: usize) -> &[Edge<W>] {
        &self.edges[self.ranges[group].clone()]
    }

    /// Drops the removed edges of a group.
    fn drop_removed(&mut self, group: usize, is_gone: &[bool]) {
        let range = &mut self.ranges[group];
        let mut end = range.start;
        for place in range.clone() {
            if !is_gone[self.edges[place].id.index()] {
                self.edges.swap(end, place);
                end += 1;
            }
        }
        range.end = end;
    }
}

/// Number of edges from which a group can be a hub.
const MANY_EDGES: usize = 8;

/// Group with the most outgoing edges, and its distances to and from all groups. It usually
/// contains the beginning of the plan, because windows and deadlines are constraints to the
/// beginning. A search that continued from the hub would visit the whole network.
struct Hub<W> {
    group: usize,
    /// The lengths of the shortest paths from each group to the hub, and from the hub to each
    /// group. They omit the hub's own time, which cancels: it is subtracted from one and added to
    /// the other.
    to: Vec<Option<W>>,
    from: Vec<Option<W>>,
}

impl<W: Weight> Hub<W> {
    fn of(search: &Search<'_, W>, outgoing: &Outgoing<W>) -> Option<Self> {
        let groups = &search.rigid.groups;
        let group = (0..groups.len()).max_by_key(|group| outgoing.of(*group).len())?;
        if outgoing.of(group).len() < MANY_EDGES {
            return None;
        }
        let root = groups[group][0];
        let lengths = |paths: &ShortestPaths<W>| {
            let length = |members: &Vec<NodeId>| {
                let distance = paths.distance(members[0])?;
                Some(paths.direction().key(distance, members[0], search.schedule))
            };
            groups.iter().map(length).collect()
        };
        Some(Self {
            group,
            to: lengths(&search.network.shortest_paths_to(root)),
            from: lengths(&search.network.shortest_paths_from(root)),
        })
    }

    /// Returns the length of the shortest path between two other groups that leads through the hub.
    fn between(&self, source: usize, target: usize) -> Option<W> {
        if self.group == source || self.group == target {
            return None;
        }
        let (there, on) = (self.to[source].as_ref()?, self.from[target].as_ref()?);
        Some(there.plus(on))
    }
}

/// Groups near a source, reused between searches to save allocations.
struct Reach<W> {
    /// The length of the shortest path found.
    length: Vec<Option<W>>,
    /// `true` if a path of two or more edges is at least as short as the shortest single edge.
    has_detour: Vec<bool>,
    is_final: Vec<bool>,
    touched: Vec<usize>,
    queue: BinaryHeap<Reverse<(W, usize)>>,
}

impl<W: Weight> Reach<W> {
    fn new(group_count: usize) -> Self {
        Self {
            length: vec![None; group_count],
            has_detour: vec![false; group_count],
            is_final: vec![false; group_count],
            touched: Vec::new(),
            queue: BinaryHeap::new(),
        }
    }

    /// Runs Dijkstra's algorithm from `source`, until all of its edges with a detour are known. The
    /// lengths of detours through the hub are known beforehand.
    fn find_detours(
        &mut self,
        outgoing: &Outgoing<W>,
        source: usize,
        hub: Option<&Hub<W>>,
        can_go: &[bool],
    ) {
        self.clear();
        self.is_final[source] = true;
        self.touched.push(source);
        let mut open: Vec<(W, usize)> = Vec::new();
        let edges = outgoing.of(source);
        for edges in edges.chunk_by(|a, b| a.target == b.target) {
            let target = edges[0].target;
            let lengths = edges.iter().map(|edge| &edge.length);
            let Some(shortest) = lengths.min() else {
                continue;
            };
            self.reach(target, shortest.clone());
            let by_hub = hub.and_then(|hub| hub.between(source, target));
            self.has_detour[target] = by_hub.is_some_and(|length| length <= *shortest);
            if edges.iter().any(|edge| can_go[edge.id.index()]) {
                open.push((shortest.clone(), target));
            }
        }
        open.sort_unstable();
        while let Some(Reverse((length, group))) = self.queue.pop() {
            while open
                .pop_if(|(_, target)| self.has_detour[*target])
                .is_some()
            {}
            let Some((limit, _)) = open.last() else {
                return;
            };
            if length > *limit {
                return;
            }
            let is_hub = hub.is_some_and(|hub| hub.group == group);
            if std::mem::replace(&mut self.is_final[group], true) || is_hub {
                continue;
            }
            for edge in outgoing.of(group) {
                let target = edge.target;
                let longer = length.plus(&edge.length);
                if target == source || longer > *limit {
                    continue;
                }
                match &self.length[target] {
                    Some(old) if longer > *old => {}
                    Some(old) if longer == *old => self.has_detour[target] = true,
                    _ => {
                        self.has_detour[target] = true;
                        self.reach(target, longer);
                    }
                }
            }
        }
    }

    fn reach(&mut self, group: usize, length: W) {
        self.touched.push(group);
        self.length[group] = Some(length.clone());
        self.queue.push(Reverse((length, group)));
    }

    fn clear(&mut self) {
        for group in self.touched.drain(..) {
            self.length[group] = None;
            self.has_detour[group] = false;
            self.is_final[group] = false;
        }
        self.queue.clear();
    }
}
