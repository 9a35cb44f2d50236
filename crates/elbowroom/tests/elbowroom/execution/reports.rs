//! Wrong reports, one kind at a time: each has a defined outcome.

use std::sync::Arc;

use elbowroom::execute::PlanPreparer;
use elbowroom::execution::run::{Report, RunningRule, Verdict};
use elbowroom::execution::{
    ActionHandle, Cause, Command, Ending, Event, NoRecord, Observation, TimeAdvance, World,
    WorldError,
};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::sim::{SimWorld, WorldModel};

use crate::execution::scene::{EXECUTORS, Scene};

/// World whose reports are modified on their way to the run.
struct Tampered<'a> {
    inner: SimWorld<'a>,
    tamper: &'a mut (dyn FnMut(Observation) -> Vec<Observation> + Send),
}

impl World for Tampered<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let passage = self.inner.wait(until)?;
        let observations = passage.observations.into_iter();
        Ok(TimeAdvance {
            now: passage.now,
            observations: observations.flat_map(&mut *self.tamper).collect(),
        })
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.inner.look(facts, fluents)
    }
}

/// Runs in that world. The run must not report that the goal is reached if it is not.
fn run(
    scene: &Scene,
    executor: &str,
    model: &WorldModel,
    tamper: &mut (dyn FnMut(Observation) -> Vec<Observation> + Send),
) -> Report {
    let inner = SimWorld::new(Arc::clone(&scene.task), model, 1);
    let mut world = Tampered { inner, tamper };
    let mut analyst = PlanPreparer::new(scene.flow.clone());
    let report = scene.run_in(executor, &mut world, &mut analyst, &mut NoRecord);
    if report.verdict == Verdict::GoalReached {
        assert_eq!(world.inner.truth().is_goal(), Ok(true), "{report:#?}");
    }
    report
}

fn ended(observation: &Observation) -> Option<(ActionHandle, &Ending)> {
    match &observation.event {
        Event::Ended { ticket, ending, .. } => Some((*ticket, ending)),
        _ => None,
    }
}

fn causes(report: &Report) -> Vec<Cause> {
    report.reasons.iter().map(|reason| reason.cause).collect()
}

/// Returns the endings of all executions of an action.
fn endings(report: &Report, action: &str) -> Vec<Option<Ending>> {
    let done = report.executed.iter();
    let these = done.filter(|executed| executed.step.action.name.contains(action));
    these.map(|executed| executed.ending.clone()).collect()
}

#[test]
fn a_report_that_comes_twice_counts_once() {
    let scene = Scene::case("delivery");
    for executor in EXECUTORS.iter() {
        let model = WorldModel::without_deviations();
        let once = run(&scene, executor, &model, &mut |it| vec![it]);
        let twice = run(&scene, executor, &model, &mut |it| vec![it.clone(), it]);
        assert_eq!(once.verdict, Verdict::GoalReached);
        assert_eq!(once, twice, "{executor}");
    }
}

/// The drive takes too long, and the concurrent unlocking is cancelled, but has already succeeded.
#[test]
fn a_success_after_a_cancel_counts() {
    let mut scene = Scene::case("delivery");
    scene.settings.running = RunningRule::Cancel;
    let model = scene.world("[[duration]]\naction = \"(drive rover depot shelf)\"\nconstant = 5\n");
    let mut was_cancelled = false;
    let report = run(&scene, "fixed:10", &model, &mut |mut it| {
        if let Event::Ended { ending, .. } = &mut it.event
            && *ending == Ending::Cancelled
        {
            was_cancelled = true;
            *ending = Ending::Succeeded;
        }
        vec![it]
    });
    assert!(was_cancelled);
    assert_eq!(causes(&report)[0], Cause::OutsideInterval);
    assert_eq!(endings(&report, "unlock")[0], Some(Ending::Succeeded));
}

/// The same, but first the cancellation is confirmed, and then a success is reported. The effects
/// of the unlocking are unknown, and the run reports that.
#[test]
fn an_end_after_another_end_is_a_contradiction() {
    let scene = Scene::case("delivery");
    let model = WorldModel::without_deviations();
    let report = run(&scene, "guarded", &model, &mut |it| {
        let mut all = vec![it.clone()];
        if let (
            Some((_, Ending::Succeeded)),
            Event::Ended {
                ticket, measured, ..
            },
        ) = (ended(&it), &it.event)
        {
            all.push(Observation {
                time: it.time.clone(),
                event: Event::Ended {
                    ticket: *ticket,
                    ending: Ending::Failed {
                        why: "so it says".to_owned(),
                    },
                    measured: measured.clone(),
                },
            });
        }
        all
    });
    assert_eq!(causes(&report)[0], Cause::Contradiction, "{report:#?}");
}

#[test]
fn end_that_is_never_reported_times_out() {
    let mut scene = Scene::case("delivery");
    scene.settings.timeout = "2x,30".parse().expect("a correct test");
    for executor in ["fixed:1000", "live"] {
        let mut lost = None;
        let report = run(
            &scene,
            executor,
            &WorldModel::without_deviations(),
            &mut |it| {
                // The first end of any action.
                if let Some((ticket, _)) = ended(&it)
                    && *lost.get_or_insert(ticket) == ticket
                {
                    return Vec::new();
                }
                vec![it]
            },
        );
        assert!(lost.is_some());
        // Either the action times out, or the plan that waits for it is abandoned before.
        let cause = causes(&report)[0];
        let expected = [
            Cause::Silence,
            Cause::Outlived,
            Cause::Unreachable,
            Cause::GuaranteeLost,
        ];
        assert!(expected.contains(&cause), "{executor}: {report:#?}");
        assert!(
            report.time < scene.settings.time_limit,
            "{executor}: {report:#?}"
        );
    }
}

#[test]
fn a_start_that_is_never_reported_is_known_from_its_end() {
    let scene = Scene::case("delivery");
    for executor in EXECUTORS.iter() {
        let report = run(
            &scene,
            executor,
            &WorldModel::without_deviations(),
            &mut |it| {
                if matches!(it.event, Event::Started { .. }) {
                    return Vec::new();
                }
                vec![it]
            },
        );
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{executor}: {report:#?}"
        );
        assert_eq!(report.replans, 0, "{executor}: {report:#?}");
    }
}

#[test]
fn a_report_on_something_never_started_changes_nothing() {
    let scene = Scene::case("delivery");
    for executor in EXECUTORS.iter() {
        let model = WorldModel::without_deviations();
        let clean = run(&scene, executor, &model, &mut |it| vec![it]);
        let report = run(&scene, executor, &model, &mut |it| {
            let ghost = Observation {
                time: it.time.clone(),
                event: Event::Ended {
                    ticket: ActionHandle(9999),
                    ending: Ending::Succeeded,
                    measured: Vec::new(),
                },
            };
            vec![ghost, it]
        });
        assert_eq!(report, clean, "{executor}");
    }
}

#[test]
fn a_report_with_an_impossible_time_is_taken_as_the_nearest_possible() {
    let scene = Scene::case("delivery");
    for (executor, shift) in [("fixed:1000", -1000), ("fixed:1000", 1000)] {
        let report = run(
            &scene,
            executor,
            &WorldModel::without_deviations(),
            &mut |mut it| {
                it.time += Rational::from(shift);
                vec![it]
            },
        );
        for executed in &report.executed {
            let duration = executed.step.duration.clone().unwrap_or_default();
            assert!(!executed.step.start.is_negative(), "{report:#?}");
            assert!(!duration.is_negative(), "{report:#?}");
            assert!(
                &executed.step.start + &duration <= report.time,
                "{report:#?}"
            );
        }
    }
}
