//! Time of one event in a plan with 10,000 time points: processing the event, updating the windows,
//! and deciding. The plan is that of [`robots`].

mod robots;

use divan::Bencher;
use divan::counter::ItemsCount;
use robots::{Events, mission, ready};

fn main() {
    divan::main();
}

/// Number of actions that end in one sample.
const EVENTS: usize = 200;

#[divan::bench(args = [1_000, 10_000, 100_000])]
fn stn(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "stn", nodes);
}

/// All durations are left open.
#[divan::bench(args = [1_000, 10_000, 100_000])]
fn guarded(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "guarded", nodes);
}

/// All durations are left open.
#[divan::bench(args = [1_000, 10_000, 100_000])]
fn live(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "live", nodes);
}

#[divan::bench(args = [1_000, 10_000, 100_000])]
fn fixed(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "fixed:60", nodes);
}

/// The plan contains only orderings.
#[divan::bench(args = [1_000, 10_000, 100_000])]
fn esterel(bencher: Bencher<'_, '_>, nodes: usize) {
    events(bencher, "esterel", nodes);
}

fn events(bencher: Bencher<'_, '_>, executor: &str, nodes: usize) {
    let mission = mission(nodes / 2, matches!(executor, "guarded" | "live"));
    bencher
        .counter(ItemsCount::new(EVENTS))
        .with_inputs(|| (ready(executor, &mission), Events::new(&mission)))
        .bench_local_values(|(mut executor, mut events)| {
            for _ in 0..EVENTS {
                events.next(executor.as_mut());
            }
            // They are returned so that dropping them does not count.
            (executor, events)
        });
}
