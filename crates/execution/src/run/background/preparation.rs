//! Preparation of a plan in the background.

use elbowroom_model::ground::{Action, Body};
use elbowroom_model::{Footprint, Step, Task};
use elbowroom_num::Rational;

use super::search::MAX_START_REPORT_WAIT;
use crate::event::ActionHandle;
use crate::executor::{Order, PreparedPlan};
use crate::preparation::PrepareError;
use crate::request::RequestId;
use crate::run::action_log::ActionLog;
use crate::run::situation::StartedPlan;
use crate::run::view::RunView;

/// Background preparation of a plan.
pub(in crate::run) struct Preparation {
    request: RequestId,
    /// The prepared plan, until it is processed.
    answer: Option<Result<PreparedPlan, PrepareError>>,
    course: StartedPlan,
    /// Number of actions started until then. Later ones belong to the plan.
    started: usize,
    /// The time at which it was ready, if it is.
    since: Option<Rational>,
    /// `true` if an unexpected event has happened since.
    is_outdated: bool,
    /// `true` if the plan was fitted to the present situation.
    is_fitted: bool,
}

impl Preparation {
    pub(super) fn new(
        request: RequestId,
        course: StartedPlan,
        started: usize,
        is_fitted: bool,
    ) -> Self {
        Self {
            request,
            answer: None,
            course,
            started,
            since: None,
            is_outdated: false,
            is_fitted,
        }
    }

    /// Takes the answer to the request, which has arrived now or during a wait.
    pub(super) fn take_answer(
        &mut self,
        id: RequestId,
        prepared: Result<PreparedPlan, PrepareError>,
        now: Option<Rational>,
    ) {
        if self.open_request() == Some(id) {
            self.answer = Some(prepared);
            self.since = now;
        }
    }

    /// Records that the plan is prepared. Returns `false` if there is no new answer.
    pub(super) fn note_ready(&mut self, now: &Rational) -> bool {
        let has_arrived = self.has_arrived();
        if has_arrived {
            self.since = Some(now.clone());
        }
        has_arrived
    }

    /// Returns `true` if the prepared plan has arrived, and is not recorded yet.
    pub(super) fn has_arrived(&self) -> bool {
        self.answer.is_some() && self.since.is_none()
    }

    /// Returns the request if it has no answer yet.
    pub(super) fn open_request(&self) -> Option<RequestId> {
        (self.answer.is_none() && self.since.is_none()).then_some(self.request)
    }

    pub(super) fn note_unexpected_event(&mut self) {
        self.is_outdated = true;
    }

    pub(in crate::run) fn is_outdated(&self) -> bool {
        self.is_outdated
    }

    pub(in crate::run) fn is_fitted(&self) -> bool {
        self.is_fitted
    }

    pub(in crate::run) fn ready_since(&self) -> Option<&Rational> {
        self.since.as_ref()
    }

    pub(in crate::run) fn take_prepared(&mut self) -> Option<Result<PreparedPlan, PrepareError>> {
        self.answer.take()
    }

    /// Returns the plan, the situation from which it starts, and the actions running there.
    pub(in crate::run) fn course(&self) -> &StartedPlan {
        &self.course
    }

    /// Returns the time of the next decision about the preparation if no event comes before.
    pub(super) fn next_decision(&self, view: &RunView<'_>) -> Rational {
        let (_, situation, _) = &self.course;
        match &self.since {
            Some(since) => {
                (since + Rational::from(MAX_START_REPORT_WAIT)).max(view.now + view.task.epsilon())
            }
            None if *view.now < situation.time => situation.time.clone(),
            // The preparer reports when it is finished.
            None => view.settings.time_limit.clone(),
        }
    }

    /// Returns the actions that were started since the preparation began.
    pub(in crate::run) fn starts_since(
        &self,
        log: &ActionLog,
    ) -> impl Iterator<Item = ActionHandle> + use<> {
        (self.started..log.started()).map(|number| ActionHandle(number as u64))
    }

    /// Returns `true` if an action was started meanwhile and its start has not been reported.
    pub(in crate::run) fn has_unreported_start(&self, view: &RunView<'_>) -> bool {
        let has_ended = |it: ActionHandle| view.log.get(it).is_none_or(|it| it.ended.is_some());
        let is_running = |it: ActionHandle| view.belief.running().contains_key(&it);
        let mut begun = self.starts_since(view.log);
        begun.any(|it| !has_ended(it) && !is_running(it))
    }

    /// Returns `true` if the prepared plan waits for the reports of starts.
    pub(in crate::run) fn waits_for_reports(&self, view: &RunView<'_>, since: &Rational) -> bool {
        self.has_unreported_start(view) && *view.now < since + Rational::from(MAX_START_REPORT_WAIT)
    }

    /// Returns `true` if these actions can be started while the plan is being prepared: the plan
    /// also has them, and no earlier step of it interferes with them.
    pub(in crate::run) fn may_start(&self, orders: &[Order], view: &RunView<'_>) -> bool {
        let (plan, situation, _) = &self.course;
        let mut left = Step::by_start(plan.new_steps(situation));
        let begun = self.starts_since(view.log);
        let begun = begun.filter_map(|it| view.log.get(it));
        let mut take = |name: &str| {
            let index = left.iter().position(|it| it.action.name == name)?;
            Some(left.remove(index))
        };
        if !begun.map(|it| take(&it.action.name)).all(|it| it.is_some()) {
            return false;
        }
        let starts: Option<Vec<&Step>> = orders.iter().map(|it| take(&it.action.name)).collect();
        starts.is_some_and(|starts| {
            starts.iter().all(|step| {
                let mut earlier = left.iter().filter(|it| it.start < step.start);
                !earlier.any(|it| may_interfere(view.task, &it.action, &step.action))
            })
        })
    }
}

/// Returns `true` if the order of two actions may matter.
fn may_interfere(task: &Task, one: &Action, other: &Action) -> bool {
    let prints = |action: &Action| {
        let mut all = vec![
            Footprint::of_start(task, action),
            Footprint::of_end(task, action),
        ];
        if let Body::Durative(body) = &action.body {
            all.push(Footprint::of_condition(task, &body.over_all));
        }
        all
    };
    let others = prints(other);
    let touches = |it: &Footprint| others.iter().any(|other| it.interferes_with(other));
    prints(one).iter().any(touches)
}
