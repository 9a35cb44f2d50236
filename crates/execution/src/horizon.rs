//! How far an executor looks when it asks when a time point may happen.

use elbowroom_num::Rational;
use elbowroom_stn::{
    ConsistentNetwork, Constraint, ConstraintId, MovingWindows, Network, NodeId, WindowEnd,
};

/// The window of a time point, its ends `None` where they are infinite.
pub(crate) type Ends = (Option<Rational>, Option<Rational>);

/// When time points may happen, given those that have.
#[derive(Clone, Debug)]
pub(crate) enum Horizon {
    /// What follows from all constraints together.
    Whole(Box<MovingWindows>),
    /// What follows from each single constraint with a time point that has happened: what paper
    /// 1's dispatcher and `ROSPlan`'s see.
    OneHop(OneHop),
}

/// See [`Horizon::OneHop`].
#[derive(Clone, Debug)]
pub(crate) struct OneHop {
    network: Network,
    happened: Vec<Option<Rational>>,
}

/// A time that a window does not allow.
#[derive(Clone, Debug)]
pub(crate) struct Missed {
    /// The end that was missed.
    pub(crate) end: WindowEnd,
    /// By how much.
    pub(crate) by: Rational,
}

impl Horizon {
    pub(crate) fn whole(network: ConsistentNetwork) -> Self {
        Self::Whole(Box::new(MovingWindows::new(network, NodeId(0))))
    }

    pub(crate) fn one_hop(network: Network) -> Self {
        let mut happened = vec![None; network.node_count()];
        happened[0] = Some(Rational::ZERO);
        Self::OneHop(OneHop { network, happened })
    }

    pub(crate) fn network(&self) -> &Network {
        match self {
            Self::Whole(windows) => windows.network(),
            Self::OneHop(one_hop) => &one_hop.network,
        }
    }

    pub(crate) fn window(&self, node: NodeId) -> Ends {
        match self {
            Self::Whole(windows) => {
                let window = windows.window(node);
                (window.earliest.clone(), window.latest.clone())
            }
            Self::OneHop(one_hop) => one_hop.window(node),
        }
    }

    /// The node happens, or happened, at `time`. With [`Horizon::OneHop`] it does in any case.
    pub(crate) fn fix(&mut self, node: NodeId, time: &Rational) -> Result<(), Missed> {
        match self {
            Self::Whole(windows) => windows.fix(node, time).map_err(|out| Missed {
                end: out.end,
                by: out.by,
            }),
            Self::OneHop(one_hop) => {
                let (earliest, latest) = one_hop.window(node);
                one_hop.happened[node.index()] = Some(time.clone());
                if let Some(earliest) = earliest.filter(|earliest| time < earliest) {
                    return Err(Missed {
                        end: WindowEnd::Earliest,
                        by: earliest - time,
                    });
                }
                if let Some(latest) = latest.filter(|latest| time > latest) {
                    return Err(Missed {
                        end: WindowEnd::Latest,
                        by: time - latest,
                    });
                }
                Ok(())
            }
        }
    }

    /// From now on a constraint demands only `bound`, or nothing. Who looks one hop far goes by
    /// the bounds that the plan began with.
    pub(crate) fn loosen(&mut self, id: ConstraintId, bound: Option<Rational>) {
        if let Self::Whole(windows) = self {
            windows.loosen(id, bound);
        }
    }

    /// The constraints behind one end of a window, beginning far away from the node.
    pub(crate) fn grounds(&self, node: NodeId, end: WindowEnd) -> Vec<ConstraintId> {
        match self {
            Self::Whole(windows) => windows
                .grounds(node, end)
                .map(|grounds| grounds.constraints)
                .unwrap_or_default(),
            Self::OneHop(one_hop) => one_hop.grounds(node, end).into_iter().collect(),
        }
    }
}

impl OneHop {
    fn window(&self, node: NodeId) -> Ends {
        let time = |end| self.grounds(node, end).and_then(|id| self.limit(id, end));
        (time(WindowEnd::Earliest), time(WindowEnd::Latest))
    }

    /// The constraint that says most about one end of the window.
    fn grounds(&self, node: NodeId, end: WindowEnd) -> Option<ConstraintId> {
        let limit = |id| Some((self.limit(id, end)?, id));
        let most = match end {
            WindowEnd::Earliest => self.network.leaving(node).filter_map(limit).max(),
            WindowEnd::Latest => self.network.entering(node).filter_map(limit).min(),
        };
        most.map(|(_, id)| id)
    }

    /// What one constraint says, if the time point at its other end has happened.
    fn limit(&self, id: ConstraintId, end: WindowEnd) -> Option<Rational> {
        let Constraint { from, to, bound } = self.network.constraint(id);
        match end {
            WindowEnd::Earliest => Some(self.happened[to.index()].as_ref()? - bound),
            WindowEnd::Latest => Some(self.happened[from.index()].as_ref()? + bound),
        }
    }
}
