//! The executor's part on `PlanSys2`'s topic `actions_hub`.

use std::collections::{BTreeMap, BTreeSet};
use std::mem;
use std::time::Duration;

use crate::message::{ActionExecution, ActionPerformerStatus, kind, state};

/// A request may be lost while nodes find each other; it is repeated after so long.
const ASK_EVERY: Duration = Duration::from_secs(1);
/// An action that nobody has answered for so long has failed.
const GIVE_UP_ASKING: Duration = Duration::from_secs(30);
/// A performer whose status came every second, and has not come for so long, is lost.
const LOST_AFTER: Duration = Duration::from_secs(5);
/// A performer that has said for so long that it does nothing is not going to say how its action ended:
/// either it was never told to begin, or its last word is lost.
const IDLE_AFTER: Duration = Duration::from_secs(3);

/// The number of a start. It never comes again within a run.
pub type Ticket = u64;

/// An action that is to be done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Action {
    /// Which start it is.
    pub ticket: Ticket,
    /// Its name.
    pub name: String,
    /// Its objects.
    pub arguments: Vec<String>,
    /// Whether it takes no time: then it has started when it is done.
    pub is_instantaneous: bool,
}

/// What is to be done after something was heard.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// This is to be published on `actions_hub`.
    Send(ActionExecution),
    /// This has become of an action.
    Tell(Ticket, Told),
    /// People should know.
    Remark(String),
}

/// What has become of an action.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// It has started; if it takes no time, it is done.
    Started,
    /// It goes on.
    Feedback {
        /// How far it has come, from 0 to 1.
        completion: f32,
        /// What the performer says about that.
        note: String,
    },
    /// It has ended as it should.
    Succeeded,
    /// It has ended otherwise, and why.
    Failed(String),
    /// It does not run any more, as it was told to.
    Cancelled,
}

/// One action, and who does it. Messages carry no number of the execution: the name and the arguments
/// are all there is to go by.
type Key = (String, Vec<String>);

#[derive(Debug)]
struct Deal {
    action: Action,
    /// When it was last asked for.
    asked: Option<Duration>,
    /// When something last happened.
    since: Duration,
    performer: Option<String>,
    /// Since when the performer has said that it does nothing.
    idle: Option<Duration>,
    is_cancelled: bool,
}

/// A performer that was heard of.
#[derive(Debug)]
struct Heard {
    at: Duration,
    action: String,
}

/// The executor's side of `actions_hub`: finds a performer for each action, follows it, and notices who is
/// lost. Times are since any moment, the same for all calls, and do not go back.
#[derive(Debug)]
pub struct Hub {
    name: String,
    deals: BTreeMap<Key, Deal>,
    heard: BTreeMap<String, Heard>,
    others: BTreeSet<String>,
    effects: Vec<Effect>,
}

impl Hub {
    /// A hub that calls itself so on the topic.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            deals: BTreeMap::new(),
            heard: BTreeMap::new(),
            others: BTreeSet::new(),
            effects: Vec::new(),
        }
    }

    /// What is to be done since this was last asked, in this order.
    pub fn effects(&mut self) -> Vec<Effect> {
        mem::take(&mut self.effects)
    }

    /// Looks for a performer. A second one of the same action could not be told from the first, and fails.
    pub fn begin(&mut self, action: Action, now: Duration) {
        let key = (lower(&action.name), lower_all(&action.arguments));
        if let Some(there) = self.deals.get(&key) {
            let performer = there.performer.as_deref().unwrap_or("a performer");
            let why = if there.is_cancelled {
                format!("{performer} has not confirmed that it has stopped the same action")
            } else {
                format!("{performer} is still busy with the same action")
            };
            return self.tell(action.ticket, Told::Failed(why));
        }
        let deal = Deal {
            action,
            asked: None,
            since: now,
            performer: None,
            idle: None,
            is_cancelled: false,
        };
        self.deals.insert(key, deal);
        self.tick(now);
    }

    /// Has the performer stop. It does not answer: that it is ready again shows that it has.
    pub fn cancel(&mut self, ticket: Ticket) {
        let mut deals = self.deals.iter_mut();
        let its = |(_, it): &(&Key, &mut Deal)| it.action.ticket == ticket && !it.is_cancelled;
        let Some((key, deal)) = deals.find(its) else {
            return;
        };
        if let Some(performer) = &deal.performer {
            deal.is_cancelled = true;
            let message = say(kind::CANCEL, performer, &deal.action);
            self.effects.push(Effect::Send(message));
        } else {
            let key = key.clone();
            self.deals.remove(&key);
            self.tell(ticket, Told::Cancelled);
        }
    }

    /// Takes what came on `actions_hub`, its own messages included.
    pub fn message(&mut self, message: &ActionExecution, now: Duration) {
        let key = key_of(message);
        match message.kind {
            kind::REQUEST => self.asked_by_others(message),
            kind::RESPONSE => self.answered(&key, message, now),
            kind::FEEDBACK => self.went_on(&key, message, now),
            kind::FINISH => self.finished(&key, message),
            _ => {}
        }
    }

    /// Two executors would both choose performers, each for itself.
    fn asked_by_others(&mut self, message: &ActionExecution) {
        if message.node_id != self.name && self.others.insert(message.node_id.clone()) {
            self.effects.push(Effect::Remark(format!(
                "another executor, {}, is asking performers too: PlanSys2's own must be off",
                message.node_id
            )));
        }
    }

    fn answered(&mut self, key: &Key, message: &ActionExecution, now: Duration) {
        let node = &message.node_id;
        let deal = self.deals.get_mut(key);
        match deal.map(|it| (it.performer.is_some(), it)) {
            Some((true, deal)) if deal.performer.as_ref() == Some(node) => {}
            Some((false, deal)) => {
                deal.performer = Some(node.clone());
                deal.since = now;
                let message = say(kind::CONFIRM, node, &deal.action);
                let (ticket, has_started) = (deal.action.ticket, !deal.action.is_instantaneous);
                self.effects.push(Effect::Send(message));
                if has_started {
                    self.tell(ticket, Told::Started);
                }
            }
            // Whoever has answered waits for a word, also when the action was given up.
            _ => self.effects.push(Effect::Send(ActionExecution {
                kind: kind::REJECT,
                node_id: node.clone(),
                action: message.action.clone(),
                arguments: message.arguments.clone(),
                ..ActionExecution::default()
            })),
        }
    }

    fn went_on(&mut self, key: &Key, message: &ActionExecution, now: Duration) {
        let Some(deal) = self.deal_of(key, &message.node_id) else {
            return;
        };
        deal.since = now;
        deal.idle = None;
        if !deal.is_cancelled {
            let ticket = deal.action.ticket;
            let (completion, note) = (message.completion, message.status.clone());
            self.tell(ticket, Told::Feedback { completion, note });
        }
    }

    fn finished(&mut self, key: &Key, message: &ActionExecution) {
        let Some(deal) = self.deal_of(key, &message.node_id) else {
            return;
        };
        let ticket = deal.action.ticket;
        let told = if !message.success {
            Told::Failed(if message.status.is_empty() {
                format!("{} has not said why", message.node_id)
            } else {
                message.status.clone()
            })
        } else if deal.action.is_instantaneous {
            Told::Started
        } else {
            Told::Succeeded
        };
        self.deals.remove(key);
        self.tell(ticket, told);
    }

    /// Takes what came on `performers_status`.
    pub fn status(&mut self, status: &ActionPerformerStatus, now: Duration) {
        let node = &status.node_name;
        let action = status.action.clone();
        self.heard.insert(node.clone(), Heard { at: now, action });
        let mut over: Vec<(Key, Option<String>)> = Vec::new();
        for (key, deal) in &mut self.deals {
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
                    if now.saturating_sub(*deal.idle.get_or_insert(now)) >= IDLE_AFTER {
                        let why =
                            format!("{node} does nothing, and has not said how this has ended");
                        over.push((key.clone(), Some(why)));
                    }
                }
            }
        }
        for (key, why) in over {
            match why {
                Some(why) => self.lose(&key, why),
                None => {
                    if let Some(deal) = self.deals.remove(&key) {
                        self.tell(deal.action.ticket, Told::Cancelled);
                    }
                }
            }
        }
    }

    /// Those that were heard of lately, each with the action that it performs.
    pub fn performers(&self, now: Duration) -> Vec<(&str, &str)> {
        let lately = self.heard.iter();
        lately
            .filter(|(_, heard)| now.saturating_sub(heard.at) <= LOST_AFTER)
            .map(|(name, heard)| (name.as_str(), heard.action.as_str()))
            .collect()
    }

    /// Asks again, and notices who is lost. To be called a few times a second.
    pub fn tick(&mut self, now: Duration) {
        let mut lost = Vec::new();
        for (key, deal) in &mut self.deals {
            if let Some(performer) = &deal.performer {
                let heard = self.heard.get(performer).map(|it| it.at.max(deal.since));
                if heard.is_some_and(|at| now.saturating_sub(at) > LOST_AFTER) {
                    let why = format!(
                        "{performer} is lost: nothing was heard of it for {} s",
                        LOST_AFTER.as_secs()
                    );
                    lost.push((key.clone(), Some(why)));
                }
            } else if now.saturating_sub(deal.since) > GIVE_UP_ASKING {
                lost.push((key.clone(), None));
            } else if deal
                .asked
                .is_none_or(|at| now.saturating_sub(at) >= ASK_EVERY)
            {
                deal.asked = Some(now);
                let message = say(kind::REQUEST, &self.name, &deal.action);
                self.effects.push(Effect::Send(message));
            }
        }
        for (key, why) in lost {
            let why = why.unwrap_or_else(|| self.nobody(now));
            self.lose(&key, why);
        }
    }

    fn nobody(&self, now: Duration) -> String {
        format!(
            "no performer answered within {} s; performers that were heard: {}",
            GIVE_UP_ASKING.as_secs(),
            self.listed(now)
        )
    }

    /// Those that were heard of lately, for people: `robot1 (move), gripper (pick)`.
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

    /// The deal, if it is with this performer.
    fn deal_of(&mut self, key: &Key, node: &str) -> Option<&mut Deal> {
        let deal = self.deals.get_mut(key);
        deal.filter(|deal| deal.performer.as_deref() == Some(node))
    }

    fn lose(&mut self, key: &Key, why: String) {
        let Some(deal) = self.deals.remove(key) else {
            return;
        };
        if let Some(performer) = &deal.performer {
            // In case it is there all the same.
            let message = say(kind::CANCEL, performer, &deal.action);
            self.effects.push(Effect::Send(message));
        }
        self.tell(deal.action.ticket, Told::Failed(why));
    }

    fn tell(&mut self, ticket: Ticket, told: Told) {
        self.effects.push(Effect::Tell(ticket, told));
    }
}

fn say(kind: i16, node: &str, action: &Action) -> ActionExecution {
    ActionExecution {
        kind,
        node_id: node.to_owned(),
        action: action.name.clone(),
        arguments: action.arguments.clone(),
        ..ActionExecution::default()
    }
}

/// What a message is about. `PlanSys2` 2.0 sends an action without arguments as its own argument.
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
