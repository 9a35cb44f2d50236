//! Adoption of a plan.

use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_num::Rational;

use super::agenda::PreparationFallback;
use super::goals::Goals;
use super::plan_start::PlanStart;
use super::search_results::SearchResults;
use super::{Run, Stop};
use crate::executor::{PlanEvent, PreparedPlan};
use crate::record::Entry;

impl Run<'_> {
    /// Has a plan prepared, and begins with it.
    pub(super) fn adopt_plan(&mut self, course: PlanStart<'_>) {
        let (task, goals) = (Arc::clone(&self.task), self.goals.open());
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
        self.with_goals(|it, context| it.note_plan(context, course.plan, goals));
        self.rotate_before_adoption(course, goals);
        self.begin_prepared_plan(mission)
    }

    /// Begins with a prepared plan.
    pub(super) fn begin_prepared_plan(&mut self, mission: &PreparedPlan) -> Result<(), Stop> {
        self.search_results = SearchResults::default();
        self.background.take_anticipated();
        let mut steps = mission.running.clone();
        steps.extend(&mission.begun);
        self.action_log.begin_plan(&steps);
        if self.settings.plans_in_background || self.settings.monitors_slack {
            self.action_log.note_steps(mission);
        }
        self.steps = mission.time_triggered.steps.len();
        self.clock_watchdog.begin_plan();
        self.plan_events.clear();
        self.ports.recorder.record(&Entry::PlanAdopted(mission));
        if let Err(reason) = self.ports.executor.adopt(mission) {
            self.drop_steps();
            return self.replan(&reason);
        }
        // The plan still waits for actions that ended while it was made.
        let mut missed: Vec<(Rational, PlanEvent)> = Vec::new();
        for (step, ticket) in mission.running.iter().map(|(step, it)| (*step, *it)) {
            missed.extend(self.action_log.end_event(step, ticket));
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
                missed.extend(self.action_log.start_event(step, ticket));
                missed.extend(self.action_log.end_event(step, ticket));
            }
            missed.sort_by(|(one, _), (other, _)| one.cmp(other));
        }
        self.plan_events
            .extend(missed.into_iter().map(|(_, news)| news));
        Ok(())
    }
}
