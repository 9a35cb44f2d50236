//! Latency of single events: median, 99th percentile and maximum over all events of a plan (the
//! first 20,000 of long plans), for each executor with a network. The plan is that of [`robots`].
//!
//! ```text
//! cargo bench -p elbowroom-execution --bench latency
//! ```

#![allow(clippy::print_stdout, reason = "the table is what it is for")]
#![allow(clippy::disallowed_methods, reason = "events are timed")]

mod robots;

use std::time::{Duration, Instant};

use robots::{Events, mission, ready};

const MAX_EVENTS: usize = 20_000;

fn main() {
    // As in the test harness, words are filters on the names.
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<_> = words.iter().filter(|word| !word.starts_with('-')).collect();
    println!("| executor | time points | adopting | median | p99 | worst |");
    println!("|---|---:|---:|---:|---:|---:|");
    for executor in ["stn", "guarded", "live"] {
        if !words.is_empty() && !words.iter().any(|word| executor.contains(word.as_str())) {
            continue;
        }
        for nodes in [1_000, 10_000, 100_000] {
            row(executor, nodes);
        }
    }
}

fn row(executor: &str, nodes: usize) {
    let mission = mission(nodes / 2, executor != "stn");
    let begin = Instant::now();
    let mut decider = ready(executor, &mission);
    let adopting = begin.elapsed();
    let mut events = Events::new(&mission);
    let mut times = Vec::new();
    loop {
        let begin = Instant::now();
        let may_continue = events.next(decider.as_mut());
        times.push(begin.elapsed());
        if !may_continue || times.len() == MAX_EVENTS {
            break;
        }
    }
    times.sort_unstable();
    let at = |share: usize| milliseconds(times[(times.len() - 1) * share / 100]);
    let (median, p99, worst) = (at(50), at(99), at(100));
    let adopting = milliseconds(adopting);
    println!("| `{executor}` | {nodes} | {adopting} | {median} | {p99} | {worst} |");
}

fn milliseconds(time: Duration) -> String {
    format!("{:.4} ms", time.as_secs_f64() * 1000.0)
}
