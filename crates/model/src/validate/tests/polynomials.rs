//! Zeros of polynomials.

use elbowroom_num::Rational;
use proptest::prelude::*;

use super::world::number;
use crate::validate::polynomial::{Polynomial, Root};

/// Returns `(τ - r1)(τ - r2)…`.
fn with_roots(roots: &[Rational]) -> Polynomial {
    let one = Polynomial::constant(Rational::ONE);
    roots.iter().fold(one, |product, root| {
        product.times(&Polynomial::new(vec![-root, Rational::ONE]))
    })
}

#[test]
fn an_irrational_zero_is_bracketed() {
    let polynomial = Polynomial::new(vec![number("-2"), Rational::ZERO, Rational::ONE]);
    let roots = polynomial.roots_within(&number("5"));
    assert_eq!(roots.len(), 1);
    let narrow = polynomial.narrowed(&roots[0], &number("0.001"));
    assert!(*narrow.lower() > number("1.413") && *narrow.upper() < number("1.416"));
}

#[test]
fn a_zero_between_two_irrational_ones_is_separated_from_them() {
    // (τ² - 2)(τ - 1.4142)
    let square = Polynomial::new(vec![number("-2"), Rational::ZERO, Rational::ONE]);
    let polynomial = square.times(&with_roots(&[number("1.4142")]));
    let roots = polynomial.roots_within(&number("2"));
    assert_eq!(roots.len(), 2);
    assert!(roots[0].upper() <= roots[1].lower());
}

#[test]
fn constants_have_no_zeros() {
    assert!(
        Polynomial::constant(Rational::ZERO)
            .roots_within(&Rational::ONE)
            .is_empty()
    );
    assert!(
        Polynomial::constant(Rational::ONE)
            .roots_within(&Rational::ONE)
            .is_empty()
    );
}

proptest! {
    #[test]
    fn exactly_the_zeros_inside_interval_are_found(
        roots in prop::collection::vec((-8..40_i64, 1..5_i64), 1..6),
    ) {
        let roots: Vec<_> = roots.into_iter().map(|(n, d)| Rational::new(n, d)).collect();
        let length = number("7");
        let mut expected: Vec<_> =
            roots.iter().filter(|r| r.is_positive() && **r < length).cloned().collect();
        expected.sort();
        expected.dedup();
        let found = with_roots(&roots).roots_within(&length);
        prop_assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            match found {
                Root::Exact(value) => prop_assert_eq!(value, expected),
                Root::Between(low, high) => prop_assert!(low < expected && expected < high),
            }
        }
        for pair in found.windows(2) {
            prop_assert!(pair[0].upper() <= pair[1].lower());
        }
    }
}
