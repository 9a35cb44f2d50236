//! `adaptable`: Olisipo, on a clock.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::ground::Expression;
use elbowroom_model::{Step, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_plan::deorder;
use elbowroom_plan::partial_order::partial_order;
use elbowroom_plan::{InstanceId, Node, NodeId};
use elbowroom_probability::search::Progress;
use elbowroom_probability::{
    Choice, Circumstances, LayerDispatch, Likelihoods, Model, NextHappening, OrderSearch,
    Reconsider, Running, SearchSettings, Semantics,
};

use super::Registered;
use crate::dispatch::replan;
use crate::event::Ending;
use crate::executor::{Decided, Decision, Executor, Mission, Moment, News, Order, Planned, StepId};
use crate::preparation::Need;
use crate::reason::{Cause, Reason};

pub(super) const REGISTERED: Registered = Registered {
    name: "adaptable",
    argument: None,
    is_optional: false,
    summary: "Does next what the order of the plan's happenings that is most likely to succeed \
              has next, as things stand: it skips, repeats and re-orders actions where that is \
              likelier and there is time for it, and replans when no order can work.",
    paper: "Olisipo in Ribeiro et al. (2021), sections 2.2.1 and 2.2.2",
    need: Need::Orderings,
    make: |_, means| {
        Box::new(Adaptable {
            likelihoods: means.likelihoods,
            state: None,
        })
    },
};

/// A search looks at so many happenings at most, sequences times the plan's length; then the best
/// order so far is taken. Plans of some twenty happenings are searched to the end.
const MOST_HAPPENINGS: usize = 200_000;

/// An action is given up when it has failed so often in a row that this is how likely that was.
const TOO_UNLIKELY: f64 = 1e-6;

/// See [`REGISTERED`].
struct Adaptable {
    likelihoods: Arc<Likelihoods>,
    state: Option<Rest>,
}

/// A plan, and how it stands.
struct Rest {
    mission: Mission,
    /// The plan's steps in the order of the model's instances.
    steps: Vec<Step>,
    dispatch: LayerDispatch,
    /// What was told to start and has not ended, and when it has started, on the plan's clock.
    under_way: BTreeMap<StepId, (InstanceId, Option<Rational>)>,
    /// Starts and ends that have been observed lately, on the plan's clock.
    recent: Vec<(NodeId, Rational)>,
    /// How often each instance has failed in a row.
    failures: BTreeMap<InstanceId, i32>,
    /// The number of the next order.
    next_step: u32,
}

impl Executor for Adaptable {
    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        let settings = deorder::Settings {
            epsilon: mission.epsilon.clone(),
        };
        // Numbers that depend on how long something takes are followed as if all went as planned.
        let as_timed = TimeTriggeredPlan {
            steps: mission.time_triggered.steps.iter().map(timed).collect(),
        };
        let plan = partial_order(&mission.task, &as_timed, &settings);
        let task = Arc::clone(&mission.task);
        let model = Model::new(task, plan, &self.likelihoods, Semantics::Paper)
            .map_err(|missing| Box::new(Reason::new(Cause::NoOrder).about(missing.to_string())))?;
        // Instances are numbered by their start; what is running comes first in both.
        let mut steps = mission.time_triggered.steps.clone();
        steps.sort_by(|a, b| a.start.cmp(&b.start));
        let as_planned = as_planned(&model, &steps);
        let search = OrderSearch::new(
            model,
            SearchSettings {
                epsilon: mission.epsilon.clone(),
                ..SearchSettings::default()
            },
        )
        .beginning_with(as_planned);
        let running = mission.running.keys();
        let under_way = running.map(|&step| (step, (InstanceId(step.0), Some(Rational::ZERO))));
        self.state = Some(Rest {
            under_way: under_way.collect(),
            next_step: u32::try_from(steps.len()).unwrap_or(u32::MAX),
            steps,
            dispatch: LayerDispatch::new(search, Reconsider::WhenNoLayerFits),
            mission: mission.clone(),
            recent: Vec::new(),
            failures: BTreeMap::new(),
        });
        Ok(())
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let Some(rest) = &mut self.state else {
            return super::without_plan();
        };
        for news in moment.news {
            if let Some(reason) = rest.learn(news, &self.likelihoods) {
                return replan(reason);
            }
        }
        rest.next(moment)
    }

    /// What is under way ends by its duration; when the rest happens is decided then.
    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        let rest = self.state.as_ref()?;
        let (instance, start) = rest.under_way.get(&step)?;
        let start = start.as_ref().filter(|_| is_end)?;
        let (least, greatest) = rest.dispatch.search().model().plan().duration(*instance);
        let time = |duration: Rational| start + duration + &rest.mission.origin;
        Some(Planned {
            earliest: Some(time(least)),
            latest: greatest.map(time),
        })
    }
}

impl Rest {
    /// Takes note of what is new; why the plan has to be given up, if it has to.
    fn learn(&mut self, news: &News, likelihoods: &Likelihoods) -> Option<Reason> {
        match news {
            News::Started { step, time, .. } => {
                let local = time - &self.mission.origin;
                let (instance, start) = self.under_way.get_mut(step)?;
                let instance = *instance;
                *start = Some(local.clone());
                self.recent.push((self.node(instance, false), local));
                if self.steps[instance.index()].duration.is_none() {
                    self.under_way.remove(step);
                    self.failures.remove(&instance);
                }
                None
            }
            News::Ended {
                step, ending, time, ..
            } => {
                let (instance, _) = self.under_way.remove(step)?;
                let local = time - &self.mission.origin;
                self.recent.push((self.node(instance, true), local));
                if *ending == Ending::Succeeded {
                    self.failures.remove(&instance);
                    return None;
                }
                self.failed(instance, ending, likelihoods)
            }
            // The belief knows it already, and layers are held against the belief.
            News::Fact(_) | News::Value(_) => None,
            News::Contradiction { action } => Some(Reason::new(Cause::Contradiction).of(action)),
            News::Silence { action, since } => {
                Some(Reason::new(Cause::Silence).of(action).since(since.clone()))
            }
        }
    }

    /// An action is tried again as long as its likelihoods explain that it fails.
    fn failed(
        &mut self,
        instance: InstanceId,
        ending: &Ending,
        likelihoods: &Likelihoods,
    ) -> Option<Reason> {
        let action = &self.steps[instance.index()].action;
        let failures = self.failures.entry(instance).or_default();
        *failures += 1;
        let success = likelihoods.start(action).unwrap_or(1.0);
        if (1.0 - success).powi(*failures) >= TOO_UNLIKELY {
            return None;
        }
        let why = match ending {
            Ending::Failed { why } => why.as_str(),
            Ending::Succeeded | Ending::Cancelled => "it was cancelled",
        };
        let about = format!("{why}; {failures} in a row, and it starts with probability {success}");
        Some(Reason::new(Cause::Failed).of(&action.name).about(about))
    }

    /// An instance's start or end.
    fn node(&self, instance: InstanceId, is_end: bool) -> NodeId {
        let model = self.dispatch.search().model();
        if is_end {
            model.end(instance)
        } else {
            model.start(instance)
        }
    }

    /// What has happened so lately that what interferes with it has to wait.
    fn lately(&mut self, now: &Rational) -> Vec<(NodeId, Rational)> {
        let epsilon = &self.mission.epsilon;
        self.recent.retain(|(_, time)| time + epsilon > *now);
        let model = self.dispatch.search().model();
        let nodes = model.plan().nodes.iter().enumerate();
        let timed = nodes.filter_map(|(at, node)| match node {
            Node::Timed(index) => {
                Some((NodeId::from(at), model.task().timed()[*index].time.clone()))
            }
            _ => None,
        });
        let is_recent = |(_, time): &(NodeId, Rational)| time <= now && time + epsilon > *now;
        let mut lately: Vec<_> = timed.filter(is_recent).collect();
        lately.extend(self.recent.iter().cloned());
        lately.sort_by(|a, b| a.1.cmp(&b.1));
        lately
    }

    /// What to do now.
    fn next(&mut self, moment: &Moment<'_>) -> Decided {
        if self.under_way.values().any(|(_, start)| start.is_none()) {
            return wait(None, "what was told to start has started");
        }
        let now = moment.now - &self.mission.origin;
        let mut circumstances = Circumstances::observed(now.clone(), &moment.belief.state());
        let mut running: Vec<Running> = self
            .under_way
            .values()
            .map(|(instance, start)| Running {
                instance: *instance,
                start: start.clone().unwrap_or_default(),
            })
            .collect();
        running.sort_by(|a, b| (&a.start, a.instance).cmp(&(&b.start, b.instance)));
        circumstances.running = running;
        circumstances.recent = self.lately(&now);
        let length = self.dispatch.search().model().plan().nodes.len();
        let mut most = |progress: &Progress| {
            if progress.sequences * length > MOST_HAPPENINGS {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        match self.dispatch.choose(&circumstances, &mut most) {
            Err(coupled) => replan(Reason::new(Cause::NoOrder).about(coupled.to_string())),
            Ok(Choice::GoalReached) => Decided {
                decision: Decision::GoalReached,
                reason: Reason::new(Cause::GoalReached),
            },
            Ok(Choice::Next(next)) => self.carry_on(&next, &now),
            Ok(Choice::Replan) if self.awaits_ends(&now) => {
                // What is under way is ended before a plan is given up: a robot that is let go
                // between two places is at neither. And it may change what can be done.
                let until = self.first_overdue().map(|time| self.world(&time));
                wait(until, "what is under way has ended")
            }
            Ok(Choice::Replan | Choice::Abandon(_)) => {
                replan(Reason::new(Cause::NoOrder).since(moment.now.clone()))
            }
        }
    }

    /// Whether something is under way, and nothing overdue.
    fn awaits_ends(&self, now: &Rational) -> bool {
        let is_overdue = self.first_overdue().is_some_and(|time| time <= *now);
        !self.under_way.is_empty() && !is_overdue
    }

    /// When the first of the actions under way is later than it can be.
    fn first_overdue(&self) -> Option<Rational> {
        let plan = self.dispatch.search().model().plan();
        let ends = self.under_way.values().filter_map(|(instance, start)| {
            let latest = plan.duration(*instance).1?;
            Some(start.as_ref()? + latest + &self.mission.epsilon)
        });
        ends.min()
    }

    /// A time of the plan by the world's clock.
    fn world(&self, time: &Rational) -> Rational {
        time + &self.mission.origin
    }

    fn carry_on(&mut self, next: &NextHappening, now: &Rational) -> Decided {
        let probability = self.dispatch.order().map_or(0.0, |order| order.probability);
        let origin = &self.mission.origin;
        let world = |time: &Rational| time + origin;
        let node = self.dispatch.search().model().plan().nodes[next.node.index()];
        let (Node::Start(instance) | Node::Instant(instance)) = node else {
            // An end, or timed initials: it comes when it comes. When it is too late for the order,
            // another one is looked for.
            let late = next
                .slot
                .latest
                .as_ref()
                .map(|latest| latest + &self.mission.epsilon);
            let until = late.filter(|late| late > now);
            return wait(
                until.map(|until| world(&until)),
                "what is next in the order has happened",
            );
        };
        if next.slot.earliest > *now {
            return wait(Some(world(&next.slot.earliest)), "the order's next start");
        }
        let step = StepId(self.next_step);
        self.next_step = self.next_step.saturating_add(1);
        let planned = &self.steps[instance.index()];
        let order = Order {
            step,
            action: Arc::new(planned.action.clone()),
            duration: planned.duration.clone(),
            planned: Planned {
                earliest: Some(world(&next.slot.earliest)),
                latest: next.slot.latest.as_ref().map(world),
            },
        };
        let name = &planned.action.name;
        let about = if next.is_new_order {
            format!("first of the order most likely to succeed (P = {probability:.4} from here)")
        } else {
            "next after the lattermost layer that fits".to_owned()
        };
        let reason = Reason::new(Cause::Due).of(name).about(about);
        self.under_way.insert(step, (instance, None));
        Decided {
            decision: Decision::Start(vec![order]),
            reason,
        }
    }
}

/// The step with its planned duration in place of `?duration`.
fn timed(step: &Step) -> Step {
    let duration = step.duration.clone();
    let mut planned = |leaf: &Expression| match leaf {
        Expression::Duration => duration.clone().map(Expression::Constant),
        _ => None,
    };
    Step {
        action: step.action.map_leaves(&mut planned),
        ..step.clone()
    }
}

/// The plan's happenings as they are timed; ends before what begins at the same time.
fn as_planned(model: &Model, steps: &[Step]) -> Vec<NodeId> {
    let timed = model.task().timed();
    let nodes = model.plan().nodes.iter().enumerate();
    let mut happenings: Vec<_> = nodes
        .filter_map(|(index, node)| {
            let (time, rank) = match *node {
                Node::Zero => return None,
                Node::End(id) => (steps[id.index()].end(), 0),
                Node::Timed(index) => (timed[index].time.clone(), 1),
                Node::Start(id) | Node::Instant(id) => (steps[id.index()].start.clone(), 2),
            };
            Some((time, rank, NodeId::from(index)))
        })
        .collect();
    happenings.sort();
    happenings.into_iter().map(|(.., node)| node).collect()
}

fn wait(until: Option<Rational>, why: &str) -> Decided {
    Decided {
        decision: Decision::Wait { until },
        reason: Reason::new(Cause::NothingDue).about(why),
    }
}
