//! Experiments have the same result for any number of threads, and parts add up.

use elbowroom_laboratory::compare::{Experiment, run};
use elbowroom_laboratory::results::Results;
use elbowroom_laboratory::trials::Part;
use elbowroom_num::Rational;

/// Reads a file of the project, by its path from the root.
fn read(path: &str) -> String {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    std::fs::read_to_string(root.join(path)).expect("a correct test")
}

fn experiment() -> Experiment {
    let text = read("experiments/table1.toml");
    let file = |name: &str| Ok(read(&format!("experiments/{name}")));
    let mut experiment = Experiment::read(&text, &file).expect("a correct test");
    for values in experiment.blanks.values_mut() {
        *values = vec![values[4].clone()];
    }
    experiment.columns.truncate(2);
    experiment
}

const WHOLE: Part = Part {
    trials: 6,
    shard: 0,
    shards: 1,
    jobs: 1,
};

#[test]
fn results_are_independent_of_threads_and_parts() {
    let experiment = experiment();
    let make = |part| run(&experiment, part, &|_| true).expect("a correct test");
    let whole = make(WHOLE);
    assert_eq!(whole, make(Part { jobs: 3, ..WHOLE }));
    // More threads than trials: the planner has the rest.
    let one = Part { trials: 1, ..WHOLE };
    assert_eq!(make(one), make(Part { jobs: 7, ..one }));
    let parts = [0, 1, 2].map(|shard| {
        make(Part {
            shard,
            shards: 3,
            ..WHOLE
        })
    });
    assert_eq!(
        Results::merge_results(&parts).expect("a correct test"),
        whole
    );
    assert!(Results::merge_results(&[parts[0].clone(), parts[0].clone()]).is_err());
    let text = whole.json().to_string();
    assert_eq!(Results::read(&text).expect("a correct test"), whole);
}

#[test]
fn errors_in_experiments_name_their_line() {
    let text = read("experiments/table1.toml");
    let file = |name: &str| Ok(read(&format!("experiments/{name}")));
    let broken = text.replace("\"fixed:10\"", "\"fixed:ten\"");
    let error = Experiment::read(&broken, &file).unwrap_err().to_string();
    let line = 1 + text[..text.find("fixed:10").expect("a correct test")]
        .matches('\n')
        .count();
    assert!(error.starts_with(&format!("text:{line}:")), "{error}");
}

/// Returns `clumsy.toml` with few trials.
fn clumsy_experiment(change: &dyn Fn(&str) -> String) -> Result<Experiment, String> {
    let file = |name: &str| Ok(read(&format!("experiments/{name}")));
    let text = change(&read("experiments/clumsy.toml"));
    Experiment::read(&text, &file).map_err(|error| error.to_string())
}

/// Three starts in ten fail, which executors can only know from the likelihoods.
#[test]
fn column_specifies_likelihoods() {
    let told = clumsy_experiment(&str::to_owned).expect("a correct test");
    let untold = clumsy_experiment(&|text| {
        let lines = text.lines();
        let kept = lines.filter(|line| !line.starts_with("likelihoods"));
        kept.collect::<Vec<_>>().join("\n")
    });
    let untold = untold.expect("a correct test");
    let part = Part {
        trials: 60,
        ..WHOLE
    };
    // The optimum takes minutes, and is not tested here.
    let make = |experiment| {
        let experiment = Experiment {
            optimum: false,
            clairvoyant: false,
            ..experiment
        };
        run(&experiment, part, &|_| true).expect("a correct test")
    };
    let (told, untold) = (make(told), make(untold));
    let row = |name: &str| told.counts.rows.iter().position(|row| row == name).unwrap();
    let (adaptable, failing) = (row("adaptable"), 1);
    // With likelihoods, it retries failed starts. Without them, starts are certain, and a failure
    // is a reason to replan.
    assert_eq!(told.counts.cells[adaptable][failing].replans, 0);
    assert!(untold.counts.cells[adaptable][failing].replans > 30);
    for other in ["esterel", "stn", "guarded", "live"].map(row) {
        assert_eq!(
            told.counts.cells[other], untold.counts.cells[other],
            "{}",
            told.counts.rows[other]
        );
    }
}

#[test]
fn errors_about_likelihoods_name_their_position() {
    let text = read("experiments/clumsy.toml");
    let line = 1 + text[..text
        .find("clumsy/starts-fail.toml")
        .expect("a correct test")]
        .matches('\n')
        .count();
    let file = |name: &str| match name {
        "clumsy/starts-fail.toml" => Err("cannot read it".to_owned()),
        name => Ok(read(&format!("experiments/{name}"))),
    };
    let error = Experiment::read(&text, &file).unwrap_err().to_string();
    assert!(error.starts_with(&format!("text:{line}:")), "{error}");
    assert!(error.ends_with(": error: cannot read it"), "{error}");
    let file = |name: &str| {
        let text = read(&format!("experiments/{name}"));
        Ok(text.replace("facts.unlocked", "facts.unlokced"))
    };
    let experiment = Experiment::read(&text, &file).expect("a correct test");
    let error = run(&experiment, WHOLE, &|_| true).unwrap_err().to_string();
    assert!(
        error.contains("likelihoods of and the door locks:11:"),
        "{error}"
    );
    assert!(error.contains("unlokced"), "{error}");
}

/// Stored results contain the fingerprint, so it must not change with the program.
#[test]
fn fingerprint_depends_on_content_and_is_stable() {
    let made = |change: &dyn Fn(&mut Experiment)| {
        let mut experiment = experiment();
        change(&mut experiment);
        let stopped = run(&experiment, WHOLE, &|_| false);
        stopped.expect("a correct test").origin.fingerprint
    };
    let same = made(&|_| {});
    assert_eq!(same, made(&|experiment| experiment.title.clear()));
    assert_eq!(same, made(&|experiment| experiment.published.clear()));
    let others = [
        made(&|experiment| experiment.seed += 1),
        made(&|experiment| experiment.domain.push(' ')),
        made(&|experiment| experiment.executors.reverse()),
        made(&|experiment| experiment.columns.reverse()),
        made(&|experiment| experiment.settings.max_replans += 1),
        made(&|experiment| experiment.planner_states += 1),
        made(&|experiment| experiment.planning_budget = 3.into()),
    ];
    let different: std::collections::BTreeSet<_> = others.iter().chain([&same]).collect();
    assert_eq!(different.len(), others.len() + 1);
}

/// An executor whose preparation was interrupted lacks the table of `policy` or has another first
/// plan. Its trials would not be comparable.
#[test]
fn interruption_during_preparation_makes_no_trial() {
    let experiment = experiment();
    let asked = std::sync::atomic::AtomicU64::new(0);
    let only_at_first = |_| asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) == 0;
    let results = run(&experiment, WHOLE, &only_at_first).expect("a correct test");
    assert!(results.origin.is_interrupted);
    let mut cells = results.counts.cells.iter().flatten();
    assert!(
        cells.all(|cell| cell.runs == 0),
        "{:?}",
        results.counts.cells
    );
}

/// Towers of Hanoi with seven discs, which need more than a few states.
const HANOI: &str = "(define (domain hanoi) (:requirements :durative-actions)
  (:predicates (clear ?x) (on ?x ?y) (fits ?x ?y) (hand))
  (:durative-action move :parameters (?disc ?from ?to) :duration (= ?duration 1)
    :condition (and (at start (hand)) (at start (clear ?disc)) (at start (clear ?to))
      (at start (on ?disc ?from)) (at start (fits ?disc ?to)))
    :effect (and (at start (not (hand))) (at end (hand)) (at start (not (on ?disc ?from)))
      (at end (clear ?from)) (at start (not (clear ?to))) (at end (on ?disc ?to)))))";

/// Returns the problem of [`HANOI`]: all discs lie on `p`, and belong on `r`.
fn hanoi() -> String {
    let smaller_on_larger = |disc: u32| format!("(on d{disc} d{})", disc + 1);
    let tower: Vec<String> = (1..7).map(smaller_on_larger).collect();
    let fits = |disc: u32| {
        let places = ["p", "q", "r"].map(str::to_owned).into_iter();
        let supports = places.chain((disc + 1..=7).map(|larger| format!("d{larger}")));
        supports.map(move |support| format!("(fits d{disc} {support})"))
    };
    let fits: Vec<String> = (1..=7).flat_map(fits).collect();
    let (tower, fits) = (tower.join(" "), fits.join(" "));
    format!(
        "(define (problem seven) (:domain hanoi) (:objects p q r d1 d2 d3 d4 d5 d6 d7)
         (:init (hand) (clear d1) (clear q) (clear r) (on d7 p) {tower} {fits})
         (:goal (and (on d7 r) {tower})))"
    )
}

#[test]
fn missing_first_plan_names_the_limit_as_the_file_does() {
    let with = |change: &dyn Fn(&mut Experiment)| {
        let mut experiment = experiment();
        HANOI.clone_into(&mut experiment.domain);
        experiment.problem = hanoi();
        experiment.blanks.clear();
        change(&mut experiment);
        match run(&experiment, WHOLE, &|_| true) {
            Ok(_) => panic!("there is a plan"),
            Err(error) => error.to_string(),
        }
    };
    let states = with(&|experiment| experiment.planner_states = 2);
    assert!(states.contains("(`planner_states`)"), "{states}");
    let budget = with(&|experiment| experiment.planning_budget = Rational::new(1, 1_000_000));
    assert!(budget.contains("(`planning_budget`)"), "{budget}");
}

/// An interrupted search ends without a plan. This is not a failure of the executor.
#[test]
fn interrupted_trial_does_not_count() {
    let experiment = experiment();
    let successes = |part, may_continue: &(dyn Fn(u64) -> bool + Sync)| {
        let results = run(&experiment, part, may_continue).expect("a correct test");
        let cells = results.counts.cells.into_iter().flatten();
        let counts: Vec<_> = cells.map(|cell| (cell.runs, cell.successes)).collect();
        (counts, results.origin.is_interrupted)
    };
    let whole: Vec<_> = (1..=WHOLE.trials)
        .map(|trials| successes(Part { trials, ..WHOLE }, &|_| true).0)
        .collect();
    let mut runs = std::collections::BTreeSet::new();
    let mut most = 100;
    loop {
        let asked = std::sync::atomic::AtomicU64::new(0);
        let for_a_while = |_| asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) < most;
        let (counts, is_interrupted) = successes(WHOLE, &for_a_while);
        for (place, count) in counts.iter().enumerate() {
            runs.insert(count.0);
            let trials = usize::try_from(count.0).expect("few trials");
            if trials > 0 {
                let uninterrupted = whole[trials - 1][place];
                assert_eq!(*count, uninterrupted, "after {most} questions");
            }
        }
        if !is_interrupted {
            break;
        }
        most += most / 3;
    }
    assert!(runs.len() > 2, "{runs:?}");
}
