//! Interfaces for supervisors and monitoring: health, readiness, metrics.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::router::ApiRouter;
use crate::interface::documents::{Activity, GoalsNow, State};

/// States of goals, as `GET /v1/goals` has them.
const GOAL_STATES: [&str; 9] = [
    "queued",
    "kept",
    "pursued",
    "set-aside",
    "impossible",
    "unplanned",
    "achieved",
    "cancelled",
    "failed",
];

impl ApiRouter {
    /// Returns the reason for which the executive cannot start actions now, or `None` if it can.
    pub(super) fn obstacle_to_readiness(&self) -> Option<String> {
        let state = self.state();
        match (state.activity, state.unanswered) {
            (Activity::Beginning, _) => Some(state.why.unwrap_or("it is starting".to_owned())),
            (Activity::Over, _) => Some("the run has ended".to_owned()),
            (_, Some(seconds)) => Some(format!("the world has not answered for {seconds} s")),
            _ => None,
        }
    }

    /// Returns metrics in the text format of Prometheus, version 0.0.4.
    pub(super) fn metrics(&self) -> String {
        let goals = self.run().map(|run| run.status.all_goals());
        let is_ready = self.obstacle_to_readiness().is_none();
        metrics(&self.state(), goals.ok().as_ref(), is_ready)
    }
}

fn metrics(state: &State, goals: Option<&GoalsNow>, is_ready: bool) -> String {
    let mut text = String::new();
    let mut gauge = |name: &str, help: &str, value: f64| {
        let _ = writeln!(
            text,
            "# HELP elbowroom_{name} {help}\n# TYPE elbowroom_{name} gauge\nelbowroom_{name} {value}"
        );
    };
    let count = |count: usize| f64::from(u32::try_from(count).unwrap_or(u32::MAX));
    let time = "Time of the run by the world's clock, in seconds.";
    gauge("time_seconds", time, state.now.0.to_f64());
    let ready = "1 if actions can be started, 0 otherwise.";
    gauge("ready", ready, f64::from(u8::from(is_ready)));
    let silence = "Time for which the world has not answered, in seconds.";
    let seconds = u32::try_from(state.unanswered.unwrap_or_default()).unwrap_or(u32::MAX);
    gauge("world_silence_seconds", silence, f64::from(seconds));
    let restarting = "1 while the world's program is being started again, 0 otherwise.";
    let is_restarting = f64::from(u8::from(state.restarting.is_some()));
    gauge("world_restarting", restarting, is_restarting);
    gauge(
        "running_actions",
        "Running actions.",
        count(state.running.len()),
    );
    gauge("plans", "Plans that were begun.", count(state.plans));
    let doubts = "Facts and numbers that are in doubt.";
    gauge("doubts", doubts, count(state.in_doubt.len()));
    text.push_str("# HELP elbowroom_activity 1 for what the executive does, 0 for the others.\n");
    text.push_str("# TYPE elbowroom_activity gauge\n");
    for (activity, name) in Activity::NAMES {
        let is_it = u8::from(*activity == state.activity);
        let _ = writeln!(text, "elbowroom_activity{{activity=\"{name}\"}} {is_it}");
    }
    text.push_str(
        "# HELP elbowroom_goals Goals by state: open ones, and the last 1000 that were closed.\n",
    );
    text.push_str("# TYPE elbowroom_goals gauge\n");
    let mut counts: BTreeMap<&str, usize> = GOAL_STATES.iter().map(|it| (*it, 0)).collect();
    for goal in goals.iter().flat_map(|it| &it.goals) {
        *counts.entry(&goal.state).or_default() += 1;
    }
    for (name, count) in counts {
        let _ = writeln!(text, "elbowroom_goals{{state=\"{name}\"}} {count}");
    }
    text
}
