//! Measurement of an executor's decision times: [`Timed`].

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use elbowroom_execution::{
    Decided, DecisionContext, Executor, PlanForm, Planned, PreparedPlan, Reason, StepId,
};

/// Decision times.
#[derive(Clone, Default)]
pub(crate) struct Times(Arc<Mutex<Vec<Duration>>>);

impl Times {
    /// Returns the number of decisions, and the median, 99th percentile and maximum of their times.
    pub(crate) fn summary(&self) -> (usize, [String; 3]) {
        let mut times = self.0.lock().expect("no thread has panicked").clone();
        times.sort_unstable();
        let at = |share: usize| {
            let time = times.get(times.len().saturating_sub(1) * share / 100);
            time.map_or_else(String::new, |time| milliseconds(*time))
        };
        (times.len(), [50, 99, 100].map(at))
    }
}

/// Executor whose decisions are timed.
pub(crate) struct Timed {
    pub(crate) inner: Box<dyn Executor>,
    pub(crate) times: Times,
}

impl Executor for Timed {
    fn need(&self) -> PlanForm {
        self.inner.need()
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        self.inner.adopt(mission)
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let begin = Instant::now();
        let decided = self.inner.decide(moment);
        let took = begin.elapsed();
        let mut times = self.times.0.lock().expect("no thread has panicked");
        times.push(took);
        drop(times);
        decided
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.inner.window(step, is_end)
    }
}

pub(crate) fn milliseconds(time: Duration) -> String {
    format!("{:.3} ms", time.as_secs_f64() * 1000.0)
}
