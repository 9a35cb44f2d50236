//! Plans from situations at wall-clock times: fractions with many digits, which lie on no grid.

use std::path::Path;

use elbowroom::execute::Embedded;
use elbowroom::execution::{PlanAnswer, Planner as _};
use elbowroom::model::validate::Settings;
use elbowroom::model::{RunningAction, Situation, Task, validate_from};
use elbowroom::num::{Interval, Rational};
use elbowroom::pddl::{Source, read_problem};

/// Returns the task of `cases/delivery`.
fn delivery() -> Task {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/delivery");
    let source = |file: &str| {
        let text = std::fs::read_to_string(folder.join(file)).expect("a file of the case");
        Source::new(file, text)
    };
    let read = read_problem(&source("domain.pddl"), &source("problem.pddl"));
    Task::new(read.expect("a case without mistakes").0)
}

/// Returns a situation at `time` with these facts and running actions: name, start and bounds of
/// the duration.
fn situation(
    task: &Task,
    time: &str,
    facts: &[&str],
    running: &[(&[&str], &str, &str, &str)],
) -> Situation {
    let number = |text: &str| text.parse::<Rational>().expect("a number");
    let mut situation = Situation::initial(task);
    situation.time = number(time);
    let ids = facts
        .iter()
        .map(|name| task.fact_named(name).expect("a fact"));
    situation.state.facts = ids.collect();
    for (words, start, least, most) in running {
        let schema = task.problem().schema(words[0]).expect("an action");
        let objects = words[1..].iter();
        let objects: Vec<_> = objects
            .map(|word| task.problem().object(word).expect("an object"))
            .collect();
        situation.running.push(RunningAction {
            action: task
                .instantiate(schema, &objects)
                .expect("these suit")
                .into(),
            start: number(start),
            duration: Interval::closed(number(least), number(most)),
        });
    }
    situation
}

fn assert_solved(task: &Task, situation: &Situation) {
    let answer = Embedded::default().plan(task, situation).answer;
    let PlanAnswer::Plan(plan) = answer else {
        panic!("{answer:?} from {situation:?}");
    };
    let verdict = validate_from(task, situation, &plan, &Settings::default());
    assert!(verdict.is_valid(), "{verdict:?}");
}

#[test]
fn action_started_between_ticks_is_supported_in_replanning() {
    let task = delivery();
    let facts = ["(lies parcel shelf)", "(counter-open office)"];
    let drive: (&[&str], _, _, _) = (
        &["drive", "rover", "depot", "shelf"],
        "2741813659667969/5000000000000000000",
        "10",
        "10",
    );
    let unlock: (&[&str], _, _, _) = (
        &["unlock", "office"],
        "3921031951904297/50000000000000000",
        "6",
        "6",
    );
    let time = "16161782836914063/100000000000000000";
    assert_solved(&task, &situation(&task, time, &facts, &[drive, unlock]));
    assert_solved(&task, &situation(&task, time, &facts, &[drive]));
}

#[test]
fn action_duration_between_ticks_is_supported_in_replanning() {
    let task = delivery();
    let facts = [
        "(carries rover parcel)",
        "(unlocked office)",
        "(counter-open office)",
    ];
    let words: &[&str] = &["drive", "rover", "shelf", "office"];
    let start = "13562901020050049/500000000000000";
    let time = "105326625289917/2500000000000";
    for duration in [
        "7502424037933351/400000000000000",
        "7502924037933351/500000000000000",
        "20",
    ] {
        let running = (words, start, duration, duration);
        assert_solved(&task, &situation(&task, time, &facts, &[running]));
    }
    // One of several durations, whose first tick is after the last one.
    let most = "18756060094833377/1000000000000000";
    let running = (words, start, "18.75606009483337", most);
    assert_solved(&task, &situation(&task, time, &facts, &[running]));
}
