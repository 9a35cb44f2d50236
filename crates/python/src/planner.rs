//! Planners in Python as implementations of the planner interface of [`elbowroom::execution`].

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use elbowroom::execution::{PlanAnswer, Planner, PlannerAnswer, Shortfall};
use elbowroom::external::{Question, Request};
use elbowroom::model::validate::{self, Settings, Verdict};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::pddl;
use elbowroom::text::Source;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

/// The exception of a planner, for the caller of the run.
pub(crate) type Raised = Arc<Mutex<Option<PyErr>>>;

/// Planner that calls a Python callable with the texts of a domain and a problem. The callable
/// returns the text of a plan, or `None` if there is none.
pub(crate) struct PyPlanner {
    pub(crate) callable: Py<PyAny>,
    pub(crate) domain: Source,
    pub(crate) problem: Source,
    pub(crate) interrupted: Arc<AtomicBool>,
    pub(crate) raised: Raised,
}

impl PyPlanner {
    fn answer(&self, task: &Task, situation: &Situation) -> Result<PlanAnswer, String> {
        let mut request = Request {
            task,
            situation,
            domain: &self.domain,
            problem: &self.problem,
        };
        let question = Question::of(&request)?;
        let said = Python::attach(|py| {
            let asked = (self.domain.text(), question.text());
            let said = self.callable.call1(py, asked);
            match said.and_then(|said| said.extract::<Option<String>>(py)) {
                Ok(said) => Ok(said),
                Err(error) => {
                    let why = format!("the planner failed: {error}");
                    if error.is_instance_of::<PyKeyboardInterrupt>(py) {
                        self.interrupted.store(true, Ordering::Relaxed);
                    } else {
                        let mut raised = self.raised.lock().unwrap_or_else(PoisonError::into_inner);
                        raised.get_or_insert(error);
                    }
                    Err(why)
                }
            }
        })?;
        let Some(said) = said else {
            return Ok(PlanAnswer::NotFound {
                why: "the planner found no plan".to_owned(),
            });
        };
        let plan = pddl::read_plan(&Source::new("plan of the planner", said), question.task());
        let (plan, _warnings) = plan.map_err(|wrong| wrong.to_string())?;
        let plan = question.translate(&plan, &mut request)?;
        match validate::validate_from(task, situation, &plan, &Settings::default()) {
            Verdict::Valid(_) => Ok(PlanAnswer::Plan(plan)),
            Verdict::Invalid(wrong) => Err(format!("the planner's plan does not work: {wrong}")),
            Verdict::Undecided(why) => Err(format!(
                "the validity of the planner's plan is undecided: {why}"
            )),
        }
    }
}

impl Planner for PyPlanner {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let begun = Instant::now();
        let answer = self.answer(task, situation);
        let micros = i64::try_from(begun.elapsed().as_micros()).unwrap_or(i64::MAX);
        PlannerAnswer {
            answer: answer.unwrap_or_else(|why| PlanAnswer::NotFound { why }),
            seconds: Some(Rational::new(micros, 1_000_000)),
            remark: None,
            shortfall: Shortfall::default(),
        }
    }
}
