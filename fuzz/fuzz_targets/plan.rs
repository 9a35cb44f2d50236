//! Arbitrary bytes as a plan. A valid plan is written and read again.

#![no_main]

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_plan, read_problem, write_plan};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let domain = Source::new("domain.pddl", include_str!("../fixed/domain.pddl"));
    let problem = Source::new("problem.pddl", include_str!("../fixed/problem.pddl"));
    let (problem, _) = read_problem(&domain, &problem).expect("the fixed texts are right");
    let task = Task::new(problem);
    match read_plan(&Source::from_bytes("plan", bytes), &task) {
        Ok((mut plan, _)) => {
            let written = write_plan(&task, &plan);
            let (again, _) = read_plan(&Source::new("written", written), &task)
                .expect("what is written is right");
            plan.steps.sort_by(|a, b| a.start.cmp(&b.start));
            assert_eq!(again, plan);
        }
        Err(diagnostics) => {
            diagnostics.render(false);
        }
    }
});
