//! Comparison of the predictions of a world file with observations, by action.

use std::collections::BTreeMap;

use elbowroom_learning::records::{Outcome, Record};
use elbowroom_num::Rational;
use elbowroom_sim::draw::keyed;
use elbowroom_sim::{Purpose, Side, WorldModel};
use serde::{Deserialize, Serialize};

/// Number of draws per mean of a distribution.
const DRAWS: u64 = 200;

/// Durations outside the central 90 % of their distribution are below the first share, or above the second.
const TAILS: (f64, f64) = (0.05, 0.95);

/// Predictions of the believed world for the attempts of one action, and observations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PredictionAnswer {
    /// Number of observed durations with a prediction: attempts that succeeded.
    pub durations: u64,
    /// Predicted mean of these durations, in seconds; 0 if there are none.
    pub predicted_mean: f64,
    /// Observed mean of these durations, in seconds; 0 if there are none.
    pub observed_mean: f64,
    /// Number of them within the central 90 % of the predicted distribution.
    pub within: u64,
    /// Number of attempts that ended by themselves.
    pub ended: u64,
    /// Predicted number of failures among them.
    pub predicted_failures: f64,
    /// Observed number of failures among them.
    pub failures: u64,
}

/// Returns predictions of `world` for the attempts of a log, by the names of the actions.
pub fn predictions_for(records: &[Record], world: &WorldModel) -> Vec<(String, PredictionAnswer)> {
    let mut predictions = Predictions::default();
    predictions.add(records, world);
    let names = predictions.by_name.keys();
    let answers = names.filter_map(|name| Some((name.clone(), predictions.of(name)?)));
    answers.collect()
}

/// Sums over the attempts of all logs with a believed world.
#[derive(Default)]
pub(super) struct Predictions {
    by_name: BTreeMap<String, PredictionAnswer>,
    means: BTreeMap<(String, u64), f64>,
}

impl Predictions {
    /// Adds the attempts of a log, whose executor believed `world`.
    pub(super) fn add(&mut self, records: &[Record], world: &WorldModel) {
        self.means.clear();
        for record in records {
            self.add_attempt(record, world);
        }
    }

    fn add_attempt(&mut self, record: &Record, world: &WorldModel) {
        let action = format!("({})", record.action.trim_matches(['(', ')']));
        let is_failure = record.outcome == Outcome::Failed;
        let observed = record.start.map(|start| record.end - start);
        let observed = observed.filter(|_| record.outcome == Outcome::Succeeded);
        let sums = self.by_name.entry(record.name().to_owned()).or_default();
        if is_failure || record.outcome == Outcome::Succeeded {
            sums.ended += 1;
            sums.failures += u64::from(is_failure);
            let failing = world.failure_rule(&action);
            sums.predicted_failures += failing.map_or(0.0, |it| it.probability);
        }
        let (Some(observed), Some(planned)) = (observed, record.planned) else {
            return;
        };
        let Ok(exact) = planned.to_string().parse::<Rational>() else {
            return;
        };
        // Times of reports are rounded in binary.
        let resolution = world.resolution.to_f64();
        let observed = (observed / resolution).round() * resolution;
        let share = |side| world.duration_probability(&action, &exact, observed, side);
        let is_low = share(Side::AtMost).is_some_and(|share| share < TAILS.0);
        let is_high = share(Side::Below).is_some_and(|share| share > TAILS.1);
        let key = (action.clone(), planned.to_bits());
        let mean = *self
            .means
            .entry(key)
            .or_insert_with(|| mean(world, &action, &exact));
        sums.durations += 1;
        sums.within += u64::from(!is_low && !is_high);
        // Sums until they are read by `of`.
        sums.predicted_mean += mean;
        sums.observed_mean += observed;
    }

    /// Returns the predictions for the actions of a name; `None` if no attempt of theirs has one.
    pub(super) fn of(&self, name: &str) -> Option<PredictionAnswer> {
        let sums = *self.by_name.get(name)?;
        #[allow(
            clippy::cast_precision_loss,
            reason = "counts of attempts are far below 2^53"
        )]
        let count = sums.durations.max(1) as f64;
        Some(PredictionAnswer {
            predicted_mean: sums.predicted_mean / count,
            observed_mean: sums.observed_mean / count,
            ..sums
        })
    }
}

/// Returns the mean of the durations of an action, in seconds, from draws that depend on its name only.
fn mean(world: &WorldModel, action: &str, planned: &Rational) -> f64 {
    let draw = |sample| {
        let mut rng = keyed(sample, action, 0, Purpose::Duration);
        world.duration(action, planned, &mut rng).to_f64()
    };
    #[allow(clippy::cast_precision_loss, reason = "the number of draws is small")]
    let count = DRAWS as f64;
    (0..DRAWS).map(draw).sum::<f64>() / count
}
