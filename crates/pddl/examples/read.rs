//! Reads a domain, a problem and optionally a plan, and prints the diagnostics.
//!
//! `cargo run -p elbowroom-pddl --example read DOMAIN PROBLEM [PLAN]`

#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_plan, read_problem};

fn main() -> Result<(), Box<dyn Error>> {
    let texts = std::env::args()
        .skip(1)
        .map(|path| Ok(Source::from_bytes(path.as_str(), &std::fs::read(&path)?)))
        .collect::<Result<Vec<_>, std::io::Error>>()?;
    let [domain, problem, plan @ ..] = texts.as_slice() else {
        return Err("expected the paths of a domain, a problem and perhaps a plan".into());
    };
    let (problem, warnings) = match read_problem(domain, problem) {
        Ok(read) => read,
        Err(diagnostics) => {
            println!("{}", diagnostics.render(false));
            return Ok(());
        }
    };
    for warning in warnings {
        println!("{}\n", warning.render(false));
    }
    println!(
        "{}: {} actions, {} objects, {} initial facts",
        problem.name,
        problem.schemas.len(),
        problem.objects.len(),
        problem.initial_facts.len()
    );
    let task = Task::new(problem);
    for plan in plan {
        match read_plan(plan, &task) {
            Ok((plan, warnings)) => {
                for warning in warnings {
                    println!("{}\n", warning.render(false));
                }
                println!("a plan of {} steps", plan.steps.len());
            }
            Err(diagnostics) => println!("{}", diagnostics.render(false)),
        }
    }
    Ok(())
}
