//! Time windows of time points, with different reach of constraint propagation.

use std::sync::Arc;

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{Dispatchable, Dispatcher, Ground, LinkId, Step};
use elbowroom_stn::{
    ConsistentNetwork, Constraint, ConstraintId, IncrementalWindows, Network, NodeId, WindowEnd,
};

/// Window of a time point; an end is `None` if it is infinite.
pub(crate) type TimeWindow = (Option<Rational>, Option<Rational>);

/// The time windows of time points, given those that have been executed.
#[derive(Clone, Debug)]
pub(crate) enum WindowPropagation {
    /// Windows that follow from all constraints together.
    WholeNetwork(Box<IncrementalWindows>),
    /// Windows that follow from single constraints with executed time points, as in the dispatchers
    /// of paper 1 and `ROSPlan`.
    OneHop(OneHop),
    /// Windows that follow from a dispatchable form of the network: an event has to be propagated
    /// only to its neighbours. The world decides on the contingent links.
    Dispatchable(Box<Dispatcher>),
}

/// Cause of one end of a time window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NetworkLimit {
    /// A constraint of the network.
    Constraint(ConstraintId),
    /// A contingent link.
    Link(LinkId),
}

/// See [`PropagationReach::OneHop`](crate::dispatch::PropagationReach::OneHop).
#[derive(Clone, Debug)]
pub(crate) struct OneHop {
    network: Network,
    executed: Vec<Option<Rational>>,
}

/// Violation of a time window.
#[derive(Clone, Debug)]
pub(crate) struct Missed {
    /// The violated end.
    pub(crate) end: WindowEnd,
    /// The amount of the violation.
    pub(crate) by: Rational,
    /// `true` if only the bounds of the contingent link that ends there are violated. Then the
    /// remaining plan may still work.
    pub(crate) is_only_link: bool,
}

impl WindowPropagation {
    pub(crate) fn whole_network(network: ConsistentNetwork) -> Self {
        Self::WholeNetwork(Box::new(IncrementalWindows::new(network, NodeId(0))))
    }

    pub(crate) fn one_hop(network: Network) -> Self {
        let mut happened = vec![None; network.node_count()];
        happened[0] = Some(Rational::ZERO);
        Self::OneHop(OneHop {
            network,
            executed: happened,
        })
    }

    /// Creates the horizon of a network in dispatchable form.
    pub(crate) fn dispatchable(form: Arc<Dispatchable<Rational>>) -> Self {
        Self::Dispatchable(Box::new(Dispatcher::new(form)))
    }

    /// Returns `true` if all time points that must come before have happened. Without a
    /// dispatchable form, always `true`.
    pub(crate) fn is_ready(&self, node: NodeId) -> bool {
        match self {
            Self::WholeNetwork(_) | Self::OneHop(_) => true,
            Self::Dispatchable(dispatcher) => dispatcher.is_ready(node),
        }
    }

    /// Returns `true` if the world decides when a time point happens. Without a dispatchable form,
    /// always `true`.
    pub(crate) fn is_contingent(&self, node: NodeId) -> bool {
        match self {
            Self::WholeNetwork(_) | Self::OneHop(_) => true,
            Self::Dispatchable(dispatcher) => dispatcher.form().network().is_contingent(node),
        }
    }

    /// Returns the earliest time of a time point that is ready, if no event comes before. `Err` if
    /// it has to wait for the end of that link, however late that is.
    pub(crate) fn earliest(&self, node: NodeId) -> Result<Option<Rational>, LinkId> {
        match self {
            Self::WholeNetwork(_) | Self::OneHop(_) => Ok(self.window(node).0),
            Self::Dispatchable(dispatcher) => Ok(dispatcher.earliest(node)?.cloned()),
        }
    }

    pub(crate) fn window(&self, node: NodeId) -> TimeWindow {
        match self {
            Self::WholeNetwork(windows) => {
                let window = windows.window(node);
                (window.earliest.clone(), window.latest.clone())
            }
            Self::OneHop(one_hop) => one_hop.window(node),
            Self::Dispatchable(dispatcher) => dispatcher.bounds(node),
        }
    }

    /// Executes a node at `time`. If that is outside its window,
    /// [`WholeNetwork`](Self::WholeNetwork) does not record it; the others do.
    pub(crate) fn fix(&mut self, node: NodeId, time: &Rational) -> Result<(), Missed> {
        match self {
            Self::WholeNetwork(windows) => windows.fix(node, time).map_err(|out| Missed {
                end: out.end,
                by: out.amount,
                is_only_link: false,
            }),
            Self::OneHop(one_hop) => {
                let (earliest, latest) = one_hop.window(node);
                one_hop.executed[node.index()] = Some(time.clone());
                if let Some(earliest) = earliest.filter(|earliest| time < earliest) {
                    return Err(Missed {
                        end: WindowEnd::Earliest,
                        by: earliest - time,
                        is_only_link: false,
                    });
                }
                if let Some(latest) = latest.filter(|latest| time > latest) {
                    return Err(Missed {
                        end: WindowEnd::Latest,
                        by: time - latest,
                        is_only_link: false,
                    });
                }
                Ok(())
            }
            Self::Dispatchable(dispatcher) => {
                dispatcher.record(node, time).map_err(|missed| Missed {
                    end: missed.end,
                    by: missed.amount,
                    is_only_link: missed.is_only_link,
                })
            }
        }
    }

    /// Returns `true` if the network is still executable after a time point has happened outside
    /// the bounds of its link, and nothing else was violated.
    pub(crate) fn remains_executable_after(&self, node: NodeId, now: &Rational) -> bool {
        match self {
            Self::WholeNetwork(_) | Self::OneHop(_) => false,
            Self::Dispatchable(dispatcher) => dispatcher.stays_executable(node, now),
        }
    }

    /// Assumes that the running link that ends at a time point ends by `until`, or at any time.
    /// Returns `true` if the network is still executable.
    pub(crate) fn assume_end_by(
        &mut self,
        end: NodeId,
        until: Option<&Rational>,
        now: &Rational,
    ) -> bool {
        match self {
            Self::WholeNetwork(_) | Self::OneHop(_) => false,
            Self::Dispatchable(dispatcher) => {
                let link = dispatcher.form().network().ending_at(end);
                link.is_some_and(|link| dispatcher.extend_link(link, until, now))
            }
        }
    }

    /// Returns the latest end, at most `until`, that can be assumed for the running link that ends
    /// at a time point.
    pub(crate) fn latest_assumable_end(
        &self,
        end: NodeId,
        until: &Rational,
        now: &Rational,
    ) -> Option<Rational> {
        match self {
            Self::WholeNetwork(_) | Self::OneHop(_) => None,
            Self::Dispatchable(dispatcher) => {
                let link = dispatcher.form().network().ending_at(end)?;
                dispatcher.extendable_until(link, until, now)
            }
        }
    }

    /// Returns the causes of one end of a window, the one farthest from the node first.
    pub(crate) fn window_causes(&self, node: NodeId, end: WindowEnd) -> Vec<NetworkLimit> {
        match self {
            Self::WholeNetwork(windows) => windows
                .grounds(node, end)
                .map(|grounds| {
                    grounds
                        .constraints
                        .into_iter()
                        .map(NetworkLimit::Constraint)
                        .collect()
                })
                .unwrap_or_default(),
            Self::OneHop(one_hop) => {
                let grounds = one_hop.tightest_constraint(node, end).into_iter();
                grounds.map(NetworkLimit::Constraint).collect()
            }
            Self::Dispatchable(dispatcher) => link_or_window_causes(dispatcher, node, end),
        }
    }
}

/// Returns the causes of one end of a node's window, or of its link if that is tighter.
fn link_or_window_causes(
    dispatcher: &Dispatcher,
    node: NodeId,
    end: WindowEnd,
) -> Vec<NetworkLimit> {
    let (earliest, latest) = dispatcher.window(node);
    let (least, most) = dispatcher.bounds(node);
    let is_link = match end {
        WindowEnd::Earliest => least.as_ref() != earliest,
        WindowEnd::Latest => most.as_ref() != latest,
    };
    if is_link && let Some(link) = dispatcher.form().network().ending_at(node) {
        return vec![NetworkLimit::Link(link)];
    }
    let mut behind = constraints_of_steps(&dispatcher.implying_path(node, end));
    if end == WindowEnd::Earliest {
        // These lead from the node back to the cause.
        behind.reverse();
    }
    behind
}

/// Returns the parts of a network that justify these steps.
pub(crate) fn constraints_of_steps(steps: &[Step]) -> Vec<NetworkLimit> {
    let ground = |step: &Step| match step.ground {
        Ground::Requirement(id) => NetworkLimit::Constraint(id),
        Ground::Early(link) | Ground::Late(link) => NetworkLimit::Link(link),
    };
    steps.iter().map(ground).collect()
}

impl OneHop {
    fn window(&self, node: NodeId) -> TimeWindow {
        let time = |end| {
            self.tightest_constraint(node, end)
                .and_then(|id| self.limit(id, end))
        };
        (time(WindowEnd::Earliest), time(WindowEnd::Latest))
    }

    /// Returns the tightest constraint on one end of the window.
    fn tightest_constraint(&self, node: NodeId, end: WindowEnd) -> Option<ConstraintId> {
        let limit = |id| Some((self.limit(id, end)?, id));
        let most = match end {
            WindowEnd::Earliest => self.network.leaving(node).filter_map(limit).max(),
            WindowEnd::Latest => self.network.entering(node).filter_map(limit).min(),
        };
        most.map(|(_, id)| id)
    }

    /// Returns the bound that a constraint sets, if the time point at its other end has been
    /// executed.
    fn limit(&self, id: ConstraintId, end: WindowEnd) -> Option<Rational> {
        let Constraint { from, to, bound } = self.network.constraint(id);
        match end {
            WindowEnd::Earliest => Some(self.executed[to.index()].as_ref()? - bound),
            WindowEnd::Latest => Some(self.executed[from.index()].as_ref()? + bound),
        }
    }
}
