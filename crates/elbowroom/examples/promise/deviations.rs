//! One unexpected deviation: the duration of an action is outside its interval, or the executor
//! observes the world too late. A plan that is still feasible must not be abandoned, and promises
//! made after the deviation must be kept.

use std::collections::{BTreeMap, VecDeque};

use elbowroom::execution::{
    ActionHandle, Cause, Command, Decision, Ending, Entry, Event, GuaranteeLevel, Recorder,
    TimeAdvance, World, WorldError,
};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::plan::{
    Bound, Constraint, InstanceId, NodeId, ParametrizedPlan, Valuation, network_node,
};
use elbowroom::stn::{self, ConsistentNetwork, Network};

/// Unexpected deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stray {
    /// The duration of this action.
    Duration(InstanceId),
    /// The time of an observation, by its number.
    Look(u64),
}

/// World whose executor once observes it later than planned.
pub(crate) struct Lagging<W> {
    pub(crate) inner: W,
    /// Number of observations before the late one.
    pub(crate) looks: u64,
    pub(crate) lag: Rational,
}

impl<W: World> World for Lagging<W> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
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

/// Knowledge of the executor in a run, and its promises.
pub(crate) struct Course<'a> {
    plan: &'a ParametrizedPlan,
    stray: Stray,
    orders: VecDeque<InstanceId>,
    tickets: BTreeMap<ActionHandle, InstanceId>,
    looks: u64,
    happened: Vec<Option<Rational>>,
    /// Promises, in their order.
    promises: Vec<GuaranteeLevel>,
    /// Number of promises when the deviation was noticed.
    noticed: Option<usize>,
    /// Time and cause of abandoning the plan; later events are ignored.
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

    /// Returns `true` if the plan was abandoned.
    pub(crate) fn is_given_up(&self) -> bool {
        self.given_up.is_some()
    }

    /// Returns `true` if the last promise is at least as strong as `weakest` and the deviation
    /// cannot violate it: the promise was made before the deviating action had started, or after
    /// the deviation was noticed.
    pub(crate) fn is_promised(&self, weakest: GuaranteeLevel) -> bool {
        let is_before = match self.stray {
            Stray::Duration(id) => self.happened[self.plan.plan.start(id).index()].is_none(),
            Stray::Look(_) => true,
        };
        let first = self.noticed.or(is_before.then_some(0));
        let since = first.and_then(|first| self.promises.get(first..));
        let last = since.and_then(<[GuaranteeLevel]>::last);
        last.is_some_and(|last| *last <= weakest)
    }

    /// Returns `true` if the plan was abandoned for lack of time although its remaining steps were
    /// feasible with nominal durations and arbitrary ends of overdue actions.
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
                self.promises.extend(decided.reason.guarantee);
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
        let of = |ticket: &ActionHandle| self.tickets.get(ticket).copied();
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
