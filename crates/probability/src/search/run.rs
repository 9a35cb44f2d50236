//! Branch and bound, sequence by sequence.

use std::ops::ControlFlow;

use elbowroom_num::work;
use elbowroom_plan::{InstanceId, Node, NodeId};

use super::bound::{Bound, BoundContext};
use super::memo::Memo;
use super::nominal::Nominal;
use super::time_slack::TimeSlacks;
use super::{Candidates, OrderSearch, Progress, SEQUENCE_WORK};
use crate::model::Model;
use crate::network::{PrunedNetwork, TooCoupled};
use crate::search_state::SearchState;

/// A running search, with the data of the current sequence.
pub(super) struct Run<'s, 'w> {
    search: &'s OrderSearch,
    model: &'s Model,
    must_work: bool,
    has_deadlines: bool,
    network: PrunedNetwork<'s>,
    nominal: Nominal,
    time_slacks: TimeSlacks<'s>,
    is_used: Vec<bool>,
    /// For each instance, the interchangeable one that has to be used before it.
    before: Vec<Option<InstanceId>>,
    is_placed: Vec<bool>,
    /// Position of the next relevant timed initial.
    next_timed: usize,
    memo: Memo,
    best: Option<Best>,
    sequences: usize,
    watch: &'w mut dyn FnMut(&Progress) -> ControlFlow<()>,
}

/// Best order found.
pub(super) struct Best {
    pub(super) probability: f64,
    pub(super) sequence: Vec<NodeId>,
    /// For each happening, `true` if it comes at the same moment as the previous one.
    pub(super) joined: Vec<bool>,
}

/// Relative difference below which two probabilities count as equal. It is more than the correction
/// of bounds for rounding; otherwise a bound would always seem slightly better than the best order.
pub(super) const TIE_TOLERANCE: f64 = 1e-11;

impl<'s, 'w> Run<'s, 'w> {
    /// Creates a search with an empty sequence.
    pub(super) fn new(
        search: &'s OrderSearch,
        circumstances: &SearchState,
        nominal: Nominal,
        rooms: TimeSlacks<'s>,
        watch: &'w mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, TooCoupled> {
        let model = &*search.model;
        let now = &circumstances.now;
        let timed = search.separations.timed.iter();
        let mut is_used = vec![false; model.plan().instances.len()];
        for running in &circumstances.running {
            is_used[running.instance.index()] = true;
        }
        Ok(Self {
            search,
            model,
            must_work: search.settings.candidates == Candidates::Working,
            has_deadlines: search.separations.has_deadlines(now),
            network: PrunedNetwork::new(model, circumstances)?,
            nominal,
            time_slacks: rooms,
            is_used,
            before: search.symmetry.order(model, circumstances),
            is_placed: vec![false; model.plan().nodes.len()],
            next_timed: timed.take_while(|(_, time)| time <= now).count(),
            memo: Memo::new(model, &search.separations),
            best: None,
            sequences: 0,
            watch,
        })
    }

    /// Returns the best sequence, and the number of sequences examined.
    pub(super) fn finish(self) -> (Option<Best>, usize) {
        (self.best, self.sequences)
    }

    /// Examines one sequence, without happenings that are impossible from here.
    pub(super) fn try_sequence(&mut self, sequence: &[NodeId]) -> Result<(), TooCoupled> {
        let mut done = Vec::new();
        for &node in sequence {
            let can_be = match self.model.plan().nodes[node.index()] {
                Node::Zero => false,
                Node::Start(id) | Node::Instant(id) => !self.is_used[id.index()],
                Node::End(id) => self.network.running().contains(&id),
                Node::Timed(_) => {
                    let next = self.search.separations.timed.get(self.next_timed);
                    next.is_some_and(|(next, _)| *next == node)
                }
            };
            let is_placed = |other: NodeId| self.is_placed[other.index()];
            if !can_be || !self.search.separations.may_follow(node, &is_placed) {
                continue;
            }
            // The goal may be reached before the end of the sequence.
            self.record_if_better()?;
            // Happenings that need each other come at the same moment.
            let is_joined = self.network.is_open();
            let is_coupled = self.must_work && self.search.couplings.is_coupled(node);
            if self.push(node, false)?.is_none()
                && !(is_coupled && self.push(node, true)?.is_some())
            {
                break;
            }
            let timed_before = self.timed_before(node);
            if !self
                .time_slacks
                .push(self.model, (node, is_joined), timed_before)
            {
                self.pop(node);
                break;
            }
            done.push(node);
        }
        self.record_if_better()?;
        for node in done.into_iter().rev() {
            self.time_slacks.pop();
            self.pop(node);
        }
        Ok(())
    }

    /// Examines the current sequence, and all continuations.
    pub(super) fn explore(&mut self) -> Result<ControlFlow<()>, TooCoupled> {
        self.sequences += 1;
        work::spend(SEQUENCE_WORK);
        let progress = Progress {
            sequences: self.sequences,
            best: self.best.as_ref().map(|best| best.probability),
        };
        if (self.watch)(&progress).is_break() || work::is_stopped() {
            return Ok(ControlFlow::Break(()));
        }
        self.record_if_better()?;
        let is_joined = self.network.is_open();
        let mut promising = Vec::new();
        for next in self.next() {
            if let Some(bound) = self.push(next.0, next.1)? {
                promising.push((bound, next));
                self.pop(next.0);
            }
        }
        promising.sort_by(|(a, first), (b, second): &(Bound, (NodeId, bool))| {
            let likelier = b.probability.total_cmp(&a.probability);
            likelier.then(first.cmp(second))
        });
        for (bound, (node, is_open)) in promising {
            if !self.can_beat(bound) {
                continue;
            }
            if self.push(node, is_open)?.is_none() {
                continue;
            }
            let timed_before = self.timed_before(node);
            let has_time = self
                .time_slacks
                .push(self.model, (node, is_joined), timed_before);
            let deeper = if has_time {
                let deeper = if !is_open && self.is_dominated() {
                    ControlFlow::Continue(())
                } else {
                    self.explore()?
                };
                self.time_slacks.pop();
                deeper
            } else {
                ControlFlow::Continue(())
            };
            self.pop(node);
            if deeper.is_break() {
                return Ok(deeper);
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Returns the position of `node` among the timed initials, if it is one.
    fn timed_before(&self, node: NodeId) -> usize {
        let is_timed = matches!(self.model.plan().nodes[node.index()], Node::Timed(_));
        self.next_timed - usize::from(is_timed)
    }

    /// Returns `true` if a sequence within that bound could be better than the best one.
    fn can_beat(&self, bound: Bound) -> bool {
        match &self.best {
            None => bound.probability > 0.0,
            Some(best) => {
                let (best, order) = (best.probability, &best.sequence);
                bound.probability > best * (1.0 + TIE_TOLERANCE)
                    || (bound.probability >= best * (1.0 - TIE_TOLERANCE)
                        && bound.length < order.len())
            }
        }
    }

    /// Records the current sequence, if it is an order and better than the best one.
    fn record_if_better(&mut self) -> Result<(), TooCoupled> {
        if !self.network.running().is_empty()
            || self.network.is_open()
            || !self
                .search
                .may_be_over(self.next_timed, self.network.sequence())
        {
            return Ok(());
        }
        if self.must_work {
            let checkpoint = self.nominal.checkpoint();
            let works = self.nominal.assume(self.model, &self.model.goal);
            self.nominal.undo_to(checkpoint);
            if !works {
                return Ok(());
            }
        }
        let probability = self.network.success_probability()?;
        let length = self.network.sequence().len();
        let is_better = match &self.best {
            None => probability > 0.0,
            Some(best) => {
                let (best, order) = (best.probability, &best.sequence);
                probability > best * (1.0 + TIE_TOLERANCE)
                    || (probability >= best * (1.0 - TIE_TOLERANCE) && length < order.len())
            }
        };
        if is_better {
            self.best = Some(Best {
                probability,
                sequence: self.network.sequence().to_vec(),
                joined: self.network.joined(),
            });
        }
        Ok(())
    }

    /// Returns the possible next happenings, regardless of time and probabilities; `true` marks
    /// those that another happening has to follow at the same moment.
    fn next(&self) -> Vec<(NodeId, bool)> {
        self.search.joinable(&self.network, self.next_nodes())
    }

    fn next_nodes(&self) -> Vec<NodeId> {
        let separations = &self.search.separations;
        let mut next = Vec::new();
        for (id, _) in self.model.plan().instances() {
            let (start, end) = (separations.starts[id.index()], separations.ends[id.index()]);
            let node = if !self.is_used[id.index()] {
                let before = self.before[id.index()];
                if before.is_some_and(|before| !self.is_used[before.index()]) {
                    continue;
                }
                start
            } else if start != end && self.network.running().contains(&id) {
                end
            } else {
                continue;
            };
            if separations.may_follow(node, &|other| self.is_placed[other.index()]) {
                next.push(node);
            }
        }
        next.extend(
            separations
                .timed
                .get(self.next_timed)
                .map(|(node, _)| *node),
        );
        next
    }

    /// Adds a happening to all data except the time slacks. Returns the bound of all continuations,
    /// or `None` if the happening is impossible or the bound is not good enough. With `is_open`,
    /// another happening has to follow at the same moment, unless nothing needs that.
    fn push(&mut self, node: NodeId, is_open: bool) -> Result<Option<Bound>, TooCoupled> {
        let model = self.model;
        let event = model.event(node);
        self.memo.mark(self.nominal.checkpoint());
        let what = model.plan().nodes[node.index()];
        self.is_placed[node.index()] = true;
        match what {
            Node::Start(id) | Node::Instant(id) => self.is_used[id.index()] = true,
            Node::Timed(_) => self.next_timed += 1,
            Node::End(_) | Node::Zero => {}
        }
        let pushed = self.network.push_as(node, is_open);
        let probability = match pushed {
            Ok(probability) => probability,
            Err(error) => {
                self.unmark(node);
                return Err(error);
            }
        };
        let bound = if probability <= 0.0 {
            Bound::IMPOSSIBLE
        } else if is_open {
            if self.nominal.apply_open(model, event) && !self.is_settled() {
                Bound::of_start(&self.network)
            } else {
                Bound::IMPOSSIBLE
            }
        } else if !self.must_work || self.nominal.apply(model, event, self.network.running()) {
            self.bound()
        } else {
            Bound::IMPOSSIBLE
        };
        if self.can_beat(bound) {
            Ok(Some(bound))
        } else {
            self.pop(node);
            Ok(None)
        }
    }

    fn pop(&mut self, node: NodeId) {
        self.network.pop();
        self.unmark(node);
    }

    fn unmark(&mut self, node: NodeId) {
        self.is_placed[node.index()] = false;
        match self.model.plan().nodes[node.index()] {
            Node::Start(id) | Node::Instant(id) => self.is_used[id.index()] = false,
            Node::Timed(_) => self.next_timed -= 1,
            Node::End(_) | Node::Zero => {}
        }
        let checkpoint = self.memo.unmark();
        self.nominal.undo_to(checkpoint);
    }

    /// Returns `true` if the over-all conditions of the running actions hold, so that no happening
    /// has to follow at the same moment.
    fn is_settled(&mut self) -> bool {
        let running = self.network.running();
        self.nominal.is_settled(self.model, running) && self.network.may_be_settled()
    }

    fn bound(&mut self) -> Bound {
        let is_used = &self.is_used;
        let is_free = |id: InstanceId| !is_used[id.index()];
        let action_values = BoundContext {
            nominal: &self.nominal,
            must_work: self.must_work,
            is_free: &is_free,
            has_timed: self.next_timed < self.search.separations.timed.len(),
        };
        self.search.bounds.bound(
            self.model,
            &mut self.network,
            &action_values,
            &self.search.separations,
        )
    }

    /// Returns `true` if an equivalent sequence dominates the current one.
    fn is_dominated(&mut self) -> bool {
        let has_timed = self.next_timed < self.search.separations.timed.len();
        let room = self
            .time_slacks
            .relevant_slack(self.has_deadlines && has_timed);
        self.memo.is_dominated(
            self.model,
            &self.nominal,
            &mut self.network,
            &self.is_used,
            (self.next_timed, has_timed),
            room,
        )
    }
}
