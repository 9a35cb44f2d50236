//! Cost of the dynamic guarantee: its boxes in comparison with those of the weak one, and their
//! search times; and the gain if the dispatcher enforces obligations.

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::{Duration, Instant};

use elbowroom::envelope::Guarantee;
use elbowroom::num::Rational;
use elbowroom::pipeline;
use elbowroom::plan::{DecoupledEnvelope, ParametrizedPlan};

use super::options::Options;
use super::sources::Source;
use super::subject::Subject;
use super::trial::{Boxed, Search, boxed};
use super::{results_by_family, skipped_table};

/// Boxes of one plan, weak and dynamic.
struct Row {
    is_different: bool,
    widths: [Rational; 2],
    checks: [usize; 2],
    times: [Duration; 2],
    /// Widths of the dynamic box and of that with enforced obligations, if there are any.
    enforced: Option<[Rational; 2]>,
}

pub(crate) fn main(options: &Options) {
    let (families, skipped) = results_by_family(options, &|source| {
        row(source, options).map(|row| (source.family.clone(), row))
    });
    println!(
        "| family | plans | boxes differ | widths of these: weak | dynamic | share | \
         checks: weak | dynamic | seconds: weak | dynamic | to enforce | gain | widths of these | \
         enforced |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
    for (family, rows) in &families {
        println!("| {family} {}", line(&rows.iter().collect::<Vec<_>>()));
    }
    let all: Vec<&Row> = families.values().flatten().collect();
    println!("| **all** {}", line(&all));
    print!("{}", skipped_table(&skipped));
}

fn line(rows: &[&Row]) -> String {
    let different: Vec<_> = rows.iter().filter(|row| row.is_different).collect();
    let mut line = format!("| {} | {} |", rows.len(), different.len());
    let mut widths = [Rational::ZERO, Rational::ZERO];
    for row in &different {
        for (sum, width) in widths.iter_mut().zip(&row.widths) {
            *sum = &*sum + width;
        }
    }
    let [weak, dynamic] = &widths;
    match weak.reciprocal() {
        Some(inverse) => {
            let share = (dynamic * inverse * Rational::from(100)).to_decimal(1);
            let (weak, dynamic) = (weak.to_decimal(1), dynamic.to_decimal(1));
            let _ = write!(line, " {weak} | {dynamic} | {share} % |");
        }
        None => line.push_str(" | | |"),
    }
    for guarantee in 0..2 {
        let checks: usize = rows.iter().map(|row| row.checks[guarantee]).sum();
        let _ = write!(line, " {checks} |");
    }
    for guarantee in 0..2 {
        let time: Duration = rows.iter().map(|row| row.times[guarantee]).sum();
        let _ = write!(line, " {:.3} |", time.as_secs_f64());
    }
    let enforced: Vec<_> = rows
        .iter()
        .filter_map(|row| row.enforced.as_ref())
        .collect();
    let gain: Vec<_> = enforced
        .iter()
        .filter(|[without, with]| without < with)
        .collect();
    let sum = |which: usize| {
        let widths = gain.iter().map(|widths| &widths[which]);
        widths.fold(Rational::ZERO, |sum, width| &sum + width)
    };
    let [without, with] = [sum(0), sum(1)].map(|sum| sum.to_decimal(1));
    let _ = write!(
        line,
        " {} | {} | {without} | {with} |",
        enforced.len(),
        gain.len()
    );
    line
}

fn row(source: &Source, options: &Options) -> Result<Row, String> {
    let subject = Subject::of_source(source, &options.planning)?;
    let open = pipeline::open(&subject.task, subject.freed.clone(), &[]);
    let open = Arc::new(open.map_err(|_| "durations cannot be left open")?);
    let (weak, weak_time) = timed(&subject, &open, Guarantee::Weak, options)?;
    let (dynamic, dynamic_time) = timed(&subject, &open, Guarantee::Dynamic, options)?;
    if !weak.is_finished || !dynamic.is_finished {
        return Err("a box that was still growing when the time was up".to_owned());
    }
    let enforced = match elbowroom::envelope::with_obligations(&subject.task, &open) {
        Ok((plan, count)) if count > 0 => {
            let plan = Arc::new(plan);
            let (with, _) = timed(&subject, &plan, Guarantee::Dynamic, options)?;
            Some([&dynamic, &with].map(|own| width(&own.envelope, &open)))
        }
        _ => None,
    };
    Ok(Row {
        enforced,
        is_different: weak.envelope != dynamic.envelope,
        widths: [&weak, &dynamic].map(|own| width(&own.envelope, &open)),
        checks: [weak.checks, dynamic.checks],
        times: [weak_time, dynamic_time],
    })
}

#[allow(clippy::disallowed_methods, reason = "it is about time")]
fn timed(
    subject: &Subject,
    plan: &Arc<ParametrizedPlan>,
    guarantee: Guarantee,
    options: &Options,
) -> Result<(Boxed, Duration), String> {
    let begin = Instant::now();
    let may_continue = || begin.elapsed() < options.time_per_box;
    let search = Search {
        most_checks: usize::MAX,
        may_continue: &may_continue,
    };
    let boxed = boxed(&subject.task, plan, guarantee, search)?;
    Ok((boxed, begin.elapsed()))
}

/// Returns the sum of the widths, with upper ends cut at ten times the nominal value.
fn width(envelope: &DecoupledEnvelope, plan: &ParametrizedPlan) -> Rational {
    let mut sum = Rational::ZERO;
    for (interval, parameter) in envelope.intervals().iter().zip(&plan.parameters) {
        let lower = interval.lower.value().cloned().unwrap_or_default();
        let most = &parameter.nominal * Rational::from(10);
        let upper = interval.upper.value().min(Some(&most));
        let upper = upper.unwrap_or(&most).max(&lower).clone();
        sum = &sum + (upper - lower);
    }
    sum
}
