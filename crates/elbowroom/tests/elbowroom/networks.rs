//! Simple temporal networks: analysis and simulation.

use elbowroom::network::{
    Answer, Durations, NetworkFile, Request, Simulation, Verdict, analyze, read, write_json,
};
use elbowroom::num::Rational;
use elbowroom::stn::uncertain::{ContingentLink, UncertainNetwork};
use elbowroom::stn::{Constraint, Network, NodeId};
use proptest::prelude::*;

/// Returns a network in plain text: points, edges `X 12 C`, links `A 1 3 C`.
fn network(points: &str, edges: &str, links: &str) -> NetworkFile {
    let text = format!(
        "# KIND OF NETWORK\nSTNU\n# Time-Point Names\n{points}\n# Ordinary Edges\n{}\n\
         # Contingent Links\n{}\n",
        edges.replace(", ", "\n"),
        links.replace(", ", "\n"),
    );
    read("network", text.as_bytes()).expect("a network")
}

fn examined(file: &NetworkFile) -> Answer {
    analyze(file, &Request::default()).expect("no runs")
}

/// Returns the verdicts, and the texts of the reasons.
fn answer_text(answer: &Answer) -> String {
    let promises = [
        Some(&answer.consistent),
        answer.weak.as_ref(),
        answer.dynamic.as_ref(),
        answer.strong.as_ref(),
    ];
    let mut lines = Vec::new();
    for promise in promises.into_iter().flatten() {
        lines.push(format!("{:?}", promise.verdict));
        if let Some(reason) = &promise.reason {
            lines.push(format!("  by {}", reason.by.exact));
            // A cycle has no first step.
            let mut steps: Vec<_> = reason.steps.iter().map(|step| &step.words).collect();
            steps.sort_unstable();
            lines.extend(steps.into_iter().map(|words| format!("  {words}")));
            let ends = reason.durations.iter().map(|link| {
                let (from, to, value) = (&link.activation, &link.end, &link.value.exact);
                format!("  at the {} end: {from} to {to}, {value}", link.at)
            });
            let mut ends: Vec<_> = ends.collect();
            ends.sort_unstable();
            lines.extend(ends);
        }
    }
    lines.join("\n")
}

fn simulated(file: &NetworkFile, runs: u64, seed: u64, durations: Durations) -> Answer {
    let request = Request {
        durations,
        simulation: Some(Simulation { runs, seed }),
        ..Request::default()
    };
    analyze(file, &request).expect("durations can be drawn")
}

#[test]
fn contradiction_uses_names_of_the_file() {
    let file = network(
        "start lunch end",
        "start 5 end, end -3 lunch, lunch -3 start",
        "",
    );
    insta::assert_snapshot!(answer_text(&examined(&file)), @r"
    No
      by 1
      end at least 3 after lunch
      end at most 5 after start
      lunch at least 3 after start
    ");
}

#[test]
fn uncontrollable_network_names_points_that_need_foresight() {
    // Filming must begin two to four before the eggs hatch, at an uncontrollable time.
    let file = network(
        "laid hatched film",
        "film 4 hatched, hatched -2 film",
        "laid 3 9 hatched",
    );
    insta::assert_snapshot!(answer_text(&examined(&file)), @r"
    Yes
    Yes
    No
      by 4
      hatched at least 2 after film
      hatched at most 4 after film
      hatched may come as early as 3 after laid
      hatched may come as late as 9 after laid
      at the lower end: laid to hatched, 3
      at the upper end: laid to hatched, 9
    No
      by 4
      hatched at least 2 after film
      hatched at most 4 after film
      hatched may come as early as 3 after laid
      hatched may come as late as 9 after laid
      at the lower end: laid to hatched, 3
      at the upper end: laid to hatched, 9
    ");
}

#[test]
fn durations_without_schedule_are_reported() {
    let file = network("A C D", "D 0 C, A 7 D", "A 3 9 C");
    insta::assert_snapshot!(answer_text(&examined(&file)), @r"
    Yes
    No
      by 2
      C comes 9 after A
      C not after D
      D at most 7 after A
      at the upper end: A to C, 9
    No
      by 2
      C may come as late as 9 after A
      C not after D
      D at most 7 after A
      at the upper end: A to C, 9
    No
      by 2
      C may come as late as 9 after A
      C not after D
      D at most 7 after A
      at the upper end: A to C, 9
    ");
}

#[test]
fn an_end_without_limit_and_a_deadline_contradict_each_other() {
    let text = r#"{ "format": "elbowroom-network", "version": 1, "points": ["A", "C"],
        "requirements": [{"from": "A", "to": "C", "upper": 10}],
        "links": [{"activation": "A", "end": "C", "lower": 1, "upper": "inf",
                   "duration": {"normal": {"mean": 5, "deviation": 1}}}] }"#;
    let file = read("f", text.as_bytes()).expect("a network");
    let answer = simulated(&file, 500, 1, Durations::Given);
    assert!(!answer.is_executable());
    assert_eq!(
        answer.weak.as_ref().map(|weak| weak.verdict),
        Some(Verdict::No)
    );
    let runs = answer.simulation.expect("runs");
    assert_eq!(
        (runs.executor.as_str(), runs.successes),
        ("early-first", 500)
    );
    // There is no uniform distribution between 1 and infinity.
    let request = Request {
        durations: Durations::Uniform,
        simulation: Some(Simulation { runs: 1, seed: 0 }),
        ..Request::default()
    };
    let refused = analyze(&file, &request).expect_err("no upper bound");
    assert_eq!(
        refused.to_string(),
        "the link from `A` to `C` has no upper bound, so its durations cannot be drawn uniformly; \
         draw them from the distributions of the file"
    );
}

#[test]
fn uncontrollable_network_succeeds_in_some_runs() {
    // At 5 at the latest, but it takes 0 to 10: half of the runs.
    let file = network("A C", "A 5 C", "A 0 10 C");
    let runs = simulated(&file, 4000, 3, Durations::Given)
        .simulation
        .expect("runs");
    assert!((runs.share - 0.5).abs() < 0.03, "{}", runs.share);
    assert!(runs.interval[0] < 0.5 && 0.5 < runs.interval[1]);
    assert_eq!(runs.broken[0].requirement, "C at most 5 after A");
    assert_eq!(runs.broken[0].runs + runs.successes, 4000);
}

#[test]
fn runs_depend_on_the_seed() {
    let file = network("A C", "A 5 C", "A 0 10 C");
    let runs = |seed| simulated(&file, 300, seed, Durations::Uniform).simulation;
    assert_eq!(runs(7), runs(7));
    assert_ne!(
        runs(7).map(|runs| runs.successes),
        runs(8).map(|runs| runs.successes)
    );
}

#[test]
fn correlated_durations_vary_together() {
    let links = |correlations: &str| {
        let text = format!(
            r#"{{ "format": "elbowroom-network", "version": 1, "points": ["A", "C", "B", "D"],
            "requirements": [{{"from": "A", "to": "B", "upper": 0, "lower": 0}},
                             {{"from": "C", "to": "D", "upper": 1, "lower": -1}}],
            "links": [
              {{"activation": "A", "end": "C", "lower": 0, "upper": "inf",
                "duration": {{"normal": {{"mean": 50, "deviation": 5}}}}}},
              {{"activation": "B", "end": "D", "lower": 0, "upper": "inf",
                "duration": {{"normal": {{"mean": 50, "deviation": 5}}}}}}]{correlations} }}"#
        );
        let file = read("f", text.as_bytes()).expect("a network");
        let runs = simulated(&file, 2000, 5, Durations::Given).simulation;
        runs.expect("runs").share
    };
    // The difference of two independent ones has the standard deviation 7.07: it lies within 1 in
    // 11.2 %.
    assert!((links("") - 0.112).abs() < 0.03);
    // With a correlation of 0.99 it has 0.707: 84.3 %.
    let correlated =
        links(r#", "correlations": [{"ends": ["C", "D"], "matrix": [[1, "0.99"], ["0.99", 1]]}]"#);
    assert!((correlated - 0.843).abs() < 0.03, "{correlated}");
}

#[test]
fn answers_round_trip() {
    let file = network("A C D", "C 0 D, A 7 D", "A 3 9 C");
    let answer = simulated(&file, 20, 0, Durations::Given);
    let text = serde_json::to_string(&answer).expect("JSON");
    let again: Answer = serde_json::from_str(&text).expect("an answer");
    assert_eq!(again, answer);
}

fn arbitrary_networks() -> impl Strategy<Value = NetworkFile> {
    let point = 0..8_u32;
    let edges = prop::collection::vec((point.clone(), point, -4..16_i64), 0..12);
    let links = prop::collection::vec((0..8_u32, 0..4_i64, 0..8_i64), 1..5);
    (edges, links).prop_map(|(edges, links)| {
        let mut requirements = Network::with_nodes(8);
        for (from, to, bound) in edges {
            let bound = Rational::from(bound);
            requirements.add(Constraint::at_most(NodeId(from), NodeId(to), bound));
        }
        let links = links
            .into_iter()
            .enumerate()
            .map(|(index, (begin, lower, width))| {
                let end = u32::try_from(index).expect("few links") + 1;
                ContingentLink {
                    activation: NodeId(begin % end),
                    end: NodeId(end),
                    lower: Rational::from(lower),
                    upper: Some(Rational::from(lower + width)),
                }
            });
        let mut file = network("a b c d e f g h", "", "");
        file.network = UncertainNetwork::new(requirements, links.collect()).expect("sound links");
        file.durations = vec![None; file.network.links().len()];
        file
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Promises imply each other, each promise is kept in every run, and the dispatchable form of a
    /// network is equivalent to it.
    #[test]
    fn controllable_network_never_fails(file in arbitrary_networks(), seed in 0..1000_u64) {
        let answer = simulated(&file, 20, seed, Durations::Uniform);
        let is = |promise: &Option<_>| {
            promise.as_ref().map(|promise: &elbowroom::network::ControllabilityCheck| promise.verdict)
                == Some(Verdict::Yes)
        };
        let (weak, dynamic, strong) = (is(&answer.weak), is(&answer.dynamic), is(&answer.strong));
        prop_assert!(!strong || dynamic);
        prop_assert!(!dynamic || weak);
        prop_assert!(!weak || answer.consistent.verdict == Verdict::Yes);
        let runs = answer.simulation.expect("runs");
        prop_assert_eq!(runs.outside, 0);
        if dynamic {
            prop_assert_eq!(runs.successes, runs.runs, "{:?}", runs.broken);
            let form = file.network.dispatchable().expect("just found");
            let text = write_json(&file.dispatchable(&form));
            let again = read("again", text.as_bytes()).expect("what was written");
            prop_assert!(again.network.is_dynamically_controllable());
        }
        for promise in [answer.weak, answer.dynamic, answer.strong].into_iter().flatten() {
            prop_assert_eq!(promise.verdict == Verdict::No, promise.reason.is_some());
        }
    }
}
