//! Problems with a calendar file: `docs/reference/calendars.md`.

use elbowroom::execute::NamedText;
use elbowroom::num::Rational;
use elbowroom::pddl;
use elbowroom::text::{Diagnostic, Source};
use elbowroom_calendar::{Calendar, Origin};

use crate::args::CalendarArgs;
use crate::exit::Failure;
use crate::file;
use crate::output::{self, Output};
use crate::terminal::{HINT, styled};
use elbowroom_executive::clock::{self, Clock};

/// A problem with the timed initials of a calendar.
pub(crate) struct TimedProblem {
    pub(crate) problem: Source,
    pub(crate) calendar: Calendar,
    /// Warnings about the calendar file.
    pub(crate) warnings: Vec<Diagnostic>,
    /// Clock that started at time 0, if time 0 is the current time.
    pub(crate) since: Option<Clock>,
}

/// Reads the calendar file, if one is given, and adds its timed initials to the problem. With
/// `is_live`, time 0 is the current time unless the file or the command line says otherwise.
///
/// # Errors
/// When domain, problem or calendar are wrong.
pub(crate) fn timed_problem(
    arguments: &CalendarArgs,
    domain: &Source,
    problem: &Source,
    is_live: bool,
) -> Result<Option<TimedProblem>, Failure> {
    let Some(path) = &arguments.calendar else {
        return Ok(None);
    };
    let file = file::source(path, "calendar")?;
    // Errors in domain or problem are reported at their positions in the original text.
    let (read, _) = pddl::read_problem(domain, problem)?;
    let origin = Origin {
        begin: arguments.begin.as_deref(),
        now: clock::now(),
        is_live,
    };
    let now = Clock::start();
    let (calendar, warnings) = elbowroom_calendar::read(&file, &read, &origin)?;
    Ok(Some(TimedProblem {
        problem: calendar.timed_problem(problem, &file),
        since: calendar.begins_now().then_some(now),
        calendar,
        warnings,
    }))
}

/// Returns the problem with the timed initials of its calendar, and the clock that runs from time 0 if
/// the calendar begins now. `factor` is the speed of time, if it passes on a wall clock.
pub(crate) fn with_calendar(
    (arguments, factor): (&CalendarArgs, Option<Rational>),
    domain: &NamedText,
    problem: Source,
    output: &mut Output,
) -> Result<(Source, Option<Clock>), Failure> {
    let timed = timed_problem(arguments, &domain.source(), &problem, factor.is_some())?;
    let Some(timed) = timed else {
        return Ok((problem, None));
    };
    output.warn_about(&timed.warnings);
    timed.announce(factor.as_ref());
    Ok((timed.problem, timed.since))
}

impl TimedProblem {
    /// Reports the date of time 0 on standard error. `pace` is the number of the problem's time
    /// units per second, if time is that of a wall clock.
    fn announce(&self, pace: Option<&Rational>) {
        let note = styled(HINT, "note");
        output::print_to_stderr(&format!("{note}: {}", self.calendar.origin()));
        let Some(pace) = pace.filter(|_| self.calendar.begins_now()) else {
            return;
        };
        let rate = pace * &self.calendar.unit_in_seconds();
        if rate != Rational::ONE {
            let label = styled(HINT, "warning");
            let seconds = Rational::ONE / &self.calendar.unit_in_seconds();
            output::print_to_stderr(&format!(
                "{label}: the calendar begins now, but its time passes {rate} times as fast as the \
                 wall clock\n  {note}: choose `unit = \"seconds\"`, or --realtime {seconds} for a \
                 simulated world"
            ));
        }
    }
}
