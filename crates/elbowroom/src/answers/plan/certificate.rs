//! The proof that there is no plan, in the form that `elbowroom-verify` checks.

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_verify::no_plan::{Instances, NoPlan, Reached, no_plan_certificate};

use super::{PlanAnswer, PlanFinding, Watcher};

/// The most objects that are tried for the parameters of actions, in each round: about a second.
const MOST_STEPS: u64 = 1_000_000;

/// The most effects of instances that are looked at, in all rounds together: some seconds.
const MOST_LOOKS: usize = 3_000_000;

/// Puts a certificate into an answer that says that there is no plan, or the reason why it has none.
///
/// The certificate is the set of facts that are reached in the delete relaxation, each with its earliest
/// time. Where plans fail for another reason, such as two facts that exclude each other, there is none.
/// `files` are the names of domain and problem, for who checks it. The work ends early when the watcher
/// wants no more.
pub fn certify(answer: &mut PlanAnswer, task: &Task, files: [&str; 2], watcher: &mut dyn Watcher) {
    let PlanFinding::NoPlan {
        certificate,
        uncertified,
        ..
    } = &mut answer.finding
    else {
        return;
    };
    let mut goes_on = || watcher.flow().is_continue();
    match certificate_of(task, &mut goes_on) {
        Ok(found) => {
            let files = files.iter().map(|file| (*file).to_owned()).collect();
            *certificate = Some(Box::new(NoPlan { files, ..found }));
        }
        Err(why) => *uncertified = Some(why),
    }
}

/// The certificate, or why there is none.
fn certificate_of(task: &Task, goes_on: &mut dyn FnMut() -> bool) -> Result<NoPlan, String> {
    let mut instances = Instances::of(task).map_err(|flaw| flaw.to_string())?;
    let mut reached = Reached::new();
    let mut looks = 0;
    loop {
        if !goes_on() {
            return Err("the time was up before it was made".to_owned());
        }
        let too_many = "there are too many instances of actions to list what they reach";
        let extended = instances.extend(&reached, MOST_STEPS);
        extended.map_err(|_| too_many.to_owned())?;
        looks += instances.len();
        if looks > MOST_LOOKS {
            return Err(too_many.to_owned());
        }
        let breaches = instances.breaches(&reached);
        if breaches.is_empty() {
            break;
        }
        for breach in breaches {
            let from = reached
                .entry(breach.fact)
                .or_insert_with(|| breach.time.clone());
            *from = Rational::min(from.clone(), breach.time);
        }
    }
    if instances.is_goal_in_reach(&reached) {
        return Err(
            "if nothing that has become true were ever lost, the goal would be reached in time; that \
             there is no plan was proved by pairs of facts, or by search"
                .to_owned(),
        );
    }
    Ok(no_plan_certificate(task, &reached))
}
