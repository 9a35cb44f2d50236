//! Starts an executive in a child process, submits a goal, kills the process, and resumes the run from the journal.
//!
//! `cargo run --package elbowroom-executive --example restart`, from the root of the repository.

use std::error::Error;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use elbowroom::execute::{NamedText, RunSpec};
use elbowroom::execution::run::PROBLEM_GOAL_NAME;
use elbowroom_executive::interface::documents::{GoalNow, NewGoal};
use elbowroom_executive::{Executive, ExecutiveSettings};

/// Name of the goal that is submitted before the crash.
const HOME: &str = "home";

/// Reads a file of the case `delivery`.
fn case(name: &str) -> Result<NamedText, std::io::Error> {
    let text = std::fs::read_to_string(Path::new("cases/delivery").join(name))?;
    let name = name.to_owned();
    Ok(NamedText { name, text })
}

/// Waits until a goal is achieved.
fn wait_for(executive: &Executive, name: &str) {
    let is_achieved = |goal: &GoalNow| goal.name == name && goal.state == "achieved";
    while !executive
        .published()
        .all_goals()
        .goals
        .iter()
        .any(is_achieved)
    {
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Executes the problem, submits [`HOME`], and crashes.
fn first_run(journal: &Path) -> Result<(), Box<dyn Error>> {
    let mut spec = RunSpec::new(case("domain.pddl")?, case("problem.pddl")?);
    spec.world_process = Some("python3 examples/world.py".to_owned());
    let journal = Some(journal.to_owned());
    let settings = ExecutiveSettings {
        journal,
        ..ExecutiveSettings::default()
    };
    let executive = Executive::new(spec, settings)?;
    std::thread::scope(|scope| {
        scope.spawn(|| executive.run());
        wait_for(&executive, PROBLEM_GOAL_NAME);
        let home = NewGoal {
            name: Some(HOME.to_owned()),
            goal: "(at rover depot)".to_owned(),
            value: None,
            deadline: None,
            within: None,
            release: None,
            after: None,
            keep: false,
            by: None,
        };
        executive.submit_goal(home, Duration::from_secs(10))?;
        std::process::abort()
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    if let Some(journal) = std::env::args_os().nth(1) {
        return first_run(Path::new(&journal));
    }
    let folder = std::env::temp_dir().join(format!("elbowroom-restart-{}", std::process::id()));
    std::fs::create_dir(&folder)?;
    let journal = folder.join("robot.journal");
    Command::new(std::env::current_exe()?)
        .arg(&journal)
        .status()?;
    let executive = Executive::resume(&journal, ExecutiveSettings::default())?;
    std::thread::scope(|scope| {
        let run = scope.spawn(|| executive.run());
        wait_for(&executive, HOME);
        executive.stop();
        let outcome = run.join().expect("the run returns an outcome")?;
        let verdict = outcome.outcome.answer.report.verdict;
        writeln!(
            std::io::stdout(),
            "goal reached after the restart; verdict: {verdict}"
        )?;
        std::fs::remove_dir_all(&folder)?;
        Ok(())
    })
}
