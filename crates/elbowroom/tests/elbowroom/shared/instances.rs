//! Instances of the paper's experiments (Figures 3 and 4).

use std::path::{Path, PathBuf};

/// Files of an instance.
#[derive(Clone, Debug)]
pub(crate) struct Instance {
    /// `auv mission_10_0_3`, …
    pub(crate) name: String,
    pub(crate) domain: PathBuf,
    pub(crate) problem: PathBuf,
    pub(crate) plan: PathBuf,
}

/// Returns all `auv`, `generator_linear` and `solar_rover` instances with parameters and nominal
/// values.
pub(crate) fn figure_3(data: &Path) -> Vec<Instance> {
    let envelopes = data.join("envelopes");
    let mut instances = Vec::new();
    for name in files(&envelopes.join("auv/stns_params_with_values")) {
        let instance = name
            .trim_start_matches("stn_plan_")
            .trim_end_matches("_params");
        instances.push(Instance {
            name: format!("auv {instance}"),
            domain: envelopes.join("auv/domains/pandora_domain_strategic_for_validation.pddl"),
            problem: envelopes.join(format!("auv/problems/{instance}.pddl")),
            plan: envelopes.join("auv/stns_params_with_values").join(&name),
        });
    }
    let families = [
        (
            "generator_linear",
            "generator_linear",
            "gen_linear_domain.pddl",
            "gen_linear_prob",
        ),
        (
            "solar_rover",
            "solar_rover/flexible",
            "solarrover_linear.pddl",
            "prob",
        ),
    ];
    for (family, folder, domain, problem) in families {
        let folder = envelopes.join(folder);
        for name in files(&folder.join("stns_params_with_values")) {
            let instance = name
                .trim_start_matches("output")
                .trim_end_matches("pram.stn");
            let (number, _) = instance.split_once('_').expect("NUMBER_PARAMETERS");
            instances.push(Instance {
                name: format!("{family} {instance}"),
                domain: folder.join(domain),
                problem: folder.join(format!("{problem}{number}.pddl")),
                plan: folder.join("stns_params_with_values").join(&name),
            });
        }
    }
    instances
}

/// Returns all robot deliveries of `scalability`, with the domain whose drives have unrestricted
/// durations.
pub(crate) fn figure_4(data: &Path) -> Vec<Instance> {
    let envelopes = data.join("envelopes");
    let folder = envelopes.join("robot_delivery/scalability");
    files(&folder.join("stn_params_deadline"))
        .into_iter()
        .map(|name| {
            let problem = name
                .trim_start_matches("STN_plan_")
                .trim_end_matches(".stn");
            Instance {
                name: problem
                    .trim_start_matches("problem_")
                    .trim_end_matches("_ROSPlan")
                    .to_owned(),
                domain: envelopes
                    .join("golden_reference_runs/robot_delivery")
                    .join("domain_robot_delivery_goto_relaxed.pddl"),
                problem: folder
                    .join("problems_deadline")
                    .join(format!("{problem}.pddl")),
                plan: folder.join("stn_params_deadline").join(&name),
            }
        })
        .collect()
}

/// Returns the names of the files in a folder, sorted.
fn files(folder: &Path) -> Vec<String> {
    let entries =
        std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut names: Vec<String> = entries
        .map(|entry| {
            entry
                .expect("a readable folder")
                .file_name()
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    names.sort();
    names
}
