//! Most probable controllable boxes of networks that are not dynamically controllable.

use elbowroom::network::{
    Answer, ControllableBox, NetworkFile, Request, Simulation, analyze, read,
};
use elbowroom::num::Rational;
use elbowroom::stn::uncertain::{ContingentLink, UncertainNetwork};
use elbowroom::stn::{Constraint, Network, NodeId};
use proptest::prelude::*;

fn analyzed(file: &NetworkFile, runs: u64) -> Answer {
    let request = Request {
        is_box_requested: true,
        simulation: (runs > 0).then_some(Simulation { runs, seed: 4 }),
        ..Request::default()
    };
    analyze(file, &request).expect("durations can be drawn")
}

fn file(requirements: &str, links: &str, correlations: &str) -> NetworkFile {
    let text = format!(
        r#"{{ "format": "elbowroom-network", "version": 1,
             "points": ["A", "C", "B", "D"], "requirements": [{requirements}],
             "links": [{links}] {correlations} }}"#
    );
    read("f", text.as_bytes()).expect("a network")
}

/// Returns a link with a normal duration.
fn normal(activation: &str, end: &str, mean: i64, deviation: i64) -> String {
    format!(
        r#"{{ "activation": "{activation}", "end": "{end}", "lower": 0, "upper": "inf",
             "duration": {{ "normal": {{ "mean": {mean}, "deviation": {deviation} }} }} }}"#
    )
}

const DEADLINE: &str = r#"{ "from": "A", "to": "D", "upper": 22 },
                          { "from": "C", "to": "B", "lower": 0 }"#;

#[test]
fn risk_is_allotted_to_two_links_under_a_deadline() {
    let links = [normal("A", "C", 10, 1), normal("B", "D", 10, 1)].join(",");
    let best = analyzed(&file(DEADLINE, &links, ""), 0)
        .best
        .expect("a box");
    // By symmetry each link ends one deviation late at most: 0.8413.
    for link in &best.links {
        assert!((link.probability - 0.8413).abs() < 1e-4, "{link:?}");
    }
    assert!((best.given - 0.8413 * 0.8413).abs() < 1e-3);
    assert!((best.least - (1.0 - 2.0 * 0.1587)).abs() < 1e-3);
}

#[test]
fn precise_link_receives_less_risk_than_its_share() {
    let links = [normal("A", "C", 10, 1), normal("B", "D", 10, 3)].join(",");
    let requirements = DEADLINE.replace("22", "28");
    let best = analyzed(&file(&requirements, &links, ""), 0)
        .best
        .expect("a box");
    // Ends at equal relative densities have the greatest product; checked on a fine grid.
    let normal_cdf = |z: f64| {
        let steps = 4000;
        let width = (z + 10.0) / f64::from(steps);
        let sum: f64 = (0..steps)
            .map(|step| -10.0 + (f64::from(step) + 0.5) * width)
            .map(|at| (-at * at / 2.0).exp())
            .sum();
        sum * width / (2.0 * std::f64::consts::PI).sqrt()
    };
    let grid = (0..800).map(|step| f64::from(step) / 100.0);
    let products = grid.map(|first| normal_cdf(first) * normal_cdf((8.0 - first) / 3.0));
    let greatest = products.fold(0.0, f64::max);
    assert!(
        (best.given - greatest).abs() < 1e-4,
        "{} and {greatest}",
        best.given
    );
}

#[test]
fn correlated_group_is_bounded_without_independence() {
    let links = [normal("A", "C", 10, 1), normal("B", "D", 10, 1)].join(",");
    let group = r#", "correlations": [{ "ends": ["C", "D"], "matrix": [[1, "0.5"], ["0.5", 1]] }]"#;
    let best = analyzed(&file(DEADLINE, &links, group), 0)
        .best
        .expect("a box");
    assert!((best.given - best.least).abs() < 1e-9);
}

#[test]
fn impossible_deadline_leaves_no_box() {
    let requirements = r#"{ "from": "A", "to": "C", "upper": -1 }"#;
    let answer = analyzed(&file(requirements, &normal("A", "C", 10, 1), ""), 10);
    assert_eq!(answer.best, None);
    assert_eq!(answer.simulation.expect("runs").successes, 0);
}

#[test]
fn link_without_distribution_and_bound_keeps_its_interval() {
    let links = r#"{ "activation": "A", "end": "C", "lower": 1, "upper": "inf" }"#;
    let requirements = r#"{ "from": "A", "to": "C", "upper": 5 }"#;
    assert_eq!(analyzed(&file(requirements, links, ""), 0).best, None);
}

#[test]
fn fixed_action_between_random_ones_keeps_its_duration() {
    // B is at least 0 after C, and D exactly 5 after B. With ordinary windows, D would be awaited
    // from B on, and B from D backwards.
    let requirements = r#"{ "from": "B", "to": "D", "lower": 5, "upper": 5 },
                          { "from": "C", "to": "D", "lower": 6 },
                          { "from": "A", "to": "D", "upper": 18 }"#;
    let answer = analyzed(&file(requirements, &normal("A", "C", 10, 1), ""), 200);
    let runs = answer.simulation.expect("runs");
    assert_eq!(runs.executor, "best-box");
    let best = answer.best.expect("a box");
    assert!((best.given - 0.97725).abs() < 1e-4, "{}", best.given);
    assert!(runs.share > 0.93, "{}", runs.share);
}

/// Returns the probability of the most probable controllable box with whole ends.
fn by_exhaustion(file: &NetworkFile) -> f64 {
    fn search(network: &UncertainNetwork<Rational>, at: usize, done: &[ContingentLink]) -> f64 {
        let Some(link) = network.links().get(at) else {
            let boxed = UncertainNetwork::new(network.requirements().clone(), done.to_vec());
            let is_controllable = boxed.expect("a network").is_dynamically_controllable();
            return f64::from(u8::from(is_controllable));
        };
        let upper = link.upper.clone().expect("an upper bound");
        let width = (&upper - &link.lower).to_f64();
        let ends: Vec<Rational> = (0..=8)
            .map(|step| &link.lower + Rational::from(step))
            .filter(|end| *end <= upper)
            .collect();
        let mut greatest: f64 = 0.0;
        for lower in &ends {
            for upper in ends.iter().filter(|upper| *upper > lower || width == 0.0) {
                let mut done = done.to_vec();
                done.push(ContingentLink {
                    lower: lower.clone(),
                    upper: Some(upper.clone()),
                    ..link.clone()
                });
                let share = if width > 0.0 {
                    (upper - lower).to_f64() / width
                } else {
                    1.0
                };
                greatest = greatest.max(share * search(network, at + 1, &done));
            }
        }
        greatest
    }
    search(&file.network, 0, &[])
}

fn arbitrary_networks() -> impl Strategy<Value = NetworkFile> {
    let point = 0..5_u32;
    let edges = prop::collection::vec((point.clone(), point, -4..10_i64), 1..9);
    let links = prop::collection::vec((0..5_u32, 0..4_i64, 0..7_i64), 1..3);
    (edges, links).prop_map(|(edges, links)| {
        let mut requirements = Network::with_nodes(5);
        for (from, to, bound) in edges {
            let bound = Rational::from(bound);
            requirements.add(Constraint::at_most(NodeId(from), NodeId(to), bound));
        }
        let links = (1..)
            .zip(links)
            .map(|(end, (begin, lower, width))| ContingentLink {
                activation: NodeId(begin % end),
                end: NodeId(end),
                lower: Rational::from(lower),
                upper: Some(Rational::from(lower + width)),
            });
        let text = "# KIND OF NETWORK\nSTNU\n# Time-Point Names\na b c d e\n# Ordinary Edges\n\
                    # Contingent Links\n";
        let mut file = read("network", text.as_bytes()).expect("a network");
        file.network = UncertainNetwork::new(requirements, links.collect()).expect("sound links");
        file.durations = vec![None; file.network.links().len()];
        file
    })
}

/// Returns `true` if the network is controllable in the box.
fn is_controllable_in(file: &NetworkFile, best: &ControllableBox) -> bool {
    let mut links = file.network.links().to_vec();
    for (link, interval) in links.iter_mut().zip(&best.links) {
        link.lower = interval.lower.exact.parse().expect("a number");
        link.upper = interval.upper.exact.parse().ok();
    }
    let boxed = UncertainNetwork::new(file.network.requirements().clone(), links);
    boxed.expect("a network").is_dynamically_controllable()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    /// The box is controllable, is at least as probable as all boxes with whole ends, and its
    /// probability bounds the share of successful runs.
    #[test]
    fn box_is_at_least_as_probable_as_exhaustive_search(file in arbitrary_networks()) {
        let answer = analyzed(&file, 200);
        let Some(best) = &answer.best else {
            if !answer.is_executable() && answer.consistent.verdict == elbowroom::network::Verdict::Yes {
                let greatest = by_exhaustion(&file);
                prop_assert!(greatest < 1e-9, "no box, but {}", greatest);
            }
            return Ok(());
        };
        prop_assert!(is_controllable_in(&file, best));
        let greatest = by_exhaustion(&file);
        prop_assert!(best.given > greatest - 2e-3, "{} but {}", best.given, greatest);
        let runs = answer.simulation.expect("runs");
        // Five standard deviations of 200 runs.
        let error = 5.0 * (best.given * (1.0 - best.given) / 200.0).sqrt();
        prop_assert!(runs.share > best.given - error - 1e-3, "{} but {}", runs.share, best.given);
    }
}
