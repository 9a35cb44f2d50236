//! Checks, without any search, that no box inside a robustness envelope is better than one.
//!
//! In: an answer of `elbowroom envelope --method best --json` ([`verify_answer`]), or its
//! [`Certificate`] alone ([`verify`]). Out: what it proves ([`Verified`]), or the first thing in it
//! that is not so ([`Flaw`]).
//!
//! A certificate holds the plan's temporal network, the box, *proofs* of linear inequalities that
//! all boxes inside the envelope satisfy (each a cycle of the network's bounds), and how it follows
//! from these that no box is better. The inequalities themselves are not in it: they are worked out
//! here from the proofs ([`row`]), so that there is nothing to believe but
//!
//! - that the network is that of the plan,
//! - the theorems that make the cycles conflicts (Vidal & Fargier 1999; Morris & Muscettola 2005;
//!   Morris 2006), and that a box inside the envelope has its sub-boxes there, too.
//!
//! What the network does not show, such as conditions on numbers, is in it as an assumption with
//! its reason in words; how many there are is part of the verdict. That the box itself is inside
//! the envelope is not what a certificate proves: `elbowroom envelope --contains` checks that.
//!
//! This crate knows exact numbers, and nothing of planning, networks or search.
//!
//! Work of 10 seconds has to end while a light burns, for 5. How far may both deviate if nobody
//! knows in advance how long they take? By 20 %, and the certificate has the cycle of bounds that
//! would be negative if it were more.
//!
//! ```
//! use elbowroom_verify::{AnswerError, verify_answer};
//!
//! let answer = include_str!("../examples/lamp.json");
//! let verified = verify_answer(answer)?;
//! assert_eq!(verified.value, verified.bound, "no box is better than this one");
//! assert_eq!((verified.proofs, verified.assumed), (1, 0));
//!
//! let forged = answer.replace("2499/12500", "1/4");
//! assert!(matches!(verify_answer(&forged), Err(AnswerError::Flaw(_))));
//! # Ok::<(), AnswerError>(())
//! ```

mod answer;
mod bounds;
mod certificate;
mod chance;
mod check;
mod claim;
mod flaw;
mod network;
mod number;
mod probability;
pub mod row;
mod volume;

pub use answer::{AnswerError, verify_answer};
pub use bounds::Ends;
pub use certificate::{
    Case, Certificate, Chance, Constraint, End, Exact, Guarantee, Limit, Multiplier, Parameter,
    Part, Proof, Reasons, Shape, Source, Stopped, Sum, Term, Total, Touch, Way,
};
pub use check::{Verified, added_up, verify};
pub use flaw::Flaw;
