//! Checks, without any search, that a box is inside a robustness envelope and that no box is
//! better, and that a problem has no plan ([`no_plan`]).
//!
//! Input: an answer of `elbowroom envelope --method best --json` ([`verify_answer`]), or its
//! [`Certificate`] alone ([`verify`]). Output: the verified claim ([`Verified`]), or the first flaw
//! ([`Flaw`]).
//!
//! A certificate contains the plan's temporal network, the box, *proofs* of linear inequalities
//! that all boxes inside the envelope satisfy (each a cycle of the network's bounds), and a
//! derivation from these inequalities that no box is better. It does not contain the inequalities
//! themselves: this crate computes them from the proofs ([`row`]). It also contains a proof that
//! the box is inside ([`sound`]): times, rules for times or a closed network, depending on the
//! guarantee, and sums of bounds that refute each possible violation of a condition of the plan.
//! The verdict relies on two assumptions:
//!
//! - The network and the conditions are those of the plan. With problem and plan,
//!   [`verify_answer_of`] (or [`verify_answer_of_network`]) derives both and assumes nothing about
//!   them (`derive`).
//! - The theorems about such networks hold: the cycles are conflicts (Vidal & Fargier 1999; Morris
//!   & Muscettola 2005; Morris 2006), a closed network is controllable (Morris & Muscettola 2005),
//!   and every sub-box of a box inside the envelope is inside as well.
//!
//! Facts that the network does not show, such as cuts by conditions on numbers, are assumptions in
//! the certificate, with their reasons in words. The verdict includes their number.
//!
//! This crate depends on exact numbers and on the semantics of planning problems. It imports no
//! crate that builds networks or searches.
//!
//! Example: work of 10 seconds has to end while a light is on, for 5 seconds. By how much may both
//! deviate if no duration is known in advance? By 20 %: the certificate contains the cycle of
//! bounds that would be negative for more.
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
mod faults;
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
pub use bounds::EndExpression;
pub use certificate::{
    Case, Certificate, Chance, Constraint, End, Exact, Guarantee, Limit, Multiplier, Parameter,
    Part, Path, Proof, Reasons, Shape, Source, Stopped, Sum, Term, Total, Touch, sound,
};
pub use check::{InsideCheck, Verified, verify, with_sums};
pub use derive::{NotDerived, Plan};
pub use faults::{FaultsError, VerifiedFaults, verify_faults};
pub use flaw::Flaw;
pub use given::{GivenConstraint, GivenInstance, GivenParameter, GivenPlan};
