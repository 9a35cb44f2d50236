//! Estimation of a world's behaviour from logs: durations, start delays, failure rates, their
//! drift, and prediction intervals.
//!
//! - [`records`]: attempts to execute actions, from traces of runs; [`table`]: the same from CSV.
//! - [`survival`], [`fit`]: distributions from right-censored samples, whose actions were cancelled
//!   or failed. Without these samples, slow actions would seem fast.
//! - [`changes`]: rates at which facts change by themselves, per second.
//! - [`learn`]: grouping of actions and their distributions; [`world`]: the result as a world file.
//! - [`conformal`]: intervals that contain the next value with a stated probability, for any
//!   distribution.
//! - [`drift`]: detection of changes in the distribution of values.
//!
//! ```
//! use elbowroom_learning::learn::{Settings, learn};
//! use elbowroom_learning::{table, world};
//!
//! let log = "action,start,end,outcome,planned
//! (drive a b),0,10,succeeded,10
//! (drive b a),12,33,succeeded,20
//! (drive a b),40,44,cancelled,10
//! (drive a b),50,61,succeeded,10
//! ";
//! let records = table::read(&log.into())?;
//! let settings = Settings::default();
//! let learnt = learn(&records, &settings);
//! assert_eq!(learnt[0].name, "drive");
//! let world = world::write(&learnt, &[], settings.resolution);
//! assert!(world.contains("relative = true"));
//! # Ok::<(), elbowroom_text::Diagnostics>(())
//! ```

pub mod changes;
pub mod conformal;
pub mod drift;
pub mod fit;
pub mod learn;
pub mod records;
pub mod survival;
pub mod table;
pub mod world;
