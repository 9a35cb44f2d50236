//! One event in a plan with 10,000 time points: taking note of it, moving the windows, deciding.
//!
//! 5,000 actions on 20 robots, one after the other on each; every tenth waits for one of another
//! robot; every hundredth has a deadline. Every action ends later than planned, so that all windows
//! behind it move.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use divan::Bencher;
use divan::counter::ItemsCount;
use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::{
    Decision, Ending, Executor, Mission, Moment, News, Progression, Region, StepId,
};
use elbowroom_model::ground::{Action, Body, Condition, DurativeBody, SnapAction};
use elbowroom_model::problem::SchemaId;
use elbowroom_model::{Problem, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_plan::{
    Bound, Constraint, DecoupledEnvelope, Instance, InstanceId, NodeId, Parameter, ParameterId,
    ParameterKind, ParametrizedPlan, Reason, StnPlan,
};

fn main() {
    divan::main();
}

/// How many actions end in one sample.
const EVENTS: usize = 200;

#[divan::bench(args = [1_000, 10_000, 100_000])]
fn stn(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "stn", nodes);
}

#[divan::bench(args = [1_000, 10_000, 100_000])]
fn guarded(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "guarded", nodes);
}

/// All durations are left open.
#[divan::bench(args = [1_000, 10_000, 100_000])]
fn live(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "live", nodes);
}

#[divan::bench(args = [1_000, 10_000, 100_000])]
fn fixed(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "fixed:60", nodes);
}

/// Nothing but orderings.
#[divan::bench(args = [1_000, 10_000, 100_000])]
fn esterel(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "esterel", nodes);
}

fn events(bencher: Bencher<'_, '_>, executor: &str, nodes: usize) {
    let mission = mission(nodes / 2, executor == "live");
    let spec: ExecutorSpec = executor.parse().expect("a known executor");
    let belief = Progression::new(Arc::clone(&mission.task));
    bencher
        .counter(ItemsCount::new(EVENTS))
        .with_inputs(|| {
            let mut executor = spec.build(Box::new(Everywhere));
            executor.adopt(&mission).expect("a consistent plan");
            executor
        })
        .bench_local_values(|executor| execute(executor, &belief));
}

/// Ends one action after the other, each half a second late.
fn execute(mut executor: Box<dyn Executor>, belief: &Progression) -> Rational {
    let mut running: BTreeSet<(Rational, StepId)> = BTreeSet::new();
    let mut now = Rational::ZERO;
    let mut news = Vec::new();
    let mut ended = 0;
    loop {
        let moment = Moment {
            now: &now,
            news: &std::mem::take(&mut news),
            belief,
        };
        match executor.decide(&moment).decision {
            Decision::Start(orders) => {
                for order in orders {
                    let duration = order.duration.expect("all take time");
                    let end = &now + duration + Rational::new(1, 2);
                    running.insert((end, order.step));
                    news.push(News::Started {
                        step: order.step,
                        time: now.clone(),
                        measured: Vec::new(),
                    });
                }
            }
            Decision::Wait { until } => {
                let next = running.first().map(|(time, _)| time.clone());
                let until = until.filter(|until| next.as_ref().is_none_or(|next| until < next));
                if let Some(until) = until {
                    now = until;
                    continue;
                }
                let Some((time, step)) = running.pop_first() else {
                    return now;
                };
                now.clone_from(&time);
                news.push(News::Ended {
                    step,
                    time,
                    ending: Ending::Succeeded,
                    measured: Vec::new(),
                });
                ended += 1;
                if ended > EVENTS {
                    return now;
                }
            }
            other => panic!("the plan has room: {other:?}"),
        }
    }
}

struct Everywhere;

impl Region for Everywhere {
    fn objection(&mut self, _: &Arc<Task>, _: &ParametrizedPlan, _: &[Rational]) -> Option<String> {
        None
    }
}

fn mission(count: usize, is_open: bool) -> Mission {
    const ROBOTS: usize = 20;
    let task = Arc::new(Task::new(Problem::default()));
    let instances = (0..count).map(|index| Instance {
        label: format!("n{index}"),
        action: nothing(index),
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
    let mut nominal = vec![Rational::ZERO; 1 + 2 * count];
    for index in 0..count {
        let duration = Rational::from(i64::try_from(5 + index % 7).expect("small"));
        let mut begin = Rational::ZERO;
        let after = |earlier: usize, begin: &mut Rational| {
            let time = &nominal[end(earlier).index()] + &epsilon;
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
        nominal[start(index).index()] = begin;
        nominal[end(index).index()] = finish;
    }
    let mut plan = ParametrizedPlan::closed(&task, plan);
    if is_open {
        leave_durations_open(&mut plan);
    }
    Mission {
        origin: Rational::ZERO,
        now: Rational::ZERO,
        time_triggered: TimeTriggeredPlan::default(),
        plan,
        nominal,
        envelope: Some(DecoupledEnvelope {
            intervals: Vec::new(),
        }),
        running: BTreeMap::new(),
        epsilon,
        task,
    }
}

/// Makes a parameter of each duration, its shortest one being nominal.
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

fn nothing(index: usize) -> Action {
    let snap = || SnapAction {
        condition: Condition::TRUE,
        effects: Vec::new(),
    };
    Action {
        schema: SchemaId(0),
        arguments: Vec::new(),
        name: format!("(work {index})"),
        body: Body::Durative(DurativeBody {
            duration: Vec::new(),
            start: snap(),
            over_all: Condition::TRUE,
            end: snap(),
            continuous: Vec::new(),
        }),
    }
}
