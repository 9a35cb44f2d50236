//! Every schedule of a deordered plan is a valid plan. This is checked by the soundness check, also
//! for plans that are prepared without it, and by the validator for random schedules.

#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "the helpers of a test are part of it"
)]

use crate::shared;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use elbowroom::answers::envelope::Search;
use elbowroom::execute::PlanPreparer;
use elbowroom::execution::{PlanForm, Preparer};
use elbowroom::{RoundingRule, pipeline};
use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::soundness::broken_in;
use elbowroom_envelope::{Guarantee, IrrRun, Oracle, irr};
use elbowroom_model::validate::Settings;
use elbowroom_model::{Task, TimeTriggeredPlan, Verdict, validate};
use elbowroom_num::Rational;
use elbowroom_plan::deorder::{Deordered, keeps_all_that_is_read, with_fixed_times};
use elbowroom_plan::parametrize::parametrize;
use elbowroom_plan::{DecoupledEnvelope, NodeId, Schedule, StnPlan, Valuation, network_node};
use elbowroom_stn::{ConsistentNetwork, Constraint};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Draws a schedule: in random order, some nodes get a time in their window, often one of its ends.
/// All others are then as early, or as late, as possible.
fn draw(plan: &StnPlan, rng: &mut ChaCha8Rng) -> Schedule {
    /// Maximum number of nodes with a random time. Computing windows is slow, and large plans do
    /// not need all nodes.
    const MOST: usize = 40;
    let zero = network_node(NodeId::ZERO);
    let network = ConsistentNetwork::try_from(plan.network(&Valuation::default()));
    let mut network = network.expect("the plan has schedules");
    let mut nodes: Vec<NodeId> = plan.nodes().map(|(node, _)| node).skip(1).collect();
    nodes.shuffle(rng);
    for node in nodes.into_iter().take(MOST) {
        let node = network_node(node);
        let earliest = network
            .distance(node, zero)
            .expect("no node comes before zero");
        let earliest = -earliest;
        let beyond = Rational::from(rng.random_range(0..200_i64));
        let latest = network.distance(zero, node);
        let latest = latest.unwrap_or_else(|| &earliest + beyond);
        let share = *[0, 0, 1, 4, 9, 10, 10]
            .choose(rng)
            .expect("it is not empty");
        let time = &earliest + (latest - &earliest) * Rational::new(share, 10);
        network
            .add(Constraint::at_least(zero, node, time.clone()))
            .expect("in its window");
        network
            .add(Constraint::at_most(zero, node, time))
            .expect("in its window");
    }
    let schedule = if rng.random() {
        network.earliest_schedule(zero)
    } else {
        network.latest_schedule(zero)
    };
    schedule.into()
}

/// Returns the validator's objection to a schedule of the plan.
fn objection(task: &Task, plan: &StnPlan, schedule: &Schedule) -> Option<String> {
    let fixed: TimeTriggeredPlan = plan.scheduled(schedule);
    match validate(task, &fixed, &Settings::default()) {
        Verdict::Valid(_) => None,
        Verdict::Invalid(violation) => Some(violation.to_string()),
        Verdict::Undecided(undecided) => Some(undecided.to_string()),
    }
}

/// With all durations as parameters, the nominal schedule is one at the nominal values.
fn assert_parametrized(task: &Task, deordered: &Deordered) {
    let Deordered { plan, nominal, .. } = deordered.clone();
    let open = parametrize(task, plan, &nominal, &[]).unwrap_or_else(|error| panic!("{error}"));
    let network = open.plan.network(&open.nominal());
    assert!(elbowroom_stn::Schedule::from(nominal).holds_in(&network));
}

/// Returns domain, problem and plan of each line of `plans.csv` whose plan is valid by VAL with a
/// tolerance of a thousandth.
fn valid_plans(data: &Path) -> Vec<[PathBuf; 3]> {
    let data = data.join("pddl");
    let table = std::fs::read_to_string(data.join("plans.csv")).unwrap();
    table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>())
        .filter(|cells| cells[10] == "valid")
        .map(|cells| [3, 4, 5].map(|index| data.join(cells[index])))
        .collect()
}

/// Returns domain, problem and plan of the plans next to the authors' STN plan files.
fn plans_of_the_authors(data: &Path) -> Vec<[PathBuf; 3]> {
    let auv = data.join("envelopes/auv");
    let generators = data.join("envelopes/generator_linear");
    let mut plans = Vec::new();
    for plan in files(&auv.join("plans")) {
        let name = plan.file_name().unwrap().to_string_lossy().into_owned();
        let mission = name.trim_start_matches("plan_");
        let domain = auv.join("domains/pandora_domain_strategic_for_validation.pddl");
        plans.push([domain, auv.join(format!("problems/{mission}.pddl")), plan]);
    }
    for plan in files(&generators.join("plans_and_stns")) {
        let name = plan.file_name().unwrap().to_string_lossy().into_owned();
        let Some(number) = name.strip_prefix("output").filter(|rest| rest.len() == 2) else {
            continue;
        };
        let problem = generators.join(format!("gen_linear_prob{number}.pddl"));
        plans.push([
            generators.join("gen_linear_domain_validation.pddl"),
            problem,
            plan,
        ]);
    }
    plans
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Compares two envelopes of a short plan whose deordering is said to preserve all conditions. When
/// such a plan is prepared, its envelope is computed without the conditions. It must equal the
/// envelope with a check of each condition. Returns `false` for other plans.
fn same_envelope(task: &Task, plan: &TimeTriggeredPlan, name: &str) -> bool {
    /// Maximum length of a plan, because the check of each condition takes quadratic time.
    const LONG: usize = 60;
    let task = Arc::new(task.clone());
    let settings = pipeline::Settings {
        search: Search::irr(),
        ..pipeline::Settings::default()
    };
    let mut analyst = PlanPreparer::new(settings.clone());
    let ready =
        (plan.steps.len() <= LONG).then(|| analyst.prepare(&task, plan, PlanForm::Envelope));
    let Some(Ok(ready)) = ready else { return false };
    if !keeps_all_that_is_read(&task, &ready.plan, &ready.nominal) {
        return false;
    }
    let open = Arc::new(ready.plan);
    let settings = settings.search.settings();
    let search = |oracle: Result<Oracle, Refusal>| {
        irr(&mut oracle?, &settings, &mut |_| ControlFlow::Continue(()))
    };
    for guarantee in Guarantee::ALL {
        // One box after the other, and all at once where that is valid: the same steps.
        let asked = search(Oracle::new(&task, &open, guarantee));
        let of_times = search(Oracle::of_times(&task, &open, guarantee));
        let (Ok(asked), Ok(of_times)) = (asked, of_times) else {
            continue;
        };
        let steps = |run: &IrrRun| (run.widenings, run.checks, run.stop);
        assert_eq!(steps(&asked), steps(&of_times), "{name}, {guarantee}");
        let (asked, of_times) = (asked.envelope.ok(), of_times.envelope.ok());
        assert_eq!(asked, of_times, "{name}, {guarantee}");
        if guarantee == Guarantee::default() {
            assert_eq!(ready.envelope, asked, "{name}");
        }
    }
    true
}

/// Number of random schedules for each plan.
const DRAWS: usize = 50;

#[derive(Default)]
struct Count {
    plans: usize,
    reported: usize,
    made_ready: usize,
    unsupported: usize,
    invalid: usize,
    schedules: usize,
    failures: Vec<String>,
}

/// Checks that the deordered plan is sound at the nominal point, that its nominal schedule belongs
/// to it, and that the validator accepts this and other random schedules.
fn examine([domain, problem, plan_file]: &[PathBuf; 3], rng: &mut ChaCha8Rng, count: &mut Count) {
    let name = plan_file.display();
    let Ok(task) = shared::task(domain, problem) else {
        println!("{name}: its problem is not supported");
        count.unsupported += 1;
        return;
    };
    let (plan, _) = RoundingRule::default()
        .read_plan(&shared::source(plan_file), &task)
        .unwrap_or_else(|error| panic!("{}", error.render(false)));
    let freed = match pipeline::free(&task, &plan) {
        Ok(freed) => freed,
        Err(error) => {
            println!("{name}: {error}");
            count.invalid += 1;
            return;
        }
    };
    count.plans += 1;
    count.made_ready += usize::from(same_envelope(&task, &plan, &name.to_string()));
    assert_parametrized(&task, &freed);
    let nominal = freed.nominal.clone();
    let closed = pipeline::without_parameters(&task, freed);
    let network = closed.plan.network(&Valuation::default());
    assert!(
        elbowroom_stn::Schedule::from(nominal.clone()).holds_in(&network),
        "{name}"
    );
    let sound = match broken_in(
        &task,
        &closed,
        &DecoupledEnvelope::point(&Valuation::default()),
    ) {
        Ok(None) => {
            count.reported += 1;
            closed.plan
        }
        Ok(Some(broken)) => {
            let words = broken.requirement.describe(&task, &closed.plan);
            count.failures.push(format!("{name}: {words}"));
            return;
        }
        Err(refusal) => {
            println!("{name}: fixed, as nothing can be told: {refusal}");
            with_fixed_times(closed.plan, &nominal)
        }
    };
    let drawn: Vec<Schedule> = (0..DRAWS).map(|_| draw(&sound, rng)).collect();
    for schedule in std::iter::once(&nominal).chain(&drawn) {
        count.schedules += 1;
        if let Some(objection) = objection(&task, &sound, schedule) {
            count.failures.push(format!("{name}: {objection}"));
            break;
        }
    }
}

fn examine_all(plans: &[[PathBuf; 3]]) -> Count {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut count = Count::default();
    for plan in plans {
        examine(plan, &mut rng, &mut count);
    }
    println!(
        "{} plans deordered ({} problems not supported, {} plans not valid), {} of them found \
         sound, {} schedules judged, {} have the same envelope without a look at their conditions",
        count.plans,
        count.unsupported,
        count.invalid,
        count.reported,
        count.schedules,
        count.made_ready
    );
    assert!(count.failures.is_empty(), "{}", count.failures.join("\n"));
    count
}

/// Returns domain, problem and plan of the cases that come with the project.
fn our_plans() -> Vec<[PathBuf; 3]> {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    let folders = files(&cases).into_iter();
    let with_plan = folders.filter(|folder| folder.join("plan.plan").exists());
    with_plan
        .map(|folder| ["domain.pddl", "problem.pddl", "plan.plan"].map(|file| folder.join(file)))
        .collect()
}

#[test]
fn own_plans_stay_valid_when_deordered() {
    let count = examine_all(&our_plans());
    assert!(count.plans >= 7, "{}", count.plans);
    assert_eq!((count.unsupported, count.invalid), (0, 0));
}

#[test]
fn benchmark_plans_stay_valid_when_deordered() {
    let Some(data) = shared::data() else { return };
    let n: usize = shared::one_in(3);
    let plans: Vec<_> = valid_plans(&data).into_iter().step_by(n).collect();
    let count = examine_all(&plans);
    assert!(count.plans * n >= 110, "{}", count.plans);
    assert!(count.made_ready * n >= 20, "{}", count.made_ready);
}

#[test]
fn plans_of_the_authors_stay_valid_when_deordered() {
    let Some(data) = shared::data() else { return };
    let count = examine_all(&plans_of_the_authors(&data));
    assert!(count.plans >= 20, "{}", count.plans);
}
