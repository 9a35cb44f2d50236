//! Requests that add a goal: names, deadlines and values of [`NewGoal`].

use std::sync::atomic::{AtomicU64, Ordering};

use elbowroom::execution::{GoalTerms, Request};
use elbowroom::executive::Status;
use elbowroom::executive::documents::NewGoal;
use elbowroom::num::Rational;

use crate::error::Error;
use crate::request_queue::ExternalRequest;

/// Prefix of the names of goals that are given without a name.
const PREFIX: &str = "goal-";

/// Source of names for goals that are given without a name.
#[derive(Debug, Default)]
pub(crate) struct GoalNames(AtomicU64);

impl GoalNames {
    /// Returns names that differ from these.
    pub(crate) fn after<'a>(names: impl Iterator<Item = &'a str>) -> Self {
        let numbers = names.filter_map(|name| name.strip_prefix(PREFIX)?.parse::<u64>().ok());
        // Larger numbers are not from here.
        let last = numbers.filter(|it| u32::try_from(*it).is_ok()).max();
        Self(AtomicU64::new(last.unwrap_or_default()))
    }

    /// Returns a name that no open goal has.
    fn new_name(&self, open: &[String]) -> String {
        loop {
            let number = self.0.fetch_add(1, Ordering::SeqCst) + 1;
            let name = format!("{PREFIX}{number}");
            if !open.contains(&name) {
                return name;
            }
        }
    }

    /// Returns the name of a goal, and the request that adds it to a run with this status.
    ///
    /// # Errors
    /// When the goal has two deadlines, or one that has passed.
    pub(crate) fn request(
        &self,
        given: NewGoal,
        status: &Status,
    ) -> Result<(String, ExternalRequest), Error> {
        let name = given.name;
        let name = name.unwrap_or_else(|| self.new_name(&status.goals()));
        let goal = given.goal.trim().to_owned();
        let value = given.value.map_or(Rational::ONE, |value| value.0);
        let request = match (given.deadline, given.within) {
            (Some(_), Some(_)) => {
                let error = "the goal has a deadline and a time within which it is to be achieved";
                return Err(Error::new(error, "leave out one of them"));
            }
            (Some(deadline), None) if deadline.0 <= status.state().now.0 => {
                let now = status.state().now.0;
                let late = (&now - &deadline.0).to_decimal(3);
                let now = now.to_decimal(3);
                return Err(Error::new(
                    format!("the deadline has passed: it is {now}, {late} s later"),
                    "give a later time, or the seconds from now (`within`)",
                ));
            }
            (None, Some(within)) => ExternalRequest::GoalWithin {
                name: name.clone(),
                goal,
                value,
                within: within.0,
            },
            (deadline, None) => ExternalRequest::Request(Request::Pursue {
                name: name.clone(),
                goal,
                terms: GoalTerms {
                    value,
                    deadline: deadline.map(|it| it.0),
                },
            }),
        };
        Ok((name, request))
    }
}

#[cfg(test)]
mod tests {
    use super::GoalNames;

    #[test]
    fn names_differ_from_open_goals_and_earlier_names() {
        let earlier = [
            "goal-3",
            "home",
            "goal-",
            "goal-18446744073709551615",
            "goal-1",
        ];
        let names = GoalNames::after(earlier.into_iter());
        let open = ["goal-5".to_owned()];
        assert_eq!(names.new_name(&open), "goal-4");
        assert_eq!(names.new_name(&open), "goal-6");
    }
}
