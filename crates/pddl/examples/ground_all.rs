//! Grounds all instances of a benchmark set and prints, for each one, seconds and counts:
//! `cargo run --release --example ground_all [FOLDER [PART OF A PATH]]`, where the folder holds
//! `manifest.csv`.
#![allow(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "it measures, and prints what it measures"
)]

use std::error::Error;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use elbowroom_model::Task;
use elbowroom_model::reachability::{Answer, Settings, ground};
use elbowroom_pddl::{Source, read_problem};

const USUAL_FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/pddl");

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| USUAL_FOLDER.into()));
    let wanted = arguments.next().unwrap_or_default();
    let manifest = std::fs::read_to_string(folder.join("manifest.csv"))?;
    let mut total = [Duration::ZERO; 3];
    let (mut grounded, mut unreadable, mut limited, mut action_count) = (0, 0, 0, 0);
    for line in manifest
        .lines()
        .skip(1)
        .filter(|line| line.contains(&wanted))
    {
        let columns: Vec<_> = line.split(',').collect();
        let [domain, problem] = [columns[3], columns[4]];
        let load = |path: &str| -> Result<Source, Box<dyn Error>> {
            Ok(Source::from_bytes(path, &std::fs::read(folder.join(path))?))
        };
        let (domain, source) = (load(domain)?, load(problem)?);
        let start = Instant::now();
        let answer = read_problem(&domain, &source);
        total[0] += start.elapsed();
        let Ok((lifted, _)) = answer else {
            unreadable += 1;
            continue;
        };
        let start = Instant::now();
        let task = Task::new(lifted);
        total[1] += start.elapsed();
        let start = Instant::now();
        let answer = ground(&task, &Settings::default());
        let seconds = start.elapsed();
        total[2] += seconds;
        let seconds = seconds.as_secs_f64();
        match answer {
            Answer::Complete(grounding) => {
                grounded += 1;
                action_count += grounding.actions.len();
                println!(
                    "{seconds:8.4} s {:7} actions {:7} facts {:9} steps {:3} unreachable goals  {problem}",
                    grounding.actions.len(),
                    grounding.facts.len(),
                    grounding.steps,
                    grounding.unreachable_goals.len(),
                );
            }
            Answer::LimitReached => {
                limited += 1;
                println!("{seconds:8.4} s  limit reached  {problem}");
            }
        }
    }
    let [reading, entering, grounding] = total.map(|duration| duration.as_secs_f64());
    println!("{grounded} grounded, {limited} limited, {unreadable} unreadable");
    println!("{action_count} actions");
    println!("reading {reading:.2} s, first facts {entering:.2} s, grounding {grounding:.2} s");
    Ok(())
}
