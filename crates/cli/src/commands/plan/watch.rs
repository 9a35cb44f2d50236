//! How a search is getting on, and when it has to stop.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom::num::Rational;

use crate::args::PlanArgs;
use crate::interrupt::Interrupt;
use crate::number;
use crate::output::counted;
use crate::progress::Progress;

/// Watches the plans that come, Ctrl-C, and, for who keeps no time of its own, the time.
pub(super) struct Watch {
    line: Progress,
    interrupt: Interrupt,
    limit: Option<Duration>,
    stops_at_first: bool,
    plans: usize,
    first: Option<Duration>,
    best: Option<Worth>,
}

/// What the last plan is worth.
struct Worth {
    makespan: Rational,
    metric: Option<Rational>,
}

impl Watch {
    /// Starts to watch.
    pub(super) fn start(arguments: &PlanArgs) -> Self {
        let limit = arguments.time_limit.as_ref().map(duration);
        Self {
            line: Progress::new(),
            interrupt: Interrupt::listen(),
            limit,
            stops_at_first: arguments.first || limit.is_none(),
            plans: 0,
            first: None,
            best: None,
        }
    }

    pub(super) fn limit(&self) -> Option<Duration> {
        self.limit
    }

    /// Whether the first plan is enough.
    pub(super) fn stops_at_first(&self) -> bool {
        self.stops_at_first
    }

    /// How many plans there were.
    pub(super) fn plans(&self) -> usize {
        self.plans
    }

    /// When the first plan was there.
    pub(super) fn first(&self) -> Option<Duration> {
        self.first
    }

    /// Whether Ctrl-C was pressed.
    pub(super) fn is_cancelled(&self) -> bool {
        self.interrupt.is_requested()
    }

    /// Whether the time is up.
    pub(super) fn is_late(&self, elapsed: Duration) -> bool {
        self.limit.is_some_and(|limit| elapsed >= limit)
    }

    /// A plan has come. Says whether to go on.
    pub(super) fn plan(
        &mut self,
        makespan: &Rational,
        metric: Option<&Rational>,
        elapsed: Duration,
    ) -> ControlFlow<()> {
        self.plans += 1;
        self.first.get_or_insert(elapsed);
        self.best = Some(Worth {
            makespan: makespan.clone(),
            metric: metric.filter(|metric| *metric != makespan).cloned(),
        });
        if self.stops_at_first {
            return ControlFlow::Break(());
        }
        self.flow()
    }

    /// Shows how far the search has come; `what` it counts stands at the beginning. Says whether
    /// to go on.
    pub(super) fn show(
        &mut self,
        elapsed: Duration,
        what: impl FnOnce() -> String,
    ) -> ControlFlow<()> {
        let (plans, best, limit) = (self.plans, &self.best, self.limit);
        self.line.show(elapsed, || {
            let mut line = format!("{}, {}", what(), counted(plans, "plan"));
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
        self.flow()
    }

    fn flow(&self) -> ControlFlow<()> {
        if self.is_cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// Seconds as the clock understands them.
fn duration(seconds: &Rational) -> Duration {
    Duration::try_from_secs_f64(seconds.to_f64()).unwrap_or(Duration::MAX)
}
