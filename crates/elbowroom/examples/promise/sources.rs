//! Sources of plans: files of the benchmarks, and planning problems.

use std::fs;
use std::path::{Path, PathBuf};

/// Problem, and the source of its plan.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    /// Family for the counts.
    pub(crate) family: String,
    /// Name within its family.
    pub(crate) name: String,
    pub(crate) domain: PathBuf,
    pub(crate) problem: PathBuf,
    pub(crate) origin: Origin,
}

/// Origin of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// Written by hand, or by another planner.
    File(PathBuf),
    /// Computed by the embedded planner.
    Planned,
}

/// Returns all sources below a folder of benchmarks.
pub(crate) fn sources(data: &Path) -> Vec<Source> {
    let mut sources = published(data);
    sources.extend(envelopes(&data.join("envelopes")));
    sources.extend(problems(data));
    sources
}

/// Returns the columns of each line of a table without quoting.
fn table(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).unwrap_or_default();
    let lines = text.lines().skip(1);
    let columns = |line: &str| line.split(',').map(str::to_owned).collect();
    lines.map(columns).collect()
}

/// Returns the plans of `pddl/plans.csv`.
fn published(data: &Path) -> Vec<Source> {
    let folder = data.join("pddl");
    let rows = table(&folder.join("plans.csv"));
    let source = |row: &Vec<String>| {
        let [collection, domain, _, domain_file, problem_file, plan, ..] = &row[..] else {
            return None;
        };
        let name = Path::new(plan).file_name()?.to_string_lossy().into_owned();
        Some(Source {
            family: format!("{collection}/{domain}"),
            name,
            domain: folder.join(domain_file),
            problem: folder.join(problem_file),
            origin: Origin::File(folder.join(plan)),
        })
    };
    rows.iter().filter_map(source).collect()
}

/// Returns the temporal problems of `pddl/manifest.csv` and all of
/// `required-concurrency/manifest.csv`.
fn problems(data: &Path) -> Vec<Source> {
    let mut sources = Vec::new();
    let folder = data.join("required-concurrency");
    for row in table(&folder.join("manifest.csv")) {
        if let [domain, instance, domain_file, problem_file] = &row[..] {
            sources.push(Source {
                family: format!("required-concurrency/{domain}"),
                name: instance.clone(),
                domain: folder.join(domain_file),
                problem: folder.join(problem_file),
                origin: Origin::Planned,
            });
        }
    }
    let folder = data.join("pddl");
    for row in table(&folder.join("manifest.csv")) {
        let [
            collection,
            domain,
            instance,
            domain_file,
            problem_file,
            _,
            durative,
            ..,
        ] = &row[..]
        else {
            continue;
        };
        if durative != "0" {
            sources.push(Source {
                family: format!("{collection}/{domain}"),
                name: instance.clone(),
                domain: folder.join(domain_file),
                problem: folder.join(problem_file),
                origin: Origin::Planned,
            });
        }
    }
    sources
}

/// Returns all plans of `envelopes`, those with fixed times and those without.
fn envelopes(folder: &Path) -> Vec<Source> {
    let mut files = Vec::new();
    below(folder, &mut files);
    let source = |file: &PathBuf| {
        let inside = file.strip_prefix(folder).ok()?;
        let parts: Vec<&str> = inside.iter().filter_map(|part| part.to_str()).collect();
        let (domain, problem) = companions(&parts)?;
        Some(Source {
            family: format!("envelopes/{}", parts[0]),
            name: parts[1..].join("/"),
            domain: folder.join(domain),
            problem: folder.join(problem),
            origin: Origin::File(file.clone()),
        })
    };
    files.iter().filter_map(source).collect()
}

/// Returns the domain and the problem for a plan of `envelopes`, or `None` if the file is not a
/// plan.
fn companions(parts: &[&str]) -> Option<(String, String)> {
    let (name, folders) = parts.split_last()?;
    let digits = || {
        let number: String = name.chars().skip_while(|c| !c.is_ascii_digit()).collect();
        number.chars().take(2).collect::<String>()
    };
    let is_stn = Path::new(name).extension().is_some_and(|ext| ext == "stn");
    let owned = |domain: &str, problem: String| Some((domain.to_owned(), problem));
    match folders {
        ["auv", kind, ..] if kind.starts_with("stn") || *kind == "plans" => {
            let name = name.trim_start_matches("stn_").trim_start_matches("plan_");
            let mission: Vec<&str> = name.split('_').take(4).collect();
            let domain = "auv/domains/pandora_domain_strategic_for_validation.pddl";
            owned(domain, format!("auv/problems/{}.pddl", mission.join("_")))
        }
        ["generator_linear", kind, ..] if is_stn || *kind == "plans_and_stns" => owned(
            "generator_linear/gen_linear_domain.pddl",
            format!("generator_linear/gen_linear_prob{}.pddl", digits()),
        ),
        ["solar_rover", version, kind, ..] if is_stn || *kind == "plans" => Some((
            format!("solar_rover/{version}/solarrover_linear.pddl"),
            format!("solar_rover/{version}/prob{}.pddl", digits()),
        )),
        ["robot_delivery", "scalability", kind] if is_stn || kind.starts_with("plans_") => {
            let name = name.trim_start_matches("STN_").trim_start_matches("plan_");
            let problem = name.trim_end_matches(".stn").trim_end_matches(".pddl");
            let (domain, problems) = if kind.ends_with("_no_deadline") || *kind == "stn_no_params" {
                (
                    "robot_delivery/scalability/domain_no_deadline.pddl",
                    "problems_no_deadline",
                )
            } else {
                (
                    "robot_delivery/domain_robot_delivery.pddl",
                    "problems_deadline",
                )
            };
            owned(
                domain,
                format!("robot_delivery/scalability/{problems}/{problem}.pddl"),
            )
        }
        ["ccmmz_examples", example] if is_stn => {
            let (domain, problem) = if example.starts_with("generator") {
                ("gen_linear_domain", "gen_linear_prob01")
            } else {
                ("domain", "problem")
            };
            Some((
                format!("ccmmz_examples/{example}/{domain}.pddl"),
                format!("ccmmz_examples/{example}/{problem}.pddl"),
            ))
        }
        ["golden_reference_runs", "rcll"] if is_stn || name.starts_with("plan") => owned(
            "rcll_duration/domain_rcll_simple_robust.pddl",
            "rcll_duration/problems/problem_lp0.05_hp0.95.pddl".to_owned(),
        ),
        _ => None,
    }
}

/// Adds all files below a folder, sorted.
fn below(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    let mut entries: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            below(&path, found);
        } else {
            found.push(path);
        }
    }
}
