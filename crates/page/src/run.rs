//! Page of a run and its plans.

mod bars;
mod guarantee;
mod log;
mod windows;

use std::sync::Arc;

use elbowroom::answers::RunAnswer;
use elbowroom::answers::envelope::timeline;
use elbowroom::answers::learn::{PredictionAnswer, predictions_for};
use elbowroom::execute::{RunInputs, RunSpec};
use elbowroom::learning::records;
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::report::decimal::nearest;
use elbowroom::report::schema::{ObservationLine, ReasonLine, ReportLine};
use elbowroom::report::trace::{Line, Stored};
use elbowroom::sim::WorldModel;
use elbowroom::text::Source;

use crate::document::{Chart, Document, Mark, Section, Series, Table, Text, Texts, Tone, Verdict};
use crate::lanes::{Lanes, Occupant, lanes};
use crate::plan::{end_of_axis, prose};
use crate::run::bars::Bars;
use crate::run::guarantee::Guarantees;
use crate::run::log::Log;
use crate::state_timeline::StateTimeline;

/// State of the record of an unfinished run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Record {
    /// The record has ended.
    Ended,
    /// The run is still recorded.
    Live {
        /// Number of lines after the first one that the record no longer contains.
        left_out: usize,
    },
}

/// Returns the page about a run.
///
/// Types of objects, deadlines and values of numbers are read from the problem. The page omits them
/// if the problem cannot be read.
#[allow(clippy::too_many_lines, reason = "the page from top to bottom")]
pub(crate) fn trace(name: &str, stored: &Stored, spec: &RunSpec, record: Record) -> Document {
    let mut texts = Texts::default();
    let task = task(spec);
    let left_out = match record {
        Record::Live { left_out } => left_out,
        Record::Ended => 0,
    };
    // Beliefs can only be recomputed from a complete record.
    let mut belief = task
        .as_ref()
        .filter(|_| left_out == 0 && !stored.has_snapshot())
        .map(|task| StateTimeline::new(task, &mut texts));
    let (mut bars, mut guarantees, mut log) =
        (Bars::default(), Guarantees::default(), Log::default());
    let mut report = None;
    let mut is_paused = false;
    if let Ok(Some(snapshot)) = stored.snapshot() {
        bars.add_snapshot_starts(&snapshot);
        is_paused = snapshot.paused;
    }
    for line in &stored.lines {
        let counted = match line {
            Line::Observed(observed) => observed.as_processed(),
            _ => None,
        };
        if let Some(observation) = &counted {
            match observation {
                ObservationLine::Pause { .. } => is_paused = true,
                ObservationLine::Resume { .. } => is_paused = false,
                _ => {}
            }
        }
        if let (Some(belief), Some(observation)) = (&mut belief, &counted) {
            match bars.command_of(observation) {
                Some((ticket, action, planned)) => {
                    let planned = planned.as_ref();
                    belief.started(ticket, &action, planned, observation, &mut texts);
                }
                None => belief.record_observation(observation, &mut texts),
            }
        }
        bars.read(line);
        guarantees.read(line, &bars);
        log.read(line, &bars);
        // A finished run may have been resumed.
        report = match line {
            Line::Over(over) => Some(over),
            _ => None,
        };
    }
    let now = log.now.clone();
    if let Some(belief) = &mut belief {
        belief.advance(&now, &mut texts);
    }
    let (changes, numbers) = belief.map(StateTimeline::finish).unwrap_or_default();
    let mut chart = bars.chart(task.as_deref(), &now);
    chart.guarantee = guarantees.finish(now.to_f64());
    chart.changes = changes;
    chart.decisions = log.decisions();
    chart.end = chart.end.max(now.to_f64());
    let end = chart.end;
    let table = bars.table();
    let mut sections = vec![Section::Chart(chart)];
    sections.extend(report.into_iter().flat_map(failure_sections));
    sections.push(Section::Table(table));
    if !numbers.is_empty() {
        sections.push(Section::Series(Series {
            heading: "Numbers over time".to_owned(),
            end,
            lines: numbers,
        }));
    }
    sections.extend(
        task.as_ref()
            .and_then(|task| predictions(stored, spec, task)),
    );
    sections.push(Section::Table(log.table(&mut texts)));
    let (domain, problem) = match &task {
        Some(task) => (task.problem().domain.clone(), task.problem().name.clone()),
        None => (spec.domain.name.clone(), spec.problem.name.clone()),
    };
    let mut facts = vec![
        ("domain".to_owned(), domain),
        ("problem".to_owned(), problem.clone()),
        ("executor".to_owned(), spec.executor.to_string()),
        ("seed".to_owned(), spec.seed.to_string()),
        ("planner".to_owned(), spec.planner.clone()),
        ("time-out".to_owned(), spec.timeout.in_words()),
        ("trace".to_owned(), name.to_owned()),
    ];
    let not_shown = omitted_part_note(stored, left_out);
    facts.extend(not_shown.map(|words| ("not shown".to_owned(), words)));
    if let Some(report) = report {
        facts.push(("new plans".to_owned(), report.replans.to_string()));
        facts.push(("actions started".to_owned(), report.starts.to_string()));
    }
    Document {
        title: format!("Run of {problem}"),
        verdict: match report {
            Some(report) => verdict(report),
            None => unfinished_verdict(record, is_paused, &now),
        },
        facts,
        sections,
        texts: texts.into_texts(),
        is_paused,
        more: Vec::new(),
    }
}

/// Returns a table of the durations and failures that the believed world predicts, and those observed; `None` if the run
/// has no believed world, or no action has ended.
fn predictions(stored: &Stored, spec: &RunSpec, task: &Task) -> Option<Section> {
    let believed = Source::new("world", spec.believed.as_deref()?);
    let world = WorldModel::read(believed, task.problem()).ok()?;
    let records = records::of_trace(stored);
    let predictions = predictions_for(&records, &world);
    let ended = predictions.iter().filter(|(_, it)| it.ended > 0);
    let row = |(name, it): &(String, PredictionAnswer)| {
        let mean = |mean: f64| match it.durations {
            0 => String::new(),
            _ => format!("{mean:.2}"),
        };
        let cells = [
            name.clone(),
            mean(it.predicted_mean),
            mean(it.observed_mean),
            format!("{} of {}", it.within, it.durations),
            format!("{:.2}", it.predicted_failures),
            format!("{} of {}", it.failures, it.ended),
        ];
        cells.map(Text::from).to_vec()
    };
    let rows: Vec<_> = ended.map(row).collect();
    let columns = [
        ("action", false),
        ("predicted mean, s", true),
        ("observed mean, s", true),
        ("within the central 90 %", true),
        ("predicted failures", true),
        ("observed failures", true),
    ];
    (!rows.is_empty()).then(|| {
        Section::Table(Table {
            heading: "Predictions of the believed world".to_owned(),
            note: "Actions of each name that ended by themselves, compared with the model of \
                   --believed."
                .to_owned(),
            columns: columns
                .map(|(name, is_number)| (name.to_owned(), is_number))
                .to_vec(),
            rows,
            ..Table::default()
        })
    })
}

/// Describes the part of the run that is missing if the record does not begin with the run.
fn omitted_part_note(stored: &Stored, left_out: usize) -> Option<String> {
    if stored.has_snapshot() {
        let words = "all records before this segment of the journal, except the last actions, \
                     facts and numbers";
        return Some(words.to_owned());
    }
    let words = || format!("the first {left_out} lines of the trace, and facts and numbers");
    (left_out > 0).then(words)
}

/// Describes the state of a run that is unfinished in its record.
fn unfinished_verdict(record: Record, is_paused: bool, now: &Rational) -> Verdict {
    let now = nearest(now);
    let words = match record {
        Record::Ended => format!("The trace ends at {now} before the run was over."),
        Record::Live { .. } if is_paused => {
            format!("The run is paused at {now}: no further actions are started.")
        }
        Record::Live { .. } => format!("The run continues; its time is {now}."),
    };
    Verdict {
        tone: Tone::Plain,
        words,
    }
}

/// The page about the outcome of a run.
pub(crate) fn outcome(answer: &RunAnswer) -> Document {
    let report = &answer.report;
    let mut bars = Bars::default();
    bars.add_executed_steps(&report.executed);
    let chart = bars.chart(None, &report.time);
    let mut sections = vec![Section::Chart(chart)];
    sections.extend(failure_sections(report));
    sections.push(Section::Table(bars.table()));
    Document {
        title: "Outcome of a run".to_owned(),
        verdict: verdict(report),
        facts: vec![
            ("new plans".to_owned(), report.replans.to_string()),
            ("actions started".to_owned(), report.starts.to_string()),
        ],
        sections,
        texts: Vec::new(),
        is_paused: false,
        more: Vec::new(),
    }
}

fn task(spec: &RunSpec) -> Option<Arc<Task>> {
    let (inputs, _warnings) = RunInputs::read(spec.clone()).ok()?;
    Some(Arc::clone(inputs.task()))
}

fn verdict(report: &ReportLine) -> Verdict {
    let time = nearest(&report.time);
    let more = match &report.why {
        Some(why) if !why.is_empty() => format!(": {why}"),
        _ => ".".to_owned(),
    };
    let plans = match report.replans {
        0 => "without a new plan".to_owned(),
        1 => "after 1 new plan".to_owned(),
        count => format!("after {count} new plans"),
    };
    let (tone, words) = match report.verdict.as_str() {
        "goal-reached" => (Tone::Good, "The goal was reached".to_owned()),
        "interrupted" => (Tone::Plain, "The run was interrupted".to_owned()),
        other => (
            Tone::Bad,
            format!("The run failed ({})", other.replace('-', " ")),
        ),
    };
    Verdict {
        tone,
        words: format!("{words} at {time}, {plans}{more}"),
    }
}

/// Returns the reasons why plans were abandoned, and why no plan reaches the goal.
fn failure_sections(report: &ReportLine) -> Vec<Section> {
    let sentences = |reasons: &[ReasonLine]| -> Vec<String> {
        reasons.iter().map(|reason| reason.words.clone()).collect()
    };
    let mut sections = Vec::new();
    if !report.reasons.is_empty() {
        sections.push(prose(
            "Why plans were abandoned",
            sentences(&report.reasons),
        ));
    }
    if !report.dead_end.is_empty() {
        sections.push(prose(
            "Why no plan reaches the goal",
            sentences(&report.dead_end),
        ));
    }
    sections
}

impl Bars {
    /// Converts the plans and executed actions to a chart.
    fn chart(&self, task: Option<&Task>, now: &Rational) -> Chart {
        let mut bars = self.draw_bars(now);
        let occupants: Vec<Occupant<'_>> = bars
            .iter()
            .map(|bar| Occupant {
                name: &bar.name,
                time: bar.actual.or(bar.planned).unwrap_or((0.0, 0.0)),
                counts: bar.actual.is_some(),
            })
            .collect();
        let types = task.map(|task| timeline::types(task, bars.iter().map(|it| it.name.as_str())));
        let type_of = |object: &str| types.as_ref()?.get(object).map(String::as_str);
        let Lanes {
            groupings,
            chosen,
            of,
        } = lanes(&occupants, &type_of);
        for (bar, lanes) in bars.iter_mut().zip(of) {
            bar.lanes = lanes;
        }
        let timed = task.map(|task| task.timed().iter().enumerate());
        let mut marks: Vec<Mark> = timed
            .into_iter()
            .flatten()
            .map(|(index, timed)| Mark {
                at: timed.time.to_f64(),
                name: task.map_or_else(String::new, |task| {
                    timeline::changes(task, index).join(", ")
                }),
                is_event: false,
            })
            .collect();
        marks.extend(self.events());
        Chart {
            heading: "The run and its plan".to_owned(),
            end: end_of_axis(&bars, &marks),
            groupings,
            chosen,
            orderings: self.drawn_orderings(),
            plans: self.plan_names(),
            bars,
            marks,
            is_run: true,
            ..Chart::default()
        }
    }
}
