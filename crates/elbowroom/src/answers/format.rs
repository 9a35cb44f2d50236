//! The version of documents.

use serde::{Deserialize, Serialize};

/// The version of a document, 1. Within it, members are added but never changed or removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub struct Version;

impl From<Version> for u32 {
    fn from(Version: Version) -> Self {
        1
    }
}

/// The unsupported version of a document.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unsupported version {0} of this document, expected version 1")]
pub struct UnknownVersion(pub u32);

impl TryFrom<u32> for Version {
    type Error = UnknownVersion;

    fn try_from(number: u32) -> Result<Self, UnknownVersion> {
        match number {
            1 => Ok(Self),
            other => Err(UnknownVersion(other)),
        }
    }
}
