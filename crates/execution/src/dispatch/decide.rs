//! Decisions: the starts that are due, and the time of the next decision.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Body, Condition, DurationConstraint, Expression};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId, network_node};
use elbowroom_stn::WindowEnd;

use super::{Dispatch, explain, is_instantaneous};
use crate::belief_state::{BeliefState, GoalStatus, conditions_on_duration};
use crate::executor::{Decided, Decision, DecisionContext, Order, PreparedPlan, StepId};
use crate::reason::{Cause, Reason, Subject};
use crate::window_propagation::WindowPropagation;

/// Instance that was commanded and may be running, although its start was not reported.
struct UnreportedStart {
    /// The latest time at which it may be running, on the plan's clock; `None` if there is no
    /// limit.
    until: Option<Rational>,
}

impl Dispatch {
    /// Returns the decision at this moment. All news must have been processed.
    pub(crate) fn next(&mut self, moment: &DecisionContext<'_>) -> Decided {
        if self.progress.remaining == 0 {
            return decide_when_done(moment);
        }
        if let Some(reason) = self
            .overdue_reason(moment)
            .or_else(|| violated_over_all_condition(moment))
        {
            return replan(reason);
        }
        self.decide_without_checks(moment)
    }

    /// Returns the decision without checks for overdue time points and broken over-all conditions.
    pub(crate) fn decide_without_checks(&mut self, moment: &DecisionContext<'_>) -> Decided {
        if self.progress.remaining == 0 {
            return decide_when_done(moment);
        }
        let now = self.to_plan_time(moment.now);
        self.pass_time(&now);
        let mut orders = Vec::new();
        let mut wake: Option<(Rational, NodeId)> = None;
        let mut wake_at = |time: Rational, node: NodeId| {
            if wake.as_ref().is_none_or(|(old, _)| time < *old) {
                wake = Some((time, node));
            }
        };
        for node in self.progress.ready.iter().copied() {
            if !self.horizon.is_ready(network_node(node)) {
                if let Some((time, timed)) = self.timed.last() {
                    wake_at(time.clone(), *timed);
                }
                continue;
            }
            let (_, latest) = self.horizon.window(network_node(node));
            // A start that waits for an event of the world needs no wake-up time.
            if let Ok(earliest) = self.horizon.earliest(network_node(node)) {
                let earliest = earliest.max(self.retry_time(node));
                match earliest.filter(|earliest| *earliest > now) {
                    Some(earliest) => wake_at(earliest, node),
                    None => orders.push(node),
                }
            }
            if let Some(latest) = latest.filter(|latest| *latest >= now) {
                wake_at(latest + &self.epsilon, node);
            }
        }
        orders.retain(|&node| {
            let separated = self.separation_end(node, &now);
            if let Some(separated) = &separated {
                wake_at(separated.clone(), node);
            }
            separated.is_none()
        });
        for &id in &self.progress.running {
            let node = self.awaited_node(id);
            if let Some(silent) = self.unreported_start(id, &now) {
                if let Some(until) = silent.until {
                    wake_at(until + &self.epsilon, node);
                }
                continue;
            }
            // A closed window was reported before, or is irrelevant for the executor.
            let latest = self.horizon.window(network_node(node)).1;
            if let Some(latest) = latest.filter(|latest| *latest >= now) {
                wake_at(latest + &self.epsilon, node);
            }
        }
        if !orders.is_empty() {
            return self.order(&orders, &now, moment.belief);
        }
        let mut reason = Reason::new(Cause::NothingDue);
        reason.about = Some(match &wake {
            Some((_, node)) => {
                let words = self.describe_node(*node);
                let failures = self.failure_subject(*node, Some(words.clone()));
                failures.unwrap_or(Subject::TimePoint(words))
            }
            None => Subject::AnyObservation,
        });
        Decided {
            decision: Decision::Wait {
                until: wake.map(|(time, _)| self.to_world_time(&time)),
            },
            reason,
        }
    }

    /// Starts these actions in order, up to the first one whose conditions do not hold. If that is
    /// the first action of the list, a new plan is requested.
    fn order(&mut self, nodes: &[NodeId], now: &Rational, belief: &BeliefState) -> Decided {
        let mut orders = Vec::new();
        for &node in nodes {
            let (Node::Start(id) | Node::Instant(id)) = self.plan.nodes[node.index()] else {
                continue;
            };
            let action = self.action(id);
            let duration = self.commanded_duration(id, now);
            if let Some(reason) = self.unmet_start_condition(id, &duration, belief) {
                if orders.is_empty() {
                    return replan(reason);
                }
                break;
            }
            orders.push(Order {
                step: StepId::from(id),
                duration: (!is_instantaneous(action)).then_some(duration),
                action: action.clone(),
                planned: self.planned(StepId::from(id), false).unwrap_or_default(),
            });
        }
        let first = orders.first().map(|order| order.step.instance());
        for order in &orders {
            let id = order.step.instance();
            self.progress.ready.remove(&self.ends[id.index()][0]);
            self.progress.running.insert(id);
            self.commanded_unstarted.insert(id, now.clone());
        }
        let mut reason = Reason::new(Cause::Due);
        reason.action = orders.first().map(|order| order.action.name.clone());
        reason.about =
            first.and_then(|id| self.failure_subject(self.start_and_end_nodes(id)[0], None));
        Decided {
            decision: Decision::Start(orders),
            reason,
        }
    }

    /// Returns the duration that is commanded for an action that starts now: the planned one, or
    /// the nearest value that its bounds and its window allow.
    pub(super) fn commanded_duration(&self, id: InstanceId, now: &Rational) -> Rational {
        let planned = self.nominal_duration(id);
        let (least, most) = &self.durations[id.index()];
        let end = network_node(self.ends[id.index()][1]);
        if least == most || self.horizon.is_contingent(end) {
            return planned;
        }
        let (earliest, latest) = self.horizon.window(end);
        let least = earliest
            .map(|earliest| earliest - now)
            .into_iter()
            .chain(least.clone())
            .max();
        let most = latest
            .map(|latest| latest - now)
            .into_iter()
            .chain(most.clone())
            .min();
        let planned = least.map_or(planned.clone(), |least| planned.max(least));
        most.map_or(planned.clone(), |most| planned.min(most))
            .max(Rational::ZERO)
    }

    /// Returns the node of a running instance that is expected next: its start or its end.
    fn awaited_node(&self, id: InstanceId) -> NodeId {
        let [start, end] = self.ends[id.index()];
        if self.execution_time(start).is_some() {
            end
        } else {
            start
        }
    }

    /// Returns a value if an instance was commanded in time, its start was not reported, and it may
    /// still be running. Reports can be lost; the end, or the lack of one, shows when the action
    /// started. When its longest duration has passed since the command, it is assumed not to have
    /// started, and its start is late.
    fn unreported_start(&self, id: InstanceId, now: &Rational) -> Option<UnreportedStart> {
        let start = network_node(self.ends[id.index()][0]);
        let WindowPropagation::Dispatchable(_) = self.horizon else {
            return None;
        };
        let told = self.commanded_unstarted.get(&id)?;
        let latest = self.horizon.window(start).1;
        let is_in_time = latest.is_none_or(|latest| *told <= latest);
        let most = self.durations[id.index()].1.as_ref();
        let until = most.map(|most| told + most);
        let may_run = until.as_ref().is_none_or(|until| now <= until);
        (is_in_time && may_run).then_some(UnreportedStart { until })
    }

    /// Returns the reason if a time point is overdue.
    pub(crate) fn overdue_reason(&self, moment: &DecisionContext<'_>) -> Option<Reason> {
        let now = self.to_plan_time(moment.now);
        let (node, latest) = self.first_missed_time_point(&now)?;
        let awaited = match self.plan.nodes[node.index()] {
            Node::Start(id) | Node::End(id) | Node::Instant(id) => Some(id),
            Node::Zero | Node::Timed(_) => None,
        };
        let awaited = awaited.filter(|id| self.progress.running.contains(id));
        let is_own = |id: InstanceId| {
            node == self.ends[id.index()][1] && self.is_limited_by_duration(id, WindowEnd::Latest)
        };
        let mut reason = if let Some(id) = awaited.filter(|id| is_own(*id)) {
            let mut reason = Reason::new(Cause::Outlived);
            if self.resumed.contains(&id) {
                reason = reason.about(self.duration_subject(id));
            }
            let start = self.ends[id.index()][0];
            reason.observed = self.execution_time(start).map(|start| &now - start);
            reason.allowed = Some(explain::interval(&self.durations[id.index()]));
            reason
        } else {
            let words = self.describe_node(node);
            Reason::new(Cause::Unreachable).about(Subject::TimePoint(words))
        };
        reason.action = awaited.map(|id| self.action(id).name.clone());
        reason.evidence = self.window_evidence(node, WindowEnd::Latest);
        reason.since = Some(self.to_world_time(&latest));
        reason.by = Some(now - latest);
        Some(reason)
    }

    /// Returns the first time point whose window has closed by `now`, on the plan's clock, with its
    /// latest time.
    ///
    /// The windows are exact, so it suffices to compare each awaited time point with its own
    /// window. Windows are not updated merely because time passes, since an event may be reported
    /// later than it happened.
    pub(super) fn first_missed_time_point(&self, now: &Rational) -> Option<(NodeId, Rational)> {
        let running = self.progress.running.iter();
        let awaited = running
            .filter(|id| self.unreported_start(**id, now).is_none())
            .map(|id| self.awaited_node(*id));
        let ready = self.progress.ready.iter().copied();
        awaited.chain(ready).find_map(|node| {
            let latest = self.horizon.window(network_node(node)).1;
            latest
                .filter(|latest| latest < now)
                .map(|latest| (node, latest))
        })
    }
}

/// Decides when the plan is done: the goal is reached, it will be reached without further actions,
/// or a new plan is needed.
fn decide_when_done(moment: &DecisionContext<'_>) -> Decided {
    let belief = moment.belief;
    match belief.goal_status() {
        GoalStatus::Reached => Decided {
            decision: Decision::GoalReached,
            reason: Reason::new(Cause::GoalReached),
        },
        GoalStatus::Awaited(time) => Decided {
            decision: Decision::Wait { until: Some(time) },
            reason: Reason::new(Cause::NothingDue).about(Subject::LastGoalTimedInitial),
        },
        GoalStatus::Unmet => {
            let unmet = in_words(belief, &belief.unmet_finally());
            replan(Reason::new(Cause::PlanDone).about(Subject::Conditions(unmet)))
        }
    }
}

/// Returns the reason if an over-all condition of a running action does not hold.
fn violated_over_all_condition(moment: &DecisionContext<'_>) -> Option<Reason> {
    let (_, underway) = moment.belief.violated_action()?;
    let unmet = underway.violated_conjuncts();
    let about = Subject::OverAllConditions(in_words(moment.belief, &unmet));
    let reason = Reason::new(Cause::Condition).for_action(&underway.action.name);
    Some(reason.about(about).since(moment.now.clone()))
}

impl Dispatch {
    /// Returns the reason if an action's start condition, or a bound on its duration, does not
    /// hold.
    pub(super) fn unmet_start_condition(
        &self,
        id: InstanceId,
        duration: &Rational,
        belief: &BeliefState,
    ) -> Option<Reason> {
        let action = self.action(id);
        let (condition, bounds) = match &action.body {
            Body::Instantaneous(snap) => (&snap.condition, None),
            Body::Durative(body) => (&body.start.condition, Some(&body.duration)),
        };
        let of_domain = self.numbers_of_durations.get(&id);
        let bounds = bounds.into_iter().chain(of_domain).flatten();
        let bounds = conditions_on_duration(bounds, duration);
        let mut unmet = belief.unmet(condition, Some(duration));
        unmet.extend(bounds.iter().flat_map(|it| belief.unmet(it, None)));
        if unmet.is_empty() {
            return None;
        }
        let reason = Reason::new(Cause::Condition).for_action(&action.name);
        Some(reason.about(Subject::Conditions(in_words(belief, &unmet))))
    }
}

/// Returns the numeric bounds on durations, for instances whose durations are parameters of the
/// plan without bounds there. The numbers may have changed since the plan was made.
pub(super) fn numeric_duration_bounds(
    mission: &PreparedPlan,
) -> BTreeMap<InstanceId, Vec<DurationConstraint>> {
    let steps = mission.time_triggered.steps.iter();
    let steps = steps.zip(&mission.instances).filter_map(|(step, &id)| {
        let planned = mission.plan.plan.instance(id).action.durative()?;
        let body = step.action.durative()?;
        let bounds = body
            .duration
            .iter()
            .filter(|bound| reads_only_fluents(bound));
        let bounds: Vec<_> = bounds.cloned().collect();
        (planned.duration.is_empty() && !bounds.is_empty()).then_some((id, bounds))
    });
    steps.collect()
}

/// Returns `true` if the bound reads fluents, and only fluents and constants.
fn reads_only_fluents(bound: &DurationConstraint) -> bool {
    let (mut reads, mut is_known) = (false, true);
    bound.bound.visit_leaves(&mut |leaf| match leaf {
        Expression::Fluent(_) => reads = true,
        Expression::Constant(_) => {}
        _ => is_known = false,
    });
    reads && is_known
}

pub(crate) fn in_words(belief: &BeliefState, conditions: &[&Condition]) -> Vec<String> {
    let words = conditions
        .iter()
        .map(|condition| belief.task().describe_condition(condition));
    words.collect()
}

pub(crate) fn replan(reason: Reason) -> Decided {
    Decided {
        decision: Decision::Replan,
        reason,
    }
}
