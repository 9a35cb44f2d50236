//! Validation of each execution while it is recorded: [`Validated`].

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom_execution::run::RunSnapshot;
use elbowroom_execution::{Entry, Recorder};
use elbowroom_model::Task;
use elbowroom_report::validation::{Invalid, Validation};

use crate::execution::read_goal;

/// A recorder that also gives each entry to the validator.
///
/// ```
/// use std::sync::Arc;
///
/// use elbowroom_selection::{Execution, Validated};
/// use elbowroom_execution::NoRecord;
/// use elbowroom_model::{Problem, Task};
/// use elbowroom_sim::{SimWorld, WorldModel};
///
/// let task = Arc::new(Task::new(Problem::default()));
/// let (recorder, validation) = Validated::new(NoRecord, &task, None);
/// let model = WorldModel::default();
/// let report = Execution::of(&task)
///     .recorded_by(recorder)
///     .run_in(&mut SimWorld::new(Arc::clone(&task), &model, 0));
/// assert_eq!(report.verdict.name(), "goal-reached");
/// assert!(validation.findings().is_empty());
/// ```
pub struct Validated<'a, R> {
    inner: R,
    validation: Findings,
    reported: usize,
    listener: Option<Listener<'a>>,
}

type Listener<'a> = Box<dyn FnMut(&Invalid) + Send + 'a>;

/// The validator's findings in a run so far, shared between clones.
#[derive(Clone)]
pub struct Findings(Arc<Mutex<Validation<'static>>>);

impl<'a, R: Recorder> Validated<'a, R> {
    /// Creates the recorder and its findings. `stand` is the snapshot of a run to continue, or
    /// `None` for a new run.
    pub fn new(inner: R, task: &Arc<Task>, stand: Option<&RunSnapshot>) -> (Self, Findings) {
        let mut validation = Validation::new(task, read_goal);
        if let Some(stand) = stand {
            validation = validation.resume_from(stand);
        }
        let validation = Findings(Arc::new(Mutex::new(validation)));
        let recorder = Self {
            inner,
            validation: validation.clone(),
            reported: 0,
            listener: None,
        };
        (recorder, validation)
    }

    /// Reports each of the first findings to `listener` immediately, not only at the end of the
    /// run.
    #[must_use]
    pub fn on_finding(mut self, listener: impl FnMut(&Invalid) + Send + 'a) -> Self {
        self.listener = Some(Box::new(listener));
        self
    }
}

impl Findings {
    /// Returns the first findings: bugs of this program.
    pub fn findings(&self) -> Vec<Invalid> {
        self.validation().findings().to_vec()
    }

    fn validation(&self) -> MutexGuard<'_, Validation<'static>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<R: Recorder> Recorder for Validated<'_, R> {
    fn record(&mut self, entry: &Entry<'_>) {
        self.inner.record(entry);
        let mut validation = self.validation.validation();
        validation.process_entry(entry);
        let new = validation.findings()[self.reported..].to_vec();
        drop(validation);
        self.reported += new.len();
        if let Some(listener) = &mut self.listener {
            new.iter().for_each(listener);
        }
    }

    fn commit(&mut self) {
        self.inner.commit();
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool {
        self.inner.begin_anew(stand)
    }
}
