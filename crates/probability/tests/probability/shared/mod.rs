//! The authors' domains and likelihoods, and the first plans of the experiments. Tests that need
//! files outside of the repository report if these are missing, and pass.
#![allow(dead_code, unused_imports, reason = "each test uses some of it")]

#[path = "../../../../../testing/sampled.rs"]
mod sampled;
#[path = "../../../../../testing/skipped.rs"]
mod skipped;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_plan::PartialOrderPlan;
use elbowroom_plan::partial_order::partial_order;
use elbowroom_probability::likelihoods::read_authors;
use elbowroom_probability::{Likelihoods, Model, Semantics};
pub(crate) use sampled::one_in;
pub(crate) use skipped::skipped;

/// The plan that POPF gave the authors for SF3: all at once.
pub(crate) const SF3_PLAN: &str = "
    0.000: (go_maintain_machine m1) [1.000]
    0.000: (go_maintain_machine m2) [1.000]
    0.000: (go_maintain_machine m3) [1.000]";

/// The plan that POPF gave the authors for AF3: one after the other.
pub(crate) const AF3_PLAN: &str = "
    0.000: (maintain_machine m1) [1.000]
    1.001: (go_to_machine m1 m2) [1.000]
    2.002: (maintain_machine m2) [1.000]
    3.003: (go_to_machine m2 m3) [1.000]
    4.004: (maintain_machine m3) [1.000]";

/// One of the authors' 18 worlds, with its first plan.
pub(crate) struct Published {
    pub(crate) name: String,
    pub(crate) task: Arc<Task>,
    pub(crate) plan: PartialOrderPlan,
    pub(crate) likelihoods: Likelihoods,
}

impl Published {
    pub(crate) fn model(&self, semantics: Semantics) -> Model {
        let (task, plan) = (Arc::clone(&self.task), self.plan.clone());
        Model::new(task, plan, &self.likelihoods, semantics).expect("the authors list everything")
    }
}

/// Returns the folder of the authors' data, if it exists.
pub(crate) fn data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/olisipo");
    if folder.is_dir() {
        return Some(folder);
    }
    skipped(format_args!("there is no {}", folder.display()));
    None
}

/// Returns SF3 p1–p10.
pub(crate) fn sf3() -> Vec<Published> {
    published("sf3", "domain_simple_factory_robot.pddl", SF3_PLAN, 10)
}

/// Returns AF3 p1–p8.
pub(crate) fn af3() -> Vec<Published> {
    published("af3", "domain_adv_factory_robot.pddl", AF3_PLAN, 8)
}

fn published(folder: &str, domain: &str, plan: &str, count: usize) -> Vec<Published> {
    let Some(data) = data() else {
        return Vec::new();
    };
    let folder_path = data.join(folder);
    let world = |number: usize| {
        let (task, plan) = read_task(
            &file(&folder_path.join(domain)),
            &file(&folder_path.join("problem_m3.pddl")),
            plan,
        );
        let path = folder_path.join(format!("probabilities_m3_p{number}.txt"));
        let likelihoods = read_authors(file(&path).as_bytes(), &task)
            .unwrap_or_else(|errors| panic!("{}: {errors}", path.display()));
        Published {
            name: format!("{folder} p{number}"),
            task: Arc::new(task),
            plan,
            likelihoods,
        }
    };
    (1..=count).map(world).collect()
}

fn file(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns a task, and the partial order of a plan for it.
pub(crate) fn read_task(domain: &str, problem: &str, plan: &str) -> (Task, PartialOrderPlan) {
    let domain = Source::new("domain.pddl", domain);
    let problem = Source::new("problem.pddl", problem);
    let read = read_problem(&domain, &problem);
    let (problem, _) = read.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    let task = Task::new(problem);
    let read = read_plan(&Source::new("plan", plan), &task);
    let (plan, _) = read.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    let plan = partial_order(&task, &plan);
    (task, plan)
}
