//! Methods of searching for an envelope.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Method of searching for an envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Method {
    /// Moves out one end of the box at a time: [`irr`](crate::irr()).
    Irr,
    /// Finds the largest box by an objective, with a proof: [`best`](crate::best()).
    Best,
}

impl Method {
    /// Returns its name in documents and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Irr => "irr",
            Self::Best => "best",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
