//! Methods of searching for an envelope.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Method of searching for an envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Method {
    /// One end of the box at a time is moved out: [`irr`](crate::irr()).
    Irr,
    /// The largest box by some objective, with a proof: [`best`](crate::best()).
    Best,
}

impl Method {
    /// Its name in documents and on the command line.
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
