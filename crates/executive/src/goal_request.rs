//! Requests that add a goal: names, times and values of [`NewGoal`].

use std::sync::atomic::{AtomicU64, Ordering};

use elbowroom::execution::{GoalTerms, Request};
use elbowroom::num::Rational;

use crate::error::Error;
use crate::interface::Status;
use crate::interface::documents::NewGoal;
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
        // Larger numbers were not generated here.
        let last = numbers.filter(|it| u32::try_from(*it).is_ok()).max();
        Self(AtomicU64::new(last.unwrap_or_default()))
    }

    /// Returns a name that no known goal has.
    fn new_name(&self, is_known: impl Fn(&str) -> bool) -> String {
        loop {
            let number = self.0.fetch_add(1, Ordering::SeqCst) + 1;
            let name = format!("{PREFIX}{number}");
            if !is_known(&name) {
                return name;
            }
        }
    }

    /// Returns the name of a goal, and the request that adds it to a run with this status.
    ///
    /// # Errors
    /// When the goal has two deadlines or two release times, or a deadline that has passed or is not later than its
    /// release time.
    pub(crate) fn request(
        &self,
        given: NewGoal,
        status: &Status,
    ) -> Result<(String, ExternalRequest), Error> {
        check_times(&given, &status.state().now.0)?;
        let name = given.name;
        let name = name.unwrap_or_else(|| self.new_name(|name| status.goal(name).is_some()));
        let goal = given.goal.trim().to_owned();
        let terms = GoalTerms {
            value: given.value.map_or(Rational::ONE, |value| value.0),
            deadline: given.deadline.map(|it| it.0),
            release: given.release.map(|it| it.0),
            keep: given.keep,
            by: given.by,
        };
        let (within, after) = (given.within.map(|it| it.0), given.after.map(|it| it.0));
        let pursued = name.clone();
        let request = if within.is_none() && after.is_none() {
            ExternalRequest::Request(Request::Pursue {
                name: pursued,
                goal,
                terms,
            })
        } else {
            ExternalRequest::TimedGoal {
                name: pursued,
                goal,
                terms,
                within,
                after,
            }
        };
        Ok((name, request))
    }
}

/// Checks the times of a goal that is given at `now`.
fn check_times(given: &NewGoal, now: &Rational) -> Result<(), Error> {
    if given.keep && (given.deadline.is_some() || given.within.is_some()) {
        return Err(Error::new(
            "a goal to keep cannot have a deadline",
            "leave out the deadline, or achieve the goal once",
        ));
    }
    let error = match (&given.deadline, &given.within, &given.release, &given.after) {
        (Some(_), Some(_), ..) => "the goal has both `deadline` and `within`",
        (.., Some(_), Some(_)) => "the goal has both `release` and `after`",
        (Some(_), _, _, Some(_)) | (_, Some(_), Some(_), _) => {
            let error = "of the deadline and the release time, only one is relative to now";
            return Err(Error::new(
                error,
                "give both on the world's clock, or both relative to now",
            ));
        }
        (Some(deadline), ..) if deadline.0 <= *now => {
            let late = (now - &deadline.0).to_decimal(3);
            return Err(Error::new(
                format!(
                    "the deadline has passed: the time is {}, {late} s later",
                    now.to_decimal(3)
                ),
                "give a later time, or the seconds from now (`within`)",
            ));
        }
        (Some(deadline), _, Some(release), _) | (_, Some(deadline), _, Some(release))
            if deadline.0 <= release.0 =>
        {
            let error = "the deadline is not later than the release time";
            return Err(Error::new(
                error,
                "give a later deadline, or an earlier release time",
            ));
        }
        _ => return Ok(()),
    };
    Err(Error::new(error, "leave out one of them"))
}

#[cfg(test)]
mod tests {
    use super::GoalNames;

    #[test]
    fn names_differ_from_known_goals_and_earlier_names() {
        let earlier = [
            "goal-3",
            "home",
            "goal-",
            "goal-18446744073709551615",
            "goal-1",
        ];
        let names = GoalNames::after(earlier.into_iter());
        let is_known = |name: &str| name == "goal-5";
        assert_eq!(names.new_name(is_known), "goal-4");
        assert_eq!(names.new_name(is_known), "goal-6");
    }
}
