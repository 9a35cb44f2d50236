//! A first action that never ends by itself: it times out, and its end effects are in doubt.

use std::sync::Arc;

use elbowroom::execute::PlanPreparer;
use elbowroom::execution::run::{Report, Verdict};
use elbowroom::execution::{
    ActionHandle, BeliefState, Cause, Command, Doubt, Ending, Event, NoRecord, Observation,
    TimeAdvance, World, WorldError,
};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::sim::{SimWorld, WorldModel};

use crate::execution::scene::{EXECUTORS, Scene};

const DOMAIN: &str = "(define (domain robots)
    (:requirements :typing :durative-actions :negative-preconditions)
    (:types robot item)
    (:predicates (in ?x - item) (done ?x - item))
    (:durative-action pick :parameters (?r - robot ?x - item) :duration (= ?duration 1)
      :condition (at start (in ?x))
      :effect (and (at end (done ?x)) (at end (not (in ?x))))))";

fn scene(goal: &str) -> Scene {
    let problem = format!(
        "(define (problem p) (:domain robots) (:objects r1 r2 - robot x - item)
            (:init (in x)) (:goal {goal}))"
    );
    let mut scene = Scene::new(DOMAIN, &problem, Some("0: (pick r1 x) [1]"));
    scene.settings.timeout = "60".parse().expect("a correct test");
    scene
}

/// World whose first action hangs.
struct Hanging<'a> {
    world: SimWorld<'a>,
    /// Report of its end, and its delay after the cancellation.
    reply: Option<(i64, Ending)>,
    /// Completed shares that it reports, one every 25 seconds; the last one is repeated.
    completions: Vec<Rational>,
    can_look: bool,
    now: Rational,
    cancelled: Option<Rational>,
    reports: usize,
}

const HANGS: ActionHandle = ActionHandle(0);

impl<'a> Hanging<'a> {
    fn new(scene: &Scene, model: &'a WorldModel) -> Self {
        Self {
            world: SimWorld::new(Arc::clone(&scene.task), model, 0),
            reply: None,
            completions: Vec::new(),
            can_look: false,
            now: Rational::ZERO,
            cancelled: None,
            reports: 0,
        }
    }

    fn next_report(&self) -> Option<Rational> {
        let number = i64::try_from(self.reports).expect("a few") + 1;
        let is_running = self.cancelled.is_none() && !self.completions.is_empty();
        is_running.then(|| Rational::from(25 * number))
    }

    fn reply_due(&self) -> Option<Rational> {
        let (after, _) = self.reply.as_ref()?;
        Some(self.cancelled.as_ref()? + Rational::from(*after))
    }
}

impl World for Hanging<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        match command {
            Command::Start { ticket: HANGS, .. } => Ok(()),
            Command::Cancel { ticket: HANGS } => {
                self.cancelled.get_or_insert_with(|| now.clone());
                Ok(())
            }
            _ => self.world.command(now, command),
        }
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let is_coming = |time: &Rational| *time >= self.now && time <= until;
        let own = [self.next_report(), self.reply_due()];
        let own = own.into_iter().flatten().filter(is_coming).min();
        let mut passage = self.world.wait(own.as_ref().unwrap_or(until))?;
        self.now.clone_from(&passage.now);
        let mut report = |time: Rational, event| {
            passage.observations.push(Observation { time, event });
        };
        if let Some(time) = self.next_report().filter(|time| *time <= self.now) {
            let last = self.completions.len() - 1;
            let completion = self.completions[self.reports.min(last)].clone();
            let (completion, note) = (Some(completion), String::new());
            self.reports += 1;
            let ticket = HANGS;
            report(
                time,
                Event::Feedback {
                    ticket,
                    completion,
                    note,
                },
            );
        }
        if let Some(time) = self.reply_due().filter(|time| *time <= self.now)
            && let Some((_, ending)) = self.reply.take()
        {
            let (ticket, measured) = (HANGS, Vec::new());
            report(
                time,
                Event::Ended {
                    ticket,
                    ending,
                    measured,
                },
            );
        }
        Ok(passage)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        if self.can_look {
            self.world.look(facts, fluents)
        } else {
            Ok(Vec::new())
        }
    }
}

fn run(scene: &Scene, executor: &str, world: &mut Hanging<'_>) -> Report {
    let mut analyst = PlanPreparer::new(scene.flow.clone());
    scene.run_in(executor, world, &mut analyst, &mut NoRecord)
}

fn failed() -> Ending {
    let why = "stopped".to_owned();
    Ending::Failed { why }
}

#[test]
fn other_robot_takes_over_if_the_cancelled_action_reports_its_end() {
    let scene = scene("(done x)");
    let model = WorldModel::without_deviations();
    for executor in EXECUTORS.iter() {
        for ending in [Ending::Cancelled, failed()] {
            for after in [0, 1, 9] {
                let mut world = Hanging::new(&scene, &model);
                world.reply = Some((after, ending.clone()));
                let report = run(&scene, executor, &mut world);
                let case = format!("{executor}, {ending:?} after {after}: {report:#?}");
                assert_eq!(report.verdict, Verdict::GoalReached, "{case}");
                assert!(report.time < Rational::from(80), "{case}");
            }
        }
    }
}

#[test]
fn uncertain_fact_is_observed_before_replanning() {
    let scene = scene("(done x)");
    let model = WorldModel::without_deviations();
    for executor in EXECUTORS.iter() {
        let mut world = Hanging::new(&scene, &model);
        world.can_look = true;
        let report = run(&scene, executor, &mut world);
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{executor}: {report:#?}"
        );
        assert!(report.time < Rational::from(80), "{executor}: {report:#?}");
    }
}

#[test]
fn run_ends_with_unresolvable_doubt_as_reason() {
    let scene = scene("(done x)");
    let model = WorldModel::without_deviations();
    for executor in EXECUTORS.iter() {
        let report = run(&scene, executor, &mut Hanging::new(&scene, &model));
        let Verdict::NoPlan { why, .. } = &report.verdict else {
            panic!("{executor}: {report:#?}");
        };
        assert!(
            why.contains("therefore in doubt: (in x)"),
            "{executor}: {why}"
        );
        assert!(
            why.contains("whether (pick r1 x) has ended"),
            "{executor}: {why}"
        );
        let refused = report
            .reasons
            .iter()
            .filter(|it| it.cause == Cause::Condition);
        assert_eq!(refused.count(), 0, "{executor}: {report:#?}");
    }
}

#[test]
fn uncertain_goal_does_not_count_as_reached() {
    let scene = scene("(not (in x))");
    let model = WorldModel::without_deviations();
    for executor in EXECUTORS.iter() {
        let report = run(&scene, executor, &mut Hanging::new(&scene, &model));
        let Verdict::NoPlan { why, .. } = &report.verdict else {
            panic!("{executor}: {report:#?}");
        };
        assert!(why.contains("in doubt"), "{executor}: {why}");
    }
}

/// The end is reported while the other robot works, before or after its effects were put in doubt.
#[test]
fn late_end_settles_the_doubt_while_another_action_runs() {
    let problem = "(define (problem p) (:domain robots) (:objects r1 r2 - robot x y z - item)
        (:init (in x) (in y) (in z)) (:goal (and (done x) (done y) (done z))))";
    let plan = "0: (pick r1 x) [1]\n0: (pick r2 y) [1]\n1.001: (pick r2 z) [1]";
    let domain = DOMAIN.replace("(in ?x - item)", "(in ?x - item) (idle ?r - robot)");
    let domain = domain.replace(
        ":condition (at start (in ?x))",
        ":condition (and (at start (in ?x)) (at start (not (idle ?r))))",
    );
    let domain = domain.replace(
        ":effect (and",
        ":effect (and (at start (idle ?r)) (at end (not (idle ?r)))",
    );
    let mut scene = Scene::new(&domain, problem, Some(plan));
    scene.settings.timeout = "60".parse().expect("a correct test");
    let model = scene.world(
        "[[duration]]\naction = \"(pick r2 y)\"\nconstant = 50\n
        [[duration]]\naction = \"(pick r2 z)\"\nconstant = 50\n",
    );
    for executor in ["live", "esterel"] {
        for ending in [Ending::Succeeded, Ending::Cancelled] {
            for after in [5, 15, 35] {
                let mut world = Hanging::new(&scene, &model);
                world.reply = Some((after, ending.clone()));
                let report = run(&scene, executor, &mut world);
                let case = format!("{executor}, {ending:?} after {after}: {report:#?}");
                assert_eq!(report.verdict, Verdict::GoalReached, "{case}");
            }
        }
    }
}

#[test]
fn end_of_one_action_does_not_settle_the_doubt_about_another() {
    let scene = scene("(done x)");
    let name = |name: &str| scene.task.fact_named(name).expect("a fact");
    let (waits, done) = (name("(in x)"), name("(done x)"));
    let body = scene.plan.steps[0].action.durative().expect("an action");
    let doubt = |ticket| Doubt {
        since: Rational::from(70),
        ticket: ActionHandle(ticket),
        action: format!("action {ticket}"),
    };
    let mut belief = BeliefState::new(Arc::clone(&scene.task));
    belief.doubt(&body.end, &doubt(1));
    belief.doubt(&body.end, &doubt(2));
    assert!(!belief.fact(waits) && !belief.fact(done));
    let _ = belief.resolve_doubts(ActionHandle(1));
    assert!(!belief.fact(waits), "the other action may have taken it");
    let mut taken = belief.clone();
    let _ = taken.resolve_doubts_as_happened(ActionHandle(2), &[&body.end], &Rational::ONE, &[]);
    assert_eq!(taken.doubt_count(), 0);
    assert!(!taken.fact(waits) && taken.fact(done));
    let _ = belief.resolve_doubts(ActionHandle(2));
    assert_eq!(belief.doubt_count(), 0);
    assert!(belief.fact(waits) && !belief.fact(done));
}

#[test]
fn feedback_without_progress_does_not_extend_the_time_out() {
    let scene = scene("(done x)");
    let model = WorldModel::without_deviations();
    let stuck = vec![Rational::new(1, 2)];
    let slow = (1..=8).map(|part| Rational::new(part, 10)).collect();
    for (completions, least, most) in [(stuck, 80, 100), (slow, 255, 270)] {
        for executor in ["guarded", "live", "adaptable", "policy", "esterel"] {
            let mut world = Hanging::new(&scene, &model);
            world.completions = completions.clone();
            world.reply = Some((0, Ending::Cancelled));
            let report = run(&scene, executor, &mut world);
            let case = format!("{executor}: {report:#?}");
            assert_eq!(report.verdict, Verdict::GoalReached, "{case}");
            assert!(report.time > Rational::from(least), "{case}");
            assert!(report.time < Rational::from(most), "{case}");
        }
    }
}
