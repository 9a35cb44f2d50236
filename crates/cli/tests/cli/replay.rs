//! Replays of stored runs make the same decisions, for all executors.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use crate::command::{elbowroom, root};

/// A file that is removed on drop.
struct Temporary(PathBuf);

impl Temporary {
    fn new(name: &str, text: &str) -> Self {
        let name = format!("elbowroom-{}-replay-{name}", std::process::id());
        let path = std::env::temp_dir().join(name);
        fs::write(&path, text).expect("written");
        Self(path)
    }

    fn name(&self) -> String {
        self.0.display().to_string()
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// Executes a run, replays it, and returns the trace.
fn played_back(name: &str, arguments: &[&str]) -> String {
    let trace = Temporary::new(&format!("{name}.jsonl"), "");
    let made = elbowroom(&[&["run", "--trace", &trace.name()], arguments].concat());
    assert!(
        matches!(made.status.code(), Some(0 | 1)),
        "{name}: {made:?}"
    );
    let text = fs::read_to_string(&trace.0).expect("a trace");
    let replay = elbowroom(&["run", "--json", "--replay", &trace.name()]);
    assert_eq!(replay.status.code(), Some(0), "{name}: {replay:?}");
    let document: Value = serde_json::from_slice(&replay.stdout).expect("a document");
    assert_eq!(document["agrees"], true, "{name}");
    assert_eq!(document["complete"], true, "{name}");
    // All lines except the header are entries.
    assert_eq!(document["entries"], text.lines().count() - 1, "{name}");
    text
}

/// Returns the line of the first difference between a trace and its replay, if any.
fn difference(trace: &str, name: &str) -> Option<u64> {
    let file = Temporary::new(name, trace);
    let replay = elbowroom(&["run", "--json", "--replay", &file.name()]);
    assert!(
        matches!(replay.status.code(), Some(0 | 1)),
        "{name}: {replay:?}"
    );
    let document: Value = serde_json::from_slice(&replay.stdout).expect("a document");
    document["difference"]["line"].as_u64()
}

/// Returns the first plan made in a run.
fn first_plan(trace: &str) -> String {
    let lines = trace.lines().map(serde_json::from_str::<Value>);
    let mut entries = lines.map(|entry| entry.expect("JSON"));
    let planned = entries.find(|entry| entry["event"] == "planned");
    let planned = planned.expect("a plan was made");
    let steps = planned["plan"].as_array().expect("steps").iter();
    let words = steps.map(|step| {
        let decimal = |name: &str| step[name]["decimal"].to_string();
        let action = step["action"].as_str().expect("a name");
        format!("{}: {action} [{}]", decimal("start"), decimal("duration"))
    });
    words.collect::<Vec<_>>().join("\n")
}

fn causes(trace: &str) -> Vec<String> {
    let lines = trace.lines().map(serde_json::from_str::<Value>);
    let entries = lines.map(|entry| entry.expect("JSON"));
    let causes = entries.filter_map(|entry| Some(entry["reason"]["cause"].as_str()?.to_owned()));
    causes.collect()
}

const DELIVERY: [&str; 2] = ["cases/delivery/domain.pddl", "cases/delivery/problem.pddl"];

/// Two orders. The nearer one has almost no slack, so `live:5` abandons it.
#[test]
fn run_with_switch_to_likelier_plan_is_replayed() {
    let text = fs::read_to_string(root().join("experiments/table1/problem.pddl")).expect("read");
    let text = text.replace("{early}", "425").replace("{late}", "800");
    let problem = Temporary::new("problem.pddl", &text);
    let uncertain = |step: u32, mean: u32| {
        format!(
            "[[duration]]\naction = \"make-base-{step}\"\n\
             normal = {{ mean = {mean}, deviation = 70, minimum = 0 }}\n"
        )
    };
    let world = format!(
        "format = \"elbowroom-world\"\nversion = 1\n{}{}",
        uncertain(1, 170),
        uncertain(2, 160)
    );
    let world_file = Temporary::new("world.toml", &world);
    let (name, world) = (problem.name(), world_file.name());
    let common = [
        "experiments/table1/domain.pddl",
        &name,
        "--world",
        &world,
        "--planner-states",
        "400",
        "--improve-states",
        "256",
        "--seed",
        "3",
        "--planning-time",
        "0",
    ];
    // The planner's own plan. By default, a run begins with the likeliest one.
    let shortest = ["--executor", "live", "--first-plan", "shortest"];
    let hasty = played_back("hasty", &[&common[..], &shortest].concat());
    let plan = Temporary::new("hasty.plan", &first_plan(&hasty));
    let trace = played_back(
        "live",
        &[
            &common[..],
            &["--executor", "live:5", "--plan", &plan.name()],
        ]
        .concat(),
    );
    assert!(causes(&trace).iter().any(|cause| cause == "likelier"));
    // The replay recomputes probabilities, which differ in another world.
    let steady = trace.replacen("deviation = 70", "deviation = 1", 10);
    assert_ne!(steady, trace);
    assert!(difference(&steady, "steady.jsonl").is_some());
}

/// The deadline is met more often with another order of the actions. `policy` makes that plan
/// itself, so the planner does not make the first plan in the trace.
#[test]
fn run_with_policy_plan_and_planner_plan_is_replayed() {
    let domain = Temporary::new(
        "shift-domain.pddl",
        "(define (domain shift)
  (:requirements :strips :durative-actions :timed-initial-literals :duration-inequalities)
  (:predicates (free) (soft) (cut) (sanded) (open) (lit))
  (:durative-action soak :parameters () :duration (and (>= ?duration 7) (<= ?duration 17))
    :condition (at start (open)) :effect (at end (soft)))
  (:durative-action cut :parameters () :duration (= ?duration 3)
    :condition (and (at start (free)) (at start (soft)) (over all (lit)) (at end (lit)))
    :effect (and (at start (not (free))) (at end (free)) (at end (cut))))
  (:durative-action sand :parameters () :duration (= ?duration 3)
    :condition (and (at start (free)) (at end (open)))
    :effect (and (at start (not (free))) (at end (free)) (at end (sanded)))))",
    );
    let problem = Temporary::new(
        "shift-problem.pddl",
        "(define (problem late) (:domain shift)
  (:init (free) (open) (lit) (at 14 (not (open))) (at 16.5 (not (lit))))
  (:goal (and (soft) (cut) (sanded))))",
    );
    let plan = Temporary::new(
        "shift.plan",
        "0: (soak) [7]\n7.001: (cut) [3]\n10.002: (sand) [3]\n",
    );
    let world = Temporary::new(
        "shift-world.toml",
        "format = \"elbowroom-world\"\nversion = 1\n\
         [[duration]]\naction = \"*\"\nuniform = { from = 0.5, to = 1.5 }\nrelative = true\n\
         [[failure]]\naction = \"sand\"\nprobability = 0.5\nwhen = \"midway\"\nundone = true\n",
    );
    let [domain, problem, plan, world] = [&domain, &problem, &plan, &world].map(Temporary::name);
    let mut plans = 0;
    for seed in ["4", "5", "8"] {
        let trace = played_back(
            "policy",
            &[
                &domain,
                &problem,
                &plan,
                "--executor",
                "policy",
                "--world",
                &world,
                "--seed",
                seed,
                "--planning-budget",
                "0.5",
            ],
        );
        assert!(causes(&trace).iter().any(|cause| cause == "likelier"));
        plans += trace.matches("\"event\":\"planned\"").count();
    }
    assert!(plans > 3, "{plans}");
}

#[test]
fn runs_by_likelihoods_with_failures_are_replayed() {
    for executor in ["adaptable", "lookahead", "esterel"] {
        let (mut replans, mut failed) = (0, 0);
        for seed in ["1", "2", "3", "4"] {
            let mut arguments = vec![
                DELIVERY[0],
                DELIVERY[1],
                "--plan",
                "cases/delivery/plan.plan",
                "--world",
                "experiments/clumsy/door.toml",
                "--executor",
                executor,
                "--running",
                "keep",
                "--seed",
                seed,
            ];
            if executor != "esterel" {
                arguments.extend(["--likelihoods", "experiments/clumsy/door-locks.toml"]);
            }
            let trace = played_back(&format!("{executor}-{seed}"), &arguments);
            failed += trace.matches("it did not start").count();
            replans += trace.matches("\"event\":\"planning\"").count();
        }
        assert!(failed > 5, "{executor}: {failed}");
        // `esterel` reaches a locked door in some of them.
        assert_eq!(replans > 0, executor == "esterel", "{executor}: {replans}");
    }
}

/// Likelihoods are part of the record, because they affect decisions.
#[test]
fn likelihoods_are_kept_in_the_trace() {
    let trace = played_back(
        "likelihoods",
        &[
            DELIVERY[0],
            DELIVERY[1],
            "--world",
            "experiments/clumsy/door.toml",
            "--likelihoods",
            "experiments/clumsy/door-locks.toml",
            "--executor",
            "adaptable",
            "--seed",
            "1",
        ],
    );
    let certain = trace.replacen("becomes_false = 0.1", "becomes_false = 0.0", 1);
    assert_ne!(certain, trace);
    assert!(difference(&certain, "certain.jsonl").is_some());
    let other = trace.replacen("\"executor\":\"adaptable\"", "\"executor\":\"esterel\"", 1);
    assert_ne!(other, trace);
    assert!(difference(&other, "other.jsonl").is_some());
}

#[test]
fn trace_with_rejected_plan_cannot_be_replayed() {
    let trace = Temporary::new("refused.jsonl", "");
    let case = ["domain.pddl", "problem.pddl", "plan.plan"].map(|file| {
        root()
            .join("cases/delivery")
            .join(file)
            .display()
            .to_string()
    });
    let [domain, problem, plan] = &case;
    let made = elbowroom(&[
        "run",
        domain,
        problem,
        plan,
        "--timeout",
        "3",
        "--trace",
        &trace.name(),
    ]);
    assert_eq!(made.status.code(), Some(1), "{made:?}");
    let replay = elbowroom(&["run", "--replay", &trace.name()]);
    assert_eq!(replay.status.code(), Some(2), "{replay:?}");
    let said = String::from_utf8_lossy(&replay.stderr).replace("\n  ", " ");
    assert!(said.contains("was rejected"), "{said}");
}

/// Runs with recorded traces, by name. `ELBOWROOM_UPDATE_RECORDED=1` writes the traces again, after
/// an intended change.
const RECORDED: [(&str, &str); 8] = [
    (
        "guarded",
        "cases/delivery --world experiments/clumsy/door.toml --executor guarded --seed 2",
    ),
    (
        "esterel",
        "cases/delivery --world experiments/clumsy/door.toml --executor esterel --seed 3 \
         --plan cases/delivery/plan.plan --running keep --planning-time 2",
    ),
    (
        "adaptable",
        "cases/delivery --world experiments/clumsy/door.toml --executor adaptable --seed 4 \
         --likelihoods experiments/clumsy/door-locks.toml",
    ),
    (
        "cancelled",
        "cases/delivery --world experiments/clumsy/door.toml --executor stn --seed 5 --running cancel",
    ),
    (
        "late",
        "cases/delivery --world crates/cli/tests/files/late-drives-world.toml --executor guarded --seed 1",
    ),
    (
        "live",
        "cases/delivery --world crates/cli/tests/files/clumsy-world.toml --executor live --seed 6 --planning-time 1",
    ),
    (
        "awaited",
        "cases/match --world crates/cli/tests/files/clumsy-world.toml --executor guarded --seed 1 --running await",
    ),
    (
        "unattended",
        "crates/cli/tests/files/errands --world crates/cli/tests/files/clumsy-world.toml --executor guarded --seed 3",
    ),
];

#[test]
fn recorded_runs_are_reproduced_and_replayed() {
    for (name, line) in RECORDED {
        let stored = format!("crates/cli/tests/files/golden/{name}.jsonl");
        let words: Vec<&str> = line.split_whitespace().collect();
        let (domain, problem) = (
            format!("{}/domain.pddl", words[0]),
            format!("{}/problem.pddl", words[0]),
        );
        let arguments = [&[domain.as_str(), &problem], &words[1..]].concat();
        let text = played_back(&format!("recorded-{name}"), &arguments);
        if std::env::var_os("ELBOWROOM_UPDATE_RECORDED").is_some() {
            fs::write(root().join(&stored), &text).expect("a file to write");
        }
        let stored_text = fs::read_to_string(root().join(&stored)).expect("a trace");
        let mut lines = text.lines().zip(stored_text.lines());
        if let Some((now, recorded)) = lines.find(|(now, recorded)| now != recorded) {
            panic!("{name}: recorded\n{recorded}\nnow\n{now}");
        }
        assert_eq!(text, stored_text, "{name}");
        let replay = elbowroom(&["run", "--replay", &stored]);
        assert_eq!(replay.status.code(), Some(0), "{name}: {replay:?}");
    }
}
