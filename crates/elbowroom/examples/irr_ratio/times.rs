//! Computation times of the largest boxes and of their certificates.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use elbowroom::answers::envelope::{Search, envelope};
use elbowroom::answers::{EnvelopeRequest, Observer, StopRequest};
use elbowroom::envelope::{Guarantee, Objective};
use elbowroom::model::Task;
use elbowroom::plan::format;
use elbowroom::verify::{AnswerError, verify_answer};

use crate::instances::Instance;
use crate::{best_in_steps, default_world, read};

/// Prints a row for each family, guarantee and objective.
#[allow(
    clippy::disallowed_methods,
    reason = "how long it takes is what is asked"
)]
pub(crate) fn times(families: &[(String, Vec<Instance>)], steps: usize) {
    println!(
        "| family | guarantee | objective | plans | proved | box: median | longest | certificates | check: longest |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (family, instances) in families {
        for guarantee in [Guarantee::Weak, Guarantee::Dynamic, Guarantee::Strong] {
            for objective in [
                Objective::LeastSlack,
                Objective::Widths,
                Objective::Volume,
                Objective::Probability,
            ] {
                let (mut boxes, mut checks, mut proved) = (Vec::new(), Vec::new(), 0);
                for instance in instances {
                    let Some((task, text)) = read(instance) else {
                        continue;
                    };
                    let begun = Instant::now();
                    let Some(run) = best_in_steps(&task, &text, guarantee, objective, steps) else {
                        continue;
                    };
                    boxes.push(begun.elapsed().as_secs_f64());
                    proved += usize::from(run.is_proved);
                    checks.extend(time_checks(&task, &text, guarantee, objective, steps));
                }
                for own in [&mut boxes, &mut checks] {
                    own.sort_by(f64::total_cmp);
                }
                let milliseconds = |value: Option<&f64>| {
                    value.map_or_else(
                        || "-".to_owned(),
                        |value| format!("{:.1} ms", value * 1000.0),
                    )
                };
                println!(
                    "| {family} | {guarantee} | {objective} | {} | {proved} | {} | {} | {} | {} |",
                    boxes.len(),
                    milliseconds(boxes.get(boxes.len() / 2)),
                    milliseconds(boxes.last()),
                    checks.len(),
                    milliseconds(checks.last()),
                );
            }
        }
    }
}

/// Returns the time in seconds to check the certificate of the largest box, or `None` without one.
///
/// # Panics
/// The certificate is rejected.
#[allow(
    clippy::disallowed_methods,
    reason = "how long it takes is what is asked"
)]
fn time_checks(
    task: &Arc<Task>,
    text: &str,
    guarantee: Guarantee,
    objective: Objective,
    steps: usize,
) -> Option<f64> {
    let plan = format::read(text.as_bytes(), task).ok()?;
    let mut request = EnvelopeRequest::new(task, plan);
    request.guarantee = guarantee;
    request.search = Search::best(objective);
    request.world = default_world(task).map(Arc::new);
    let outcome = envelope(&request, &mut StepLimit(steps)).ok()?;
    let answer = serde_json::to_string(&outcome.answer).expect("a document");
    let begun = Instant::now();
    let verdict = verify_answer(&answer);
    let seconds = begun.elapsed().as_secs_f64();
    match verdict {
        Ok(_) => Some(seconds),
        Err(AnswerError::NoBox | AnswerError::NoCertificate) => None,
        Err(wrong) => panic!("{guarantee} {objective}: {wrong}"),
    }
}

/// Watcher that ends a search after this number of steps.
struct StepLimit(usize);

impl Observer for StepLimit {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 {
            return ControlFlow::Break(StopRequest::TimeLimit);
        }
        ControlFlow::Continue(())
    }
}
