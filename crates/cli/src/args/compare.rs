//! Arguments of `elbowroom compare`.

use std::path::PathBuf;

use clap::Args;

use super::number::count;

#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// The experiment (docs/reference/formats/experiment.md)
    #[arg(value_name = "EXPERIMENT.toml")]
    pub(crate) experiment: PathBuf,
    /// Number of trials of each problem; by default that of the experiment
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    #[arg(allow_negative_numbers = true)]
    pub(crate) trials: Option<u64>,
    /// Random seed; by default the seed of the experiment
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Number of threads; 0 for one per processor. Trials are distributed over them; if there are
    /// fewer trials, the embedded planner uses the others
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) jobs: usize,
    /// Run only part `I` of `N`, counted from 0
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub(crate) shard: Option<(u64, u64)>,
    /// Run nothing; merge the results of parts
    #[arg(long, value_name = "RESULTS.json", num_args = 1..)]
    #[arg(conflicts_with_all = ["shard", "trials"])]
    pub(crate) merge: Vec<PathBuf>,
    /// Write results.json, table.md, table.csv and plots to this folder
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Also write trials.csv there: seed, case, column, trial, executor, verdict, time and replans
    /// of each trial
    #[arg(long, requires = "output", conflicts_with = "merge")]
    pub(crate) each_trial: bool,
    /// Print the results as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

fn shard(text: &str) -> Result<(u64, u64), String> {
    let numbers = text.split_once('/');
    let numbers = numbers.and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match numbers {
        Some((shard, shards)) if shard < shards => Ok((shard, shards)),
        _ => Err("write I/N with 0 <= I < N, as in 0/4".to_owned()),
    }
}
