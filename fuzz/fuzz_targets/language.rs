//! Arbitrary bytes, before the first `@` as sections of a domain with processes, events, control
//! parameters and object fluents, and after it as a plan. Valid input is written and read again,
//! and the plan is validated.

#![no_main]

use elbowroom_model::validate::{Settings, validate};
use elbowroom_model::{Situation, Task};
use elbowroom_pddl::{ProblemText, Source, read_plan, read_problem, write_problem};
use libfuzzer_sys::fuzz_target;

const PLAN: &str = "1: (pour kettle 2.5) [2]\n4: (carry r1 kettle bath)\n";

const PROBLEM: &str = "(define (problem evening) (:domain flat) (:objects r1 - robot)
    (:init (open) (= (level) 0) (= (place r1) hall) (at 3 (= (place r1) bath)))
    (:goal (and)))";

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    let (sections, plan) = text.split_once('@').unwrap_or((&text, PLAN));
    let domain = format!(
        "(define (domain flat) (:types robot room thing) (:constants hall bath - room kettle - thing)
           (:predicates (open) (wet ?r - room) (has ?r - robot ?t - thing))
           (:functions (level) - number (place ?r - robot) - room) {sections})"
    );
    let domain = Source::new("domain.pddl", domain);
    let problem = match read_problem(&domain, &Source::new("problem.pddl", PROBLEM)) {
        Ok((problem, _)) => problem,
        Err(diagnostics) => {
            diagnostics.render(false);
            return;
        }
    };
    let task = Task::new(problem);
    let written = write_problem(&task, &Situation::initial(&task), &ProblemText::default())
        .expect("nothing has happened");
    read_problem(&domain, &Source::new("written.pddl", written)).expect("what is written is right");
    if let Ok((plan, _)) = read_plan(&Source::new("plan", plan), &task) {
        validate(&task, &plan, &Settings::default());
    }
});
