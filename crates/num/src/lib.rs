//! Exact numbers: rationals, bounds with infinities, intervals.
//!
//! Everything that decides whether a plan is sound is computed with [`Rational`], so that a
//! guarantee never hangs on a rounding error. Small numbers (numerator and denominator in an
//! `i64`) take a fast path without allocation; anything larger is kept exactly as well.
//!
//! - [`Rational`]: an exact fraction.
//! - [`Delta`]: a rational plus a multiple of an infinitesimal, to treat `<` like `<=`.
//! - [`CommonDenominator`]: the unit in which given fractions are whole numbers.
//! - [`Total`]: a sum of many products.
//! - [`Interval`]: a set of rationals between two ends, each closed, open or infinite.
//! - [`enclosed`]: logarithms, powers of e and the normal distribution, between two fractions.
//! - [`chance`]: how likely a random number lies in an interval, and linear bounds on the logarithm
//!   of that.
//! - [`simplex`]: systems of linear inequalities, decided and optimised exactly, with proofs.
//! - [`work`]: how much work was done, counted in the same way on every machine.
//!
//! No planning word occurs in this crate.
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

pub mod chance;
mod delta;
mod denominator;
pub mod enclosed;
mod interval;
mod rational;
pub mod simplex;
mod total;
pub mod work;

pub use delta::Delta;
pub use denominator::CommonDenominator;
pub use interval::{End, Interval, Side};
pub use rational::{ParseRationalError, Rational};
pub use total::Total;
