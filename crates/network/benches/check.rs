//! Benchmark of the checks of a network. `cargo bench -p elbowroom-network`

#![allow(
    clippy::print_stdout,
    reason = "a benchmark says what it measures, or that it is skipped"
)]

use std::path::Path;

use divan::Bencher;
use elbowroom_network::{NetworkFile, read, weak, write_json};
use elbowroom_num::Rational;
use elbowroom_stn::uncertain::UncertainNetwork;
use elbowroom_stn::{Constraint, NodeId};

fn main() {
    divan::main();
}

/// Returns a network of `jobs` parallel jobs, each a chain of `tasks` contingent links, with
/// deadlines and hand-overs between neighbours. It has 2 · jobs · tasks + 1 points.
fn network(jobs: usize, tasks: usize, slack: i64) -> NetworkFile {
    let mut points = vec!["\"start\"".to_owned()];
    let mut requirements = Vec::new();
    let mut links = Vec::new();
    let mut requirement = |from: &str, to: &str, lower: i64, upper: i64| {
        requirements.push(format!(
            "{{\"from\": \"{from}\", \"to\": \"{to}\", \"lower\": {lower}, \"upper\": {upper}}}"
        ));
    };
    for job in 0..jobs {
        let mut before = "start".to_owned();
        for task in 0..tasks {
            let (begin, end) = (format!("b{job}.{task}"), format!("e{job}.{task}"));
            points.push(format!("\"{begin}\""));
            points.push(format!("\"{end}\""));
            requirement(&before, &begin, 0, 40 + slack);
            let lower = 3 + (job * 7 + task * 5) % 11;
            links.push(format!(
                "{{\"activation\": \"{begin}\", \"end\": \"{end}\", \"lower\": {lower}, \
                 \"upper\": {}}}",
                lower + 2 + task % 5
            ));
            if job > 0 {
                // A hand-over: the neighbour begins this task at about the same time.
                requirement(
                    &format!("e{}.{task}", job - 1),
                    &begin,
                    -60 - slack,
                    60 + slack,
                );
            }
            before = end;
        }
        let total = 40 * i64::try_from(tasks).expect("few tasks");
        requirement("start", &before, 0, total + slack);
    }
    let text = format!(
        "{{\"format\": \"elbowroom-network\", \"version\": 1, \"points\": [{}], \
         \"requirements\": [{}], \"links\": [{}]}}",
        points.join(", "),
        requirements.join(", "),
        links.join(", ")
    );
    read("network", text.as_bytes()).expect("a network")
}

/// Jobs and tasks: 101, 201 and 501 points.
const SIZES: [(usize, usize); 3] = [(5, 10), (10, 10), (25, 10)];

#[divan::bench(args = SIZES)]
fn dynamically_controllable(bencher: Bencher, (jobs, tasks): (usize, usize)) {
    let file = network(jobs, tasks, 20);
    assert!(file.network.is_dynamically_controllable());
    bencher.bench_local(|| file.network.dispatchable().is_ok());
}

#[divan::bench(args = SIZES)]
fn not_dynamically_controllable(bencher: Bencher, (jobs, tasks): (usize, usize)) {
    let mut file = network(jobs, tasks, 20);
    // The last end must come at a fixed time.
    let begin = file
        .points
        .iter()
        .position(|point| point == "b0.0")
        .expect("a task");
    let end = file
        .points
        .iter()
        .position(|point| point == "e0.1")
        .expect("a task");
    let node = |index| NodeId(u32::try_from(index).expect("few points"));
    let mut requirements = file.network.requirements().clone();
    let fixed = Rational::from(30);
    requirements.add(Constraint::at_most(node(begin), node(end), fixed.clone()));
    requirements.add(Constraint::at_least(node(begin), node(end), fixed));
    let links = file.network.links().to_vec();
    file.network = UncertainNetwork::new(requirements, links).expect("sound");
    assert!(!file.network.is_dynamically_controllable());
    bencher.bench_local(|| file.network.dispatchable().is_err());
}

#[divan::bench(args = SIZES)]
fn strongly_controllable(bencher: Bencher, (jobs, tasks): (usize, usize)) {
    let file = network(jobs, tasks, 20);
    bencher.bench_local(|| file.network.strong().is_ok());
}

#[divan::bench(args = SIZES)]
fn weakly_controllable(bencher: Bencher, (jobs, tasks): (usize, usize)) {
    let file = network(jobs, tasks, 20);
    bencher.bench_local(|| weak(&file.network, 1000));
}

#[divan::bench(args = SIZES)]
fn reading(bencher: Bencher, (jobs, tasks): (usize, usize)) {
    let text = write_json(&network(jobs, tasks, 20));
    bencher.bench_local(|| read("network", text.as_bytes()).is_ok());
}

/// Benchmarks the networks with published verdicts, if they are available: those of about 100
/// points, and all.
#[divan::bench(args = ["about 100 points", "all"], sample_count = 20, sample_size = 1)]
fn published(bencher: Bencher, which: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/stn");
    let labels = std::fs::read_to_string(folder.join("labels.csv")).unwrap_or_default();
    let mut files = Vec::new();
    for line in labels.lines().skip(1) {
        let name = line.split(',').next().unwrap_or_default();
        let bytes = std::fs::read(folder.join(name)).expect("a published network");
        let file = read(name, &bytes).expect("a published network");
        if which == "all" || (90..=110).contains(&file.points.len()) {
            files.push(file);
        }
    }
    println!("{} networks: {which}", files.len());
    bencher.bench_local(|| {
        let verdicts = files.iter().map(|file| file.network.dispatchable().is_ok());
        verdicts.filter(|&is_controllable| is_controllable).count()
    });
}
