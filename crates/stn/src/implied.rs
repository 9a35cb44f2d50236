//! Constraints that the others imply.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::{ConsistentNetwork, ConstraintId, NodeId, Weight};

impl<W: Weight> ConsistentNetwork<W> {
    /// Constraints that can be left out all together without a new schedule becoming possible,
    /// in ascending order; those for which `keep` holds stay in. Of what stays in, no constraint
    /// but those of `keep` is implied by the others.
    ///
    /// Where several constraints imply each other, the oldest stay in.
    ///
    /// Lengths are slacks in the network's schedule, hence never negative. The nodes on a cycle
    /// of length zero form a *rigid* group and are contracted (Tsamardinos, Muscettola & Morris,
    /// AAAI 1998): between groups no cycle has length zero, so it is no matter of order which
    /// constraints have a detour, and one run of Dijkstra's algorithm per group finds them.
    pub fn implied(&self, keep: impl Fn(ConstraintId) -> bool) -> Vec<ConstraintId> {
        let network = self.network();
        let constraints = network.constraints().iter();
        let slack: Vec<W> = constraints.map(|c| c.slack_in(self.schedule())).collect();
        let rigid = self.rigid_groups(&slack);
        let mut search = Search {
            network: self,
            slack,
            can_go: network.constraint_ids().map(|id| !keep(id)).collect(),
            is_gone: vec![false; network.constraints().len()],
            rigid,
        };
        search.within_groups();
        search.between_groups();
        let gone = network.constraint_ids();
        gone.filter(|id| search.is_gone[id.index()]).collect()
    }

    /// The nodes whose differences are fixed, group by group: the strongly connected components
    /// of the edges without slack (Kosaraju's algorithm).
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
    slack: Vec<W>,
    /// Whether the caller allows to leave a constraint out.
    can_go: Vec<bool>,
    /// The constraints left out so far. Those that are not imply all of these.
    is_gone: Vec<bool>,
    rigid: Rigid,
}

impl<W: Weight> Search<'_, W> {
    /// Leaves out constraints between nodes of one group, newest first.
    ///
    /// Those with slack never matter. Those without must keep the group strongly connected.
    fn within_groups(&mut self) {
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
                self.is_gone[id.index()] = self.can_go[id.index()];
                continue;
            }
            tight_leaving[edge.from.index()] += 1;
            tight_entering[edge.to.index()] += 1;
            inner.push(id);
        }
        let mut mark = vec![None; network.node_count()];
        for id in inner.into_iter().rev() {
            let edge = network.constraint(id);
            // A node's only way out, or in, is needed; this spares most of the searches.
            let is_bridge =
                tight_leaving[edge.from.index()] < 2 || tight_entering[edge.to.index()] < 2;
            if self.can_go[id.index()] && !is_bridge && self.has_tight_detour(id, &mut mark) {
                self.is_gone[id.index()] = true;
                tight_leaving[edge.from.index()] -= 1;
                tight_entering[edge.to.index()] -= 1;
            }
        }
    }

    /// Whether edges without slack lead from the constraint's `from` to its `to` without it.
    ///
    /// `mark` holds for each node the last search that saw it.
    fn has_tight_detour(&self, avoided: ConstraintId, mark: &mut [Option<ConstraintId>]) -> bool {
        let network = self.network.network();
        let edge = network.constraint(avoided);
        let mut stack = vec![edge.from];
        mark[edge.from.index()] = Some(avoided);
        while let Some(node) = stack.pop() {
            for id in network.leaving(node) {
                let to = network.constraint(id).to;
                let is_open = id != avoided
                    && !self.is_gone[id.index()]
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

    /// Leaves out constraints between nodes of different groups.
    fn between_groups(&mut self) {
        let group_count = self.rigid.groups.len();
        let mut sources: Vec<usize> = (0..group_count).collect();
        // Most edges lead back in time. Early sources first: then what a later source looks
        // through has been thinned out already.
        sources.sort_by(|&a, &b| {
            let time = |group: usize| &self.network.schedule()[self.rigid.groups[group][0]];
            time(a).cmp(time(b)).then(a.cmp(&b))
        });
        let mut reach = Reach::new(group_count);
        for source in sources {
            let mut edges: Vec<(usize, ConstraintId)> = Vec::new();
            edges.extend(self.edges_out_of(source).map(|(id, target)| (target, id)));
            edges.sort_unstable();
            reach.look_for_detours(self, source, &edges);
            for edges in edges.chunk_by_mut(|a, b| a.0 == b.0) {
                self.thin_out(edges, reach.has_detour[edges[0].0]);
            }
        }
    }

    /// Of the edges between two groups, keeps the oldest shortest one if there is no detour.
    fn thin_out(&mut self, edges: &mut [(usize, ConstraintId)], has_detour: bool) {
        // What cannot go counts as older than the rest: it makes the others superfluous.
        edges.sort_unstable_by_key(|&(_, id)| (self.can_go[id.index()], id));
        let ids = || edges.iter().map(|&(_, id)| id);
        let shortest = ids().min_by_key(|id| &self.slack[id.index()]);
        let needed = shortest.filter(|_| !has_detour);
        for id in ids() {
            if self.can_go[id.index()] && Some(id) != needed {
                self.is_gone[id.index()] = true;
            }
        }
    }

    fn group(&self, node: NodeId) -> usize {
        self.rigid.group_of[node.index()]
    }

    /// The remaining edges that leave a group, each with the group it leads to.
    fn edges_out_of(&self, group: usize) -> impl Iterator<Item = (ConstraintId, usize)> {
        let network = self.network.network();
        let members = self.rigid.groups[group].iter();
        members
            .flat_map(|&node| network.leaving(node))
            .filter(|id| !self.is_gone[id.index()])
            .map(|id| (id, self.group(network.constraint(id).to)))
            .filter(move |&(_, target)| target != group)
    }
}

/// The groups near a source, kept between searches to spare allocations.
struct Reach<W> {
    /// The length of the shortest path found.
    length: Vec<Option<W>>,
    /// Whether a path of two or more edges is at least as short as the shortest single edge.
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

    /// Dijkstra's algorithm from `source`, as far as needed to know which of its edges have a
    /// detour.
    fn look_for_detours(
        &mut self,
        search: &Search<'_, W>,
        source: usize,
        edges: &[(usize, ConstraintId)],
    ) {
        self.clear();
        self.is_final[source] = true;
        self.touched.push(source);
        let mut open: Vec<(W, usize)> = Vec::new();
        for edges in edges.chunk_by(|a, b| a.0 == b.0) {
            let target = edges[0].0;
            let lengths = edges.iter().map(|(_, id)| &search.slack[id.index()]);
            let Some(shortest) = lengths.min() else {
                continue;
            };
            self.reach(target, shortest.clone());
            if edges.iter().any(|(_, id)| search.can_go[id.index()]) {
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
            if std::mem::replace(&mut self.is_final[group], true) {
                continue;
            }
            for (id, target) in search.edges_out_of(group) {
                let longer = length.plus(&search.slack[id.index()]);
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
