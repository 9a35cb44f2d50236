//! Status of each action of a plan, as reported by `PlanSys2`'s executor.

use std::collections::BTreeMap;

use crate::interface::{ActionExecutionInfo, Plan, PlanItem, execution};
use crate::message::Stamp;
use crate::{Action, ActionHandle, ActionUpdate};

/// Actions of a plan with their status. Actions of later plans are appended.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    infos: Vec<ActionExecutionInfo>,
    /// Entry of each start.
    entries: BTreeMap<ActionHandle, usize>,
}

impl Progress {
    /// Creates the progress of a plan, none of whose actions has started.
    pub fn new(plan: &Plan) -> Self {
        let infos = plan.items.iter().map(|item| {
            let (name, arguments) = words(&item.action);
            ActionExecutionInfo {
                status: execution::NOT_EXECUTED,
                action_full_name: format!("{}:{:.0}", item.action, f64::from(item.time) * 1000.0),
                action: name,
                arguments,
                duration: stamp(item.duration),
                ..ActionExecutionInfo::default()
            }
        });
        Self {
            infos: infos.collect(),
            entries: BTreeMap::new(),
        }
    }

    /// Returns the status of each action.
    pub fn infos(&self) -> &[ActionExecutionInfo] {
        &self.infos
    }

    /// Returns the remaining steps of `plan`, whose progress this is: the actions that have not
    /// succeeded.
    pub fn remaining_plan(&self, plan: &Plan) -> Plan {
        let with_infos = plan.items.iter().zip(&self.infos);
        let left = with_infos.filter(|(_, info)| info.status != execution::SUCCEEDED);
        Plan {
            items: left.map(|(item, _)| item.clone()).collect(),
        }
    }

    /// Adds a start of an action.
    pub fn begin(&mut self, action: &Action) {
        let is_its = |it: &ActionExecutionInfo| {
            it.status == execution::NOT_EXECUTED
                && it.action == action.name
                && it.arguments == action.arguments
        };
        let open = |at: &usize| !self.entries.values().any(|it| it == at);
        let found = (0..self.infos.len())
            .filter(open)
            .find(|&at| is_its(&self.infos[at]));
        let entry = found.unwrap_or_else(|| {
            let text = [std::slice::from_ref(&action.name), &action.arguments]
                .concat()
                .join(" ");
            self.infos.push(ActionExecutionInfo {
                status: execution::NOT_EXECUTED,
                action_full_name: format!("({text}):"),
                action: action.name.clone(),
                arguments: action.arguments.clone(),
                ..ActionExecutionInfo::default()
            });
            self.infos.len() - 1
        });
        self.entries.insert(action.ticket, entry);
    }

    /// Takes a report about an action.
    pub fn update(&mut self, ticket: ActionHandle, told: &ActionUpdate, now: Stamp) {
        let Some(&entry) = self.entries.get(&ticket) else {
            return;
        };
        let info = &mut self.infos[entry];
        info.status_stamp = now;
        info.status = match told {
            ActionUpdate::Started => {
                info.start_stamp = now;
                execution::EXECUTING
            }
            ActionUpdate::Feedback { completion, note } => {
                info.completion = *completion;
                info.message_status.clone_from(note);
                execution::EXECUTING
            }
            ActionUpdate::Succeeded => {
                info.completion = 1.0;
                execution::SUCCEEDED
            }
            ActionUpdate::Failed(why) => {
                info.message_status.clone_from(why);
                execution::FAILED
            }
            ActionUpdate::Cancelled => execution::CANCELLED,
        };
    }
}

/// Returns a plan in the format that `elbowroom` reads: `0.000: (move r a b) [2.000]`, line by
/// line. Times are 32-bit floats in messages, and are written as the shortest decimals with the
/// same value.
pub fn plan_text(plan: &Plan) -> String {
    let line = |item: &PlanItem| {
        let (name, arguments) = words(&item.action);
        let action = [vec![name], arguments].concat().join(" ");
        // An instantaneous action has no duration in that format.
        let duration = (item.duration > 0.0).then(|| format!(" [{}]", item.duration));
        format!(
            "{}: ({action}){}\n",
            item.time,
            duration.unwrap_or_default()
        )
    };
    plan.items.iter().map(line).collect()
}

fn words(text: &str) -> (String, Vec<String>) {
    let inner = text.trim_matches(|it: char| it == '(' || it == ')' || it.is_whitespace());
    let mut words = inner.split_whitespace().map(str::to_owned);
    (words.next().unwrap_or_default(), words.collect())
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "`as` takes the nearest number that there is"
)]
fn stamp(seconds: f32) -> Stamp {
    let seconds = f64::from(seconds.max(0.0));
    Stamp {
        sec: seconds.trunc() as i32,
        nanosec: (seconds.fract() * 1e9) as u32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use execution::{EXECUTING, FAILED, NOT_EXECUTED, SUCCEEDED};

    fn plan() -> Plan {
        let item = |time, action: &str| PlanItem {
            time,
            action: action.into(),
            duration: 2.5,
        };
        Plan {
            items: vec![
                item(0.0, "(move r a b)"),
                item(2.501, "(move r b a)"),
                item(5.002, "(move r a b)"),
            ],
        }
    }

    fn action(ticket: ActionHandle, text: &str) -> Action {
        let (name, arguments) = words(text);
        Action {
            ticket,
            name,
            arguments,
            is_instantaneous: false,
        }
    }

    #[test]
    fn remaining_plan_has_unsuccessful_actions() {
        let mut progress = Progress::new(&plan());
        let now = Stamp { sec: 9, nanosec: 0 };
        let left = |progress: &Progress| progress.remaining_plan(&plan()).items;
        assert_eq!(left(&progress), plan().items);
        for (ticket, told) in [
            (1, ActionUpdate::Succeeded),
            (2, ActionUpdate::Failed("it slips".into())),
        ] {
            progress.begin(&action(ticket, "(move r a b)"));
            progress.update(ticket, &told, now);
        }
        // An action outside the plan does not count.
        progress.begin(&action(3, "(jump r)"));
        progress.update(3, &ActionUpdate::Succeeded, now);
        assert_eq!(left(&progress), plan().items[1..]);
    }

    #[test]
    fn each_start_is_the_first_open_entry_of_its_action_or_a_new_one() {
        let mut progress = Progress::new(&plan());
        assert_eq!(progress.infos()[1].action_full_name, "(move r b a):2501");
        assert_eq!(
            progress.infos()[0].duration,
            Stamp {
                sec: 2,
                nanosec: 500_000_000
            }
        );
        let now = Stamp { sec: 9, nanosec: 0 };
        progress.begin(&action(1, "(move r a b)"));
        progress.update(1, &ActionUpdate::Started, now);
        progress.begin(&action(2, "(move r a b)"));
        progress.update(2, &ActionUpdate::Failed("it slips".into()), now);
        progress.begin(&action(3, "(jump r)"));
        progress.update(3, &ActionUpdate::Succeeded, now);
        progress.update(99, &ActionUpdate::Succeeded, now);
        let statuses: Vec<_> = progress.infos().iter().map(|it| it.status).collect();
        assert_eq!(statuses, [EXECUTING, NOT_EXECUTED, FAILED, SUCCEEDED]);
        assert_eq!(progress.infos()[2].message_status, "it slips");
        assert_eq!(progress.infos()[3].action_full_name, "(jump r):");
    }

    #[test]
    fn plan_text_round_trips() {
        let lines = "0: (move r a b) [2.5]\n2.501: (move r b a) [2.5]\n5.002: (move r a b) [2.5]\n";
        assert_eq!(plan_text(&plan()), lines);
    }
}
