//! Planners that hang, crash, exhaust memory, print garbage or wrong plans. Each has the right
//! outcome, and no process or file is left.
#![cfg(unix)]

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use crate::skipped::skipped;
use elbowroom_external::{Ending, Event, Outcome, Planner, Report, Request, Settings, plan};
use elbowroom_model::{Problem, Situation, Task};
use elbowroom_num::{Interval, Rational};
use elbowroom_pddl::{Source, read_plan, read_problem, write_plan};

const DOMAIN: &str = "(define (domain shop)
    (:predicates (open) (sold) (clean))
    (:durative-action sell :duration (= ?duration 5)
      :condition (at end (open)) :effect (at end (sold)))
    (:durative-action sweep :duration (= ?duration 3)
      :effect (and (at start (not (clean))) (at end (clean)))))";

const PROBLEM: &str = "(define (problem day) (:domain shop)
    (:init (open) (at 30 (not (open)))) (:goal (sold)))";

/// Result of a fake planner.
struct Run {
    report: Report,
    /// For each event about a plan, its makespan or `refused`.
    events: Vec<String>,
    /// The plan found, as text.
    plan: Option<String>,
}

/// Returns a unique word for the command lines of one fake planner's processes.
fn tag() -> String {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    // Digits can be appended to the decimal point in an argument of `sleep`.
    format!("{}{count:03}", std::process::id())
}

/// Runs a shell script as a planner. `$TAG` in it is a unique word, used to find remaining
/// processes afterwards.
fn run(script: &str, seconds: u64) -> Run {
    run_with(script, |settings| {
        settings.time_limit = Some(Duration::from_secs(seconds));
    })
}

fn run_with(script: &str, set: impl FnOnce(&mut Settings)) -> Run {
    let tag = tag();
    let folder = tempfile::tempdir().expect("a folder");
    let script_file = folder.path().join("fake.sh");
    fs::write(&script_file, script.replace("$TAG", &tag)).expect("a script");
    let line = format!(
        "sh '{}' {{domain}} {{problem}} {{plan}}",
        script_file.display()
    );
    let scratch = folder.path().join("scratch");
    fs::create_dir(&scratch).expect("a folder");
    let mut settings = Settings {
        scratch: Some(scratch.clone()),
        ..Settings::default()
    };
    set(&mut settings);
    let run = run_line(&line, &settings, &mut |_| ControlFlow::Continue(()));
    assert_eq!(left_running(&tag), [""; 0], "left running");
    let left_on_disk = fs::read_dir(&scratch).expect("the folder");
    assert_eq!(left_on_disk.count(), 0, "left on disk");
    run
}

/// Reads the problem of the two texts.
fn problem_of(domain: &Source, problem: &Source) -> Problem {
    read_problem(domain, problem).expect("they are right").0
}

fn run_line(
    line: &str,
    settings: &Settings,
    observe: &mut dyn FnMut(&Event<'_>) -> ControlFlow<()>,
) -> Run {
    let domain = Source::new("shop.pddl", DOMAIN);
    let problem = Source::new("day.pddl", PROBLEM);
    let task = Task::new(problem_of(&domain, &problem));
    let situation = Situation::initial(&task);
    let mut request = Request {
        task: &task,
        situation: &situation,
        domain: &domain,
        problem: &problem,
    };
    let mut events = Vec::new();
    let report = plan(
        &Planner::named(line).expect("a command line"),
        &mut request,
        settings,
        &mut |_, _| None,
        &mut |event| {
            match event {
                Event::Plan { found, .. } => events.push(found.makespan.to_decimal(3)),
                Event::Refused { .. } => events.push("refused".to_owned()),
                Event::Running { .. } => {}
            }
            observe(event)
        },
    );
    let plan = report
        .outcome
        .found()
        .map(|found| write_plan(&task, &found.plan));
    Run {
        report,
        events,
        plan,
    }
}

/// Returns the command lines of processes that contain the word.
fn left_running(tag: &str) -> Vec<String> {
    let Ok(entries) = fs::read_dir("/proc") else {
        return Vec::new();
    };
    let command_line = |path: &Path| {
        let bytes = fs::read(path.join("cmdline")).unwrap_or_default();
        String::from_utf8_lossy(&bytes).replace('\0', " ")
    };
    entries
        .flatten()
        .map(|entry| command_line(&entry.path()))
        .filter(|line| line.contains(tag))
        .collect()
}

fn has_proc() -> bool {
    let is_there = Path::new("/proc/self/stat").exists();
    if !is_there {
        skipped("there is no /proc here");
    }
    is_there
}

#[test]
fn plan_of_successful_planner_is_returned() {
    let run = run(
        "echo noise; echo '0.5: (SELL) [5.000]'; echo more noise",
        30,
    );
    assert_eq!(run.plan.as_deref(), Some("0.500: (sell) [5.000]\n"));
    assert_eq!(run.events, ["5.5"]);
    let statistics = run.report.statistics;
    assert_eq!((statistics.plans, statistics.refused), (1, 0));
    assert_eq!(statistics.ending, Some(Ending::Exited(0)));
}

#[test]
fn planner_receives_original_texts() {
    let run = run("cat \"$1\"; cat \"$2\" >&2; exit 3", 30);
    let Outcome::NotUnderstood { code, excerpt } = run.report.outcome else {
        panic!("{:?}", run.report.outcome);
    };
    assert_eq!((code, excerpt.as_str()), (3, PROBLEM));
}

#[test]
fn each_plan_is_reported_and_last_is_returned() {
    let script = "echo '; Plan found with metric 20'; echo '15: (sell) [5]'; echo
        echo '; Plan found with metric 9'; echo '4: (sell) [5]'; echo
        sleep 0.2; printf '0: (sell) [5]\n' > \"$3.2\"";
    let run = run(script, 30);
    assert_eq!(run.plan.as_deref(), Some("0.000: (sell) [5.000]\n"));
    assert_eq!(run.events, ["20", "9", "5"]);
}

#[test]
fn plan_file_is_read_as_soon_as_it_exists() {
    let script =
        "echo '0: (sell) [5]' > \"$3\"; echo '1: (sell) [5]' > \"$3_1.SOL\"; sleep 999.$TAG";
    let script = script.replace("$3_1", "${3}_1");
    let run = run(&script, 1);
    assert_eq!(run.report.statistics.plans, 2);
    assert_eq!(run.report.statistics.ending, Some(Ending::TimeLimit));
    assert!(run.report.statistics.first_plan.unwrap() < Duration::from_millis(900));
}

#[test]
fn hanging_planner_is_killed_with_children() {
    let script = "trap '' TERM INT HUP
        (trap '' TERM; sleep 999.$TAG; sleep 998.$TAG) & (sleep 997.$TAG &) 
        while :; do sleep 996.$TAG; done";
    let run = run(script, 1);
    assert_eq!(run.report.outcome, Outcome::NoneInTime);
    let elapsed = run.report.statistics.elapsed;
    assert!(elapsed >= Duration::from_secs(1), "{elapsed:?}");
}

#[test]
fn children_that_leave_the_group_are_found() {
    if !has_proc() || !Path::new("/usr/bin/setsid").exists() {
        skipped("this needs /proc and setsid");
        return;
    }
    // A process with its own session whose parent is gone; only its environment identifies it.
    let script = "setsid sh -c '(setsid sleep 999.$TAG &) ; exit' & wait; sleep 0.2; exit 1";
    let run = run(script, 30);
    assert_eq!(run.report.outcome.name(), "not understood");
}

#[test]
fn successful_planner_leaves_no_processes() {
    let run = run("sleep 999.$TAG & echo '0: (sell) [5]'", 30);
    assert!(run.plan.is_some());
    assert!(run.report.statistics.elapsed < Duration::from_secs(20));
}

#[test]
fn crash_is_reported_with_signal() {
    let outcome = run("echo 'about to fall' >&2; kill -SEGV $$", 30)
        .report
        .outcome;
    assert_eq!(outcome.to_string(), "it crashed (SIGSEGV)");
    let Outcome::Crashed { excerpt, .. } = outcome else {
        panic!("{outcome:?}");
    };
    assert_eq!(excerpt, "about to fall");
    // A wrapper script that reports the crash of its child by its exit code.
    let outcome = run("sh -c 'kill -ABRT $$'; exit $?", 30).report.outcome;
    assert_eq!(outcome.to_string(), "it crashed (SIGABRT)");
}

#[test]
fn plan_printed_before_crash_is_accepted() {
    let run = run("echo '0: (sell) [5]'; kill -SEGV $$", 30);
    assert_eq!(run.events, ["5"]);
    assert_eq!(run.report.statistics.ending, Some(Ending::Signalled(11)));
}

#[test]
fn planner_over_memory_limit_is_killed() {
    if !has_proc() {
        return;
    }
    // `tail` keeps the last line, and /dev/zero has no end of line.
    let run = run_with("tail /dev/zero & tail /dev/zero & wait", |settings| {
        settings.memory_limit = Some(64 << 20);
        settings.time_limit = Some(Duration::from_secs(60));
    });
    assert_eq!(
        run.report.outcome.name(),
        "out of memory",
        "{:?}",
        run.report
    );
    assert!(run.report.statistics.elapsed < Duration::from_secs(50));
}

#[test]
fn out_of_memory_message_is_outcome() {
    let script = "echo \"terminate called after throwing an instance of 'std::bad_alloc'\" >&2
        kill -ABRT $$";
    assert_eq!(run(script, 30).report.outcome.name(), "out of memory");
}

#[test]
fn endless_output_is_truncated() {
    for script in [
        "yes 'states evaluated: 1000000000'",
        "cat /dev/zero",
        "cat /dev/urandom",
        "yes '0.0: (sell) [' >&2",
        "yes '(a b c)'",
        "yes '0: (sell) [5] 0: (sell) [5]' | tr -d '\\n'",
    ] {
        let run = run(script, 1);
        assert_eq!(run.report.outcome.name(), "none in time", "{script}");
        assert!(run.report.statistics.printed > 1 << 20, "{script}");
        let elapsed = run.report.statistics.elapsed;
        assert!(elapsed < Duration::from_secs(20), "{script}: {elapsed:?}");
    }
}

#[test]
fn endless_plans_respect_time_limit() {
    let run = run(
        "while :; do echo '0: (sell) [5]'; echo '; Plan found'; done",
        1,
    );
    assert_eq!(run.events, ["5"]);
    assert_eq!(run.report.statistics.ending, Some(Ending::TimeLimit));
}

#[test]
fn invalid_plan_has_own_outcome() {
    let run = run("echo '28: (sell) [5]'", 30);
    assert_eq!(run.events, ["refused"]);
    let Outcome::Refused { reason, plan } = run.report.outcome else {
        panic!("{:?}", run.report.outcome);
    };
    assert!(reason.contains("(open) is false since"), "{reason}");
    assert_eq!(plan, "28: (sell) [5]\n");
    assert_eq!(run.plan, None);
}

#[test]
fn a_plan_of_unknown_actions_is_not_understood() {
    let run = run("echo '28: (steal) [5]'", 30);
    assert_eq!(run.events, ["refused"]);
    let Outcome::NotUnderstood { excerpt, .. } = run.report.outcome else {
        panic!("{:?}", run.report.outcome);
    };
    assert!(excerpt.contains("unknown action `steal`"), "{excerpt}");
}

#[test]
fn a_valid_plan_counts_although_others_were_refused() {
    let run = run(
        "echo '0: (sell) [5]'; echo; echo noise; echo '28: (sell) [5]'",
        30,
    );
    assert_eq!(run.events, ["5", "refused"]);
    assert_eq!(run.plan.as_deref(), Some("0.000: (sell) [5.000]\n"));
}

#[test]
fn exit_messages_determine_outcome() {
    let name = |script: &str| run(script, 30).report.outcome.name();
    assert_eq!(name("echo ';; Problem unsolvable!'; exit 1"), "unsolvable");
    assert_eq!(name("echo 'search limit exceeded.'"), "gave up");
    assert_eq!(
        name("echo 'error: :constraints are not supported' >&2; exit 1"),
        "unsupported"
    );
    assert_eq!(name("true"), "not understood");
    assert_eq!(name("exit 7"), "not understood");
}

#[test]
fn unsolvable_message_before_hang_is_outcome() {
    let run = run("echo ';; Problem unsolvable!'; sleep 999.$TAG", 1);
    assert_eq!(run.report.outcome.name(), "unsolvable");
}

#[test]
fn missing_planner_is_reported() {
    let settings = Settings::default();
    let mut go_on = |_: &Event<'_>| ControlFlow::Continue(());
    let run = run_line("no-such-planner {domain} {problem}", &settings, &mut go_on);
    assert_eq!(
        run.report.outcome.to_string(),
        "it cannot be started: there is no program no-such-planner"
    );
}

#[test]
fn observer_can_stop_planner() {
    let settings = Settings::default();
    let line = "sh -c 'echo \"0: (sell) [5]\"; echo x; sleep 999' {domain} {problem}";
    let mut until_plan = |event: &Event<'_>| match event {
        Event::Plan { .. } => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    let run = run_line(line, &settings, &mut until_plan);
    assert!(run.plan.is_some());
    assert_eq!(run.report.statistics.ending, Some(Ending::Stopped));
    let mut at_once = |_: &Event<'_>| ControlFlow::Break(());
    let line = "sh -c 'sleep 999' {domain} {problem}";
    let run = run_line(line, &settings, &mut at_once);
    assert_eq!(run.report.outcome, Outcome::Stopped);
}

#[test]
fn panicking_observer_leaves_no_processes() {
    let tag = tag();
    let line = format!("sh -c 'sleep 999.{tag}; sleep 998.{tag}' {{domain}} {{problem}}");
    let panicked = std::panic::catch_unwind(|| {
        run_line(&line, &Settings::default(), &mut |_| panic!("enough"))
    });
    assert!(panicked.is_err());
    assert_eq!(left_running(&tag), [""; 0]);
}

#[test]
fn repaired_plan_is_validated_again() {
    let domain = Source::new("shop.pddl", DOMAIN);
    let problem = Source::new("day.pddl", PROBLEM);
    let task = Task::new(problem_of(&domain, &problem));
    let situation = Situation::initial(&task);
    let name = |good: bool| {
        let mut request = Request {
            task: &task,
            situation: &situation,
            domain: &domain,
            problem: &problem,
        };
        let report = plan(
            &Planner::named("sh -c 'echo \"28: (sell) [5]\"' {domain} {problem}").unwrap(),
            &mut request,
            &Settings::default(),
            &mut |_, plan| {
                let mut plan = plan.clone();
                plan.steps[0].start = Rational::from(if good { 3 } else { 27 });
                Some(plan)
            },
            &mut |_| ControlFlow::Continue(()),
        );
        match report.outcome {
            Outcome::Plan(found) => found.repaired.expect("it was repaired"),
            other => other.name().to_owned(),
        }
    };
    assert!(name(true).contains("(open) is false"));
    assert_eq!(name(false), "refused");
}

#[test]
fn mid_execution_problem_is_rewritten_and_plan_shifted() {
    let domain = Source::new("shop.pddl", DOMAIN);
    let text = PROBLEM.replace("(:goal (sold))", "(:goal (and (sold) (clean)))");
    let problem = Source::new("day.pddl", text);
    let task = Task::new(problem_of(&domain, &problem));
    let (sweep, _) = read_plan(&Source::new("p", "19: (sweep) [3]"), &task).unwrap();
    let step = &sweep.steps[0];
    let situation = Situation {
        time: Rational::from(20),
        state: task.initial().clone(),
        running: vec![elbowroom_model::RunningAction {
            action: step.action.clone(),
            start: step.start.clone(),
            duration: Interval::point(Rational::from(3)),
        }],
    };
    let mut request = Request {
        task: &task,
        situation: &situation,
        domain: &domain,
        problem: &problem,
    };
    // It prints a plan only if the problem contains the deadline and the end of the sweeping,
    // relative to now.
    let script = "grep -q '(at 10 (not (open)))' \"$1\" && grep -q '(at 2 (clean))' \"$1\" &&
        echo '1: (sell) [5]'";
    let line = format!(
        "sh -c '{}' {{domain}} {{problem}}",
        script.replace('\'', "'\\''")
    );
    let report = plan(
        &Planner::named(&line).unwrap_or_else(|error| panic!("{line}: {error}")),
        &mut request,
        &Settings::default(),
        &mut |_, _| None,
        &mut |_| ControlFlow::Continue(()),
    );
    let found = report
        .outcome
        .found()
        .unwrap_or_else(|| panic!("{report:?}"));
    assert_eq!(
        write_plan(&task, &found.plan),
        "19.000: (sweep) [3.000]\n21.000: (sell) [5.000]\n"
    );
    assert_eq!(found.makespan, Rational::from(26));
}
