//! Statistics of answers and certificates.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use elbowroom::answers::plan::no_plan_certificate_from;
use elbowroom::model::{Situation, Task};
use elbowroom::planner::{Answer, Proof};
use elbowroom::verify::no_plan::verify_no_plan_from;

/// Time limit for a certificate.
const LIMIT: Duration = Duration::from_secs(20);

/// Counts of answers by kind.
#[derive(Default)]
pub(crate) struct Sums {
    plans: usize,
    open: usize,
    /// By the planner's proof and the certificate's kind.
    denied: BTreeMap<(String, String), Vec<[f64; 3]>>,
}

impl Sums {
    /// Counts an answer. If it says that there is no plan, certifies and checks it.
    pub(crate) fn count_answer(
        &mut self,
        name: &str,
        task: &Task,
        situation: &Situation,
        answer: &Answer,
    ) {
        let proof = match answer {
            Answer::Plan { .. } => {
                self.plans += 1;
                return;
            }
            Answer::Unsolvable { proof, .. } => proof,
            _ => {
                self.open += 1;
                return;
            }
        };
        let proof = match proof {
            Proof::Unreachable(_) => "unreachable",
            Proof::TooLate { .. } => "too late",
            Proof::Exhausted { .. } => "exhausted",
            Proof::WithoutSelfOverlap { .. } => "exhausted without self-overlap",
        };
        let begin = Instant::now();
        let mut may_continue = || begin.elapsed() < LIMIT;
        let found = no_plan_certificate_from(task, situation, &mut may_continue);
        let made = begin.elapsed().as_secs_f64();
        let (kind, figures) = match found {
            Ok(certificate) => {
                let bytes = serde_json::to_string(&certificate).map_or(0, |text| text.len());
                let begin = Instant::now();
                let verdict = verify_no_plan_from(task, situation, &certificate);
                let kind = match verdict {
                    Ok(()) => format!("{:?}", certificate.kind()),
                    Err(flaw) => format!("REFUSED: {flaw}"),
                };
                #[allow(clippy::cast_precision_loss, reason = "it is a size to be read")]
                let bytes = bytes as f64;
                (kind, [made, begin.elapsed().as_secs_f64(), bytes])
            }
            Err(why) => (format!("none: {why}"), [made, 0.0, 0.0]),
        };
        println!(
            "{name}: {proof}; {kind}; made {:.3} s, checked {:.3} s, {} bytes",
            figures[0], figures[1], figures[2]
        );
        let own = self.denied.entry((proof.to_owned(), kind)).or_default();
        own.push(figures);
    }

    pub(crate) fn print(&self) {
        println!("\n{} plans, {} open", self.plans, self.open);
        println!(
            "| proof | certificate | answers | made, median and most s | checked | kilobytes |"
        );
        println!("|---|---|--:|--:|--:|--:|");
        for ((proof, kind), figures) in &self.denied {
            let spread = |place: usize, unit: f64| {
                let mut values: Vec<f64> = figures.iter().map(|own| own[place] / unit).collect();
                values.sort_by(f64::total_cmp);
                let most = values.last().copied().unwrap_or_default();
                format!("{:.4}, {most:.3}", values[values.len() / 2])
            };
            println!(
                "| {proof} | {kind} | {} | {} | {} | {} |",
                figures.len(),
                spread(0, 1.0),
                spread(1, 1.0),
                spread(2, 1000.0)
            );
        }
    }
}
