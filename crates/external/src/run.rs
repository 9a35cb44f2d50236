//! Run of a planner, from request to outcome.

use std::io;
use std::ops::ControlFlow;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use super::channel::Received;
use super::clock::Clock;
use super::outcome::{Event, Found, Outcome, Report, Statistics};
use super::output_parser::FoundPhrases;
use super::plan_check::{PlanValidator, Repair, ValidationResult};
use super::reader::{Reader, Shared};
use super::registry::Planner;
use super::request::Request;
use super::settings::Settings;
use super::start::{not_started, prepare};
use super::supervise::{Ended, Ending, Limits, supervise};
use super::workspace::Workspace;

/// Interval between calls of the observer.
const HEARTBEAT: Duration = Duration::from_millis(20);
/// Grace period after the time limit for the validation of queued plans.
const GRACE: Duration = Duration::from_millis(50);
/// Runs a planner. `observe` receives each plan, and is otherwise called about fifty times per
/// second. It can end the run, whose outcome is then the last plan found. `repair` receives plans
/// that the validator rejects.
///
/// Every plan in the report and in the events has been accepted by the validator
/// ([`elbowroom_model::validate_from`]). When this function returns, no process and no file is
/// left.
pub fn plan(
    planner: &Planner,
    request: &mut Request<'_>,
    settings: &Settings,
    repair: &mut Repair<'_>,
    observe: &mut dyn FnMut(&Event<'_>) -> ControlFlow<()>,
) -> Report {
    let prepared = if cfg!(unix) {
        prepare(planner, request, settings)
    } else {
        // Checked before any use of clocks and folders, which some systems lack.
        let reason = format!(
            "{} is an external planner, and this system does not support them",
            planner.name
        );
        Err(not_started(reason, "use the embedded planner"))
    };
    match prepared {
        Ok((question, workspace, command)) => {
            let validator = PlanValidator {
                request,
                question,
                repair,
            };
            let run = Run::new(validator, settings, observe);
            run.run(planner, workspace, command)
        }
        Err(outcome) => Report {
            outcome,
            statistics: Statistics::default(),
        },
    }
}

/// A running planner, as seen by the validating thread.
struct Run<'a, 'r> {
    validator: PlanValidator<'a, 'r>,
    settings: &'a Settings,
    observe: &'a mut dyn FnMut(&Event<'_>) -> ControlFlow<()>,
    clock: Clock,
    best: Option<Found>,
    /// The last rejected plan: the objection, and its text.
    refused: Option<(String, String)>,
    /// The reason why the last text similar to a plan was unreadable.
    unreadable: Option<String>,
    statistics: Statistics,
    is_stopped: bool,
}

/// Sets its flag on drop.
struct StopAtEnd<'s>(&'s AtomicBool);

impl Drop for StopAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}

impl<'a, 'r> Run<'a, 'r> {
    fn new(
        validator: PlanValidator<'a, 'r>,
        settings: &'a Settings,
        observe: &'a mut dyn FnMut(&Event<'_>) -> ControlFlow<()>,
    ) -> Self {
        Self {
            validator,
            settings,
            observe,
            clock: Clock::start(),
            best: None,
            refused: None,
            unreadable: None,
            statistics: Statistics::default(),
            is_stopped: false,
        }
    }

    /// Runs the planner. One thread reads the output and enforces the limits; this one validates,
    /// so that a long validation does not delay the planner's end.
    fn run(mut self, planner: &Planner, workspace: Workspace, command: process::Command) -> Report {
        let shared = Shared::default();
        let limits = Limits {
            time: self.settings.time_limit,
            work: self.settings.work_limit,
            memory: self.settings.memory_limit,
        };
        let mut reader = Reader::new(planner, workspace, &shared);
        let ended = thread::scope(|scope| {
            // Ends the planner if the validator or the observer panics.
            let _stop = StopAtEnd(&shared.stop);
            let supervisor = scope.spawn(|| {
                let ended = supervise(command, limits, &shared.stop, &mut reader);
                reader.finish(ended.as_ref().ok().map(|ended| ended.ending));
                ended
            });
            self.validate_queued(&shared);
            supervisor.join()
        });
        let Ok(ended) = ended else {
            // A bug of this crate; the process has ended.
            std::panic::resume_unwind(Box::new("the supervisor of a planner panicked"));
        };
        let ended = match ended {
            Ok(ended) => ended,
            Err(error) => return self.not_started(planner, &error),
        };
        self.statistics.printed = reader.printed_bytes();
        let sayings = reader.phrases();
        let excerpt = reader.excerpt();
        // The folder is removed before the outcome is reported.
        drop(reader);
        self.report(planner, ended, sayings, excerpt)
    }

    fn validate_queued(&mut self, shared: &Shared) {
        loop {
            match shared.mailbox.pop_timeout(HEARTBEAT) {
                Received::Text(text) if self.is_over() && self.best.is_some() => drop(text),
                Received::Text(text) => self.validate(&text),
                Received::TimedOut => {
                    let running = Event::Running {
                        elapsed: self.clock.elapsed(),
                        memory: shared.memory.load(Ordering::Relaxed),
                    };
                    self.notify(&running);
                }
                Received::Closed => return,
            }
            if self.is_stopped {
                shared.stop.store(true, Ordering::SeqCst);
            }
        }
    }

    /// Returns `true` if it is too late for better plans.
    fn is_over(&self) -> bool {
        let limit = self.settings.time_limit;
        self.is_stopped || limit.is_some_and(|limit| self.clock.elapsed() > limit + GRACE)
    }

    fn notify(&mut self, event: &Event<'_>) {
        if !self.is_stopped {
            self.is_stopped = (self.observe)(event).is_break();
        }
    }

    fn validate(&mut self, text: &str) {
        let judgement = self.validator.validate(text);
        let elapsed = self.clock.elapsed();
        match judgement {
            ValidationResult::Accepted(found) => {
                // A plan that is both written to a file and printed counts once.
                if self
                    .best
                    .as_ref()
                    .is_some_and(|best| best.plan == found.plan)
                {
                    return;
                }
                self.statistics.plans += 1;
                self.statistics.first_plan.get_or_insert(elapsed);
                let found = &*self.best.insert(found);
                if !self.is_stopped {
                    let event = Event::Plan { found, elapsed };
                    self.is_stopped = (self.observe)(&event).is_break();
                }
            }
            ValidationResult::Refused(reason) => {
                self.statistics.refused += 1;
                let event = Event::Refused {
                    reason: &reason,
                    elapsed,
                };
                self.notify(&event);
                self.refused = Some((reason, text.to_owned()));
            }
            ValidationResult::Unreadable(reason) => {
                self.statistics.refused += 1;
                let event = Event::Refused {
                    reason: &reason,
                    elapsed,
                };
                self.notify(&event);
                self.unreadable = Some(reason);
            }
        }
    }

    fn not_started(self, planner: &Planner, error: &io::Error) -> Report {
        let reason = format!("{}: {error}", planner.name);
        Report {
            outcome: not_started(reason, &planner.install_hint),
            statistics: self.statistics,
        }
    }

    fn report(
        mut self,
        planner: &Planner,
        ended: Ended,
        sayings: FoundPhrases,
        excerpt: String,
    ) -> Report {
        self.statistics.elapsed = self.clock.elapsed();
        self.statistics.peak_memory = ended.peak_memory;
        self.statistics.work = ended.work;
        self.statistics.ending = Some(ended.ending);
        let outcome = match (self.best.take(), &sayings.missing) {
            (Some(found), _) => Outcome::Plan(found),
            (None, Some(reason)) => not_started(reason.clone(), &planner.install_hint),
            (None, None) => self.without_plan(ended, sayings, excerpt),
        };
        Report {
            outcome,
            statistics: self.statistics,
        }
    }

    /// Determines the outcome of a run without a valid plan.
    fn without_plan(&mut self, ended: Ended, sayings: FoundPhrases, excerpt: String) -> Outcome {
        let peak = ended.peak_memory;
        if ended.ending == Ending::MemoryLimit {
            return Outcome::OutOfMemory { peak };
        }
        if let Some((reason, plan)) = self.refused.take() {
            return Outcome::Refused { reason, plan };
        }
        match ended.ending {
            Ending::MemoryLimit => Outcome::OutOfMemory { peak },
            // The planner may report this and then hang.
            Ending::TimeLimit | Ending::Stopped => match sayings.unsolvable {
                Some(says) => Outcome::Unsolvable { says },
                None if ended.ending == Ending::Stopped => Outcome::Stopped,
                None => Outcome::NoneInTime,
            },
            Ending::Signalled(_) | Ending::Exited(_) => {
                self.ended_by_itself(ended.ending, peak, sayings, excerpt)
            }
        }
    }

    fn ended_by_itself(
        &mut self,
        ending: Ending,
        peak: u64,
        sayings: FoundPhrases,
        excerpt: String,
    ) -> Outcome {
        let signal = crash_signal(ending);
        if sayings.out_of_memory.is_some() && ending != Ending::Exited(0) {
            return Outcome::OutOfMemory { peak };
        }
        if let Some(says) = sayings.unsupported {
            return Outcome::Unsupported { says };
        }
        if let Some(signal) = signal {
            return Outcome::Crashed { signal, excerpt };
        }
        // If no actions are needed, planners print empty plans in various forms.
        if self.unreadable.is_none()
            && let Some(found) = self.validator.validate_empty_plan()
        {
            self.statistics.plans = 1;
            self.statistics.first_plan = Some(self.statistics.elapsed);
            return Outcome::Plan(found);
        }
        if let Some(says) = sayings.unsolvable {
            return Outcome::Unsolvable { says };
        }
        if let Some(says) = sayings.gave_up {
            return Outcome::GaveUp { says };
        }
        let code = match ending {
            Ending::Exited(code) => code,
            _ => 0,
        };
        let excerpt = match self.unreadable.take() {
            Some(reason) => format!("{reason}\n{excerpt}"),
            None => excerpt,
        };
        Outcome::NotUnderstood { code, excerpt }
    }
}

/// Returns the signal that ended the planner, even if a shell reports it by an exit code above 128.
fn crash_signal(ending: Ending) -> Option<i32> {
    /// Signals sent by the system to end a faulty program.
    const FAULTS: [i32; 6] = [4, 6, 7, 8, 9, 11];
    match ending {
        Ending::Signalled(signal) => Some(signal),
        Ending::Exited(code) => FAULTS.contains(&(code - 128)).then_some(code - 128),
        _ => None,
    }
}
