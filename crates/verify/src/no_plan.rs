//! Check that a problem has no plan, by facts with lower bounds on the times at which they are
//! true.
//!
//! The certificate ([`NoPlan`]) is an inductive invariant of the delete relaxation (as in Eriksson,
//! Röger & Helmert, "Unsolvability certificates for classical planning", ICAPS 2017), here with
//! times. It lists facts, each with a time before which it is not true in any execution. Facts that
//! are not listed are never true. The checker ([`verify_no_plan`]) confirms three properties:
//!
//! - Facts that are true at time 0, or that timed initials make true, are listed, with a time that
//!   is not later.
//! - If the conditions of an action instance are true no earlier than listed, all facts that the
//!   instance adds are listed, with times that are not later.
//! - The goal needs a fact that is not listed, or that timed initials delete permanently.
//!
//! So no execution contains a first fact that violates the list. The check of an action's start
//! considers only conditions that the action reads at its start, and facts that only timed initials
//! make true: other actions that start at the same time may establish the later conditions. The
//! check of its end considers all conditions.
//!
//! Where the list is not sufficient, the certificate also has pairs that are never true together
//! ([`pairs`]) or a closed set of states ([`closed`]). The list then only determines the instances
//! of actions to consider.
//!
//! Instances are found by trying objects for the parameters one after the other. The checker
//! searches neither for a list nor for plans. Programs that generate certificates can use the same
//! [`Instances`].

pub mod closed;
mod earliest_times;
mod initial_state;
mod instances;
pub mod pairs;
mod processes;
mod relevance;
mod static_facts;
mod timed_numbers;
mod valueless;

use std::collections::BTreeMap;

use elbowroom_model::problem::{ObjectId, PredicateId};
use elbowroom_model::{Situation, Task, ground};
use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use crate::Exact;
pub use closed::{ClosedSet, ClosedState};
use earliest_times::{ConditionContext, EarliestTimes};
pub use instances::{Breach, Instances};
use pairs::Structure;

/// A predicate and its objects.
pub type Fact = (PredicateId, Vec<ObjectId>);

/// Facts, each with a time before which it is not true. A fact that is not listed is never true.
pub type ReachedFacts = BTreeMap<Fact, Rational>;

/// Certificate that a problem has no plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoPlan {
    /// Claim, in words.
    pub proves: String,
    /// The files that the problem was read from, as they were named: domain and problem.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<String>,
    /// The least separation ε of interfering happenings that the proof uses. Only bounds on pairs need it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epsilon: Option<Exact>,
    /// Facts that can become true, by time. Facts that only timed initials change are not listed,
    /// because the problem determines their intervals.
    pub reached: Vec<Group>,
    /// Pairs that are not true together before some time; see [`pairs`]. Empty if they are not
    /// needed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub apart: Vec<MutexPair>,
    /// Closed set of states; see [`closed`]. `None` if it is not needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closed: Option<ClosedSet>,
}

/// Pairs that are not true together before some time. The elements are literals, `(at rover depot)`
/// or `(not (at rover depot))`, and states of actions: `doing (drive rover depot)` for a running
/// action, `begun (drive rover depot)` for one that was running initially and still is, and `ended
/// …` for one that was running initially and has ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MutexPair {
    /// The time; `None`: the pairs are never true together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<Exact>,
    /// Two elements that have not become true together before.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub together: Vec<[String; 2]>,
    /// An action that has not started before, if the second element has been true since its start.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub started: Vec<[String; 2]>,
    /// A running action, and an element that has not become true before while the action was
    /// running.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub meanwhile: Vec<[String; 2]>,
}

/// Facts that are not true before some time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// The time.
    pub from: Exact,
    /// Facts in PDDL notation.
    pub facts: Vec<String>,
}

/// Claim of every certificate without pairs or states.
pub const PROVES: &str = "no plan exists: even if nothing that has become true were ever lost, the \
                          goal would not be reached";

/// Claim of a certificate with [`NoPlan::apart`].
pub const PROVES_APART: &str = "no plan exists: what the goal needs is never true together";

/// Claim of a certificate with [`NoPlan::closed`].
pub const PROVES_CLOSED: &str = "no plan exists: whatever happens leads into one of the listed states, and the \
                                 goal holds in none";

/// Largest number of action instances and tried objects.
pub const MAX_STEPS: u64 = 20_000_000;

/// Reason why a certificate does not prove that there is no plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoPlanFlaw {
    /// The claim does not match the certificate.
    #[error("`proves` differs from the statement that the certificate proves")]
    Claim,
    /// The problem has a feature that the checker does not support.
    #[error("the checker does not support {0}")]
    Unknown(&'static str),
    /// The problem has no such fact.
    #[error("the problem has no fact `{0}`")]
    NoSuchFact(String),
    /// A fact is listed twice.
    #[error("`{0}` is listed twice")]
    Twice(String),
    /// A fact that is not listed, or is listed for later, can become true.
    #[error("`{fact}` can be true at {time}, by {by}; the certificate states {said}")]
    Breach {
        /// The fact.
        fact: String,
        /// Earliest time.
        time: String,
        /// Happening that makes it true.
        by: String,
        /// Entry of the list.
        said: String,
    },
    /// Two elements can be true together earlier than the certificate claims.
    #[error("{pair} can be true together earlier than the certificate states, by {by}")]
    Together {
        /// The elements.
        pair: String,
        /// Happening that makes them true.
        by: String,
    },
    /// A happening leads to a state that is not listed.
    #[error("a happening that is possible in {0} leads to a state that is not listed")]
    Leads(String),
    /// Two objects are not interchangeable.
    #[error("`{0}` and `{1}` are not interchangeable")]
    NotInterchangeable(String, String),
    /// The list does not exclude the goal.
    #[error("according to the listed facts, the goal could be reached")]
    GoalInReach,
    /// There are too many instances of actions.
    #[error("the problem has too many instances of actions to be checked")]
    TooMany,
}

/// Reason why an answer has no certificate to check.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoPlanAnswerError {
    /// The text is not an answer of `elbowroom plan`.
    #[error("this is not an answer of `elbowroom plan --json`: {0}")]
    Unreadable(#[from] serde_json::Error),
    /// The answer does not claim that there is no plan.
    #[error("the answer does not state that no plan exists")]
    NotDenied,
    /// The answer has no certificate.
    #[error("the answer has no certificate: {0}")]
    Uncertified(String),
}

/// The part of an answer of `elbowroom plan` that is read.
#[derive(Deserialize)]
struct Answer {
    #[allow(dead_code, reason = "read so that nothing else is taken for an answer")]
    format: Format,
    #[serde(rename = "answer")]
    finding: String,
    certificate: Option<NoPlan>,
    uncertified: Option<String>,
}

#[derive(Deserialize)]
enum Format {
    #[serde(rename = "elbowroom-plan")]
    Plan,
}

/// Returns the certificate of an answer of `elbowroom plan --json`.
///
/// # Errors
/// When the answer has none.
pub fn certificate_of(answer: &str) -> Result<NoPlan, NoPlanAnswerError> {
    let answer: Answer = serde_json::from_str(answer)?;
    match (
        answer.finding.as_str(),
        answer.certificate,
        answer.uncertified,
    ) {
        ("no plan", Some(certificate), _) => Ok(certificate),
        (_, _, Some(why)) => Err(NoPlanAnswerError::Uncertified(why)),
        ("no plan", None, None) => {
            let why = "it gives no reason".to_owned();
            Err(NoPlanAnswerError::Uncertified(why))
        }
        _ => Err(NoPlanAnswerError::NotDenied),
    }
}

/// Checks that the certificate proves that the task has no plan.
///
/// # Errors
/// The first flaw.
pub fn verify_no_plan(task: &Task, certificate: &NoPlan) -> Result<(), NoPlanFlaw> {
    verify_no_plan_from(task, &Situation::initial(task), certificate)
}

/// Checks that the certificate proves that no plan exists from the situation.
///
/// # Errors
/// The first flaw.
pub fn verify_no_plan_from(
    task: &Task,
    situation: &Situation,
    certificate: &NoPlan,
) -> Result<(), NoPlanFlaw> {
    if certificate.proves != certificate.kind().proves() {
        return Err(NoPlanFlaw::Claim);
    }
    let (instances, reached) = verified_list(task, situation, certificate)?;
    if !instances.is_goal_in_reach(&reached) {
        return Ok(());
    }
    if let Some(closed) = &certificate.closed {
        return closed.verify(&instances, &reached);
    }
    let structure = Structure::of(&instances, &reached);
    let claims = structure.parse_groups(&certificate.apart)?;
    if let Some((pair, by)) = structure.first_violation(&claims) {
        return Err(NoPlanFlaw::Together {
            pair: structure.describe_claim(pair),
            by: by.map_or_else(
                || "the beginning".to_owned(),
                |by| structure.describe_happening(by),
            ),
        });
    }
    if structure.is_goal_excluded(&claims) {
        Ok(())
    } else {
        Err(NoPlanFlaw::GoalInReach)
    }
}

/// Returns a time before which the condition holds in no execution from the situation, by the
/// certificate's list of facts; `None` if it never holds. The goal of the task and the
/// certificate's other parts are ignored.
///
/// # Errors
/// The first fact that can become true and is not listed, or is listed for later.
pub fn verify_earliest(
    task: &Task,
    situation: &Situation,
    certificate: &NoPlan,
    condition: &ground::Condition,
) -> Result<Option<Rational>, NoPlanFlaw> {
    let (instances, reached) = verified_list(task, situation, certificate)?;
    let moments = instances.earliest_times(&reached);
    Ok(moments.next(condition, &situation.time, ConditionContext::All))
}

/// Checks that the certificate's list of facts is an invariant. Returns it with the instances that it allows.
fn verified_list(
    task: &Task,
    situation: &Situation,
    certificate: &NoPlan,
) -> Result<(Instances, ReachedFacts), NoPlanFlaw> {
    let mut instances = Instances::from(task, situation)?;
    let reached = listed(task, certificate)?;
    instances.extend(&reached, MAX_STEPS)?;
    if let Some(breach) = instances.breaches(&reached).into_iter().next() {
        let said = reached.get(&breach.fact);
        return Err(NoPlanFlaw::Breach {
            fact: task
                .problem()
                .apply_predicate(breach.fact.0, &breach.fact.1),
            time: breach.time.to_string(),
            by: breach.by,
            said: said.map_or_else(|| "never".to_owned(), |from| format!("not before {from}")),
        });
    }
    Ok((instances, reached))
}

/// Method of a proof that there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Delete relaxation.
    Reached,
    /// Pairs that are never true together.
    Apart,
    /// Closed set of states.
    Closed,
}

impl Kind {
    /// Returns the claim of certificates of this kind, in words.
    pub fn proves(self) -> &'static str {
        match self {
            Self::Reached => PROVES,
            Self::Apart => PROVES_APART,
            Self::Closed => PROVES_CLOSED,
        }
    }
}

impl NoPlan {
    /// Returns the method of the proof.
    pub fn kind(&self) -> Kind {
        if self.closed.is_some() {
            Kind::Closed
        } else if self.apart.is_empty() {
            Kind::Reached
        } else {
            Kind::Apart
        }
    }
}

/// Returns the certificate for a list of facts, without checking that it proves anything.
pub fn no_plan_certificate(task: &Task, reached: &ReachedFacts) -> NoPlan {
    let mut by_time: BTreeMap<&Rational, Vec<String>> = BTreeMap::new();
    for ((predicate, objects), from) in reached {
        let name = task.problem().apply_predicate(*predicate, objects);
        by_time.entry(from).or_default().push(name);
    }
    let reached = by_time.into_iter().map(|(from, facts)| Group {
        from: Exact(from.clone()),
        facts,
    });
    NoPlan {
        proves: PROVES.to_owned(),
        files: Vec::new(),
        epsilon: None,
        reached: reached.collect(),
        apart: Vec::new(),
        closed: None,
    }
}

/// Returns the facts that the certificate lists.
fn listed(task: &Task, certificate: &NoPlan) -> Result<ReachedFacts, NoPlanFlaw> {
    let mut reached = ReachedFacts::new();
    for group in &certificate.reached {
        for name in &group.facts {
            let fact = fact(task, name).ok_or_else(|| NoPlanFlaw::NoSuchFact(name.clone()))?;
            if reached.insert(fact, group.from.0.clone()).is_some() {
                return Err(NoPlanFlaw::Twice(name.clone()));
            }
        }
    }
    Ok(reached)
}

/// Returns the fact of that name: `(name arg …)`, or `(= (name arg …) value)` for an object
/// function.
fn fact(task: &Task, name: &str) -> Option<Fact> {
    let problem = task.problem();
    let is_bracket = |c: char| c == '(' || c == ')' || c.is_whitespace();
    let mut words = name.split(is_bracket).filter(|word| !word.is_empty());
    let mut first = words.next()?;
    if first == "=" {
        first = words.next()?;
    }
    let predicate = problem.predicate(first)?;
    let objects: Option<Vec<ObjectId>> = words.map(|word| problem.object(word)).collect();
    let objects = objects?;
    (objects.len() == problem.predicates[predicate.index()].parameters.len())
        .then_some((predicate, objects))
}
