//! Other forms of a network, as separate networks.

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{ContingentLink, Dispatchable, UncertainNetwork};
use elbowroom_stn::{ConsistentNetwork, Constraint, NegativeCycle, Network};

use crate::file::{Format, GivenWait, NetworkFile};

impl NetworkFile {
    /// Returns the requirements and the bounds of links, as if the executor chose all durations.
    /// Constraints of links follow the requirements, for each link first the upper bound, if there
    /// is one, and then the lower one.
    pub fn kind_network(&self) -> Network<Rational> {
        let mut network = self.network.requirements().clone();
        for link in self.network.links() {
            if let Some(upper) = &link.upper {
                network.add(Constraint::at_most(
                    link.activation,
                    link.end,
                    upper.clone(),
                ));
            }
            let lower = link.lower.clone();
            network.add(Constraint::at_least(link.activation, link.end, lower));
        }
        network
    }

    /// Returns the network with all implied bounds, as tight as possible; links are kept.
    ///
    /// # Errors
    /// If the network is inconsistent.
    pub fn minimal(&self) -> Result<Self, NegativeCycle<Rational>> {
        let minimal = ConsistentNetwork::try_from(self.kind_network())?.minimal();
        let requirements = self.network.requirements();
        let mut tight = Network::with_nodes(requirements.node_count());
        for from in requirements.nodes() {
            for to in requirements.nodes().filter(|&to| to != from) {
                if let Some(bound) = minimal.distance(from, to) {
                    tight.add(Constraint::at_most(from, to, bound.clone()));
                }
            }
        }
        Ok(self.with(tight, Vec::new()))
    }

    /// Returns the network's dispatchable form, waits included.
    #[must_use]
    pub fn dispatchable(&self, form: &Dispatchable<Rational>) -> Self {
        let mut network = Network::with_nodes(self.points.len());
        for edge in form.edges() {
            let bound = edge.bound.clone();
            network.add(Constraint::at_most(edge.from, edge.to, bound));
        }
        let waits = form.waits().map(|(_, wait)| GivenWait {
            node: wait.node,
            link: wait.link,
            delay: wait.delay.clone(),
        });
        self.with(network, waits.collect())
    }

    /// Returns the network in whole numbers, as most programs require them, and the number of its
    /// units per unit of this network. Links with a single possible duration become requirements,
    /// because most programs require a positive width. `None` if a number becomes too large.
    ///
    /// Distributions of durations and waits are left out.
    pub fn in_whole_numbers(&self) -> Option<(Self, Rational)> {
        let whole = self.network.to_integer_network()?;
        let factor = whole.unit.to_fraction(1).reciprocal()?;
        let mut requirements = Network::with_nodes(self.points.len());
        for constraint in whole.network.requirements().constraints() {
            let bound = Rational::from(constraint.bound);
            requirements.add(Constraint::at_most(constraint.from, constraint.to, bound));
        }
        let mut links = Vec::new();
        for link in whole.network.links() {
            let (begin, end, lower) = (link.activation, link.end, Rational::from(link.lower));
            if link.upper == Some(link.lower) {
                requirements.add(Constraint::at_most(begin, end, lower.clone()));
                requirements.add(Constraint::at_least(begin, end, lower));
                continue;
            }
            links.push(ContingentLink {
                activation: begin,
                end,
                lower,
                upper: link.upper.map(Rational::from),
            });
        }
        let file = Self {
            format: Format::Elbowroom,
            durations: vec![None; links.len()],
            network: UncertainNetwork::new(requirements, links)
                .expect("the links are some of a network"),
            correlations: Vec::new(),
            waits: Vec::new(),
            remarks: Vec::new(),
            ..self.clone()
        };
        Some((file, factor))
    }

    /// Returns the same points and links with other requirements.
    fn with(&self, requirements: Network<Rational>, waits: Vec<GivenWait>) -> Self {
        let links = self.network.links().to_vec();
        Self {
            format: Format::Elbowroom,
            network: UncertainNetwork::new(requirements, links)
                .expect("the links are those of a network"),
            waits,
            remarks: Vec::new(),
            ..self.clone()
        }
    }
}
