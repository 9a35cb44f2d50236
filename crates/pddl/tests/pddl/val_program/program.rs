//! VAL as a process, and the validator's answer in the same terms.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use elbowroom_model::Task;
use elbowroom_model::validate::{Settings, Verdict, ViolationKind, validate};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_plan, read_problem};

use crate::skipped::skipped;

/// The tolerance of both validators.
pub(crate) const TOLERANCE: &str = "0.001";

/// Verdict on a plan.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum PlanVerdict {
    /// It is valid, with this metric, if there is one.
    Valid(Option<f64>),
    Invalid,
    /// Domain, problem or plan cannot be read or validated.
    NoVerdict,
}

impl PlanVerdict {
    /// Returns `true` if both verdicts are the same, up to rounding of the metrics.
    pub(crate) fn agrees_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Valid(Some(one)), Self::Valid(Some(two))) => (one - two).abs() < 0.005,
            (Self::Valid(_), Self::Valid(_)) => true,
            _ => self == other,
        }
    }
}

/// VAL, with a working folder for its input files.
pub(crate) struct Val {
    program: PathBuf,
    folder: PathBuf,
}

impl Val {
    /// Returns `None`, with a message, if the environment names no program.
    pub(crate) fn find(test: &str) -> Option<Self> {
        let Some(program) = std::env::var_os("ELBOWROOM_VAL").map(PathBuf::from) else {
            skipped("no VAL; set ELBOWROOM_VAL to its program Validate");
            return None;
        };
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("val-{test}"));
        std::fs::create_dir_all(&folder).expect("a folder for the test");
        Some(Self { program, folder })
    }

    /// Returns VAL's verdict on texts.
    pub(crate) fn verdict(&self, domain: &str, problem: &str, plan: &str) -> PlanVerdict {
        let texts = [
            ("domain.pddl", domain),
            ("problem.pddl", problem),
            ("plan", plan),
        ];
        let [domain, problem, plan] = texts.map(|(name, text)| {
            let path = self.folder.join(name);
            std::fs::write(&path, text).expect("the folder can be written to");
            path
        });
        self.verdict_for(&domain, &problem, &plan)
    }

    /// Returns VAL's verdict on files.
    pub(crate) fn verdict_for(&self, domain: &Path, problem: &Path, plan: &Path) -> PlanVerdict {
        let output = Command::new(&self.program)
            .args(["-t", TOLERANCE])
            .args([domain, problem, plan])
            .stdin(Stdio::null())
            .output()
            .expect("ELBOWROOM_VAL names a program");
        let text = String::from_utf8_lossy(&output.stdout);
        let errors = [
            "Bad plan",
            "Problem in domain",
            "Bad problem",
            "Type problem",
            "Error",
        ];
        if errors.iter().any(|error| text.contains(error)) {
            PlanVerdict::NoVerdict
        } else if text.contains("Plan valid") {
            let value = text
                .lines()
                .find_map(|line| line.strip_prefix("Final value: "));
            PlanVerdict::Valid(value.and_then(|value| value.trim().parse().ok()))
        } else if ["failed to execute", "Plan invalid", "Goal not satisfied"]
            .iter()
            .any(|failure| text.contains(failure))
        {
            PlanVerdict::Invalid
        } else {
            PlanVerdict::NoVerdict
        }
    }
}

/// Returns the task of a problem that can be read.
pub(crate) fn task(domain: &Source, problem: &Source) -> Option<Task> {
    let (problem, _) = read_problem(domain, problem).ok()?;
    Some(Task::new(problem))
}

/// Returns the validator's verdict and its reason.
pub(crate) fn ours(task: &Task, plan: &Source) -> (PlanVerdict, String) {
    let Ok((plan, _)) = read_plan(plan, task) else {
        return (PlanVerdict::NoVerdict, "the plan cannot be read".to_owned());
    };
    let tolerance: Rational = TOLERANCE.parse().expect("a number");
    match validate(task, &plan, &Settings::like_val(tolerance)) {
        Verdict::Valid(report) => {
            let metric = report.metric(task);
            let value = metric.map(|metric| metric.to_decimal(6).parse().expect("a number"));
            (PlanVerdict::Valid(value), String::new())
        }
        Verdict::Invalid(violation) => {
            let said = match violation.kind {
                ViolationKind::Undefined { .. } => PlanVerdict::NoVerdict,
                _ => PlanVerdict::Invalid,
            };
            (said, violation.to_string())
        }
        Verdict::Undecided(undecided) => (PlanVerdict::NoVerdict, undecided.to_string()),
    }
}
