//! Text of a learnt model.

use std::fmt::Write as _;

use elbowroom_num::End;
use elbowroom_report::console::{
    EMPHASIS, ERROR, HINT, SUCCESS, TextLayout, count_with_noun, push_paragraph, push_wrapped,
    styled,
};
use elbowroom_report::table::Table;

use super::{
    ConformalBox, DriftAnswer, FitAnswer, GroupAnswer, LearnAnswer, LearnRequest, LearntAction,
    LearntDurations, LearntRate, PredictionAnswer, Verdict, mean_planned_and_actual,
};

impl LearnAnswer {
    /// Renders the answer to a request as text for a console.
    pub fn text(&self, request: &LearnRequest, look: TextLayout) -> String {
        render(request, self, look)
    }
}

fn render(request: &LearnRequest, answer: &LearnAnswer, look: TextLayout) -> String {
    let logs = count_with_noun(answer.logs.len(), "log");
    let attempts = count_with_noun(answer.attempts, "attempt");
    let title = format!("Learnt from {logs} with {attempts}");
    let mut text = format!("{}\n\n", styled(EMPHASIS, &title));
    if answer.actions.is_empty() {
        text.push_str("No action was started.\n");
        return text;
    }
    let rows = answer
        .actions
        .iter()
        .flat_map(|action| rows(request, action));
    let table = Table {
        caption: String::new(),
        headings: ["action", "planned", "actual", "duration", "failed"]
            .map(str::to_owned)
            .to_vec(),
        keys: 1,
        rows: rows.collect(),
        notes: Vec::new(),
    };
    text.push_str(table.fit_to_width(look.width).trim_start_matches('\n'));
    predictions(&mut text, answer, look);
    changes(&mut text, answer, look);
    for action in &answer.actions {
        remarks(&mut text, action, look);
    }
    if let Some(timeouts) = &answer.timeouts {
        let line = format!("Time-outs for `envelope`, `run` and `serve`: --timeout \"{timeouts}\"");
        text.push('\n');
        push_paragraph(&mut text, &line, look.width);
    }
    if let Some(inside) = &answer.inside {
        conformal(&mut text, inside, look);
    }
    text
}

/// Returns the rows of an action: one, or one for each ground action with a separate distribution.
fn rows(request: &LearnRequest, action: &LearntAction) -> Vec<Vec<String>> {
    let records = request.logs.iter().flat_map(|log| &log.records);
    let records: Vec<_> = records.cloned().collect();
    let (planned, actual) = match mean_planned_and_actual(&records, &action.action) {
        Some((planned, actual)) => (short(planned), short(actual)),
        None => (String::new(), String::new()),
    };
    let failures = &action.failures;
    let failed = format!("{} of {}", failures.failed, failures.ended);
    let row = |name: &str, words: String, failed: String| {
        vec![
            name.to_owned(),
            planned.clone(),
            actual.clone(),
            words,
            failed,
        ]
    };
    match &action.durations {
        LearntDurations::Unknown => vec![row(&action.action, "unknown".to_owned(), failed)],
        LearntDurations::Together { group } => {
            vec![row(&action.action, distribution(group, ""), failed)]
        }
        LearntDurations::Relative { group } => {
            let words = distribution(group, " x planned");
            vec![row(&action.action, words, failed)]
        }
        LearntDurations::Apart { groups } => {
            let mut rows = vec![row(&action.action, "separately:".to_owned(), failed)];
            for named in groups {
                let words = distribution(&named.group, "");
                let name = format!("  {}", named.action);
                rows.push(vec![
                    name,
                    String::new(),
                    String::new(),
                    words,
                    String::new(),
                ]);
            }
            rows
        }
    }
}

/// Appends a table of predictions and observations.
fn predictions(text: &mut String, answer: &LearnAnswer, look: TextLayout) {
    let row = |action: &LearntAction| {
        let prediction = action.prediction.filter(|it| it.ended > 0)?;
        let PredictionAnswer {
            durations,
            predicted_mean,
            observed_mean,
            within,
            ended,
            predicted_failures,
            failures,
        } = prediction;
        let mean = |mean| {
            if durations > 0 {
                short(mean)
            } else {
                String::new()
            }
        };
        Some(vec![
            action.action.clone(),
            mean(predicted_mean),
            mean(observed_mean),
            format!("{within} of {durations}"),
            short(predicted_failures),
            format!("{failures} of {ended}"),
        ])
    };
    let rows: Vec<Vec<String>> = answer.actions.iter().filter_map(row).collect();
    if rows.is_empty() {
        return;
    }
    let headings = ["action", "mean", "observed", "within", "failed", "observed"];
    let table = Table {
        caption: String::new(),
        headings: headings.map(str::to_owned).to_vec(),
        keys: 1,
        rows,
        notes: Vec::new(),
    };
    text.push('\n');
    text.push_str("Predictions of the world file and observations (within: durations in the central 90 %):\n\n");
    text.push_str(table.fit_to_width(look.width).trim_start_matches('\n'));
}

/// Appends a table of the exogenous changes, which no action and no timed initial makes.
fn changes(text: &mut String, answer: &LearnAnswer, look: TextLayout) {
    if answer.changes.is_empty() {
        return;
    }
    // Expected rates are shown if a world file was given for comparison.
    let is_expected = answer.changes.iter().any(|it| it.all.expected.is_some());
    let row = |name: &str, becomes: bool, rate: &LearntRate| {
        let (lower, upper) = rate.interval.unwrap_or((0.0, f64::INFINITY));
        let mut row = vec![name.to_owned(), becomes.to_string()];
        if is_expected {
            row.push(rate.expected.map_or(String::new(), short));
        }
        row.extend([
            rate.changes.to_string(),
            short(rate.seconds),
            rate.per_second.map_or(String::new(), rate_words),
            format!("{} to {}", rate_words(lower), rate_words(upper)),
        ]);
        row
    };
    let mut rows = Vec::new();
    for learnt in &answer.changes {
        rows.push(row(&learnt.predicate, learnt.becomes, &learnt.all));
        let apart = learnt.apart.iter();
        rows.extend(apart.map(|(fact, rate)| row(&format!("  {fact}"), learnt.becomes, rate)));
    }
    let mut headings = vec!["fact", "becomes"];
    if is_expected {
        headings.push("expected");
    }
    headings.extend(["times", "seconds", "per second", "95 %"]);
    let table = Table {
        caption: String::new(),
        headings: headings.into_iter().map(str::to_owned).collect(),
        keys: 2,
        rows,
        notes: Vec::new(),
    };
    text.push('\n');
    text.push_str("Exogenous changes, which no action and no timed initial makes:\n\n");
    text.push_str(table.fit_to_width(look.width).trim_start_matches('\n'));
    for learnt in answer.changes.iter().filter(|it| is_surprising(&it.all)) {
        let becomes = if learnt.becomes { "true" } else { "false" };
        let words = format!(
            "{}: facts of {} became {becomes} {}, which is unlikely with the rate of the world file.",
            styled(HINT, "surprise"),
            learnt.predicate,
            if learnt.all.changes == 1 {
                "once".to_owned()
            } else {
                format!("{} times", learnt.all.changes)
            },
        );
        text.push('\n');
        push_paragraph(text, &words, look.width);
    }
}

/// Returns `true` if the expected rate lies outside the 95 % interval of the observations.
fn is_surprising(rate: &LearntRate) -> bool {
    let Some((expected, (lower, upper))) = rate.expected.zip(rate.interval) else {
        return false;
    };
    let expected = expected / rate.seconds;
    expected < lower || expected > upper
}

/// Formats a rate with four decimal digits, because rates are small.
fn rate_words(rate: f64) -> String {
    format!("{rate:.4}")
}

fn distribution(group: &GroupAnswer, unit: &str) -> String {
    let mut words = fit(&group.fit);
    words.push_str(unit);
    let _ = write!(words, ", from {}", group.observed);
    if group.censored > 0 {
        let _ = write!(words, " and {} cut off", group.censored);
    }
    words
}

fn fit(fit: &FitAnswer) -> String {
    let mut numbers = fit.numbers.iter().map(|(_, value)| short(*value));
    match (fit.family.as_str(), numbers.next(), numbers.next()) {
        ("constant", Some(value), _) => value,
        ("uniform", Some(from), Some(to)) => format!("uniform {from} to {to}"),
        (family, Some(mean), Some(deviation)) => format!("{family} {mean} ± {deviation}"),
        (family, _, _) => format!("{family}, mean {}", short(fit.mean)),
    }
}

fn remarks(text: &mut String, action: &LearntAction, look: TextLayout) {
    let mut remark = |words: String| {
        text.push('\n');
        push_paragraph(text, &words, look.width);
    };
    if let Some(delay) = &action.delay {
        remark(format!(
            "{} starts late: {} seconds after the command.",
            action.action,
            fit(delay)
        ));
    }
    let drifted = |drift: &DriftAnswer, what: &str| {
        let since = drift.since?;
        Some(format!(
            "{}: the {what} of {} drifted, detected at number {since} of them. The learnt model \
             mixes the values before and after.",
            styled(HINT, "drift"),
            action.action
        ))
    };
    let durations = action
        .drift
        .as_ref()
        .and_then(|drift| drifted(drift, "durations"));
    let failures = drifted(&action.failure_drift, "failures");
    for words in durations.into_iter().chain(failures) {
        remark(words);
    }
}

fn conformal(text: &mut String, inside: &ConformalBox, look: TextLayout) {
    let percent = short(100.0 * inside.probability);
    let verdict = match inside.verdict {
        Verdict::Inside => format!(
            "{}: with a probability of at least {percent} %, all durations of the next run lie in these \
             intervals, and the plan works for all values in them.",
            styled(SUCCESS, "inside")
        ),
        Verdict::Outside => format!(
            "{}: with a probability of at least {percent} %, all durations of the next run lie in these \
             intervals, but the plan does not work for all values in them.",
            styled(ERROR, "outside")
        ),
        Verdict::Undecided => format!(
            "{}: with a probability of at least {percent} %, all durations of the next run lie in these \
             intervals, but processes and events may behave differently in them, so it is \
             undecided whether the plan works for all values in them.",
            styled(HINT, "undecided")
        ),
        Verdict::TooFew => format!(
            "{}: there are too few samples for a probability of {percent} %.",
            styled(ERROR, "too few")
        ),
        Verdict::NoEnvelope => format!(
            "{}: the plan does not work even with its nominal durations; `elbowroom check` \
             explains why.",
            styled(ERROR, "no envelope")
        ),
    };
    text.push('\n');
    push_paragraph(text, &verdict, look.width);
    if let Some(reason) = &inside.reason {
        push_wrapped(text, reason, 2, look.width);
    }
    if inside.intervals.is_empty() {
        return;
    }
    let end = |end: &End| match end {
        End::Infinite => "inf".to_owned(),
        End::Closed(value) | End::Open(value) => value.to_decimal(3),
    };
    let rows = inside.intervals.iter().map(|interval| {
        let samples = match interval.needed {
            Some(needed) => format!("{} of {needed}", interval.samples),
            None => interval.samples.to_string(),
        };
        vec![
            interval.parameter.clone(),
            interval.action.clone(),
            interval.nominal.to_decimal(3),
            end(&interval.lower),
            end(&interval.upper),
            samples,
        ]
    });
    let table = Table {
        caption: String::new(),
        headings: ["", "action", "nominal", "lower", "upper", "samples"]
            .map(str::to_owned)
            .to_vec(),
        keys: 1,
        rows: rows.collect(),
        notes: Vec::new(),
    };
    text.push('\n');
    text.push_str(table.fit_to_width(look.width).trim_start_matches('\n'));
}

/// Formats a number with about three significant digits.
fn short(value: f64) -> String {
    let digits = match value.abs() {
        value if value >= 100.0 => 0,
        value if value >= 10.0 => 1,
        value if value >= 1.0 => 2,
        _ => 3,
    };
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}
