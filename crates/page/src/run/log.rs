//! Log of a trace: each line as text.

use elbowroom::num::Rational;
use elbowroom::report::decimal::nearest;
use elbowroom::report::schema::{DecisionLine, IssuedCommandLine, ObservationLine, WindowLine};
use elbowroom::report::trace::Line;

use super::bars::{Bars, answer};
use crate::document::{DecisionAt, Table, Text, Texts};
use crate::plan::window_words;

/// The lines so far.
#[derive(Default)]
pub(super) struct Log {
    /// The time of the last line.
    pub(super) now: Rational,
    rows: Vec<Row>,
}

struct Row {
    at: f64,
    time: String,
    kind: &'static str,
    what: String,
    due: String,
    why: String,
}

impl Log {
    /// Processes a line of the trace, after `bars`.
    pub(super) fn read(&mut self, line: &Line, bars: &Bars) {
        match line {
            Line::Plan(plan) => {
                let count = plan.steps.len();
                let what = match bars.plan_count() {
                    1 => format!("the first plan is adopted: {count} actions"),
                    number => format!("plan {number} is adopted: {count} actions"),
                };
                self.add(&plan.now.0, "plan", what, String::new(), String::new());
            }
            Line::Decided(decided) => {
                let what = decision(&decided.decision, bars);
                let why = decided.reason.words.clone();
                self.add(&decided.now.0, "decision", what, String::new(), why);
            }
            Line::Command(command) => {
                let what = match &command.command {
                    IssuedCommandLine::Start { action, .. } => format!("start {action}"),
                    IssuedCommandLine::Cancel { ticket } => {
                        format!("cancel {}", bars.action(*ticket).unwrap_or("an action"))
                    }
                };
                let due = due_text(&command.planned);
                self.add(&command.now.0, "command", what, due, String::new());
            }
            Line::Observed(observed) => {
                let (time, what) = observation(&observed.observation, bars);
                let remark = observed.remark.clone().unwrap_or_default();
                self.add(
                    time,
                    "observation",
                    what,
                    due_text(&observed.planned),
                    remark,
                );
            }
            Line::Planning(planning) => {
                let why = planning.reason.words.clone();
                let what = "a new plan is requested".to_owned();
                self.add(&planning.now.0, "planning", what, String::new(), why);
            }
            Line::Planned(planned) => {
                let what = match (&planned.plan, planned.is_unsolvable) {
                    (None, _) if planned.has_failed => "the planner failed".to_owned(),
                    (Some(steps), _) => format!(
                        "a plan of {} actions, made in {}",
                        steps.len(),
                        nearest(&planned.took.0)
                    ),
                    (None, true) => "there is no further plan".to_owned(),
                    (None, false) => "no plan was found".to_owned(),
                };
                let why = planned.why_not.clone().unwrap_or_default();
                self.add(&planned.now.0, "planning", what, String::new(), why);
            }
            Line::Warning(line) => {
                let what = line.words.clone();
                self.add(&line.now.0, "warning", what, String::new(), String::new());
            }
            Line::Kept(kept) => {
                let why = kept.reason.words.clone();
                let what = "the rest of the plan is kept".to_owned();
                self.add(&kept.now.0, "planning", what, String::new(), why);
            }
            Line::Goal(goal) => {
                let what = format!("{}: {}", goal.becomes.in_words(), goal.name);
                let why = goal.why.clone().unwrap_or_default();
                self.add(&goal.now.0, "goal", what, String::new(), why);
            }
            Line::Resting(rest) => {
                let what = match rest.verdict.as_deref() {
                    None => "there is no goal".to_owned(),
                    Some("goal-reached") => format!("reached: {}", rest.goals.join(", ")),
                    Some(verdict) => format!("waits for a change: {}", verdict.replace('-', " ")),
                };
                let why = rest.why.clone().unwrap_or_default();
                self.add(&rest.now.0, "rest", what, String::new(), why);
            }
            Line::Interrupted(line) => {
                let what = "an operator requested the end of the run".to_owned();
                self.add(&line.now.0, "end", what, String::new(), String::new());
            }
            Line::WorldFailed(line) => {
                let what = "the world failed".to_owned();
                self.add(&line.now.0, "end", what, String::new(), line.why.clone());
            }
            Line::Over(report) => {
                let why = report.why.clone().unwrap_or_default();
                let what = report.verdict.replace('-', " ");
                self.add(&report.time, "end", what, String::new(), why);
            }
            // Observations in between have their own lines.
            Line::Passed(passed) => self.advance(&passed.now.0),
            Line::Looked(looked) => self.advance(&looked.now.0),
            _ => {}
        }
    }

    fn advance(&mut self, time: &Rational) {
        if *time > self.now {
            self.now.clone_from(time);
        }
    }

    fn add(&mut self, time: &Rational, kind: &'static str, what: String, due: String, why: String) {
        self.advance(time);
        // Keeps rows in order even if something was reported late.
        let last = self.rows.last().map_or(f64::NEG_INFINITY, |row| row.at);
        self.rows.push(Row {
            at: time.to_f64().max(last),
            time: nearest(time),
            kind,
            what,
            due,
            why,
        });
    }

    /// Returns the decisions with their reasons.
    pub(super) fn decisions(&self) -> Vec<DecisionAt> {
        let decisions = self.rows.iter().filter(|row| row.kind == "decision");
        decisions
            .map(|row| DecisionAt {
                at: row.at,
                words: if row.what == row.why {
                    row.what.clone()
                } else {
                    format!("{}, because {}", row.what, row.why)
                },
            })
            .collect()
    }

    /// Converts the log to a table.
    pub(super) fn table(self, texts: &mut Texts) -> Table {
        let columns = [
            ("time", true),
            ("kind", false),
            ("what", false),
            ("was due", true),
            ("why", false),
        ];
        let times = self.rows.iter().map(|row| row.at).collect();
        let rows = self.rows.into_iter().map(|row| -> Vec<Text> {
            vec![
                row.time.into(),
                texts.share(row.kind),
                texts.share(&row.what),
                row.due.into(),
                texts.share(&row.why),
            ]
        });
        Table {
            heading: "Events and reasons".to_owned(),
            columns: columns
                .map(|(name, is_number)| (name.to_owned(), is_number))
                .to_vec(),
            rows: rows.collect(),
            times,
            ..Table::default()
        }
    }
}

fn due_text(window: &WindowLine) -> String {
    window_words(&answer(window)).unwrap_or_default()
}

fn decision(decision: &DecisionLine, bars: &Bars) -> String {
    match decision {
        DecisionLine::Start { orders } => {
            let names: Vec<&str> = orders.iter().map(|order| order.action.as_str()).collect();
            format!("start {}", names.join(", "))
        }
        DecisionLine::Wait { until: Some(until) } => {
            format!("wait until {} at the latest", nearest(&until.0))
        }
        DecisionLine::Wait { until: None } => "wait".to_owned(),
        DecisionLine::Cancel { steps } => match bars.step_names(steps) {
            names if names.is_empty() => "cancel".to_owned(),
            names => format!("cancel {}", names.join(", ")),
        },
        DecisionLine::Replan => "abandon the plan".to_owned(),
        DecisionLine::GoalReached => "the goal is reached".to_owned(),
    }
}

fn observation<'a>(observation: &'a ObservationLine, bars: &Bars) -> (&'a Rational, String) {
    let action = |ticket: &u64| bars.action(*ticket).unwrap_or("something").to_owned();
    match observation {
        ObservationLine::Started { ticket, time, .. } => {
            (&time.0, format!("{} has started", action(ticket)))
        }
        ObservationLine::Ended {
            ticket,
            outcome,
            why,
            time,
            ..
        } => {
            let why = why.as_deref().filter(|why| !why.is_empty());
            let why = why.map(|why| format!(": {why}")).unwrap_or_default();
            let how = match outcome.as_str() {
                "cancelled" => "was cancelled".to_owned(),
                other => format!("has {other}"),
            };
            (&time.0, format!("{} {how}{why}", action(ticket)))
        }
        ObservationLine::Feedback {
            ticket,
            completion,
            note,
            time,
        } => {
            let part = completion.as_ref().map(|part| {
                let percent = &part.0 * &Rational::from(100);
                format!(" is {} % done", nearest(&percent))
            });
            let part = part.unwrap_or_else(|| " is running".to_owned());
            let note = if note.is_empty() {
                String::new()
            } else {
                format!(": {note}")
            };
            (&time.0, format!("{}{part}{note}", action(ticket)))
        }
        ObservationLine::Fact {
            fact,
            becomes,
            time,
        } => (&time.0, format!("{fact} is {becomes}")),
        ObservationLine::Value {
            fluent,
            value,
            time,
        } => (&time.0, format!("{fluent} = {}", nearest(&value.0))),
        ObservationLine::Goal {
            name,
            goal,
            release,
            by,
            time,
            ..
        } => {
            let by = by.as_ref().map_or(String::new(), |by| format!(" by {by}"));
            let release = release.as_ref();
            let release = release.map_or(String::new(), |it| format!(", from {}", nearest(&it.0)));
            (&time.0, format!("requested{by}: {name}: {goal}{release}"))
        }
        ObservationLine::Abandon { name, time } => (&time.0, format!("request to abandon: {name}")),
        ObservationLine::CancelAction { ticket, time } => (
            &time.0,
            format!("request to cancel the action of ticket {ticket}"),
        ),
        ObservationLine::Pause { time } => (&time.0, "request to pause".to_owned()),
        ObservationLine::Resume { time } => (&time.0, "request to continue".to_owned()),
        ObservationLine::PlanMade { time } => (&time.0, "the plan is made".to_owned()),
        ObservationLine::PlanReady { time } => (&time.0, "the plan is ready".to_owned()),
        ObservationLine::Unintelligible { said, why, time } => {
            (&time.0, format!("cannot be parsed ({why}): {said}"))
        }
    }
}
