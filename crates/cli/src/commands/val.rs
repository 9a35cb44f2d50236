//! `elbowroom val`: the verdicts of `check` in the output format of VAL.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use elbowroom::RoundingRule;
use elbowroom::answers::check::{CheckAnswer, CheckFinding, CheckRequest, ValidationReport, check};
use elbowroom::model::validate::Settings;
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;

use crate::args::ValArgs;
use crate::exit::{Answer, Exit, Failure};
use crate::output::Output;
use crate::terminal::{HINT, styled};
use crate::{input, output};

/// Advice if the given plan is an STN plan.
const NETWORK_ADVICE: &str = "`elbowroom envelope` checks whether all of them work";

/// Number of decimal digits printed for times.
const DIGITS: u32 = 6;

/// Validates all plans, like VAL's `Validate`.
pub(crate) fn run(arguments: &ValArgs, output: &mut Output) -> Answer {
    let task = match input::task(&arguments.problem, &Task::default_epsilon(), output) {
        Ok(task) => task,
        Err(failure) => {
            output::print("Problem in domain or problem description!\n")?;
            return Err(failure);
        }
    };
    let settings = Settings::like_val(arguments.tolerance.clone());
    let mut tally = ValidationSummary::default();
    // VAL has its own rules about rounded numbers.
    let as_printed = RoundingRule::with_tolerance(Some(Rational::ZERO));
    for path in &arguments.plans {
        let plan = match input::time_triggered(&task, path, &as_printed, NETWORK_ADVICE, output) {
            Ok(plan) => plan,
            Err(failure) => {
                output::print("Bad plan description!\n")?;
                output.fail(&failure, false);
                tally.unreadable.push(path.display().to_string());
                continue;
            }
        };
        let name = path.display().to_string();
        if let Some([first, later]) = equal_times(&settings, &times(&task, &plan)) {
            warn_about_equal_times(&name, &first, &later, &arguments.tolerance);
        }
        let request = CheckRequest {
            task: &task,
            plan: Some(&plan),
            name: name.clone(),
            settings: settings.clone(),
        };
        let answer = check(&request).map_err(|error| Failure::new(error, ""))?;
        let CheckAnswer::Plan(checked) = answer else {
            continue;
        };
        let mut text = String::new();
        if arguments.verbose {
            push_plan(&mut text, &name, &plan);
        }
        tally.add(&mut text, arguments.verbose, &task, &plan, checked);
        output::print(&text)?;
    }
    output::print(&tally.text())?;
    Ok(
        match (tally.unreadable.is_empty(), tally.failed.is_empty()) {
            (false, _) => Exit::BadInput,
            (true, false) => Exit::No,
            (true, true) => Exit::Yes,
        },
    )
}

/// The results of the plans so far.
#[derive(Default)]
struct ValidationSummary {
    /// Plan value and file name.
    valid: Vec<(String, String)>,
    failed: Vec<String>,
    /// Unreadable plans.
    unreadable: Vec<String>,
}

impl ValidationSummary {
    fn add(
        &mut self,
        text: &mut String,
        is_verbose: bool,
        task: &Task,
        plan: &TimeTriggeredPlan,
        checked: ValidationReport,
    ) {
        let name = checked.plan;
        match checked.finding {
            CheckFinding::Valid {
                makespan, metric, ..
            } => {
                if is_verbose {
                    push_happenings(text, task, plan, None);
                }
                let value = metric.unwrap_or(makespan).to_decimal(DIGITS);
                let _ = write!(
                    text,
                    "Plan executed successfully - checking goal\nPlan valid\nFinal value: {value} \n"
                );
                self.valid.push((value, name));
            }
            CheckFinding::Invalid { violation } => {
                // The failed action is identified by its start.
                let step = violation.step.and_then(|step| plan.steps.get(step));
                let time = step.map_or(&violation.time, |step| &step.start);
                if is_verbose {
                    push_happenings(text, task, plan, Some(time));
                }
                text.push_str(match violation.action {
                    Some(_) => "Plan failed to execute\n",
                    None => {
                        "Plan executed successfully - checking goal\nGoal not satisfied\nPlan invalid\n"
                    }
                });
                let _ = write!(text, "\nPlan Repair Advice:\n\n{}\n\n", violation.message);
                // VAL ends the advice with these words; the complete list follows at the end.
                let _ = writeln!(text, "Failed plans:\n {name} ");
                self.failed.push(name);
            }
        }
    }

    fn text(&self) -> String {
        let mut text = String::new();
        if !self.valid.is_empty() {
            text.push_str("\nSuccessful plans:");
            for (value, name) in &self.valid {
                let _ = write!(text, "\nValue: {value}\n {name} {value} ");
            }
            text.push('\n');
        }
        if self.failed.len() > 1 {
            let _ = writeln!(text, "\nFailed plans:\n {} ", self.failed.join(" "));
        }
        if !self.unreadable.is_empty() {
            let _ = writeln!(text, "\nBad plans:\n {} ", self.unreadable.join(" "));
        }
        text
    }
}

fn push_plan(text: &mut String, name: &str, plan: &TimeTriggeredPlan) {
    let _ = writeln!(
        text,
        "Checking plan: {name}\nPlan to validate:\n\nPlan size: {}",
        plan.steps.len()
    );
    for step in &plan.steps {
        let _ = write!(
            text,
            "{}:\n{}",
            step.start.to_decimal(DIGITS),
            step.action.name
        );
        if let Some(duration) = &step.duration {
            let _ = write!(text, " [{}]", duration.to_decimal(DIGITS));
        }
        text.push('\n');
    }
    text.push_str("\nPlan Validation details\n-----------------------\n\n");
}

/// Returns the times of all happenings.
fn times(task: &Task, plan: &TimeTriggeredPlan) -> BTreeSet<Rational> {
    let mut times: BTreeSet<Rational> = task.timed().iter().map(|it| it.time.clone()).collect();
    for step in &plan.steps {
        times.insert(step.start.clone());
        times.insert(step.end());
    }
    times
}

/// Returns the first two different times that count as equal at the tolerance.
fn equal_times(settings: &Settings, times: &BTreeSet<Rational>) -> Option<[Rational; 2]> {
    let mut first: Option<&Rational> = None;
    for time in times {
        match first {
            Some(first) if settings.counts_as_equal(first, time) => {
                return Some([first.clone(), time.clone()]);
            }
            _ => first = Some(time),
        }
    }
    None
}

/// Warns that the verdict applies to the plan with these times made equal.
fn warn_about_equal_times(plan: &str, first: &Rational, later: &Rational, tolerance: &Rational) {
    // The group width is a tenth of the tolerance.
    let finer = later - first;
    output::print_to_stderr(&format!(
        "{}: {plan}: the times {} and {} count as equal at -t {}, and so do others that are \
         no more than {} apart\n  {}: try -t {}",
        styled(HINT, "warning"),
        first.to_decimal(DIGITS),
        later.to_decimal(DIGITS),
        tolerance.to_decimal(DIGITS),
        (tolerance / Rational::from(10)).to_decimal(DIGITS),
        styled(HINT, "help"),
        finer.to_decimal(DIGITS),
    ));
}

/// Appends the times of the happenings up to `until`.
fn push_happenings(
    text: &mut String,
    task: &Task,
    plan: &TimeTriggeredPlan,
    until: Option<&Rational>,
) {
    for time in times(task, plan)
        .iter()
        .filter(|time| until.is_none_or(|until| *time <= until))
    {
        let mut time = time.to_decimal(DIGITS);
        // Programs that parse this line expect a decimal point.
        if !time.contains('.') {
            time.push_str(".0");
        }
        let _ = writeln!(text, "Checking next happening (time {time})");
    }
}
