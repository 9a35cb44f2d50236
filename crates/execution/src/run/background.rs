//! Planning in the background: the search in progress, the forecast for the next one, and the expected
//! planning time.

mod anticipated;
mod fitting;
mod preparation;
mod search;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;

use super::situation::OverrunEstimate;
use crate::belief_state::BeliefState;
use crate::event::{ActionHandle, Event, Observation};
use crate::executor::StepId;
use crate::request::RequestId;

pub(super) use anticipated::{AnticipatedReplan, AnticipatedSituation, next_late_time, next_need};
pub(super) use preparation::Preparation;
pub(super) use search::{BackgroundSearch, ExecutionDuringSearch, PlanQuery};

/// State of planning in the background.
pub(super) struct BackgroundPlanning {
    search: Option<BackgroundSearch>,
    /// The situation of the next plan if a late action does not end, as reported to the planner.
    anticipated: Option<AnticipatedReplan>,
    /// The expected planning time, in seconds of the world's clock.
    expected_time: Rational,
    /// The task with the goals of the present plan, with background planning.
    plan_task: Option<Arc<Task>>,
    /// The last awaited request whose answer was a plan: the task with its goals, the situation,
    /// and the assumption about late actions.
    planned_for: Option<(Arc<Task>, Situation, OverrunEstimate)>,
}

impl BackgroundPlanning {
    pub(super) fn new(expected_time: Rational) -> Self {
        Self {
            search: None,
            anticipated: None,
            expected_time,
            plan_task: None,
            planned_for: None,
        }
    }

    pub(super) fn search(&self) -> Option<&BackgroundSearch> {
        self.search.as_ref()
    }

    pub(super) fn search_mut(&mut self) -> Option<&mut BackgroundSearch> {
        self.search.as_mut()
    }

    pub(super) fn take_search(&mut self) -> Option<BackgroundSearch> {
        self.search.take()
    }

    /// Begins a search, or continues one that was taken.
    pub(super) fn set_search(&mut self, search: BackgroundSearch) {
        self.search = Some(search);
    }

    /// Returns `true` while the present plan continues unless the plan of the search is better.
    pub(super) fn is_search_optional(&self) -> bool {
        self.search
            .as_ref()
            .is_some_and(BackgroundSearch::is_optional)
    }

    /// Ends the search. Returns its request that has no answer yet.
    pub(super) fn end_search(&mut self) -> Option<RequestId> {
        self.search.take()?.open_request()
    }

    /// Returns the answers that arrived during the wait that ends at `now`, as observations.
    pub(super) fn arrived_answers(&self, now: &Rational) -> Vec<Observation> {
        let search = self.search.as_ref();
        let (is_made, is_ready) = search.map_or((false, false), BackgroundSearch::arrived_answers);
        let made = is_made.then_some(Event::PlanMade);
        let ready = is_ready.then_some(Event::PlanReady);
        let arrival = |event| Observation {
            time: now.clone(),
            event,
        };
        made.into_iter().chain(ready).map(arrival).collect()
    }

    pub(super) fn expected_time(&self) -> &Rational {
        &self.expected_time
    }

    pub(super) fn set_expected_time(&mut self, time: Rational) {
        self.expected_time = time;
    }

    /// Updates the expected planning time: to the last planning time if that is greater, otherwise
    /// to no less than half of the previous value. If one long search delayed all later plans, a
    /// run with frequent new goals would never start anything.
    pub(super) fn update_expected_time(&mut self, took: &Rational) {
        let half = &self.expected_time / &Rational::from(2);
        self.expected_time = half.max(took.clone());
    }

    /// Raises the expected planning time to at least this time.
    pub(super) fn raise_expected_time(&mut self, took: Rational) {
        self.expected_time = std::mem::take(&mut self.expected_time).max(took);
    }

    /// Records the task of the plan that is being adopted.
    pub(super) fn set_plan_task(&mut self, task: &Arc<Task>) {
        self.plan_task = Some(Arc::clone(task));
    }

    /// Returns the belief with the goals of the present plan, which need not reach the goals that
    /// were given since. `None` if the goals are the same.
    pub(super) fn belief_of_the_plan(&self, belief: &BeliefState) -> Option<BeliefState> {
        let (_, task) = (self.search.as_ref()?, self.plan_task.as_ref()?);
        let mut belief = belief.clone();
        belief.set_goal(task);
        Some(belief)
    }

    /// Records that the planner has made a plan for an awaited request.
    pub(super) fn note_planned_for(
        &mut self,
        task: &Arc<Task>,
        situation: &Situation,
        guess: OverrunEstimate,
    ) {
        self.planned_for = Some((Arc::clone(task), situation.clone(), guess));
    }

    /// Returns `true` if the last awaited plan was made for the same request.
    pub(super) fn is_planned_for(
        &self,
        task: &Arc<Task>,
        situation: &Situation,
        guess: OverrunEstimate,
    ) -> bool {
        let is_it = |(known_task, known, before): &(Arc<Task>, Situation, OverrunEstimate)| {
            Arc::ptr_eq(known_task, task) && known == situation && *before == guess
        };
        self.planned_for.as_ref().is_some_and(is_it)
    }

    /// Records an event that neither the search nor the forecast accounts for.
    pub(super) fn note_unexpected_event(&mut self) {
        if let Some(search) = &mut self.search {
            search.note_unexpected_event();
        }
        self.note_unexpected_effects();
    }

    /// Records an event that the plan being prepared and the forecast do not account for.
    pub(super) fn note_unexpected_effects(&mut self) {
        if let Some(anticipated) = &mut self.anticipated {
            anticipated.note_unexpected_event();
        }
        if let Some(search) = &mut self.search {
            search.note_unexpected_effects();
        }
    }

    pub(super) fn set_anticipated(&mut self, anticipated: Option<AnticipatedReplan>) {
        self.anticipated = anticipated;
    }

    pub(super) fn anticipated(&self) -> Option<&AnticipatedReplan> {
        self.anticipated.as_ref()
    }

    pub(super) fn take_anticipated(&mut self) -> Option<AnticipatedReplan> {
        self.anticipated.take()
    }

    /// Forgets a forecast for a time that has not come.
    pub(super) fn forget_future_anticipated(&mut self, now: &Rational) {
        self.anticipated.take_if(|it| it.is_after(now));
    }

    /// Abandons the present plan. These of its steps were started.
    pub(super) fn abandon_plan(&mut self, started: &BTreeMap<StepId, ActionHandle>) {
        if let Some(search) = &mut self.search {
            search.abandon_plan(started);
        }
    }
}
