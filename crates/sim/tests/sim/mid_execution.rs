//! Worlds that begin in the middle of an execution, compared with rejection sampling: of many
//! worlds that are run from the beginning, those with the same observations until then.

use std::sync::Arc;

use elbowroom_execution::{
    ActionHandle, BeliefState, Command, Ending, Event, ObservedChange, TimeAdvance, World,
};
use elbowroom_model::Task;
use elbowroom_model::ground::Action;
use elbowroom_model::problem::SchemaId;
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_sim::{ObservedChanges, WorldModel};

const DOMAIN: &str = "(define (domain d) (:requirements :durative-actions)
    (:predicates (done) (open) (lit))
    (:durative-action work :parameters () :duration (= ?duration 5)
      :condition () :effect (at end (done))))";

const PROBLEM: &str = "(define (problem p) (:domain d) (:init (open) (lit)) (:goal (done)))";

/// The work takes 2 to 8 and fails midway with probability 0.3. The door shuts once, early or late,
/// and the light goes out with probability 0.5.
const WORLD: &str = "format = \"elbowroom-world\"\nversion = 1\n
    [[duration]]\naction = \"work\"\nuniform = { from = 2, to = 8 }\n
    [[failure]]\naction = \"work\"\nprobability = 0.3\nwhen = \"midway\"\n
    [[event]]\nfact = \"(open)\"\nbecomes = false\nuniform = { from = 0, to = 6 }\nprobability = 0.5\n
    [[event]]\nfact = \"(open)\"\nbecomes = false\nuniform = { from = 3, to = 12 }\nprobability = 0.8\n
    [[event]]\nfact = \"(lit)\"\nbecomes = false\nuniform = { from = 0, to = 10 }\nprobability = 0.5\n";

fn task() -> Arc<Task> {
    let source = |text: &str| Source::new("test", text);
    let (problem, _) = read_problem(&source(DOMAIN), &source(PROBLEM)).expect("it works");
    Arc::new(Task::new(problem))
}

fn work(task: &Task) -> Action {
    task.instantiate(SchemaId::from(0), &[]).expect("it works")
}

/// Events of a world from now until 20.
#[derive(Debug, Default, PartialEq)]
struct EventTimes {
    /// The time of the action's end, and `true` if it succeeded.
    ended: Option<(f64, bool)>,
    door_shut: Option<f64>,
    light_out: Option<f64>,
}

fn simulate(task: &Task, world: &mut dyn World) -> EventTimes {
    let mut course = EventTimes::default();
    let end = Rational::from(20);
    loop {
        let TimeAdvance { now, observations } = world.wait(&end).expect("it works");
        for observation in observations {
            let time = observation.time.to_f64();
            match observation.event {
                Event::Ended { ending, .. } => {
                    course.ended = Some((time, ending == Ending::Succeeded));
                }
                Event::Fact { fact, .. } if task.fact_name(fact) == "(open)" => {
                    course.door_shut = course.door_shut.or(Some(time));
                }
                Event::Fact { .. } => course.light_out = Some(time),
                _ => {}
            }
        }
        if now >= end {
            return course;
        }
    }
}

/// Runs a world from the beginning, with the work started at 0.
fn simulate_from_start(task: &Arc<Task>, model: &WorldModel, seed: u64) -> EventTimes {
    let mut world = model.world(task, seed);
    let action = work(task);
    let start = Command::Start {
        ticket: ActionHandle(0),
        action: Arc::new(action),
        duration: Some(Rational::from(5)),
    };
    world.command(&Rational::ZERO, &start).expect("it works");
    simulate(task, world.as_mut())
}

/// Returns the shares of worlds in which the work succeeds, the work ends after 6, the light goes
/// out, and the door shuts after 4.
#[allow(clippy::cast_precision_loss, reason = "there are few worlds")]
fn shares(courses: &[EventTimes]) -> [f64; 4] {
    let share = |is_so: &dyn Fn(&EventTimes) -> bool| {
        courses.iter().filter(|it| is_so(it)).count() as f64 / courses.len() as f64
    };
    [
        share(&|it| it.ended.is_some_and(|(_, succeeded)| succeeded)),
        share(&|it| it.ended.is_some_and(|(time, _)| time > 6.0)),
        share(&|it| it.light_out.is_some()),
        share(&|it| it.door_shut.is_some_and(|time| time > 4.0)),
    ]
}

#[test]
fn future_events_are_drawn_conditionally_on_observations() {
    let task = task();
    let model = WorldModel::read(WORLD, task.problem()).expect("it works");
    let goes_with = |course: &EventTimes| {
        let is_later = |time: Option<f64>| time.is_none_or(|time| time > 4.0);
        is_later(course.ended.map(|(time, _)| time))
            && is_later(course.light_out)
            && is_later(course.door_shut)
    };
    let all = (0..20_000).map(|seed| simulate_from_start(&task, &model, seed));
    let kept: Vec<EventTimes> = all.filter(goes_with).collect();

    let mut belief = BeliefState::new(Arc::clone(&task));
    let action = Arc::new(work(&task));
    belief
        .start(ActionHandle(0), &action, &Rational::from(5), &[])
        .expect("it works");
    belief.advance(&Rational::from(4)).expect("it works");
    let drawn = (0..4000).map(|seed| {
        let mut world = model.world_in_mid_execution(&belief, seed, &ObservedChanges::default());
        simulate(&task, world.as_mut())
    });
    let drawn: Vec<EventTimes> = drawn.collect();
    assert!(drawn.iter().all(goes_with));
    assert!(kept.len() > 1000, "{}", kept.len());
    for (plain, drawn) in shares(&kept).into_iter().zip(shares(&drawn)) {
        assert!((plain - drawn).abs() < 0.05, "{plain} beside {drawn}");
    }
}

/// The door was observed to shut at 3.5, so the same event does not come again.
#[test]
fn observed_event_does_not_recur() {
    let task = task();
    let model = WorldModel::read(WORLD, task.problem()).expect("it works");
    let fact = task.fact_named("(open)").expect("it works");
    let mut belief = BeliefState::new(Arc::clone(&task));
    belief.advance(&Rational::from(4)).expect("it works");
    belief.change_fact(fact, false);
    let seen = ObservedChanges {
        changes: vec![ObservedChange {
            time: Rational::new(7, 2),
            fact,
            truth: false,
            is_spontaneous: true,
        }],
    };
    let again = (0..200).filter(|seed| {
        let mut world = model.world_in_mid_execution(&belief, *seed, &seen);
        simulate(&task, world.as_mut()).door_shut.is_some()
    });
    // The other event finds the door shut already. It is reported and changes nothing.
    let again = again.count();
    assert!((40..=180).contains(&again), "{again}");
}

/// Two runs that continue from here meet the same world as long as they do the same.
#[test]
fn same_seed_continues_identically() {
    let task = task();
    let model = WorldModel::read(WORLD, task.problem()).expect("it works");
    let belief = BeliefState::new(Arc::clone(&task));
    let one = |seed| {
        let mut world = model.world_in_mid_execution(&belief, seed, &ObservedChanges::default());
        simulate(&task, world.as_mut())
    };
    assert!((0..20).all(|seed| one(seed) == one(seed)));
    assert!((1..20).any(|seed| one(seed) != one(0)));
}
