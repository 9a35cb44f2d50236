//! That a problem has no plan: facts with the times before which they cannot be true.
//!
//! The certificate ([`NoPlan`]) is an inductive invariant of the delete relaxation (as in Eriksson,
//! Röger & Helmert, "Unsolvability certificates for classical planning", ICAPS 2017), here with times. It
//! lists facts, each with a time before which it is
//! not true in any course of events; what it does not list is never true. The checker
//! ([`verify_no_plan`]) confirms that
//!
//! - what is true at time 0, and what timed initials make true, is listed, and no later than that;
//! - each instance of an action brings about only what is listed, and none of it too early, if its
//!   conditions are true no earlier than listed;
//! - the goal needs something that is not listed, or that timed initials take away for good.
//!
//! So the first fact that breaks the list in a course of events would have to be brought about by
//! something of which none of this is so. The start of an action is only held to what it reads when it
//! starts, and to what nobody but timed initials makes true: its later conditions may come true by others
//! that start at the same time. Its end is held to all.
//!
//! Where that is not enough, a certificate has pairs that are never true together ([`pairs`]) or a closed
//! set of states ([`closed`]) beside the list, which then only says which instances of actions count.
//!
//! Instances are found by trying objects for parameters one after the other; there is no search for a
//! list, nor any for plans. Whoever makes a certificate can use the same [`Instances`].

mod beginning;
pub mod closed;
mod instances;
mod lasting;
mod moments;
pub mod pairs;
mod processes;
mod relevance;
mod valueless;

use std::collections::BTreeMap;

use elbowroom_model::problem::{ObjectId, PredicateId};
use elbowroom_model::{Situation, Task, ground};
use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use crate::Exact;
pub use closed::{Closed, ClosedState};
pub use instances::{Breach, Instances};
use moments::{HeldTo, Moments};
use pairs::Structure;

/// A predicate and its objects.
pub type Fact = (PredicateId, Vec<ObjectId>);

/// Facts, each with a time before which it is not true. What is not listed is never true.
pub type Reached = BTreeMap<Fact, Rational>;

/// The certificate that a problem has no plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoPlan {
    /// What it proves, in words.
    pub proves: String,
    /// The files that the problem was read from, as they were named: domain and problem.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<String>,
    /// The least separation ε of interfering happenings that the proof uses. Only bounds on pairs need it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epsilon: Option<Exact>,
    /// The facts that can become true, by time. Facts that only timed initials change are not among
    /// them: the problem says when these hold.
    pub reached: Vec<Group>,
    /// What is not true together before some time, if that is needed: see [`pairs`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub apart: Vec<Apart>,
    /// States into one of which whatever happens leads, if that is needed: see [`closed`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closed: Option<Closed>,
}

/// Pairs that are not true together before some time. Each names literals, `(at rover depot)` or
/// `(not (at rover depot))`, and actions: `doing (drive rover depot)` says that it is under way,
/// `begun (drive rover depot)` that one is that was so at the beginning, and `ended …` that it no longer is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Apart {
    /// The time; never, if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<Exact>,
    /// Two that have not become true together before.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub together: Vec<[String; 2]>,
    /// An action that has not started before, if the other has been true since its start.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub started: Vec<[String; 2]>,
    /// An action, and what has not become true before while it was under way.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub meanwhile: Vec<[String; 2]>,
}

/// Facts that are not true before some time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// The time.
    pub from: Exact,
    /// The facts, as PDDL writes them.
    pub facts: Vec<String>,
}

/// What every certificate of this kind proves.
pub const PROVES: &str = "no plan exists: even if nothing that has become true were ever lost, the \
                          goal would not be reached";

/// What a certificate with [`NoPlan::apart`] proves.
pub const PROVES_APART: &str = "no plan exists: what the goal needs is never true together";

/// What a certificate with [`NoPlan::closed`] proves.
pub const PROVES_CLOSED: &str = "no plan exists: whatever happens leads into one of the listed states, and the \
                                 goal holds in none";

/// The most instances of actions and tried objects that are looked at.
pub const MOST_STEPS: u64 = 20_000_000;

/// Why a certificate does not prove that there is no plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoPlanFlaw {
    /// It says something else than it proves.
    #[error("`proves` is not what the certificate proves")]
    Claim,
    /// The problem has something that the checker does not know.
    #[error("the checker does not know {0}")]
    Unknown(&'static str),
    /// The problem has no such fact.
    #[error("the problem has no fact `{0}`")]
    NoSuchFact(String),
    /// A fact is listed twice.
    #[error("`{0}` is listed twice")]
    Twice(String),
    /// A fact can become true that is not listed, or is listed for later.
    #[error("`{fact}` can be true at {time}, by {by}; the certificate says {said}")]
    Breach {
        /// The fact.
        fact: String,
        /// How early.
        time: String,
        /// What brings it about.
        by: String,
        /// What is listed.
        said: String,
    },
    /// Two things can be true together though the certificate says that they are not.
    #[error("{pair} can be so earlier than the certificate says, by {by}")]
    Together {
        /// What is true together.
        pair: String,
        /// What brings it about.
        by: String,
    },
    /// Something leads out of the states.
    #[error("something that can happen in {0} leads to a state that is not listed")]
    Leads(String),
    /// The objects cannot change places.
    #[error("`{0}` and `{1}` are not alike")]
    NotAlike(String, String),
    /// The goal is not out of reach.
    #[error("according to the listed facts, the goal could be reached")]
    GoalInReach,
    /// There are too many instances of actions.
    #[error("the problem has too many instances of actions to be checked")]
    TooMany,
}

/// Why an answer has nothing to be checked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoPlanAnswerError {
    /// It is no answer of `elbowroom plan`.
    #[error("this is no answer of `elbowroom plan --json`: {0}")]
    Unreadable(#[from] serde_json::Error),
    /// It does not say that there is no plan.
    #[error("the answer does not say that no plan exists")]
    NotDenied,
    /// It has no certificate.
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

/// The certificate of an answer of `elbowroom plan --json`.
///
/// # Errors
/// When it has none.
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
            let why = "it does not say why".to_owned();
            Err(NoPlanAnswerError::Uncertified(why))
        }
        _ => Err(NoPlanAnswerError::NotDenied),
    }
}

/// Checks that the certificate proves that the task has no plan.
///
/// # Errors
/// The first thing that is not so.
pub fn verify_no_plan(task: &Task, certificate: &NoPlan) -> Result<(), NoPlanFlaw> {
    verify_no_plan_from(task, &Situation::initial(task), certificate)
}

/// Checks that the certificate proves that no plan goes on from the situation.
///
/// # Errors
/// The first thing that is not so.
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
    let claims = structure.read(&certificate.apart)?;
    if let Some((pair, by)) = structure.first_broken(&claims) {
        return Err(NoPlanFlaw::Together {
            pair: structure.in_words(pair),
            by: by.map_or_else(|| "the beginning".to_owned(), |by| structure.happening(by)),
        });
    }
    if structure.is_goal_excluded(&claims) {
        Ok(())
    } else {
        Err(NoPlanFlaw::GoalInReach)
    }
}

/// Returns a time before which the condition holds in no course of events from the situation, by the certificate's list
/// of facts; `None` if it never holds. The goal of the task and the certificate's other parts do not count.
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
    let moments = instances.moments(&reached);
    Ok(moments.next(condition, &situation.time, HeldTo::All))
}

/// Checks that the certificate's list of facts is an invariant. Returns it with the instances that it allows.
fn verified_list(
    task: &Task,
    situation: &Situation,
    certificate: &NoPlan,
) -> Result<(Instances, Reached), NoPlanFlaw> {
    let mut instances = Instances::from(task, situation)?;
    let reached = listed(task, certificate)?;
    instances.extend(&reached, MOST_STEPS)?;
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

/// How a certificate proves that there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// By the delete relaxation.
    Reached,
    /// By pairs.
    Apart,
    /// By a closed set of states.
    Closed,
}

impl Kind {
    /// What certificates of this kind prove, in words.
    pub fn proves(self) -> &'static str {
        match self {
            Self::Reached => PROVES,
            Self::Apart => PROVES_APART,
            Self::Closed => PROVES_CLOSED,
        }
    }
}

impl NoPlan {
    /// How it proves that there is no plan.
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

/// The certificate of a list of facts; whether it proves anything is another question.
pub fn no_plan_certificate(task: &Task, reached: &Reached) -> NoPlan {
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

/// The facts that the certificate lists.
fn listed(task: &Task, certificate: &NoPlan) -> Result<Reached, NoPlanFlaw> {
    let mut reached = Reached::new();
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

/// The fact of that name: `(name arg …)`, or `(= (name arg …) value)` of an object function.
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
