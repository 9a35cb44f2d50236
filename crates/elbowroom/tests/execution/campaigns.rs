//! Experiments: the same result for any number of threads, and parts that add up.

use elbowroom::compare::{Experiment, Part, Results, run};

use crate::scene::read;

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
fn results_do_not_depend_on_the_number_of_threads_and_parts_add_up() {
    let experiment = experiment();
    let make = |part| run(&experiment, part, &|_| true).expect("a correct test");
    let whole = make(WHOLE);
    assert_eq!(whole, make(Part { jobs: 3, ..WHOLE }));
    let parts = [0, 1, 2].map(|shard| {
        make(Part {
            shard,
            shards: 3,
            ..WHOLE
        })
    });
    assert_eq!(Results::merged(&parts).expect("a correct test"), whole);
    assert!(Results::merged(&[parts[0].clone(), parts[0].clone()]).is_err());
    let text = whole.json().to_string();
    assert_eq!(Results::read(&text).expect("a correct test"), whole);
}

#[test]
fn mistakes_in_an_experiment_have_their_line() {
    let text = read("experiments/table1.toml");
    let file = |name: &str| Ok(read(&format!("experiments/{name}")));
    let broken = text.replace("\"fixed:10\"", "\"fixed:ten\"");
    let error = Experiment::read(&broken, &file).unwrap_err().to_string();
    let line = 1 + text[..text.find("fixed:10").expect("a correct test")]
        .matches('\n')
        .count();
    assert!(error.starts_with(&format!("line {line}: ")), "{error}");
}
