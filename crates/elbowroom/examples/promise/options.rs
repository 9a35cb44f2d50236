//! Command line.

use std::path::PathBuf;
use std::time::Duration;

use super::subject::Planning;

/// Options of all commands.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    pub(crate) data: PathBuf,
    pub(crate) planning: Planning,
    /// Texts to search for in the family and the name of a plan; one of them must occur.
    pub(crate) only: Vec<String>,
    /// Maximum number of runs of one plan.
    pub(crate) runs: u64,
    /// Time limit for the runs of one plan.
    pub(crate) time_per_plan: Duration,
    /// Time limit for widening a box.
    pub(crate) time_per_box: Duration,
    /// Number of threads.
    pub(crate) jobs: usize,
}

impl Options {
    pub(crate) fn read(arguments: &[String]) -> Result<Self, String> {
        let mut options = Self {
            data: PathBuf::from("../shared/data"),
            planning: Planning {
                cache: None,
                states: 200_000,
                time: Some(Duration::from_secs(5)),
            },
            only: Vec::new(),
            runs: 3_000,
            time_per_plan: Duration::from_secs(10),
            time_per_box: Duration::from_secs(20),
            jobs: 2,
        };
        let mut arguments = arguments.iter();
        while let Some(option) = arguments.next() {
            let value = arguments
                .next()
                .ok_or_else(|| format!("{option} needs a value"))?;
            let number = || {
                let number: Result<u64, _> = value.parse();
                number.map_err(|_| format!("{option} expects a number, found {value}"))
            };
            match option.as_str() {
                "--data" => options.data = PathBuf::from(value),
                "--plans" => options.planning.cache = Some(PathBuf::from(value)),
                "--states" => options.planning.states = number()?,
                "--seconds" => {
                    let time = Duration::from_secs(number()?);
                    options.planning.time = (!time.is_zero()).then_some(time);
                }
                "--only" => options.only.push(value.clone()),
                "--runs" => options.runs = number()?,
                "--each" => options.time_per_plan = Duration::from_secs(number()?),
                "--widening" => options.time_per_box = Duration::from_secs(number()?),
                "--jobs" => options.jobs = usize::try_from(number()?.max(1)).unwrap_or(1),
                _ => return Err(format!("unknown option {option}")),
            }
        }
        if let Some(folder) = &options.planning.cache {
            std::fs::create_dir_all(folder)
                .map_err(|error| format!("{}: {error}", folder.display()))?;
        }
        Ok(options)
    }
}
