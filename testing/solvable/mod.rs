//! Random temporal problems that are solvable by construction.
//!
//! [`problem`] draws a domain without conditions, an initial state and a plan. It then adds random
//! conditions, constraints and goals one by one, and keeps those under which the validator still accepts
//! the plan. So each problem comes with a witness plan, and a planner that claims that no plan exists
//! is wrong.
//!
//! To add a feature: a flag in `features.rs`, and text that uses it in the file of its family
//! (`conditions.rs`, `effects.rs`, `schedule.rs`, `world.rs`, `course.rs`). Everything is PDDL text, so
//! that other programs can read the problems as well.

mod conditions;
mod course;
mod effects;
mod features;
mod outcome;
mod random;
mod schedule;
mod sketch;
mod world;

use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_pddl::{Source, read_plan, read_problem};

pub(crate) use features::Features;
pub(crate) use outcome::{Outcome, Tally, outcome, outcome_with};
use random::Random;
use sketch::Sketch;

/// Number of drafts per seed. The last one has no features and a plan of one step.
const DRAFTS: u64 = 40;

/// Random problem, with a plan that solves it.
#[derive(Clone, Debug)]
pub(crate) struct Solvable {
    pub(crate) features: Features,
    pub(crate) domain: String,
    pub(crate) problem: String,
    pub(crate) plan: String,
}

impl Solvable {
    /// Returns the task.
    ///
    /// # Panics
    ///
    /// Panics if the text is not PDDL.
    pub(crate) fn task(&self) -> Task {
        match read(&self.domain, &self.problem) {
            Ok(task) => task,
            Err(message) => panic!("{message}\n{self}"),
        }
    }

    /// Returns the plan, with facts as `task` numbers them.
    ///
    /// # Panics
    ///
    /// Panics if the text is no plan.
    pub(crate) fn witness(&self, task: &Task) -> TimeTriggeredPlan {
        let source = Source::new("plan", self.plan.clone());
        match read_plan(&source, task) {
            Ok((plan, _)) => plan,
            Err(diagnostics) => panic!("{}\n{self}", diagnostics.render(false)),
        }
    }

    /// Returns `true` if an action overlaps itself in the plan.
    pub(crate) fn overlaps_itself(&self) -> bool {
        self.witness(&self.task()).self_overlap().is_some()
    }
}

impl std::fmt::Display for Solvable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            features,
            domain,
            problem,
            plan,
        } = self;
        write!(f, "; {features}\n{domain}{problem}; plan\n{plan}")
    }
}

/// Returns the problem of a seed, or `None` if all its drafts are unusable.
pub(crate) fn problem(seed: u64) -> Option<Solvable> {
    problem_with(seed, Features::draw)
}

/// The same for problems about one changing number ([`Features::draw_numeric`]).
#[allow(dead_code, reason = "not all tests that share this ask for numbers")]
pub(crate) fn numeric_problem(seed: u64) -> Option<Solvable> {
    problem_with(seed, Features::draw_numeric)
}

fn problem_with(seed: u64, draw: fn(&mut Random) -> Features) -> Option<Solvable> {
    (0..DRAFTS).find_map(|draft| {
        let mut random = Random::new(seed.wrapping_mul(DRAFTS).wrapping_add(draft));
        let features = draw(&mut random);
        drafted(&mut random, features)
    })
}

/// Returns a problem with these features, or `None` if the draft is unusable: the plan is invalid, or
/// no goal needs it.
fn drafted(random: &mut Random, features: Features) -> Option<Solvable> {
    let mut sketch = Sketch::draw(random, features);
    if !is_valid(&sketch, true) {
        sketch.spread_steps();
        if !is_valid(&sketch, true) {
            return None;
        }
    }
    conditions::add(random, &mut sketch);
    if features.constraints {
        course::add(random, &mut sketch);
    }
    conditions::add_goal(random, &mut sketch)?;
    Some(sketch.finished())
}

/// Returns `true` if the validator accepts the sketch's plan, or the empty one.
fn is_valid(sketch: &Sketch, with_plan: bool) -> bool {
    matches!(judged(sketch, with_plan), (_, Verdict::Valid(_)))
}

/// Returns the value of `(n0)` at the end of the sketch's plan; `None` if the plan is invalid, or no decimal number of nine
/// digits is that value.
fn last_value(sketch: &Sketch) -> Option<String> {
    let (task, verdict) = judged(sketch, true);
    let Verdict::Valid(report) = verdict else {
        return None;
    };
    let value = report.state.values.get(&task.fluent_named("(n0)")?)?;
    let text = value.to_decimal(9);
    (text.parse().as_ref() == Ok(value)).then_some(text)
}

/// Returns the verdict on the sketch's plan, or the empty one.
fn judged(sketch: &Sketch, with_plan: bool) -> (Task, Verdict) {
    let (domain, problem) = (sketch.domain(), sketch.problem());
    let task = match read(&domain, &problem) {
        Ok(task) => task,
        Err(message) => panic!("{message}\n{domain}\n{problem}"),
    };
    let plan = if with_plan {
        let source = Source::new("plan", sketch.plan());
        match read_plan(&source, &task) {
            Ok((plan, _)) => plan,
            Err(diagnostics) => panic!("{}\n{domain}\n{problem}", diagnostics.render(false)),
        }
    } else {
        TimeTriggeredPlan::default()
    };
    let verdict = validate(&task, &plan, &Settings::default());
    (task, verdict)
}

fn read(domain: &str, problem: &str) -> Result<Task, String> {
    let domain = Source::new("domain.pddl", domain.to_owned());
    let problem = Source::new("problem.pddl", problem.to_owned());
    match read_problem(&domain, &problem) {
        Ok((problem, _)) => Ok(Task::new(problem)),
        Err(diagnostics) => Err(diagnostics.render(false)),
    }
}
