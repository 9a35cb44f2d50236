//! Changes of facts in a run, by actions and spontaneously: [`FactHistory`].

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_execution::{ActionHandle, BeliefState};
use elbowroom_learning::changes::Exposure;
use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Effect, FactId};
use elbowroom_num::Rational;
use elbowroom_pddl::read_problem;
use elbowroom_report::trace::schema::{IssuedCommandLine, ObservationLine};
use elbowroom_report::trace::{Line, Stored, action_named};
use elbowroom_sim::WorldModel;
use elbowroom_text::Source;

use super::super::RequestError;
use crate::execute::RunSpec;

/// The facts of one run, from its trace: the initial facts, the effects of actions and timed
/// initials, and the facts reported as changed otherwise.
#[derive(Clone, Debug)]
pub struct FactHistory {
    task: Arc<Task>,
    changes: Vec<FactChange>,
    /// Duration of the run, in seconds.
    duration: f64,
    /// Failures of actions whose start had changed facts.
    failures: Vec<ActionFailure>,
}

/// A failure of an action.
#[derive(Clone, Debug)]
struct ActionFailure {
    /// The name of the action, without its objects.
    name: String,
    at: Rational,
    /// The facts that the start had changed and the failure did not restore.
    left_behind: Vec<(FactId, bool)>,
}

/// A change of a fact.
#[derive(Clone, Copy, Debug)]
struct FactChange {
    fact: FactId,
    becomes: bool,
    at: f64,
    is_spontaneous: bool,
}

impl FactHistory {
    /// Returns `None` if the trace does not contain the problem and the executed actions.
    pub(super) fn of(trace: &Stored) -> Option<Self> {
        let spec: RunSpec = trace.header().ok()?;
        let source = |text: &str| Source::new("trace", text);
        let read = read_problem(&source(&spec.domain.text), &source(&spec.problem.text));
        let task = Arc::new(Task::new(read.ok()?.0));
        let mut follower = TraceReplay {
            state: BeliefState::new(Arc::clone(&task)),
            task,
            changes: Vec::new(),
            commanded: BTreeMap::new(),
            started: BTreeMap::new(),
            failures: Vec::new(),
            last_failure: (Rational::ZERO, BTreeSet::new()),
            unsettled: BTreeSet::new(),
        };
        for line in &trace.lines {
            follower.follow(line);
        }
        let lasted = follower.state.time().to_f64();
        Some(Self {
            task: follower.task,
            changes: follower.changes,
            failures: follower.failures,
            duration: lasted,
        })
    }

    /// Returns the name of the domain.
    pub fn domain(&self) -> &str {
        &self.task.problem().domain
    }

    /// Returns the believed world of the run, if it had one.
    pub(super) fn believed_world(&self, trace: &Stored) -> Option<WorldModel> {
        let spec: RunSpec = trace.header().ok()?;
        self.read(&Source::new("world", spec.believed?))
    }

    /// Reads a world file for the problem of the run.
    pub(super) fn read(&self, world: &Source) -> Option<WorldModel> {
        WorldModel::read(world, self.task.problem()).ok()
    }

    /// Returns, for each failure of an action whose start had changed facts, the action's name, and
    /// `true` if all these changes were undone at the failure.
    pub(super) fn undone_effects(&self) -> impl Iterator<Item = (&str, bool)> {
        let failures = self.failures.iter();
        failures.map(|failed| (failed.name.as_str(), failed.left_behind.is_empty()))
    }

    /// Returns the predicates with a fact that has changed by itself.
    pub(super) fn changing_predicates(&self) -> impl Iterator<Item = String> {
        let flips = self.changes.iter().filter(|flip| flip.is_spontaneous);
        flips.map(|flip| {
            let (predicate, _) = self.task.atom(flip.fact);
            self.task.problem().predicates[predicate.index()]
                .name
                .clone()
        })
    }

    /// Returns how long all facts of a predicate were true and false, and how often they changed by
    /// themselves. Empty for a predicate with more facts than a world file may have rates for.
    pub(super) fn exposures(&self, predicate: &str) -> Vec<Exposure> {
        let all = format!(
            "format = \"elbowroom-world\"\nversion = 1\n[[hazard]]\nfact = \"{predicate}\"\n\
             becomes_true_per_second = 1"
        );
        let problem = self.task.problem();
        let Ok(model) = WorldModel::read(all.as_str(), problem) else {
            return Vec::new();
        };
        let names = model.hazardous(problem).into_iter();
        let known = names.filter_map(|(name, _)| Some((self.task.fact_named(&name)?, name)));
        known
            .flat_map(|(fact, name)| self.exposure(fact, &name))
            .collect()
    }

    /// Returns the exposures of the facts that change by themselves in `world`, each with its rate.
    pub(super) fn expected(&self, world: &Source) -> Result<Vec<(Exposure, f64)>, RequestError> {
        let problem = self.task.problem();
        let model = WorldModel::read(world.clone(), problem).map_err(|mistakes| {
            RequestError::Unsupported(format!(
                "the expected world does not fit the problem of a log: {mistakes}"
            ))
        })?;
        let rates = model.hazardous(problem).into_iter();
        let known =
            rates.filter_map(|(name, rate)| Some((self.task.fact_named(&name)?, name, rate)));
        let both = known.flat_map(|(fact, name, rate)| {
            let exposures = self.exposure(fact, &name).into_iter();
            exposures.map(|exposure| {
                let rate = rate.rate(exposure.becomes);
                (exposure, rate)
            })
        });
        Ok(both.collect())
    }

    fn exposure(&self, fact: FactId, name: &str) -> [Exposure; 2] {
        let mut both = [false, true].map(|becomes| Exposure {
            fact: name.to_owned(),
            becomes,
            seconds: 0.0,
            changes: 0,
        });
        let mut truth = self.task.initial().facts.contains(&fact);
        let mut since = 0.0;
        for flip in self.changes.iter().filter(|flip| flip.fact == fact) {
            // A fact that is true can become false.
            both[usize::from(!truth)].seconds += flip.at - since;
            both[usize::from(flip.becomes)].changes += u64::from(flip.is_spontaneous);
            (truth, since) = (flip.becomes, flip.at);
        }
        both[usize::from(!truth)].seconds += self.duration - since;
        both
    }
}

/// A state that is progressed along a trace.
struct TraceReplay {
    task: Arc<Task>,
    state: BeliefState,
    changes: Vec<FactChange>,
    commanded: BTreeMap<u64, (Arc<Action>, Option<Rational>)>,
    /// By ticket: the facts that a start has changed, with their previous values.
    started: BTreeMap<u64, Vec<(FactId, bool)>>,
    failures: Vec<ActionFailure>,
    /// The time of the last failure, and the facts that the start of this action had changed. A
    /// fact that the failure restores has not changed by itself.
    last_failure: (Rational, BTreeSet<FactId>),
    /// Facts that cancelled actions may have changed, and that were not reported since.
    unsettled: BTreeSet<FactId>,
}

impl TraceReplay {
    fn follow(&mut self, line: &Line) {
        match line {
            Line::Command(line) => {
                self.advance_to(&line.now.0);
                if let IssuedCommandLine::Start {
                    ticket,
                    action,
                    duration,
                } = &line.command
                    && let Ok(action) = action_named(action, &self.task)
                {
                    let duration = duration.as_ref().map(|duration| duration.0.clone());
                    self.commanded.insert(*ticket, (Arc::new(action), duration));
                }
            }
            Line::Passed(line) => self.advance_to(&line.now.0),
            Line::Observed(line) => {
                if let Some(observation) = line.as_processed() {
                    self.observe(&observation);
                }
            }
            Line::Over(line) => self.advance_to(&line.time),
            _ => {}
        }
    }

    fn observe(&mut self, observation: &ObservationLine) {
        match observation {
            ObservationLine::Started { ticket, time, .. } => {
                self.advance_to(&time.0);
                let Some((action, planned)) = self.commanded.get(ticket).cloned() else {
                    return;
                };
                let facts = affected_facts(&action, true);
                let before = facts.iter().map(|fact| (*fact, self.state.fact(*fact)));
                let before: Vec<_> = before.collect();
                self.record_changes(&facts, |state| {
                    let planned = planned.unwrap_or_default();
                    let _ = state.start(ActionHandle(*ticket), &action, &planned, &[]);
                });
                self.started.insert(*ticket, self.changed_since(before));
            }
            ObservationLine::Ended {
                ticket,
                outcome,
                time,
                ..
            } => {
                self.advance_to(&time.0);
                let Some((action, _)) = self.commanded.remove(ticket) else {
                    return;
                };
                let before = self.started.remove(ticket).unwrap_or_default();
                if outcome == "failed" && !before.is_empty() {
                    let schema = action.schema.index();
                    self.failures.push(ActionFailure {
                        name: self.task.problem().schemas[schema].name.clone(),
                        at: time.0.clone(),
                        left_behind: self.changed_since(before),
                    });
                }
                if outcome == "succeeded" {
                    let facts = affected_facts(&action, false);
                    self.record_changes(&facts, |state| {
                        let _ = state.end(ActionHandle(*ticket), &[]);
                    });
                    return;
                }
                self.state.stop(ActionHandle(*ticket));
                if self.last_failure.0 != time.0 {
                    self.last_failure = (time.0.clone(), BTreeSet::new());
                }
                self.last_failure.1.extend(affected_facts(&action, true));
                if outcome == "cancelled" {
                    self.unsettled.extend(affected_facts(&action, true));
                    self.unsettled.extend(affected_facts(&action, false));
                }
            }
            ObservationLine::Fact {
                fact,
                becomes,
                time,
            } => {
                self.advance_to(&time.0);
                let Some(fact) = self.task.fact_named(fact) else {
                    return;
                };
                // The first report after a cancellation is about the state in which it left the fact.
                let is_settled = !self.unsettled.remove(&fact);
                if self.state.fact(fact) == *becomes {
                    return;
                }
                self.state.change_fact(fact, *becomes);
                let is_undone =
                    self.last_failure.0 == time.0 && self.last_failure.1.contains(&fact);
                self.record_change(fact, &time.0, is_settled && !is_undone);
                let state = &self.state;
                let now = self.failures.iter_mut().rev();
                for failed in now.take_while(|failed| failed.at == time.0) {
                    failed
                        .left_behind
                        .retain(|(fact, before)| state.fact(*fact) != *before);
                }
            }
            _ => {}
        }
    }

    /// Returns the facts whose values differ from those in `before`.
    fn changed_since(&self, mut before: Vec<(FactId, bool)>) -> Vec<(FactId, bool)> {
        before.retain(|(fact, before)| self.state.fact(*fact) != *before);
        before
    }

    /// Advances to `time` and applies timed initials. A late report counts as of now.
    fn advance_to(&mut self, time: &Rational) {
        while let Some(timed) = self.task.timed().get(self.state.past_timed_initials())
            && timed.time <= *time
        {
            let at = timed.time.clone();
            let facts: Vec<FactId> = timed.changes.iter().filter_map(fact_of).collect();
            self.record_changes_at(&facts, &at, |state| {
                let _ = state.advance(&at);
            });
        }
        if *time > *self.state.time() {
            let _ = self.state.advance(time);
        }
    }

    fn record_changes(&mut self, facts: &[FactId], what: impl FnOnce(&mut BeliefState)) {
        let now = self.state.time().clone();
        self.record_changes_at(facts, &now, what);
    }

    /// Runs `what`, and records which of these facts it changes.
    fn record_changes_at(
        &mut self,
        facts: &[FactId],
        at: &Rational,
        what: impl FnOnce(&mut BeliefState),
    ) {
        let before: Vec<bool> = facts.iter().map(|fact| self.state.fact(*fact)).collect();
        what(&mut self.state);
        for (fact, before) in facts.iter().zip(before) {
            self.unsettled.remove(fact);
            if self.state.fact(*fact) != before {
                self.record_change(*fact, at, false);
            }
        }
    }

    fn record_change(&mut self, fact: FactId, at: &Rational, is_by_itself: bool) {
        let latest = self.changes.last().map_or(0.0, |flip| flip.at);
        self.changes.push(FactChange {
            fact,
            becomes: self.state.fact(fact),
            at: at.to_f64().max(latest),
            is_spontaneous: is_by_itself,
        });
    }
}

/// Returns the facts that an action's start or end may change, each once.
fn affected_facts(action: &Action, is_start: bool) -> Vec<FactId> {
    let effects: &[Effect] = match &action.body {
        Body::Instantaneous(snap) if is_start => &snap.effects,
        Body::Instantaneous(_) => &[],
        Body::Durative(body) if is_start => &body.start.effects,
        Body::Durative(body) => &body.end.effects,
    };
    let facts = effects.iter().filter_map(|effect| fact_of(&effect.change));
    let facts: BTreeSet<FactId> = facts.collect();
    facts.into_iter().collect()
}

fn fact_of(change: &Change) -> Option<FactId> {
    match change {
        Change::Add(fact) | Change::Delete(fact) => Some(*fact),
        Change::Update { .. } => None,
    }
}
