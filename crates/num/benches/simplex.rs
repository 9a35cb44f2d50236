//! Linear programs of the kind that plans lead to: chains of time points with bounds on their
//! differences, and shared consumption.

use divan::Bencher;
use elbowroom_num::simplex::{Simplex, VariableId};
use elbowroom_num::{Delta, Rational};

fn main() {
    divan::main();
}

/// Returns a system of `count` time points. Each lies 1 to 3 (and a bit) after one of the last
/// three before it, and each tenth sum of four stays below a limit.
fn plan(count: i64) -> (Simplex, Vec<VariableId>) {
    let mut system = Simplex::new();
    let mut tag = 0..;
    let mut next_tag = || tag.next().expect("endless");
    let points: Vec<_> = (0..count).map(|_| system.add_variable()).collect();
    system.assert_lower(points[0], Delta::ZERO, next_tag());
    system.assert_upper(points[0], Delta::ZERO, next_tag());
    for later in 1..points.len() {
        let back = 1 + later * 7 % 3;
        let earlier = points[later.saturating_sub(back)];
        let difference = system.define(&[
            (points[later], Rational::ONE),
            (earlier, Rational::from(-1)),
        ]);
        let bit = Rational::new(i64::try_from(later * 13 % 10).expect("a digit"), 1000);
        let (lower, upper) = (Rational::ONE + &bit, Rational::from(3) + &bit);
        system.assert_lower(difference, Delta::just_above(lower), next_tag());
        system.assert_upper(difference, Delta::from(upper), next_tag());
    }
    for window in points.windows(4).step_by(10) {
        let row: Vec<_> = window.iter().map(|&v| (v, Rational::new(1, 4))).collect();
        let sum = system.define(&row);
        let limit = Rational::from(2 * i64::from(window[3].0));
        system.assert_upper(sum, Delta::from(limit), next_tag());
    }
    (system, points)
}

#[divan::bench(args = [20, 100, 300], max_time = 5)]
fn check_from_scratch(bencher: Bencher, count: i64) {
    let (system, _) = plan(count);
    bencher
        .with_inputs(|| system.clone())
        .bench_values(|mut system| system.check().is_ok());
}

#[divan::bench(args = [20, 100, 300], max_time = 5)]
fn maximize_the_last_after_a_check(bencher: Bencher, count: i64) {
    let (mut system, points) = plan(count);
    assert!(system.check().is_ok());
    let objective = [(points[points.len() - 1], Rational::ONE)];
    bencher
        .with_inputs(|| system.clone())
        .bench_values(|mut system| system.maximize(&objective));
}

/// Adds a bound, checks, and undoes it, as a search does all the time.
#[divan::bench(args = [20, 100, 300], max_time = 5)]
fn push_check_pop(bencher: Bencher, count: i64) {
    let (mut system, points) = plan(count);
    assert!(system.check().is_ok());
    let last = points[points.len() - 1];
    let bound = Delta::from(Rational::from(count));
    bencher.bench_local(|| {
        system.push();
        system.assert_upper(last, bound.clone(), usize::MAX);
        let verdict = system.check().is_ok();
        system.pop();
        verdict
    });
}
