//! Executors that believe in another world than that of their runs.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom::answers::NoObserver;
use elbowroom::answers::learn::{LearnRequest, Log, Settings, learn};
use elbowroom::answers::run::simulate;
use elbowroom::execute::{Candidates, Limits, NamedText, RunInputs, RunSpec, WorldNames};
use elbowroom::report::trace::TraceWriter;
use elbowroom_laboratory::compare::Experiment;
use elbowroom_model::{Situation, Task};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_planner::embedded;
use elbowroom_sim::WorldModel;
use indexmap::IndexMap;

fn experiment(name: &str, executors: &[&str]) -> Experiment {
    let mut experiment = crate::shared::experiment(name);
    experiment.columns.truncate(1);
    Experiment {
        executors: executors
            .iter()
            .map(|name| name.parse().expect("a name"))
            .collect(),
        published: Vec::new(),
        optimum: false,
        clairvoyant: false,
        ..experiment
    }
}

/// Returns the percentage of trials in which the first executor reaches the goal, by column.
fn reached(experiment: &Experiment, trials: u64) -> Vec<f64> {
    let results = crate::shared::results(experiment, 0, trials);
    let cells = results.counts.cells[0].iter();
    let few = |count: u64| f64::from(u32::try_from(count).expect("few trials"));
    cells
        .map(|cell| 100.0 * few(cell.successes) / few(cell.runs))
        .collect()
}

/// Returns `count` logs of runs that alternate between plans with different actions. `first` is the
/// seed of the first run.
fn logs(experiment: &Experiment, count: u64, first: u64) -> Vec<Log> {
    let world = &experiment.columns[0].world;
    let source = |text: &str| Source::new("test", text);
    let (problem, _) = read_problem(&source(&experiment.domain), &source(&experiment.problem))
        .expect("it is PDDL");
    let task = Arc::new(Task::new(problem));
    let model = WorldModel::read(world.as_str(), task.problem()).expect("it is a world");
    let limits = Limits {
        work: u64::MAX,
        first_plan_factor: 1,
        most_states: 2_000,
        improve_states: 256,
        other_states: 10_000,
        searches: 12,
    };
    let situation = Situation::initial(&task);
    let settings = embedded::Settings::default();
    let mut source = Candidates::new(&task, &situation, Some(&model), settings, limits);
    let mut plans = IndexMap::new();
    for plan in std::iter::from_fn(|| source.next(&mut |_| true)) {
        let steps = plan.plan.steps.iter();
        let actions: BTreeSet<_> = steps.map(|step| step.action.schema).collect();
        plans.entry(actions).or_insert(plan.plan);
    }
    let named = |name: &str, text: &str| NamedText {
        name: name.to_owned(),
        text: text.to_owned(),
    };
    let logs = plans
        .values()
        .cycle()
        .zip(first..first + count)
        .map(|(plan, seed)| {
            let spec = RunSpec {
                world: Some(world.clone()),
                seed,
                has_plan: true,
                ..RunSpec::new(
                    named("domain.pddl", &experiment.domain),
                    named("problem.pddl", &experiment.problem),
                )
            };
            let mut text = String::new();
            let mut sink = |line: &str| text.push_str(line);
            let mut writer = TraceWriter::new(Arc::clone(&task), &mut sink);
            writer.header(&spec).expect("texts and numbers");
            let inputs = RunInputs::of(spec, Arc::clone(&task), &WorldNames::default());
            let inputs = inputs.expect("a world");
            let execution = inputs.execution(None).expect("a consistent specification");
            let execution = execution.beginning_with(plan.clone());
            let execution = execution.recorded_by(&mut writer);
            simulate(&inputs, execution, &mut NoObserver).expect("a world");
            drop(writer);
            Log::read(&Source::new(format!("run {seed}"), text)).expect("a trace")
        });
    logs.collect()
}

/// `policy` believes in a model that was learnt from a few logs, while the world stays the same.
/// The loss depends on the logs: in `rendezvous`, it is five points if a tenth of failures looks
/// like a sixth. The test checks the mean.
///
/// For the table of docs/reference/learning.md: `ELBOWROOM_LEARNT=20 cargo test --workspace --test laboratory
/// world_learnt -- --nocapture`.
#[test]
fn world_learnt_from_few_logs_is_as_good_as_the_true_one() {
    let times: Option<u64> = std::env::var("ELBOWROOM_LEARNT")
        .ok()
        .and_then(|times| times.parse().ok());
    let counts: &[u64] = if times.is_some() {
        &[20, 50, 200]
    } else {
        &[200]
    };
    let names: &[&str] = if times.is_some() {
        &["weld", "detour", "rendezvous", "door"]
    } else {
        &["rendezvous"]
    };
    let trials = if times.is_some() { 2000 } else { 1000 };
    let times = times.unwrap_or(4);
    for name in names {
        let mut experiment = experiment(name, &["policy"]);
        for count in counts {
            for time in 1..=times {
                let request = LearnRequest {
                    logs: logs(&experiment, *count, 10_000 * time),
                    settings: Settings::default(),
                    conformal_box: None,
                    expected: None,
                };
                let learnt = learn(&request, &mut NoObserver).expect("an answer").world;
                let mut column = experiment.columns[0].clone();
                column.believed = Some(learnt);
                column.name = format!("{count} logs, {time}");
                experiment.columns.push(column);
            }
        }
        let reached = reached(&experiment, trials);
        let (truth, learnt) = reached.split_first().expect("as many as columns");
        let sets = usize::try_from(times).expect("few");
        for (count, of_count) in counts.iter().zip(learnt.chunks(sets)) {
            let few = f64::from(u32::try_from(sets).expect("few"));
            let mean = of_count.iter().sum::<f64>() / few;
            println!(
                "{name}: {truth:.1} %; from {count} logs {mean:.1} on average, {of_count:.1?}"
            );
            assert!(mean + 2.0 >= *truth, "{name}, {count}: {of_count:?}");
        }
    }
}

/// An executor that believes that nothing slips takes the slide.
#[test]
fn executors_use_the_believed_world() {
    let mut experiment = experiment("vase", &["policy"]);
    let own = experiment.columns[0].clone();
    let mut same = own.clone();
    same.believed = Some(own.world.clone());
    let mut wrong = own.clone();
    wrong.believed = Some("format = \"elbowroom-world\"\nversion = 1\n".to_owned());
    experiment.columns.extend([same, wrong]);
    let reached = reached(&experiment, 100);
    assert!((reached[0] - reached[1]).abs() < 1e-9, "{reached:?}");
    assert!(reached[2] < reached[0] - 10.0, "{reached:?}");
}
