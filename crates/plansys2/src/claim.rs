//! Claims of executors: the performers of a namespace serve one executor at a time.
//!
//! Messages of `actions_hub` do not name the executor that requests an action, so two executors
//! would take each other's performers, and count each other's results. Each executor of Elbowroom
//! therefore publishes its claim on a topic. A second one sees the claim of the first while it waits
//! for the performers, and refuses. No clocks are compared, because those of two machines differ.

use std::time::Duration;

/// Time after which a held claim is established. Until then, an executor may not have discovered
/// another one.
const PROBATION: Duration = Duration::from_secs(5);

/// States of a claim, in order of priority.
const STATES: [&str; 3] = ["waiting", "new", "established"];

/// State of a claim whose executor ends. Others ignore it.
const RELEASED: &str = "released";

/// Claim of this executor.
#[derive(Debug)]
pub struct Claim {
    id: String,
    name: String,
    held_since: Option<Duration>,
    is_released: bool,
}

impl Claim {
    /// Creates a claim that waits. `id` is unique among executors and has no spaces; `name`
    /// describes the executor to people.
    pub fn new(id: &str, name: &str) -> Self {
        Self {
            id: id.to_owned(),
            name: name.to_owned(),
            held_since: None,
            is_released: false,
        }
    }

    /// Holds the claim from now on, if it is not held already.
    pub fn hold(&mut self, now: Duration) {
        self.held_since.get_or_insert(now);
    }

    /// Gives up the claim, so that another executor can start at once.
    pub fn release(&mut self) {
        self.is_released = true;
    }

    /// Returns the text to publish whenever it has changed: state, identifier and name.
    pub fn text(&self, now: Duration) -> String {
        let state = if self.is_released {
            RELEASED
        } else {
            STATES[self.state(now)]
        };
        format!("{state} {} {}", self.id, self.name)
    }

    /// Takes the claim of an executor. Its own claim and texts of another form are ignored.
    ///
    /// # Errors
    /// The other executor has priority; the text says who it is and what to do. An established
    /// claim has priority over a new one, and a new one over one that waits. Otherwise the
    /// identifier decides, but an established claim never gives way.
    pub fn check(&self, text: &str, now: Duration) -> Result<(), String> {
        let mut words = text.splitn(3, ' ');
        let (Some(state), Some(id), Some(name)) = (words.next(), words.next(), words.next()) else {
            return Ok(());
        };
        let Some(other) = STATES.iter().position(|it| *it == state) else {
            return Ok(());
        };
        let own = self.state(now);
        let is_established = own + 1 == STATES.len();
        let has_priority = other > own || other == own && id < self.id.as_str();
        if id == self.id || is_established || !has_priority {
            return Ok(());
        }
        Err(format!(
            "another executor, {name}, uses these performers: stop it, choose another --namespace \
             or --domain-id, or allow both with --shared"
        ))
    }

    /// Returns the index in [`STATES`].
    fn state(&self, now: Duration) -> usize {
        match self.held_since {
            None => 0,
            Some(since) if now.saturating_sub(since) < PROBATION => 1,
            Some(_) => 2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    fn held(id: &str, since: u64) -> Claim {
        let mut claim = Claim::new(id, "an executor");
        claim.hold(seconds(since));
        claim
    }

    #[test]
    fn executor_that_waits_gives_way_to_a_holder() {
        let waiting = Claim::new("a", "process 8 on depot");
        for age in [0, 10] {
            let why = waiting.check(&held("b", 0).text(seconds(age)), seconds(1));
            let why = why.unwrap_err();
            assert!(why.contains("another executor, an executor,"), "{why}");
        }
    }

    /// Two executors that have the same state, at the same time.
    #[test]
    fn exactly_one_of_two_executors_gives_way() {
        let waiting = [Claim::new("a", "one"), Claim::new("b", "two")];
        let new = [held("a", 0), held("b", 1)];
        for [first, second] in [waiting, new] {
            let now = seconds(2);
            assert_eq!(first.check(&second.text(now), now), Ok(()));
            assert!(second.check(&first.text(now), now).is_err());
        }
    }

    #[test]
    fn new_holder_gives_way_to_an_established_one() {
        let (established, new) = (held("b", 0), held("a", 97));
        let now = seconds(100);
        assert!(new.check(&established.text(now), now).is_err());
        assert_eq!(established.check(&new.text(now), now), Ok(()));
        assert_eq!(established.check(&held("a", 0).text(now), now), Ok(()));
    }

    #[test]
    fn released_claims_have_no_priority() {
        let mut first = held("a", 0);
        first.release();
        let waiting = Claim::new("b", "two");
        assert_eq!(waiting.check(&first.text(seconds(9)), seconds(9)), Ok(()));
    }

    #[test]
    fn own_claims_and_other_texts_are_ignored() {
        let claim = Claim::new("b", "an executor");
        for text in ["", "new", "new a", "old a me", &claim.text(seconds(0))] {
            assert_eq!(claim.check(text, seconds(1)), Ok(()), "{text}");
        }
    }
}
