//! Problem with a plan, and the settings of its run.

use std::sync::{Arc, LazyLock};

use elbowroom::answers::envelope::Search;
use elbowroom::execute::{
    Embedded, Execution, MostProbablePlanner, PlanPreparer, SharedMostProbablePlanner, Validated,
};
use elbowroom::execution::executors::{self, ExecutorSpec};
use elbowroom::execution::run::{PlanningTime, Report, RunSettings, Verdict};
use elbowroom::execution::{NoRecord, Planner, PreparationResult, Preparer, Recorder, World};
use elbowroom::model::validate::{self, validate};
use elbowroom::model::{Situation, Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};
use elbowroom::pipeline;
use elbowroom::planner::embedded;
use elbowroom::probability::{Likelihoods, likelihoods};
use elbowroom::sim::{FaultInjector, ReportReliability, SimWorld, WorldModel};

/// One of each executor in the registry, so that new ones are tested automatically.
pub(crate) static EXECUTORS: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
    let registered = executors::EXECUTORS.iter();
    registered.map(|it| &*it.example().leak()).collect()
});

/// Returns settings with IRR's boxes.
pub(crate) fn irr() -> pipeline::Settings {
    pipeline::Settings {
        search: Search::irr(),
        ..pipeline::Settings::default()
    }
}

/// Problem with a plan.
pub(crate) struct Scene {
    pub(crate) task: Arc<Task>,
    pub(crate) plan: TimeTriggeredPlan,
    pub(crate) flow: pipeline::Settings,
    pub(crate) settings: RunSettings,
    pub(crate) states: u64,
    pub(crate) likelihoods: Arc<Likelihoods>,
}

impl Scene {
    /// Reads one of the folders in `cases`.
    pub(crate) fn case(name: &str) -> Self {
        let file = |file: &str| read(&format!("cases/{name}/{file}"));
        Self::new(
            &file("domain.pddl"),
            &file("problem.pddl"),
            Some(&file("plan.plan")),
        )
    }

    /// Returns the problem of table 1 with these deadlines.
    pub(crate) fn two_orders(early: &str, late: &str) -> Self {
        let problem = read("experiments/table1/problem.pddl");
        let problem = problem.replace("{early}", early).replace("{late}", late);
        Self::new(&read("experiments/table1/domain.pddl"), &problem, None)
    }

    /// Returns a problem with a plan, by default that of the planner.
    pub(crate) fn new(domain: &str, problem: &str, plan: Option<&str>) -> Self {
        Self::within(400, domain, problem, plan)
    }

    /// Returns a problem with a plan; the planner searches at most `states` states.
    pub(crate) fn within(states: u64, domain: &str, problem: &str, plan: Option<&str>) -> Self {
        let source = |text: &str| Source::new("test", text);
        let (problem, _) =
            pddl::read_problem(&source(domain), &source(problem)).expect("a correct test");
        let task = Task::new(problem);
        let mut scene = Self {
            plan: TimeTriggeredPlan::default(),
            // The times and numbers that the tests expect are those of IRR's boxes.
            flow: irr(),
            settings: RunSettings {
                planning_time: PlanningTime::Seconds(Rational::ZERO),
                time_limit: Rational::from(100_000),
                ..RunSettings::default()
            },
            task: Arc::new(task.clone()),
            states,
            likelihoods: Arc::new(Likelihoods::certain()),
        };
        scene.plan = if let Some(text) = plan {
            let read = pddl::read_plan(&source(text), &task);
            read.expect("a correct test").0
        } else {
            let situation = Situation::initial(&task);
            match scene.planner().plan(&task, &situation).answer {
                elbowroom::execution::PlanAnswer::Plan(plan) => plan,
                other => panic!("no plan: {other:?}"),
            }
        };
        scene.task = Arc::new(task);
        scene
    }

    /// Adds these sections of a likelihood file.
    pub(crate) fn with_likelihoods(mut self, sections: &str) -> Self {
        let text = format!("format = \"elbowroom-likelihoods\"\nversion = 1\n{sections}");
        let read = likelihoods::read(text.as_bytes(), &self.task);
        self.likelihoods = Arc::new(read.expect("a correct test"));
        self
    }

    /// Runs an executor that searches for likelier plans in that world.
    pub(crate) fn run_likeliest(&self, executor: &str, model: &WorldModel, seed: u64) -> Report {
        let spec: ExecutorSpec = executor.parse().expect("a correct test");
        let PlanningTime::Seconds(time) = self.settings.planning_time.clone() else {
            panic!("a correct test");
        };
        let likeliest = MostProbablePlanner::new(model.clone(), self.planner(), time);
        let likeliest = SharedMostProbablePlanner::new(likeliest);
        let mut world = SimWorld::new(Arc::clone(&self.task), model, seed);
        let report = Execution::of(&self.task)
            .beginning_with(self.plan.clone())
            .by(spec)
            .with_settings(self.settings.clone())
            .with_envelopes(self.flow.clone())
            .with_plan_comparator(Some(Box::new(likeliest.clone())))
            .with_planner(likeliest)
            .run_in(&mut world);
        if report.verdict == Verdict::GoalReached {
            assert_eq!(world.truth().is_goal(), Ok(true), "a wrong goal reached");
        }
        report
    }

    pub(crate) fn planner(&self) -> Embedded<'static> {
        Embedded {
            settings: embedded::Settings::default(),
            most_states: self.states,
            improve_states: 256,
            ..Embedded::default()
        }
    }

    /// Prepares the first plan.
    pub(crate) fn prepared(&self, executor: &str) -> PreparationResult {
        let spec: ExecutorSpec = executor.parse().expect("a correct test");
        let mut analyst = PlanPreparer::new(self.flow.clone());
        analyst
            .prepare(&self.task, &self.plan, spec.needs().plan)
            .expect("a correct test")
    }

    /// Runs an executor in any world.
    pub(crate) fn run_in(
        &self,
        executor: &str,
        world: &mut dyn World,
        preparer: &mut dyn Preparer,
        recorder: &mut dyn Recorder,
    ) -> Report {
        let (recorder, validation) = Validated::new(recorder, &self.task, None);
        let report = self
            .execution(executor)
            .with_preparer(preparer)
            .recorded_by(recorder)
            .run_in(world);
        assert_eq!(validation.findings(), [], "{executor}: {report:#?}");
        report
    }

    /// Returns an execution of the plan.
    pub(crate) fn execution(&self, executor: &str) -> Execution<'static> {
        Execution::of(&self.task)
            .beginning_with(self.plan.clone())
            .by(executor.parse().expect("a correct test"))
            .with_settings(self.settings.clone())
            .with_envelopes(self.flow.clone())
            .with_likelihoods(Arc::clone(&self.likelihoods))
            .with_planner(self.planner())
    }

    /// Runs in a simulated world, and validates successful executions.
    pub(crate) fn run(&self, executor: &str, model: &WorldModel, seed: u64) -> Report {
        let mut world = SimWorld::new(Arc::clone(&self.task), model, seed);
        let mut analyst = PlanPreparer::new(self.flow.clone());
        let report = self.run_in(executor, &mut world, &mut analyst, &mut NoRecord);
        if report.verdict == Verdict::GoalReached {
            assert_eq!(world.truth().is_goal(), Ok(true), "a wrong goal reached");
        }
        report
    }

    /// Runs in a simulated world with faulty reports. Also returns `true` if the goal holds in the
    /// end.
    pub(crate) fn run_badly(
        &self,
        executor: &str,
        model: &WorldModel,
        reports: &ReportReliability,
        seed: u64,
        preparer: &mut dyn Preparer,
    ) -> (Report, bool) {
        let sim = SimWorld::new(Arc::clone(&self.task), model, seed);
        let resolution = model.resolution.clone();
        let mut world = FaultInjector::new(sim, reports.clone(), seed, resolution);
        let report = self.run_in(executor, &mut world, preparer, &mut NoRecord);
        let is_goal = world.inner().truth().is_goal() == Ok(true);
        (report, is_goal)
    }

    /// Validates the execution.
    pub(crate) fn judged(&self, report: &Report) -> validate::Verdict {
        let steps = report.executed.iter().map(|executed| executed.step.clone());
        let plan = TimeTriggeredPlan {
            steps: steps.collect(),
        };
        validate(&self.task, &plan, &validate::Settings::default())
    }

    pub(crate) fn world(&self, sections: &str) -> WorldModel {
        let text = format!("format = \"elbowroom-world\"\nversion = 1\n{sections}");
        WorldModel::read(&text, self.task.problem()).expect("a correct test")
    }
}

/// Reads a file of the project, by its path from the root.
pub(crate) fn read(path: &str) -> String {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    std::fs::read_to_string(root.join(path)).expect("a correct test")
}

/// Returns the number of runs of a long test, from the environment variable or by default.
pub(crate) fn runs(variable: &str, otherwise: u64) -> u64 {
    std::env::var(variable)
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(otherwise)
}
