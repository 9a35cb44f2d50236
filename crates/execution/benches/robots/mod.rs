//! A plan of 20 robots, each with a sequence of actions. Every tenth action waits for one of
//! another robot, and every hundredth has a deadline. Every action ends half a second later than
//! planned, so all later windows move.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::{
    BeliefState, Decision, DecisionContext, DispatchableCache, Ending, Executor, PlanEvent,
    PreparedPlan, RegionOracle, StepId,
};
use elbowroom_model::ground::{Action, Body, Condition, DurativeBody, SnapAction};
use elbowroom_model::problem::SchemaId;
use elbowroom_model::{Problem, Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{
    Bound, Constraint, DecoupledEnvelope, Instance, InstanceId, NodeId, Parameter, ParameterId,
    ParameterKind, ParametrizedPlan, Reason, Schedule, StnPlan, Valuation,
};

/// Creates an executor that has adopted the plan of `mission`.
pub(crate) fn ready(spec: &str, mission: &PreparedPlan) -> Box<dyn Executor> {
    let spec: ExecutorSpec = spec.parse().expect("a known executor");
    let mut executor = spec.build(Box::new(UnlimitedRegion));
    executor.adopt(mission).expect("a consistent plan");
    executor
}

/// World in which the actions end one after the other.
pub(crate) struct Events {
    running: BTreeSet<(Rational, StepId)>,
    now: Rational,
    news: Vec<PlanEvent>,
    belief: BeliefState,
}

impl Events {
    pub(crate) fn new(mission: &PreparedPlan) -> Self {
        Self {
            running: BTreeSet::new(),
            now: Rational::ZERO,
            news: Vec::new(),
            belief: BeliefState::new(Arc::clone(&mission.task)),
        }
    }

    /// Passes the news to the executor, carries out its decisions, and ends the next action.
    /// Returns `false` if no action is running.
    pub(crate) fn next(&mut self, executor: &mut dyn Executor) -> bool {
        loop {
            let moment = DecisionContext {
                now: &self.now,
                plan_events: &std::mem::take(&mut self.news),
                belief: &self.belief,
            };
            match executor.decide(&moment).decision {
                Decision::Start(orders) => {
                    for order in orders {
                        let duration = order.duration.expect("all take time");
                        let end = &self.now + duration + Rational::new(1, 2);
                        self.running.insert((end, order.step));
                        self.news.push(PlanEvent::Started {
                            step: order.step,
                            time: self.now.clone(),
                            measured: Vec::new(),
                        });
                    }
                }
                Decision::Wait { until } => {
                    let next = self.running.first().map(|(time, _)| time.clone());
                    let until = until.filter(|until| next.as_ref().is_none_or(|next| until < next));
                    if let Some(until) = until {
                        self.now = until;
                        continue;
                    }
                    let Some((time, step)) = self.running.pop_first() else {
                        return false;
                    };
                    self.now.clone_from(&time);
                    self.news.push(PlanEvent::Ended {
                        step,
                        time,
                        ending: Ending::Succeeded,
                        measured: Vec::new(),
                    });
                    return true;
                }
                Decision::GoalReached => return false,
                other => panic!("the plan has room: {other:?}"),
            }
        }
    }
}

pub(crate) struct UnlimitedRegion;

impl RegionOracle for UnlimitedRegion {
    fn is_feasible(&mut self, _: &Arc<Task>, _: &ParametrizedPlan, _: &Valuation) -> bool {
        true
    }
}

/// Creates a plan with `count` actions. If `is_open`, each duration may be up to twice the planned
/// one.
pub(crate) fn mission(count: usize, is_open: bool) -> PreparedPlan {
    const ROBOTS: usize = 20;
    let task = Arc::new(Task::new(Problem::default()));
    let instances = (0..count).map(|index| Instance {
        label: format!("n{index}"),
        action: Arc::new(empty_action(index)),
    });
    let mut plan = StnPlan::unconstrained(&task, instances.collect());
    let start = |index: usize| NodeId::from(1 + 2 * index);
    let end = |index: usize| NodeId::from(2 + 2 * index);
    let mut add = |from, to, lower: Option<Rational>, upper: Option<Rational>, reason| {
        let bound = |value: Option<Rational>| value.map_or(Bound::Infinite, Bound::Finite);
        plan.constraints.push(Constraint {
            from,
            to,
            lower: bound(lower),
            upper: bound(upper),
            reason,
        });
    };
    let epsilon = Rational::new(1, 1000);
    let mut nominal = Schedule::new(vec![Rational::ZERO; 1 + 2 * count]);
    for index in 0..count {
        let duration = Rational::from(i64::try_from(5 + index % 7).expect("small"));
        let mut begin = Rational::ZERO;
        let after = |earlier: usize, begin: &mut Rational| {
            let time = &nominal[end(earlier)] + &epsilon;
            *begin = time.max(begin.clone());
        };
        if let Some(earlier) = index.checked_sub(ROBOTS) {
            add(
                end(earlier),
                start(index),
                Some(epsilon.clone()),
                None,
                Reason::Interference,
            );
            after(earlier, &mut begin);
        }
        if let Some(earlier) = index.checked_sub(ROBOTS + 7).filter(|_| index % 10 == 0) {
            add(
                end(earlier),
                start(index),
                Some(epsilon.clone()),
                None,
                Reason::Interference,
            );
            after(earlier, &mut begin);
        }
        let finish = &begin + &duration;
        if index % 100 == 99 {
            let deadline = &finish * Rational::from(3);
            add(
                NodeId::ZERO,
                end(index),
                None,
                Some(deadline),
                Reason::Given,
            );
        }
        let id = Reason::Duration(InstanceId::from(index));
        let longest = &duration * Rational::from(2);
        add(start(index), end(index), Some(duration), Some(longest), id);
        nominal[start(index)] = begin;
        nominal[end(index)] = finish;
    }
    let mut plan = ParametrizedPlan::closed(&task, plan);
    if is_open {
        leave_durations_open(&mut plan);
    }
    let twice = |parameter: &Parameter| {
        let nominal = &parameter.nominal;
        Interval::closed(nominal.clone(), nominal * Rational::from(2))
    };
    let intervals = plan.parameters.iter().map(twice).collect();
    let envelope = DecoupledEnvelope::new(&plan, intervals);
    PreparedPlan {
        origin: Rational::ZERO,
        begun: std::collections::BTreeMap::new(),
        now: Rational::ZERO,
        time_triggered: TimeTriggeredPlan::default(),
        plan,
        instances: Vec::new(),
        nominal,
        envelope,
        dispatchable_cache: DispatchableCache::default(),
        order: None,
        running: BTreeMap::new(),
        task,
    }
}

/// Turns each duration into a parameter whose nominal value is the shortest duration.
fn leave_durations_open(plan: &mut ParametrizedPlan) {
    for constraint in &mut plan.plan.constraints {
        let (Reason::Duration(instance), Bound::Finite(nominal)) =
            (constraint.reason.clone(), constraint.lower.clone())
        else {
            continue;
        };
        let kind = ParameterKind::Duration(instance);
        let parameter = Bound::Parameter(ParameterId::from(plan.parameters.len()));
        (constraint.lower, constraint.upper) = (parameter.clone(), parameter);
        plan.parameters.push(Parameter {
            name: format!("dur_{}", instance.index()),
            kind,
            range: kind.natural_range(&nominal),
            nominal,
            weight: Rational::ONE,
        });
    }
}

fn empty_action(index: usize) -> Action {
    let nothing = Arc::new(SnapAction {
        condition: Condition::TRUE,
        effects: Vec::new(),
    });
    Action {
        schema: SchemaId(0),
        arguments: Vec::new(),
        name: format!("(work {index})"),
        body: Body::Durative(DurativeBody {
            duration: Vec::new(),
            start: Arc::clone(&nothing),
            over_all: Condition::TRUE,
            end: nothing,
            continuous: Vec::new(),
            is_running: false,
        }),
    }
}
