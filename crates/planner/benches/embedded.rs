//! Measures the time to the first plan on the delivery and RCLL problems, and to a plan or a proof
//! from situations in mid-execution of their plans.
//!
//! The problems are in a folder next to the repository; without them nothing is measured.
#![allow(clippy::print_stdout, reason = "percentiles are printed")]
#![allow(clippy::disallowed_methods, reason = "a benchmark looks at the clock")]

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use elbowroom_model::ground::{Change, Condition};
use elbowroom_model::{RunningAction, Situation, Task, TimeTriggeredPlan, validate, validate_from};
use elbowroom_num::{Interval, Rational};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_planner::{Answer, Settings, plan};

/// Domain and problem, relative to the data folder.
const PROBLEMS: &[(&str, &str)] = &[
    ("delivery_battery/domain.pddl", "delivery_battery/p1.pddl"),
    ("delivery_battery/domain.pddl", "delivery_battery/p2.pddl"),
    ("delivery_battery/domain.pddl", "delivery_battery/p3.pddl"),
    (
        "envelopes/rcll_duration/domain_rcll_simple.pddl",
        "envelopes/rcll_duration/problems/problem_lp0.05_hp0.05.pddl",
    ),
    (
        "envelopes/rcll_resource/domain_rcll_simple_resource_2_param.pddl",
        "envelopes/rcll_resource/problems/problem_extra_fuel_rate_0.50.pddl",
    ),
];

/// Number of situations for the latencies.
const SITUATIONS: usize = 1000;

/// Maximum number of progress reports of a search from a situation before it counts as unanswered.
const MAX_REPORTS: usize = 2000;

fn main() {
    latencies();
    divan::main();
}

fn data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    folder.is_dir().then_some(folder)
}

fn task((domain, problem): (&str, &str)) -> Option<Task> {
    let folder = data()?;
    let source = |path: &str| {
        let bytes = std::fs::read(folder.join(path)).ok()?;
        Some(Source::from_bytes(path, &bytes))
    };
    let (problem, _) = read_problem(&source(domain)?, &source(problem)?).ok()?;
    Some(Task::new(problem))
}

fn first_plan(task: &Task, situation: &Situation) -> Answer {
    let settings = Settings {
        first_plan_only: true,
        ..Settings::default()
    };
    let mut left = MAX_REPORTS;
    plan(task, situation, &settings, &mut |_| {
        left -= 1;
        if left == 0 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
}

#[divan::bench(args = 0..PROBLEMS.len(), sample_count = 20)]
fn time_to_first_plan(bencher: divan::Bencher<'_, '_>, problem: usize) {
    let Some(task) = task(PROBLEMS[problem]) else {
        return;
    };
    let situation = Situation::initial(&task);
    bencher
        .with_inputs(|| task.clone())
        .bench_values(|task| first_plan(&task, &situation));
}

/// Pseudo-random numbers with a fixed seed (Marsaglia's xorshift).
struct Rng(u64);

impl Rng {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % bound
    }
}

/// Prints the percentiles of the time to a plan or a proof from situations in mid-execution.
fn latencies() {
    let mut dice = Rng(0x9e37_79b9_7f4a_7c15);
    let (mut times, mut states): (Vec<f64>, Vec<u64>) = (Vec::new(), Vec::new());
    let (mut plans, mut proofs, mut unanswered) = (0, 0, 0);
    let mut starts: Vec<(Task, TimeTriggeredPlan)> = Vec::new();
    for problem in PROBLEMS {
        let Some(task) = task(*problem) else {
            println!("skipped: no {}", problem.1);
            continue;
        };
        let situation = Situation::initial(&task);
        if let Some(found) = first_plan(&task, &situation).found() {
            starts.push((task, found.plan.clone()));
        }
    }
    while !starts.is_empty() && times.len() < SITUATIONS {
        let number = times.len() % starts.len();
        let (task, plan) = &starts[number];
        let makespan = plan.makespan();
        #[allow(clippy::cast_possible_wrap, reason = "below a thousand")]
        let cut = &makespan * Rational::new(dice.below(1000) as i64, 1000);
        let Some(situation) = situation_at(task, plan, &cut, &mut dice) else {
            continue;
        };
        let task = task.clone();
        let begin = Instant::now();
        let answer = first_plan(&task, &situation);
        times.push(begin.elapsed().as_secs_f64() * 1e3);
        states.push(match &answer {
            Answer::Plan { counts, .. }
            | Answer::Unsolvable { counts, .. }
            | Answer::NoneFound { counts, .. } => counts.evaluated,
            Answer::Unsupported(_) => 0,
        });
        match &answer {
            Answer::Plan { found, .. } => {
                let strictness = validate::Settings::default();
                let verdict = validate_from(&task, &situation, &found.plan, &strictness);
                assert!(verdict.is_valid(), "a plan from a situation is valid");
                plans += 1;
            }
            Answer::Unsolvable { .. } => proofs += 1,
            _ => unanswered += 1,
        }
    }
    if times.is_empty() {
        return;
    }
    times.sort_by(f64::total_cmp);
    states.sort_unstable();
    let place = |percent: usize| (times.len() - 1) * percent / 100;
    let percentile = |percent: usize| times[place(percent)];
    println!(
        "replanning from {} situations: {plans} plans, {proofs} proofs, {unanswered} unanswered; \
         median {:.2} ms, 90th percentile {:.2} ms, 99th percentile {:.2} ms, worst {:.2} ms",
        times.len(),
        percentile(50),
        percentile(90),
        percentile(99),
        percentile(100),
    );
    println!(
        "states: median {}, 90th percentile {}, 99th percentile {}, most {}",
        states[place(50)],
        states[place(90)],
        states[place(99)],
        states[place(100)],
    );
}

/// Returns the situation of the plan at `now`. Running actions last up to half as long again as
/// planned.
fn situation_at(
    task: &Task,
    plan: &TimeTriggeredPlan,
    now: &Rational,
    dice: &mut Rng,
) -> Option<Situation> {
    let mut happened: Vec<(Rational, &[elbowroom_model::ground::Effect])> = Vec::new();
    let mut running = Vec::new();
    for step in plan.steps.iter().filter(|step| step.start < *now) {
        match (step.action.durative(), &step.duration) {
            (Some(body), Some(duration)) => {
                happened.push((step.start.clone(), &body.start.effects));
                if step.end() < *now {
                    happened.push((step.end(), &body.end.effects));
                } else {
                    #[allow(clippy::cast_possible_wrap, reason = "below a hundred")]
                    let late = Rational::new(100 + dice.below(50) as i64, 100);
                    let longest = duration * late;
                    running.push(RunningAction {
                        action: step.action.clone(),
                        start: step.start.clone(),
                        duration: Interval::closed(longest.clone(), longest),
                    });
                }
            }
            _ => {
                if let elbowroom_model::ground::Body::Instantaneous(snap) = &step.action.body {
                    happened.push((step.start.clone(), &snap.effects));
                }
            }
        }
    }
    let mut situation = Situation::initial(task);
    let timed = task.timed().iter().filter(|timed| timed.time <= *now);
    let mut changes: Vec<(Rational, u8, &Change)> = timed
        .flat_map(|timed| {
            timed
                .changes
                .iter()
                .map(|change| (timed.time.clone(), change))
        })
        .map(|(time, change)| (time, u8::from(matches!(change, Change::Add(_))), change))
        .collect();
    for (time, effects) in happened {
        for effect in effects {
            if effect.guard.now != Condition::TRUE {
                return None;
            }
            let order = u8::from(matches!(effect.change, Change::Add(_)));
            changes.push((time.clone(), order, &effect.change));
        }
    }
    changes.sort_by(|a, b| (&a.0, a.1).cmp(&(&b.0, b.1)));
    for (_, _, change) in changes {
        apply(change, &mut situation)?;
    }
    situation.time = now + Rational::new(1, 1000);
    situation.running = running;
    // No timed initial may take effect between the cut and the start of planning.
    let is_quiet =
        |timed: &elbowroom_model::TimedHappening| timed.time <= *now || timed.time > situation.time;
    task.timed().iter().all(is_quiet).then_some(situation)
}

fn apply(change: &Change, situation: &mut Situation) -> Option<()> {
    use elbowroom_model::problem::UpdateOperator;
    match change {
        Change::Add(fact) => {
            situation.state.facts.insert(*fact);
        }
        Change::Delete(fact) => {
            situation.state.facts.remove(fact);
        }
        Change::Update {
            operator,
            fluent,
            value,
        } => {
            let values = &situation.state.values;
            let amount = value.evaluate(&mut |leaf| match leaf {
                elbowroom_model::ground::Expression::Fluent(read) => values.get(read).cloned(),
                _ => None,
            })?;
            let old = values.get(fluent).cloned();
            let new = match operator {
                UpdateOperator::Assign => amount,
                UpdateOperator::Increase => old? + amount,
                UpdateOperator::Decrease => old? - amount,
                UpdateOperator::ScaleUp => old? * amount,
                UpdateOperator::ScaleDown => old?.checked_div(&amount)?,
            };
            situation.state.values.insert(*fluent, new);
        }
    }
    Some(())
}
