//! The problems to run: from a folder of benchmarks, or given as files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};

/// A problem.
pub(crate) struct Instance {
    /// `collection/domain`.
    pub(crate) domain: String,
    pub(crate) name: String,
    pub(crate) domain_file: PathBuf,
    pub(crate) problem_file: PathBuf,
}

/// Filter for the instances of a folder.
#[derive(Debug, Default)]
pub(crate) struct Selection {
    /// Keeps the instances whose lines contain one of the texts; all of them if there are no texts.
    pub(crate) only: Vec<String>,
    /// If set to `k`, every `k`-th instance of each domain with durative actions, beginning with
    /// the first.
    pub(crate) every: Option<usize>,
}

/// Returns the problems that the arguments name: a folder with a `manifest.csv`, or a domain and
/// problems.
///
/// The first line of a manifest names its columns: `domain`, `instance`, `domain_file` and
/// `problem_file`, in any order. The columns `collection` and `durative_actions` (number of
/// durative actions in the domain) are optional, and others are ignored.
///
/// # Errors
/// If there is nothing to run.
pub(crate) fn instances(files: &[PathBuf], selection: &Selection) -> Result<Vec<Instance>, String> {
    match files {
        [folder] => of_folder(folder, selection),
        [domain, problems @ ..] => {
            let stem = |path: &Path| {
                let stem = path.file_stem().unwrap_or_default();
                stem.to_string_lossy().into_owned()
            };
            let problems = problems.iter().map(|problem| Instance {
                domain: stem(domain),
                name: stem(problem),
                domain_file: domain.clone(),
                problem_file: problem.clone(),
            });
            Ok(problems.collect())
        }
        [] => Err("give a folder with a manifest.csv, or a domain and problems".to_owned()),
    }
}

fn of_folder(folder: &Path, selection: &Selection) -> Result<Vec<Instance>, String> {
    // `.` has no name.
    let folder = folder.canonicalize();
    let folder = &folder.map_err(|error| format!("there is no such folder: {error}"))?;
    let path = folder.join("manifest.csv");
    let text = std::fs::read_to_string(&path);
    let text = text.map_err(|error| format!("{}: {error}", path.display()))?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = |name: &str| {
        let column = names.iter().position(|column| column.trim() == name);
        column.ok_or_else(|| format!("{}: there is no column `{name}`", path.display()))
    };
    let (domain, instance) = (column("domain")?, column("instance")?);
    let files = [column("domain_file")?, column("problem_file")?];
    let (collection, durative) = (column("collection").ok(), column("durative_actions").ok());
    let Selection { only, every } = selection;
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut instances = Vec::new();
    for line in lines.filter(|line| !line.trim().is_empty()) {
        if !only.is_empty() && !only.iter().any(|text| line.contains(text.as_str())) {
            continue;
        }
        let cells: Vec<&str> = line.split(',').collect();
        let cell = |column: usize| {
            let cell = cells.get(column).copied();
            cell.ok_or_else(|| format!("{}: too few columns in `{line}`", path.display()))
        };
        let own = match collection {
            Some(collection) => cell(collection)?.to_owned(),
            None => folder
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
        };
        let own = format!("{own}/{}", cell(domain)?);
        if let Some(every) = *every {
            if durative.map(cell).transpose()? == Some("0") {
                continue;
            }
            let count = counts.entry(own.clone()).or_default();
            *count += 1;
            if !(*count - 1).is_multiple_of(every.max(1)) {
                continue;
            }
        }
        instances.push(Instance {
            domain: own,
            name: cell(instance)?.to_owned(),
            domain_file: folder.join(cell(files[0])?),
            problem_file: folder.join(cell(files[1])?),
        });
    }
    Ok(instances)
}

/// Returns the task of an instance.
///
/// # Errors
/// If the instance cannot be read. The word distinguishes unsupported features from mistakes.
pub(crate) fn task(instance: &Instance) -> Result<Task, &'static str> {
    let source = |path: &Path| {
        let bytes = std::fs::read(path).unwrap_or_default();
        Source::from_bytes(path.display().to_string(), &bytes)
    };
    let read = read_problem(
        &source(&instance.domain_file),
        &source(&instance.problem_file),
    );
    match read {
        Ok((problem, _)) => Ok(Task::new(problem)),
        Err(diagnostics) if elbowroom_pddl::is_unsupported(&diagnostics) => {
            Err("not-read-unsupported")
        }
        Err(_) => Err("not-read"),
    }
}
