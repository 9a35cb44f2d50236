//! Adoption of a plan.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::pending::Otherwise;
use super::stand::Goals;
use super::{MissingPlan, Run, Stop, Verdict};
use crate::event::Ticket;
use crate::executor::CAN_HAVE_A_CLOCK;
use crate::executor::{Mission, News, StepId};
use crate::preparation::PrepareError;
use crate::record::Entry;

/// A plan, with the situation from which it starts.
#[derive(Clone, Copy)]
pub(super) struct Course<'p> {
    pub(super) plan: &'p TimeTriggeredPlan,
    pub(super) situation: &'p Situation,
    /// The tickets of the actions that are running there.
    pub(super) running: &'p [Ticket],
    /// The steps that have begun between the plan's start and its adoption.
    pub(super) begun: &'p [Ticket],
}

impl<'p> Course<'p> {
    /// Creates the course of a plan with no step begun.
    pub(super) fn of(
        plan: &'p TimeTriggeredPlan,
        situation: &'p Situation,
        running: &'p [Ticket],
    ) -> Self {
        Self {
            plan,
            situation,
            running,
            begun: &[],
        }
    }
}

impl Run<'_> {
    /// Has a plan prepared, and begins with it.
    pub(super) fn take_up(&mut self, course: Course<'_>) {
        let (task, goals) = (Arc::clone(&self.task), self.goals());
        self.take_up_for(&task, &goals, course);
    }

    /// Has a plan prepared for these goals, which belong to this task, and begins with it.
    pub(super) fn take_up_for(&mut self, task: &Arc<Task>, goals: &Goals, course: Course<'_>) {
        self.await_preparation(task, goals, course, Otherwise::End);
    }

    /// Begins with a prepared plan for these goals.
    pub(super) fn begin_with(
        &mut self,
        course: Course<'_>,
        goals: &Goals,
        mission: &Mission,
    ) -> Result<(), Stop> {
        self.note_plan(course.plan, goals);
        self.begin_anew_with(course, goals);
        self.begin_mission(mission)
    }

    /// Begins with a prepared plan.
    pub(super) fn begin_mission(&mut self, mission: &Mission) -> Result<(), Stop> {
        self.lost = super::Lost::default();
        self.foreseen = None;
        let mut steps = mission.running.clone();
        steps.extend(&mission.begun);
        self.account.begin_plan(&steps);
        if CAN_HAVE_A_CLOCK && (self.settings.plans_aside || self.settings.watches_room) {
            self.account.note_steps(mission);
        }
        self.steps = mission.time_triggered.steps.len();
        self.progress.begin_plan();
        self.news.clear();
        self.ports.recorder.record(&Entry::Mission(mission));
        if let Err(reason) = self.ports.executor.adopt(mission) {
            self.account.begin_plan(&BTreeMap::new());
            return self.replan(&reason);
        }
        // The plan still waits for actions that ended while it was made.
        let mut missed: Vec<(Rational, News)> = Vec::new();
        for (step, ticket) in mission.running.iter().map(|(step, it)| (*step, *it)) {
            missed.extend(self.ending(step, ticket));
        }
        if !mission.begun.is_empty() {
            // In the order of their commands.
            let mut begun: Vec<_> = mission
                .begun
                .iter()
                .map(|(step, it)| (*it, *step))
                .collect();
            begun.sort_unstable();
            for (ticket, step) in begun {
                missed.extend(self.beginning(step, ticket));
                missed.extend(self.ending(step, ticket));
            }
            missed.sort_by(|(one, _), (other, _)| one.cmp(other));
        }
        self.news.extend(missed.into_iter().map(|(_, news)| news));
        Ok(())
    }

    /// Returns the steps of a plan to which these starts belong: of each action, the first ones
    /// that are not running when the plan begins. `None` if a start belongs to no step.
    pub(super) fn steps_of(
        &self,
        mission: &Mission,
        begun: &[Ticket],
    ) -> Option<BTreeMap<StepId, Ticket>> {
        if begun.is_empty() {
            return Some(BTreeMap::new());
        }
        let steps = mission.instances.iter().zip(&mission.time_triggered.steps);
        let steps = steps.map(|(instance, step)| (StepId::from(*instance), step));
        let mut left: Vec<_> = steps
            .filter(|(id, _)| !mission.running.contains_key(id))
            .collect();
        left.sort_by(|(_, one), (_, other)| one.start.cmp(&other.start));
        let step_of = |ticket: &Ticket| {
            let name = &self.account.get(*ticket)?.action.name;
            let index = left.iter().position(|(_, it)| it.action.name == *name)?;
            Some((left.remove(index).0, *ticket))
        };
        begun.iter().map(step_of).collect()
    }

    /// Returns the start of a step as news.
    pub(super) fn beginning(&self, step: StepId, ticket: Ticket) -> Option<(Rational, News)> {
        let time = self.account.get(ticket)?.started.clone()?;
        let measured = Vec::new();
        let news = News::Started {
            step,
            time: time.clone(),
            measured,
        };
        Some((time, news))
    }

    /// Returns the end of a step as news. An instantaneous action ends when it starts.
    pub(super) fn ending(&self, step: StepId, ticket: Ticket) -> Option<(Rational, News)> {
        let entry = self.account.get(ticket)?;
        let (time, ending) = entry.ended.clone()?;
        if entry.planned.is_none() && entry.started.is_some() {
            return None;
        }
        let measured = Vec::new();
        let news = News::Ended {
            step,
            time: time.clone(),
            ending,
            measured,
        };
        Some((time, news))
    }
}

/// Returns the end of a run whose plan cannot be prepared.
pub(super) fn no_plan(error: &PrepareError) -> Stop {
    let why = error.to_string();
    let missing = MissingPlan::NotSearched;
    Stop::Over(Verdict::NoPlan { why, missing })
}
