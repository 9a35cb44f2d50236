//! Adoption of a plan.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::pending::PreparationFallback;
use super::snapshot::Goals;
use super::{MissingPlan, Run, Stop, Verdict};
use crate::event::ActionHandle;
use crate::executor::{PlanEvent, PreparedPlan, StepId};
use crate::preparation::PrepareError;
use crate::record::Entry;

/// A plan, with the situation from which it starts.
#[derive(Clone, Copy)]
pub(super) struct PlanStart<'p> {
    pub(super) plan: &'p TimeTriggeredPlan,
    pub(super) situation: &'p Situation,
    /// The tickets of the actions that are running there.
    pub(super) running: &'p [ActionHandle],
    /// The steps that have begun between the plan's start and its adoption.
    pub(super) begun_steps: &'p [ActionHandle],
}

impl<'p> PlanStart<'p> {
    /// Creates the course of a plan with no step begun.
    pub(super) fn of(
        plan: &'p TimeTriggeredPlan,
        situation: &'p Situation,
        running: &'p [ActionHandle],
    ) -> Self {
        Self {
            plan,
            situation,
            running,
            begun_steps: &[],
        }
    }
}

impl Run<'_> {
    /// Has a plan prepared, and begins with it.
    pub(super) fn adopt_plan(&mut self, course: PlanStart<'_>) {
        let (task, goals) = (Arc::clone(&self.task), self.goals());
        self.adopt_plan_for_goals(&task, &goals, course);
    }

    /// Has a plan prepared for these goals, which belong to this task, and begins with it.
    pub(super) fn adopt_plan_for_goals(
        &mut self,
        task: &Arc<Task>,
        goals: &Goals,
        course: PlanStart<'_>,
    ) {
        self.await_preparation(task, goals, course, PreparationFallback::EndRun);
    }

    /// Begins with a prepared plan for these goals.
    pub(super) fn begin_prepared_plan_for_goals(
        &mut self,
        course: PlanStart<'_>,
        goals: &Goals,
        mission: &PreparedPlan,
    ) -> Result<(), Stop> {
        self.note_plan(course.plan, goals);
        self.rotate_before_adoption(course, goals);
        self.begin_prepared_plan(mission)
    }

    /// Begins with a prepared plan.
    pub(super) fn begin_prepared_plan(&mut self, mission: &PreparedPlan) -> Result<(), Stop> {
        self.search_results = super::SearchResults::default();
        self.anticipated_replan = None;
        let mut steps = mission.running.clone();
        steps.extend(&mission.begun);
        self.action_log.begin_plan(&steps);
        if self.settings.plans_aside || self.settings.monitors_slack {
            self.action_log.note_steps(mission);
        }
        self.steps = mission.time_triggered.steps.len();
        self.clock_watchdog.begin_plan();
        self.plan_events.clear();
        self.ports.recorder.record(&Entry::PlanAdopted(mission));
        if let Err(reason) = self.ports.executor.adopt(mission) {
            self.action_log.begin_plan(&BTreeMap::new());
            return self.replan(&reason);
        }
        // The plan still waits for actions that ended while it was made.
        let mut missed: Vec<(Rational, PlanEvent)> = Vec::new();
        for (step, ticket) in mission.running.iter().map(|(step, it)| (*step, *it)) {
            missed.extend(self.end_event(step, ticket));
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
                missed.extend(self.start_event(step, ticket));
                missed.extend(self.end_event(step, ticket));
            }
            missed.sort_by(|(one, _), (other, _)| one.cmp(other));
        }
        self.plan_events
            .extend(missed.into_iter().map(|(_, news)| news));
        Ok(())
    }

    /// Returns the steps of a plan to which these starts belong: of each action, the first ones
    /// that are not running when the plan begins. `None` if a start belongs to no step.
    pub(super) fn match_steps(
        &self,
        mission: &PreparedPlan,
        begun: &[ActionHandle],
    ) -> Option<BTreeMap<StepId, ActionHandle>> {
        if begun.is_empty() {
            return Some(BTreeMap::new());
        }
        let steps = mission.instances.iter().zip(&mission.time_triggered.steps);
        let steps = steps.map(|(instance, step)| (StepId::from(*instance), step));
        let mut left: Vec<_> = steps
            .filter(|(id, _)| !mission.running.contains_key(id))
            .collect();
        left.sort_by(|(_, one), (_, other)| one.start.cmp(&other.start));
        let step_of = |ticket: &ActionHandle| {
            let name = &self.action_log.get(*ticket)?.action.name;
            let index = left.iter().position(|(_, it)| it.action.name == *name)?;
            Some((left.remove(index).0, *ticket))
        };
        begun.iter().map(step_of).collect()
    }

    /// Returns the start of a step as news.
    pub(super) fn start_event(
        &self,
        step: StepId,
        ticket: ActionHandle,
    ) -> Option<(Rational, PlanEvent)> {
        let time = self.action_log.get(ticket)?.started.clone()?;
        let measured = Vec::new();
        let news = PlanEvent::Started {
            step,
            time: time.clone(),
            measured,
        };
        Some((time, news))
    }

    /// Returns the end of a step as news. An instantaneous action ends when it starts.
    pub(super) fn end_event(
        &self,
        step: StepId,
        ticket: ActionHandle,
    ) -> Option<(Rational, PlanEvent)> {
        let entry = self.action_log.get(ticket)?;
        let (time, ending) = entry.ended.clone()?;
        if entry.planned.is_none() && entry.started.is_some() {
            return None;
        }
        let measured = Vec::new();
        let news = PlanEvent::Ended {
            step,
            time: time.clone(),
            ending,
            measured,
        };
        Some((time, news))
    }
}

/// Returns the end of a run whose plan cannot be prepared.
pub(super) fn preparation_failure(error: &PrepareError) -> Stop {
    let why = error.to_string();
    let missing = MissingPlan::NotSearched;
    Stop::Ended(Verdict::NoPlan { why, missing })
}
