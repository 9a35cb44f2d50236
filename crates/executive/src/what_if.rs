//! Answers to hypothetical goals: "what if this goal were given now?"
//!
//! The answer comes from a simulation of the run from now on, in a world in which everything goes as planned: its
//! executor, its planner with the same limits, and its selection among goals. The simulation has its own table of
//! facts and its own copy of the status, and the run does not take part in it.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use elbowroom::execute::{RunInputs, SpecError};
use elbowroom::execution::run::situation::{OverrunEstimate, remaining_plan_of, situation_at};
use elbowroom::execution::run::{
    GivenGoal, Goals, KnownStart, PlanAdoption, RefusalBackoff, RunPhase, RunSnapshot, Wait,
};
use elbowroom::execution::{
    ActionHandle, BeliefState, Command, Entry, Event, GoalTerms, Observation, Recorder,
    TimeAdvance, World, WorldError,
};
use elbowroom::model::Step;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::exact::Exact;
use elbowroom::report::trace::action_named;
use elbowroom::sim::{ObservedChanges, SimWorld, WorldModel};

use crate::clock::Clock;
use crate::error::Error;
use crate::goal_request::GoalNames;
use crate::interface::Status;
use crate::interface::documents::{GoalNow, NewGoal, WhatIf};
use crate::request_check::check;

/// Maximum number of searches for plans in one simulation.
const MAX_SEARCHES: usize = 20;

/// Time limit of one simulation, in seconds of the wall clock.
const MAX_SECONDS: i64 = 10;

/// States of a goal that the simulation does not change any more.
const FINAL_STATES: [&str; 3] = ["achieved", "failed", "cancelled"];

/// States of an open goal for which the executive has no plan.
const MISSED_STATES: [&str; 4] = ["set-aside", "impossible", "unplanned", "failed"];

/// Simulates the run of this status with another goal.
///
/// # Errors
/// When the run has no state yet, or its specification is contradictory.
pub(crate) fn what_if(
    inputs: &RunInputs,
    status: &Status,
    given: NewGoal,
) -> Result<WhatIf, Error> {
    if given.keep {
        return Err(Error::new(
            "a goal to keep is never done",
            "ask for the goal without `keep`",
        ));
    }
    let before = status.fork();
    let known = before.belief().filter(|_| !before.is_replayed());
    let belief = known.ok_or_else(|| {
        Error::new(
            "the run has not begun",
            "ask again when `elbowroom ctl state` shows an activity",
        )
    })?;
    let now = before.now();
    let (name, request) = GoalNames::default().request(given, &before)?;
    check(&request, &belief.task().with_own_table())?;
    let mut belief = belief.with_separate_fact_table();
    let _ = belief.advance(&now);
    // The deadlines of goals come from the goals.
    let task = belief.task().with_deadlines([]);
    let task = task.map_or_else(|| Arc::clone(belief.task()), Arc::new);
    confirm_starts(&mut belief, &before, &now);
    let slack_now = before.least_slack();
    let pursued = goals_in(&before, &["pursued"]);
    let event = request.event(&now, &task);
    let request = event.map(|event| Observation { time: now, event });
    let inputs = inputs.without_planning_time(task);
    let unasked = before.fork();
    let (found, after) = simulate(&inputs, before, &belief, request, vec![name.clone()])?;
    let goal = after.goal(&name);
    let searches_left = found.searches.load(Ordering::SeqCst) <= MAX_SEARCHES;
    let is_over = found.is_over.load(Ordering::SeqCst) && searches_left;
    let refused = found
        .refused
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .take();
    let slack_then = found
        .slack
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .take();
    let verdict = match &goal {
        _ if refused.is_some() => "impossible".to_owned(),
        Some(goal) if is_over && is_decided(&goal.state) => goal.state.clone(),
        _ => "undecided".to_owned(),
    };
    let missed = goals_in(&after, &MISSED_STATES);
    let missed: Vec<String> = pursued
        .into_iter()
        .filter(|it| missed.contains(it))
        .collect();
    let missed_anyway = if missed.is_empty() {
        Vec::new()
    } else {
        let (_, after) = simulate(&inputs, unasked, &belief, None, missed.clone())?;
        goals_in(&after, &MISSED_STATES)
    };
    let is_achieved = verdict == "achieved";
    Ok(WhatIf {
        done: goal
            .as_ref()
            .filter(|_| is_achieved)
            .map(|goal| goal.since.clone()),
        why: refused.or_else(|| match verdict.as_str() {
            "undecided" => Some("the simulation has reached its limits".to_owned()),
            _ => goal.and_then(|goal| goal.why),
        }),
        slack_now: slack_now.map(Exact),
        slack_then: slack_then.map(Exact).filter(|_| is_achieved),
        missed: missed
            .into_iter()
            .filter(|it| !missed_anyway.contains(it))
            .collect(),
        verdict,
    })
}

/// Returns `true` if a goal in this state is closed or has no plan.
fn is_decided(state: &str) -> bool {
    FINAL_STATES.contains(&state) || MISSED_STATES.contains(&state)
}

/// Simulates the run of this status from this belief on, with a request if there is one, until the goals have their
/// final states. Returns the observations and the status at the end.
fn simulate(
    inputs: &RunInputs,
    status: Status,
    belief: &BeliefState,
    request: Option<Observation>,
    names: Vec<String>,
) -> Result<(Arc<Found>, Status), Error> {
    let snapshot = snapshot(&status, belief, status.now());
    let model = WorldModel::without_deviations();
    let mut world = AskingWorld {
        inner: SimWorld::mid_execution(belief, &model, 0, &ObservedChanges::default()),
        request,
    };
    let course = Course {
        status,
        names,
        found: Arc::default(),
    };
    let outcome = (Arc::clone(&course.found), course.status.clone());
    execute(inputs, snapshot, course, &mut world)
        .map_err(|error| Error::new(error.to_string(), "correct the options of the executive"))?;
    Ok(outcome)
}

/// Executes the simulation until the goals have their final states.
fn execute(
    inputs: &RunInputs,
    snapshot: RunSnapshot,
    course: Course,
    world: &mut dyn World,
) -> Result<(), SpecError> {
    let clock = Clock::start();
    let found = Arc::clone(&course.found);
    let may_continue = move || {
        !found.is_over.load(Ordering::SeqCst)
            && found.searches.load(Ordering::SeqCst) <= MAX_SEARCHES
            && clock.seconds() < Rational::from(MAX_SECONDS)
    };
    let no_clock = || Rational::ZERO;
    let planner = inputs.planner(&no_clock, &may_continue)?;
    let execution = inputs
        .execution(None)?
        .with_domain_commands(false)
        .resume_from(snapshot)
        .with_planner(planner)
        .with_preparer(inputs.preparer())
        .recorded_by(course)
        .with_explanations()
        .with_stop_check(|| !may_continue());
    execution.run_in(world);
    Ok(())
}

/// Counts actions as running whose start was commanded and has not been confirmed.
fn confirm_starts(belief: &mut BeliefState, status: &Status, now: &Rational) {
    for running in status.state().running {
        let ticket = ActionHandle(running.ticket);
        if belief.running().contains_key(&ticket) || running.planned.is_none() {
            continue;
        }
        let task = Arc::clone(belief.task());
        if let Ok(action) = action_named(&running.action, &task) {
            let planned = running.planned.map(|it| it.0).unwrap_or_default();
            let _ = belief.start(ticket, &Arc::new(action), &planned, &[]);
        }
    }
    let _ = belief.advance(now);
}

/// Returns the initial state of the simulation.
fn snapshot(status: &Status, belief: &BeliefState, now: Rational) -> RunSnapshot {
    let open = status.all_goals().goals;
    let open = open
        .iter()
        .filter(|goal| !FINAL_STATES.contains(&goal.state.as_str()));
    let (queued, pursued): (Vec<&GoalNow>, Vec<&GoalNow>) =
        open.partition(|goal| ["queued", "kept"].contains(&goal.state.as_str()));
    let goals = Goals {
        open: pursued.into_iter().map(given).collect(),
        are_changed: true,
    };
    let phase = adoption(status, belief, &goals).unwrap_or(RunPhase::Idle {
        since: now.clone(),
        is_unsolvable: false,
    });
    let plan = status.plan();
    let tickets = plan.steps.iter().filter_map(|step| step.ticket);
    let ended = plan.ended.iter().map(|ended| ended.ticket);
    let running = belief.running().keys().map(|ticket| ticket.0);
    let last = tickets.chain(ended).chain(running).max();
    RunSnapshot {
        belief: belief.clone(),
        started: last.map_or(0, |last| {
            usize::try_from(last)
                .unwrap_or(usize::MAX)
                .saturating_add(1)
        }),
        starts: belief.running().iter().map(known_start).collect(),
        allowance: Rational::ZERO,
        answers: (now, 0),
        replans: 0,
        refusals: RefusalBackoff::default(),
        goals,
        queued: queued.into_iter().map(given).collect(),
        is_paused: false,
        phase,
    }
}

/// Returns the adoption of the remaining plan; `None` if there is none, or if it does not reach its goals from here.
fn adoption(status: &Status, belief: &BeliefState, goals: &Goals) -> Option<RunPhase> {
    let task = belief.task();
    // Nothing is started before the request.
    let start = belief.time() + task.epsilon();
    let (situation, running) = situation_at(belief, start, OverrunEstimate::QuarterLonger);
    let left = status
        .plan()
        .steps
        .into_iter()
        .filter(|step| step.state == "to-come");
    let left = left.map(|step| {
        Some(Step {
            start: step.start.0,
            action: Arc::new(action_named(&step.action, task).ok()?),
            duration: step.duration.map(|it| it.0),
        })
    });
    let left: Vec<Step> = left.collect::<Option<_>>()?;
    if left.is_empty() && running.is_empty() {
        return None;
    }
    let plan = remaining_plan_of(task, &situation, left)?;
    Some(RunPhase::Adopting(Box::new(PlanAdoption {
        plan,
        situation,
        running,
        begun_steps: Vec::new(),
        goals: goals.clone(),
        plan_events: Vec::new(),
        pending_goal_change: None,
    })))
}

fn given(goal: &GoalNow) -> GivenGoal {
    let number = |it: &Option<Exact>| it.as_ref().map(|it| it.0.clone());
    GivenGoal {
        name: goal.name.clone(),
        text: Some(goal.goal.clone()),
        terms: GoalTerms {
            value: goal.value.0.clone(),
            deadline: number(&goal.deadline),
            release: number(&goal.release),
            keep: goal.keep,
            by: goal.by.clone(),
        },
        set_aside: goal.why.clone().filter(|_| goal.state == "set-aside"),
        missed_deadline: None,
        wait: match goal.state.as_str() {
            "kept" => Wait::Holds,
            "queued" if goal.keep => Wait::Others,
            _ => Wait::Release,
        },
    }
}

fn known_start(
    (ticket, running): (&ActionHandle, &elbowroom::execution::RunningActionState),
) -> KnownStart {
    KnownStart {
        ticket: *ticket,
        action: Arc::clone(&running.action),
        planned: Some(running.planned.clone()),
        commanded: running.start.clone(),
        started: Some(running.start.clone()),
        progress: None,
        ended: None,
        cancelled: None,
        timed_out: None,
        is_in_doubt: false,
        warned: None,
        warned_timeout: None,
        measured: [Vec::new(), Vec::new()],
    }
}

/// Returns the names of the goals in these states.
fn goals_in(run: &Status, states: &[&str]) -> Vec<String> {
    let goals = run.all_goals().goals.into_iter();
    let are_in = goals.filter(|goal| states.contains(&goal.state.as_str()));
    are_in.map(|goal| goal.name).collect()
}

/// World that passes the request on at its first answer.
struct AskingWorld<'m> {
    inner: SimWorld<'m>,
    request: Option<Observation>,
}

impl World for AskingWorld<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        match self.request.take() {
            Some(request) => Ok(TimeAdvance {
                now: request.time.clone(),
                observations: vec![request],
            }),
            None => self.inner.wait(until),
        }
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.inner.look(facts, fluents)
    }
}

/// Recorder that follows the simulation until the goals have their final states.
struct Course {
    status: Status,
    names: Vec<String>,
    found: Arc<Found>,
}

/// Observations of the simulation.
#[derive(Default)]
struct Found {
    is_over: AtomicBool,
    searches: AtomicUsize,
    /// The reason for which the run does not accept the goal.
    refused: Mutex<Option<String>>,
    /// The least slack of the first plan for the goal.
    slack: Mutex<Option<Rational>>,
}

impl Recorder for Course {
    fn record(&mut self, entry: &Entry<'_>) {
        self.status.record(entry);
        let found = &self.found;
        let mut is_over = matches!(entry, Entry::Over(_));
        match entry {
            Entry::Taken {
                observation:
                    Observation {
                        event: Event::Requested(_),
                        ..
                    },
                remark: Some(remark),
                ..
            } => {
                *found.refused.lock().unwrap_or_else(PoisonError::into_inner) =
                    Some((*remark).to_owned());
                is_over = true;
            }
            Entry::Planned { .. } => {
                found.searches.fetch_add(1, Ordering::SeqCst);
            }
            _ => {}
        }
        let goals = self.names.iter().map(|name| self.status.goal(name));
        let Some(goals) = goals.collect::<Option<Vec<GoalNow>>>() else {
            found.is_over.fetch_or(is_over, Ordering::SeqCst);
            return;
        };
        let is_pursued = goals.iter().any(|goal| goal.state == "pursued");
        let is_planned = matches!(entry, Entry::Decided { .. }) && is_pursued;
        if is_planned {
            let mut slack = found.slack.lock().unwrap_or_else(PoisonError::into_inner);
            if slack.is_none() {
                *slack = self.status.least_slack();
            }
        }
        let is_idle = matches!(entry, Entry::Resting { .. });
        is_over |= goals.iter().all(|goal| {
            FINAL_STATES.contains(&goal.state.as_str()) || is_idle && goal.state != "queued"
        });
        found.is_over.fetch_or(is_over, Ordering::SeqCst);
    }
}

#[cfg(test)]
mod tests;
