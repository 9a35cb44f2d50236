//! Every schedule of a deordered plan is a valid plan: the judge says so of schedules drawn at
//! random.

#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "the helpers of a test are part of it"
)]

mod shared;

use std::path::Path;

use elbowroom_envelope::obligations::Requirement;
use elbowroom_envelope::soundness::broken_in;
use elbowroom_model::validate::Settings;
use elbowroom_model::{Task, TimeTriggeredPlan, Verdict, validate};
use elbowroom_num::Rational;
use elbowroom_pddl::read_plan;
use elbowroom_plan::deorder::{self, Deordered, deorder, pin_until_sound, pinned_to};
use elbowroom_plan::parametrize::parametrize;
use elbowroom_plan::{
    DecoupledEnvelope, NodeId, ParametrizedPlan, Schedule, StnPlan, network_node,
};
use elbowroom_stn::{ConsistentNetwork, Constraint};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A schedule of the plan: some nodes, in random order, take a time in their window, often one of
/// its ends; all others are as early, or as late, as they can be then.
fn draw(plan: &StnPlan, rng: &mut ChaCha8Rng) -> Schedule {
    /// Looking up windows takes time; of large plans, not all nodes need it.
    const MOST: usize = 40;
    let zero = network_node(NodeId::ZERO);
    let network = ConsistentNetwork::try_from(plan.network(&[]));
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
    schedule.times().to_vec()
}

/// What the judge objects to in a schedule of the plan.
fn objection(task: &Task, plan: &StnPlan, schedule: &[Rational]) -> Option<String> {
    let fixed: TimeTriggeredPlan = plan.scheduled(schedule);
    match validate(task, &fixed, &Settings::default()) {
        Verdict::Valid(_) => None,
        Verdict::Invalid(violation) => Some(violation.to_string()),
        Verdict::Undecided(undecided) => Some(undecided.to_string()),
    }
}

/// The plan with as many differences fixed as needed, or why that cannot be told.
fn pinned(task: &Task, deordered: &Deordered, epsilon: &Rational) -> Result<StnPlan, String> {
    let mut refusal = None;
    let mut oracle = |plan: &StnPlan| {
        let closed = ParametrizedPlan::closed(task, plan.clone());
        let point = DecoupledEnvelope::point(&[]);
        match broken_in(task, &closed, epsilon, &point) {
            Ok(broken) => broken.map(|broken| {
                let differences = broken.case.differences.iter();
                let mut nodes: Vec<NodeId> = differences
                    .flat_map(|difference| [difference.from, difference.to])
                    .collect();
                for inequality in &broken.case.inequalities {
                    nodes.extend(inequality.expression.times.keys());
                }
                nodes.retain(|node| node.index() < plan.nodes.len());
                if let Requirement::Condition { node, .. }
                | Requirement::Defined { node, .. }
                | Requirement::OneUpdate { node, .. } = broken.requirement
                {
                    nodes.push(node);
                }
                nodes
            }),
            Err(error) => {
                refusal = Some(error.to_string());
                None
            }
        }
    };
    let plan = pin_until_sound(deordered.plan.clone(), &deordered.nominal, &mut oracle);
    match (refusal, plan) {
        (Some(refusal), _) => Err(refusal),
        (None, Some(plan)) => Ok(plan),
        (None, None) => Err("even the nominal schedule is not sound".to_owned()),
    }
}

/// With all durations left open, the nominal schedule is one at the nominal values.
fn assert_parametrized(task: &Task, deordered: &Deordered) {
    let Deordered { plan, nominal } = deordered.clone();
    let open = parametrize(task, plan, &nominal, &[]).unwrap_or_else(|error| panic!("{error}"));
    let network = open.plan.network(&open.nominal());
    assert!(elbowroom_stn::Schedule::new(nominal).holds_in(&network));
}

/// A line of `plans.csv` whose plan is valid when VAL is called with a tolerance of a thousandth.
fn valid_plans(data: &Path) -> Vec<[String; 3]> {
    let table = std::fs::read_to_string(data.join("plans.csv")).unwrap();
    table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>())
        .filter(|cells| cells[10] == "valid")
        .map(|cells| {
            [
                cells[3].to_owned(),
                cells[4].to_owned(),
                cells[5].to_owned(),
            ]
        })
        .collect()
}

/// How many schedules are drawn of each plan.
const DRAWS: usize = 20;

#[test]
fn random_schedules_of_deordered_plans_are_valid() {
    let Some(data) = shared::data().map(|data| data.join("pddl")) else {
        return;
    };
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let settings = deorder::Settings::default();
    let (mut plans, mut schedules, mut pins, mut unreadable) = (0, 0, 0, 0);
    let mut failures = Vec::new();
    for [domain, problem, plan_file] in valid_plans(&data) {
        let Ok(mut task) = shared::task(&data.join(domain), &data.join(problem)) else {
            println!("{plan_file}: its problem is not supported");
            unreadable += 1;
            continue;
        };
        let (plan, _) = read_plan(&shared::source(&data.join(&plan_file)), &mut task)
            .unwrap_or_else(|error| panic!("{}", error.render(false)));
        let deordered = match deorder(&task, &plan, &settings) {
            Ok(deordered) => deordered,
            Err(error) => {
                failures.push(format!("{plan_file}: {error}"));
                continue;
            }
        };
        plans += 1;
        assert_parametrized(&task, &deordered);
        let sound = pinned(&task, &deordered, &settings.epsilon).unwrap_or_else(|reason| {
            println!("{plan_file}: fixed, as nothing can be told: {reason}");
            pinned_to(deordered.plan.clone(), &deordered.nominal)
        });
        pins += usize::from(sound != deordered.plan);
        for _ in 0..DRAWS {
            schedules += 1;
            if let Some(objection) = objection(&task, &sound, &draw(&sound, &mut rng)) {
                failures.push(format!("{plan_file}: {objection}"));
                break;
            }
        }
    }
    println!(
        "{plans} plans deordered ({unreadable} not supported), {pins} with pins, \
         {schedules} schedules judged"
    );
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
