//! Elbowroom: what a planning problem means, and the judge.
