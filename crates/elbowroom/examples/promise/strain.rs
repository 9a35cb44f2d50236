//! One thing that nobody has reckoned with: an action that takes shorter or longer than its interval has it, or a look
//! at the world that comes too late. A plan that would still work is not given up because of it, and what is
//! promised from then on is kept.

use std::collections::{BTreeMap, VecDeque};

use elbowroom::execution::{
    Cause, Command, Decision, Ending, Entry, Event, Passage, Promise, Recorder, Ticket, World,
    WorldError,
};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::plan::{
    Bound, Constraint, InstanceId, NodeId, ParametrizedPlan, Valuation, network_node,
};
use elbowroom::stn::{self, ConsistentNetwork, Network};

/// What was not reckoned with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stray {
    /// How long this action takes.
    Duration(InstanceId),
    /// When somebody looked at the world, the how-manieth time.
    Look(u64),
}

/// A world at which somebody looks later than he said he would, once.
pub(crate) struct Lagging<W> {
    pub(crate) inner: W,
    /// How many looks are left before the one that is late.
    pub(crate) looks: u64,
    pub(crate) lag: Rational,
}

impl<W: World> World for Lagging<W> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        let mut passage = self.inner.wait(until)?;
        let is_late = self.looks == 0;
        self.looks = self.looks.wrapping_sub(1);
        if is_late {
            let looked_at = &passage.now + &self.lag;
            while passage.now < looked_at {
                let later = self.inner.wait(&looked_at)?;
                passage.observations.extend(later.observations);
                passage.now = later.now;
            }
        }
        Ok(passage)
    }
}

/// What a run knew, and what it said of that.
pub(crate) struct Course<'a> {
    plan: &'a ParametrizedPlan,
    stray: Stray,
    orders: VecDeque<InstanceId>,
    tickets: BTreeMap<Ticket, InstanceId>,
    looks: u64,
    happened: Vec<Option<Rational>>,
    /// The promises made, in their order.
    promises: Vec<Promise>,
    /// How many promises had been made when the stray was noticed.
    noticed: Option<usize>,
    /// When and why the plan was given up; nothing is noted after that.
    given_up: Option<(Rational, Cause)>,
}

impl<'a> Course<'a> {
    pub(crate) fn new(plan: &'a ParametrizedPlan, stray: Stray) -> Self {
        Self {
            plan,
            stray,
            orders: VecDeque::new(),
            tickets: BTreeMap::new(),
            looks: 0,
            happened: vec![None; plan.plan.nodes.len()],
            promises: Vec::new(),
            noticed: None,
            given_up: None,
        }
    }

    /// Whether the plan was given up.
    pub(crate) fn is_given_up(&self) -> bool {
        self.given_up.is_some()
    }

    /// Whether what was promised at last is that promise or a stronger one, and nothing was beyond what was reckoned
    /// with then: before the stray, or after it was noticed.
    pub(crate) fn is_promised(&self, weakest: Promise) -> bool {
        let is_before = match self.stray {
            Stray::Duration(id) => self.happened[self.plan.plan.start(id).index()].is_none(),
            Stray::Look(_) => true,
        };
        let first = self.noticed.or(is_before.then_some(0));
        let since = first.and_then(|first| self.promises.get(first..));
        let last = since.and_then(<[Promise]>::last);
        last.is_some_and(|last| *last <= weakest)
    }

    /// Whether the plan was given up for want of time although the rest of it would have worked from then on as
    /// planned, what was overdue ending when it suits.
    pub(crate) fn is_given_up_in_vain(&self, task: &Task) -> bool {
        let Some((now, cause)) = &self.given_up else {
            return false;
        };
        let is_about_time = matches!(
            cause,
            Cause::Unreachable | Cause::OutsideInterval | Cause::Outlived | Cause::GuaranteeLost
        );
        is_about_time && !self.plan.reads_more_than_facts(task) && self.works_from(now)
    }

    fn works_from(&self, now: &Rational) -> bool {
        let plan = &self.plan.plan;
        let happened = |node: NodeId| self.happened[node.index()].as_ref();
        let rest = plan.remainder(now, happened, |_| true);
        let values = self.plan.nominal();
        let mut network = Network::with_nodes(rest.nodes.len());
        for constraint in &rest.constraints {
            let (from, to) = (constraint.from, constraint.to);
            let (lower, upper) = self.bounds(constraint, &values, now);
            let (from, to) = (network_node(from), network_node(to));
            if let Some(lower) = lower {
                network.add(stn::Constraint::at_least(from, to, lower));
            }
            if let Some(upper) = upper {
                network.add(stn::Constraint::at_most(from, to, upper));
            }
        }
        ConsistentNetwork::try_from(network).is_ok()
    }

    fn bounds(
        &self,
        constraint: &Constraint,
        values: &Valuation,
        now: &Rational,
    ) -> (Option<Rational>, Option<Rational>) {
        let (lower, upper) = (constraint.lower.at(values), constraint.upper.at(values));
        let is_open = matches!(constraint.upper, Bound::Parameter(_));
        let happened = |node: NodeId| self.happened[node.index()].as_ref();
        match (happened(constraint.from), happened(constraint.to)) {
            (Some(_), Some(_)) => (None, None),
            (Some(begun), None) if is_open && self.plan.plan.duration_of(constraint).is_some() => {
                let elapsed = now - begun;
                if upper.as_ref().is_some_and(|upper| *upper <= elapsed) {
                    (lower.max(Some(elapsed)), None)
                } else {
                    (lower, upper)
                }
            }
            _ => (lower, upper),
        }
    }
}

impl Recorder for Course<'_> {
    fn record(&mut self, entry: &Entry<'_>) {
        if self.given_up.is_some() {
            return;
        }
        match entry {
            Entry::Decided { now, decided } => {
                if let Decision::Start(orders) = &decided.decision {
                    let steps = orders.iter().map(|order| order.step.instance());
                    self.orders.extend(steps);
                }
                self.promises.extend(decided.reason.promise);
                if matches!(decided.decision, Decision::Replan) {
                    self.given_up = Some(((*now).clone(), decided.reason.cause));
                }
            }
            Entry::Command {
                command: Command::Start { ticket, .. },
                ..
            } => {
                let step = self.orders.pop_front();
                self.tickets.extend(step.map(|step| (*ticket, step)));
            }
            Entry::Passed { .. } => {
                if self.stray == Stray::Look(self.looks) {
                    self.noticed = Some(self.promises.len());
                }
                self.looks += 1;
            }
            Entry::Taken { observation, .. } => self.observe(&observation.time, &observation.event),
            _ => {}
        }
    }
}

impl Course<'_> {
    fn observe(&mut self, time: &Rational, event: &Event) {
        let plan = &self.plan.plan;
        let of = |ticket: &Ticket| self.tickets.get(ticket).copied();
        let node = match event {
            Event::Started { ticket, .. } => of(ticket).map(|id| plan.start(id)),
            Event::Ended {
                ticket,
                ending: Ending::Succeeded,
                ..
            } => {
                let id = of(ticket);
                if id.map(Stray::Duration) == Some(self.stray) {
                    self.noticed = Some(self.promises.len());
                }
                id.map(|id| plan.end(id))
            }
            _ => None,
        };
        if let Some(node) = node {
            self.happened[node.index()] = Some(time.clone());
        }
    }
}
