//! Services, topics and the action of `PlanSys2`'s planner and executor.

use elbowroom_plansys2::interface::{
    ActionExecutionInfo, CancelRequest, CancelResponse, ChangeRequest, Empty, Feedback,
    GoalRequest, GoalResponse, GoalStatuses, Plan, PlanRequest, PlanResponse, ResultRequest,
    ResultResponse, StateResponse, Success, ValidateRequest, ValidateResponse,
};
use elbowroom_plansys2::knowledge::SubGoalsResponse;

use super::Input;
use super::network::{Answers, Asker, Mouth, Network, latched, reliable};

/// Nodes that this program replaces.
pub(super) const NODES: [&str; 2] = ["planner", "executor"];
/// Positions in [`NODES`].
pub(super) const PLANNER: usize = 0;
pub(super) const EXECUTOR: usize = 1;

/// Request of a client.
pub(super) enum Asked {
    Plan(Asker, PlanRequest),
    /// The executed plan, or its remaining steps.
    Executed(Part, Asker),
    /// The subgoals, in the order of their times.
    Order(Asker),
    Validate(Asker, ValidateRequest),
    Goal(Asker, GoalRequest),
    Cancel(Asker, CancelRequest),
    Result(Asker, ResultRequest),
    /// The state of a node, by its position in [`NODES`].
    State(usize, Asker),
    Change(usize, Asker, ChangeRequest),
}

/// Requested part of the executed plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Whole,
    Rest,
}

/// Senders of answers and messages.
pub(super) struct Services {
    pub(super) plan: Answers<PlanResponse>,
    pub(super) executed: Answers<PlanResponse>,
    pub(super) rest: Answers<PlanResponse>,
    pub(super) order: Answers<SubGoalsResponse>,
    pub(super) validate: Answers<ValidateResponse>,
    pub(super) goal: Answers<GoalResponse>,
    pub(super) cancel: Answers<CancelResponse>,
    pub(super) result: Answers<ResultResponse>,
    pub(super) feedback: Mouth<Feedback>,
    pub(super) statuses: Mouth<GoalStatuses>,
    /// For monitoring tools: the status of each action, and the executed plan.
    pub(super) infos: Mouth<ActionExecutionInfo>,
    pub(super) executing: Mouth<Plan>,
    pub(super) state: Vec<Answers<StateResponse>>,
    pub(super) change: Vec<Answers<Success>>,
}

impl Services {
    /// Offers all services and topics.
    ///
    /// # Errors
    /// DDS refuses; the text says what.
    pub(super) fn offer(network: &mut Network) -> Result<Self, String> {
        let ask = |asked| Input::Asked(Box::new(asked));
        let (mut state, mut change) = (Vec::new(), Vec::new());
        for (number, node) in NODES.iter().enumerate() {
            let kind = "lifecycle_msgs::srv::dds_::GetState";
            let name = format!("{node}/get_state");
            state.push(network.serve(&name, kind, move |asker, _: Empty| {
                ask(Asked::State(number, asker))
            })?);
            let kind = "lifecycle_msgs::srv::dds_::ChangeState";
            let name = format!("{node}/change_state");
            change.push(network.serve(&name, kind, move |asker, it| {
                ask(Asked::Change(number, asker, it))
            })?);
        }
        let action = "plansys2_msgs::action::dds_::ExecutePlan";
        let cancels = "action_msgs::srv::dds_::CancelGoal";
        let own = |part: &str| format!("execute_plan/_action/{part}");
        Ok(Self {
            plan: network.serve(
                "planner/get_plan",
                "plansys2_msgs::srv::dds_::GetPlan",
                move |asker, it| ask(Asked::Plan(asker, it)),
            )?,
            executed: network.serve(
                "executor/get_plan",
                "plansys2_msgs::srv::dds_::GetPlan",
                move |asker, _: PlanRequest| ask(Asked::Executed(Part::Whole, asker)),
            )?,
            rest: network.serve(
                "executor/get_remaining_plan",
                "plansys2_msgs::srv::dds_::GetPlan",
                move |asker, _: PlanRequest| ask(Asked::Executed(Part::Rest, asker)),
            )?,
            order: network.serve(
                "executor/get_ordered_sub_goals",
                "plansys2_msgs::srv::dds_::GetOrderedSubGoals",
                move |asker, _: Empty| ask(Asked::Order(asker)),
            )?,
            validate: network.serve(
                "planner/validate_domain",
                "plansys2_msgs::srv::dds_::ValidateDomain",
                move |asker, it| ask(Asked::Validate(asker, it)),
            )?,
            goal: network.serve(
                &own("send_goal"),
                &format!("{action}_SendGoal"),
                move |asker, it| ask(Asked::Goal(asker, it)),
            )?,
            cancel: network.serve(&own("cancel_goal"), cancels, move |asker, it| {
                ask(Asked::Cancel(asker, it))
            })?,
            result: network.serve(
                &own("get_result"),
                &format!("{action}_GetResult"),
                move |asker, it| ask(Asked::Result(asker, it)),
            )?,
            feedback: network.publish(
                &own("feedback"),
                &format!("{action}_FeedbackMessage_"),
                &reliable(10),
            )?,
            statuses: network.publish(
                &own("status"),
                "action_msgs::msg::dds_::GoalStatusArray_",
                &latched(),
            )?,
            infos: network.publish(
                "action_execution_info",
                "plansys2_msgs::msg::dds_::ActionExecutionInfo_",
                &reliable(100),
            )?,
            executing: network.publish(
                "executing_plan",
                "plansys2_msgs::msg::dds_::Plan_",
                &latched(),
            )?,
            state,
            change,
        })
    }
    /// Sends the answers that are due. To be called a few times a second.
    ///
    /// # Errors
    /// One could not be sent.
    pub(super) fn flush(&mut self) -> Result<(), String> {
        self.plan.flush()?;
        self.executed.flush()?;
        self.rest.flush()?;
        self.order.flush()?;
        self.validate.flush()?;
        self.goal.flush()?;
        self.cancel.flush()?;
        self.result.flush()?;
        self.state.iter_mut().try_for_each(Answers::flush)?;
        self.change.iter_mut().try_for_each(Answers::flush)
    }
}
