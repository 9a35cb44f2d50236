//! Certified claims that no plan exists.
//!
//! A planner whose search ends without a plan only claims that there is none. The library reports the claim
//! as a fact only if [`no_plan_certificate_from`] returns a certificate, which [`verify_no_plan_from`] has
//! accepted. This module is the only source of the answer that no plan exists.

mod closed_set;
mod conflict;
mod pairs;
mod without_value;

use std::sync::Arc;

use elbowroom_model::ground::{Body, Condition};
use elbowroom_model::{RunningAction, Situation, Task};
use elbowroom_num::{Interval, Rational};
use elbowroom_verify::Exact;
use elbowroom_verify::no_plan::pairs::Structure;
use elbowroom_verify::no_plan::{
    Instances, NoPlan, ReachedFacts, no_plan_certificate, verify_earliest, verify_no_plan_from,
};

pub use conflict::conflict;
pub use without_value::fluents_without_value;

/// Limit on the objects tried for parameters of actions, for each round (about a second).
const MAX_STEPS: u64 = 1_000_000;

/// Limit on the evaluated effects of instances, for all rounds together (some seconds).
const MAX_EVALUATIONS: usize = 3_000_000;

/// Work for the evaluation of the effects of one instance.
const EVALUATION_WORK: u64 = 10;

/// Limit on the work for a certificate, and a callback that interrupts it.
///
/// A unit of work is one object tried for a parameter, about 0.1 µs in an optimized build.
pub struct Effort<'a> {
    remaining: u64,
    may_continue: &'a mut dyn FnMut() -> bool,
}

/// The effort is spent.
struct EffortExhausted;

impl<'a> Effort<'a> {
    /// Creates an effort of `work` units, which ends early when `may_continue` returns `false`.
    pub fn of(work: u64, may_continue: &'a mut dyn FnMut() -> bool) -> Self {
        Self {
            remaining: work,
            may_continue,
        }
    }

    fn spend(&mut self, work: u64) -> Result<(), EffortExhausted> {
        self.remaining = self.remaining.saturating_sub(work);
        if self.remaining == 0 || !(self.may_continue)() {
            return Err(EffortExhausted);
        }
        Ok(())
    }
}

/// Returns a certificate that no plan leads from the situation to the goal. The verifier has accepted it.
///
/// The certificate contains the facts that are reached in the delete relaxation, each with its earliest
/// time. If these do not suffice, it also contains pairs of facts that are never true together, or a closed
/// set of states. The work ends early when `may_continue` returns `false`.
///
/// # Errors
/// The reason for the missing certificate, in words. A plan may exist then.
pub fn no_plan_certificate_from(
    task: &Task,
    situation: &Situation,
    may_continue: &mut dyn FnMut() -> bool,
) -> Result<NoPlan, String> {
    no_plan_certificate_within(task, situation, &mut Effort::of(u64::MAX, may_continue))
}

/// Returns the same as [`no_plan_certificate_from`], within a limit on the work.
///
/// # Errors
/// The reason for the missing certificate, in words. A plan may exist then.
pub fn no_plan_certificate_within(
    task: &Task,
    situation: &Situation,
    effort: &mut Effort<'_>,
) -> Result<NoPlan, String> {
    let certificate = propose_certificate(task, situation, effort)?;
    match verify_no_plan_from(task, situation, &certificate) {
        Ok(()) => Ok(certificate),
        Err(flaw) => Err(format!("the verifier refuses the certificate: {flaw}")),
    }
}

/// Returns times before which these conditions do not hold, whatever happens from the situation;
/// `None` for a condition that never holds. The verifier has accepted them.
///
/// # Errors
/// The reason why they are not known, in words.
pub fn earliest_times(
    task: &Task,
    situation: &Situation,
    conditions: &[&Condition],
    effort: &mut Effort<'_>,
) -> Result<Vec<Option<Rational>>, String> {
    let instances = Instances::from(task, situation);
    let mut instances = instances.map_err(|flaw| flaw.to_string())?;
    let certificate = no_plan_certificate(task, &add_reachable(&mut instances, effort)?);
    let times = conditions
        .iter()
        .map(|condition| verify_earliest(task, situation, &certificate, condition));
    let times: Result<Vec<_>, _> = times.collect();
    times.map_err(|flaw| flaw.to_string())
}

/// Returns the situation with nothing assumed about its running actions: each may end at any time, with any
/// of its effects or, if it is cancelled or fails, with none.
///
/// The situations of planning requests contain estimated ends of running actions. A proof for such a
/// situation does not hold for other ends.
#[must_use]
pub fn with_any_ends(situation: &Situation) -> Situation {
    let running = situation.running.iter().map(|running| {
        let mut action = (*running.action).clone();
        if let Body::Durative(body) = &mut action.body {
            body.over_all = Condition::TRUE;
            let mut end = (*body.end).clone();
            end.condition = Condition::TRUE;
            for effect in &mut end.effects {
                // A guard that was evaluated at the start counts as undecided.
                effect.guard.at_start = Condition::Or(vec![Condition::TRUE]);
            }
            body.end = Arc::new(end);
        }
        RunningAction {
            action: Arc::new(action),
            duration: Interval::at_least(Rational::ZERO),
            ..running.clone()
        }
    });
    Situation {
        running: running.collect(),
        ..situation.clone()
    }
}

/// Proposes a certificate, which the verifier has not checked yet.
fn propose_certificate(
    task: &Task,
    situation: &Situation,
    effort: &mut Effort<'_>,
) -> Result<NoPlan, String> {
    let instances = Instances::from(task, situation);
    let mut instances = instances.map_err(|flaw| flaw.to_string())?;
    let reached = add_reachable(&mut instances, effort)?;
    let mut certificate = no_plan_certificate(task, &reached);
    if !instances.is_goal_in_reach(&reached) {
        return Ok(certificate);
    }
    let structure = Structure::of(&instances, &reached);
    match pairs::claims(&structure, effort) {
        Ok(claims) => {
            certificate.apart = structure.to_groups(&claims);
            certificate.epsilon = Some(Exact(task.epsilon().clone()));
            let proves = certificate.kind().proves();
            proves.clone_into(&mut certificate.proves);
            return Ok(certificate);
        }
        Err(pairs::Failure::Stopped) => return Err(EFFORT_IS_SPENT.to_owned()),
        Err(pairs::Failure::TooMany | pairs::Failure::Reachable) => {}
    }
    match closed_set::closed_set(task, &instances, &reached, effort) {
        Ok(closed) => {
            certificate.closed = Some(closed);
            let proves = certificate.kind().proves();
            proves.clone_into(&mut certificate.proves);
            Ok(certificate)
        }
        Err(closed_set::Failure::Stopped) => Err(EFFORT_IS_SPENT.to_owned()),
        Err(closed_set::Failure::TooMany) => Err("there are too many states to list".to_owned()),
        Err(closed_set::Failure::Unknown(why)) => Err(why),
        Err(closed_set::Failure::Reachable) => Err(
            "the goal is reachable by the verifier's rules, which ignore the least separation of \
             happenings, and over-all conditions with numbers or alternatives"
                .to_owned(),
        ),
    }
}

/// Adds the reachable instances of actions, and returns the facts that they reach.
fn add_reachable(
    instances: &mut Instances,
    effort: &mut Effort<'_>,
) -> Result<ReachedFacts, String> {
    let too_many =
        || "there are too many instances of actions to list the reachable facts".to_owned();
    let mut reached = ReachedFacts::new();
    let mut looks = 0;
    loop {
        let steps = instances.extend(&reached, MAX_STEPS);
        let steps = steps.map_err(|_| too_many())?;
        looks += instances.len();
        if looks > MAX_EVALUATIONS {
            return Err(too_many());
        }
        let work = steps + EVALUATION_WORK * instances.len() as u64;
        let spent = effort.spend(work);
        spent.map_err(|EffortExhausted| EFFORT_IS_SPENT.to_owned())?;
        let breaches = instances.breaches(&reached);
        if breaches.is_empty() {
            return Ok(reached);
        }
        for breach in breaches {
            let from = reached
                .entry(breach.fact)
                .or_insert_with(|| breach.time.clone());
            *from = Rational::min(from.clone(), breach.time);
        }
    }
}

const EFFORT_IS_SPENT: &str = "the limit on time or work was reached first";
