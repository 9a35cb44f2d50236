//! The validator against the recorded verdicts of VAL, on all plans of the benchmark set.
//!
//! `docs/research/val-agreement.md` lists the disagreements and their causes.

use std::path::PathBuf;

use crate::skipped::skipped;
use elbowroom_model::Task;
use elbowroom_model::validate::{Settings, Verdict, ViolationKind, validate};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, is_unsupported, read_plan, read_problem};

/// Known disagreements, which the document explains.
const DISAGREEMENTS: [&str; 5] = [
    "auv-missions/pandora-tactical/plans/mission201.popf.plan at 0.0001",
    "val-samples/sleeping-beauty-with-magnetic-window-alarm/plans/sleepingbeauty-problem.src.plan at 0.00001",
    "val-samples/sleeping-beauty-with-magnetic-window-alarm/plans/sleepingbeauty-problem.src.plan at 0.0001",
    "val-samples/sleeping-beauty-with-magnetic-window-alarm/plans/sleepingbeauty-problem.src.plan at 0.001",
    "val-samples/sleeping-beauty-with-magnetic-window-alarm/plans/sleepingbeauty-problem.src.plan at 0.01",
];

const DOCUMENT: &str = include_str!("../../../../docs/research/val-agreement.md");

/// Returns the benchmark set, or `None` if it is not installed.
fn benchmarks() -> Option<PathBuf> {
    let shared = std::env::var_os("ELBOWROOM_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let root = shared.join("data/pddl");
    root.join("plans.csv").is_file().then_some(root)
}

/// VAL's verdicts on one plan, by tolerance.
struct Row<'a> {
    domain: &'a str,
    problem: &'a str,
    plan: &'a str,
    verdicts: Vec<(&'a str, &'a str)>,
}

impl<'a> Row<'a> {
    fn all(table: &'a str) -> Vec<Self> {
        let mut lines = table
            .lines()
            .map(|line| line.split(',').collect::<Vec<_>>());
        let header = lines.next().expect("a header");
        let column = |name: &str| {
            header
                .iter()
                .position(|column| *column == name)
                .expect("a column of this name")
        };
        let [domain, problem, plan] = ["domain_file", "problem_file", "plan_file"].map(column);
        let tolerances: Vec<_> = header
            .iter()
            .enumerate()
            .filter_map(|(index, name)| Some((index, name.strip_prefix("val_t")?)))
            .collect();
        lines
            .map(|cells| Self {
                domain: cells[domain],
                problem: cells[problem],
                plan: cells[plan],
                verdicts: tolerances
                    .iter()
                    .map(|(index, t)| (*t, cells[*index]))
                    .collect(),
            })
            .collect()
    }
}

/// A problem with its plan, if they can be read.
enum Reading {
    Read(Box<Task>, elbowroom_model::TimeTriggeredPlan),
    Mistaken,
    Unsupported,
}

fn read(row: &Row<'_>, load: impl Fn(&str) -> Source) -> Reading {
    let problem = match read_problem(&load(row.domain), &load(row.problem)) {
        Ok((problem, _)) => problem,
        Err(diagnostics) if is_unsupported(&diagnostics) => return Reading::Unsupported,
        Err(_) => return Reading::Mistaken,
    };
    let task = Task::new(problem);
    match read_plan(&load(row.plan), &task) {
        Ok((plan, _)) => Reading::Read(Box::new(task), plan),
        Err(_) => Reading::Mistaken,
    }
}

/// Returns our verdict in VAL's terms. VAL stops with an error, recorded as `type-error`, if a file
/// cannot be read, and also if a fluent without a value is read.
fn answer(reading: &Reading, tolerance: Rational) -> &'static str {
    let Reading::Read(task, plan) = reading else {
        return "type-error";
    };
    match validate(task, plan, &Settings::like_val(tolerance)) {
        Verdict::Valid(_) => "valid",
        Verdict::Invalid(violation) => match violation.kind {
            ViolationKind::Undefined { .. } => "type-error",
            _ => "failed-to-execute",
        },
        Verdict::Undecided(_) => "undecided",
    }
}

#[test]
fn verdicts_agree_with_val_except_documented_disagreements() {
    let Some(root) = benchmarks() else {
        skipped("no benchmark set; set ELBOWROOM_SHARED to where it is");
        return;
    };
    let load = |path: &str| {
        let bytes = std::fs::read(root.join(path)).expect("a file that the table names");
        Source::from_bytes(path, &bytes)
    };
    let table = std::fs::read_to_string(root.join("plans.csv")).expect("checked above");
    let (mut agreements, mut disagreements, mut not_judged) = (0, Vec::new(), Vec::new());
    for row in Row::all(&table) {
        let reading = read(&row, load);
        if matches!(reading, Reading::Unsupported) {
            not_judged.push(row.plan);
            continue;
        }
        for (tolerance, theirs) in &row.verdicts {
            let tolerance: Rational = tolerance.parse().expect("a number");
            if answer(&reading, tolerance.clone()) == *theirs {
                agreements += 1;
            } else {
                disagreements.push(format!("{} at {}", row.plan, tolerance.to_decimal(9)));
            }
        }
    }
    assert_eq!(disagreements, DISAGREEMENTS);
    assert!(not_judged.is_empty(), "{not_judged:?}");
    assert!(
        DOCUMENT.contains(&format!("agree on {agreements} of")),
        "{agreements} agreements"
    );
}

#[test]
fn the_document_names_each_disagreement() {
    for case in DISAGREEMENTS {
        let (plan, tolerance) = case.split_once(" at ").expect("plan at tolerance");
        let row = DOCUMENT
            .lines()
            .find(|line| line.contains(plan))
            .expect("a line of the table");
        assert!(row.contains(tolerance), "{row}");
    }
}
