//! What logs of executed plans say about the world: how long actions take, how late they start, how
//! often they fail, whether that changes, and within which limits the next run will stay.
//!
//! - [`records`]: attempts to execute actions, from traces of runs; [`table`]: the same from CSV.
//! - [`survival`], [`fit`]: distributions from samples of which some were cut off, because the
//!   action was cancelled or failed (right-censored); leaving these out would make slow actions
//!   look quick.
//! - [`changes`]: how often facts change by themselves, per second.
//! - [`learn`]: which actions are described together, and by what; [`world`]: the result as a world
//!   file.
//! - [`conformal`]: intervals that hold the next value with a stated probability, whatever its
//!   distribution.
//! - [`drift`]: an alarm when values no longer come from where they came from.
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
