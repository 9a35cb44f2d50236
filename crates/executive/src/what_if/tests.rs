//! Hypothetical goals in simulated runs: the run does not change, and each answer agrees with a run with this goal.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use elbowroom::answers::NoObserver;
use elbowroom::answers::run::run;
use elbowroom::execute::{NamedText, RunInputs, RunSpec};
use elbowroom::execution::{
    Command, Event, Observation, PlanForm, Preparer as _, Recorder, Request, TimeAdvance, World,
    WorldError,
};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::model::{Step, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::plan::ParameterKind;
use elbowroom::report::schema::{IssuedCommandLine, Line, ObservationLine};
use elbowroom::report::trace::{Stored, TraceWriter, action_named};
use elbowroom::sim::{SimWorld, WorldModel};

use super::what_if;
use crate::goal_request::GoalNames;
use crate::interface::Status;
use crate::interface::documents::{GivenNumber, NewGoal, WhatIf};
use crate::operator::OperatorInterface;
use crate::request_queue::RequestQueue;
use crate::trace_buffer::TraceBuffer;

const DOMAIN: &str = "(define (domain errands)
  (:requirements :typing :durative-actions)
  (:types robot errand)
  (:predicates (idle ?r - robot) (open ?e - errand) (done ?e - errand) (first ?e ?f - errand))
  (:durative-action do
    :parameters (?r - robot ?e ?f - errand)
    :duration (= ?duration 2)
    :condition (and (at start (idle ?r)) (at start (open ?f)) (at start (first ?e ?f)) (at start (done ?e)))
    :effect (and (at start (not (idle ?r))) (at end (idle ?r)) (at end (done ?f)))))";

const PROBLEM: &str = "(define (problem day) (:domain errands)
  (:objects r s - robot nothing a1 a2 a3 b1 b2 c1 c2 d1 - errand)
  (:init (idle r) (idle s) (done nothing) (open a1) (open a2) (open a3) (open b1) (open b2) (open c1) (open c2)
    (first nothing a1) (first a1 a2) (first a2 a3) (first nothing b1) (first b1 b2) (first nothing c1) (first c1 c2)
    (first nothing d1) (at 30 (not (open c2))))
  (:goal (and (done a3) (done b2))))";

fn spec() -> RunSpec {
    let text = |text: &str| NamedText {
        name: "test".to_owned(),
        text: text.to_owned(),
    };
    RunSpec {
        is_persistent: true,
        time_limit: Rational::from(60),
        planner_states: 2000,
        ..RunSpec::new(text(DOMAIN), text(PROBLEM))
    }
}

fn read(spec: RunSpec) -> RunInputs {
    RunInputs::read(spec).expect("a correct test").0
}

fn goal(goal: &str, within: Option<i64>) -> NewGoal {
    NewGoal {
        name: None,
        goal: goal.to_owned(),
        value: None,
        deadline: None,
        within: within.map(|it| GivenNumber(Rational::from(it))),
        release: None,
        after: None,
        keep: false,
        by: None,
    }
}

/// World at whose time `at` goals are asked about, and then one is given.
struct Scripted<'m> {
    inner: SimWorld<'m>,
    inputs: &'m RunInputs,
    status: Status,
    at: Rational,
    questions: Vec<NewGoal>,
    given: Option<NewGoal>,
    /// The run is paused before the goal is given, and the questions come after it.
    pauses: bool,
    answers: Vec<WhatIf>,
}

impl Scripted<'_> {
    fn ask(&mut self) {
        for question in std::mem::take(&mut self.questions) {
            let answer = what_if(self.inputs, &self.status, question);
            self.answers.push(answer.expect("a valid goal"));
        }
    }
}

impl World for Scripted<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let is_before = self.status.now() < self.at;
        if self.pauses && self.given.is_none() {
            self.ask();
        }
        let until = if is_before {
            until.min(&self.at)
        } else {
            until
        };
        let mut passage = self.inner.wait(until)?;
        self.status.set_time(&passage.now);
        if passage.now >= self.at {
            if !self.pauses {
                self.ask();
            }
            if let Some(given) = self.given.take() {
                if self.pauses {
                    passage.observations.push(Observation {
                        time: passage.now.clone(),
                        event: Event::Requested(Request::Pause),
                    });
                }
                let named = NewGoal {
                    name: Some("given".to_owned()),
                    ..given
                };
                let (_, request) = GoalNames::default()
                    .request(named, &self.status)
                    .expect("valid");
                let event = request.event(&passage.now, self.inputs.task());
                let event: Event = event.expect("known");
                let time = passage.now.clone();
                passage.observations.push(Observation { time, event });
            }
        }
        Ok(passage)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.inner.look(facts, fluents)
    }
}

/// Executes the run. Returns its trace, the answers, and the final status.
fn executed(
    at: &Rational,
    questions: Vec<NewGoal>,
    given: Option<NewGoal>,
) -> (String, Vec<WhatIf>, Status) {
    executed_with(at, questions, given, false, 2)
}

/// Like [`executed`]. With `pauses`, the goal is given in a pause, and then the questions are asked. Each action takes
/// `seconds`; two are planned.
fn executed_with(
    at: &Rational,
    questions: Vec<NewGoal>,
    given: Option<NewGoal>,
    pauses: bool,
    seconds: usize,
) -> (String, Vec<WhatIf>, Status) {
    let inputs = read(spec());
    let task = inputs.task();
    let status = Status::new(task, inputs.spec().timeout.clone());
    let operator = OperatorInterface::new(
        RequestQueue::default(),
        status.clone(),
        TraceBuffer::default(),
    );
    let model = format!(
        "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\naction = \"do\"\nuniform = {{ from = {seconds}, to = {seconds} }}\n"
    );
    let model = WorldModel::read(&model, task.problem()).expect("a correct test");
    let mut world = Scripted {
        inner: SimWorld::new(Arc::clone(task), &model, 0),
        inputs: &inputs,
        status: status.clone(),
        at: at.clone(),
        questions,
        given,
        pauses,
        answers: Vec::new(),
    };
    let mut trace = String::new();
    let mut sink = |line: &str| trace.push_str(line);
    let recorder: Box<dyn Recorder + '_> =
        Box::new(operator.publishing(TraceWriter::new(Arc::clone(task), &mut sink), task, false));
    let execution = inputs.execution(None).expect("a correct test");
    let execution = execution
        .on_belief(operator.listener())
        .recorded_by(recorder);
    let outcome = run(&inputs, execution, &mut world, &mut NoObserver).expect("a correct test");
    assert!(
        outcome.answer.invalid.is_empty(),
        "{:?}",
        outcome.answer.invalid
    );
    let answers = std::mem::take(&mut world.answers);
    drop(world);
    (trace, answers, status)
}

/// Moments while actions are running, between an end and the next start, and while the run is idle. None of them is
/// the planned end of an action: before the report of such an end, the action counts as late.
fn moments() -> Vec<Rational> {
    [
        (1, 2),
        (1, 1),
        (3, 2),
        (4001, 2000),
        (5, 2),
        (3, 1),
        (7, 2),
        (4501, 1000),
        (5, 1),
        (11, 2),
        (9, 1),
        (20, 1),
        (27, 1),
    ]
    .map(|(one, other)| Rational::new(one, other))
    .to_vec()
}

fn goals() -> Vec<NewGoal> {
    vec![
        goal("(done c1)", None),
        goal("(done c2)", None),
        goal("(and (done c2) (done b1))", Some(7)),
        goal("(done c2)", Some(3)),
        goal("(done c1)", Some(3)),
        goal("(done d1)", None),
        goal("(done b2)", None),
        goal("(not (done a1))", Some(2)),
    ]
}

#[test]
fn answers_agree_with_runs_in_which_the_goals_are_given() {
    let mut verdicts = std::collections::BTreeSet::new();
    for at in moments() {
        for question in goals() {
            let text = format!("{question:?} at {at}");
            let (_, answers, status) = executed(&at, vec![question.clone()], Some(question));
            let [answer] = answers.as_slice() else {
                panic!("{text}: {answers:?}");
            };
            let known = status.goal("given").expect("it was given");
            // At the end of the run, goals that were impossible may have failed at their deadlines.
            let is_missed =
                |state: &str| ["impossible", "unplanned", "failed", "set-aside"].contains(&state);
            if is_missed(&answer.verdict) {
                assert!(is_missed(&known.state), "{text}: {answer:?} {known:?}");
            } else {
                assert_eq!(answer.verdict, known.state, "{text}: {answer:?} {known:?}");
                assert_eq!(
                    answer.done.as_ref(),
                    Some(&known.since),
                    "{text}: {answer:?}"
                );
            }
            verdicts.insert(answer.verdict.clone());
        }
    }
    assert!(
        verdicts.contains("achieved") && verdicts.len() > 1,
        "{verdicts:?}"
    );
}

#[test]
fn goals_that_are_missed_anyway_are_not_attributed_to_the_question() {
    let missed = |given: NewGoal, question: NewGoal| {
        let (_, answers, _) = executed_with(&Rational::ONE, vec![question], Some(given), true, 2);
        answers.into_iter().next().expect("an answer").missed
    };
    let valuable = NewGoal {
        value: Some(GivenNumber(Rational::from(5))),
        ..goal("(done c1)", Some(4))
    };
    let none = Vec::<String>::new();
    assert_eq!(missed(goal("(done d1)", None), valuable.clone()), none);
    let other = goal("(done c1)", Some(1));
    assert_eq!(missed(other, valuable.clone()), none);
    // Two robots can do two more errands in time, not three.
    let possible = missed(goal("(and (done b2) (done a2))", Some(4)), valuable);
    assert_eq!(possible, ["given".to_owned()]);
}

#[test]
fn late_action_makes_no_goal_impossible() {
    let at = Rational::new(9, 4);
    let question = goal("(and (done a1) (done d1))", None);
    let (_, answers, _) = executed_with(&at, vec![question], None, false, 3);
    let why = answers[0].why.as_deref().expect("a reason");
    assert!(why.contains("(done d1)"), "{why}");
    assert!(!why.contains("(done a1)"), "{why}");
    assert_eq!(answers[0].missed, Vec::<String>::new());
}

#[test]
fn questions_do_not_change_the_run() {
    for at in moments() {
        let (without, ..) = executed(&at, Vec::new(), Some(goal("(done c1)", None)));
        let (with, answers, _) = executed(&at, goals(), Some(goal("(done c1)", None)));
        assert_eq!(answers.len(), goals().len());
        assert_eq!(without, with, "at {at}");
    }
}

/// World in which durations deviate, and in which the slack is read every eighth of a second.
struct Sampled<'m> {
    inner: SimWorld<'m>,
    status: Status,
    trace: Arc<Mutex<String>>,
    samples: Vec<(Rational, Option<Rational>, String)>,
}

impl World for Sampled<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        loop {
            let next = self.status.now() + Rational::new(1, 8);
            let passage = self.inner.wait(until.min(&next))?;
            self.status.set_time(&passage.now);
            if !passage.observations.is_empty() || passage.now >= *until {
                return Ok(passage);
            }
            let trace = self.trace.lock().expect("not poisoned").clone();
            self.samples
                .push((passage.now, self.status.least_slack(), trace));
        }
    }
}

/// Returns the least slack at `now` of the plan in a trace, from an envelope that is computed again.
fn recomputed(spec: RunSpec, trace: &str, now: &Rational) -> Option<Rational> {
    let inputs = read(spec);
    let task = inputs.task();
    let stored = Stored::read(trace).expect("a trace");
    let plan = stored.lines.iter().rev().find_map(|line| match line {
        Line::Plan(plan) => Some(plan),
        _ => None,
    })?;
    assert_eq!(plan.origin.0, Rational::ZERO);
    let steps = plan.steps.iter().map(|step| Step {
        start: step.start.0.clone(),
        duration: step.duration.as_ref().map(|it| it.0.clone()),
        action: Arc::new(action_named(&step.action, task).expect("an action")),
    });
    let plan = TimeTriggeredPlan {
        steps: steps.collect(),
    };
    let prepared = inputs
        .preparer()
        .prepare(task, &plan, PlanForm::Envelope)
        .expect("an envelope");
    let (mut commanded, mut running) = (BTreeMap::new(), BTreeMap::new());
    for line in &stored.lines {
        match line {
            Line::Command(line) => {
                if let IssuedCommandLine::Start { ticket, action, .. } = &line.command {
                    commanded.insert(action.clone(), *ticket);
                    running.insert(*ticket, line.now.0.clone());
                }
            }
            Line::Observed(line) => {
                if let ObservationLine::Ended { ticket, .. } = &line.observation {
                    running.remove(ticket);
                }
            }
            _ => {}
        }
    }
    let envelope = prepared.envelope.as_ref()?;
    let parameters = prepared.plan.parameters.iter().zip(envelope.intervals());
    let slacks = parameters.filter_map(|(parameter, interval)| {
        let ParameterKind::Duration(instance) = parameter.kind else {
            return None;
        };
        let action = &prepared.plan.plan.instance(instance).action.name;
        let spent = match commanded.get(action) {
            None => Rational::ZERO,
            Some(ticket) => now - running.get(ticket)?,
        };
        let most = interval.upper.value()?;
        Some((most - spent.max(parameter.nominal.clone())).max(Rational::ZERO) / most)
    });
    slacks.min()
}

#[test]
fn slack_equals_that_of_an_envelope_computed_again_from_the_trace() {
    let problem = PROBLEM.replace(
        "(at 30 (not (open c2)))",
        "(at 9 (not (open a3))) (at 8 (not (open b2)))",
    );
    let mut spec = spec();
    spec.problem.text = problem;
    let inputs = read(spec.clone());
    let task = inputs.task();
    let model = "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\naction = \"do\"\nuniform = { from = 1.5, to = 3 }\n";
    let model = WorldModel::read(model, task.problem()).expect("a correct test");
    let mut compared = 0;
    for seed in 0..12 {
        let status = Status::new(task, spec.timeout.clone());
        let operator = OperatorInterface::new(
            RequestQueue::default(),
            status.clone(),
            TraceBuffer::default(),
        );
        let trace = Arc::new(Mutex::new(String::new()));
        let mut world = Sampled {
            inner: SimWorld::new(Arc::clone(task), &model, seed),
            status: status.clone(),
            trace: Arc::clone(&trace),
            samples: Vec::new(),
        };
        let mut sink = |line: &str| trace.lock().expect("not poisoned").push_str(line);
        let mut writer = TraceWriter::new(Arc::clone(task), &mut sink);
        writer.header(&spec).expect("texts");
        let recorder = operator.publishing(writer, task, false);
        let execution = inputs.execution(None).expect("a correct test");
        let execution = execution
            .on_belief(operator.listener())
            .recorded_by(recorder);
        run(&inputs, execution, &mut world, &mut NoObserver).expect("a correct test");
        for (now, slack, trace) in &world.samples {
            // Later plans begin in another state, and a part of an envelope is not the whole.
            let is_first = trace.matches("\"event\":\"plan\"").count() == 1;
            if !is_first || trace.contains("part-of-envelope") || slack.is_none() {
                continue;
            }
            assert_eq!(
                *slack,
                recomputed(spec.clone(), trace, now),
                "seed {seed} at {now}"
            );
            compared += 1;
        }
    }
    assert!(compared >= 200, "{compared}");
}

#[test]
fn slack_is_that_of_the_present_plan_and_of_the_next_one() {
    let mut known = 0;
    for at in moments() {
        let question = goal("(done c2)", Some(8));
        let (_, answers, _) = executed(&at, vec![question], None);
        let slacks = [&answers[0].slack_now, &answers[0].slack_then];
        for share in slacks.into_iter().flatten() {
            assert!(
                !share.0.is_negative() && share.0 <= Rational::ONE,
                "{answers:?}"
            );
            known += 1;
        }
    }
    assert!(known > 0, "no slack is known");
}
