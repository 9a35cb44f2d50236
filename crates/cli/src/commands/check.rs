//! `elbowroom check`: is the plan valid?

use std::collections::BTreeSet;
use std::fmt::Write as _;

use elbowroom::model::ground::FluentId;
use elbowroom::model::validate::{self, Margin, Report, Settings, Verdict, Violation};
use elbowroom::model::{Footprint, Task, TimeTriggeredPlan};
use serde_json::{Value, json};

use crate::args::CheckArgs;
use crate::exit::{Answer, Exit, Failure};
use crate::input::AnyPlan;
use crate::limits::push_wrapped;
use crate::look::{BAD, FAINT, GOOD, Look, STRONG, styled};
use crate::output::counted;
use crate::{input, json, number, output};

/// Only the tightest margins are shown to people; `--json` has all.
const MARGINS_SHOWN: usize = 8;

/// Checks a problem, or a plan for it.
pub(crate) fn run(arguments: &CheckArgs) -> Answer {
    let mut task = input::task(&arguments.problem)?;
    let Some(path) = &arguments.plan else {
        return readable(&task, arguments.json);
    };
    let plan = match input::any_plan(&mut task, path)? {
        AnyPlan::TimeTriggered(plan) => plan,
        AnyPlan::Stn(_) => {
            return Err(Failure::new(
                format!(
                    "{} is an STN plan file, which stands for many plans",
                    path.display()
                ),
                "`elbowroom envelope` says whether all of them work; `check` judges a plan with \
                 fixed times",
            ));
        }
    };
    let settings = match &arguments.tolerance {
        Some(tolerance) => Settings::like_val(tolerance.clone()),
        None => Settings {
            epsilon: Some(arguments.epsilon.clone()),
            ..Settings::default()
        },
    };
    let name = path.display().to_string();
    let verdict = validate::validate(&task, &plan, &settings);
    let exit = match &verdict {
        Verdict::Valid(_) => Exit::Yes,
        Verdict::Invalid(_) => Exit::No,
        Verdict::Undecided(why) => {
            return Err(Failure::new(
                format!("cannot tell whether {name} is valid: {why}"),
                "",
            ));
        }
    };
    if arguments.json {
        output::print_json(&document(&task, &name, &verdict))?;
    } else {
        let touched = touched(&task, &plan);
        output::print(&text(&task, &name, &verdict, &touched, Look::of_stdout()))?;
    }
    Ok(exit)
}

/// Says that domain and problem can be read.
fn readable(task: &Task, as_json: bool) -> Answer {
    let problem = task.problem();
    if as_json {
        output::print_json(&json!({
            "format": "elbowroom-check",
            "version": 1,
            "answer": "readable",
            "domain": problem.domain,
            "problem": problem.name,
        }))?;
    } else {
        output::print(&format!(
            "{}: domain {} and problem {} can be read\n  {}, {}, {}, {}, {}\n",
            styled(GOOD, "ok"),
            problem.domain,
            problem.name,
            counted(problem.schemas.len(), "action"),
            counted(problem.predicates.len(), "predicate"),
            counted(problem.functions.len(), "function"),
            counted(problem.objects.len(), "object"),
            counted(problem.timed.len(), "timed initial"),
        ))?;
    }
    Ok(Exit::Yes)
}

/// The fluents that the plan's actions change.
fn touched(task: &Task, plan: &TimeTriggeredPlan) -> BTreeSet<FluentId> {
    let steps = plan.steps.iter();
    steps
        .flat_map(|step| {
            let start = Footprint::of_start(task, &step.action);
            [start, Footprint::of_end(task, &step.action)]
        })
        .flat_map(|footprint| footprint.shifts.into_iter().chain(footprint.assigns))
        .collect()
}

fn text(
    task: &Task,
    name: &str,
    verdict: &Verdict,
    touched: &BTreeSet<FluentId>,
    look: Look,
) -> String {
    match verdict {
        Verdict::Valid(report) => success(task, name, report, touched, look),
        Verdict::Invalid(violation) => {
            let mut text = format!("{}: {name} does not work\n", styled(BAD, "invalid"));
            push_wrapped(&mut text, &violation.to_string(), 2, look.width);
            text
        }
        Verdict::Undecided(why) => format!("undecided: {why}\n"),
    }
}

fn success(
    task: &Task,
    name: &str,
    report: &Report,
    touched: &BTreeSet<FluentId>,
    look: Look,
) -> String {
    let mut text = format!(
        "{}: {name} reaches the goal at {}\n",
        styled(GOOD, "valid"),
        number::nearest(&report.makespan)
    );
    let changed: Vec<_> = report
        .state
        .values
        .iter()
        .filter(|(fluent, _)| touched.contains(fluent))
        .collect();
    if !changed.is_empty() {
        let _ = write!(text, "\n{}\n", styled(STRONG, "Values at the end"));
        for (fluent, value) in changed {
            let _ = writeln!(
                text,
                "  {} = {}",
                task.fluent_name(*fluent),
                number::nearest(value)
            );
        }
    }
    let mut margins: Vec<&Margin> = report.margins.iter().collect();
    margins.sort_by(|a, b| a.margin.cmp(&b.margin));
    if !margins.is_empty() {
        let _ = write!(text, "\n{}\n", styled(STRONG, "Smallest margins"));
    }
    for margin in margins.iter().take(MARGINS_SHOWN) {
        let of = match &margin.action {
            Some(action) => format!(" of {}", action.name),
            None => String::new(),
        };
        let line = format!(
            "{} in {}, {}{of} at {}",
            number::nearest(&margin.margin),
            margin.condition,
            margin.when,
            number::nearest(&margin.time),
        );
        push_wrapped(&mut text, &line, 2, look.width);
    }
    if margins.len() > MARGINS_SHOWN {
        let more = format!(
            "  and {} more (--json has all)",
            margins.len() - MARGINS_SHOWN
        );
        let _ = writeln!(text, "{}", styled(FAINT, &more));
    }
    text
}

fn document(task: &Task, name: &str, verdict: &Verdict) -> Value {
    let mut document = json!({
        "format": "elbowroom-check",
        "version": 1,
        "plan": name,
        "domain": task.problem().domain,
        "problem": task.problem().name,
    });
    match verdict {
        Verdict::Valid(report) => {
            document["answer"] = json!("valid");
            document["makespan"] = json::number(&report.makespan);
            document["values"] = report
                .state
                .values
                .iter()
                .map(|(fluent, value)| {
                    json!({ "fluent": task.fluent_name(*fluent), "value": json::number(value) })
                })
                .collect();
            document["margins"] = report.margins.iter().map(margin_document).collect();
        }
        Verdict::Invalid(violation) => {
            document["answer"] = json!("invalid");
            document["violation"] = violation_document(violation);
        }
        Verdict::Undecided(_) => {}
    }
    document
}

fn margin_document(margin: &Margin) -> Value {
    json!({
        "condition": margin.condition,
        "when": margin.when.to_string(),
        "action": margin.action.as_ref().map(|action| &action.name),
        "margin": json::number(&margin.margin),
        "time": json::number(&margin.time),
        "strict": margin.is_strict,
    })
}

/// A violation: when, which action (`null` for the goal), and what is wrong in words.
pub(crate) fn violation_document(violation: &Violation) -> Value {
    json!({
        "time": json::number(&violation.time),
        "action": violation.action.as_ref().map(|action| &action.name),
        "step": violation.action.as_ref().map(|action| action.step),
        "message": violation.to_string(),
    })
}
