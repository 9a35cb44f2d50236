//! A network as a file describes it.

use elbowroom_num::Rational;
use elbowroom_stn::NodeId;
use elbowroom_stn::uncertain::{LinkId, UncertainNetwork};

/// In which format a file is written.
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
    /// JSON of our own (`docs/formats/network.md`).
    Elbowroom,
}

impl Format {
    /// The format's name, for people.
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
    /// Bell-shaped.
    Normal {
        /// The mean.
        mean: Rational,
        /// The standard deviation; not negative.
        deviation: Rational,
    },
    /// All values alike.
    Uniform {
        /// From here.
        from: Rational,
        /// To here.
        to: Rational,
    },
    /// `from` and what an exponential distribution of mean `mean` adds.
    Exponential {
        /// The least value.
        from: Rational,
        /// The mean of what comes on top; not negative.
        mean: Rational,
    },
    /// `from` and what a gamma distribution adds.
    Gamma {
        /// The least value.
        from: Rational,
        /// The shape; positive.
        shape: Rational,
        /// The scale; positive.
        scale: Rational,
    },
}

/// Durations that tend to be long together, or short.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Correlation {
    /// The links, all of them normally distributed.
    pub links: Vec<LinkId>,
    /// Row by row, how much each two of them correlate; between -1 and 1, 1 in the diagonal.
    pub matrix: Vec<Vec<Rational>>,
}

/// Once the link is activated, `node` waits until its end has happened, but not longer than
/// `delay` after the activation; part of networks in dispatchable form.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenWait {
    /// The time point that waits.
    pub node: NodeId,
    /// The link whose end it waits for.
    pub link: LinkId,
    /// For how long at most; `None` if there is no other way than the link's end.
    pub delay: Option<Rational>,
}

/// The contents of a network file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NetworkFile {
    /// How it is written.
    pub format: Format,
    /// The network's name; empty if it has none.
    pub name: String,
    /// The names of the time points, by [`NodeId`]; no two are the same.
    pub points: Vec<String>,
    /// The time point from which times count, where the file has one.
    pub reference: Option<NodeId>,
    /// Requirements and contingent links.
    pub network: UncertainNetwork<Rational>,
    /// How the durations of the links are distributed, by [`LinkId`]; `None` if the file does not
    /// say.
    pub durations: Vec<Option<Duration>>,
    /// Which durations correlate.
    pub correlations: Vec<Correlation>,
    /// The waits of a network in dispatchable form.
    pub waits: Vec<GivenWait>,
    /// Remarks on parts of the file that were interpreted leniently, or left out.
    pub remarks: Vec<String>,
}

impl NetworkFile {
    /// The name of a time point.
    pub fn point(&self, node: NodeId) -> &str {
        &self.points[node.index()]
    }

    /// Whether the world decides nothing: a simple temporal network.
    pub fn is_certain(&self) -> bool {
        self.network.links().is_empty()
    }
}
