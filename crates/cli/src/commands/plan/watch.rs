//! How a search is getting on, and when it has to stop.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom::answers::{Event, Halt, PlanProgress, Watcher};
use elbowroom::num::Rational;

use crate::args::PlanArgs;
use crate::clock::Clock;
use crate::interrupt::Interrupt;
use crate::number;
use crate::output::counted;
use crate::progress::Progress;

/// Watches the plans that come, Ctrl-C, and, for who keeps no time of its own, the time.
pub(super) struct Watch {
    clock: Clock,
    line: Progress,
    interrupt: Interrupt,
    limit: Option<Duration>,
    keeps_time: bool,
    best: Option<Worth>,
}

/// What the last plan is worth.
struct Worth {
    makespan: Rational,
    metric: Option<Rational>,
}

impl Watch {
    /// Starts to watch. Another planner keeps its time limit itself.
    pub(super) fn start(arguments: &PlanArgs, is_other_planner: bool) -> Self {
        Self {
            clock: Clock::start(),
            line: Progress::new(),
            interrupt: Interrupt::listen(),
            limit: arguments.time_limit.as_ref().map(duration),
            keeps_time: !is_other_planner,
            best: None,
        }
    }

    pub(super) fn limit(&self) -> Option<Duration> {
        self.limit
    }

    /// Shows how far the search has come.
    fn show(&mut self, progress: &PlanProgress<'_>) {
        let elapsed = self.clock.elapsed();
        let (best, limit) = (&self.best, self.limit);
        self.line.show(elapsed, || {
            let mut line = match (progress.states, progress.memory) {
                (Some(states), _) => {
                    let states = usize::try_from(states).unwrap_or(usize::MAX);
                    format!("{}, ", counted(states, "state"))
                }
                (None, Some(memory)) => format!("{} MB, ", memory >> 20),
                (None, None) => String::new(),
            };
            line.push_str(&counted(progress.plans, "plan"));
            if let Some(best) = best {
                let makespan = number::nearest(&best.makespan);
                let _ = write!(line, ", the last ends at {makespan}");
                if let Some(metric) = &best.metric {
                    let _ = write!(line, ", metric {}", number::nearest(metric));
                }
            }
            let _ = match limit {
                Some(limit) => write!(
                    line,
                    ", {} s left",
                    (limit.saturating_sub(elapsed)).as_secs()
                ),
                None => write!(line, ", {} s", elapsed.as_secs()),
            };
            line
        });
    }
}

impl Watcher for Watch {
    fn elapsed(&mut self) -> Duration {
        self.clock.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<Halt> {
        let is_late = |limit: Duration| self.keeps_time && self.clock.elapsed() >= limit;
        if self.interrupt.is_requested() {
            ControlFlow::Break(Halt::Cancelled)
        } else if self.limit.is_some_and(is_late) {
            ControlFlow::Break(Halt::TimeLimit)
        } else {
            ControlFlow::Continue(())
        }
    }

    fn notice(&mut self, event: &Event<'_>) {
        let Event::Plan(progress) = event else {
            return;
        };
        if let Some(makespan) = progress.makespan {
            self.best = Some(Worth {
                makespan: makespan.clone(),
                metric: progress
                    .metric
                    .filter(|metric| *metric != makespan)
                    .cloned(),
            });
        }
        self.show(progress);
    }
}

/// Seconds as the clock understands them.
fn duration(seconds: &Rational) -> Duration {
    Duration::try_from_secs_f64(seconds.to_f64()).unwrap_or(Duration::MAX)
}
