//! Executor's side of `PlanSys2`'s topic `actions_hub`.

use std::collections::{BTreeMap, BTreeSet};
use std::mem;
use std::time::Duration;

use crate::message::{ActionExecution, ActionPerformerStatus, kind, state};

/// Interval between repetitions of a request, which may be lost during discovery.
const REQUEST_INTERVAL: Duration = Duration::from_secs(1);
/// Time limit for an answer to a request. Then the action has failed.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(30);
/// Time without a status after which a performer is lost. It reports once a second.
const PERFORMER_TIMEOUT: Duration = Duration::from_secs(5);
/// Time for which a performer must report that it is idle until its action has failed. Either it
/// never received the confirmation, or its result was lost.
const IDLE_TIMEOUT: Duration = Duration::from_secs(3);

/// Number of a start, unique within a run.
pub type ActionHandle = u64;

/// Action to execute.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Action {
    /// Number of this start.
    pub ticket: ActionHandle,
    /// Its name.
    pub name: String,
    /// Its arguments.
    pub arguments: Vec<String>,
    /// `true` if it is instantaneous. Then its start is reported when it is done.
    pub is_instantaneous: bool,
}

/// Output of the hub.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// Message to publish on `actions_hub`.
    Send(ActionExecution),
    /// Report about an action.
    Report(ActionHandle, ActionUpdate),
    /// Message for the user.
    Remark(String),
}

/// Report about an action.
#[derive(Clone, Debug, PartialEq)]
pub enum ActionUpdate {
    /// It has started. An instantaneous action is also done.
    Started,
    /// It is running.
    Feedback {
        /// Completed share, from 0 to 1.
        completion: f32,
        /// Text of the performer.
        note: String,
    },
    /// It has succeeded.
    Succeeded,
    /// It has failed, for this reason.
    Failed(String),
    /// It has stopped after a cancel request.
    Cancelled,
}

/// Ground action, by its name and arguments. Messages have no other identification.
type Key = (String, Vec<String>);

#[derive(Debug)]
struct ActionRequest {
    action: Action,
    /// Time of the last request.
    last_request: Option<Duration>,
    /// Time of the last event.
    since: Duration,
    performer: Option<String>,
    /// Time since which the performer has reported that it is idle.
    idle: Option<Duration>,
    is_cancelled: bool,
}

/// Last status of a performer.
#[derive(Debug)]
struct PerformerState {
    at: Duration,
    action: String,
}

/// Executor's side of `actions_hub`. It finds a performer for each action, follows its progress,
/// and detects lost performers. Times must have a common origin and never decrease.
#[derive(Debug)]
pub struct Hub {
    name: String,
    requests: BTreeMap<Key, ActionRequest>,
    performer_states: BTreeMap<String, PerformerState>,
    others: BTreeSet<String>,
    effects: Vec<Effect>,
}

impl Hub {
    /// Creates a hub with this node name on the topic.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            requests: BTreeMap::new(),
            performer_states: BTreeMap::new(),
            others: BTreeSet::new(),
            effects: Vec::new(),
        }
    }

    /// Takes the outputs since the last call, in their order.
    pub fn effects(&mut self) -> Vec<Effect> {
        mem::take(&mut self.effects)
    }

    /// Requests a performer. Fails if the same ground action is already running, because messages
    /// could not distinguish the two.
    pub fn begin(&mut self, action: Action, now: Duration) {
        let key = (lower(&action.name), lower_all(&action.arguments));
        if let Some(there) = self.requests.get(&key) {
            let performer = there.performer.as_deref().unwrap_or("a performer");
            let why = if there.is_cancelled {
                format!("{performer} has not confirmed that it has stopped the same action")
            } else {
                format!("{performer} is still busy with the same action")
            };
            return self.report(action.ticket, ActionUpdate::Failed(why));
        }
        let deal = ActionRequest {
            action,
            last_request: None,
            since: now,
            performer: None,
            idle: None,
            is_cancelled: false,
        };
        self.requests.insert(key, deal);
        self.tick(now);
    }

    /// Asks the performer to stop. It sends no answer; its status shows when it has stopped.
    pub fn cancel(&mut self, ticket: ActionHandle) {
        let mut deals = self.requests.iter_mut();
        let its =
            |(_, it): &(&Key, &mut ActionRequest)| it.action.ticket == ticket && !it.is_cancelled;
        let Some((key, deal)) = deals.find(its) else {
            return;
        };
        if let Some(performer) = &deal.performer {
            deal.is_cancelled = true;
            let message = build_message(kind::CANCEL, performer, &deal.action);
            self.effects.push(Effect::Send(message));
        } else {
            let key = key.clone();
            self.requests.remove(&key);
            self.report(ticket, ActionUpdate::Cancelled);
        }
    }

    /// Takes a message of `actions_hub`. The hub's own messages are ignored.
    pub fn message(&mut self, message: &ActionExecution, now: Duration) {
        let key = key_of(message);
        match message.kind {
            kind::REQUEST => self.warn_of_other_executor(message),
            kind::RESPONSE => self.on_response(&key, message, now),
            kind::FEEDBACK => self.on_feedback(&key, message, now),
            kind::FINISH => self.on_finish(&key, message),
            _ => {}
        }
    }

    /// Warns about another executor. Both would choose performers independently.
    fn warn_of_other_executor(&mut self, message: &ActionExecution) {
        if message.node_id != self.name && self.others.insert(message.node_id.clone()) {
            self.effects.push(Effect::Remark(format!(
                "another executor, {}, also requests performers: PlanSys2's own must be off",
                message.node_id
            )));
        }
    }

    fn on_response(&mut self, key: &Key, message: &ActionExecution, now: Duration) {
        let node = &message.node_id;
        let deal = self.requests.get_mut(key);
        match deal.map(|it| (it.performer.is_some(), it)) {
            Some((true, deal)) if deal.performer.as_ref() == Some(node) => {}
            Some((false, deal)) => {
                deal.performer = Some(node.clone());
                deal.since = now;
                let message = build_message(kind::CONFIRM, node, &deal.action);
                let (ticket, has_started) = (deal.action.ticket, !deal.action.is_instantaneous);
                self.effects.push(Effect::Send(message));
                if has_started {
                    self.report(ticket, ActionUpdate::Started);
                }
            }
            // A performer that has answered waits for a decision, even if the action was abandoned.
            _ => self.effects.push(Effect::Send(ActionExecution {
                kind: kind::REJECT,
                node_id: node.clone(),
                action: message.action.clone(),
                arguments: message.arguments.clone(),
                ..ActionExecution::default()
            })),
        }
    }

    fn on_feedback(&mut self, key: &Key, message: &ActionExecution, now: Duration) {
        let Some(deal) = self.request_of(key, &message.node_id) else {
            return;
        };
        deal.since = now;
        deal.idle = None;
        if !deal.is_cancelled {
            let ticket = deal.action.ticket;
            let (completion, note) = (message.completion, message.status.clone());
            self.report(ticket, ActionUpdate::Feedback { completion, note });
        }
    }

    fn on_finish(&mut self, key: &Key, message: &ActionExecution) {
        let Some(deal) = self.request_of(key, &message.node_id) else {
            return;
        };
        let ticket = deal.action.ticket;
        let told = if !message.success {
            ActionUpdate::Failed(if message.status.is_empty() {
                format!("{} gave no reason", message.node_id)
            } else {
                message.status.clone()
            })
        } else if deal.action.is_instantaneous {
            ActionUpdate::Started
        } else {
            ActionUpdate::Succeeded
        };
        self.requests.remove(key);
        self.report(ticket, told);
    }

    /// Takes a message of `performers_status`.
    pub fn status(&mut self, status: &ActionPerformerStatus, now: Duration) {
        let node = &status.node_name;
        let action = status.action.clone();
        self.performer_states
            .insert(node.clone(), PerformerState { at: now, action });
        let mut over: Vec<(Key, Option<String>)> = Vec::new();
        for (key, deal) in &mut self.requests {
            if deal.performer.as_ref() != Some(node) {
                continue;
            }
            if deal.is_cancelled {
                if status.state != state::RUNNING {
                    over.push((key.clone(), None));
                }
                continue;
            }
            match status.state {
                state::FAILURE => {
                    over.push((key.clone(), Some(format!("{node} reports a failure"))));
                }
                state::RUNNING => deal.idle = None,
                _ => {
                    if now.saturating_sub(*deal.idle.get_or_insert(now)) >= IDLE_TIMEOUT {
                        let why = format!("{node} is idle, and has not reported the outcome");
                        over.push((key.clone(), Some(why)));
                    }
                }
            }
        }
        for (key, why) in over {
            match why {
                Some(why) => self.fail_request(&key, why),
                None => {
                    if let Some(deal) = self.requests.remove(&key) {
                        self.report(deal.action.ticket, ActionUpdate::Cancelled);
                    }
                }
            }
        }
    }

    /// Returns the performers with a recent status, each with its action.
    pub fn performers(&self, now: Duration) -> Vec<(&str, &str)> {
        let lately = self.performer_states.iter();
        lately
            .filter(|(_, heard)| now.saturating_sub(heard.at) <= PERFORMER_TIMEOUT)
            .map(|(name, heard)| (name.as_str(), heard.action.as_str()))
            .collect()
    }

    /// Repeats requests, and detects lost performers. To be called a few times a second.
    pub fn tick(&mut self, now: Duration) {
        let mut lost = Vec::new();
        for (key, deal) in &mut self.requests {
            if let Some(performer) = &deal.performer {
                let heard = self
                    .performer_states
                    .get(performer)
                    .map(|it| it.at.max(deal.since));
                if heard.is_some_and(|at| now.saturating_sub(at) > PERFORMER_TIMEOUT) {
                    let why = format!(
                        "{performer} is lost: no message from it for {} s",
                        PERFORMER_TIMEOUT.as_secs()
                    );
                    lost.push((key.clone(), Some(why)));
                }
            } else if now.saturating_sub(deal.since) > REQUEST_TIMEOUT {
                lost.push((key.clone(), None));
            } else if deal
                .last_request
                .is_none_or(|at| now.saturating_sub(at) >= REQUEST_INTERVAL)
            {
                deal.last_request = Some(now);
                let message = build_message(kind::REQUEST, &self.name, &deal.action);
                self.effects.push(Effect::Send(message));
            }
        }
        for (key, why) in lost {
            let why = why.unwrap_or_else(|| self.no_performer_message(now));
            self.fail_request(&key, why);
        }
    }

    fn no_performer_message(&self, now: Duration) -> String {
        format!(
            "no performer answered within {} s; discovered performers: {}",
            REQUEST_TIMEOUT.as_secs(),
            self.listed(now)
        )
    }

    /// Lists the performers with a recent status, for the user: `robot1 (move), gripper (pick)`.
    pub fn listed(&self, now: Duration) -> String {
        let each = |(name, action): (&str, &str)| match action {
            "" => name.to_owned(),
            action => format!("{name} ({action})"),
        };
        let all: Vec<_> = self.performers(now).into_iter().map(each).collect();
        if all.is_empty() {
            "none".to_owned()
        } else {
            all.join(", ")
        }
    }

    /// Returns the deal if its performer is `node`.
    fn request_of(&mut self, key: &Key, node: &str) -> Option<&mut ActionRequest> {
        let deal = self.requests.get_mut(key);
        deal.filter(|deal| deal.performer.as_deref() == Some(node))
    }

    fn fail_request(&mut self, key: &Key, why: String) {
        let Some(deal) = self.requests.remove(key) else {
            return;
        };
        if let Some(performer) = &deal.performer {
            // The performer may still be running.
            let message = build_message(kind::CANCEL, performer, &deal.action);
            self.effects.push(Effect::Send(message));
        }
        self.report(deal.action.ticket, ActionUpdate::Failed(why));
    }

    fn report(&mut self, ticket: ActionHandle, told: ActionUpdate) {
        self.effects.push(Effect::Report(ticket, told));
    }
}

fn build_message(kind: i16, node: &str, action: &Action) -> ActionExecution {
    ActionExecution {
        kind,
        node_id: node.to_owned(),
        action: action.name.clone(),
        arguments: action.arguments.clone(),
        ..ActionExecution::default()
    }
}

/// Returns the ground action of a message. `PlanSys2` 2.0 sends an action without arguments as its
/// own argument.
fn key_of(message: &ActionExecution) -> Key {
    let name = lower(&message.action);
    let mut arguments = lower_all(&message.arguments);
    if arguments.len() == 1 && arguments[0] == name {
        arguments.clear();
    }
    (name, arguments)
}

fn lower(text: &str) -> String {
    text.to_lowercase()
}

fn lower_all(texts: &[String]) -> Vec<String> {
    texts.iter().map(|it| lower(it)).collect()
}

#[cfg(test)]
mod tests;
