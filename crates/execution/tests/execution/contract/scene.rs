//! A problem with a prepared plan, and a world for it, without any crate above this one.

use std::sync::Arc;

use elbowroom_execution::executors::{
    ExecutorServices, ExecutorSpec, OrderCache, PolicyTableCache,
};
use elbowroom_execution::run::{Ports, Run, RunSettings};
use elbowroom_execution::{
    ActionHandle, Command, DispatchableCache, Ending, Event, NoPlanner, Observation, PlanForm,
    PortWorkers, PreparationResult, PrepareError, Preparer, Recorder, RegionOracle, TimeAdvance,
    World, WorldError,
};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_plan::deorder::deorder;
use elbowroom_plan::parametrize::parametrize;
use elbowroom_plan::partial_order::partial_order;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Valuation};
use elbowroom_probability::Likelihoods;

const DOMAIN: &str = "(define (domain kitchen) (:requirements :durative-actions)
    (:predicates (boiled) (chopped) (cooked))
    (:durative-action boil :parameters () :duration (= ?duration 10)
      :effect (at end (boiled)))
    (:durative-action chop :parameters () :duration (= ?duration 4)
      :effect (at end (chopped)))
    (:durative-action cook :parameters () :duration (= ?duration 8)
      :condition (and (at start (boiled)) (at start (chopped)))
      :effect (at end (cooked))))";

const PROBLEM: &str =
    "(define (problem soup) (:domain kitchen) (:init) (:goal (and (cooked) (boiled))))";

const PLAN: &str = "0: (boil) [10]\n0: (chop) [4]\n10.001: (cook) [8]";

/// The problem, with its plan.
pub(crate) struct Scene {
    task: Arc<Task>,
    plan: TimeTriggeredPlan,
    /// Orders shared between executors, if any.
    pub(crate) orders: Option<OrderCache>,
}

impl Scene {
    pub(crate) fn new() -> Self {
        let source = |text: &str| Source::new("test", text);
        let (problem, _) = read_problem(&source(DOMAIN), &source(PROBLEM)).expect("a correct test");
        let task = Task::new(problem);
        let (plan, _) = read_plan(&source(PLAN), &task).expect("a correct test");
        Self {
            task: Arc::new(task),
            plan,
            orders: None,
        }
    }

    /// Creates a run of the plan, with its workers. The run is over when the plan fails.
    pub(crate) fn run(
        &self,
        executor: &str,
        recorder: impl Recorder + 'static,
        settings: RunSettings,
    ) -> (Run<'static>, PortWorkers<'static>) {
        let spec: ExecutorSpec = executor.parse().expect("a registered executor");
        let ports = Ports {
            executor: spec.build(ExecutorServices {
                action_values: None,
                rollout: None,
                region: Box::new(UnlimitedRegion),
                likelihoods: Arc::new(Likelihoods::certain()),
                comparator: None,
                policy_cache: PolicyTableCache::default(),
                order_cache: self.orders.clone(),
                has_planner: settings.max_replans > 0,
            }),
            recorder: Box::new(recorder),
        };
        let plan = Some(self.plan.clone());
        let run = Run::new(Arc::clone(&self.task), plan, settings, ports);
        (run, PortWorkers::new(NoPlanner, ManualPreparer))
    }
}

/// Prepares plans without a solver: each duration may be up to twice as long as planned. For this
/// plan, which has no deadlines, that is correct.
struct ManualPreparer;

impl Preparer for ManualPreparer {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        let deordered = deorder(task, plan)?;
        let (instances, nominal) = (deordered.instances, deordered.nominal);
        let is_open = matches!(need, PlanForm::OpenNetwork | PlanForm::Envelope);
        let order = (need == PlanForm::PartialOrder).then(|| partial_order(task, plan));
        let prepared = if is_open {
            parametrize(task, deordered.plan, &nominal, &[])?
        } else {
            ParametrizedPlan::closed(task, deordered.plan)
        };
        let twice = prepared.parameters.iter().map(|parameter| {
            let longest = &parameter.nominal * Rational::from(2);
            Interval::closed(parameter.nominal.clone(), longest)
        });
        let twice = twice.collect();
        let envelope = is_open.then(|| DecoupledEnvelope::new(&prepared, twice));
        Ok(PreparationResult {
            time_triggered: plan.clone(),
            plan: prepared,
            instances,
            nominal,
            envelope: envelope.flatten(),
            forms: DispatchableCache::default(),
            order,
        })
    }
}

/// Region without objections, for plans without numbers.
struct UnlimitedRegion;

impl RegionOracle for UnlimitedRegion {
    fn is_feasible(&mut self, _: &Arc<Task>, _: &ParametrizedPlan, _: &Valuation) -> bool {
        true
    }
}

/// Deviations of a world.
#[derive(Clone, Copy)]
pub(crate) enum WorldFaults {
    /// No deviations.
    None,
    /// Actions take longer or fail, and reports are lost, repeated, wrong, or from the future.
    Seeded(u64),
}

/// World in which actions take the commanded durations, apart from its deviations.
pub(crate) struct ToyWorld {
    now: Rational,
    coming: Vec<Observation>,
    whims: WorldFaults,
    state: u64,
}

impl ToyWorld {
    pub(crate) fn new(whims: WorldFaults) -> Self {
        let state = match whims {
            WorldFaults::None => 0,
            WorldFaults::Seeded(seed) => seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1,
        };
        Self {
            now: Rational::ZERO,
            coming: Vec::new(),
            whims,
            state,
        }
    }

    /// Returns `true` once in `times` calls on average; xorshift.
    fn with_chance_one_in(&mut self, times: u64) -> bool {
        if matches!(self.whims, WorldFaults::None) {
            return false;
        }
        self.state ^= self.state << 13;
        self.state ^= self.state >> 7;
        self.state ^= self.state << 17;
        self.state.is_multiple_of(times)
    }

    fn report(&mut self, time: Rational, event: Event) {
        if self.with_chance_one_in(12) {
            return;
        }
        let observation = Observation { time, event };
        if self.with_chance_one_in(8) {
            self.coming.push(observation.clone());
        }
        self.coming.push(observation);
    }
}

impl World for ToyWorld {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        let measured = Vec::new;
        match *command {
            Command::Start {
                ticket,
                ref duration,
                ..
            } => {
                let event = Event::Started {
                    ticket,
                    measured: measured(),
                };
                self.report(now.clone(), event);
                let mut end = now + duration.clone().unwrap_or_default();
                if self.with_chance_one_in(4) {
                    end += &Rational::from(3);
                }
                let ending = if self.with_chance_one_in(10) {
                    let why = "it slipped".to_owned();
                    Ending::Failed { why }
                } else {
                    Ending::Succeeded
                };
                let event = Event::Ended {
                    ticket,
                    ending,
                    measured: measured(),
                };
                self.report(end, event);
            }
            Command::Cancel { ticket } => {
                let is_other = |it: &Observation| ended_by(it) != Some(ticket);
                self.coming.retain(is_other);
                let event = Event::Ended {
                    ticket,
                    ending: Ending::Cancelled,
                    measured: measured(),
                };
                self.report(now.clone(), event);
            }
        }
        if self.with_chance_one_in(20) {
            let (said, why) = ("mumble".to_owned(), "no words".to_owned());
            self.report(now.clone(), Event::Unintelligible { said, why });
        }
        if self.with_chance_one_in(20) {
            let ticket = ActionHandle(1_000_000);
            let measured = measured();
            self.report(now + Rational::from(9), Event::Started { ticket, measured });
        }
        Ok(())
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let times = self.coming.iter().map(|it| it.time.clone());
        let next = times.chain([until.clone()]).min().unwrap_or_default();
        self.now = next.max(self.now.clone());
        let now = self.now.clone();
        let observations = self.coming.extract_if(.., |it| it.time <= now);
        Ok(TimeAdvance {
            observations: observations.collect(),
            now: self.now.clone(),
        })
    }
}

/// Returns the start whose end the observation reports.
fn ended_by(observation: &Observation) -> Option<ActionHandle> {
    match observation.event {
        Event::Ended { ticket, .. } => Some(ticket),
        _ => None,
    }
}

/// Returns the starts whose ends are reported.
pub(crate) fn ended(passage: &TimeAdvance) -> Vec<ActionHandle> {
    passage.observations.iter().filter_map(ended_by).collect()
}
