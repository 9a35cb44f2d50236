//! Ratio of the box of incremental rectangular robustification (IRR) to the largest box, by family,
//! in the published order of the parameters and in random ones.
//!
//! ```text
//! cargo run --release -p elbowroom --example irr_ratio -- DATA [ORDERS] [STEPS]
//! cargo run --release -p elbowroom --example irr_ratio -- DATA times [STEPS]
//! cargo run --release -p elbowroom --example irr_ratio -- DATA volume
//! ```
//!
//! The second command prints the computation times of the largest box for each guarantee and
//! objective (IRR, whose box is the first one, and the search), and the time `elbowroom verify`
//! needs for its certificate.
//!
//! The third command prints the share of each box in the volume of the exact region (weak
//! guarantee, as for the region; published order).
//!
//! `DATA` is the folder with `envelopes/`, `ORDERS` the number of random orders (20), and `STEPS`
//! the maximum number of boxes in the search for the largest one (2000). Plans that need more are
//! counted and omitted. The guarantee is the dynamic one. The step size is a hundredth of each
//! nominal value. Ends count up to nine times the nominal value. Probabilities are those of a world
//! in which each duration is normally distributed around its nominal value, with a standard
//! deviation of 15 % of it, and at least a thousandth.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "that is what the example does"
)]

#[path = "../../tests/elbowroom/shared/instances.rs"]
mod instances;
mod times;

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use elbowroom::answers::region::{RegionFinding, RegionSettings, region};
use elbowroom::answers::{EnvelopeRequest, NoObserver};
use elbowroom::duration_distributions;
use elbowroom::envelope::{
    BestRun, BestSettings, Guarantee, Objective, Oracle, Settings, best, irr, volume_foot,
};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::pddl::{Source, read_problem};
use elbowroom::plan::{BoxEnd, DecoupledEnvelope, format};
use elbowroom::sim::WorldModel;
use instances::{Instance, figure_3, figure_4};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Result for one order of the parameters of one plan: IRR's share of the greatest sum of widths,
/// of the greatest least slack, and of the greatest volume (the geometric mean of the widths).
/// `is_starved` is `true` if an end has no slack although it could have some.
struct Shares {
    widths: f64,
    slack: f64,
    volume: f64,
    /// Share of the greatest probability that all durations stay inside.
    probability: f64,
    is_starved: bool,
}

/// Largest boxes of one plan.
struct Largest {
    widest: BestRun,
    fairest: BestRun,
    most_spacious: BestRun,
    likeliest: BestRun,
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let data = arguments
        .next()
        .unwrap_or_else(|| "../shared/data".to_owned());
    let number = |text: Option<String>, default: usize| {
        text.map_or(default, |text| text.parse().expect("a whole number"))
    };
    let second = arguments.next();
    let families = families(Path::new(&data));
    match second.as_deref() {
        Some("volume") => return volumes(&families),
        Some("times") => return times::times(&families, number(arguments.next(), 2000)),
        _ => {}
    }
    let orders = number(second, 20);
    let steps = number(arguments.next(), 2000);
    println!(
        "| family | order | plans | boxes | widths: least | median | least slack: least | median | volume: least | median | probability: least | median | starved |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (family, instances) in families {
        let (mut published, mut shuffled, mut left_out) = (Vec::new(), Vec::new(), 0);
        for instance in &instances {
            let Some(mut found) = compared(instance, orders, steps) else {
                left_out += 1;
                continue;
            };
            shuffled.extend(found.split_off(1));
            published.extend(found);
        }
        eprintln!("{family}: {left_out} left out");
        let plans = published.len();
        row(&family, "published", plans, &published);
        row(&family, "random", plans, &shuffled);
    }
}

fn families(data: &Path) -> Vec<(String, Vec<Instance>)> {
    let mut families: Vec<(String, Vec<Instance>)> = Vec::new();
    for instance in figure_3(data) {
        let family = instance
            .name
            .split(' ')
            .next()
            .unwrap_or_default()
            .to_owned();
        match families.iter_mut().find(|(name, _)| *name == family) {
            Some((_, instances)) => instances.push(instance),
            None => families.push((family, vec![instance])),
        }
    }
    families.push(("robot_delivery".to_owned(), figure_4(data)));
    families
}

/// Prints the share of each box in the volume of the exact region.
fn volumes(families: &[(String, Vec<Instance>)]) {
    println!(
        "| family | plans | with a volume | exactly | IRR: least | median | greatest | best least slack: median | best sum of widths: median |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (family, instances) in families {
        let mut shares: [Vec<f64>; 3] = Default::default();
        let (mut measured, mut exact) = (0, 0);
        for (boxes, is_exact) in instances.iter().filter_map(shares_of_volume) {
            measured += 1;
            exact += usize::from(is_exact);
            for (name, share) in boxes {
                let names = ["irr", "least-slack", "widths"];
                if let Some(place) = names.iter().position(|own| *own == name) {
                    shares[place].push(share);
                }
            }
        }
        let percent = |value: Option<&f64>| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{:.1} %", value * 100.0))
        };
        for own in &mut shares {
            own.sort_by(f64::total_cmp);
        }
        let median = |own: &[f64]| percent(own.get(own.len() / 2));
        println!(
            "| {family} | {} | {measured} | {exact} | {} | {} | {} | {} | {} |",
            instances.len(),
            percent(shares[0].first()),
            median(&shares[0]),
            percent(shares[0].last()),
            median(&shares[1]),
            median(&shares[2]),
        );
    }
}

/// Returns the share of each box by name, and `true` if the volume is exact.
fn shares_of_volume(instance: &Instance) -> Option<(Vec<(String, f64)>, bool)> {
    let (task, text) = read(instance)?;
    let plan = format::read(text.as_bytes(), &task).ok()?;
    let settings = RegionSettings {
        with_boxes: true,
        with_volume: true,
        seed: 0,
    };
    let request = EnvelopeRequest::new(&task, plan);
    let outcome = region(&request, &settings, &mut NoObserver).ok()?;
    let RegionFinding::Region {
        boxes,
        measure: Some(measure),
        ..
    } = outcome.answer.finding
    else {
        return None;
    };
    let shares = boxes
        .into_iter()
        .filter_map(|own| Some((own.name, own.share?.decimal)));
    Some((shares.collect(), measure.volume.is_some()))
}

fn read(instance: &Instance) -> Option<(Arc<Task>, String)> {
    let source = |path: &Path| {
        let bytes =
            std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Source::from_bytes(path.display().to_string(), &bytes)
    };
    let read = read_problem(&source(&instance.domain), &source(&instance.problem));
    let task = Arc::new(Task::new(read.ok()?.0));
    Some((task, source(&instance.plan).text().to_owned()))
}

fn row(family: &str, order: &str, plans: usize, shares: &[Shares]) {
    let spread = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let percent = |value: Option<&f64>| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{:.0} %", value * 100.0))
        };
        format!(
            "{} | {}",
            percent(values.first()),
            percent(values.get(values.len() / 2))
        )
    };
    let widths = spread(shares.iter().map(|own| own.widths).collect());
    let slack = spread(shares.iter().map(|own| own.slack).collect());
    let volume = spread(shares.iter().map(|own| own.volume).collect());
    let probability = spread(shares.iter().map(|own| own.probability).collect());
    let starved = shares.iter().filter(|own| own.is_starved).count();
    println!(
        "| {family} | {order} | {plans} | {} | {widths} | {slack} | {volume} | {probability} | {starved} |",
        shares.len()
    );
}

/// Returns the results, the published order first; `None` if the largest boxes are not found, or
/// have no slack.
fn compared(instance: &Instance, orders: usize, steps: usize) -> Option<Vec<Shares>> {
    let (task, text) = read(instance)?;
    let largest = Largest {
        widest: largest(&task, &text, Objective::Widths, steps)?,
        fairest: largest(&task, &text, Objective::LeastSlack, steps)?,
        most_spacious: largest(&task, &text, Objective::Volume, steps)?,
        likeliest: largest(&task, &text, Objective::Probability, steps)?,
    };
    let plan = format::read(text.as_bytes(), &task).ok()?;
    let names: Vec<String> = plan.parameters.into_iter().map(|own| own.name).collect();
    let mut all = vec![shares(&task, &text, &names, &largest)?];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..orders {
        let (mut parameters, others): (Vec<&str>, Vec<&str>) = text
            .lines()
            .partition(|line| line.trim_start().starts_with("parameter"));
        parameters.shuffle(&mut rng);
        parameters.extend(others);
        all.push(shares(&task, &parameters.join("\n"), &names, &largest)?);
    }
    Some(all)
}

/// Returns the largest box with the dynamic guarantee, if it is proved to be the largest and has
/// any slack.
fn largest(task: &Arc<Task>, text: &str, objective: Objective, steps: usize) -> Option<BestRun> {
    let run = best_in_steps(task, text, Guarantee::Dynamic, objective, steps)?;
    let is_logarithm = matches!(objective, Objective::Volume | Objective::Probability);
    let has_room = is_logarithm || run.value.is_positive();
    (run.is_proved && has_room).then_some(run)
}

/// Returns the largest box found in `steps` steps, starting with IRR's.
fn best_in_steps(
    task: &Arc<Task>,
    text: &str,
    guarantee: Guarantee,
    objective: Objective,
    steps: usize,
) -> Option<BestRun> {
    let plan = Arc::new(format::read(text.as_bytes(), task).ok()?);
    let mut oracle = Oracle::new(task, &plan, guarantee).ok()?;
    let start = irr(&mut oracle, &irr_settings(), &mut |_| {
        ControlFlow::Continue(())
    });
    let start = start.ok()?.envelope.ok()?;
    let chances = match objective {
        Objective::Probability => duration_distributions(&plan, &default_world(task)?).ok()?,
        _ => Vec::new(),
    };
    let settings = BestSettings {
        objective,
        distributions: chances,
        ..BestSettings::default()
    };
    let mut left = steps;
    let run = best(&mut oracle, &settings, Some(&start), &mut |_| {
        left = left.saturating_sub(1);
        if left == 0 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    run.ok().filter(|run| run.envelope.is_ok())
}

/// Returns the world in which each duration is normally distributed around its nominal value.
pub(crate) fn default_world(task: &Task) -> Option<WorldModel> {
    let text = "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\naction = \"*\"\n\
                normal = { mean = 1, deviation = 0.15 }\nrelative = true\n";
    WorldModel::read(Source::new("world", text), task.problem()).ok()
}

/// Returns settings with IRR's steps: a hundredth of each nominal value.
fn irr_settings() -> Settings {
    Settings {
        relative: Some(Rational::new(1, 100)),
        ..Settings::default()
    }
}

/// Compares IRR's box with the largest ones.
fn shares(task: &Arc<Task>, text: &str, names: &[String], largest: &Largest) -> Option<Shares> {
    let plan = Arc::new(format::read(text.as_bytes(), task).ok()?);
    let mut oracle = Oracle::new(task, &plan, Guarantee::Dynamic).ok()?;
    let run = irr(&mut oracle, &irr_settings(), &mut |_| {
        ControlFlow::Continue(())
    })
    .ok()?;
    let found = run.envelope.ok()?;
    let nominal = DecoupledEnvelope::point(&plan.nominal());
    let Largest {
        widest,
        fairest,
        most_spacious,
        likeliest,
    } = largest;
    let mut likely = 0.0;
    let own_chances = duration_distributions(&plan, &default_world(task)?).ok()?;
    let both = plan.parameters.iter().zip(found.intervals());
    for ((parameter, interval), chance) in both.zip(&own_chances) {
        let Some(chance) = chance else { continue };
        let far = Rational::from(1_000_000_000);
        let below = interval
            .lower
            .value()
            .map_or(far.clone(), |end| &parameter.nominal - end);
        let above = interval
            .upper
            .value()
            .map_or(far, |end| end - &parameter.nominal);
        let [mass, _] = chance.probability_bounds(&parameter.nominal, &[below, above]);
        likely += mass.to_f64().ln();
    }
    let mut sum = Rational::ZERO;
    // Weight of each parameter, and its width relative to the scale.
    let mut widths = vec![(0.0, volume_foot().to_f64()); plan.parameters.len()];
    let mut least: Option<Rational> = None;
    let mut is_starved = false;
    for own in &widest.proof.variables {
        let scale = &own.scale;
        for end in &own.ends {
            // The position of the parameter depends on the order.
            let end = &BoxEnd {
                parameter: plan.find(&names[end.parameter.index()])?,
                side: end.side,
            };
            let far = end.reach(&found).zip(end.reach(&nominal));
            let moved = far.map_or_else(|| own.max_distance.clone(), |(far, near)| far - near);
            let moved = moved.min(own.max_distance.clone());
            let weight = &plan.parameter(end.parameter).weight;
            sum += weight * &moved;
            let slack = moved.checked_div(scale)?;
            let width = &mut widths[end.parameter.index()];
            width.0 = weight.to_f64();
            width.1 += slack.to_f64();
            is_starved |= moved.is_zero() && fairest.value.is_positive();
            least = Some(least.map_or(slack.clone(), |least| least.min(slack)));
        }
    }
    let share = |part: &Rational, whole: &Rational| {
        part.checked_div(whole).map_or(1.0, |share| share.to_f64())
    };
    let volume: f64 = widths
        .iter()
        .map(|(weight, width)| weight * width.ln())
        .sum();
    let weights: f64 = widths.iter().map(|(weight, _)| weight).sum();
    Some(Shares {
        volume: ((volume - most_spacious.value.to_f64()) / weights).exp(),
        probability: (likely - likeliest.value.to_f64()).exp(),
        widths: share(&sum, &widest.value),
        slack: share(&least?, &fairest.value),
        is_starved,
    })
}
