//! Contents of a network file.

use elbowroom_num::Rational;
use elbowroom_stn::NodeId;
use elbowroom_stn::uncertain::{LinkId, UncertainNetwork};

/// Format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Nodes and constraints in JSON, as the HEATlab programs read and write them.
    Heatlab,
    /// Time points and constraints in JSON, with correlations, as PSTN-lib reads and writes them.
    PstnLib,
    /// GraphML, as the CSTNU Tool reads and writes it.
    GraphMl,
    /// Sections of plain text under headings that begin with `#`.
    Plain,
    /// DIMACS: lines that begin with `c`, `p` and `a`.
    Dimacs,
    /// For each node, a list of inequalities, in JSON.
    Inequalities,
    /// Elbowroom's own JSON format (`docs/reference/formats/network.md`).
    Elbowroom,
}

impl Format {
    /// Returns the format's name, for display.
    pub fn name(self) -> &'static str {
        match self {
            Self::Heatlab => "HEATlab JSON",
            Self::PstnLib => "PSTN-lib JSON",
            Self::GraphMl => "GraphML of the CSTNU Tool",
            Self::Plain => "plain STNU text",
            Self::Dimacs => "DIMACS text",
            Self::Inequalities => "inequalities in JSON",
            Self::Elbowroom => "Elbowroom JSON",
        }
    }
}

/// The distribution of a contingent link's duration, in the network's unit of time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Duration {
    /// Normal.
    Normal {
        /// The mean.
        mean: Rational,
        /// The standard deviation; not negative.
        deviation: Rational,
    },
    /// Uniform.
    Uniform {
        /// The least value.
        from: Rational,
        /// The greatest value.
        to: Rational,
    },
    /// Exponential with mean `mean`, shifted by `from`.
    Exponential {
        /// The least value.
        from: Rational,
        /// Mean of the exponential part; not negative.
        mean: Rational,
    },
    /// Gamma, shifted by `from`.
    Gamma {
        /// The least value.
        from: Rational,
        /// The shape; positive.
        shape: Rational,
        /// The scale; positive.
        scale: Rational,
    },
}

/// Group of correlated durations.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Correlation {
    /// The links, all of them normally distributed.
    pub links: Vec<LinkId>,
    /// Correlation matrix, row by row; entries between -1 and 1, and 1 in the diagonal.
    pub matrix: Vec<Vec<Rational>>,
}

/// Wait of a network in dispatchable form: once the link is activated, `node` waits until its end
/// has happened, but not longer than `delay` after the activation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenWait {
    /// The time point that waits.
    pub node: NodeId,
    /// The link whose end the time point waits for.
    pub link: LinkId,
    /// Longest wait; `None` if only the link's end can end it.
    pub delay: Option<Rational>,
}

/// The contents of a network file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NetworkFile {
    /// Format of the file.
    pub format: Format,
    /// The network's name; empty if it has none.
    pub name: String,
    /// The names of the time points, by [`NodeId`]; all are different.
    pub points: Vec<String>,
    /// Time point that serves as time zero, if the file has one.
    pub reference: Option<NodeId>,
    /// Requirements and contingent links.
    pub network: UncertainNetwork<Rational>,
    /// Distributions of the durations of the links, by [`LinkId`]; `None` if the file gives none.
    pub durations: Vec<Option<Duration>>,
    /// Groups of correlated durations.
    pub correlations: Vec<Correlation>,
    /// The waits of a network in dispatchable form.
    pub waits: Vec<GivenWait>,
    /// Remarks on parts of the file that were interpreted leniently, or left out.
    pub remarks: Vec<String>,
}

impl NetworkFile {
    /// Returns the name of a time point.
    pub fn point(&self, node: NodeId) -> &str {
        &self.points[node.index()]
    }

    /// Returns `true` if the network has no contingent links: a simple temporal network.
    pub fn is_certain(&self) -> bool {
        self.network.links().is_empty()
    }
}
