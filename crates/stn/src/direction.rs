//! Direction of paths: along edges, or against them ([`Direction`]).

/// The direction of shortest paths: from one node, or to one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// The paths begin at the root: distances bound `node - root`.
    FromRoot,
    /// The paths end at the root: distances bound `root - node`.
    ToRoot,
}
