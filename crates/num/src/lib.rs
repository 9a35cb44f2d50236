//! Exact numbers: rationals, bounds with infinities, intervals.
//!
//! Every decision about the soundness of a plan is computed with [`Rational`], so that no guarantee
//! depends on a rounding error. Small numbers (numerator and denominator in an `i64`) take a fast
//! path without allocation. Larger numbers are also exact.
//!
//! - [`Rational`]: an exact fraction.
//! - [`Delta`]: a rational plus a multiple of an infinitesimal, to treat `<` like `<=`.
//! - [`CommonDenominator`]: the unit that makes given fractions whole numbers.
//! - [`Accumulator`]: a sum of many products.
//! - [`Interval`]: a set of rationals between two ends, each closed, open or infinite.
//! - [`enclosures`]: logarithms, powers of e and the normal distribution, between two fractions.
//! - [`log_concave`]: the probability that a random number lies in an interval, and linear bounds on its
//!   logarithm.
//! - [`simplex`]: systems of linear inequalities, decided and optimised exactly, with proofs.
//! - [`work`]: deterministic count of the work done, the same on every machine.
//!
//! This crate contains no planning concepts.
//!
//! ```
//! use elbowroom_num::Rational;
//!
//! let third: Rational = "1/3".parse()?;
//! let sum = &third + &third + &third;
//! assert_eq!(sum, Rational::ONE);
//! assert_eq!("53.8888".parse::<Rational>()?.to_string(), "67361/1250");
//! # Ok::<(), elbowroom_num::ParseRationalError>(())
//! ```

mod accumulator;
mod delta;
mod denominator;
pub mod enclosures;
mod interval;
pub mod log_concave;
mod rational;
pub mod simplex;
mod terms;
pub mod work;

pub use accumulator::Accumulator;
pub use delta::Delta;
pub use denominator::CommonDenominator;
pub use interval::{End, Interval, Side};
pub use rational::{ParseRationalError, Rational};
