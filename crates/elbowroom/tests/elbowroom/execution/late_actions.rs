//! Actions that take longer than planned: a warning while there is slack, a wait while the plan is
//! feasible, and replanning without them afterwards.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom::execute::Embedded;
use elbowroom::execution::run::{MissingPlan, Report, RunSettings, Verdict};
use elbowroom::execution::{
    ActionHandle, Command, Ending, Event, NoPlanner, Observation, Planner, PlannerAnswer,
    TimeAdvance, World, WorldError,
};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::sim::SimWorld;

use crate::execution::persistent::scripted::{Notes, ScriptedWorld};
use crate::execution::scene::{Scene, read};

/// Runs the walker. Walking and climbing take 20 of 26 seconds, and the envelope allows 15.3125 for
/// walking. There is also a slide, which needs a free path; a cancelled walk frees the path.
fn run_with_slow_walk(seconds: Rational, watches_room: bool) -> (Report, Vec<String>) {
    let (scene, mut world) = walker(seconds);
    let notes = Notes::default();
    let report = scene
        .execution("guarded")
        .with_settings(RunSettings {
            monitors_slack: watches_room,
            ..scene.settings.clone()
        })
        .recorded_by(notes.clone())
        .run_in(&mut world);
    let notes = notes.0.lock().unwrap_or_else(PoisonError::into_inner);
    (report, notes.clone())
}

fn walker(seconds: Rational) -> (Scene, ScriptedWorld) {
    let file = |name: &str| read(&format!("crates/cli/tests/files/late/{name}"));
    let plan = file("plan.plan");
    let scene = Scene::new(&file("domain.pddl"), &file("problem.pddl"), Some(&plan));
    let path = scene.task.fact_named("(path)").expect("a correct test");
    let world = ScriptedWorld {
        now: Rational::ZERO,
        coming: Vec::new(),
        end: Rational::from(2000),
        stop_requested: Arc::default(),
        slow: Some(("(walk)", seconds)),
        on_cancel: Some(Event::Fact {
            fact: path,
            truth: true,
        }),
    };
    (scene, world)
}

fn done(report: &Report) -> Vec<&str> {
    let names = report.executed.iter();
    names.map(|it| it.step.action.name.as_str()).collect()
}

#[test]
fn warning_precedes_required_replan() {
    let (report, notes) = run_with_slow_walk(Rational::new(29, 2), true);
    assert_eq!(
        (&report.verdict, report.replans),
        (&Verdict::GoalReached, 0),
        "{notes:#?}"
    );
    let warnings: Vec<_> = notes
        .iter()
        .filter(|it| it.contains("must end by"))
        .collect();
    assert_eq!(warnings, ["14: (walk) must end by 15.3"], "{notes:#?}");
    for (seconds, watches_room) in [(12, true), (14, false)] {
        let (_, notes) = run_with_slow_walk(Rational::from(seconds), watches_room);
        assert!(
            !notes.iter().any(|it| it.contains("must end by")),
            "{notes:#?}"
        );
    }
}

#[test]
fn late_action_is_awaited_while_plan_is_feasible() {
    let (report, notes) = run_with_slow_walk(Rational::new(31, 2), true);
    assert_eq!(report.verdict, Verdict::GoalReached, "{notes:#?}");
    assert_eq!(done(&report), ["(walk)", "(climb)"]);
    assert_eq!(report.executed[0].step.duration, Some(Rational::new(31, 2)));
}

#[test]
fn late_action_fails_if_no_plan_is_feasible_with_it() {
    let (report, notes) = run_with_slow_walk(Rational::from(1000), true);
    assert_eq!(report.verdict, Verdict::GoalReached, "{notes:#?}");
    assert_eq!(done(&report), ["(walk)", "(slide)"]);
    assert_eq!(report.executed[0].ending, Some(Ending::Cancelled));
    let took = report.executed[0]
        .step
        .duration
        .clone()
        .expect("it takes time");
    assert!(
        took >= Rational::from(15) && took < Rational::from(17),
        "{took}: {notes:#?}"
    );
}

/// The envelope uses all of the six seconds of slack, so the walk would have to start at once. On a
/// clock no start is exactly on time.
#[test]
fn late_start_uses_slack_without_replanning() {
    let (scene, _) = walker(Rational::from(10));
    let run = |delay: &str| {
        let model = format!("[[delay]]\naction = \"walk\"\nconstant = {delay}\n");
        let report = scene.run("guarded", &scene.world(&model), 1);
        assert_eq!(report.verdict, Verdict::GoalReached, "{delay}: {report:#?}");
        report
    };
    for delay in ["0.1", "0.5", "4"] {
        let report = run(delay);
        assert_eq!(report.replans, 0, "{delay}: {report:#?}");
        assert_eq!(done(&report), ["(walk)", "(climb)"]);
        assert!(scene.judged(&report).is_valid());
    }
    // With a sixteenth of the slack no new plan would be needed.
    assert!(run("5.8").replans > 0);
}

/// The remaining slack of the envelope counts: a longer walk makes the plan infeasible.
#[test]
fn envelope_applies_after_late_start() {
    let (scene, _) = walker(Rational::from(10));
    let run = |duration: &str| {
        let model = format!(
            "[[delay]]\naction = \"walk\"\nconstant = 1\n\
             [[duration]]\naction = \"walk\"\nconstant = {duration}\n"
        );
        scene.run("guarded", &scene.world(&model), 1)
    };
    assert_eq!(run("12.5").replans, 0);
    assert!(run("15.5").replans > 0);
}

/// Runs in a world with this delay and duration of the walk. Returns the report and the warnings.
fn warned(scene: &Scene, executor: &str, delay: &str, duration: &str) -> (Report, Vec<String>) {
    let model = scene.world(&format!(
        "[[delay]]\naction = \"walk\"\nconstant = {delay}\n\
         [[duration]]\naction = \"walk\"\nconstant = {duration}\n"
    ));
    let notes = Notes::default();
    let settings = RunSettings {
        monitors_slack: true,
        ..scene.settings.clone()
    };
    let execution = scene.execution(executor).with_settings(settings);
    let execution = execution.with_planner(NoPlanner).recorded_by(notes.clone());
    let report = execution.run_in(&mut SimWorld::new(Arc::clone(&scene.task), &model, 1));
    let notes = notes.0.lock().unwrap_or_else(PoisonError::into_inner);
    let warnings = notes.iter().filter(|it| it.contains("must end by"));
    (report, warnings.cloned().collect())
}

/// On a clock each start is slightly late. The slack is reduced by no more than the delay: the walk
/// may use the rest of the six seconds, except the climb's share.
#[test]
fn slightly_late_start_uses_little_slack() {
    let (scene, _) = walker(Rational::from(10));
    for (delay, duration) in [("0.000003", "15.3"), ("0.05", "15.25"), ("1", "14.6")] {
        for executor in ["guarded", "live"] {
            let (report, warnings) = warned(&scene, executor, delay, duration);
            let outcome = (&report.verdict, report.replans);
            assert_eq!(
                outcome,
                (&Verdict::GoalReached, 0),
                "{executor}, {delay}: {warnings:?} {report:#?}"
            );
            assert!(scene.judged(&report).is_valid());
        }
    }
}

/// A warning names the latest time at which no new plan is needed, and a new plan is needed at that
/// time.
#[test]
fn warning_states_latest_feasible_time() {
    let (scene, _) = walker(Rational::from(10));
    for (executor, delay) in [
        ("guarded", "0"),
        ("guarded", "0.000003"),
        ("guarded", "0.05"),
        ("live", "0"),
        ("live", "0.05"),
        ("live", "3"),
    ] {
        let (report, warnings) = warned(&scene, executor, delay, "1000");
        let [warning] = &warnings[..] else {
            panic!("{executor}, {delay}: {warnings:?}");
        };
        let until: Rational = warning
            .rsplit(' ')
            .next()
            .and_then(|it| it.parse().ok())
            .expect("a time");
        let needed = report.reasons[0]
            .since
            .clone()
            .expect("it is told since when");
        let difference = (&until - &needed).abs();
        assert!(
            difference <= Rational::new(1, 10),
            "{executor}, {delay}: {warning}, and it is needed at {needed}: {report:#?}"
        );
    }
}

/// Performer that sends no reports, except a confirmation of its cancellation.
struct SilentPerformer<'a> {
    inner: SimWorld<'a>,
    name: &'static str,
    asked: Option<ActionHandle>,
    coming: Vec<Observation>,
}

impl World for SilentPerformer<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        match command {
            Command::Start { ticket, action, .. } if action.name == self.name => {
                self.asked = Some(*ticket);
                Ok(())
            }
            Command::Cancel { ticket } if Some(*ticket) == self.asked => {
                let event = Event::Ended {
                    ticket: *ticket,
                    ending: Ending::Cancelled,
                    measured: Vec::new(),
                };
                let time = now.clone();
                self.coming.push(Observation { time, event });
                Ok(())
            }
            _ => self.inner.command(now, command),
        }
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        if self.coming.is_empty() {
            return self.inner.wait(until);
        }
        let observations = std::mem::take(&mut self.coming);
        let now = observations[0].time.clone();
        Ok(TimeAdvance { now, observations })
    }
}

/// An action without a start report may have started when it was commanded, until its planned end.
/// After that its start is late, and the remaining time is too short for it. The goal is still
/// reached in time without it.
#[test]
fn unconfirmed_start_is_awaited_until_plan_becomes_infeasible() {
    let (scene, _) = walker(Rational::from(10));
    for executor in ["guarded", "live", "stn"] {
        let model = scene.world("");
        let mut world = SilentPerformer {
            inner: SimWorld::new(Arc::clone(&scene.task), &model, 1),
            name: "(walk)",
            asked: None,
            coming: Vec::new(),
        };
        let settings = RunSettings {
            monitors_slack: true,
            ..scene.settings.clone()
        };
        let notes = Notes::default();
        let execution = scene.execution(executor).with_settings(settings);
        let report = execution.recorded_by(notes.clone()).run_in(&mut world);
        let notes = notes.0.lock().unwrap_or_else(PoisonError::into_inner);
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{executor}: {notes:#?}"
        );
        assert_eq!(done(&report), ["(slide)"], "{executor}: {notes:#?}");
        assert!(report.time < Rational::from(26), "{executor}: {notes:#?}");
    }
}

/// World that delivers reports only at multiples of a period.
struct Ticking<'a> {
    inner: SimWorld<'a>,
    every: Rational,
}

impl World for Ticking<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let told = (until / &self.every).ceil() * &self.every;
        let first = self.inner.wait(&told)?;
        all_until(&mut self.inner, first, &told)
    }
}

/// Extends a passage of time until `until`, with all observations meanwhile.
fn all_until(
    world: &mut SimWorld<'_>,
    mut passage: TimeAdvance,
    until: &Rational,
) -> Result<TimeAdvance, WorldError> {
    while passage.now < *until {
        let later = world.wait(until)?;
        passage.observations.extend(later.observations);
        passage.now = later.now;
    }
    Ok(passage)
}

/// World whose executor observes it later than planned, by this lag.
struct Lagging<'a> {
    inner: SimWorld<'a>,
    delay: Rational,
}

impl World for Lagging<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let first = self.inner.wait(until)?;
        let looked_at = &first.now + &self.delay;
        all_until(&mut self.inner, first, &looked_at)
    }
}

/// The envelope uses all of the slack, so the first of the welds would have to be inspected at
/// once. A late decision reduces the slack like a late start.
#[test]
fn late_decision_uses_slack_without_replanning() {
    let file = |name: &str| read(&format!("cases/match/{name}"));
    let plan = file("plan.plan");
    let scene = Scene::new(&file("domain.pddl"), &file("problem.pddl"), Some(&plan));
    for executor in ["guarded", "live"] {
        let run = |lag: &str| {
            let model = scene.world("[[delay]]\naction = \"burn\"\nconstant = 0.03\n");
            let mut world = Lagging {
                inner: SimWorld::new(Arc::clone(&scene.task), &model, 1),
                delay: lag.parse().expect("a number"),
            };
            let execution = scene.execution(executor).with_planner(NoPlanner);
            execution.run_in(&mut world)
        };
        for lag in ["0", "0.01", "0.1", "1", "3"] {
            let report = run(lag);
            let outcome = (&report.verdict, report.replans);
            assert_eq!(
                outcome,
                (&Verdict::GoalReached, 0),
                "{executor}, {lag}: {report:#?}"
            );
            assert!(scene.judged(&report).is_valid());
        }
        // The plan has twelve seconds of slack, and the delays exceed them. `live` requests a new
        // plan after it has continued in vain.
        assert!(run("7").replans >= 1, "{executor}");
    }
}

/// Pumping fills the tank in proportion to its duration: ten planned, and at most fifteen. When the
/// late start of the walk is reported, the pump has run for longer. The feasibility of the
/// remaining plan is then unknown, although there is time for it.
#[test]
fn late_start_does_not_excuse_other_deviations() {
    let domain = "(define (domain tank)
        (:requirements :durative-actions :fluents :timed-initial-literals)
        (:predicates (open) (pumped) (walked) (closed)) (:functions (level))
        (:durative-action pump :parameters () :duration (= ?duration 10)
          :condition () :effect (and (at end (increase (level) ?duration)) (at end (pumped))))
        (:durative-action walk :parameters () :duration (= ?duration 10)
          :condition (over all (open)) :effect (at end (walked)))
        (:durative-action close :parameters () :duration (= ?duration 1)
          :condition (and (at start (pumped)) (at start (<= (level) 15))) :effect (at end (closed))))";
    let problem = "(define (problem full) (:domain tank)
        (:init (open) (at 60 (not (open))) (= (level) 0)) (:goal (and (walked) (closed))))";
    let plan = "0.001: (pump) [10]\n0.001: (walk) [10]\n10.002: (close) [1]\n";
    let scene = Scene::new(domain, problem, Some(plan));
    let run = |pump: &str| {
        let model = format!(
            "[[delay]]\naction = \"walk\"\nconstant = 15.5\n\
             [[duration]]\naction = \"pump\"\nconstant = {pump}\n"
        );
        let model = scene.world(&model);
        let mut world = Ticking {
            inner: SimWorld::new(Arc::clone(&scene.task), &model, 1),
            every: Rational::from(16),
        };
        let execution = scene.execution("guarded").with_planner(NoPlanner);
        execution.run_in(&mut world)
    };
    let kept = run("12");
    assert_eq!((&kept.verdict, kept.replans), (&Verdict::GoalReached, 0));
    let report = run("20");
    assert_eq!(report.replans, 1, "{report:#?}");
    assert_eq!(report.time, Rational::from(16), "{report:#?}");
}

/// In worlds without a clock, as in the papers' experiments, the run ends. It is not proved that no
/// plan exists, because the running action might end at any moment. A fact that changes when the
/// action is cancelled permits another plan.
#[test]
fn run_without_slack_monitor_ends_when_no_plan_is_feasible() {
    let (scene, mut world) = walker(Rational::from(1000));
    world.on_cancel = None;
    let settings = RunSettings {
        monitors_slack: false,
        ..scene.settings.clone()
    };
    let execution = scene.execution("guarded").with_settings(settings);
    let report = execution.run_in(&mut world);
    let is_none_found = matches!(
        report.verdict,
        Verdict::NoPlan {
            missing: MissingPlan::NotFound,
            ..
        }
    );
    assert!(is_none_found, "{report:#?}");
    let (report, _) = run_with_slow_walk(Rational::from(1000), false);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
}

/// At the warning the planner receives the situation for which a plan will be needed. That plan is
/// requested when it is needed, and may be ready by then.
#[test]
fn future_replan_is_requested_in_advance() {
    #[derive(Default)]
    struct PlannerCalls {
        expected: Vec<Situation>,
        requested: Vec<Situation>,
    }
    struct RecordingPlanner(Arc<Mutex<PlannerCalls>>);
    impl RecordingPlanner {
        fn asked(&self) -> MutexGuard<'_, PlannerCalls> {
            self.0.lock().unwrap_or_else(PoisonError::into_inner)
        }
    }
    impl Planner for RecordingPlanner {
        fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
            self.asked().requested.push(situation.clone());
            let answer = Embedded::default().plan(task, situation);
            PlannerAnswer {
                seconds: None,
                ..answer
            }
        }
        fn expect(&mut self, _task: &Task, situation: &Situation) {
            self.asked().expected.push(situation.clone());
        }
    }
    let asked = Arc::<Mutex<PlannerCalls>>::default();
    let (scene, mut world) = walker(Rational::from(1000));
    let report = scene
        .execution("guarded")
        .with_settings(RunSettings {
            monitors_slack: true,
            ..scene.settings.clone()
        })
        .with_planner(RecordingPlanner(Arc::clone(&asked)))
        .run_in(&mut world);
    assert_eq!(report.verdict, Verdict::GoalReached);
    let asked = asked.lock().unwrap_or_else(PoisonError::into_inner);
    let first = &asked.expected[0];
    assert_eq!(*first, asked.requested[0]);
    // A quarter of a second, and ε, after it is needed: at 15.3125.
    assert_eq!(first.time, Rational::new(153_125 + 2510, 10_000));
}
