//! The list of instances of a folder of benchmarks.

use std::path::{Path, PathBuf};

use serde::Deserialize;

/// A line of a manifest, its columns by name; what is not there is empty.
#[derive(Debug, Deserialize)]
struct Line {
    #[serde(default)]
    collection: String,
    domain: String,
    instance: String,
    domain_file: String,
    problem_file: String,
    /// How many durative actions the domain has.
    #[serde(default)]
    durative_actions: String,
    #[serde(default)]
    domain_features: String,
    #[serde(default)]
    problem_features: String,
}

/// An instance of a benchmark.
#[derive(Debug)]
#[allow(
    clippy::struct_field_names,
    reason = "the manifest's own name for its column"
)]
pub(crate) struct Instance {
    /// The manifest's, or the folder's name where it has none.
    pub(crate) collection: String,
    pub(crate) domain: String,
    pub(crate) instance: String,
    pub(crate) domain_file: PathBuf,
    pub(crate) problem_file: PathBuf,
    /// Whether it has durative actions, as far as the manifest knows.
    pub(crate) is_temporal: bool,
    /// Features of domain and problem, joined by spaces.
    pub(crate) features: String,
    /// The line as it stands, to be searched.
    pub(crate) line: String,
}

/// The instances of `FOLDER/manifest.csv`.
///
/// # Errors
/// When the manifest cannot be read, or a column is missing.
pub(crate) fn read(folder: &Path) -> Result<Vec<Instance>, String> {
    // `.` has no name.
    let folder = folder.canonicalize();
    let folder = &folder.map_err(|error| format!("the folder of instances: {error}"))?;
    let path = folder.join("manifest.csv");
    let wrong = |error: csv::Error| format!("{}: {error}", path.display());
    let mut reader = csv::Reader::from_path(&path).map_err(wrong)?;
    let headers = reader.headers().map_err(wrong)?.clone();
    let name = folder.file_name().unwrap_or_default();
    let mut instances = Vec::new();
    for record in reader.records() {
        let record = record.map_err(wrong)?;
        let line: Line = record.deserialize(Some(&headers)).map_err(wrong)?;
        instances.push(Instance {
            collection: if line.collection.is_empty() {
                name.to_string_lossy().into_owned()
            } else {
                line.collection
            },
            domain: line.domain,
            instance: line.instance,
            domain_file: folder.join(line.domain_file),
            problem_file: folder.join(line.problem_file),
            is_temporal: line.durative_actions != "0",
            features: format!("{} {}", line.domain_features, line.problem_features),
            line: record.iter().collect::<Vec<_>>().join(","),
        });
    }
    Ok(instances)
}
