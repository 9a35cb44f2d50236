//! Services, topics and the action of `PlanSys2`'s planner and executor.

use elbowroom_plansys2::interface::{
    ActionExecutionInfo, CancelRequest, CancelResponse, ChangeRequest, Empty, Feedback,
    GoalRequest, GoalResponse, GoalStatuses, Plan, PlanRequest, PlanResponse, ResultRequest,
    ResultResponse, StateResponse, Success, ValidateRequest, ValidateResponse,
};
use elbowroom_plansys2::knowledge::SubGoalsResponse;

use super::Input;
use super::network::{Network, RequestId, ServiceReplies, TopicPublisher, latched, reliable};

/// Nodes that this program replaces.
pub(super) const NODES: [&str; 2] = ["planner", "executor"];
/// Positions in [`NODES`].
pub(super) const PLANNER: usize = 0;
pub(super) const EXECUTOR: usize = 1;

/// Request of a client.
pub(super) enum ServiceRequest {
    Plan(RequestId, PlanRequest),
    /// The executed plan, or its remaining steps.
    Executed(Part, RequestId),
    /// The subgoals, in the order of their times.
    Order(RequestId),
    Validate(RequestId, ValidateRequest),
    Goal(RequestId, GoalRequest),
    Cancel(RequestId, CancelRequest),
    Result(RequestId, ResultRequest),
    /// The state of a node, by its position in [`NODES`].
    State(usize, RequestId),
    Change(usize, RequestId, ChangeRequest),
}

/// Requested part of the executed plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Whole,
    Rest,
}

/// Senders of answers and messages.
pub(super) struct Services {
    pub(super) plan: ServiceReplies<PlanResponse>,
    pub(super) executed: ServiceReplies<PlanResponse>,
    pub(super) rest: ServiceReplies<PlanResponse>,
    pub(super) order: ServiceReplies<SubGoalsResponse>,
    pub(super) validate: ServiceReplies<ValidateResponse>,
    pub(super) goal: ServiceReplies<GoalResponse>,
    pub(super) cancel: ServiceReplies<CancelResponse>,
    pub(super) result: ServiceReplies<ResultResponse>,
    pub(super) feedback: TopicPublisher<Feedback>,
    pub(super) statuses: TopicPublisher<GoalStatuses>,
    /// For monitoring tools: the status of each action, and the executed plan.
    pub(super) infos: TopicPublisher<ActionExecutionInfo>,
    pub(super) executing: TopicPublisher<Plan>,
    pub(super) state: Vec<ServiceReplies<StateResponse>>,
    pub(super) change: Vec<ServiceReplies<Success>>,
}

impl Services {
    /// Offers all services and topics.
    ///
    /// # Errors
    /// When DDS reports an error, which the text describes.
    pub(super) fn offer(network: &mut Network) -> Result<Self, String> {
        let ask = |asked| Input::ServiceRequest(Box::new(asked));
        let (mut state, mut change) = (Vec::new(), Vec::new());
        for (number, node) in NODES.iter().enumerate() {
            let kind = "lifecycle_msgs::srv::dds_::GetState";
            let name = format!("{node}/get_state");
            state.push(network.serve(&name, kind, move |asker, _: Empty| {
                ask(ServiceRequest::State(number, asker))
            })?);
            let kind = "lifecycle_msgs::srv::dds_::ChangeState";
            let name = format!("{node}/change_state");
            change.push(network.serve(&name, kind, move |asker, it| {
                ask(ServiceRequest::Change(number, asker, it))
            })?);
        }
        let action = "plansys2_msgs::action::dds_::ExecutePlan";
        let cancels = "action_msgs::srv::dds_::CancelGoal";
        let own = |part: &str| format!("execute_plan/_action/{part}");
        Ok(Self {
            plan: network.serve(
                "planner/get_plan",
                "plansys2_msgs::srv::dds_::GetPlan",
                move |asker, it| ask(ServiceRequest::Plan(asker, it)),
            )?,
            executed: network.serve(
                "executor/get_plan",
                "plansys2_msgs::srv::dds_::GetPlan",
                move |asker, _: PlanRequest| ask(ServiceRequest::Executed(Part::Whole, asker)),
            )?,
            rest: network.serve(
                "executor/get_remaining_plan",
                "plansys2_msgs::srv::dds_::GetPlan",
                move |asker, _: PlanRequest| ask(ServiceRequest::Executed(Part::Rest, asker)),
            )?,
            order: network.serve(
                "executor/get_ordered_sub_goals",
                "plansys2_msgs::srv::dds_::GetOrderedSubGoals",
                move |asker, _: Empty| ask(ServiceRequest::Order(asker)),
            )?,
            validate: network.serve(
                "planner/validate_domain",
                "plansys2_msgs::srv::dds_::ValidateDomain",
                move |asker, it| ask(ServiceRequest::Validate(asker, it)),
            )?,
            goal: network.serve(
                &own("send_goal"),
                &format!("{action}_SendGoal"),
                move |asker, it| ask(ServiceRequest::Goal(asker, it)),
            )?,
            cancel: network.serve(&own("cancel_goal"), cancels, move |asker, it| {
                ask(ServiceRequest::Cancel(asker, it))
            })?,
            result: network.serve(
                &own("get_result"),
                &format!("{action}_GetResult"),
                move |asker, it| ask(ServiceRequest::Result(asker, it)),
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
        self.state.iter_mut().try_for_each(ServiceReplies::flush)?;
        self.change.iter_mut().try_for_each(ServiceReplies::flush)
    }
}
