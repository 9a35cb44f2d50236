use super::Rational;
use proptest::prelude::*;
use std::str::FromStr;

fn rational(text: &str) -> Rational {
    Rational::from_str(text).expect("a number")
}

#[test]
fn decimals_and_fractions_are_read_exactly() {
    assert_eq!(rational("12.50"), Rational::new(25, 2));
    assert_eq!(rational("-0.125"), Rational::new(-1, 8));
    assert_eq!(rational(".5"), Rational::new(1, 2));
    assert_eq!(rational("5."), Rational::from(5));
    assert_eq!(rational("1e-3"), Rational::new(1, 1000));
    assert_eq!(rational("2.5E2"), Rational::from(250));
    assert_eq!(rational("10/4"), Rational::new(5, 2));
}

#[test]
fn malformed_numbers_are_refused() {
    for text in [
        "",
        "-",
        ".",
        "1/0",
        "1/",
        "/2",
        "a",
        "1e",
        "1e99999999",
        "0x10",
        "1.2.3",
        "--1",
        "∞",
    ] {
        assert!(
            Rational::from_str(text).is_err(),
            "{text:?} was read as a number"
        );
    }
    assert!(Rational::from_str(&"9".repeat(10_000)).is_err());
}

#[test]
fn numbers_that_outgrow_64_bits_stay_exact() {
    let large = rational("123456789012345678901234567890.5");
    assert_eq!(large.to_string(), "246913578024691357802469135781/2");
    assert_eq!(&large - &large, Rational::ZERO);
    assert_eq!(&(&large * &large) / &large, large);
    assert_eq!(Rational::from(i64::MIN).to_string(), "-9223372036854775808");
    assert_eq!(-(-Rational::from(i64::MIN)), Rational::from(i64::MIN));
    assert_eq!(
        Rational::from(i64::MAX) + Rational::ONE - Rational::ONE,
        Rational::from(i64::MAX)
    );
}

#[test]
fn decimals_are_rounded_half_away_from_zero() {
    assert_eq!(Rational::new(1, 3).to_decimal(3), "0.333");
    assert_eq!(Rational::new(2, 3).to_decimal(3), "0.667");
    assert_eq!(Rational::new(-1, 2000).to_decimal(3), "-0.001");
    assert_eq!(Rational::new(-1, 3000).to_decimal(3), "0");
    assert_eq!(Rational::from(100).to_decimal(0), "100");
    assert_eq!(Rational::new(3829, 4).to_decimal(3), "957.25");
    assert_eq!(Rational::new(21, 20).to_decimal(1), "1.1");
}

#[test]
fn floor_and_ceil_go_down_and_up() {
    assert_eq!(Rational::new(-7, 2).floor(), Rational::from(-4));
    assert_eq!(Rational::new(-7, 2).ceil(), Rational::from(-3));
    assert_eq!(Rational::new(7, 2).ceil(), Rational::from(4));
}

/// Fractions on both sides of the border between the fast and the general representation.
fn any_rational() -> impl Strategy<Value = Rational> {
    let parts = prop_oneof![
        -20_i64..20,
        any::<i64>(),
        Just(1),
        Just(i64::MAX),
        Just(i64::MIN)
    ];
    (parts.clone(), parts.prop_filter("not zero", |d| *d != 0))
        .prop_map(|(n, d)| Rational::new(n, d))
}

proptest! {
    #[test]
    fn addition_and_multiplication_obey_the_laws_of_a_field(
        a in any_rational(), b in any_rational(), c in any_rational()
    ) {
        prop_assert_eq!(&(&a + &b) + &c, &a + &(&b + &c));
        prop_assert_eq!(&a * &(&b + &c), &(&a * &b) + &(&a * &c));
        prop_assert_eq!(&(&a - &b) + &b, a.clone());
        if !b.is_zero() {
            prop_assert_eq!(&(&a / &b) * &b, a);
        }
    }

    #[test]
    fn order_agrees_with_the_sign_of_the_difference(a in any_rational(), b in any_rational()) {
        prop_assert_eq!(a.cmp(&b), (&a - &b).signum().cmp(&0));
        prop_assert_eq!(a == b, (&a - &b).is_zero());
    }

    #[test]
    fn formatted_numbers_round_trip(a in any_rational()) {
        prop_assert_eq!(rational(&a.to_string()), a);
    }

    #[test]
    fn floor_is_the_nearest_whole_number_below(a in any_rational()) {
        let floor = a.floor();
        prop_assert!(floor.is_integer() && floor <= a && &a - &floor < Rational::ONE);
    }
}
