//! The proof that there is no plan, in the form that `elbowroom-verify` checks.

mod closed;
mod pairs;

use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;
use elbowroom_verify::no_plan::pairs::Structure;
use elbowroom_verify::no_plan::{Instances, NoPlan, Reached, no_plan_certificate};

use super::{PlanAnswer, PlanFinding, Watcher};

/// The most objects that are tried for the parameters of actions, in each round: about a second.
const MOST_STEPS: u64 = 1_000_000;

/// The most effects of instances that are looked at, in all rounds together: some seconds.
const MOST_LOOKS: usize = 3_000_000;

/// Puts a certificate into an answer that says that there is no plan, or the reason why it has none.
///
/// The certificate is the set of facts that are reached in the delete relaxation, each with its earliest
/// time; where plans fail for another reason, also pairs that are never true together, or a closed set of
/// states.
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
    match no_plan_certificate_from(task, &Situation::initial(task), &mut goes_on) {
        Ok(found) => {
            let files = files.iter().map(|file| (*file).to_owned()).collect();
            *certificate = Some(Box::new(NoPlan { files, ..found }));
        }
        Err(why) => *uncertified = Some(why),
    }
}

/// The certificate that no plan goes on from a situation, or the reason why there is none; that no plan
/// does must be known. [`verify_no_plan_from`](elbowroom_verify::no_plan::verify_no_plan_from) checks it.
///
/// # Errors
/// In words, why there is none.
pub fn no_plan_certificate_from(
    task: &Task,
    situation: &Situation,
    goes_on: &mut dyn FnMut() -> bool,
) -> Result<NoPlan, String> {
    let instances = Instances::from(task, situation);
    let mut instances = instances.map_err(|flaw| flaw.to_string())?;
    let mut reached = Reached::new();
    let mut looks = 0;
    loop {
        if !goes_on() {
            return Err(TIME_IS_UP.to_owned());
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
    let mut certificate = no_plan_certificate(task, &reached);
    if !instances.is_goal_in_reach(&reached) {
        return Ok(certificate);
    }
    let structure = Structure::of(&instances, &reached);
    match pairs::claims(&structure, goes_on) {
        Ok(claims) => {
            certificate.apart = structure.written(&claims);
            let proves = certificate.kind().proves();
            proves.clone_into(&mut certificate.proves);
            return Ok(certificate);
        }
        Err(pairs::Failure::Stopped) => return Err(TIME_IS_UP.to_owned()),
        Err(pairs::Failure::TooMany | pairs::Failure::InReach) => {}
    }
    match closed::closed(task, &instances, &reached, goes_on) {
        Ok(closed) => {
            certificate.closed = Some(closed);
            let proves = certificate.kind().proves();
            proves.clone_into(&mut certificate.proves);
            Ok(certificate)
        }
        Err(closed::Failure::Stopped) => Err(TIME_IS_UP.to_owned()),
        Err(closed::Failure::TooMany) => Err("there are too many states to list".to_owned()),
        Err(closed::Failure::Unknown(why)) => Err(why),
        Err(closed::Failure::InReach) => Err(
            "the proof needs more than the checker heeds: the least separation of happenings, or what \
             numbers and alternatives have to be throughout actions"
                .to_owned(),
        ),
    }
}

const TIME_IS_UP: &str = "the time was up before it was made";
