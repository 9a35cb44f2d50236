//! The command `elbowroom`.

fn main() {}
