//! All sequences of happenings, scheduled by Bellman and Ford.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_model::validate::{self, Settings as Strictness, Verdict};
use elbowroom_model::{Footprint, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

/// The maximum number of happenings of a plan that the exhaustive search considers.
pub(crate) const MOST: usize = 6;

/// One happening of a sequence: an action's start or instant, or the end of an earlier one.
#[derive(Clone, Copy, Debug)]
enum Choice {
    Start(usize),
    End(usize),
}

/// The budget does not suffice.
#[derive(Debug)]
pub(crate) struct TooMany;

/// All sequences of happenings up to a length, interleaved with timed initials in all ways.
pub(crate) struct ReferencePlanner<'a> {
    task: &'a Task,
    actions: Vec<Action>,
    sequence: Vec<Choice>,
    self_overlap: bool,
    budget: usize,
}

impl<'a> ReferencePlanner<'a> {
    /// Creates an exhaustive search over at most `budget` sequences.
    pub(crate) fn new(task: &'a Task, actions: Vec<Action>, budget: usize) -> Self {
        Self {
            task,
            actions,
            sequence: Vec::new(),
            self_overlap: true,
            budget,
        }
    }

    /// Sets whether an action may overlap itself.
    pub(crate) fn with_self_overlap(self, self_overlap: bool) -> Self {
        Self {
            self_overlap,
            ..self
        }
    }
}

impl ReferencePlanner<'_> {
    /// Returns `true` if some continuation of the sequence is a plan, or `None` if the budget does
    /// not suffice.
    pub(crate) fn finds(&mut self) -> Option<bool> {
        let mut finds = false;
        let _ = self.walk(&mut |_| {
            finds = true;
            ControlFlow::Break(())
        })?;
        Some(finds)
    }

    /// Returns the least metric of all continuations that are plans, and the least makespan with
    /// that metric.
    pub(crate) fn least_metric(&mut self) -> Result<Option<(Rational, Rational)>, TooMany> {
        let mut least: Option<(Rational, Rational)> = None;
        let task = self.task;
        let _ = self
            .walk(&mut |report| {
                let metric = report.metric(task).expect("the problems have one");
                let worth = (metric, report.makespan.clone());
                if least.as_ref().is_none_or(|least| worth < *least) {
                    least = Some(worth);
                }
                ControlFlow::Continue(())
            })
            .ok_or(TooMany)?;
        Ok(least)
    }

    /// Visits all continuations that are plans. Returns `None` if the budget does not suffice.
    fn walk(
        &mut self,
        visit: &mut dyn FnMut(&validate::Report) -> ControlFlow<()>,
    ) -> Option<ControlFlow<()>> {
        self.budget = self.budget.checked_sub(1)?;
        let open = self.open();
        if open.is_empty() && self.visit_schedules(visit).is_break() {
            return Some(ControlFlow::Break(()));
        }
        let room = MOST - self.sequence.len();
        let ends = open.iter().map(|&place| Choice::End(place));
        let starts = (0..self.actions.len()).filter(|&number| {
            let takes = 1 + usize::from(self.actions[number].durative().is_some());
            let is_running = |place: &usize| self.is_start_of(*place, number);
            let is_allowed = self.self_overlap || !open.iter().any(is_running);
            is_allowed && open.len() + takes <= room
        });
        let choices: Vec<Choice> = ends.chain(starts.map(Choice::Start)).collect();
        for choice in choices {
            self.sequence.push(choice);
            let flow = self.walk(visit);
            self.sequence.pop();
            if flow? == ControlFlow::Break(()) {
                return flow;
            }
        }
        Some(ControlFlow::Continue(()))
    }

    fn is_start_of(&self, place: usize, action: usize) -> bool {
        matches!(self.sequence[place], Choice::Start(own) if own == action)
    }

    /// Returns the positions of the starts that have not ended.
    fn open(&self) -> Vec<usize> {
        let mut open = Vec::new();
        for (place, choice) in self.sequence.iter().enumerate() {
            match choice {
                Choice::Start(action) if self.actions[*action].durative().is_some() => {
                    open.push(place);
                }
                Choice::Start(_) => {}
                Choice::End(start) => open.retain(|other| other != start),
            }
        }
        open
    }

    /// Visits the interleavings with the timed initials that give a valid plan.
    fn visit_schedules(
        &self,
        visit: &mut dyn FnMut(&validate::Report) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let timed = self.task.timed().len();
        let count = self.sequence.len();
        // For each timed initial, the number of happenings before it; not descending.
        let mut places = vec![0; timed];
        loop {
            if let Some(report) = self.report(&places) {
                visit(&report)?;
            }
            let Some(next) = (0..timed).rev().find(|&t| places[t] < count) else {
                return ControlFlow::Continue(());
            };
            let place = places[next] + 1;
            places[next..].fill(place);
        }
    }

    /// Schedules the happenings as early as their order allows, and validates the plan.
    fn report(&self, places: &[usize]) -> Option<validate::Report> {
        let epsilon = Rational::new(1, 1000);
        let prints: Vec<Footprint> = self
            .sequence
            .iter()
            .map(|choice| match *choice {
                Choice::Start(action) => Footprint::of_start(self.task, &self.actions[action]),
                Choice::End(start) => Footprint::of_end(self.task, self.action_at(start)),
            })
            .collect();
        let count = self.sequence.len();
        // `to >= from + distance`; the last node is time 0.
        let mut edges: Vec<(usize, usize, Rational)> = Vec::new();
        for (to, choice) in self.sequence.iter().enumerate() {
            edges.push((count, to, Rational::ZERO));
            for from in 0..to {
                let apart = if prints[from].interferes_with(&prints[to]) {
                    epsilon.clone()
                } else {
                    Rational::ZERO
                };
                edges.push((from, to, apart));
            }
            if let Choice::End(start) = *choice {
                let duration = self.duration_at(start);
                edges.push((start, to, duration.clone()));
                edges.push((to, start, -duration));
            }
        }
        for (timed, &place) in self.task.timed().iter().zip(places) {
            let footprint = Footprint::of_timed(timed);
            for (node, print) in prints.iter().enumerate() {
                let apart = if print.interferes_with(&footprint) {
                    epsilon.clone()
                } else {
                    Rational::ZERO
                };
                if node < place {
                    edges.push((node, count, apart - &timed.time));
                } else {
                    edges.push((count, node, &timed.time + apart));
                }
            }
        }
        let mut times = vec![Rational::ZERO; count + 1];
        for round in 0..=count + 1 {
            let mut changed = false;
            for (from, to, distance) in &edges {
                let time = &times[*from] + distance;
                if time > times[*to] {
                    times[*to] = time;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
            if round > count || times[count].is_positive() {
                return None;
            }
        }
        let steps = self.sequence.iter().enumerate();
        let steps = steps.filter_map(|(place, choice)| match *choice {
            Choice::Start(action) => Some(Step {
                start: times[place].clone(),
                action: Arc::new(self.actions[action].clone()),
                duration: self.actions[action]
                    .durative()
                    .map(|_| self.duration_at(place)),
            }),
            Choice::End(_) => None,
        });
        let candidate = TimeTriggeredPlan {
            steps: steps.collect(),
        };
        match validate::validate(self.task, &candidate, &Strictness::default()) {
            Verdict::Valid(report) => Some(report),
            _ => None,
        }
    }

    fn action_at(&self, place: usize) -> &Action {
        match self.sequence[place] {
            Choice::Start(action) => &self.actions[action],
            Choice::End(_) => unreachable!("ends point to starts"),
        }
    }

    fn duration_at(&self, place: usize) -> Rational {
        let body = self.action_at(place).durative();
        match &body.expect("durative").duration[0].bound {
            elbowroom_model::ground::Expression::Constant(value) => value.clone(),
            _ => unreachable!("durations are constants here"),
        }
    }
}
