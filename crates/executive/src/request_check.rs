//! Checks of operators' requests against the problem of a run, before the run receives them.

use elbowroom::execute::{ill_typed_part, obstacle_to_deadline, read_goal};
use elbowroom::execution::{ActionHandle, GoalTerms, Request};
use elbowroom::model::Task;
use elbowroom::num::Rational;

use crate::error::Error;
use crate::interface::Status;
use crate::request_queue::{ExternalRequest, RequestQueue};

/// Limit on the name of a goal, in bytes.
const MAX_NAME_LENGTH: usize = 64;

/// Limit on the name of the client that gives a goal, in characters.
const LONGEST_AUTHOR: usize = 64;

/// Checks a request. Reading a goal or a fact can add facts to the table of `task`, so that it must not be the table
/// of the run.
///
/// # Errors
/// When a goal, its name or its value is invalid, or a fact or fluent is unknown.
pub(crate) fn check(request: &ExternalRequest, task: &Task) -> Result<(), Error> {
    match request {
        ExternalRequest::Request(Request::Pursue { name, goal, terms }) => {
            check_goal(goal, terms.deadline.is_some(), task)?;
            check_name(name)?;
            check_terms(terms)
        }
        ExternalRequest::TimedGoal {
            name,
            goal,
            terms,
            within,
            after,
        } => {
            check_goal(goal, terms.deadline.is_some() || within.is_some(), task)?;
            check_name(name)?;
            check_terms(terms)?;
            check_seconds(within.as_ref(), "within which the goal is to be achieved")?;
            check_seconds(after.as_ref(), "after which the goal is released")
        }
        ExternalRequest::Request(
            Request::Abandon { .. }
            | Request::CancelAction { .. }
            | Request::Pause
            | Request::Resume,
        )
        | ExternalRequest::Outcome { .. } => Ok(()),
        ExternalRequest::Fact { fact, .. } => check_fact(fact, task),
        ExternalRequest::Number { fluent, .. } => check_fluent(fluent, task),
    }
}

/// Checks that the open goal or the running action of a request is known to the run. While requests are pending, and
/// while a journal is replayed, they may come yet.
///
/// # Errors
/// When it is unknown.
pub(crate) fn check_target(
    request: &ExternalRequest,
    status: &Status,
    queue: &RequestQueue,
) -> Result<(), Error> {
    if !queue.is_idle() || status.is_replayed() {
        return Ok(());
    }
    match request {
        ExternalRequest::Request(Request::Abandon { name }) => check_open_goal(name, status),
        ExternalRequest::Request(Request::CancelAction { ticket })
        | ExternalRequest::Outcome { ticket, .. } => check_ticket(*ticket, status),
        _ => Ok(()),
    }
}

fn check_open_goal(name: &str, status: &Status) -> Result<(), Error> {
    let open = status.goals();
    if open.iter().any(|known| known == name) {
        return Ok(());
    }
    let help = match open.as_slice() {
        [] => "no goals are open".to_owned(),
        open => format!("open goals: {}", open.join(", ")),
    };
    Err(Error::new("there is no open goal with this name", help))
}

fn check_ticket(ticket: ActionHandle, status: &Status) -> Result<(), Error> {
    let running = status.state().running;
    if running.iter().any(|it| it.ticket == ticket.0) {
        return Ok(());
    }
    let help = match running.as_slice() {
        [] => "no action is running".to_owned(),
        running => {
            let running = running
                .iter()
                .map(|it| format!("{} {}", it.ticket, it.action));
            format!(
                "running actions: {}",
                running.collect::<Vec<_>>().join(", ")
            )
        }
    };
    let error = format!("no running action has the ticket {}", ticket.0);
    Err(Error::new(error, help))
}

fn check_goal(goal: &str, has_deadline: bool, task: &Task) -> Result<(), Error> {
    let help = "write a condition as after `:goal`, such as (at rover base)";
    let read = read_goal(task, goal).map_err(|why| Error::new(why, help))?;
    if read.is_trivial() {
        return Err(Error::new("the goal is empty", help));
    }
    if let Some(why) = ill_typed_part(task.problem(), &read) {
        return Err(Error::new(why, help));
    }
    let obstacle = has_deadline.then(|| obstacle_to_deadline(task, &read));
    match obstacle.flatten() {
        Some(why) => Err(Error::new(why, "give the goal without a deadline")),
        None => Ok(()),
    }
}

/// Checks that a name can be part of a path.
fn check_name(name: &str) -> Result<(), Error> {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    let is_path = [".", ".."].contains(&name);
    if name.is_empty() || is_path || name.len() > MAX_NAME_LENGTH || !name.bytes().all(is_plain) {
        return Err(Error::new(
            "invalid name of a goal",
            "use up to 64 letters, digits, `-`, `_` and `.`, and not only dots",
        ));
    }
    Ok(())
}

fn check_terms(terms: &GoalTerms) -> Result<(), Error> {
    if !terms.value.is_positive() {
        return Err(Error::new(
            "the value of a goal must be positive",
            "give a positive number, such as 2.5",
        ));
    }
    let is_author = |by: &String| {
        let count = by.chars().count();
        (1..=LONGEST_AUTHOR).contains(&count) && !by.contains(char::is_control)
    };
    if terms.by.as_ref().is_none_or(is_author) {
        return Ok(());
    }
    Err(Error::new(
        "invalid name of a client",
        "use 1 to 64 characters on one line",
    ))
}

/// Checks a time from now; `role` describes it.
fn check_seconds(seconds: Option<&Rational>, role: &str) -> Result<(), Error> {
    if seconds.is_none_or(Rational::is_positive) {
        return Ok(());
    }
    Err(Error::new(
        format!("the time {role} must be positive"),
        "give the seconds from now, such as 60",
    ))
}

fn check_fact(text: &str, task: &Task) -> Result<(), Error> {
    let Some(fact) = task.fact_named(text) else {
        return Err(Error::new(
            format!("the problem has no fact `{}`", text.escape_debug()),
            "write it as the problem does, such as (at rover base)",
        ));
    };
    if task.is_derived(fact) {
        return Err(Error::new(
            format!("`{}` is derived from other facts", task.fact_name(fact)),
            "report those instead",
        ));
    }
    Ok(())
}

fn check_fluent(text: &str, task: &Task) -> Result<(), Error> {
    let unknown = || {
        Error::new(
            format!("the problem has no fluent `{}`", text.escape_debug()),
            "write it as the problem does, such as (charge rover)",
        )
    };
    task.fluent_named(text).map(drop).ok_or_else(unknown)
}

#[cfg(test)]
mod tests {
    use elbowroom::execution::{GoalTerms, Request};
    use elbowroom::model::Task;
    use elbowroom::num::Rational;
    use elbowroom::pddl::{Source, read_problem};

    use super::check;
    use crate::request_queue::ExternalRequest;

    const DOMAIN: &str = "(define (domain d) (:requirements :typing :fluents :derived-predicates)
        (:types robot place)
        (:predicates (at ?r - robot ?p - place) (away ?r - robot))
        (:functions (charge ?r - robot))
        (:derived (away ?r - robot) (at ?r home))
        (:constants home - place)
        (:action go :parameters (?r - robot) :effect (at ?r home)))";
    const PROBLEM: &str = "(define (problem p) (:domain d) (:objects r - robot)
        (:init (= (charge r) 1)) (:goal (at r home)))";

    fn task() -> Task {
        let read = read_problem(&Source::new("d", DOMAIN), &Source::new("p", PROBLEM));
        Task::new(read.expect("a correct problem").0)
    }

    fn pursue(name: &str, goal: &str, value: i64) -> ExternalRequest {
        ExternalRequest::Request(Request::Pursue {
            name: name.to_owned(),
            goal: goal.to_owned(),
            terms: GoalTerms {
                value: Rational::from(value),
                ..GoalTerms::default()
            },
        })
    }

    fn by_deadline(goal: &str) -> ExternalRequest {
        ExternalRequest::Request(Request::Pursue {
            name: "x".to_owned(),
            goal: goal.to_owned(),
            terms: GoalTerms {
                deadline: Some(Rational::from(100)),
                ..GoalTerms::default()
            },
        })
    }

    fn fact(fact: &str) -> ExternalRequest {
        let (fact, becomes) = (fact.to_owned(), true);
        ExternalRequest::Fact { fact, becomes }
    }

    fn number(fluent: &str) -> ExternalRequest {
        let (fluent, value) = (fluent.to_owned(), Rational::ONE);
        ExternalRequest::Number { fluent, value }
    }

    #[test]
    fn valid_requests_pass() {
        let task = task();
        for request in [
            pursue("goal-1", "(at r home)", 1),
            pursue("a.b_c", "(away r)", 2),
            by_deadline("(at r home)"),
            ExternalRequest::Request(Request::Pause),
            fact("(at r home)"),
            number("(charge r)"),
        ] {
            assert_eq!(check(&request, &task), Ok(()), "{request:?}");
        }
    }

    #[test]
    fn invalid_requests_are_rejected_with_reason() {
        let task = task();
        let long = "x".repeat(65);
        for (request, words) in [
            (pursue("x", "(at r nowhere)", 1), "nowhere"),
            (pursue("x", "(at home r)", 1), "home"),
            (pursue("x", "(at r home)", 0), "must be positive"),
            (pursue("x", "(at r home)", -1), "must be positive"),
            (pursue("", "(at r home)", 1), "invalid name"),
            (pursue("a/b", "(at r home)", 1), "invalid name"),
            (pursue("..", "(at r home)", 1), "invalid name"),
            (pursue("x", "(and)", 1), "empty"),
            (by_deadline("(away r)"), "is derived from other facts"),
            (by_deadline("(>= (charge r) 1)"), "about numbers"),
            (pursue(&long, "(at r home)", 1), "invalid name"),
            (fact("(at r nowhere)"), "no fact"),
            (fact("(away r)"), "is derived from other facts"),
            (number("(charge home)"), "no fluent"),
        ] {
            let error = check(&request, &task).expect_err(words);
            assert!(error.message().contains(words), "{error}");
            assert!(!error.advice().is_empty(), "{error}");
        }
    }
}
