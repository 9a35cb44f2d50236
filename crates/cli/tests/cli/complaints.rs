//! Typical complaints about plan executors: one test for each row of `docs/reference/complaints.md`, with a
//! small scenario like that of the thread and the behaviour of this executor.

mod toy;

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{self, Command, Stdio};

use crate::command::{elbowroom, root};
use elbowroom::execute::Execution;
use elbowroom::execution::run::{ExecutedStep, RunSettings, Verdict};
use elbowroom::execution::{Cause, Ending, Event, GoalTerms, Observation, Request};
use elbowroom::num::Rational;
use toy::{ERRANDS, Fault, Faults, Toy, Warnings, causes, errands, run, task};

const MATCH: [&str; 2] = ["cases/match/domain.pddl", "cases/match/problem.pddl"];
const DELIVERY: [&str; 2] = ["cases/delivery/domain.pddl", "cases/delivery/problem.pddl"];
const PLAN: &str = "cases/delivery/plan.plan";

fn json(arguments: &[&str]) -> serde_json::Value {
    let done = elbowroom(arguments);
    let text = String::from_utf8_lossy(&done.stdout).into_owned();
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}: {done:?}"))
}

/// A file that no other test uses.
fn temporary(name: &str) -> String {
    let name = format!("elbowroom-complaints-{}-{name}", process::id());
    std::env::temp_dir().join(name).display().to_string()
}

#[test]
fn parallel_actions_overlap_as_the_plan_requires() {
    let outcome = json(&[&["run"], &MATCH[..], &["--json"]].concat());
    assert_eq!(outcome["verdict"], "goal-reached", "{outcome:#}");
    let spans = outcome["executed"]
        .as_array()
        .expect("steps")
        .iter()
        .map(|step| {
            let start = step["start"]["decimal"].as_f64().expect("a number");
            let duration = step["duration"]["decimal"].as_f64().expect("a number");
            (
                step["action"].as_str().expect("a name").to_owned(),
                start,
                start + duration,
            )
        });
    let spans: Vec<_> = spans.collect();
    let burns: Vec<_> = spans
        .iter()
        .filter(|it| it.0.starts_with("(burn"))
        .collect();
    let inspections: Vec<_> = spans
        .iter()
        .filter(|it| it.0.starts_with("(inspect"))
        .collect();
    assert!(!inspections.is_empty());
    for inspection in inspections {
        let is_lit = |burn: &&&(String, f64, f64)| burn.1 < inspection.1 && inspection.2 < burn.2;
        assert!(burns.iter().any(|burn| is_lit(&burn)), "{spans:?}");
    }

    // Instantaneous actions start at their planned times, and not all at once.
    let domain = ERRANDS.replacen(
        "(:durative-action",
        "(:action label :parameters (?x - item) :precondition (have ?x) :effect (labelled ?x))
    (:durative-action",
        1,
    );
    let domain = domain.replacen(
        "(have ?x - item)",
        "(have ?x - item) (labelled ?x - item)",
        1,
    );
    let problem = "(define (problem day) (:domain errands) (:objects r - robot book cup - item)
        (:init (free r) (here book) (here cup)) (:goal (and (labelled book) (labelled cup))))";
    let report = run(&task(&domain, problem), &mut Toy::default());
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:?}");
    let labels = report.executed.iter().map(|it| &it.step);
    let labels: Vec<_> = labels
        .filter(|it| it.action.name.starts_with("(label"))
        .collect();
    assert_eq!(labels.len(), 2, "{report:?}");
    let fetched = |item: &str| {
        let steps = report.executed.iter().map(|it| &it.step);
        let mut own = steps.filter(|it| it.action.name == format!("(fetch r {item})"));
        let own = own.next().expect("it was fetched");
        &own.start + own.duration.as_ref().expect("it takes time")
    };
    for label in labels {
        let items = ["book", "cup"].into_iter();
        let mut own = items.filter(|item| label.action.name.contains(item));
        let item = own.next().expect("it is labelled");
        assert!(label.start >= fetched(item), "{report:?}");
    }
}

#[test]
fn silent_performer_times_out_and_the_run_reports_it() {
    let task = errands("(have book)");
    let mut world = Toy {
        fault: Some(|_| Fault::Silent),
        ..Toy::default()
    };
    let report = run(&task, &mut world);
    assert_ne!(report.verdict, Verdict::GoalReached);
    assert!(
        causes(&report).contains(&Cause::Silence),
        "{:?}",
        report.reasons
    );
    assert!(
        report
            .reasons
            .iter()
            .any(|it| it.to_string().contains("(fetch "))
    );
    assert!(world.open.is_empty(), "nothing is left running");
    // If the plan imposes a limit, waiting ends there, and the alternative action is executed in
    // time.
    let domain = "(define (domain ways) (:requirements :durative-actions :timed-initial-literals)
        (:predicates (path) (open) (there))
        (:durative-action walk :parameters () :duration (= ?duration 2)
          :condition (over all (path)) :effect (at end (there)))
        (:durative-action ride :parameters () :duration (= ?duration 30)
          :condition (over all (open)) :effect (at end (there))))";
    let problem = "(define (problem p) (:domain ways)
        (:init (path) (open) (at 20 (not (path))) (at 60 (not (open)))) (:goal (there)))";
    let mut world = Toy {
        fault: Some(|ticket| {
            if ticket == 0 {
                Fault::Silent
            } else {
                Fault::None
            }
        }),
        ..Toy::default()
    };
    let report = run(&self::task(domain, problem), &mut world);
    assert_eq!(report.verdict, Verdict::GoalReached, "{:?}", report.reasons);
    assert_eq!(report.starts, 2, "{:?}", report.reasons);
    assert!(report.time < Rational::from(60), "{}", report.time);
}

#[test]
fn late_action_is_awaited_while_the_plan_tolerates_it() {
    let domain = "(define (domain late) (:requirements :durative-actions :timed-initial-literals)
        (:predicates (open) (there) (tried))
        (:durative-action walk :parameters () :duration (= ?duration 10)
          :condition (and (at start (not (tried))) (over all (open)))
          :effect (and (at start (tried)) (at end (there))))
        (:durative-action ride :parameters () :duration (= ?duration 3)
          :condition (and (at start (tried)) (over all (open))) :effect (at end (there))))";
    let problem = "(define (problem p) (:domain late) (:init (open) (at 20 (not (open))))
        (:goal (there)))";
    let task = task(domain, problem);
    // Lateness within the guarantee does not cause a new plan.
    let mut world = Toy {
        fault: Some(|ticket| {
            if ticket == 0 {
                Fault::Lasts(15)
            } else {
                Fault::None
            }
        }),
        ..Toy::default()
    };
    let report = run(&task, &mut world);
    assert_eq!(
        (&report.verdict, report.replans),
        (&Verdict::GoalReached, 0)
    );
    // Neither does a slightly late start. A warning precedes the need for a new plan.
    let mut world = Toy {
        fault: Some(|_| Fault::StartsLate(1, 19)),
        ..Toy::default()
    };
    let warnings = Warnings::default();
    let settings = RunSettings {
        monitors_slack: true,
        ..RunSettings::default()
    };
    let execution = Execution::of(&task).with_settings(settings);
    let report = execution.recorded_by(warnings.clone()).run_in(&mut world);
    assert_eq!(
        (&report.verdict, report.replans),
        (&Verdict::GoalReached, 0),
        "{:?}",
        report.reasons
    );
    let warnings = warnings.0.lock().expect("no thread has panicked");
    let [(action, until)] = &warnings[..] else {
        panic!("{warnings:?}");
    };
    assert_eq!(action, "(walk)");
    assert!(
        *until > Rational::from(19) && *until <= Rational::from(20),
        "{until}"
    );
    // An action that never ends is detected in time, not after minutes.
    let mut world = Toy {
        fault: Some(|ticket| {
            if ticket == 0 {
                Fault::Lasts(9999)
            } else {
                Fault::None
            }
        }),
        ..Toy::default()
    };
    let report = run(&task, &mut world);
    assert!(
        report.time <= Rational::from(26),
        "{}: {:?}",
        report.time,
        report.reasons
    );
    let is_late = |cause: &Cause| matches!(cause, Cause::Outlived | Cause::GuaranteeLost);
    assert!(causes(&report).iter().any(is_late), "{:?}", report.reasons);
}

#[test]
fn failure_causes_automatic_replanning() {
    let task = errands("(have book)");
    let mut world = Toy {
        fault: Some(|ticket| {
            if ticket == 0 {
                Fault::Fails
            } else {
                Fault::None
            }
        }),
        ..Toy::default()
    };
    // The world reports that the robot with the failed errand is free again.
    let free = |name: &str| {
        let fact = task.fact_named(name).expect("a correct test");
        Event::Fact { fact, truth: true }
    };
    world.seen = vec![free("(free r)"), free("(free s)")];
    let report = run(&task, &mut world);
    assert_eq!(
        (&report.verdict, report.replans),
        (&Verdict::GoalReached, 1)
    );
    assert_eq!(causes(&report), [Cause::Failed]);
}

#[test]
fn hopeless_run_stops_early_with_time_and_reason() {
    let task = errands("(and (have book) (have cup))");
    let gone = |name: &str| {
        let fact = task.fact_named(name).expect("a correct test");
        let event = Event::Fact { fact, truth: false };
        Observation {
            time: Rational::ZERO,
            event,
        }
    };
    let mut world = Toy {
        fault: Some(|_| Fault::Fails),
        coming: vec![gone("(here cup)")],
        ..Toy::default()
    };
    let report = run(&task, &mut world);
    assert_eq!(report.verdict, Verdict::Unsolvable, "{report:?}");
    let why: Vec<String> = report.dead_end.iter().map(ToString::to_string).collect();
    let words = "(have cup) can never become true again, since 10";
    assert!(
        why.iter()
            .any(|why| why.contains(words) && why.contains("slips")),
        "{why:?}"
    );
    assert!(world.open.is_empty());
}

#[test]
fn pause_starts_nothing_and_stop_cancels_running_actions() {
    // With one robot, the errands are sequential.
    let problem = "(define (problem day) (:domain errands) (:objects r - robot book cup key - item)
        (:init (free r) (here book) (here cup) (here key))
        (:goal (and (have book) (have cup) (have key))))";
    let task = task(ERRANDS, problem);
    let asked = |time: i64, request: Request| Observation {
        time: time.into(),
        event: Event::Requested(request),
    };
    let (name, goal) = ("again".to_owned(), "(not (here cup))".to_owned());
    let mut world = Toy {
        coming: vec![
            asked(0, Request::Pause),
            asked(100, Request::Resume),
            asked(105, Request::Pause),
            asked(200, Request::Resume),
            asked(
                205,
                Request::Pursue {
                    name,
                    goal,
                    terms: GoalTerms::default(),
                },
            ),
        ],
        ..Toy::default()
    };
    let settings = RunSettings {
        time_limit: Rational::from(207),
        ..RunSettings::default()
    };
    let report = Execution::of(&task)
        .with_settings(settings)
        .persistent(true)
        .run_in(&mut world);
    for done in &report.executed {
        let start = &done.step.start;
        let is_in_a_pause = |from: i64, to: i64| *start > from.into() && *start < to.into();
        assert!(
            !is_in_a_pause(0, 100) && !is_in_a_pause(105, 200),
            "{done:?}"
        );
    }
    // Running actions continue during a pause. Actions that run at the end are cancelled and have
    // stopped.
    let (last, others) = report.executed.split_last().expect("something was done");
    assert_eq!(last.ending, Some(Ending::Cancelled), "{report:?}");
    let has_succeeded = |done: &ExecutedStep| done.ending == Some(Ending::Succeeded);
    assert!(others.iter().all(has_succeeded), "{report:?}");
    let runs_on = |done: &ExecutedStep| {
        let end = &done.step.start + done.step.duration.clone().unwrap_or_default();
        done.step.start < Rational::from(105) && end > Rational::from(105)
    };
    assert!(others.iter().any(runs_on), "{report:?}");
    assert!(world.open.is_empty());
    // The run waits until a robot that stops slowly has stopped, whether it ends by the time limit,
    // for lack of a plan, or on request.
    let ends: [(Rational, Option<Faults>); 2] = [
        (Rational::from(5), None),
        (
            Rational::from(1000),
            Some(|ticket| {
                if ticket == 0 {
                    Fault::Fails
                } else {
                    Fault::None
                }
            }),
        ),
    ];
    for (time_limit, fault) in ends {
        let settings = RunSettings {
            time_limit,
            max_replans: 0,
            ..RunSettings::default()
        };
        let mut world = Toy {
            slides: 3,
            fault,
            ..Toy::default()
        };
        let two = errands("(and (have book) (have cup))");
        let report = Execution::of(&two)
            .with_settings(settings)
            .run_in(&mut world);
        assert_ne!(report.verdict, Verdict::GoalReached, "{report:?}");
        assert!(world.open.is_empty(), "{report:?}");
        let is_over = |done: &ExecutedStep| done.ending.is_some();
        assert!(report.executed.iter().all(is_over), "{report:?}");
    }
    // The run waits for a robot that never confirms its stop, but only for 5 s.
    let settings = RunSettings {
        time_limit: Rational::from(5),
        ..RunSettings::default()
    };
    let mut world = Toy {
        slides: 1_000_000,
        ..Toy::default()
    };
    let one = errands("(have book)");
    let report = Execution::of(&one)
        .with_settings(settings)
        .run_in(&mut world);
    assert_eq!(report.verdict, Verdict::TimeLimit, "{report:?}");
    assert_eq!(report.time, Rational::from(10), "{report:?}");
}

#[test]
fn expected_effects_are_compared_with_observations() {
    let task = errands("(have book)");
    let have = task.fact_named("(have book)").expect("a correct test");
    let mut world = Toy {
        // The action reports success, but its effect is missing.
        seen: vec![Event::Fact {
            fact: have,
            truth: false,
        }],
        ..Toy::default()
    };
    let report = run(&task, &mut world);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:?}");
    assert_eq!(
        (report.starts, report.replans),
        (2, 1),
        "{:?}",
        report.reasons
    );
    // Over-all conditions are monitored: the other way is used once the path is gone.
    let domain = "(define (domain ways) (:requirements :durative-actions)
        (:predicates (path) (there))
        (:durative-action walk :parameters () :duration (= ?duration 10)
          :condition (over all (path)) :effect (at end (there)))
        (:durative-action ride :parameters () :duration (= ?duration 30) :condition ()
          :effect (at end (there))))";
    let problem = "(define (problem p) (:domain ways) (:init (path)) (:goal (there)))";
    let task = self::task(domain, problem);
    let fact = task.fact_named("(path)").expect("a correct test");
    let mut world = Toy {
        coming: vec![Observation {
            time: 4.into(),
            event: Event::Fact { fact, truth: false },
        }],
        ..Toy::default()
    };
    let report = run(&task, &mut world);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:?}");
    let done: Vec<_> = report.executed.iter().map(|it| &it.step).collect();
    assert_eq!(done[0].duration, Some(Rational::from(4)), "{report:?}");
    assert_eq!(done[1].action.name, "(ride)");
    assert_eq!(causes(&report), [Cause::Surprise]);
}

#[test]
fn plan_and_progress_are_visible_during_the_run() {
    let trace = temporary("seen.jsonl");
    let page = temporary("seen.html");
    let done = elbowroom(&[&["run"], &DELIVERY[..], &["--trace", &trace]].concat());
    assert!(done.status.success(), "{done:?}");
    let done = elbowroom(&["report", &trace, "-o", &page]);
    assert!(done.status.success(), "{done:?}");
    let text = fs::read_to_string(&page).expect("a page");
    for words in ["drive rover depot shelf", "was due", "Events and reasons"] {
        assert!(text.contains(words), "{words}");
    }
    let _ = (fs::remove_file(trace), fs::remove_file(page));
    // A running run serves the same page, and each line of the trace as it is recorded.
    let arguments = [&["run"], &DELIVERY[..], &["--realtime", "20", "--serve=0"]].concat();
    let mut run = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .args(arguments)
        .current_dir(root())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command can be started");
    let mut said = BufReader::new(run.stderr.take().expect("it is piped")).lines();
    let address = said.find_map(|line| {
        let line = line.expect("UTF-8");
        let (_, behind) = line.split_once("http://")?;
        Some(behind.trim_end_matches('/').to_owned())
    });
    let address = address.expect("it says where it is shown");
    let mut page = TcpStream::connect(&address).expect("it listens");
    page.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        .expect("it is asked");
    let mut head = [0; 12];
    page.read_exact(&mut head).expect("an answer");
    assert_eq!(&head, b"HTTP/1.1 200");
    let _ = (run.kill(), run.wait());
}

#[test]
fn recorded_run_can_be_replayed() {
    let trace = temporary("data.jsonl");
    let world = [
        "--world",
        "cases/delivery/world.toml",
        "--seed",
        "3",
        "--trace",
        &trace,
    ];
    elbowroom(&[&["run"], &DELIVERY[..], &world].concat());
    let text = fs::read_to_string(&trace).expect("a trace");
    let line = |kind: &str| {
        text.lines()
            .find(|line| line.contains(kind))
            .expect("a line")
    };
    for member in ["\"now\"", "\"planned\"", "\"earliest\"", "\"latest\""] {
        assert!(line("\"event\":\"command\"").contains(member), "{member}");
    }
    assert!(line("\"event\":\"decided\"").contains("\"words\""));
    let replayed = elbowroom(&["run", "--replay", &trace]);
    assert_eq!(replayed.status.code(), Some(0), "{replayed:?}");
    let _ = fs::remove_file(trace);
}

#[test]
fn simulated_durations_and_failures_are_reproducible_by_seed() {
    let run = |seed: &str| {
        let world = [
            "--world",
            "crates/cli/tests/files/clumsy-world.toml",
            "--seed",
            seed,
        ];
        let done = elbowroom(&[&["run"], &DELIVERY[..], &world, &["--json"]].concat());
        done.stdout
    };
    assert_eq!(run("1"), run("1"));
    let others: Vec<_> = (2..8).map(|seed| run(&seed.to_string())).collect();
    assert!(others.iter().any(|other| *other != run("1")));
}

#[test]
fn plan_is_deordered_to_a_network_and_executed() {
    let network = json(&[&["stn"], &DELIVERY[..], &[PLAN, "--json"]].concat());
    assert!(network.to_string().contains("(drive rover depot shelf)"));
    let outcome = json(
        &[
            &["run"],
            &DELIVERY[..],
            &[PLAN, "--executor", "stn", "--json"],
        ]
        .concat(),
    );
    assert_eq!(outcome["verdict"], "goal-reached");
}

#[test]
fn numeric_fluents_and_time_windows_are_planned_and_executed() {
    let domain = "(define (domain d) (:requirements :durative-actions :fluents
          :timed-initial-literals)
        (:predicates (open) (done))
        (:functions (length) (charge))
        (:durative-action go :parameters () :duration (= ?duration (* 2 (length)))
          :condition (and (over all (open)) (at start (>= (charge) (length))))
          :effect (and (at end (decrease (charge) (length))) (at end (done)))))";
    let problem = "(define (problem p) (:domain d)
        (:init (= (length) 4) (= (charge) 5) (at 30 (open)) (at 60 (not (open))))
        (:goal (and (done) (>= (charge) 1))))";
    let report = run(&task(domain, problem), &mut Toy::default());
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:?}");
    let step = &report.executed[0].step;
    assert!(step.start > Rational::from(30) - Rational::ONE && step.start < Rational::from(31));
    assert_eq!(step.duration, Some(Rational::from(8)));
}

#[test]
fn planner_crash_is_not_reported_as_no_plan() {
    let done = elbowroom(
        &[
            &["plan"],
            &DELIVERY[..],
            &["--planner", "false {domain} {problem}"],
        ]
        .concat(),
    );
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(2), "{done:?}");
    assert!(
        said.contains("false") && !said.contains("unsolvable"),
        "{said}"
    );
    // In a run, the answer is the same. A missing planner is not reported as a failed one.
    let in_a_run = |planner: &str| {
        let line = ["--planner", planner, "--json"];
        let done = elbowroom(&[&["run"], &DELIVERY[..], &line].concat());
        let answer: serde_json::Value = serde_json::from_slice(&done.stdout).expect("JSON");
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        (done.status.code(), answer["verdict"].clone(), said)
    };
    for crash in [
        "false {domain} {problem}",
        "sh -c 'kill -SEGV $$' {domain} {problem}",
    ] {
        let (code, verdict, said) = in_a_run(crash);
        assert_eq!(
            (code, verdict),
            (Some(2), "planner-failed".into()),
            "{said}"
        );
        assert!(said.contains("the planner failed"), "{said}");
    }
    let (code, verdict, said) = in_a_run("none");
    assert_eq!((code, verdict), (Some(1), "no-plan".into()), "{said}");
    // A goal that already holds is not an error.
    let task = errands("(here book)");
    let report = run(&task, &mut Toy::default());
    assert_eq!((report.verdict, report.starts), (Verdict::GoalReached, 0));
}

#[test]
fn validator_uses_the_epsilon_of_the_plan() {
    let check = |options: &[&str]| {
        let done = elbowroom(&[&["check"], &DELIVERY[..], &[PLAN], options].concat());
        done.status.code()
    };
    // Its actions are 0.001 apart.
    assert_eq!(check(&[]), Some(0));
    assert_eq!(check(&["--epsilon", "0.01"]), Some(1));
    assert_eq!(check(&["--tolerance", "0.001"]), Some(0));
    assert_eq!(check(&["--tolerance", "0.01"]), Some(0));
    // An invalid plan is not executed.
    let plan = temporary("wrong.plan");
    fs::write(&plan, "0: (drive rover depot shelf) [10]\n").expect("a plan");
    let line = [
        &["run"],
        &DELIVERY[..],
        &[&plan, "--planner", "none", "--json"],
    ]
    .concat();
    let outcome = json(&line);
    assert_eq!(outcome["verdict"], "no-plan", "{outcome:#}");
    assert_eq!(outcome["executed"], serde_json::json!([]), "{outcome:#}");
    assert!(
        outcome["why"].to_string().contains("not valid"),
        "{outcome:#}"
    );
    let _ = fs::remove_file(plan);
}

#[test]
fn robots_act_concurrently_and_accept_goals_during_execution() {
    let task = errands("(have book)");
    let (name, goal) = ("cup".to_owned(), "(have cup)".to_owned());
    let mut world = Toy {
        coming: vec![Observation {
            time: Rational::from(2),
            event: Event::Requested(Request::Pursue {
                name,
                goal,
                terms: GoalTerms::default(),
            }),
        }],
        ..Toy::default()
    };
    let settings = RunSettings {
        time_limit: Rational::from(40),
        ..RunSettings::default()
    };
    let report = Execution::of(&task)
        .with_settings(settings)
        .persistent(true)
        .run_in(&mut world);
    let spans = report.executed.iter().map(|it| {
        let end = &it.step.start + it.step.duration.clone().unwrap_or_default();
        (it.step.start.clone(), end)
    });
    let spans: Vec<_> = spans.collect();
    assert_eq!(spans.len(), 2, "{report:?}");
    assert!(spans[1].0 < spans[0].1, "at the same time: {spans:?}");
}

/// Each row of the page names a test in this file, and each test has a row.
#[test]
fn document_lists_every_test() {
    let page = fs::read_to_string(root().join("docs/reference/complaints.md")).expect("the page");
    let own =
        fs::read_to_string(root().join("crates/cli/tests/cli/complaints.rs")).expect("this file");
    let tests = own.split("#[test]\nfn ").skip(1);
    let tests = tests.filter_map(|text| text.split('(').next());
    let mut tests: Vec<&str> = tests
        .filter(|name| **name != *"document_lists_every_test")
        .collect();
    let rows = page
        .lines()
        .filter(|line| line.starts_with("| ") && line.ends_with("` |"));
    let named = rows.filter_map(|row| row.trim_end_matches("` |").rsplit('`').next());
    let mut named: Vec<&str> = named.collect();
    tests.sort_unstable();
    named.sort_unstable();
    assert_eq!(named.len(), 15);
    assert_eq!(tests, named);
}
