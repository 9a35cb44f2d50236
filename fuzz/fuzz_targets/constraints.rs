//! Arbitrary bytes as constraints, preferences and metric of a problem. A valid problem is written
//! and read again, and a plan is validated for it.

#![no_main]

use elbowroom_model::validate::{Settings, validate};
use elbowroom_model::{Situation, Task};
use elbowroom_pddl::{ProblemText, Source, read_plan, read_problem, write_problem};
use libfuzzer_sys::fuzz_target;

const PLAN: &str = "1: (throw b1 hall)\n6: (throw b2 hall)\n";

fuzz_target!(|bytes: &[u8]| {
    let sections = String::from_utf8_lossy(bytes);
    let text = format!(
        "(define (problem evening) (:domain house) (:objects b1 b2 - ball)
           (:init (in b1 hall) (in b2 hall) (= (size b1) 4) (= (size b2) 1) (= (level) 100)
                  (at 5 (lit)) (at 7 (= (level) 3)))
           (:goal (and)) {sections})"
    );
    let domain = Source::new("domain.pddl", include_str!("../fixed/domain.pddl"));
    let (problem, _) = match read_problem(&domain, &Source::new("problem.pddl", text)) {
        Ok(read) => read,
        Err(diagnostics) => {
            diagnostics.render(false);
            return;
        }
    };
    let task = Task::new(problem);
    let written = write_problem(&task, &Situation::initial(&task), &ProblemText::default())
        .expect("nothing has happened");
    let (again, _) = read_problem(&domain, &Source::new("written.pddl", written))
        .expect("what is written is right");
    assert_eq!(again.constraints, task.problem().constraints);
    if let Ok((plan, _)) = read_plan(&Source::new("plan", PLAN), &task) {
        validate(&task, &plan, &Settings::default());
    }
});
