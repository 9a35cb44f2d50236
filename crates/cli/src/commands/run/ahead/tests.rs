use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use elbowroom::execute::{Embedded, NamedText, RunSpec};
use elbowroom::execution::{PlanAnswer, Planner, PlannerAnswer};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::pddl::{Source, read_problem};

use super::{Ahead, Aside};
use crate::bell::{Bell, Ring};
use crate::interrupt::Interrupt;

/// The planner that is asked where nothing was made ahead; it counts how often.
struct Asked<'a>(&'a AtomicUsize);

impl Planner for Asked<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.0.fetch_add(1, Ordering::SeqCst);
        Embedded::default().plan(task, situation)
    }
}

/// A case.
pub(crate) fn delivery() -> (RunSpec, Task) {
    let text = |name: &str| {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/delivery");
        NamedText {
            name: name.to_owned(),
            text: std::fs::read_to_string(file.join(name)).expect("a case"),
        }
    };
    let (domain, problem) = (text("domain.pddl"), text("problem.pddl"));
    let source = |it: &NamedText| Source::new(it.name.clone(), it.text.clone());
    let (read, _) = read_problem(&source(&domain), &source(&problem)).expect("a correct case");
    (RunSpec::new(domain, problem), Task::new(read))
}

fn aside(interrupt: &Interrupt) -> Aside {
    Aside {
        interrupt: interrupt.clone(),
        bell: Bell::default(),
        most_memory: None,
    }
}

fn steps(answer: PlanAnswer) -> Vec<(String, Rational)> {
    let PlanAnswer::Plan(plan) = answer else {
        panic!("there is a plan: {answer:?}");
    };
    let step = |step: &elbowroom::model::Step| (step.action.name.clone(), step.start.clone());
    plan.steps.iter().map(step).collect()
}

/// What the thread answers is what the planner would have answered, and nobody asks that one again.
#[test]
fn a_plan_that_was_made_ahead_is_the_one_that_would_have_been_made() {
    let ((spec, task), asked) = (delivery(), AtomicUsize::new(0));
    let situation = Situation::initial(&task);
    let mut ahead = Ahead::new(
        Box::new(Asked(&asked)),
        &spec,
        &aside(&Interrupt::default()),
    );
    ahead.expect(&task, &situation);
    let made = steps(ahead.plan(&task, &situation).answer);
    assert_eq!(asked.load(Ordering::SeqCst), 0);
    assert_eq!(
        made,
        steps(Embedded::default().plan(&task, &situation).answer)
    );
    // It was made for once: the next time, the planner is asked.
    assert_eq!(made, steps(ahead.plan(&task, &situation).answer));
    assert_eq!(asked.load(Ordering::SeqCst), 1);
}

/// A plan for what did not come about is not taken, and neither is one that was interrupted.
#[test]
fn a_plan_that_was_made_for_something_else_is_not_taken() {
    let ((spec, task), asked) = (delivery(), AtomicUsize::new(0));
    let situation = Situation::initial(&task);
    let mut later = situation.clone();
    later.time = Rational::from(1);
    let interrupt = Interrupt::default();
    let mut ahead = Ahead::new(Box::new(Asked(&asked)), &spec, &aside(&interrupt));
    ahead.expect(&task, &later);
    assert!(!steps(ahead.plan(&task, &situation).answer).is_empty());
    assert_eq!(asked.load(Ordering::SeqCst), 1);
    // Only the last expectation counts.
    ahead.expect(&task, &situation);
    ahead.expect(&task, &later);
    assert!(!steps(ahead.plan(&task, &situation).answer).is_empty());
    assert_eq!(asked.load(Ordering::SeqCst), 2);
    interrupt.request();
    ahead.expect(&task, &situation);
    assert!(!steps(ahead.plan(&task, &situation).answer).is_empty());
    assert_eq!(asked.load(Ordering::SeqCst), 3);
}

/// The bell rings for what was begun, and not for what was begun ahead or given up; what is collected
/// is what would have been waited for.
#[test]
fn the_bell_rings_for_what_was_begun() {
    let ((spec, task), asked) = (delivery(), AtomicUsize::new(0));
    let situation = Situation::initial(&task);
    let aside = aside(&Interrupt::default());
    let long = std::time::Duration::from_secs(60);
    let mut ahead = Ahead::new(Box::new(Asked(&asked)), &spec, &aside);
    ahead.expect(&task, &situation);
    assert!(!aside.bell.is_awaited());
    for _ in 0..2 {
        // The first time it is the one that was begun ahead.
        assert!(ahead.begin(&task, &situation));
        aside.bell.wait(long);
        assert_eq!(aside.bell.heard(), Some(Ring::PlanMade));
        let made = steps(ahead.collect(&task, &situation).answer);
        assert_eq!(
            made,
            steps(Embedded::default().plan(&task, &situation).answer)
        );
    }
    assert!(ahead.begin(&task, &situation));
    ahead.give_up();
    assert!(!aside.bell.is_awaited() && aside.bell.heard().is_none());
    assert_eq!(asked.load(Ordering::SeqCst), 0);
}

/// A search that takes more memory than it may says so. (Where the system does not tell, there is no
/// limit.)
#[test]
fn a_search_that_takes_too_much_memory_says_so() {
    let ((spec, task), asked) = (delivery(), AtomicUsize::new(0));
    let mut situation = Situation::initial(&task);
    // Nothing can be reached without the parcel, but much can be tried out.
    situation.state.facts.clear();
    let aside = Aside {
        most_memory: Some(0),
        ..aside(&Interrupt::default())
    };
    let mut ahead = Ahead::new(Box::new(Asked(&asked)), &spec, &aside);
    assert!(ahead.begin(&task, &situation));
    let answer = ahead.collect(&task, &situation).answer;
    assert!(!matches!(answer, PlanAnswer::Plan(_)), "{answer:?}");
}
