//! Arbitrary bytes as an STN plan file. A valid plan is written, and the written file is stable
//! when it is read and written again.

#![no_main]

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_plan::format;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let domain = Source::new("domain.pddl", include_str!("../fixed/domain.pddl"));
    let problem = Source::new("problem.pddl", include_str!("../fixed/problem.pddl"));
    let (problem, _) = read_problem(&domain, &problem).expect("the fixed texts are right");
    let task = Task::new(problem);
    match format::read(bytes, &task) {
        Ok(plan) => {
            let written = format::write(&task, &plan).expect("what was read can be written");
            let again =
                format::read(written.as_bytes(), &task).expect("what is written is right");
            // Bounds on the same difference are merged the first time.
            let rewritten = format::write(&task, &again).expect("what was read can be written");
            assert_eq!(rewritten, written);
        }
        Err(errors) => assert!(!errors.to_string().is_empty()),
    }
});
