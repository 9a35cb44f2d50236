//! Checks, without any search, that a box is inside a robustness envelope, and that none is better; and
//! that a problem has no plan ([`no_plan`]).
//!
//! In: an answer of `elbowroom envelope --method best --json` ([`verify_answer`]), or its
//! [`Certificate`] alone ([`verify`]). Out: what it proves ([`Verified`]), or the first thing in it
//! that is not so ([`Flaw`]).
//!
//! A certificate holds the plan's temporal network, the box, *proofs* of linear inequalities that
//! all boxes inside the envelope satisfy (each a cycle of the network's bounds), and how it follows
//! from these that no box is better. The inequalities themselves are not in it: they are worked out
//! here from the proofs ([`row`]). And it holds the reason why the box is inside ([`sound`]): times,
//! rules for times or a closed network, by guarantee, and sums of bounds that refute each way in which
//! a condition of the plan could fail. So there is nothing to believe but
//!
//! - that the network and the conditions are those of the plan. With problem and plan,
//!   [`verify_answer_of`] (or [`verify_answer_of_network`]) derives both and assumes nothing about them (`derive`),
//! - the theorems that make the cycles conflicts (Vidal & Fargier 1999; Morris & Muscettola 2005;
//!   Morris 2006), and a closed network one that can be controlled (Morris & Muscettola 2005), and that
//!   a box inside the envelope has its sub-boxes there, too.
//!
//! What the network does not show, such as cuts by conditions on numbers, is in it as an assumption with
//! its reason in words; how many there are is part of the verdict.
//!
//! This crate knows exact numbers and what a planning problem means, and imports nothing that makes
//! networks or searches.
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
//! assert!(verified.inside.is_some_and(|inside| inside.is_proved()));
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
mod conditions;
mod control;
mod derive;
mod flaw;
mod given;
mod intervals;
mod network;
pub mod no_plan;
mod number;
mod probability;
pub mod row;
mod volume;

pub use answer::{
    AnswerError, Distributions, epsilon_of, verify_answer, verify_answer_in_world,
    verify_answer_of, verify_answer_of_network,
};
pub use bounds::Ends;
pub use certificate::{
    Case, Certificate, Chance, Constraint, End, Exact, Guarantee, Limit, Multiplier, Parameter,
    Part, Proof, Reasons, Shape, Source, Stopped, Sum, Term, Total, Touch, Way, sound,
};
pub use check::{Inside, Verified, added_up, verify};
pub use derive::{NotDerived, Plan};
pub use flaw::Flaw;
pub use given::{GivenConstraint, GivenInstance, GivenParameter, GivenPlan};
