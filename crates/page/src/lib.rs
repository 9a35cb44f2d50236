//! Plans, runs and experiments as self-contained HTML pages.
//!
//! The input is an answer as a document, the trace of a run, or the results of an experiment. The
//! output is one HTML file that contains its style, script and data, and needs no network. The
//! crate uses no files, no clock and no command line, and the same input gives the same bytes.
//!
//! Displayed values are computed here from exact numbers; the script draws, filters and moves
//! through time. The script also decides if a plan works with the values of the sliders, in integer
//! arithmetic (`script/points.js`). Names and other external texts are data: they are embedded in a
//! block of JSON, and the script displays them as text only.
//!
//! - [`document`](mod@document): the content of a page, as data.
//! - `plan`, `region`, `run`, `experiment`, `perturbed`: from answers, traces and results to
//!   documents.
//! - `lanes`: assignment of actions to the lanes of a chart.
//! - `operator`: the page of an executive for its operator.
//! - `html`: the document as a file.
//! - `perfetto`, `mcap`: a run for other viewers.
//!
//! ```
//! # fn main() -> Result<(), elbowroom_page::PageError> {
//! let answer = r#"{
//!     "format": "elbowroom-run", "version": 1, "verdict": "goal-reached", "why": null,
//!     "time": { "exact": "7/2", "decimal": 3.5 }, "replans": 0, "reasons": [], "dead_end": [],
//!     "starts": 1, "executed": [{
//!         "start": { "exact": "0", "decimal": 0.0 }, "action": "(wave rover)",
//!         "duration": { "exact": "7/2", "decimal": 3.5 }, "ticket": 0, "outcome": "succeeded" }]
//! }"#;
//! let page = elbowroom_page::page("outcome.json", answer)?;
//! assert!(page.contains("The goal was reached at 3.5"));
//! # Ok(())
//! # }
//! ```

mod clock;
pub mod document;
mod experiment;
mod html;
mod lanes;
mod mcap;
mod operator;
mod perfetto;
mod perturbed;
mod plan;
mod region;
mod run;
mod state_timeline;

use elbowroom::answers::{EnvelopeAnswer, PlanAnswer, RegionAnswer, RunAnswer};
use elbowroom::execute::RunSpec;
use elbowroom::report::trace::Stored;
use elbowroom_laboratory::answer::FailurePosition;
use elbowroom_laboratory::compare::TimedCounts;
use elbowroom_laboratory::perturbed::{StoredTrial, UntimedCounts};
use elbowroom_laboratory::results::{Counts as _, Results};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use document::Document;
use experiment::Trials;

pub use lanes::lanes_of_actions;
pub use operator::operator_page;

/// Error of the conversion of a text to a page.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PageError {
    /// The text has no known format.
    #[error(
        "{0} has none of the formats for pages: the trace of a run (`run --trace`), an answer \
         (`envelope --json`, `plan --json`, `run --json`), or the results of an experiment \
         (`results.json` of `compare`)"
    )]
    Unknown(String),
    /// The text is a document of this program, but there are no pages for its format.
    #[error(
        "{name} is a document of the format {format}; pages are made from traces (`run --trace`), \
         from the answers of `envelope`, `plan` and `run`, and from the results of `compare`"
    )]
    OtherFormat {
        /// The name of the text.
        name: String,
        /// The format stated in the text.
        format: String,
    },
    /// The text is not a trace of a run.
    #[error("{0} is not the trace of a run (`run --trace`); other viewers accept only traces")]
    NoRun(String),
    /// The text states a supported format, but is damaged or has another version.
    #[error("{name} cannot be read: {why}")]
    Damaged {
        /// The name of the text.
        name: String,
        /// The error.
        why: String,
    },
}

/// Returns the page of an answer, a trace or results as an HTML file. `name` is the name of the
/// text, for example its file.
///
/// # Errors
/// If the text is none of these, or damaged.
pub fn page(name: &str, text: &str) -> Result<String, PageError> {
    Ok(html::html(&document(name, text)?))
}

/// Returns the page of the results of an experiment, which contains the traces of some failed
/// trials. A trial is given by its row, its column and the position of its kind of failure among
/// the most frequent ones ([`Failures::kinds`](elbowroom_laboratory::failures::Failures::kinds)),
/// with the name and text of its trace.
///
/// # Errors
/// As [`page`], and if one of the traces is damaged.
pub fn experiment_page(
    name: &str,
    text: &str,
    traces: &[(FailurePosition, String, String)],
) -> Result<String, PageError> {
    let mut trials = Trials::new();
    for (place, name, text) in traces {
        trials.insert(*place, document(name, text)?);
    }
    Ok(html::html(&results_document(name, text, trials)?))
}

fn results_document(name: &str, text: &str, trials: Trials) -> Result<Document, PageError> {
    let page = if format(text).as_deref() == Some(UntimedCounts::FORMAT) {
        Results::read(text).map(|results| perturbed::untimed_experiment(&results, trials))
    } else {
        Results::read(text).map(|results| experiment::timed(&results, trials))
    };
    page.map_err(|error| damaged_input(name, &error))
}

/// Returns the live page of a running run, from its trace so far.
///
/// The page reads `events` from its server, a stream of server-sent events: `change` if there are
/// new lines, and `over` with the document of the finished run. `document` is [`live_document`] as
/// JSON. With `#token=…` in its address, the page can also request the server to `stop` the run.
/// `left_out` is the number of lines after the first one that the text no longer contains.
///
/// # Errors
/// If the text is not a trace of a run, or damaged.
pub fn live_page(name: &str, text: &str, left_out: usize) -> Result<String, PageError> {
    Ok(html::live_html(&live_document(name, text, left_out)?))
}

/// Returns the content of the live page of a running run; `left_out` as for [`live_page`].
///
/// # Errors
/// If the text is not a trace of a run, or damaged.
pub fn live_document(name: &str, text: &str, left_out: usize) -> Result<Document, PageError> {
    match format(text).as_deref() {
        Some(TRACE) => trace_document(name, text, run::Record::Live { left_out }),
        _ => Err(PageError::NoRun(name.to_owned())),
    }
}

const TRACE: &str = "elbowroom-trace";

fn trace_document(name: &str, text: &str, record: run::Record) -> Result<Document, PageError> {
    let stored = Stored::read(text).map_err(|error| damaged_input(name, &error))?;
    let spec: RunSpec = stored
        .header()
        .map_err(|error| damaged_input(name, &error))?;
    Ok(run::trace(name, &stored, &spec, record))
}

fn damaged_input(name: &str, error: &impl ToString) -> PageError {
    PageError::Damaged {
        name: name.to_owned(),
        why: error.to_string(),
    }
}

/// Converts the run of a stored trace to the format of Perfetto, <https://ui.perfetto.dev>.
///
/// # Errors
/// If the text is not a trace of a run, or damaged.
pub fn perfetto(name: &str, text: &str) -> Result<Vec<u8>, PageError> {
    let no_run = || PageError::NoRun(name.to_owned());
    perfetto::trace(&document(name, text)?).ok_or_else(no_run)
}

/// Converts the run of a stored trace to an MCAP file, <https://mcap.dev>.
///
/// # Errors
/// If the text is not a trace of a run, or damaged.
pub fn mcap(name: &str, text: &str) -> Result<Vec<u8>, PageError> {
    let no_run = || PageError::NoRun(name.to_owned());
    mcap::file(&document(name, text)?).ok_or_else(no_run)
}

/// Returns the content of the page of an answer, a trace or results.
///
/// # Errors
/// As [`page`].
pub fn document(name: &str, text: &str) -> Result<Document, PageError> {
    match format(text).as_deref() {
        Some(TRACE) => trace_document(name, text, run::Record::Ended),
        Some("elbowroom-envelope") => {
            read::<EnvelopeAnswer>(name, text).map(|it| plan::envelope(&it))
        }
        Some("elbowroom-region") => read::<RegionAnswer>(name, text).map(|it| region::region(&it)),
        Some("elbowroom-plan") => {
            read::<PlanAnswer>(name, text).map(|it| plan::planner_answer(&it))
        }
        Some("elbowroom-run") => read::<RunAnswer>(name, text).map(|it| run::outcome(&it)),
        Some(TimedCounts::FORMAT | UntimedCounts::FORMAT) => {
            results_document(name, text, Trials::new())
        }
        Some("elbowroom-course") => {
            let course = StoredTrial::read(text).map_err(|error| damaged_input(name, &error))?;
            Ok(perturbed::trial_page(&course))
        }
        Some(format) => Err(PageError::OtherFormat {
            name: name.to_owned(),
            format: format.to_owned(),
        }),
        None => Err(PageError::Unknown(name.to_owned())),
    }
}

/// Returns the format stated in a document, or in the first line of a trace.
fn format(text: &str) -> Option<String> {
    #[derive(Deserialize)]
    struct Named {
        format: String,
    }
    let first = text.lines().next().unwrap_or_default();
    let named: Named = serde_json::from_str(text)
        .or_else(|_| serde_json::from_str(first))
        .ok()?;
    Some(named.format)
}

fn read<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, PageError> {
    serde_json::from_str(text).map_err(|error| damaged_input(name, &error))
}
