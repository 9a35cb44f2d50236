//! The normal distribution and powers of e, compared with their integrals and identities.

use elbowroom_num::Rational;
use elbowroom_num::enclosures::{exp_of_minus, normal_cdf, normal_density};

/// Integrates a function by Simpson's rule.
fn integral(from: f64, to: f64, function: &dyn Fn(f64) -> f64) -> f64 {
    let steps = 4000;
    let width = (to - from) / f64::from(steps);
    let sum: f64 = (0..=steps)
        .map(|step| {
            let weight = match step {
                0 | 4000 => 1.0,
                odd if odd % 2 == 1 => 4.0,
                _ => 2.0,
            };
            weight * function(from + f64::from(step) * width)
        })
        .sum();
    sum * width / 3.0
}

fn density(at: f64) -> f64 {
    (-at * at / 2.0).exp() / std::f64::consts::TAU.sqrt()
}

#[test]
fn the_normal_distribution_is_enclosed_as_the_integral_of_its_density() {
    for tenths in -95..=95_i64 {
        let at = Rational::new(tenths, 10);
        let [below, above] = normal_cdf(&at);
        assert!(below <= above && &above - &below < Rational::new(1, 10_000_000_000));
        let found = integral(-12.0, at.to_f64(), &density);
        assert!((below.to_f64() - found).abs() < 1e-11, "{at} {found}");
        let [less, more] = normal_density(&at);
        assert!(less < more);
        let gap = (less.to_f64() - density(at.to_f64())).abs();
        assert!(gap < 1e-15, "{at} {gap}");
    }
}

#[test]
fn bounds_are_no_tighter_than_precision() {
    // The constant has enough digits: the total probability is 1, and nearly all of it is within 9.
    let [below, _] = normal_cdf(&Rational::from(9));
    let [_, above] = normal_cdf(&Rational::from(9));
    let tiny = Rational::new(1, 1_000_000_000_000_000_000);
    assert!(Rational::ONE - &below < tiny && Rational::ONE - &above < tiny);
    // Symmetry: the probability below -z equals the probability above z.
    for tenths in 0..90_i64 {
        let at = Rational::new(tenths, 10) + Rational::new(1, 3_000_017);
        let ([a, b], [c, d]) = (normal_cdf(&at), normal_cdf(&-&at));
        assert!(&a + &c <= Rational::ONE && Rational::ONE <= &b + &d, "{at}");
    }
}

#[test]
fn powers_of_sums_are_products() {
    for one in 0..30_i64 {
        for other in 0..30_i64 {
            let [x, y] = [one, other].map(|thirds| Rational::new(thirds, 3));
            let [first, second] = [exp_of_minus(&x), exp_of_minus(&y)];
            let [below, above] = exp_of_minus(&(&x + &y));
            let products = [0, 1].map(|side| &first[side] * &second[side]);
            assert!(below <= products[1] && products[0] <= above);
            let float = (-(x + y).to_f64()).exp();
            assert!((below.to_f64() - float).abs() < 1e-15);
        }
    }
}
