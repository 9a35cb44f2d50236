//! Waiting for performers before time begins.

use std::time::Duration;

use crate::Hub;

/// Time from the first performer until all performers have been heard. Each one reports once a
/// second.
const ROUND: Duration = Duration::from_millis(1200);
/// Time from the first performer until missing ones are ignored. A plan may not need them.
const STRAGGLERS: Duration = Duration::from_secs(3);

/// Waits for performers. The names of needed actions have priority. Without them, it waits for a
/// performer of each action of the domain. If the domain is unknown as well, it waits for the first
/// performer, and for those that follow soon.
#[derive(Debug)]
pub struct PerformerDiscovery {
    needs: Vec<String>,
    domain: Vec<String>,
    within: Duration,
    first: Option<Duration>,
}

impl PerformerDiscovery {
    /// Creates a census. `needs` are names of actions in lower case. `within` is the time limit,
    /// from the hub's time 0.
    pub fn new(needs: Vec<String>, within: Duration) -> Self {
        Self {
            needs,
            domain: Vec::new(),
            within,
            first: None,
        }
    }

    /// Sets the actions of the domain, in lower case.
    pub fn set_domain_actions(&mut self, domain: Vec<String>) {
        self.domain = domain;
    }

    /// Returns the actions of the domain without a performer so far. A plan may not need them.
    pub fn actions_without_performer(&self, hub: &Hub, now: Duration) -> Vec<&str> {
        missing(&self.domain, hub, now)
    }

    /// Returns `true` if time can begin.
    ///
    /// # Errors
    /// The time limit has passed, and a needed action has no performer.
    pub fn is_over(&mut self, hub: &Hub, now: Duration) -> Result<bool, String> {
        if !hub.performers(now).is_empty() {
            self.first.get_or_insert(now);
        }
        let missing = missing(&self.needs, hub, now);
        let first = self.first;
        let is_since = |round| first.is_some_and(|at| now.saturating_sub(at) >= round);
        let are_all_there = if self.needs.is_empty() {
            // Several performers may offer the same action.
            let is_attended = || self.actions_without_performer(hub, now).is_empty();
            is_since(STRAGGLERS) || is_since(ROUND) && is_attended()
        } else {
            missing.is_empty()
        };
        if are_all_there {
            return Ok(true);
        }
        if now < self.within {
            return Ok(false);
        }
        if missing.is_empty() {
            return Ok(true);
        }
        Err(format!(
            "no performer of {} was discovered within {} s; discovered: {}. Start it, or wait \
             longer with --within",
            missing.join(", "),
            self.within.as_secs_f64(),
            hub.listed(now)
        ))
    }
}

/// Returns the actions without a performer.
fn missing<'a>(actions: &'a [String], hub: &Hub, now: Duration) -> Vec<&'a str> {
    let performers = hub.performers(now);
    let is_there = |wanted: &&String| {
        let mut performed = performers.iter().map(|(_, action)| action.to_lowercase());
        performed.any(|action| action == **wanted)
    };
    let missing = actions.iter().filter(|it| !is_there(it));
    missing.map(String::as_str).collect()
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
    fn time_begins_after_first_performer_or_timeout() {
        let mut census = PerformerDiscovery::new(vec![], seconds(3));
        let hub = hub_with("move");
        assert_eq!(census.is_over(&hub, seconds(0)), Ok(false));
        assert_eq!(census.is_over(&hub, seconds(1)), Ok(false));
        assert_eq!(census.is_over(&hub, seconds(2)), Ok(true));
        let mut census = PerformerDiscovery::new(vec![], seconds(3));
        let nobody = Hub::new("elbowroom");
        assert_eq!(census.is_over(&nobody, seconds(2)), Ok(false));
        assert_eq!(census.is_over(&nobody, seconds(3)), Ok(true));
    }

    #[test]
    fn known_domain_waits_for_all_its_actions() {
        let mut census = PerformerDiscovery::new(vec![], seconds(10));
        census.set_domain_actions(vec!["move".into(), "pick".into()]);
        let hub = hub_with("move");
        assert_eq!(census.is_over(&hub, seconds(0)), Ok(false));
        assert_eq!(census.is_over(&hub, seconds(2)), Ok(false));
        assert_eq!(census.actions_without_performer(&hub, seconds(2)), ["pick"]);
        // A plan may not need the missing action.
        assert_eq!(census.is_over(&hub, seconds(3)), Ok(true));
        let mut census = PerformerDiscovery::new(vec![], seconds(10));
        census.set_domain_actions(vec!["move".into()]);
        assert_eq!(census.is_over(&hub, seconds(0)), Ok(false));
        assert_eq!(census.is_over(&hub, seconds(2)), Ok(true));
        assert!(
            census
                .actions_without_performer(&hub, seconds(2))
                .is_empty()
        );
    }

    #[test]
    fn a_missing_performer_is_named() {
        let mut census = PerformerDiscovery::new(vec!["move".into(), "pick".into()], seconds(3));
        let hub = hub_with("MOVE");
        assert_eq!(census.is_over(&hub, seconds(2)), Ok(false));
        let why = "no performer of pick was discovered within 3 s; discovered: robot1 (MOVE). Start it, or wait longer with --within";
        assert_eq!(census.is_over(&hub, seconds(3)), Err(why.into()));
        let mut census = PerformerDiscovery::new(vec!["move".into()], seconds(3));
        assert_eq!(census.is_over(&hub, seconds(0)), Ok(true));
    }
}
