//! What trials in perturbed worlds came to.

use std::fmt::Write as _;

use elbowroom_execution::untimed::Trial;
use elbowroom_report::statistics::{Mean, Proportion};
use elbowroom_report::table::Table;

use super::{Case, ExecutorKind, PerturbedExperiment, WorldKind};

/// The trials of one case in one world with one executor.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: String,
    /// The world.
    pub world: WorldKind,
    /// The executor.
    pub executor: ExecutorKind,
    /// How many succeeded.
    pub success: Proportion,
    /// Replans in trials that succeeded.
    pub replans: Mean,
    /// What was done in trials that succeeded.
    pub succeeded: Work,
    /// What was done in trials that failed.
    pub failed: Work,
    /// What was published, in that world.
    pub published: Option<Proportion>,
    /// The best success probability there can be, where it is known.
    pub optimum: Option<f64>,
}

/// Means of what was done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Starts and ends.
    pub messages: Mean,
    /// Starts that failed.
    pub failed_starts: Mean,
    /// Actions that were started.
    pub actions: Mean,
}

impl Row {
    pub(super) fn new(
        case: &Case,
        world: WorldKind,
        executor: ExecutorKind,
        optimum: Option<f64>,
    ) -> Self {
        let published = case.published.as_ref();
        let published = published.filter(|_| world == WorldKind::AsPublished);
        let published = published.and_then(|published| {
            Some(Proportion {
                successes: *published.successes.get(&executor)?,
                count: published.trials,
            })
        });
        Self {
            case: case.name.clone(),
            world,
            executor,
            success: Proportion::default(),
            replans: Mean::default(),
            succeeded: Work::default(),
            failed: Work::default(),
            published,
            optimum,
        }
    }

    pub(super) fn add(&mut self, trial: Trial) {
        self.success.add(trial.is_success);
        let work = if trial.is_success {
            self.replans.add(trial.replans as u64);
            &mut self.succeeded
        } else {
            &mut self.failed
        };
        work.messages.add(trial.tally.messages());
        work.failed_starts.add(trial.tally.failed_starts);
        work.actions.add(trial.tally.starts);
    }

    /// How far the published share is from ours, in standard deviations of the difference.
    pub fn distance(&self) -> Option<f64> {
        let published = self.published?;
        let (ours, theirs) = (self.success.share()?, published.share()?);
        let variance = |share: f64, of: Proportion| share * (1.0 - share) / float(of.count);
        let deviation = (variance(ours, self.success) + variance(theirs, published)).sqrt();
        Some((ours - theirs) / deviation.max(f64::MIN_POSITIVE))
    }

    /// Whether the published share could, at the 5 % level, be of the same probability as ours.
    pub fn agrees(&self) -> Option<bool> {
        Some(self.distance()?.abs() <= 1.96)
    }

    /// Whether our share lies in the 95 % interval (Wilson) of what was published.
    pub fn is_inside(&self) -> Option<bool> {
        let (lower, upper) = self.published?.wilson()?;
        let share = self.success.share()?;
        Some(lower <= share && share <= upper)
    }
}

#[allow(
    clippy::cast_precision_loss,
    reason = "counts of trials are far below 2^52"
)]
fn float(count: u64) -> f64 {
    count as f64
}

/// The rows as a table.
pub fn table(experiment: &PerturbedExperiment, rows: &[Row]) -> Table {
    let headings = [
        "case",
        "world",
        "executor",
        "success %",
        "95 % interval",
        "published %",
        "z",
        "optimum %",
        "replans",
        "messages (success)",
        "failed starts (success)",
        "actions (success)",
        "messages (failure)",
        "failed starts (failure)",
        "actions (failure)",
    ];
    let percent =
        |share: Option<f64>| share.map_or_else(String::new, |s| format!("{:.1}", 100.0 * s));
    let mean = |mean: Mean| mean.value().map_or_else(String::new, |m| format!("{m:.2}"));
    let row = |row: &Row| {
        let interval = row.success.wilson();
        let interval =
            interval.map(|(lower, upper)| format!("{:.1}–{:.1}", 100.0 * lower, 100.0 * upper));
        let z = row.distance().map(|z| format!("{z:+.1}"));
        vec![
            row.case.clone(),
            row.world.name().to_owned(),
            row.executor.name().to_owned(),
            percent(row.success.share()),
            interval.unwrap_or_default(),
            percent(row.published.and_then(Proportion::share)),
            z.unwrap_or_default(),
            percent(row.optimum),
            mean(row.replans),
            mean(row.succeeded.messages),
            mean(row.succeeded.failed_starts),
            mean(row.succeeded.actions),
            mean(row.failed.messages),
            mean(row.failed.failed_starts),
            mean(row.failed.actions),
        ]
    };
    let mut caption = experiment.title.clone();
    let compared: Vec<bool> = rows.iter().filter_map(Row::agrees).collect();
    if !compared.is_empty() {
        let agreeing = compared.iter().filter(|&&agrees| agrees).count();
        let inside = rows.iter().filter(|row| row.is_inside() == Some(true));
        let _ = write!(
            caption,
            "\nOf {} published success rates, {agreeing} do not differ from ours at the 5 % level; \
             {} of ours lie in the 95 % interval of what was published.",
            compared.len(),
            inside.count()
        );
    }
    Table {
        caption,
        headings: headings.map(str::to_owned).to_vec(),
        rows: rows.iter().map(row).collect(),
    }
}
