//! Plans and executed actions, action by action.

mod drawing;

use std::collections::{BTreeMap, VecDeque};

use elbowroom::answers::Exact;
use elbowroom::answers::envelope::timeline::WindowAnswer;
use elbowroom::num::Rational;
use elbowroom::report::schema::{
    BoundLine, DecisionLine, ExecutedLine, IssuedCommandLine, ObservationLine, PlanLine, WindowLine,
};
use elbowroom::report::trace::{Line, SnapshotLine};

use super::windows::Windows;

/// The plans and starts read so far.
#[derive(Default)]
pub(super) struct Bars {
    /// Adoption time of each plan.
    plans: Vec<Rational>,
    /// The steps of all plans.
    steps: Vec<Step>,
    /// The orderings of the plans: the earlier and the later step.
    orderings: Vec<(usize, usize)>,
    /// Actions that run on the adoption of a plan. They are the first steps of the plan.
    running: Vec<String>,
    /// Position of the first step of the current plan.
    first: usize,
    /// The steps that the last decision starts, in order.
    ordered: VecDeque<usize>,
    /// Starts, by ticket.
    starts: BTreeMap<u64, Start>,
    /// Times at which plans were abandoned, with the reasons.
    abandoned: Vec<(Rational, String)>,
}

/// A step of a plan, in the world's time.
struct Step {
    plan: usize,
    action: String,
    start: Rational,
    end: Option<Rational>,
    start_window: WindowAnswer,
    end_window: WindowAnswer,
    is_ordered: bool,
}

/// An action that was commanded to start.
struct Start {
    action: String,
    step: Option<usize>,
    ordered: Rational,
    planned: Option<Rational>,
    due: WindowLine,
    end_due: WindowLine,
    started: Option<Rational>,
    ended: Option<Rational>,
    outcome: Option<String>,
    why: Option<String>,
}

impl Bars {
    /// Processes a line of the trace.
    pub(super) fn read(&mut self, line: &Line) {
        match line {
            Line::Plan(plan) => self.plan(plan),
            Line::Decided(decided) => match &decided.decision {
                DecisionLine::Start { orders } => {
                    let steps = orders.iter().map(|order| self.first + order.step as usize);
                    self.ordered = steps.filter(|step| *step < self.steps.len()).collect();
                }
                DecisionLine::Replan => {
                    let words = decided.reason.words.clone();
                    self.abandoned.push((decided.now.0.clone(), words));
                }
                _ => {}
            },
            Line::Command(command) => {
                if let IssuedCommandLine::Start {
                    ticket,
                    action,
                    duration,
                } = &command.command
                {
                    let step = self.next_ordered(action);
                    let start = Start {
                        action: action.clone(),
                        step,
                        ordered: command.now.0.clone(),
                        planned: duration.as_ref().map(|it| it.0.clone()),
                        due: command.planned.clone(),
                        end_due: WindowLine::default(),
                        started: None,
                        ended: None,
                        outcome: None,
                        why: None,
                    };
                    self.starts.insert(*ticket, start);
                }
            }
            Line::Observed(observed) => match &observed.observation {
                ObservationLine::Started { ticket, time, .. } => {
                    if let Some(start) = self.starts.get_mut(ticket) {
                        start.started.get_or_insert_with(|| time.0.clone());
                    }
                }
                ObservationLine::Ended {
                    ticket,
                    outcome,
                    why,
                    time,
                    ..
                } => {
                    if let Some(start) = self.starts.get_mut(ticket)
                        && start.ended.is_none()
                    {
                        start.ended = Some(time.0.clone());
                        start.outcome = Some(outcome.clone());
                        start.why.clone_from(why);
                        start.end_due = observed.planned.clone();
                    }
                }
                _ => {}
            },
            Line::Planning(planning) => {
                let running = planning.situation.running.iter();
                self.running = running.map(|running| running.action.clone()).collect();
            }
            Line::Over(report) => self.add_executed_steps(&report.executed),
            _ => {}
        }
    }

    /// Adds the starts from a snapshot at a rotation: running and recently ended actions.
    pub(super) fn add_snapshot_starts(&mut self, snapshot: &SnapshotLine) {
        let time = |it: &Option<Exact>| it.as_ref().map(|it| it.0.clone());
        for known in &snapshot.starts {
            let start = Start {
                action: known.action.clone(),
                step: None,
                ordered: known.ordered.0.clone(),
                planned: time(&known.duration),
                due: WindowLine::default(),
                end_due: WindowLine::default(),
                started: time(&known.started),
                ended: time(&known.ended),
                outcome: known.outcome.clone(),
                why: known.why.clone(),
            };
            self.starts.insert(known.ticket, start);
        }
        let under_way = snapshot.plan.iter().flat_map(|plan| &plan.under_way);
        let names = under_way.filter_map(|it| self.action(it.ticket));
        self.running = names.map(str::to_owned).collect();
    }

    /// Adds the executed steps of the run's report, which overrides contradictory observations.
    pub(super) fn add_executed_steps(&mut self, executed: &[ExecutedLine]) {
        for done in executed {
            let begun = done.start.0.clone();
            let start = self.starts.entry(done.ticket).or_insert_with(|| Start {
                action: done.action.clone(),
                step: None,
                ordered: begun.clone(),
                planned: None,
                due: WindowLine::default(),
                end_due: WindowLine::default(),
                started: None,
                ended: None,
                outcome: None,
                why: None,
            });
            start.outcome.clone_from(&done.outcome);
            start.ended = match (&done.duration, &done.outcome) {
                (Some(duration), Some(_)) => Some(&begun + &duration.0),
                (None, Some(_)) => Some(begun.clone()),
                (_, None) => None,
            };
            start.started = Some(begun);
        }
    }

    /// Returns the reported start: ticket, action, and planned duration.
    pub(super) fn command_of(
        &self,
        observation: &ObservationLine,
    ) -> Option<(u64, String, Option<Rational>)> {
        let ObservationLine::Started { ticket, .. } = observation else {
            return None;
        };
        let start = self.starts.get(ticket)?;
        Some((*ticket, start.action.clone(), start.planned.clone()))
    }

    /// Returns the action with this ticket.
    pub(super) fn action(&self, ticket: u64) -> Option<&str> {
        self.starts.get(&ticket).map(|start| start.action.as_str())
    }

    /// Returns the actions of these steps of the current plan.
    pub(super) fn step_names(&self, steps: &[u32]) -> Vec<&str> {
        let steps = steps
            .iter()
            .filter_map(|&step| self.steps.get(self.first + step as usize));
        steps.map(|step| step.action.as_str()).collect()
    }

    /// Returns the number of plans adopted so far.
    pub(super) fn plan_count(&self) -> usize {
        self.plans.len()
    }

    fn plan(&mut self, line: &PlanLine) {
        let plan = self.plans.len();
        self.plans.push(line.now.0.clone());
        self.first = self.steps.len();
        self.ordered.clear();
        self.orderings(line);
        let continued = std::mem::take(&mut self.running);
        let windows = Windows::of(&line.network, &line.parameters);
        let origin = &line.origin.0;
        for (index, step) in line.steps.iter().enumerate() {
            let start = origin + &step.start.0;
            let instance = line.network.instances.get(index);
            let label = instance
                .filter(|it| it.action == step.action)
                .map(|it| it.label.as_str());
            let window = |node: String| match (&windows, label) {
                (Some(windows), Some(_)) => windows.at(&node, origin),
                _ => WindowAnswer::default(),
            };
            let label = label.unwrap_or_default();
            let (start_window, end_window) = match &step.duration {
                Some(_) => (
                    window(format!("{label}.start")),
                    window(format!("{label}.end")),
                ),
                None => (window(label.to_owned()), WindowAnswer::default()),
            };
            self.steps.push(Step {
                plan,
                action: step.action.clone(),
                end: step.duration.as_ref().map(|duration| &start + &duration.0),
                start,
                start_window,
                end_window,
                // A continued action is not started again.
                is_ordered: continued.get(index) == Some(&step.action),
            });
        }
    }

    /// Records the orderings of steps in the plan's network.
    fn orderings(&mut self, line: &PlanLine) {
        let instances = line.network.instances.iter().enumerate();
        let positions: BTreeMap<&str, usize> = instances
            .map(|(index, it)| (it.label.as_str(), index))
            .collect();
        let step = |node: &str| {
            let label = node
                .strip_suffix(".start")
                .or_else(|| node.strip_suffix(".end"));
            positions
                .get(label.unwrap_or(node))
                .copied()
                .filter(|index| *index < line.steps.len())
        };
        let is_sign = |bound: &Option<BoundLine>, is_it: fn(&Rational) -> bool| matches!(bound, Some(BoundLine::Number(number)) if is_it(&number.0));
        for constraint in &line.network.constraints {
            let (Some(from), Some(to)) = (step(&constraint.from), step(&constraint.to)) else {
                continue;
            };
            let (from, to) = (self.first + from, self.first + to);
            if from == to {
                continue;
            }
            if is_sign(&constraint.lower, |bound| !bound.is_negative()) {
                self.orderings.push((from, to));
            } else if is_sign(&constraint.upper, |bound| !bound.is_positive()) {
                self.orderings.push((to, from));
            }
        }
    }

    /// Returns the step of a start command. Commands come in the order of their decision.
    fn next_ordered(&mut self, action: &str) -> Option<usize> {
        let position = self
            .ordered
            .iter()
            .position(|&step| self.steps[step].action == action)?;
        let step = self.ordered.remove(position)?;
        self.steps[step].is_ordered = true;
        Some(step)
    }
}

/// Converts a window of a trace to one of an answer.
pub(super) fn answer(window: &WindowLine) -> WindowAnswer {
    WindowAnswer {
        earliest: window.earliest.clone(),
        latest: window.latest.clone(),
    }
}
