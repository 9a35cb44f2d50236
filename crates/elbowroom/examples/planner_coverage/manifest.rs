//! Manifest of a folder of benchmark instances.

use std::path::{Path, PathBuf};

use serde::Deserialize;

/// Line of a manifest, with its columns by name; missing ones are empty.
#[derive(Debug, Deserialize)]
struct Line {
    #[serde(default)]
    collection: String,
    domain: String,
    instance: String,
    domain_file: String,
    problem_file: String,
    /// Number of durative actions in the domain.
    #[serde(default)]
    durative_actions: String,
    #[serde(default)]
    domain_features: String,
    #[serde(default)]
    problem_features: String,
}

/// Benchmark instance.
#[derive(Debug)]
#[allow(
    clippy::struct_field_names,
    reason = "the manifest's own name for its column"
)]
pub(crate) struct Instance {
    /// The manifest's collection, or the folder's name without one.
    pub(crate) collection: String,
    pub(crate) domain: String,
    pub(crate) instance: String,
    pub(crate) domain_file: PathBuf,
    pub(crate) problem_file: PathBuf,
    /// `true` if it has durative actions, or if the manifest does not say.
    pub(crate) is_temporal: bool,
    /// Features of domain and problem, separated by spaces.
    pub(crate) features: String,
    /// Unparsed line, for text search.
    pub(crate) line: String,
}

/// Returns the instances of `FOLDER/manifest.csv`.
///
/// # Errors
/// The manifest cannot be read, or a column is missing.
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
