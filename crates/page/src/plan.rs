//! Page of a plan, with its envelope if there is one.

mod sliders;
mod tables;

use std::collections::BTreeMap;

use elbowroom::answers::Exact;
use elbowroom::answers::envelope::timeline::{TimedAction, Timeline, WindowAnswer};
use elbowroom::answers::envelope::{
    Counterexample, EnvelopeAnswer, EnvelopeFinding, LimitedRange, NominalFailure, Stop,
};
use elbowroom::answers::plan::{PlanAnswer, PlanFinding};
use elbowroom::execution::run::TimeoutRule;
use elbowroom::report::decimal::nearest;

use crate::document::{
    Bar, Chart, Document, Mark, Prose, Section, Table, Text, Texts, Tone, Verdict,
};
use crate::lanes::{Lanes, Occupant, lanes};
use tables::{ends, ranges, slack_table};

pub(crate) use sliders::{SliderInterval, sliders};
pub(crate) use tables::{quantities, times};

/// The page about an envelope.
pub(crate) fn envelope(answer: &EnvelopeAnswer) -> Document {
    let mut texts = Texts::default();
    let mut facts = vec![
        ("domain".to_owned(), answer.domain.clone()),
        ("problem".to_owned(), answer.problem.clone()),
        ("plan".to_owned(), answer.plan.clone()),
        (
            "guarantee".to_owned(),
            serialized_name(&answer.settings.guarantee),
        ),
        ("epsilon".to_owned(), nearest(&answer.settings.epsilon)),
        ("time-out".to_owned(), answer.settings.timeout.in_words()),
    ];
    let mut sections = Vec::new();
    let verdict = match &answer.finding {
        EnvelopeFinding::Envelope {
            parameters,
            stop,
            checks,
            timeline,
            inequalities,
            ..
        } => {
            facts.push(("boxes checked".to_owned(), checks.to_string()));
            if let Some(timeline) = timeline {
                sections.push(Section::Chart(chart(timeline, parameters, &mut texts)));
                let reaches: Vec<SliderInterval<'_>> = parameters
                    .iter()
                    .map(|it| SliderInterval::of(&it.range))
                    .collect();
                let sliders = inequalities
                    .as_ref()
                    .and_then(|it| sliders(timeline, &reaches, it));
                sections.extend(sliders.map(Section::Sliders));
            }
            sections.push(Section::Table(slack_table(parameters, &mut texts)));
            sections.extend(
                timeline
                    .as_ref()
                    .map(|it| Section::Table(times(it, "in the envelope"))),
            );
            let has_timeouts = answer.settings.timeout != TimeoutRule::Off;
            let before = if has_timeouts {
                " and each action ends before its time-out"
            } else {
                ""
            };
            positive_verdict(&match stop {
                Stop::Converged => format!(
                    "The plan works as long as each quantity stays inside its interval{before}. \
                     The quantities may vary independently."
                ),
                _ => format!(
                    "The plan works as long as each quantity stays inside its interval{before}. \
                     The search was stopped early: wider intervals may be possible."
                ),
            })
        }
        EnvelopeFinding::Inside { parameters } => {
            sections.push(Section::Table(ranges(parameters)));
            positive_verdict("The plan works everywhere in this box.")
        }
        EnvelopeFinding::Outside {
            parameters,
            counterexample,
        } => {
            sections.extend(failure(counterexample, &mut texts));
            sections.push(Section::Table(ranges(parameters)));
            negative_verdict("The plan does not work everywhere in this box.")
        }
        EnvelopeFinding::Fails(NominalFailure::AsPlanned {
            parameters,
            counterexample,
        }) => {
            sections.extend(failure(counterexample, &mut texts));
            sections.push(Section::Table(quantities(parameters)));
            sections.push(repair_advice());
            negative_verdict("The plan fails even without deviations.")
        }
        EnvelopeFinding::Fails(NominalFailure::Invalid { violation }) => {
            sections.push(prose("Violation", vec![violation.message.clone()]));
            sections.push(repair_advice());
            negative_verdict("The plan is not valid.")
        }
        EnvelopeFinding::None { stop } => Verdict {
            tone: Tone::Plain,
            words: format!(
                "No result: the search was stopped before its first check ({}).",
                serialized_name(stop)
            ),
        },
    };
    Document {
        title: format!("Elbow room of {}", name_of(&answer.plan, &answer.problem)),
        verdict,
        facts,
        sections,
        texts: texts.into_texts(),
        is_paused: false,
        more: Vec::new(),
    }
}

/// The page about the result of a planner.
pub(crate) fn planner_answer(answer: &PlanAnswer) -> Document {
    let mut texts = Texts::default();
    let mut facts = vec![
        ("domain".to_owned(), answer.domain.clone()),
        ("problem".to_owned(), answer.problem.clone()),
        ("planner".to_owned(), answer.planner.clone()),
    ];
    let mut sections = Vec::new();
    let verdict = match &answer.finding {
        PlanFinding::Plan {
            makespan,
            metric,
            repaired,
            steps,
            ..
        } => {
            if let Some(metric) = metric {
                facts.push(("metric".to_owned(), nearest(metric)));
            }
            let timeline = fixed_timeline(steps.iter().map(|step| {
                let duration = step.duration.as_ref();
                let end = duration.map(|it| (&step.start.0 + &it.0).into());
                ("", step.action.as_str(), step.start.clone(), end)
            }));
            sections.push(Section::Chart(chart(&timeline, &[], &mut texts)));
            sections.push(Section::Table(times(&timeline, "")));
            if let Some(repaired) = repaired {
                let heading = "Errors in the planner's own times";
                sections.push(prose(heading, vec![repaired.clone()]));
            }
            positive_verdict(&format!(
                "A plan that reaches the goal at {}.",
                nearest(makespan)
            ))
        }
        PlanFinding::NoPlan { reason, .. } => {
            negative_verdict(&format!("There is no plan: {reason}"))
        }
        PlanFinding::None { reason, .. } => Verdict {
            tone: Tone::Plain,
            words: format!("It is not known whether there is a plan: {reason}"),
        },
    };
    Document {
        title: format!("Plan for {}", answer.problem),
        verdict,
        facts,
        sections,
        texts: texts.into_texts(),
        is_paused: false,
        more: Vec::new(),
    }
}

/// Builds a timeline of actions with fixed times: label, name, start and end of each.
fn fixed_timeline<'a>(
    actions: impl Iterator<Item = (&'a str, &'a str, Exact, Option<Exact>)>,
) -> Timeline {
    let actions = actions.map(|(instance, action, start, end)| TimedAction {
        instance: instance.to_owned(),
        action: action.to_owned(),
        start,
        end,
        start_window: WindowAnswer::default(),
        end_window: None,
        parameter: None,
    });
    Timeline {
        actions: actions.collect(),
        ..Timeline::default()
    }
}

/// Describes a counterexample, as sentences and as a schedule.
fn failure(example: &Counterexample, texts: &mut Texts) -> Vec<Section> {
    let mut paragraphs = vec![example.message.clone()];
    if let Some(shortfall) = &example.shortfall {
        paragraphs.push(format!("By {}.", nearest(shortfall)));
    }
    paragraphs.extend(example.verdict.clone());
    paragraphs.extend(example.plays.iter().cloned());
    let mut sections = vec![prose("Possible failures", paragraphs)];
    if !example.schedule.is_empty() {
        let timeline = fixed_timeline(example.schedule.iter().map(|happening| {
            let (start, end) = (happening.start.clone(), happening.end.clone());
            (
                happening.instance.as_str(),
                happening.action.as_str(),
                start,
                end,
            )
        }));
        let mut chart = chart(&timeline, &[], texts);
        "A schedule that fails".clone_into(&mut chart.heading);
        sections.push(Section::Chart(chart));
    }
    if !example.values.is_empty() {
        let row =
            |(name, value): (&String, &Exact)| vec![name.as_str().into(), nearest(&value.0).into()];
        sections.push(Section::Table(Table {
            heading: "Values for which it fails".to_owned(),
            columns: vec![("parameter".to_owned(), false), ("value".to_owned(), true)],
            rows: example.values.iter().map(row).collect(),
            ..Table::default()
        }));
    }
    sections
}

/// The plan as a chart.
pub(crate) fn chart(
    timeline: &Timeline,
    limited_ranges: &[LimitedRange],
    texts: &mut Texts,
) -> Chart {
    let by_name: BTreeMap<&str, &LimitedRange> = limited_ranges
        .iter()
        .map(|limited| (limited.range.quantity.name.as_str(), limited))
        .collect();
    let time = |action: &TimedAction| {
        let end = action.end.as_ref().unwrap_or(&action.start);
        (action.start.0.to_f64(), end.0.to_f64())
    };
    let occupants: Vec<Occupant<'_>> = timeline
        .actions
        .iter()
        .map(|action| Occupant {
            name: &action.action,
            time: time(action),
            counts: true,
        })
        .collect();
    let type_of = |object: &str| timeline.types.get(object).map(String::as_str);
    let Lanes {
        groupings,
        chosen,
        of,
    } = lanes(&occupants, &type_of);
    let mut bars = Vec::with_capacity(timeline.actions.len());
    for (action, lanes) in timeline.actions.iter().zip(of) {
        let limited = action
            .parameter
            .as_deref()
            .and_then(|name| by_name.get(name));
        bars.push(Bar {
            name: action.action.clone(),
            planned: Some(time(action)),
            starts: band(&action.start_window),
            ends: action.end_window.as_ref().and_then(band),
            lanes,
            details: details(action, limited.copied(), texts),
            ..Bar::default()
        });
    }
    let marks: Vec<Mark> = timeline
        .timed
        .iter()
        .map(|timed| Mark {
            at: timed.time.0.to_f64(),
            name: timed.changes.join(", "),
            is_event: false,
        })
        .collect();
    Chart {
        heading: "The plan in time".to_owned(),
        end: end_of_axis(&bars, &marks),
        groupings,
        chosen,
        bars,
        marks,
        ..Chart::default()
    }
}

/// Returns the end of the time axis: after all planned and executed actions, and after windows and
/// marks up to three times as far.
pub(crate) fn end_of_axis(bars: &[Bar], marks: &[Mark]) -> f64 {
    let spans = bars
        .iter()
        .flat_map(|bar| [bar.planned, bar.actual])
        .flatten();
    let done = spans.map(|(_, end)| end).fold(0.0, f64::max);
    let latest = |band: Option<(Option<f64>, Option<f64>)>| band.and_then(|(_, latest)| latest);
    let bands = bars
        .iter()
        .flat_map(|bar| [latest(bar.starts), latest(bar.ends)])
        .flatten();
    let later = bands.chain(marks.iter().map(|mark| mark.at));
    let far = if done > 0.0 { 3.0 * done } else { f64::MAX };
    let end = later.filter(|time| *time <= far).fold(done, f64::max);
    if end > 0.0 { end } else { 1.0 }
}

/// Converts a window for drawing; `None` if it is unbounded on both sides.
pub(crate) fn band(window: &WindowAnswer) -> Option<(Option<f64>, Option<f64>)> {
    let decimal = |end: &Option<Exact>| end.as_ref().map(|it| it.0.to_f64());
    let band = (decimal(&window.earliest), decimal(&window.latest));
    (band != (None, None)).then_some(band)
}

/// Describes a window; `None` if it is unbounded on both sides.
pub(crate) fn window_words(window: &WindowAnswer) -> Option<String> {
    match (&window.earliest, &window.latest) {
        (None, None) => None,
        (Some(earliest), None) => Some(format!("{} or later", nearest(&earliest.0))),
        (None, Some(latest)) => Some(format!("{} or earlier", nearest(&latest.0))),
        (Some(earliest), Some(latest)) if earliest == latest => Some(nearest(&earliest.0)),
        (Some(earliest), Some(latest)) => Some(format!(
            "{} to {}",
            nearest(&earliest.0),
            nearest(&latest.0)
        )),
    }
}

fn details(
    action: &TimedAction,
    limited: Option<&LimitedRange>,
    texts: &mut Texts,
) -> Vec<(&'static str, Text)> {
    let mut details: Vec<(&'static str, Text)> = Vec::new();
    let start = nearest(&action.start.0);
    details.push(match &action.end {
        Some(end) => ("planned", format!("{start} to {}", nearest(&end.0)).into()),
        None => ("planned", start.into()),
    });
    let windows = [
        ("may start at", Some(&action.start_window)),
        ("may end at", action.end_window.as_ref()),
    ];
    for (label, window) in windows {
        if let Some(words) = window.and_then(window_words) {
            details.push((label, words.into()));
        }
    }
    let Some(limited) = limited else {
        if let Some(end) = &action.end {
            details.push(("takes", nearest(&(&end.0 - &action.start.0)).into()));
        }
        return details;
    };
    let nominal = &limited.range.quantity.nominal;
    let (lower, upper) = ends(&limited.range);
    details.push(("takes", nearest(nominal).into()));
    details.push((
        "may take",
        format!("{lower} to {upper} ({})", limited.range.quantity.name).into(),
    ));
    if let Some(timeout) = &limited.range.timeout {
        details.push(("times out after", nearest(timeout).into()));
    }
    let limits = [
        ("lower limit", &limited.lower_limit),
        ("upper limit", &limited.upper_limit),
    ];
    for (label, limit) in limits {
        if let Some(limit) = limit {
            details.push((label, texts.share(limit)));
        }
    }
    details
}

/// Section that names the command for repairs. It is part of each page of a plan that does not
/// work.
pub(crate) fn repair_advice() -> Section {
    let advice = "elbowroom envelope DOMAIN PROBLEM PLAN --repair prints the cheapest repair.";
    prose("Remedy", vec![advice.to_owned()])
}

pub(crate) fn prose(heading: &str, paragraphs: Vec<String>) -> Section {
    Section::Prose(Prose {
        heading: heading.to_owned(),
        paragraphs,
    })
}

pub(crate) fn positive_verdict(words: &str) -> Verdict {
    Verdict {
        tone: Tone::Good,
        words: words.to_owned(),
    }
}

pub(crate) fn negative_verdict(words: &str) -> Verdict {
    Verdict {
        tone: Tone::Bad,
        words: words.to_owned(),
    }
}

/// Returns the last component of a path, or `otherwise` if there is none.
pub(crate) fn name_of(path: &str, otherwise: &str) -> String {
    let name = path.rsplit(['/', '\\']).next().unwrap_or_default();
    let name = if name.is_empty() { otherwise } else { name };
    name.to_owned()
}

/// Returns the word that documents use for a value.
pub(crate) fn serialized_name(value: &impl serde::Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => word,
        _ => String::new(),
    }
}
