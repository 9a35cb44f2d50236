//! Requirements on all executors in the registry, with worlds that satisfy their contract and
//! worlds that violate it. The tests need only this crate and a plan.

mod scene;

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use elbowroom_execution::executors::{EXECUTORS, OrderCache};
use elbowroom_execution::run::{Next, Report, Run, RunSettings, Verdict};
use elbowroom_execution::{
    ActionHandle, Command, Entry, PortWorkers, Recorder, TimeAdvance, World, WorldError,
};
use elbowroom_num::Rational;
use scene::{Scene, ToyWorld, WorldFaults};

/// Recorder that keeps each entry as text; of a plan, only its adoption.
#[derive(Clone, Default)]
struct Notes(Arc<Mutex<Vec<String>>>);

impl Recorder for Notes {
    fn record(&mut self, entry: &Entry<'_>) {
        let mut notes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        notes.push(match entry {
            // Its table of facts is a hash map without a defined order.
            Entry::PlanAdopted(mission) => format!("a plan from {}", mission.origin),
            other => format!("{other:?}"),
        });
    }
}

impl Notes {
    fn taken(&self) -> Vec<String> {
        let notes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        notes.clone()
    }
}

/// Started actions that have neither ended nor been cancelled.
#[derive(Default)]
struct CommandLedger {
    open: BTreeSet<ActionHandle>,
    given: BTreeSet<ActionHandle>,
}

/// Drives a run to its end.
fn drive(
    (mut run, mut workers): (Run<'_>, PortWorkers<'_>),
    world: &mut dyn World,
) -> (Report, CommandLedger) {
    let mut books = CommandLedger::default();
    loop {
        let answered = match run.next() {
            Next::Command(command) => {
                match &command {
                    Command::Start { ticket, .. } => {
                        assert!(books.given.insert(*ticket), "each start has its own ticket");
                        books.open.insert(*ticket);
                    }
                    Command::Cancel { ticket } => {
                        assert!(
                            books.given.contains(ticket),
                            "only what was started is cancelled"
                        );
                        books.open.remove(ticket);
                    }
                }
                world.command(run.now(), &command)
            }
            Next::Wait { until } => {
                assert!(until >= *run.now(), "nobody waits for the past");
                world.wait(&until).map(|passage| {
                    for ended in scene::ended(&passage) {
                        books.open.remove(&ended);
                    }
                    run.observe(passage).expect("it was asked for");
                })
            }
            Next::Look { facts, fluents } => world
                .look(&facts, &fluents)
                .map(|seen| run.observe_requested(seen).expect("it was asked for")),
            Next::Over(report) => return (report, books),
            request => {
                run.delegate(request, &mut workers);
                Ok(())
            }
        };
        if let Err(error) = answered {
            run.fail(error);
        }
    }
}

#[test]
fn undisturbed_run_reaches_goal_without_replan() {
    let scene = Scene::new();
    for registered in EXECUTORS {
        let executor = registered.example();
        let notes = Notes::default();
        let run = scene.run(&executor, notes, RunSettings::default());
        let (report, books) = drive(run, &mut ToyWorld::new(WorldFaults::None));
        assert_eq!(report.verdict, Verdict::GoalReached, "{executor}");
        assert_eq!(report.replans, 0, "{executor}: {:?}", report.reasons);
        assert!(books.open.is_empty(), "{executor}");
        assert!(report.starts >= 2, "{executor}");
    }
}

#[test]
fn same_history_yields_same_decisions() {
    let scene = Scene::new();
    for registered in EXECUTORS {
        let executor = registered.example();
        for seed in 0..5 {
            let record = || {
                let notes = Notes::default();
                let run = scene.run(&executor, notes.clone(), RunSettings::default());
                drive(run, &mut ToyWorld::new(WorldFaults::Seeded(seed)));
                notes.taken()
            };
            assert_eq!(record(), record(), "{executor}, {seed}");
        }
    }
}

#[test]
fn cached_orders_change_no_decision() {
    let decisions = |orders: Option<OrderCache>| -> Vec<Vec<String>> {
        let mut scene = Scene::new();
        scene.orders = orders;
        let runs = (0..20).map(|seed| {
            let notes = Notes::default();
            let run = scene.run("adaptable", notes.clone(), RunSettings::default());
            drive(run, &mut ToyWorld::new(WorldFaults::Seeded(seed)));
            notes.taken()
        });
        runs.collect()
    };
    assert_eq!(decisions(None), decisions(Some(OrderCache::default())));
}

#[test]
fn arbitrary_reports_end_run_without_running_actions() {
    let scene = Scene::new();
    let settings = RunSettings {
        time_limit: Rational::from(5000),
        ..RunSettings::default()
    };
    let mut verdicts = BTreeSet::new();
    for registered in EXECUTORS {
        let executor = registered.example();
        for seed in 0..40 {
            let run = scene.run(&executor, Notes::default(), settings.clone());
            let (report, books) = drive(run, &mut ToyWorld::new(WorldFaults::Seeded(seed)));
            verdicts.insert(report.verdict.name());
            assert!(
                books.open.is_empty(),
                "{executor}, {seed}: {:?}",
                books.open
            );
            assert!(
                report.time <= Rational::from(5000 + 6),
                "{executor}, {seed}"
            );
        }
    }
    assert!(verdicts.len() > 1, "the whims matter: {verdicts:?}");
}

#[test]
fn world_failure_ends_run_at_once() {
    /// World that fails after a number of answers.
    struct FailingWorld {
        inner: ToyWorld,
        left: usize,
    }
    impl FailingWorld {
        fn count_call(&mut self) -> Result<(), WorldError> {
            self.left = self
                .left
                .checked_sub(1)
                .ok_or_else(|| WorldError::new("it is gone"))?;
            Ok(())
        }
    }
    impl World for FailingWorld {
        fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
            self.count_call()?;
            self.inner.command(now, command)
        }
        fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
            self.count_call()?;
            self.inner.wait(until)
        }
    }
    let scene = Scene::new();
    for registered in EXECUTORS {
        let executor = registered.example();
        for left in 0..6 {
            let run = scene.run(&executor, Notes::default(), RunSettings::default());
            let inner = ToyWorld::new(WorldFaults::None);
            let (report, _) = drive(run, &mut FailingWorld { inner, left });
            let why = "it is gone".to_owned();
            let failed = Verdict::WorldFailed { why };
            if report.verdict != failed {
                // The plan was finished before the failure.
                assert_eq!(report.verdict, Verdict::GoalReached, "{executor}, {left}");
                assert!(left > 2, "{executor}, {left}");
            }
        }
    }
}

#[test]
fn run_can_move_between_threads() {
    let scene = Scene::new();
    for registered in EXECUTORS {
        let (mut run, mut workers) = scene.run(
            &registered.example(),
            Notes::default(),
            RunSettings::default(),
        );
        let preparation = run.next();
        run.delegate(preparation, &mut workers);
        let Next::Command(first) = run.next() else {
            panic!("the plan begins with a start");
        };
        let moved = std::thread::spawn(move || {
            let mut world = ToyWorld::new(WorldFaults::None);
            let told = world.command(&Rational::ZERO, &first);
            told.expect("the toy takes everything");
            run.run_to_end(&mut world, &mut workers)
        });
        let report = moved.join().expect("nobody panics");
        assert_eq!(report.verdict, Verdict::GoalReached, "{}", registered.name);
    }
}
