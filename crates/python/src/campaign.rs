//! Experiments, whole or in parts.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use std::{fs, thread};

use elbowroom::answers::{Event, Observer, StopRequest};
use elbowroom::text::Source;
use elbowroom_laboratory::answer::{AnyExperiment, CompareAnswer, CompareRequest, compare};
use elbowroom_laboratory::trials::Part;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::errors::{CallError, run_without_gil};

/// Interval between checks for signals and reports of progress.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// A parsed experiment.
#[pyclass(frozen, module = "elbowroom._native")]
pub(crate) struct Experiment {
    experiment: AnyExperiment,
}

/// Reads the files that an experiment mentions from a folder. Returns their texts by name.
#[pyfunction]
pub(crate) fn experiment_files(
    py: Python<'_>,
    name: String,
    text: String,
    folder: String,
) -> PyResult<BTreeMap<String, String>> {
    run_without_gil(py, || {
        let found = Mutex::new(BTreeMap::new());
        let file = |name: &str| {
            let path = Path::new(&folder).join(name);
            let text = fs::read_to_string(&path)
                .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
            let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
            found.insert(name.to_owned(), text.clone());
            Ok(text)
        };
        AnyExperiment::read(&Source::new(name, text), &file)?;
        Ok(found.into_inner().unwrap_or_else(PoisonError::into_inner))
    })
}

#[pymethods]
impl Experiment {
    #[new]
    fn new(
        py: Python<'_>,
        name: String,
        text: String,
        files: BTreeMap<String, String>,
    ) -> PyResult<Self> {
        run_without_gil(py, || {
            let file = |name: &str| {
                let text = files.get(name).cloned();
                text.ok_or_else(|| format!("the file {name} is missing from the experiment"))
            };
            let experiment = AnyExperiment::read(&Source::new(name, text), &file)?;
            Ok(Self { experiment })
        })
    }

    /// Number of trials that the experiment specifies.
    fn trials(&self) -> u64 {
        self.experiment.trials()
    }

    /// Makes a part of the trials. Returns the document as the command writes it, and `True` if
    /// Ctrl-C ended the trials.
    fn make(
        &self,
        py: Python<'_>,
        trials: u64,
        part: (u64, u64),
        jobs: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(String, bool)> {
        run_without_gil(py, || {
            let (shard, shards) = part;
            if shard >= shards {
                return Err(CallError::Request(format!(
                    "part {shard} of {shards} does not exist; expected 0 to {}",
                    shards.saturating_sub(1)
                )));
            }
            let part = Part {
                trials,
                shard,
                shards,
                jobs,
            };
            let state = TrialProgress::default();
            let request = CompareRequest {
                experiment: &self.experiment,
                part,
            };
            // Only the thread that Python called can check for signals. The trials run in other
            // threads.
            let (answer, raised) = thread::scope(|scope| {
                let trials = scope.spawn(|| compare(request, &mut TrialObserver(&state)));
                let raised = state.poll(progress.as_ref(), || trials.is_finished());
                let answer = trials.join();
                (answer, raised)
            });
            let answer = answer.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            match raised {
                Some(error) => Err(error.into()),
                None => Ok((document(&answer), answer.is_interrupted())),
            }
        })
    }

    /// Merges parts.
    fn merge(&self, py: Python<'_>, parts: Vec<String>) -> PyResult<String> {
        run_without_gil(py, || {
            let parts = parts
                .iter()
                .map(|part| CompareAnswer::read(part, &self.experiment));
            let parts: Vec<_> = parts.collect::<Result<_, _>>()?;
            Ok(document(&CompareAnswer::merge_results(&parts)?))
        })
    }

    /// The table of results as CSV, as Markdown, and as plain text.
    fn tables(&self, py: Python<'_>, results: &str) -> PyResult<(String, String, String)> {
        run_without_gil(py, || {
            let answer = CompareAnswer::read(results, &self.experiment)?;
            let table = answer.table(&self.experiment)?;
            Ok((table.csv(), table.markdown(), table.fit_to_width(100)))
        })
    }
}

/// Formats the answer like the command's `results.json`.
fn document(answer: &CompareAnswer) -> String {
    format!("{:#}\n", answer.json())
}

/// Progress of the trials, and the request to end them.
#[derive(Default)]
struct TrialProgress {
    done: AtomicU64,
    of: AtomicU64,
    stop_requested: AtomicBool,
}

impl TrialProgress {
    /// Checks for signals and reports progress until the trials are over.
    fn poll(&self, progress: Option<&Py<PyAny>>, is_over: impl Fn() -> bool) -> Option<PyErr> {
        let mut told = 0;
        loop {
            let over = is_over();
            let done = self.done.load(Ordering::Relaxed);
            let of = self.of.load(Ordering::Relaxed);
            let heard = Python::attach(|py| {
                py.check_signals()?;
                match progress {
                    Some(callback) if done > told => {
                        told = done;
                        callback
                            .call1(py, ("trials", done, Some(of), ""))
                            .map(|_| ())
                    }
                    _ => Ok(()),
                }
            });
            if let Err(error) = heard {
                self.stop_requested.store(true, Ordering::Relaxed);
                let is_interrupt =
                    Python::attach(|py| error.is_instance_of::<PyKeyboardInterrupt>(py));
                return if is_interrupt { None } else { Some(error) };
            }
            if over {
                return None;
            }
            thread::park_timeout(POLL_INTERVAL);
        }
    }
}

/// The watcher of the trials.
struct TrialObserver<'a>(&'a TrialProgress);

impl Observer for TrialObserver<'_> {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        if self.0.stop_requested.load(Ordering::Relaxed) {
            ControlFlow::Break(StopRequest::Cancelled)
        } else {
            ControlFlow::Continue(())
        }
    }

    fn notice(&mut self, event: &Event<'_>) {
        if let Event::Trials(progress) = event {
            self.0.of.store(progress.total, Ordering::Relaxed);
            self.0.done.store(progress.done, Ordering::Relaxed);
        }
    }
}
