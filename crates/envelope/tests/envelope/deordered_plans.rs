//! Deordering compared with the validator, on problems constructed so that a random plan is valid.
//!
//! The test begins with a random plan of random effects. Then it adds conditions one at a time that
//! the validator confirms in that plan, so that they are many and tight. In every schedule of the
//! deordered plan, the validator must confirm them as well.

mod scenario;

use elbowroom_envelope::obligations::{Obligations, Refusal, Substitution};
use elbowroom_envelope::soundness::{Broken, broken_in};
use elbowroom_model::{Task, TimeTriggeredPlan, Verdict, validate};
use elbowroom_num::Rational;
use elbowroom_plan::deorder::{
    Deordered, deorder, keeps_all_that_is_read, pin_until_sound, with_fixed_times,
};
use elbowroom_plan::{
    DecoupledEnvelope, NodeId, ParametrizedPlan, Schedule, StnPlan, Valuation, network_node,
};
use elbowroom_stn::{ConsistentNetwork, Constraint};
use rand::SeedableRng;
use rand::seq::{IndexedRandom, SliceRandom};
use rand_chacha::ChaCha8Rng;

use scenario::{scenario, time};

/// Returns a schedule whose nodes, in random order, take an end or a random point of their windows.
fn draw(plan: &StnPlan, rng: &mut ChaCha8Rng) -> Schedule {
    let zero = network_node(NodeId::ZERO);
    let mut network = ConsistentNetwork::try_from(plan.network(&Valuation::default()))
        .expect("a plan with a schedule");
    let mut nodes: Vec<_> = network.network().nodes().skip(1).collect();
    nodes.shuffle(rng);
    for node in nodes {
        let windows = network.windows(zero);
        let earliest = windows[node]
            .earliest
            .clone()
            .expect("times are not negative");
        let latest = windows[node].latest.clone();
        let latest = latest.unwrap_or_else(|| &earliest + time(rng, 20));
        let share = *[0, 0, 1, 2, 4, 4].choose(rng).expect("shares");
        let at = &earliest + (latest - &earliest) * Rational::new(share, 4);
        network
            .add(Constraint::at_least(zero, node, at.clone()))
            .expect("inside its window");
        network
            .add(Constraint::at_most(zero, node, at))
            .expect("inside its window");
    }
    network.schedule().relative_to(zero).into()
}

/// Describes the steps with their conditions and effects, and their remaining order.
fn shown(task: &Task, plan: &StnPlan, fixed: &TimeTriggeredPlan) -> String {
    let steps = fixed.steps.iter().map(|step| {
        let duration = step.duration.clone().unwrap_or_default();
        format!(
            "{}: {} [{duration}] {:?}\n",
            step.start, step.action.name, step.action.body
        )
    });
    let order = plan.constraints.iter().map(|constraint| {
        let (from, to) = (
            plan.node_label(constraint.from),
            plan.node_label(constraint.to),
        );
        let (lower, upper) = (&constraint.lower, &constraint.upper);
        format!(
            "{to} - {from} in [{lower:?}, {upper:?}]: {:?}\n",
            constraint.reason
        )
    });
    let timed = format!("{:?}\n", task.timed());
    steps.chain(order).chain([timed]).collect()
}

/// Returns an obligation that some schedule of the plan violates.
fn broken(task: &Task, plan: &StnPlan) -> Result<Option<Broken>, Refusal> {
    let closed = ParametrizedPlan::closed(task, plan.clone());
    let everything = DecoupledEnvelope::point(&Valuation::default());
    broken_in(task, &closed, &everything)
}

fn assert_sound(seed: u64, task: &Task, plan: &StnPlan, rng: &mut ChaCha8Rng) {
    for _ in 0..12 {
        let fixed = plan.scheduled(&draw(plan, rng));
        let verdict = validate(
            task,
            &fixed,
            &elbowroom_model::validate::Settings::default(),
        );
        if let Verdict::Invalid(violation) = verdict {
            panic!("seed {seed}: {violation}\n{}", shown(task, plan, &fixed));
        }
    }
}

/// Returns a random scenario, deordered, with its random number generator.
fn deordered(seed: u64, is_timeless: bool) -> (ChaCha8Rng, Task, Deordered) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let scenario = scenario(&mut rng, is_timeless);
    let task = scenario.task();
    let deordered = deorder(&task, &scenario.plan(&task));
    (
        rng,
        task,
        deordered.unwrap_or_else(|error| panic!("{seed}: {error}")),
    )
}

/// If [`keeps_all_that_is_read`] returns `true`, deordering alone keeps the plan valid. The
/// validator and the soundness check confirm that.
#[test]
fn lossless_deordering_has_only_valid_schedules() {
    let (mut kept, mut with_numbers, mut in_doubt, mut unsound) = (0, 0, 0, 0);
    for seed in 0..1500 {
        let (mut rng, task, Deordered { plan, nominal, .. }) = deordered(seed, seed % 4 > 0);
        let closed = ParametrizedPlan::closed(&task, plan.clone());
        if !keeps_all_that_is_read(&task, &closed, &nominal) {
            in_doubt += 1;
            unsound += usize::from(matches!(broken(&task, &plan), Ok(Some(_))));
            continue;
        }
        kept += 1;
        with_numbers += usize::from(closed.reads_more_than_facts(&task));
        assert_sound(seed, &task, &plan, &mut rng);
        if let Ok(Some(broken)) = broken(&task, &plan) {
            let words = broken.requirement.describe(&task, &plan);
            panic!("seed {seed}: {words}");
        }
    }
    println!(
        "{kept} plans are kept whole by deordering, {with_numbers} of them read numbers; of {in_doubt} in doubt, \
         {unsound} are not"
    );
    assert!(kept > 100 && with_numbers > 50, "{kept}, {with_numbers}");
    assert!(unsound > 0, "the scenarios are too easy");
}

#[test]
fn pinned_time_dependent_plans_have_only_valid_schedules() {
    let (mut pinned, mut untold) = (0, 0);
    for seed in 0..250 {
        let (mut rng, task, Deordered { plan, nominal, .. }) = deordered(seed, false);
        let mut is_told = true;
        let sound = pin_until_sound(plan.clone(), &nominal, &mut |plan| {
            let broken = broken(&task, plan);
            is_told &= broken.is_ok();
            let broken = broken.ok()??;
            let differences = broken.case.differences.iter();
            let nodes = differences.flat_map(|difference| [difference.from, difference.to]);
            let inequalities = broken.case.inequalities.iter();
            let others = inequalities.flat_map(|inequality| inequality.expression.times.keys());
            let all = nodes.chain(others);
            Some(all.filter(|node| node.index() < plan.nodes.len()).collect())
        });
        untold += usize::from(!is_told);
        let sound = match sound {
            Some(sound) if is_told => sound,
            _ => with_fixed_times(plan.clone(), &nominal),
        };
        pinned += usize::from(sound != plan);
        assert_sound(seed, &task, &sound, &mut rng);
    }
    assert!(pinned > 0, "the scenarios are too easy");
    println!("{pinned} of 250 plans needed pins; of {untold} nothing could be told");
}

/// For an over-all condition, only events that can be on either side of a moment inside the action
/// are placed. The result equals that of placing every event, for every moment.
#[test]
fn distant_events_do_not_affect_over_all_conditions() {
    let (mut conditions, mut fewer) = (0, 0);
    for seed in 0..400 {
        let (mut rng, task, Deordered { plan, nominal, .. }) = deordered(seed, false);
        let closed = ParametrizedPlan::closed(&task, plan.clone());
        let around = (&nominal, &Valuation::default());
        let compiled = Obligations::compile(&task, &closed, around, &Substitution::default());
        let Ok(compiled) = compiled else { continue };
        for over_all in &compiled.over_all {
            conditions += 1;
            fewer += usize::from(over_all.events(true).len() < over_all.events(false).len());
        }
        for schedule in (0..6).map(|_| draw(&plan, &mut rng)) {
            for over_all in &compiled.over_all {
                let (start, end) = (&schedule[over_all.start], &schedule[over_all.end]);
                if start >= end {
                    continue;
                }
                let events = over_all.events(false);
                let times = events.iter().map(|event| &schedule[*event]);
                let inside = times.filter(|&time| start < time && time < end);
                for moment in inside.chain([start]) {
                    let cut = |node: NodeId| schedule[node] <= *moment;
                    assert_eq!(
                        over_all.cases(&task, &plan, true, &cut),
                        over_all.cases(&task, &plan, false, &cut),
                        "seed {seed}: {:?}",
                        over_all.condition
                    );
                }
            }
        }
    }
    println!("{conditions} conditions, {fewer} of which need not place all events");
    assert!(conditions > 100 && fewer > 50, "{conditions}, {fewer}");
}
