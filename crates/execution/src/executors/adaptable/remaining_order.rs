//! Execution of a plan by its orders, or by a policy table: [`RemainingOrder`].

mod numeric_conditions;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body};
use elbowroom_model::{Footprint, State, Step};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};
use elbowroom_probability::search::Progress;
use elbowroom_probability::{Choice, Likelihoods, NextHappening, Running, SearchState};

use super::super::happening_choice::HappeningChooser;
use super::initial_belief::InitialBelief;
use super::repetitions::Repetitions;
use crate::belief_state::BeliefState;
use crate::dispatch::replan;
use crate::event::Ending;
use crate::executor::{
    Decided, Decision, DecisionContext, Order, PlanEvent, Planned, PreparedPlan, StepId,
};
use crate::reason::{Cause, Evidence, Reason, Subject};
use crate::separation::Separation;

/// Work limit of a search, in happenings: the number of sequences times the plan's length. When it
/// is reached, the best order so far is used. Plans of about twenty happenings are searched
/// completely.
const MAX_HAPPENINGS: usize = 200_000;

/// An action is abandoned when the probability of its failures in a row falls below this value.
const MIN_FAILURE_PROBABILITY: f64 = 1e-6;

/// Maximum number of failures in a row, however unlikely a start is. Retries take no time if starts
/// take none.
const MAX_FAILURES: i32 = 1000;

/// Number of failures in a row that are attributed to an unmet condition.
const MAX_EXPLAINED_FAILURES: i32 = 3;

/// Maximum number of successes of an action at one time with one order. Beyond it, the plan makes
/// no progress.
const MAX_SUCCESSES_PER_TIME: u32 = 20;

/// Number of successes of an action in the same state after which an order is executed to its end
/// and no longer chosen again at each start.
const MAX_RECONSIDERED_SUCCESSES: u32 = 3;

/// Maximum number of successes of an action in the same state. Beyond it, the plan makes no
/// progress and is abandoned.
const MAX_SUCCESSES_PER_STATE: u32 = 20;

/// Number of times that an action may be cancelled in favour of a likelier order.
const MAX_CANCELLATIONS: u32 = 3;

/// State of the execution of a plan.
#[derive(Clone)]
pub(super) struct RemainingOrder {
    prepared_plan: Arc<PreparedPlan>,
    /// The plan's steps in the order of the model's instances.
    steps: Arc<[Step]>,
    chooser: HappeningChooser,
    /// Instances that were commanded to start and have not ended, with their starts on the plan's
    /// clock.
    running: BTreeMap<StepId, (InstanceId, Option<Rational>)>,
    /// The timed initials, on the plan's clock.
    timed: Vec<(NodeId, Rational)>,
    /// Instances that were running when the plan was adopted. Their steps are only the remainder of an action,
    /// with the remaining duration and without start conditions, so they are never started.
    continued: BTreeSet<InstanceId>,
    /// Recent starts and ends, on the plan's clock.
    recent: Vec<(NodeId, Rational)>,
    /// The happenings that starts and planned ends are separated from, with changes by the world.
    separation: Separation,
    /// Number of failures in a row, by instance.
    failures: BTreeMap<InstanceId, i32>,
    /// The time of each instance's latest success, and the number of its successes at that time.
    successes: BTreeMap<InstanceId, (Rational, u32)>,
    /// The latest event, for the explanation when no order is left.
    latest: Option<Evidence>,
    repetitions: Repetitions,
    /// The last chosen happening.
    chosen: Option<NodeId>,
    /// `true` if an action has ended before the order expected its end.
    is_ahead: bool,
    /// `true` if the table of a small world has led to the same state repeatedly.
    is_table_cycling: bool,
    /// Steps that were cancelled and have not ended.
    cancelled: BTreeSet<StepId>,
    /// Number of cancellations, by instance.
    cancellations: BTreeMap<InstanceId, u32>,
    /// The number of the next order.
    next_step: u32,
}

impl RemainingOrder {
    /// Creates the state of a plan that is being adopted. `steps` are the actions in the order of
    /// the model's instances.
    pub(super) fn new(
        mission: &PreparedPlan,
        chooser: HappeningChooser,
        steps: Vec<Step>,
        likelihoods: &Arc<Likelihoods>,
    ) -> Self {
        let in_order = mission
            .order
            .iter()
            .flat_map(|order| &order.instance_of_step);
        let under_way = mission.instances.iter().zip(in_order);
        let under_way = under_way.map(|(&own, &in_order)| (StepId::from(own), in_order));
        let under_way = under_way.filter(|(step, _)| mission.running.contains_key(step));
        let model = chooser.search().model();
        let nodes = model.plan().nodes.iter().enumerate();
        let timed = nodes.filter_map(|(at, node)| match node {
            Node::Timed(index) => {
                Some((NodeId::from(at), model.task().timed()[*index].time.clone()))
            }
            _ => None,
        });
        let under_way: BTreeMap<_, _> = under_way
            .map(|(step, instance)| (step, (instance, Some(Rational::ZERO))))
            .collect();
        let mut separation =
            Separation::new(&mission.task, &mission.origin).with_failures(Arc::clone(likelihoods));
        for (step, (instance, _)) in &under_way {
            // The steps of running actions are only their remainders.
            let rest = &steps[instance.index()];
            let end = rest.duration.clone().unwrap_or_default();
            separation.expect_end(step.0, (&mission.task, &rest.action), end);
        }
        Self {
            timed: timed.collect(),
            continued: under_way.values().map(|(instance, _)| *instance).collect(),
            running: under_way,
            next_step: u32::try_from(steps.len()).unwrap_or(u32::MAX),
            steps: steps.into(),
            chooser,
            cancelled: BTreeSet::new(),
            cancellations: BTreeMap::new(),
            prepared_plan: Arc::new(mission.clone()),
            recent: Vec::new(),
            separation,
            failures: BTreeMap::new(),
            successes: BTreeMap::new(),
            latest: None,
            repetitions: Repetitions::default(),
            chosen: None,
            is_ahead: false,
            is_table_cycling: false,
        }
    }

    /// Returns `true` if the plan was abandoned because the table of a small world led to the same state repeatedly.
    pub(super) fn is_table_cycling(&self) -> bool {
        self.is_table_cycling
    }

    /// Returns the window of the end of a running step. All other times are decided at the last
    /// moment.
    pub(super) fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        let (instance, start) = self.running.get(&step)?;
        let start = start.as_ref().filter(|_| is_end)?;
        let (least, greatest) = self.chooser.search().model().plan().duration(*instance);
        Some(Planned {
            earliest: Some(self.to_world_time(&(start + least))),
            latest: greatest.map(|greatest| self.to_world_time(&(start + greatest))),
        })
    }

    /// Processes a news item. Returns the reason for a new plan, if one is needed.
    pub(super) fn learn(
        &mut self,
        news: &PlanEvent,
        moment: &DecisionContext<'_>,
        likelihoods: &Likelihoods,
    ) -> Option<Reason> {
        let belief = moment.belief;
        self.latest = self.describe_news(news, belief).or(self.latest.take());
        match news {
            PlanEvent::Started { step, time, .. } => {
                let local = time - &self.prepared_plan.origin;
                let (instance, start) = self.running.get_mut(step)?;
                let instance = *instance;
                *start = Some(local.clone());
                self.recent
                    .push((self.node(instance, false), local.clone()));
                if self.steps[instance.index()].duration.is_some() {
                    return None;
                }
                self.running.remove(step);
                self.repetitions.end(*step, true);
                self.succeeded(instance, local)
            }
            PlanEvent::Ended {
                step, ending, time, ..
            } => {
                let (instance, start) = self.running.remove(step)?;
                let local = time - &self.prepared_plan.origin;
                self.repetitions.end(*step, *ending == Ending::Succeeded);
                self.separation
                    .end(step.0, *ending == Ending::Succeeded, &local);
                self.recent.push((self.node(instance, true), local.clone()));
                let was_let_go = self.cancelled.remove(step);
                if *ending == Ending::Succeeded {
                    self.is_ahead |= self.chosen != Some(self.node(instance, true));
                    return self.succeeded(instance, local);
                }
                if was_let_go {
                    return None;
                }
                let failures = self.failures.entry(instance).or_default();
                *failures += 1;
                let failures = *failures;
                let step = &self.steps[instance.index()];
                let is_explained = failures <= MAX_EXPLAINED_FAILURES
                    && has_unmet_condition(step, start.is_some(), belief);
                if is_explained {
                    return None;
                }
                check_failures(step, failures, ending, likelihoods)
            }
            // Layers are compared with the belief, which already contains the change.
            PlanEvent::Fact(_) | PlanEvent::Value(_) => {
                self.record_spontaneous_change(news, moment);
                None
            }
            PlanEvent::Contradiction { action } => {
                Some(Reason::new(Cause::Contradiction).for_action(action))
            }
            PlanEvent::TimedOut { action, since } => Some(
                Reason::new(Cause::Silence)
                    .for_action(action)
                    .since(since.clone()),
            ),
        }
    }

    /// Records the success of an action. Returns the reason for a new plan if the action succeeds
    /// too often at one time: an action without duration would be repeated forever.
    fn succeeded(&mut self, instance: InstanceId, time: Rational) -> Option<Reason> {
        self.failures.remove(&instance);
        let (latest, times) = self.successes.entry(instance).or_default();
        *times = if *latest == time { *times + 1 } else { 1 };
        *latest = time;
        let (times, since) = (*times, latest.clone());
        let name = &self.steps[instance.index()].action.name;
        let about = format!("{name} has succeeded {times} times at the same time without progress");
        let reason = Reason::new(Cause::NoOrder).about(Subject::ExternalMessage(about));
        (times > MAX_SUCCESSES_PER_TIME).then(|| reason.since(self.to_world_time(&since)))
    }

    /// Records a spontaneous change.
    fn record_spontaneous_change(&mut self, news: &PlanEvent, moment: &DecisionContext<'_>) {
        let mut change = Footprint::default();
        match news {
            PlanEvent::Fact(fact) if moment.belief.fact(*fact) => change.adds.insert(*fact),
            PlanEvent::Fact(fact) => change.deletes.insert(*fact),
            PlanEvent::Value(fluent) => change.assigns.insert(*fluent),
            _ => return,
        };
        self.separation
            .note(change, &(moment.now - &self.prepared_plan.origin));
    }

    /// Returns the action that a news item concerns.
    pub(super) fn action_of(&self, news: &PlanEvent) -> Option<&Action> {
        let (PlanEvent::Started { step, .. } | PlanEvent::Ended { step, .. }) = news else {
            return None;
        };
        let (instance, _) = self.running.get(step)?;
        Some(&self.steps[instance.index()].action)
    }

    /// Returns a news item with names instead of numbers.
    fn describe_news(&self, news: &PlanEvent, belief: &BeliefState) -> Option<Evidence> {
        let action = |step: &StepId| {
            let (instance, _) = self.running.get(step)?;
            Some(self.steps[instance.index()].action.name.clone())
        };
        Some(match news {
            PlanEvent::Started { step, time, .. } => Evidence::Started {
                action: action(step)?,
                at: time.clone(),
            },
            PlanEvent::Ended {
                step, time, ending, ..
            } => Evidence::Ended {
                action: action(step)?,
                ending: ending.clone(),
                at: time.clone(),
            },
            PlanEvent::Fact(fact) => Evidence::Fact {
                fact: belief.task().fact_name(*fact),
                truth: belief.fact(*fact),
            },
            PlanEvent::Value(fluent) => Evidence::Value {
                fluent: belief.task().fluent_name(*fluent),
                value: belief.value(*fluent).cloned(),
            },
            PlanEvent::Contradiction { .. } | PlanEvent::TimedOut { .. } => return None,
        })
    }

    /// Returns the node of an instance's start or end.
    fn node(&self, instance: InstanceId, is_end: bool) -> NodeId {
        let model = self.chooser.search().model();
        if is_end {
            model.end(instance)
        } else {
            model.start(instance)
        }
    }

    /// Returns the happenings of the last ε; interfering happenings have to wait.
    fn recent_happenings(&mut self, now: &Rational) -> Vec<(NodeId, Rational)> {
        let epsilon = self.prepared_plan.task.epsilon();
        self.recent.retain(|(_, time)| time + epsilon > *now);
        let is_recent = |(_, time): &(NodeId, Rational)| time <= now && time + epsilon > *now;
        let timed = self.timed.iter();
        let mut lately: Vec<_> = timed.filter(|timed| is_recent(timed)).cloned().collect();
        lately.extend(self.recent.iter().cloned());
        lately.sort_by(|a, b| a.1.cmp(&b.1));
        lately
    }

    /// Returns the decision at this moment.
    pub(super) fn next(
        &mut self,
        moment: &DecisionContext<'_>,
        initial: &InitialBelief,
    ) -> Decided {
        if !self.cancelled.is_empty() {
            return wait(None, Subject::EndOfCancelledActions);
        }
        if self.running.values().any(|(_, start)| start.is_none()) {
            return wait(None, Subject::StartOfCommandedActions);
        }
        let now = moment.now - &self.prepared_plan.origin;
        if now.is_negative() {
            // The plan begins ε after the last event before it.
            return wait(Some(self.prepared_plan.origin.clone()), Subject::NextStart);
        }
        let state = moment.belief.state();
        let mut circumstances = SearchState::observed(now.clone(), &state);
        initial.apply(moment.belief.task(), &mut circumstances.belief);
        let mut running: Vec<Running> = self
            .running
            .values()
            .map(|(instance, start)| Running {
                instance: *instance,
                start: start.clone().unwrap_or_default(),
            })
            .collect();
        running.sort_by(|a, b| (&a.start, a.instance).cmp(&(&b.start, b.instance)));
        circumstances.running = running;
        circumstances.recent = self.recent_happenings(&now);
        let length = self.chooser.search().model().plan().nodes.len();
        let mut most = |progress: &Progress| {
            if progress.sequences * length > MAX_HAPPENINGS {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let mut choice = self.chooser.choose(&circumstances, &mut most);
        // After an action ends earlier than the order expected, possibly only layers before its
        // start fit. The action is not repeated for that.
        if let Ok(Choice::Next(next)) = &choice
            && self.is_ahead
            && let Some(instance) = self.actions_to_start(next).first()
            && let Some((latest, _)) = self.successes.get(instance)
            && self.chooser.drop_order(next, *latest == now)
        {
            choice = self.chooser.choose(&circumstances, &mut most);
            self.is_ahead = false;
        }
        if let Ok(Choice::Next(next)) = &choice {
            self.is_ahead &= !next.is_new_order;
            self.chosen = Some(next.node);
        }
        let running: Vec<InstanceId> = self.running.values().map(|(id, _)| *id).collect();
        if let Ok(Choice::Next(next)) = &choice
            && let Some(instance) = self.actions_to_start(next).first().copied()
        {
            let count = self.repetitions.count(&state, &running, instance);
            self.is_table_cycling = count > MAX_RECONSIDERED_SUCCESSES && self.chooser.is_table();
            if count > MAX_SUCCESSES_PER_STATE || self.is_table_cycling {
                return replan(self.cycle_reason(instance, count, moment.now));
            }
            if count > MAX_RECONSIDERED_SUCCESSES && self.chooser.keep_order() {
                choice = self.chooser.choose(&circumstances, &mut most);
            }
        }
        // An order that relies on other numbers is dropped.
        if let Ok(Choice::Next(next)) = &choice
            && self.is_permanently_unmet(next, moment, &now)
            && self.chooser.drop_order(next, false)
        {
            choice = self.chooser.choose(&circumstances, &mut most);
        }
        match choice {
            Err(coupled) => replan(
                Reason::new(Cause::NoOrder).about(Subject::ExternalMessage(coupled.to_string())),
            ),
            Ok(Choice::GoalReached) => Decided {
                decision: Decision::GoalReached,
                reason: Reason::new(Cause::GoalReached),
            },
            Ok(Choice::Next(next)) => {
                self.decide_next_happening(&next, moment, &now, (&state, &running))
            }
            Ok(Choice::Replan) if self.awaits_ends(&now) => {
                // Running actions are awaited before the plan is abandoned: a robot whose move is
                // cancelled is at neither place, and an end may make another order possible.
                let until = self.first_overdue().map(|time| self.to_world_time(&time));
                wait(until, Subject::EndOfRunningActions)
            }
            Ok(Choice::Abandon(instance)) => self.cancel_action(instance, &now),
            Ok(Choice::Replan) => {
                let mut reason = Reason::new(Cause::NoOrder).since(moment.now.clone());
                reason.evidence = self.latest.iter().cloned().collect();
                replan(reason)
            }
        }
    }

    /// Returns the reason to abandon a plan because an action succeeds repeatedly after a start in
    /// the same state.
    fn cycle_reason(&self, instance: InstanceId, count: u32, now: &Rational) -> Reason {
        let name = &self.steps[instance.index()].action.name;
        let about =
            format!("{name} has succeeded {count} times in the same state without progress");
        let reason = Reason::new(Cause::NoOrder).about(Subject::ExternalMessage(about));
        reason.since(now.clone())
    }

    /// Returns the actions that start if this happening is next: several if they need each other.
    /// Empty for an end or a timed initial.
    fn actions_to_start(&self, next: &NextHappening) -> Vec<InstanceId> {
        let nodes = &self.chooser.search().model().plan().nodes;
        let starting = std::iter::once(&next.node).chain(&next.together);
        let starting = starting.map_while(|node| match nodes[node.index()] {
            Node::Start(instance) | Node::Instant(instance) => Some(instance),
            Node::Zero | Node::End(_) | Node::Timed(_) => None,
        });
        starting.collect()
    }

    /// Cancels an action whose end is not worth waiting for. The number of cancellations is
    /// limited, because they take no time.
    fn cancel_action(&mut self, instance: InstanceId, now: &Rational) -> Decided {
        let times = self.cancellations.entry(instance).or_default();
        if *times >= MAX_CANCELLATIONS {
            let overdue = self.first_overdue().filter(|time| time > now);
            let until = overdue.map(|time| self.to_world_time(&time));
            return wait(until, Subject::EndOfRunningActions);
        }
        *times += 1;
        let is_it = |(step, (under_way, _)): (&StepId, &(InstanceId, Option<Rational>))| {
            (*under_way == instance).then_some(*step)
        };
        let steps: Vec<StepId> = self.running.iter().filter_map(is_it).collect();
        self.cancelled.extend(&steps);
        let name = &self.steps[instance.index()].action.name;
        Decided {
            decision: Decision::Cancel(steps),
            reason: Reason::new(Cause::Likelier)
                .for_action(name)
                .about(Subject::WithoutEndOf(name.clone())),
        }
    }

    /// Returns `true` if an action is running and none is overdue.
    fn awaits_ends(&self, now: &Rational) -> bool {
        let is_overdue = self.first_overdue().is_some_and(|time| time <= *now);
        !self.running.is_empty() && !is_overdue
    }

    /// Returns the time at which the first running action becomes overdue.
    fn first_overdue(&self) -> Option<Rational> {
        let plan = self.chooser.search().model().plan();
        let ends = self.running.values().filter_map(|(instance, start)| {
            let latest = plan.duration(*instance).1?;
            Some(start.as_ref()? + latest + self.prepared_plan.task.epsilon())
        });
        ends.min()
    }

    /// Converts a time of the plan to the world's clock.
    fn to_world_time(&self, time: &Rational) -> Rational {
        time + &self.prepared_plan.origin
    }

    fn decide_next_happening(
        &mut self,
        next: &NextHappening,
        moment: &DecisionContext<'_>,
        now: &Rational,
        before: (&State, &[InstanceId]),
    ) -> Decided {
        let origin = self.prepared_plan.origin.clone();
        let world = |time: &Rational| time + &origin;
        let starting = self.actions_to_start(next);
        let Some(first) = starting.first() else {
            // The next happening is an end or a timed initial, so the executor waits for it. If it
            // is too late for the order, another order is searched for.
            let late = next
                .slot
                .latest
                .as_ref()
                .map(|latest| latest + self.prepared_plan.task.epsilon());
            // Starts that need it at the same moment happen then.
            let moment = (!next.together.is_empty()).then(|| next.slot.earliest.clone());
            let until = late.into_iter().chain(moment).filter(|time| time > now);
            let until = until.min();
            return wait(until.map(|until| world(&until)), Subject::NextHappening);
        };
        if next.slot.earliest > *now {
            return wait(Some(world(&next.slot.earliest)), Subject::NextStart);
        }
        let continued = starting.iter().find(|it| self.continued.contains(it));
        if let Some(continued) = continued {
            let name = &self.steps[continued.index()].action.name;
            let reason = Reason::new(Cause::Failed).for_action(name);
            return replan(reason.since(world(now)));
        }
        let separated = starting.iter().filter_map(|instance| {
            let Step {
                action, duration, ..
            } = &self.steps[instance.index()];
            let of = (&*self.prepared_plan.task, &**action);
            self.separation.separated(of, duration.as_ref(), now)
        });
        if let Some(separated) = separated.max() {
            return wait(Some(world(&separated)), Subject::NextStart);
        }
        if let Some(lack) = self.unmet_start(next, moment, now) {
            return self.await_numbers(&lack, next, moment, now);
        }
        let planned = Planned {
            earliest: Some(world(&next.slot.earliest)),
            latest: next.slot.latest.as_ref().map(world),
        };
        let about = self.chooser.subject(next);
        let name = &self.steps[first.index()].action.name;
        let reason = Reason::new(Cause::Due).for_action(name).about(about);
        let orders = starting.into_iter();
        let orders = orders.map(|instance| self.start(instance, planned.clone(), now, before));
        Decided {
            decision: Decision::Start(orders.collect()),
            reason,
        }
    }

    /// Returns the order to start an action now.
    fn start(
        &mut self,
        instance: InstanceId,
        planned: Planned,
        now: &Rational,
        (state, running): (&State, &[InstanceId]),
    ) -> Order {
        let Step {
            action, duration, ..
        } = &self.steps[instance.index()];
        let step = StepId(self.next_step);
        self.next_step = self.next_step.saturating_add(1);
        let of = (&*self.prepared_plan.task, &**action);
        self.separation.start(step.0, of, duration.as_ref(), now);
        self.running.insert(step, (instance, None));
        self.repetitions.start(step, state, running, instance);
        Order {
            step,
            action: Arc::clone(action),
            duration: duration.clone(),
            planned,
        }
    }
}

/// Returns the reason to abandon the plan if an action has failed too often in a row. An action is
/// retried as long as its likelihoods explain the failures.
fn check_failures(
    step: &Step,
    failures: i32,
    ending: &Ending,
    likelihoods: &Likelihoods,
) -> Option<Reason> {
    let action = &step.action;
    let seconds = step.duration.as_ref().map_or(0.0, Rational::to_f64);
    let success =
        likelihoods.start(action).unwrap_or(1.0) * likelihoods.success_probability(action, seconds);
    if (1.0 - success).powi(failures) >= MIN_FAILURE_PROBABILITY && failures < MAX_FAILURES {
        return None;
    }
    let about = Subject::RepeatedFailure {
        why: match ending {
            Ending::Failed { why } => Some(why.clone()),
            Ending::Succeeded | Ending::Cancelled => None,
        },
        failures,
        success,
    };
    Some(
        Reason::new(Cause::Failed)
            .for_action(&action.name)
            .about(about),
    )
}

/// Returns `true` if a condition of the action is known not to hold, which explains its failure.
fn has_unmet_condition(step: &Step, has_started: bool, belief: &BeliefState) -> bool {
    let needs = match &step.action.body {
        Body::Instantaneous(snap) => vec![&snap.condition],
        Body::Durative(body) if has_started => vec![&body.over_all, &body.end.condition],
        Body::Durative(body) => vec![&body.start.condition],
    };
    let duration = step.duration.as_ref();
    let mut held = needs
        .into_iter()
        .map(|needed| belief.holds(needed, duration));
    held.any(|holds| holds == Ok(false))
}

fn wait(until: Option<Rational>, why: Subject) -> Decided {
    Decided {
        decision: Decision::Wait { until },
        reason: Reason::new(Cause::NothingDue).about(why),
    }
}
