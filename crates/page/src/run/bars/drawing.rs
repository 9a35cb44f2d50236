//! Plans and executed actions, as bars and as a table.

use elbowroom::num::Rational;
use elbowroom::report::decimal::nearest;
use elbowroom::report::schema::WindowLine;

use super::{Bars, Start, Step, answer};
use crate::document::{Bar, Mark, Table, Text};
use crate::plan::{band, window_words};

impl Bars {
    /// Returns the names of the plans, if there are several.
    pub(in crate::run) fn plan_names(&self) -> Vec<String> {
        let names = self.plans.iter().enumerate().map(|(index, since)| {
            let since = nearest(since);
            match index {
                0 => format!("first plan, from {since}"),
                _ => format!("plan {}, from {since}", index + 1),
            }
        });
        let names: Vec<String> = names.collect();
        if names.len() > 1 { names } else { Vec::new() }
    }

    /// Returns marks for the times at which plans were abandoned.
    pub(in crate::run) fn events(&self) -> impl Iterator<Item = Mark> + '_ {
        self.abandoned.iter().map(|(time, words)| Mark {
            at: time.to_f64(),
            name: format!("plan abandoned: {words}"),
            is_event: true,
        })
    }

    /// Returns all bars: starts in order, and then the steps that were not started.
    pub(in crate::run) fn draw_bars(&self, now: &Rational) -> Vec<Bar> {
        let starts = self
            .starts
            .values()
            .map(|start| self.started_bar(start, now));
        let waiting = self.steps.iter().filter(|step| !step.is_ordered);
        starts.chain(waiting.map(unstarted_bar)).collect()
    }

    /// Returns the orderings of the plans, as positions in [`Bars::drawn`].
    pub(in crate::run) fn drawn_orderings(&self) -> Vec<(usize, usize)> {
        let mut bars = vec![None; self.steps.len()];
        for (bar, start) in self.starts.values().enumerate() {
            if let Some(step) = start.step {
                bars[step] = Some(bar);
            }
        }
        let waiting = self
            .steps
            .iter()
            .enumerate()
            .filter(|(_, step)| !step.is_ordered);
        for (bar, (step, _)) in (self.starts.len()..).zip(waiting) {
            bars[step] = Some(bar);
        }
        let mut drawn: Vec<(usize, usize)> = self
            .orderings
            .iter()
            .filter_map(|&(from, to)| bars[from].zip(bars[to]))
            .collect();
        drawn.sort_unstable();
        drawn.dedup();
        drawn
    }

    fn started_bar(&self, start: &Start, now: &Rational) -> Bar {
        let step = start.step.map(|step| &self.steps[step]);
        let begun = start.started.as_ref();
        let end = start.ended.as_ref().or(begun.map(|_| now));
        let outcome = match (&start.outcome, begun) {
            (Some(outcome), _) => known_outcome(outcome),
            (None, Some(_)) => "running",
            (None, None) => "ordered",
        };
        let mut details: Vec<(&'static str, Text)> = Vec::new();
        if let Some(step) = step {
            details.push(("planned", step.words().into()));
        }
        if let Some(begun) = begun {
            let until = start.ended.as_ref().map_or_else(|| "…".to_owned(), nearest);
            details.push(("was done", format!("{} to {until}", nearest(begun)).into()));
        }
        if let (Some(begun), Some(ended)) = (begun, &start.ended) {
            let took = nearest(&(ended - begun));
            details.push((
                "took",
                match &start.planned {
                    Some(planned) => format!("{took}, planned {}", nearest(planned)).into(),
                    None => took.into(),
                },
            ));
        }
        let why = start.why.as_deref().unwrap_or_default();
        let words = match (outcome, why) {
            ("ordered", _) => format!("requested at {}, not confirmed", nearest(&start.ordered)),
            (outcome, "") => outcome.to_owned(),
            (outcome, why) => format!("{outcome}: {why}"),
        };
        details.push(("outcome", words.into()));
        for (label, due) in [
            ("start was due", &start.due),
            ("end was due", &start.end_due),
        ] {
            if let Some(words) = window_words(&answer(due)) {
                details.push((label, words.into()));
            }
        }
        Bar {
            name: start.action.clone(),
            planned: step.map(Step::span),
            actual: begun
                .zip(end)
                .map(|(begun, end)| (begun.to_f64(), end.to_f64())),
            outcome,
            starts: drawable_window(&start.due),
            ends: drawable_window(&start.end_due)
                .or_else(|| step.and_then(|it| band(&it.end_window))),
            plan: step.map_or(0, |step| step.plan),
            details,
            ..Bar::default()
        }
    }

    /// Builds the table of planned and observed times.
    pub(in crate::run) fn table(&self) -> Table {
        let columns = [
            ("action", false),
            ("planned start", true),
            ("start", true),
            ("planned end", true),
            ("end", true),
            ("outcome", false),
        ];
        let number =
            |value: Option<&Rational>| -> Text { value.map(nearest).unwrap_or_default().into() };
        let mut rows = Vec::new();
        for start in self.starts.values() {
            let step = start.step.map(|step| &self.steps[step]);
            let outcome = start.outcome.as_deref();
            let unknown = if start.started.is_some() {
                "running"
            } else {
                "ordered"
            };
            rows.push(vec![
                start.action.as_str().into(),
                number(step.map(|step| &step.start)),
                number(start.started.as_ref()),
                number(step.and_then(|step| step.end.as_ref())),
                number(start.ended.as_ref()),
                match &start.why {
                    Some(why) => format!("{}: {why}", outcome.unwrap_or(unknown)).into(),
                    None => outcome.unwrap_or(unknown).into(),
                },
            ]);
        }
        for step in self.steps.iter().filter(|step| !step.is_ordered) {
            rows.push(vec![
                step.action.as_str().into(),
                number(Some(&step.start)),
                "".into(),
                number(step.end.as_ref()),
                "".into(),
                "not started".into(),
            ]);
        }
        let has_plan = !self.steps.is_empty();
        Table {
            heading: if has_plan {
                "Planned and actual times"
            } else {
                "Executed actions"
            }
            .to_owned(),
            columns: columns
                .map(|(name, is_number)| (name.to_owned(), is_number))
                .to_vec(),
            bars: (0..rows.len()).collect(),
            rows,
            ..Table::default()
        }
    }
}

impl Step {
    fn span(&self) -> (f64, f64) {
        let end = self.end.as_ref().unwrap_or(&self.start);
        (self.start.to_f64(), end.to_f64())
    }

    fn words(&self) -> String {
        match &self.end {
            Some(end) => format!("{} to {}", nearest(&self.start), nearest(end)),
            None => nearest(&self.start),
        }
    }
}

fn unstarted_bar(step: &Step) -> Bar {
    let mut details: Vec<(&'static str, Text)> = vec![("planned", step.words().into())];
    let windows = [
        ("may start at", &step.start_window),
        ("may end at", &step.end_window),
    ];
    for (label, window) in windows {
        if let Some(words) = window_words(window) {
            details.push((label, words.into()));
        }
    }
    details.push(("outcome", "not started".into()));
    Bar {
        name: step.action.clone(),
        planned: Some(step.span()),
        outcome: "not-started",
        starts: band(&step.start_window),
        ends: band(&step.end_window),
        plan: step.plan,
        details,
        ..Bar::default()
    }
}

/// Converts a window for drawing; `None` if it has no latest time.
fn drawable_window(due: &WindowLine) -> Option<(Option<f64>, Option<f64>)> {
    band(&answer(due)).filter(|(_, latest)| latest.is_some())
}

/// Maps an outcome to one that traces can have.
fn known_outcome(outcome: &str) -> &'static str {
    match outcome {
        "succeeded" => "succeeded",
        "failed" => "failed",
        "cancelled" => "cancelled",
        _ => "unknown",
    }
}
