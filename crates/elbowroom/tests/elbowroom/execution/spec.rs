//! Specifications of runs as data: they are written and read without ambiguity.

use std::sync::Arc;

use elbowroom::answers::run::simulate;
use elbowroom::answers::{NoObserver, RunAnswer};
use elbowroom::execute::{
    AdversarySettings, FirstPlan, NamedText, RunInputs, RunSpec, SpecError, WorldNames,
};
use elbowroom::execution::run::Verdict;
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::pddl::read_problem;
use elbowroom::report::trace::{Line, Stored, TraceWriter};
use serde_json::{Value, json};

use crate::execution::scene::{EXECUTORS, read};

fn spec() -> RunSpec {
    let file = |name: &str| NamedText {
        name: name.to_owned(),
        text: read(&format!("cases/delivery/{name}")),
    };
    RunSpec::new(file("domain.pddl"), file("problem.pddl"))
}

fn value(spec: &RunSpec) -> Value {
    serde_json::to_value(spec).expect("texts and numbers")
}

fn read_back(value: Value) -> Result<RunSpec, String> {
    serde_json::from_value(value).map_err(|error| error.to_string())
}

/// Returns a specification without any default value.
fn unusual() -> RunSpec {
    let text = |name: &str| NamedText {
        name: name.to_owned(),
        text: "…".to_owned(),
    };
    RunSpec {
        world: Some("a world".to_owned()),
        world_process: Some("./robot".to_owned()),
        spoiler: Some(AdversarySettings {
            inside: Some("dur_0=[8,14]".to_owned()),
        }),
        planner: "popf".to_owned(),
        planner_time: Some(Rational::new(5, 2)),
        likelihoods: Some(text("likely.toml")),
        has_plan: true,
        executor: "fixed:5/2".parse().expect("a correct test"),
        seed: u64::MAX,
        vary: vec![
            "duration (drive _ _ _) weight 2"
                .parse()
                .expect("a correct test"),
        ],
        guarantee: elbowroom::envelope::Guarantee::Strong,
        precision: Some(Rational::new(1, 3)),
        objective: Some(elbowroom::envelope::Objective::Volume),
        running: "await".parse().expect("a correct test"),
        planning_time: "measured".parse().expect("a correct test"),
        realtime: Some(Rational::from(10)),
        max_replans: 0,
        time_limit: Rational::from(7),
        epsilon: Rational::new(1, 100),
        ..spec()
    }
}

#[test]
fn specification_round_trips() {
    for spec in [spec(), unusual()] {
        assert_eq!(read_back(value(&spec)), Ok(spec));
    }
}

#[test]
fn missing_or_unknown_member_is_an_error() {
    let whole = value(&unusual());
    let members: Vec<String> = whole
        .as_object()
        .expect("an object")
        .keys()
        .cloned()
        .collect();
    assert_eq!(members.len(), 25);
    for member in &members {
        let mut less = whole.clone();
        less.as_object_mut().expect("an object").remove(member);
        let read = read_back(less);
        let optional = [
            "spoiler",
            "planner_time",
            "precision",
            "objective",
            "planning_budget",
            "timeout",
        ];
        if optional.contains(&member.as_str()) {
            assert!(read.is_ok(), "{member} may be left out");
        } else {
            let wrong = read.expect_err(member);
            assert!(
                wrong.contains(&format!("missing field `{member}`")),
                "{wrong}"
            );
        }
        let mut renamed = whole.clone();
        let moved = renamed.as_object_mut().expect("an object").remove(member);
        renamed[format!("{member}_")] = moved.expect("it is there");
        let wrong = read_back(renamed).expect_err(member);
        assert!(wrong.contains("field `"), "{member}: {wrong}");
    }
    for part in ["domain", "likelihoods", "spoiler"] {
        let mut more = whole.clone();
        more[part]["more"] = json!(1);
        assert!(read_back(more).is_err(), "{part}");
    }
}

#[test]
fn meaningless_value_is_an_error() {
    for (member, wrong) in [
        ("executor", json!("gaurded")),
        ("executor", json!(3)),
        ("precision", json!("0")),
        ("precision", json!("a third")),
        ("precision", json!(1)),
        ("epsilon", json!("-1/1000")),
        ("time_limit", json!("0")),
        ("planner_time", json!("-3")),
        ("realtime", json!("0")),
        ("realtime", json!("fast")),
        ("running", json!("later")),
        ("planning_time", json!("soon")),
        ("planning_time", json!("-1")),
        ("guarantee", json!("none")),
        ("vary", json!(["deadlin (van)"])),
        ("seed", json!(-1)),
        ("max_replans", json!("ten")),
    ] {
        let mut changed = value(&unusual());
        changed[member] = wrong.clone();
        assert!(read_back(changed).is_err(), "{member}: {wrong}");
    }
}

/// Header as written by versions without a type for it.
#[test]
fn headers_of_older_traces_are_read() {
    let header = r#"{"domain":{"name":"d","text":"(define)"},"problem":{"name":"p","text":"()"},
        "world":null,"world_process":null,"planner":"embedded","likelihoods":null,"has_plan":true,
        "executor":"guarded","seed":7,"planner_states":400,"improve_states":100,"vary":[],
        "guarantee":"dynamic","precision":"1","running":"keep","planning_time":"0","realtime":null,
        "max_replans":10,"time_limit":"1000000","epsilon":"1/1000","event":"header",
        "format":"elbowroom-trace","version":1}"#;
    let stored = Stored::read(&header.replace('\n', "")).expect("a trace");
    let spec: RunSpec = stored.header().expect("a specification");
    assert_eq!(spec.seed, 7);
    let mut sink = String::new();
    let mut write = |line: &str| sink.push_str(line);
    let task = Arc::new(Task::new(elbowroom::model::Problem::default()));
    let mut writer = TraceWriter::new(task, &mut write);
    writer.header(&spec).expect("texts and numbers");
    let words: String = header.split_whitespace().collect();
    // Older traces without time-outs have those of the default rule.
    let words = words.replace(r#""max_replans""#, r#""timeout":"10x,600","max_replans""#);
    assert_eq!(sink.trim_end(), words);
}

/// The number of threads only concerns the planner. It is not part of traces, and a trace with it
/// is invalid.
#[test]
fn number_of_threads_is_not_in_the_trace() {
    let mut spec = spec();
    assert_eq!(spec.embedded().settings.threads, 1);
    spec.threads = 3;
    assert_eq!(spec.embedded().settings.threads, 3);
    let mut written = value(&spec);
    assert_eq!(read_back(written.clone()).map(|it| it.threads), Ok(1));
    written["threads"] = 3.into();
    let why = read_back(written).expect_err("an unknown member");
    assert!(why.contains("threads"), "{why}");
}

#[test]
fn inconsistent_settings_are_rejected_before_the_run() {
    let task = Arc::new(Task::new(elbowroom::model::Problem::default()));
    let check = |change: &dyn Fn(&mut RunSpec)| {
        let mut spec = spec();
        change(&mut spec);
        let inputs = RunInputs::of(spec, Arc::clone(&task), &WorldNames::default());
        inputs.and_then(|inputs| inputs.execution(None)).err()
    };
    let live = || "live:5".parse().expect("a correct test");
    assert!(check(&|_| {}).is_none());
    let wrong = check(&|spec| spec.executor = live());
    assert!(matches!(wrong, Some(SpecError::NeedsWorld(_))), "{wrong:?}");
    let wrong = check(&|spec| {
        spec.executor = live();
        spec.world = Some("format = \"elbowroom-world\"\nversion = 1\n".to_owned());
        spec.planner = "none".to_owned();
    });
    assert!(
        matches!(wrong, Some(SpecError::NeedsEmbedded(_))),
        "{wrong:?}"
    );
    let wrong = check(&|spec| spec.planner_time = Some(Rational::ONE));
    assert!(
        matches!(wrong, Some(SpecError::NoTimeLimit(_))),
        "{wrong:?}"
    );
    let wrong = check(&|spec| spec.planner = "nobody-knows".to_owned());
    assert!(matches!(wrong, Some(SpecError::Planner(_))), "{wrong:?}");
}

#[test]
fn likelihoods_that_nothing_uses_are_rejected() {
    let mut spec = spec();
    spec.likelihoods = Some(NamedText {
        name: "likelihoods.toml".to_owned(),
        text: String::new(),
    });
    for (executor, first_plan, is_used) in [
        ("policy", FirstPlan::Shortest, false),
        ("live", FirstPlan::Shortest, false),
        ("live", FirstPlan::Likeliest, true),
        ("adaptable", FirstPlan::Shortest, true),
        ("lookahead", FirstPlan::Shortest, true),
    ] {
        spec.executor = executor.parse().expect("a correct test");
        spec.first_plan = first_plan;
        let checked = spec.check_new();
        let is_rejected = matches!(checked, Err(SpecError::UnusedLikelihoods(_)));
        assert_eq!(!is_rejected, is_used, "{executor}: {checked:?}");
    }
}

/// The answer and the lines of the trace can be deserialized, and serialized again to the same
/// bytes.
#[test]
fn answer_and_trace_lines_round_trip() {
    let world = "format = \"elbowroom-world\"\nversion = 1\n\
        [[duration]]\naction = \"*\"\nnormal = { mean = 1.2, deviation = 0.4, minimum = 0.2 }\n\
        relative = true\n[[failure]]\naction = \"*\"\nprobability = 0.2\n\
        [reports]\nlost = 0.1\nduplicated = 0.1\ncontradicted = 0.05\n";
    for executor in EXECUTORS.iter() {
        let spec = RunSpec {
            executor: executor.parse().expect("a correct test"),
            world: Some(world.to_owned()),
            planner_states: 400,
            improve_states: 100,
            seed: 3,
            ..spec()
        };
        let (domain, problem) = (spec.domain.source(), spec.problem.source());
        let (problem, _) = read_problem(&domain, &problem).expect("a correct test");
        let task = Arc::new(Task::new(problem));
        let mut text = String::new();
        let mut sink = |line: &str| text.push_str(line);
        let mut writer = TraceWriter::new(Arc::clone(&task), &mut sink);
        writer.header(&spec).expect("texts and numbers");
        let inputs = RunInputs::of(spec.clone(), Arc::clone(&task), &WorldNames::default());
        let inputs = inputs.expect("texts");
        let execution = inputs.execution(None).expect("a consistent specification");
        let execution = execution.recorded_by(&mut writer);
        let outcome = simulate(&inputs, execution, &mut NoObserver);
        let answer = outcome.expect("a world").answer;

        let written = serde_json::to_string(&answer).expect("texts and numbers");
        let read: RunAnswer = serde_json::from_str(&written).expect("what was written");
        assert_eq!(read, answer, "{executor}");

        let stored = Stored::read(&text).expect("a trace");
        assert_eq!(stored.header::<RunSpec>().expect("a specification"), spec);
        assert!(stored.is_complete(), "{executor}");
        let again: Vec<String> = stored.lines.iter().map(Line::text).collect();
        let lines: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(again, lines, "{executor}");
        let Some(Line::Over(last)) = stored.lines.last() else {
            panic!("{executor}: the trace ends with the report");
        };
        assert_eq!(*last, answer.report, "{executor}");
    }
}

/// Returns the answer of `policy` in this world. The embedded planner makes the plan.
fn answer_of_policy(world: &str, budget: &str) -> RunAnswer {
    let spec = RunSpec {
        world: Some(format!(
            "format = \"elbowroom-world\"\nversion = 1\n{world}"
        )),
        executor: "policy".parse().expect("a correct test"),
        planning_budget: Some(budget.parse().expect("a correct test")),
        ..spec()
    };
    let (inputs, _) = RunInputs::read(spec).expect("a correct test");
    let execution = inputs.execution(None).expect("a correct test");
    let outcome = simulate(&inputs, execution, &mut NoObserver).expect("a correct test");
    outcome.answer
}

#[test]
fn policy_reports_reason_for_missing_table() {
    let varied =
        "[[duration]]\naction = \"*\"\nuniform = { from = 0.9, to = 1.1 }\nrelative = true\n";
    let delayed = "[[delay]]\naction = \"*\"\nconstant = 1\n";
    let reason = |world: &str, budget: &str| answer_of_policy(world, budget).no_table;
    assert!(reason(delayed, "10").is_some_and(|why| why.contains("delay")));
    assert!(reason(varied, "0.000001").is_some_and(|why| why.contains("--planning-budget")));
}

#[test]
fn planning_budget_limits_work_for_certificates() {
    let work = |budget: Option<&str>| {
        let planning_budget = budget.map(|it| it.parse().expect("a correct test"));
        RunSpec {
            planning_budget,
            ..spec()
        }
        .embedded()
        .certificate_work
    };
    assert_eq!(work(Some("0.1")), 1_000_000);
    assert_eq!(work(Some("0")), 0);
    assert_eq!(work(Some("2")), work(None));
    assert!(work(Some("0.5")) < work(None));
}

/// A failure of the first action makes the start of the second one impossible, without a report.
#[test]
fn policy_does_not_start_a_refused_action_without_end() {
    let named = |name: &str, text: &str| NamedText {
        name: name.to_owned(),
        text: text.to_owned(),
    };
    let domain = "(define (domain pair) (:requirements :durative-actions)
        (:predicates (hand) (ready) (done))
        (:durative-action prepare :parameters () :duration (= ?duration 2)
          :effect (at end (ready)))
        (:durative-action work :parameters () :duration (= ?duration 3)
          :condition (and (at start (ready)) (at start (hand))) :effect (at end (done))))";
    let problem = "(define (problem p) (:domain pair) (:init (hand)) (:goal (done)))";
    let world = "format = \"elbowroom-world\"\nversion = 1\n[[failure]]\naction = \"prepare\"\n\
        probability = 0.5\nwhen = \"start\"\n[[failure.outcome]]\nprobability = 1\n\
        becomes_false = [\"(hand)\"]\nreported = false\n";
    let (domain, problem) = (named("domain", domain), named("problem", problem));
    let mut limits = 0;
    for seed in 0..8 {
        let spec = RunSpec {
            world: Some(world.to_owned()),
            executor: "policy".parse().expect("a correct test"),
            seed,
            time_limit: Rational::from(100),
            ..RunSpec::new(domain.clone(), problem.clone())
        };
        let (inputs, _) = RunInputs::read(spec).expect("a correct test");
        let execution = inputs.execution(None).expect("a correct test");
        let outcome = simulate(&inputs, execution, &mut NoObserver);
        let report = outcome.expect("a world").report;
        limits += usize::from(report.verdict == Verdict::ReplanLimit);
        assert_ne!(report.verdict, Verdict::TimeLimit, "{seed}");
        assert!(report.starts < 300, "{seed}: {}", report.starts);
    }
    assert!(limits > 0, "else the test is about nothing");
}
