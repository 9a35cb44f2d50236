//! Texts, places in them, and diagnostics, for the readers of all text formats.
//!
//! The input is a text with the name of its file, a [`Source`]. The reader records its findings in
//! a [`Report`]. The output is the value, with warnings, or [`Diagnostics`]: each one states the
//! problem, its place, and the remedy. All readers share one appearance on the terminal
//! ([`Diagnostic::render`]) and one form for programs ([`Record`], which serializes to JSON).
//!
//! The crate knows no file format but TOML (feature `toml`), opens no files, and prints nothing.
//!
//! ```
//! use elbowroom_text::{Report, Source, nearest};
//!
//! let source = Source::new("shop.txt", "tea 3\nmlik 2\n");
//! let mut report = Report::new(&source);
//! let known = ["tea", "milk"];
//! for word in ["tea", "mlik"] {
//!     if !known.contains(&word) {
//!         let start = source.text().find(word).expect("it stands in the text");
//!         report
//!             .error(start..start + word.len(), format!("unknown product `{word}`"))
//!             .suggest(nearest(word, known));
//!     }
//! }
//! let diagnostics = report.finish(Some(())).unwrap_err();
//! assert_eq!(
//!     diagnostics.to_string(),
//!     "shop.txt:2:1: error: unknown product `mlik`; did you mean `milk`?"
//! );
//! ```

mod diagnostic;
mod record;
mod render;
mod report;
mod source;
mod suggest;
#[cfg(feature = "toml")]
pub mod toml;

pub use diagnostic::{Diagnostic, Diagnostics, Label, Severity};
pub use record::{Record, RecordLabel};
pub use report::Report;
pub use source::{Source, Span};
pub use suggest::nearest;
