//! Conversion of results to Markdown.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

use crate::row::{self, Row};

/// Runs `table FILE.csv [--first]`.
pub(crate) fn main(arguments: &[String]) -> Result<(), String> {
    let (path, has_scores) = match arguments {
        [path] => (path, true),
        [path, option] if option == "--first" => (path, false),
        _ => return Err("table FILE.csv [--first]".to_owned()),
    };
    print!("{}", table(&row::read(Path::new(path))?, has_scores));
    Ok(())
}

/// Results by instance and planner. Only instances with a run of every planner count, so that all
/// are measured on the same.
struct Results<'a> {
    planners: Vec<&'a str>,
    /// By domain, in order; then by instance; then by planner.
    domains: BTreeMap<&'a str, BTreeMap<&'a str, BTreeMap<&'a str, &'a Row>>>,
}

impl<'a> Results<'a> {
    fn of(rows: &'a [Row]) -> Self {
        let mut planners: Vec<&str> = Vec::new();
        let mut domains: BTreeMap<&str, BTreeMap<&str, BTreeMap<&str, &Row>>> = BTreeMap::new();
        for row in rows.iter().filter(|row| row.outcome != "not read") {
            if !planners.contains(&row.planner.as_str()) {
                planners.push(&row.planner);
            }
            let instances = domains.entry(&row.domain).or_default();
            let runs = instances.entry(&row.instance).or_default();
            runs.insert(&row.planner, row);
        }
        for instances in domains.values_mut() {
            instances.retain(|_, runs| runs.len() == planners.len());
        }
        domains.retain(|_, instances| !instances.is_empty());
        Self { planners, domains }
    }

    /// Returns the instances with a row for which `keep` holds.
    fn instances(&self, keep: impl Fn(&Row) -> bool) -> Vec<&BTreeMap<&'a str, &'a Row>> {
        let all = self.domains.values().flat_map(BTreeMap::values);
        all.filter(|runs| runs.values().any(|row| keep(row)))
            .collect()
    }
}

fn table(rows: &[Row], has_scores: bool) -> String {
    let results = Results::of(rows);
    let mut text = String::from("| domain | instances |");
    for planner in &results.planners {
        let _ = write!(text, " {planner}: solved | first plan |");
        if has_scores {
            text.push_str(" score |");
        }
    }
    text.push_str("\n|---|--:|");
    let columns = if has_scores {
        "--:|--:|--:|"
    } else {
        "--:|--:|"
    };
    text.push_str(&columns.repeat(results.planners.len()));
    text.push('\n');
    for (domain, instances) in &results.domains {
        let runs: Vec<_> = instances.values().collect();
        text.push_str(&line(domain, &results.planners, &runs, has_scores));
    }
    for (title, kind) in [
        ("**with deadlines**", Some("deadlines")),
        ("**with numbers**", Some("numbers")),
        ("**with required concurrency**", Some("concurrency")),
        ("**any of these**", Some("")),
        ("**all**", None),
    ] {
        let runs = results.instances(|row| match kind {
            None => true,
            Some("") => !row.kinds.is_empty(),
            Some(kind) => row.kinds.split(' ').any(|own| own == kind),
        });
        if !runs.is_empty() {
            text.push_str(&line(title, &results.planners, &runs, has_scores));
        }
    }
    text.push_str(
        "\nSolved: instances with a plan that the validator accepts. First plan: the median of the \
         seconds to it,\nprocess start included.",
    );
    if has_scores {
        text.push_str(
            " Score: the sum, over the instances it solved, of the best value of the metric\n(the \
             makespan without one) that any planner in the table found, divided by its own, or the \
             inverse\nif greater is better.",
        );
    }
    text.push_str("\n\n");
    text.push_str(&outcomes(&results));
    text.push_str(&contradictions(&results));
    text
}

fn line(
    title: &str,
    planners: &[&str],
    instances: &[&BTreeMap<&str, &Row>],
    has_scores: bool,
) -> String {
    let mut text = format!("| {title} | {} |", instances.len());
    for planner in planners {
        let solved: Vec<(&Row, f64)> = instances
            .iter()
            .filter(|runs| runs[planner].is_solved())
            .map(|runs| (runs[planner], score(runs, planner)))
            .collect();
        let mut firsts: Vec<f64> = solved
            .iter()
            .filter_map(|(row, _)| row.first_seconds.parse().ok())
            .collect();
        firsts.sort_by(f64::total_cmp);
        let median = firsts.get(firsts.len() / 2);
        let median = median.map_or_else(String::new, |seconds| format!("{seconds:.2}"));
        let _ = write!(text, " {} | {median} |", solved.len());
        if has_scores {
            // An empty sum of floats is -0.
            let scores = solved.iter().fold(0.0, |sum, (_, score)| sum + score);
            let _ = write!(text, " {scores:.1} |");
        }
    }
    text.push('\n');
    text
}

/// Returns the score of the planning competitions: the best value of all planners, divided by this
/// one's (the inverse if more is better). The value is that of the problem's metric, or the
/// makespan without one.
fn score(runs: &BTreeMap<&str, &Row>, planner: &str) -> f64 {
    let row = runs[planner];
    let by_metric = !row.better.is_empty();
    let value = |row: &Row| {
        let text = if by_metric {
            &row.best_metric
        } else {
            &row.best_makespan
        };
        text.parse::<f64>().ok()
    };
    let values = runs.values().filter_map(|row| value(row));
    let more = row.better == "more";
    let best = values.reduce(if more { f64::max } else { f64::min });
    match (best, value(row)) {
        (Some(best), Some(own)) if best.total_cmp(&own).is_eq() => 1.0,
        // Among negative values, the better one has the larger absolute value if less is better.
        (Some(best), Some(own)) if best * own > 0.0 => {
            if more == (best > 0.0) {
                own / best
            } else {
                best / own
            }
        }
        _ => 0.0,
    }
}

/// Returns the table of outcomes of each planner.
fn outcomes(results: &Results<'_>) -> String {
    let all = results.instances(|_| true);
    let names: BTreeSet<&str> = all
        .iter()
        .flat_map(|runs| runs.values().map(|row| row.outcome.as_str()))
        .collect();
    let mut text = String::from("| outcome |");
    for planner in &results.planners {
        let _ = write!(text, " {planner} |");
    }
    text.push_str("\n|---|");
    text.push_str(&"--:|".repeat(results.planners.len()));
    text.push('\n');
    let mut count_line = |title: &str, counts: &dyn Fn(&Row) -> usize| {
        let _ = write!(text, "| {title} |");
        for planner in &results.planners {
            let count: usize = all.iter().map(|runs| counts(runs[planner])).sum();
            let _ = write!(text, " {count} |");
        }
        text.push('\n');
    };
    for name in names {
        count_line(name, &|row| usize::from(row.outcome == name));
    }
    count_line("plans rejected by the validator", &|row| {
        row.refused.parse().unwrap_or(0)
    });
    count_line("plans whose times were repaired", &|row| {
        usize::from(row.repaired == "yes")
    });
    for word in ["valid", "failed", "error"] {
        count_line(&format!("last plan, by VAL: {word}"), &|row| {
            usize::from(row.val == word)
        });
    }
    text
}

/// Lists the instances that one planner solves although another reports that there is no plan.
fn contradictions(results: &Results<'_>) -> String {
    let mut text = String::new();
    for (domain, instances) in &results.domains {
        for (instance, runs) in instances {
            let says_no = runs.values().filter(|row| row.outcome == "unsolvable");
            let is_solved = runs.values().any(|row| row.is_solved());
            for row in says_no.filter(|_| is_solved) {
                let _ = writeln!(
                    text,
                    "- {} reports that {domain} {instance} has no plan, but another planner found \
                     one",
                    row.planner
                );
            }
        }
    }
    if text.is_empty() {
        "\nNo planner reported an instance as unsolvable that another one solved.\n".to_owned()
    } else {
        format!("\n{text}")
    }
}
