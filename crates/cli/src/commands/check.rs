//! `elbowroom check`: validation of a plan.

use std::fmt::Write as _;

use elbowroom::RoundingRule;
use elbowroom::answers::RequestError;
use elbowroom::answers::check::{
    CheckAnswer, CheckFinding, CheckRequest, FluentValue, MarginAnswer, PreferenceAnswer,
    ProblemSummary, ValidationReport, check,
};
use elbowroom::model::Task;
use elbowroom::model::validate::Settings;
use elbowroom::text::{Record, Severity};

use crate::args::{CheckArgs, DiagnosticsForm};
use crate::exit::{Answer, Exit, Failure};
use crate::output::Output;
use crate::terminal::{EMPHASIS, ERROR, SECONDARY, SUCCESS, TextLayout, stdout_layout, styled};
use crate::{input, number, output};
use elbowroom::report::console::push_wrapped;
use elbowroom_executive::messages::count_with_noun;

/// Advice if the given plan is an STN plan.
const NETWORK_ADVICE: &str = "`elbowroom envelope` checks whether all of them work; `check` \
                              validates a plan with fixed times";

/// Maximum number of margins printed, the tightest ones; `--json` has all.
const MARGINS_SHOWN: usize = 8;

/// Checks a problem, or validates a plan for it.
pub(crate) fn run(arguments: &CheckArgs, output: &mut Output) -> Answer {
    if arguments.verbose {
        return Err(Failure::new(
            "`check` has no option -v",
            "leave it out, or use `elbowroom val -v`, which prints the events of a plan as VAL does",
        ));
    }
    let answer = validate_plan(arguments, output);
    if arguments.diagnostics == DiagnosticsForm::Lines {
        let failed = answer.as_ref().err().map(Failure::diagnostics);
        let findings = output.warnings().iter().chain(failed.unwrap_or_default());
        output::print(&findings.map(line).collect::<String>())?;
    }
    answer
}

/// Formats a finding as one line in the style of VAL's parser.
fn line(finding: &Record) -> String {
    let severity = match finding.severity {
        Severity::Error => "Error",
        Severity::Warning => "Warning",
    };
    let mut line = format!(
        "{}: line: {}: {severity}: {}",
        finding.file, finding.line, finding.message
    );
    if let Some(advice) = &finding.advice {
        let _ = write!(line, " ({advice})");
    }
    // Names in a message may contain line feeds.
    line.replace(['\n', '\r'], " ") + "\n"
}

fn validate_plan(arguments: &CheckArgs, output: &mut Output) -> Answer {
    let task = input::task(&arguments.problem, &arguments.epsilon, output)?;
    let rule = RoundingRule::with_tolerance(arguments.tolerance.clone());
    let plan = match &arguments.plan {
        Some(path) => Some(input::time_triggered(
            &task,
            path,
            &rule,
            NETWORK_ADVICE,
            output,
        )?),
        None => None,
    };
    let name = arguments
        .plan
        .as_ref()
        .map(|path| path.display().to_string());
    let name = name.unwrap_or_default();
    let request = CheckRequest {
        task: &task,
        plan: plan.as_ref(),
        name: name.clone(),
        settings: Settings::default(),
    };
    let answer = check(&request).map_err(|error| match error {
        RequestError::Undecided(why) => Failure::new(
            format!("it is undecided whether {name} is valid: {why}"),
            "",
        ),
        error => Failure::new(error, ""),
    })?;
    let is_invalid = matches!(
        &answer,
        CheckAnswer::Plan(ValidationReport {
            finding: CheckFinding::Invalid { .. },
            ..
        })
    );
    if arguments.json {
        output.document(&answer)?;
    } else {
        output::print(&text(&task, &answer, stdout_layout()))?;
        if is_invalid {
            input::advise_repair();
        }
    }
    Ok(if is_invalid { Exit::No } else { Exit::Yes })
}

fn text(task: &Task, answer: &CheckAnswer, look: TextLayout) -> String {
    match answer {
        CheckAnswer::Problem(read) => problem_text(task, read),
        CheckAnswer::Plan(checked) => match &checked.finding {
            CheckFinding::Valid {
                makespan,
                metric,
                values,
                margins,
                preferences,
                ..
            } => {
                let mut text = format!(
                    "{}: {} reaches the goal at {}\n",
                    styled(SUCCESS, "valid"),
                    checked.plan,
                    number::nearest(makespan)
                );
                if let Some(metric) = metric {
                    let _ = writeln!(text, "  metric: {}", number::nearest(metric));
                }
                push_values(&mut text, values);
                push_preferences(&mut text, preferences, look);
                push_margins(&mut text, margins, look);
                text
            }
            CheckFinding::Invalid { violation } => {
                let mut text = format!(
                    "{}: {} does not work\n",
                    styled(ERROR, "invalid"),
                    checked.plan
                );
                push_wrapped(&mut text, &violation.message, 2, look.width);
                text
            }
        },
    }
}

/// Reports that domain and problem are readable.
fn problem_text(task: &Task, read: &ProblemSummary) -> String {
    let problem = task.problem();
    format!(
        "{}: domain {} and problem {} can be read\n  {}, {}, {}, {}, {}\n",
        styled(SUCCESS, "ok"),
        read.domain,
        read.problem,
        count_with_noun(problem.schemas.len(), "action"),
        count_with_noun(problem.predicates.len(), "predicate"),
        count_with_noun(problem.functions.len(), "function"),
        count_with_noun(problem.objects.len(), "object"),
        count_with_noun(problem.timed.len(), "timed initial"),
    )
}

/// Appends the fluents that the plan's actions change.
fn push_values(text: &mut String, values: &[FluentValue]) {
    let mut changed = values.iter().filter(|value| value.is_changed).peekable();
    if changed.peek().is_some() {
        let _ = write!(text, "\n{}\n", styled(EMPHASIS, "Values at the end"));
    }
    for FluentValue { fluent, value, .. } in changed {
        let _ = writeln!(text, "  {fluent} = {}", number::nearest(&value.0));
    }
}

/// Appends the preferences that the plan violates.
fn push_preferences(text: &mut String, preferences: &[PreferenceAnswer], look: TextLayout) {
    if !preferences.is_empty() {
        let _ = write!(text, "\n{}\n", styled(EMPHASIS, "Violated preferences"));
    }
    for PreferenceAnswer {
        name,
        violations,
        why,
    } in preferences
    {
        let times = match violations {
            Some(1) | None => String::new(),
            Some(several) => format!(", {several} times"),
        };
        push_wrapped(
            text,
            &format!("{name}{times}: {}", why.join("; ")),
            2,
            look.width,
        );
    }
}

/// Appends the tightest margins.
fn push_margins(text: &mut String, margins: &[MarginAnswer], look: TextLayout) {
    let mut margins: Vec<&MarginAnswer> = margins.iter().collect();
    margins.sort_by(|a, b| a.margin.cmp(&b.margin));
    if !margins.is_empty() {
        let _ = write!(text, "\n{}\n", styled(EMPHASIS, "Smallest margins"));
    }
    for margin in margins.iter().take(MARGINS_SHOWN) {
        let of = match &margin.action {
            Some(action) => format!(" of {action}"),
            None => String::new(),
        };
        let line = format!(
            "{} in {}, {}{of} at {}",
            number::nearest(&margin.margin),
            margin.condition,
            margin.when,
            number::nearest(&margin.time),
        );
        push_wrapped(text, &line, 2, look.width);
    }
    if margins.len() > MARGINS_SHOWN {
        let more = format!(
            "  and {} more (--json has all)",
            margins.len() - MARGINS_SHOWN
        );
        let _ = writeln!(text, "{}", styled(SECONDARY, &more));
    }
}
