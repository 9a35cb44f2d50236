//! Who must be there before time begins.

use std::time::Duration;

use crate::Hub;

/// Performers say once a second that they are there: so long after the first one, all have been heard.
const A_ROUND: Duration = Duration::from_millis(1200);

/// Waits for performers: for those of the actions that are needed, or, where none are named, for the first one and
/// those that are heard soon after.
#[derive(Debug)]
pub struct Census {
    needs: Vec<String>,
    within: Duration,
    first: Option<Duration>,
}

impl Census {
    /// `needs` are names of actions in lower case; `within` is how long to wait, from the hub's time 0.
    pub fn new(needs: Vec<String>, within: Duration) -> Self {
        Self {
            needs,
            within,
            first: None,
        }
    }

    /// Whether time can begin.
    ///
    /// # Errors
    /// The time to wait is over, and an action that is needed has no performer.
    pub fn is_over(&mut self, hub: &Hub, now: Duration) -> Result<bool, String> {
        let performers = hub.performers(now);
        if !performers.is_empty() {
            self.first.get_or_insert(now);
        }
        let is_there = |need: &&String| {
            performers
                .iter()
                .any(|(_, action)| action.to_lowercase() == **need)
        };
        let missing: Vec<_> = self
            .needs
            .iter()
            .filter(|it| !is_there(it))
            .map(String::as_str)
            .collect();
        let is_round = self
            .first
            .is_some_and(|at| now.saturating_sub(at) >= A_ROUND);
        if missing.is_empty() && (is_round || !self.needs.is_empty()) {
            return Ok(true);
        }
        if now < self.within {
            return Ok(false);
        }
        if missing.is_empty() {
            return Ok(true);
        }
        Err(format!(
            "no performer of {} was heard within {} s; heard: {}. Start it, or wait longer with --within",
            missing.join(", "),
            self.within.as_secs_f64(),
            hub.listed(now)
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::ActionPerformerStatus;

    fn hub_with(action: &str) -> Hub {
        let mut hub = Hub::new("elbowroom");
        let status = ActionPerformerStatus {
            node_name: "robot1".into(),
            action: action.into(),
            ..ActionPerformerStatus::default()
        };
        hub.status(&status, Duration::ZERO);
        hub
    }

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    #[test]
    fn time_begins_a_round_after_the_first_performer_or_when_nobody_comes() {
        let mut census = Census::new(vec![], seconds(3));
        let hub = hub_with("move");
        assert_eq!(census.is_over(&hub, seconds(0)), Ok(false));
        assert_eq!(census.is_over(&hub, seconds(1)), Ok(false));
        assert_eq!(census.is_over(&hub, seconds(2)), Ok(true));
        let mut census = Census::new(vec![], seconds(3));
        let nobody = Hub::new("elbowroom");
        assert_eq!(census.is_over(&nobody, seconds(2)), Ok(false));
        assert_eq!(census.is_over(&nobody, seconds(3)), Ok(true));
    }

    #[test]
    fn a_missing_performer_is_named() {
        let mut census = Census::new(vec!["move".into(), "pick".into()], seconds(3));
        let hub = hub_with("MOVE");
        assert_eq!(census.is_over(&hub, seconds(2)), Ok(false));
        let why = "no performer of pick was heard within 3 s; heard: robot1 (MOVE). Start it, or wait longer with --within";
        assert_eq!(census.is_over(&hub, seconds(3)), Err(why.into()));
        let mut census = Census::new(vec!["move".into()], seconds(3));
        assert_eq!(census.is_over(&hub, seconds(0)), Ok(true));
    }
}
