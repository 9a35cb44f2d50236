//! Time windows of the happenings of a plan in a trace.

use std::collections::BTreeMap;

use elbowroom::answers::Exact;
use elbowroom::answers::envelope::timeline::WindowAnswer;
use elbowroom::num::Rational;
use elbowroom::report::schema::{BoundLine, NetworkLine, ParameterLine};
use elbowroom::stn::{ConsistentNetwork, Constraint, Network, NodeId};

/// Time windows of a plan's nodes, over all values in its envelope.
pub(super) struct Windows<'a> {
    nodes: BTreeMap<&'a str, NodeId>,
    windows: elbowroom::stn::Windows,
}

impl<'a> Windows<'a> {
    /// Computes the windows; `None` if the plan has no schedule.
    pub(super) fn of(network: &'a NetworkLine, parameters: &[ParameterLine]) -> Option<Self> {
        let mut nodes: BTreeMap<&str, NodeId> = BTreeMap::from([(".zero", NodeId(0))]);
        for constraint in &network.constraints {
            for name in [&constraint.from, &constraint.to] {
                let next = NodeId(u32::try_from(nodes.len()).ok()?);
                nodes.entry(name).or_insert(next);
            }
        }
        let intervals: BTreeMap<&str, &ParameterLine> =
            parameters.iter().map(|it| (it.name.as_str(), it)).collect();
        let bound = |bound: &Option<BoundLine>, is_lower: bool| -> Option<Rational> {
            match bound.as_ref()? {
                BoundLine::Number(number) => Some(number.0.clone()),
                BoundLine::Parameter { parameter } => {
                    let parameter = intervals.get(parameter.as_str())?;
                    let nominal = Some(&parameter.nominal);
                    let (lower, upper) = match &parameter.envelope {
                        Some((lower, upper)) => (lower.as_ref(), upper.as_ref()),
                        None => (nominal, nominal),
                    };
                    if is_lower { lower } else { upper }.map(|it| it.0.clone())
                }
            }
        };
        let mut relaxed = Network::with_nodes(nodes.len());
        for &node in nodes.values().filter(|node| node.0 != 0) {
            relaxed.add(Constraint::at_least(NodeId(0), node, Rational::ZERO));
        }
        for constraint in &network.constraints {
            let (from, to) = (
                nodes[constraint.from.as_str()],
                nodes[constraint.to.as_str()],
            );
            if let Some(lower) = bound(&constraint.lower, true) {
                relaxed.add(Constraint::at_least(from, to, lower));
            }
            if let Some(upper) = bound(&constraint.upper, false) {
                relaxed.add(Constraint::at_most(from, to, upper));
            }
        }
        let windows = ConsistentNetwork::try_from(relaxed)
            .ok()?
            .windows(NodeId(0));
        Some(Self { nodes, windows })
    }

    /// Returns the window of a node, in the world's time.
    pub(super) fn at(&self, node: &str, origin: &Rational) -> WindowAnswer {
        let Some(&node) = self.nodes.get(node) else {
            return WindowAnswer::default();
        };
        let window = &self.windows[node];
        let shifted = |time: &Option<Rational>| time.as_ref().map(|it| Exact(origin + it));
        WindowAnswer {
            earliest: shifted(&window.earliest),
            latest: shifted(&window.latest),
        }
    }
}
