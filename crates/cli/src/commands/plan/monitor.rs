//! Progress and limits of a search for a plan.

use std::fmt::{self, Write as _};
use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom::answers::{Event, Observer, PlanProgress, StopRequest};
use elbowroom::num::Rational;

use crate::args::PlanArgs;
use crate::interrupt::Interrupt;
use crate::number;
use crate::progress::Progress;
use crate::time_limit::{Stopwatch, duration};
use elbowroom_executive::memory_limit::MemoryLimit;
use elbowroom_executive::messages::count_with_noun;

/// Watcher that reports plans and checks Ctrl-C. It also checks time and memory, unless the planner
/// does so itself.
pub(super) struct PlanMonitor {
    stopwatch: Stopwatch,
    line: Progress,
    limit: Option<Duration>,
    memory: Option<MemoryLimit>,
    best: Option<PlanQuality>,
    /// `true` if each better plan is reported, because the search continues after the first one.
    reports_plans: bool,
}

/// Makespan and metric of the last plan.
struct PlanQuality {
    makespan: Rational,
    metric: Option<Rational>,
    /// Description of another objective, if plans are compared by one.
    objective: Option<String>,
}

impl PlanMonitor {
    /// Creates a watcher whose limits start now.
    pub(super) fn start(arguments: &PlanArgs) -> Self {
        let limit = arguments.time_limit.as_ref().map(duration);
        Self {
            stopwatch: Stopwatch::start(&Interrupt::listen()).with_limit(limit),
            line: Progress::new(),
            limit,
            memory: arguments
                .memory
                .map(|megabytes| MemoryLimit::of(megabytes << 20)),
            best: None,
            reports_plans: limit.is_some() && !arguments.first,
        }
    }

    /// Stops checking the limits, for a planner that checks them itself. Returns the remaining
    /// time.
    pub(super) fn take_limits(&mut self) -> Option<Duration> {
        self.stopwatch = self.stopwatch.clone().with_limit(None);
        self.memory = None;
        let elapsed = self.stopwatch.elapsed();
        self.limit.map(|limit| limit.saturating_sub(elapsed))
    }

    pub(super) fn limit(&self) -> Option<Duration> {
        self.limit
    }

    /// Shows the progress of the search.
    fn show(&mut self, progress: &PlanProgress<'_>) {
        let elapsed = self.stopwatch.elapsed();
        let (best, limit) = (&self.best, self.limit);
        self.line.show(elapsed, || {
            let mut line = match (progress.states, progress.memory) {
                (Some(states), _) => {
                    let states = usize::try_from(states).unwrap_or(usize::MAX);
                    format!("{}, ", count_with_noun(states, "state"))
                }
                (None, Some(memory)) => format!("{} MB, ", memory >> 20),
                (None, None) => String::new(),
            };
            line.push_str(&count_with_noun(progress.plans, "plan"));
            if let Some(best) = best {
                let _ = write!(line, ", the last with {best}");
            }
            if let Some(limit) = limit {
                let left = limit.saturating_sub(elapsed).as_secs();
                let _ = write!(line, ", {left} s left");
            }
            line
        });
    }
}

impl fmt::Display for PlanQuality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "makespan {}", number::nearest(&self.makespan))?;
        if let Some(metric) = &self.metric {
            write!(f, ", metric {}", number::nearest(metric))?;
        }
        if let Some(worth) = &self.objective {
            write!(f, ", objective {worth}")?;
        }
        Ok(())
    }
}

impl Observer for PlanMonitor {
    fn elapsed(&mut self) -> Duration {
        self.stopwatch.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        self.stopwatch.flow()?;
        let memory = self.memory.as_mut();
        if memory.is_some_and(MemoryLimit::is_exceeded) {
            return ControlFlow::Break(StopRequest::MemoryLimit);
        }
        ControlFlow::Continue(())
    }

    fn notice(&mut self, event: &Event<'_>) {
        let Event::Plan(progress) = event else {
            return;
        };
        if let Some(makespan) = progress.makespan {
            let best = PlanQuality {
                makespan: makespan.clone(),
                metric: progress
                    .metric
                    .filter(|metric| *metric != makespan)
                    .cloned(),
                objective: progress.value.map(str::to_owned),
            };
            if self.reports_plans {
                let seconds = self.stopwatch.elapsed().as_secs_f64();
                let plans = progress.plans;
                self.line
                    .print_above(&format!("plan {plans} after {seconds:.2} s: {best}"));
            }
            self.best = Some(best);
        }
        self.show(progress);
    }
}
