//! Networks in whole numbers, for which the searches are several times faster, and equally exact.

use elbowroom_num::{CommonDenominator, Rational};

use super::dispatchable::Dispatchable;
use super::graph::Graph;
use super::{Conflict, ContingentLink, UncertainNetwork};
use crate::{Constraint, Network};

/// Network whose bounds are multiplied by a common denominator.
#[derive(Clone, Debug)]
pub struct IntegerNetwork {
    /// The network in these numbers.
    pub network: UncertainNetwork<i64>,
    /// The unit.
    pub unit: Unit,
}

/// The unit of the whole numbers of a [`IntegerNetwork`].
#[derive(Clone, Copy, Debug)]
pub struct Unit {
    denominator: CommonDenominator,
    /// The largest bound, so that no sum overflows.
    largest: i64,
}

impl Unit {
    /// Converts a number to units; `None` if the result is not a whole number, or is so large that
    /// sums might overflow.
    pub fn to_integer(self, number: &Rational) -> Option<i64> {
        let whole = self.denominator.to_integer(number)?;
        (-self.largest..=self.largest)
            .contains(&whole)
            .then_some(whole)
    }

    /// Converts a number of units to a fraction.
    pub fn to_fraction(self, whole: i64) -> Rational {
        self.denominator.to_fraction(whole)
    }
}

impl UncertainNetwork<Rational> {
    /// Converts the network to whole numbers; `None` if sums of these numbers might overflow.
    pub fn to_integer_network(&self) -> Option<IntegerNetwork> {
        let unit = self.unit()?;
        let mut requirements = Network::with_nodes(self.requirements.node_count());
        for constraint in self.requirements.constraints() {
            requirements.add(Constraint {
                from: constraint.from,
                to: constraint.to,
                bound: unit.to_integer(&constraint.bound)?,
            });
        }
        let link = |link: &ContingentLink| {
            Some(ContingentLink {
                activation: link.activation,
                end: link.end,
                lower: unit.to_integer(&link.lower)?,
                upper: match &link.upper {
                    Some(upper) => Some(unit.to_integer(upper)?),
                    None => None,
                },
            })
        };
        let network = UncertainNetwork {
            requirements,
            links: self.links.iter().map(link).collect::<Option<_>>()?,
            ending: self.ending.clone(),
        };
        Some(IntegerNetwork { network, unit })
    }

    fn unit(&self) -> Option<Unit> {
        self.unit_with([])
    }

    /// Returns a unit for sums of these times and the bounds.
    pub(super) fn unit_with<'a>(
        &'a self,
        times: impl IntoIterator<Item = &'a Rational>,
    ) -> Option<Unit> {
        let bounds = self.requirements.constraints().iter();
        let bounds = bounds.map(|constraint| &constraint.bound);
        let bounds = bounds.chain(self.links.iter().map(|link| &link.lower));
        let bounds = bounds.chain(self.links.iter().filter_map(|link| link.upper.as_ref()));
        let denominator = CommonDenominator::of(bounds.chain(times))?;
        // A path in the search is no longer than one bound, or with infinite bounds, one for each
        // node. A conflict has at most one such path for each node.
        let nodes = i64::try_from(self.requirements.node_count()).ok()? + 2;
        let ways = if self.links.iter().any(|link| link.upper.is_none()) {
            nodes.checked_mul(nodes)?
        } else {
            nodes
        };
        Some(Unit {
            denominator,
            largest: (i64::MAX / 2) / ways,
        })
    }

    /// Like [`dynamic`](Self::dynamic), but computes in whole numbers if possible.
    ///
    /// # Errors
    /// The cycle that shows that the network is not dynamically controllable.
    pub fn dispatchable(&self) -> Result<Dispatchable<Rational>, Conflict> {
        let graph = self.search_graph(true)?;
        Ok(Dispatchable::new(self.clone(), graph))
    }

    /// Like [`executable`](Self::executable), but computes in whole numbers if possible, and moves
    /// the network into the form.
    ///
    /// # Errors
    /// The network, and the cycle that shows that it is not dynamically controllable.
    #[allow(clippy::result_large_err, reason = "the network is given back")]
    pub fn into_executable(self) -> Result<Dispatchable<Rational>, (Self, Conflict)> {
        match self.search_graph(false) {
            Ok(graph) => Ok(Dispatchable::new(self, graph)),
            Err(conflict) => Err((self, conflict)),
        }
    }

    /// Like [`conflict`](Self::conflict), but computes in whole numbers if possible. The check
    /// takes much less time than the dispatchable form.
    ///
    /// # Errors
    /// The cycle that shows that the network is not dynamically controllable.
    pub fn check_controllability(&self) -> Result<(), Conflict> {
        self.search_in_whole_numbers(false, false).map(|_| ())
    }

    fn search_graph(&self, is_full: bool) -> Result<Graph<Rational>, Conflict> {
        self.search_in_whole_numbers(true, is_full)
    }

    /// Like [`search`](Self::search), but computes in whole numbers if possible.
    fn search_in_whole_numbers(
        &self,
        keeps_edges: bool,
        is_full: bool,
    ) -> Result<Graph<Rational>, Conflict> {
        let Some(whole) = self.to_integer_network() else {
            return self.search(keeps_edges, is_full);
        };
        let fraction = |number: i64| whole.unit.to_fraction(number);
        let found = whole.network.search(keeps_edges, is_full);
        found
            .map(|graph| graph.map(fraction))
            .map_err(|conflict| conflict.map(fraction))
    }
}
