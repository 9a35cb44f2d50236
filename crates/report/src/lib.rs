//! Records of runs: traces, statistics, tables and plots. Text in and out; no files.
//!
//! - [`trace`]: the record of a run as JSON Lines (`docs/reference/formats/trace.md`), and a world that plays
//!   a stored one back.
//! - [`validation`]: validation of a recorded run, entry by entry.
//! - [`wire`]: commands and observations as JSON, for traces and for worlds that are processes
//!   (`docs/reference/formats/world-protocol.md`).
//! - [`exact`]: exact numbers in JSON.
//! - [`statistics`]: proportions with Wilson's intervals, means.
//! - [`table`]: tables as Markdown, CSV, or text for a terminal.
//! - [`plot`]: plots of values with intervals, as SVG.
//! - [`console`]: texts for consoles, with the table of tolerances.
//! - [`decimal`]: exact numbers as decimals.
//! - [`lattice`]: a picture of the orders of a plan, as SVG.
//! - [`plane`]: a picture of areas and boxes over two quantities, as SVG.
//!
//! ```
//! use elbowroom_report::table::Table;
//!
//! let table = Table {
//!     caption: "Success".to_owned(),
//!     headings: vec!["executor".to_owned(), "success %".to_owned()],
//!     keys: 1,
//!     rows: vec![vec!["guarded".to_owned(), "95".to_owned()]],
//!     notes: Vec::new(),
//! };
//! assert_eq!(table.csv(), "executor,success %\r\nguarded,95\r\n");
//! ```

pub mod console;
pub mod decimal;
pub mod exact;
pub mod lattice;
pub mod plane;
pub mod plot;
pub mod schema;
pub mod statistics;
mod svg;
pub mod table;
pub mod trace;
pub mod validation;
pub mod wire;
