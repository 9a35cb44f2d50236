//! Goals of a ROS action, one at a time.

use std::collections::VecDeque;

use crate::interface::{
    ActionExecutionInfo, CancelRequest, CancelResponse, GoalId, GoalInfo, GoalStatus, GoalStatuses,
    ResultResponse, goal,
};
use crate::message::Stamp;

/// Number of results kept for late requests.
const MAX_KEPT: usize = 16;

/// The open goal and the last ones that have ended. `R` identifies a client.
#[derive(Debug)]
pub struct Goals<R> {
    open: Option<GoalInfo>,
    is_canceling: bool,
    waiting: Vec<R>,
    ended: VecDeque<(GoalInfo, ResultResponse)>,
}

impl<R> Default for Goals<R> {
    fn default() -> Self {
        Self {
            open: None,
            is_canceling: false,
            waiting: Vec::new(),
            ended: VecDeque::new(),
        }
    }
}

impl<R> Goals<R> {
    /// Returns the open goal.
    pub fn open(&self) -> Option<GoalId> {
        self.open.map(|it| it.goal_id)
    }

    /// Accepts a goal if none is open and its number is new.
    pub fn accept(&mut self, goal_id: GoalId, stamp: Stamp) -> bool {
        let is_new = self.open.is_none() && self.ended.iter().all(|(it, _)| it.goal_id != goal_id);
        if is_new {
            self.open = Some(GoalInfo { goal_id, stamp });
        }
        is_new
    }

    /// Cancels the open goal if the request selects it: by its number, by a latest time, or, with
    /// both zero, always. Returns `true` if it is selected, and the answer.
    pub fn cancel(&mut self, request: &CancelRequest) -> (bool, CancelResponse) {
        let GoalInfo { goal_id, stamp } = request.goal_info;
        let (is_any, is_ever) = (goal_id == GoalId::default(), stamp == Stamp::default());
        let is_meant = |it: &GoalInfo| {
            (is_any && is_ever)
                || (!is_any && it.goal_id == goal_id)
                || (!is_ever && (it.stamp.sec, it.stamp.nanosec) <= (stamp.sec, stamp.nanosec))
        };
        let goals_canceling: Vec<_> = self.open.into_iter().filter(is_meant).collect();
        let has_ended = !is_any && self.ended.iter().any(|(it, _)| it.goal_id == goal_id);
        let return_code = match (goals_canceling.is_empty(), is_any, has_ended) {
            (false, ..) | (true, true, _) => 0,
            (true, false, true) => 3,
            (true, false, false) => 2,
        };
        let is_given_up = !goals_canceling.is_empty();
        self.is_canceling |= is_given_up;
        let response = CancelResponse {
            return_code,
            goals_canceling,
        };
        (is_given_up, response)
    }

    /// Requests a result. Returns the client and the result, or `None` if the goal is open. Its
    /// result is then returned by [`Self::end`].
    pub fn request_result(&mut self, goal_id: GoalId, who: R) -> Option<(R, ResultResponse)> {
        if self.open() == Some(goal_id) {
            self.waiting.push(who);
            return None;
        }
        let ended = self.ended.iter().find(|(it, _)| it.goal_id == goal_id);
        let unknown = || ResultResponse {
            status: goal::UNKNOWN,
            ..ResultResponse::default()
        };
        Some((
            who,
            ended.map_or_else(unknown, |(_, result)| result.clone()),
        ))
    }

    /// Ends the open goal. Returns its result for each waiting client.
    pub fn end(
        &mut self,
        is_reached: bool,
        infos: Vec<ActionExecutionInfo>,
    ) -> Vec<(R, ResultResponse)> {
        let Some(info) = self.open.take() else {
            return Vec::new();
        };
        let status = match (is_reached, self.is_canceling) {
            (true, _) => goal::SUCCEEDED,
            (false, true) => goal::CANCELED,
            (false, false) => goal::ABORTED,
        };
        self.is_canceling = false;
        let result = ResultResponse {
            status,
            success: is_reached,
            action_execution_status: infos,
        };
        self.ended.push_back((info, result.clone()));
        if self.ended.len() > MAX_KEPT {
            self.ended.pop_front();
        }
        self.waiting
            .drain(..)
            .map(|who| (who, result.clone()))
            .collect()
    }

    /// Returns the status of each known goal.
    pub fn statuses(&self) -> GoalStatuses {
        let ended = self
            .ended
            .iter()
            .map(|(info, result)| (*info, result.status));
        let now = if self.is_canceling {
            goal::CANCELING
        } else {
            goal::EXECUTING
        };
        let all = ended.chain(self.open.map(|info| (info, now)));
        GoalStatuses {
            status_list: all
                .map(|(goal_info, status)| GoalStatus { goal_info, status })
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST: GoalId = [1; 16];
    const SECOND: GoalId = [2; 16];

    fn at(sec: i32) -> Stamp {
        Stamp { sec, nanosec: 0 }
    }

    fn cancel(goals: &mut Goals<u8>, goal_id: GoalId, stamp: Stamp) -> (bool, i8) {
        let goal_info = GoalInfo { goal_id, stamp };
        let (is_given_up, response) = goals.cancel(&CancelRequest { goal_info });
        assert_eq!(is_given_up, !response.goals_canceling.is_empty());
        (is_given_up, response.return_code)
    }

    #[test]
    fn second_goal_is_rejected_while_one_is_active() {
        let mut goals = Goals::<u8>::default();
        assert!(goals.accept(FIRST, at(5)));
        assert!(!goals.accept(SECOND, at(6)));
        goals.end(true, vec![]);
        assert!(!goals.accept(FIRST, at(7)), "its number is taken");
        assert!(goals.accept(SECOND, at(8)));
        let statuses = goals.statuses().status_list;
        assert_eq!(
            statuses.iter().map(|it| it.status).collect::<Vec<_>>(),
            [goal::SUCCEEDED, goal::EXECUTING]
        );
    }

    #[test]
    fn result_is_sent_at_goal_end_and_on_late_request() {
        let mut goals = Goals::default();
        goals.accept(FIRST, at(5));
        assert_eq!(goals.request_result(FIRST, 'a'), None);
        let answers = goals.end(false, vec![]);
        assert_eq!(
            (answers.len(), answers[0].0, answers[0].1.status),
            (1, 'a', goal::ABORTED)
        );
        let (_, late) = goals.request_result(FIRST, 'b').expect("it has ended");
        assert_eq!((late.status, late.success), (goal::ABORTED, false));
        let (_, unknown) = goals.request_result(SECOND, 'c').expect("there is none");
        assert_eq!(unknown.status, goal::UNKNOWN);
    }

    #[test]
    fn goals_are_cancelled_by_number_by_time_and_all() {
        let whatever = GoalId::default();
        for (goal_id, stamp, expected) in [
            (FIRST, at(0), (true, 0)),
            (SECOND, at(0), (false, 2)),
            (whatever, at(0), (true, 0)),
            (whatever, at(4), (false, 0)),
            (whatever, at(5), (true, 0)),
        ] {
            let mut goals = Goals::default();
            goals.accept(FIRST, at(5));
            assert_eq!(
                cancel(&mut goals, goal_id, stamp),
                expected,
                "{goal_id:?}, {stamp:?}"
            );
            goals.request_result(FIRST, 7);
            let answers = goals.end(false, vec![]);
            let status = if expected.0 {
                goal::CANCELED
            } else {
                goal::ABORTED
            };
            assert_eq!(answers[0].1.status, status);
            assert_eq!(cancel(&mut goals, FIRST, at(0)), (false, 3));
        }
    }
}
