//! A planner's claim that there is no plan: proved, or reported as a search without a result.

use elbowroom_model::{Situation, Task};
use elbowroom_planner::no_plan::{Effort, fluents_without_value, no_plan_certificate_within};
use elbowroom_planner::{Counts, Proof};
use elbowroom_selection::WITHOUT_SELF_OVERLAP;
use elbowroom_verify::no_plan::NoPlan;

use super::{PlanAnswer, PlanFinding, PlanStop, SearchMonitor};

/// Work limit for the certificate of an answer: about a minute.
const MAX_WORK: u64 = 500_000_000;

impl SearchMonitor<'_> {
    /// Returns the finding for the embedded planner's claim that no plan exists.
    pub(super) fn refuted_finding(
        &mut self,
        task: &Task,
        proof: &Proof,
        counts: Counts,
    ) -> (PlanFinding, PlanStop) {
        let evaluated = counts.evaluated;
        let ended = format!("the search ended without a plan after {evaluated} states");
        if !matches!(proof, Proof::WithoutSelfOverlap { .. }) {
            return self.claimed_finding(
                task,
                proof.to_string(),
                &format!("no plan found: {ended}"),
            );
        }
        let proved = format!("{proof}; the certificate covers self-overlap as well");
        let unproved = format!("{WITHOUT_SELF_OVERLAP}: {ended}");
        let (mut finding, stop) = self.claimed_finding(task, proved, &unproved);
        if let PlanFinding::None {
            without_self_overlap,
            ..
        } = &mut finding
        {
            *without_self_overlap = true;
        }
        (finding, stop)
    }

    /// Returns the finding for a planner's claim that no plan exists: `proved` if it can be certified,
    /// otherwise `unproved` with the reason.
    pub(super) fn claimed_finding(
        &mut self,
        task: &Task,
        proved: String,
        unproved: &str,
    ) -> (PlanFinding, PlanStop) {
        let situation = Situation::initial(task);
        let mut may_continue = || self.watcher.flow().is_continue();
        let mut effort = Effort::of(MAX_WORK, &mut may_continue);
        match no_plan_certificate_within(task, &situation, &mut effort) {
            Ok(certificate) => {
                let finding = PlanFinding::NoPlan {
                    reason: with_fluents(task, proved),
                    certificate: Box::new(certificate),
                };
                (finding, PlanStop::Proved)
            }
            Err(why) => {
                let reason = format!("{unproved}; there is no certificate that none exists: {why}");
                let finding = PlanFinding::None {
                    reason: with_fluents(task, reason),
                    uncertified: Some(why),
                    without_self_overlap: false,
                };
                (finding, PlanStop::Exhausted)
            }
        }
    }
}

impl PlanFinding {
    /// Returns the finding for a search without a plan, if no planner claims that there is none.
    pub(super) fn none(task: &Task, reason: String) -> Self {
        Self::None {
            reason: with_fluents(task, reason),
            uncertified: None,
            without_self_overlap: false,
        }
    }
}

impl PlanAnswer {
    /// Adds the names of the domain and problem files to the certificate, if the answer has one.
    pub fn name_files(&mut self, files: [&str; 2]) {
        if let PlanFinding::NoPlan { certificate, .. } = &mut self.finding {
            let NoPlan { files: names, .. } = &mut **certificate;
            *names = files.map(str::to_owned).to_vec();
        }
    }
}

/// Returns the reason, with the names of the fluents without a value that are read.
fn with_fluents(task: &Task, reason: String) -> String {
    let fluents = fluents_without_value(task, &Situation::initial(task));
    let Some(first) = fluents.first() else {
        return reason;
    };
    let rest = fluents.len() - 1;
    let others = match rest {
        0 => String::new(),
        1 => ", and 1 other fluent,".to_owned(),
        _ => format!(", and {rest} other fluents,"),
    };
    let verb = if rest == 0 { "has" } else { "have" };
    format!(
        "{reason}. {first}{others} {verb} no initial value, so no action that reads it is possible \
         before it has one. If that is not intended, add a value to :init: `(= {first} 0)`"
    )
}
