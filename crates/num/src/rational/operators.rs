//! Addition, subtraction, multiplication, division and their relatives.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use super::Rational;
use super::Repr::{Big, Small};

impl<'a> Add<&'a Rational> for &Rational {
    type Output = Rational;
    fn add(self, other: &'a Rational) -> Rational {
        sum(self, other, false)
    }
}

impl<'a> Sub<&'a Rational> for &Rational {
    type Output = Rational;
    fn sub(self, other: &'a Rational) -> Rational {
        sum(self, other, true)
    }
}

/// Returns `a + b`, or `a - b` when `subtract`.
fn sum(left: &Rational, right: &Rational, subtract: bool) -> Rational {
    if let (&Small(a, b), &Small(c, d)) = (&left.0, &right.0) {
        let c = if subtract { -c } else { c };
        // With a whole number on one side, the sum is in lowest terms already.
        let whole = if d == 1 {
            c.checked_mul(b).and_then(|c| Some((a.checked_add(c)?, b)))
        } else if b == 1 {
            a.checked_mul(d).and_then(|a| Some((a.checked_add(c)?, d)))
        } else {
            None
        };
        if let Some((numerator, denominator)) = whole
            && numerator != i64::MIN
        {
            return Rational(Small(numerator, denominator));
        }
        if b == d {
            return Rational::reduced(i128::from(a) + i128::from(c), i128::from(b));
        }
        let [a, b, c, d] = [a, b, c, d].map(i128::from);
        return Rational::reduced(a * d + c * b, b * d);
    }
    let (a, b) = (left.to_big(), right.to_big());
    Rational::from_big(if subtract { a - b } else { a + b })
}

impl<'a> Mul<&'a Rational> for &Rational {
    type Output = Rational;
    fn mul(self, other: &'a Rational) -> Rational {
        match (&self.0, &other.0) {
            (&Small(a, b), &Small(c, d)) => {
                // Most products are with 1 or -1, or of whole numbers.
                let (is_sign, is_signed) = (d == 1 && c.abs() == 1, b == 1 && a.abs() == 1);
                if (is_sign || is_signed || (b == 1 && d == 1))
                    && let Some(numerator) = a.checked_mul(c)
                    && numerator != i64::MIN
                {
                    return Rational(Small(numerator, b * d));
                }
                Rational::reduced(i128::from(a) * i128::from(c), i128::from(b) * i128::from(d))
            }
            _ => Rational::from_big(self.to_big() * other.to_big()),
        }
    }
}

/// # Panics
/// When dividing by zero; see [`Rational::checked_div`].
impl<'a> Div<&'a Rational> for &Rational {
    type Output = Rational;
    fn div(self, other: &'a Rational) -> Rational {
        assert!(!other.is_zero(), "division of a rational by zero");
        match (&self.0, &other.0) {
            (&Small(a, b), &Small(c, d)) => {
                Rational::reduced(i128::from(a) * i128::from(d), i128::from(b) * i128::from(c))
            }
            _ => Rational::from_big(self.to_big() / other.to_big()),
        }
    }
}

impl Neg for &Rational {
    type Output = Rational;
    fn neg(self) -> Rational {
        match &self.0 {
            Small(numerator, denominator) => Rational(Small(-numerator, *denominator)),
            Big(big) => Rational::from_big(-(**big).clone()),
        }
    }
}

impl Neg for Rational {
    type Output = Rational;
    fn neg(self) -> Rational {
        -&self
    }
}

/// The by-value forms of the binary operators, all by way of the by-reference form.
macro_rules! by_value {
    ($($operator:ident $method:ident),*) => {$(
        impl $operator<Rational> for Rational {
            type Output = Rational;
            fn $method(self, other: Rational) -> Rational {
                (&self).$method(&other)
            }
        }
        impl<'a> $operator<&'a Rational> for Rational {
            type Output = Rational;
            fn $method(self, other: &'a Rational) -> Rational {
                (&self).$method(other)
            }
        }
        impl $operator<Rational> for &Rational {
            type Output = Rational;
            fn $method(self, other: Rational) -> Rational {
                self.$method(&other)
            }
        }
    )*};
}
by_value!(Add add, Sub sub, Mul mul, Div div);

/// The assigning operators, all by way of the by-reference form.
macro_rules! assigning {
    ($($operator:ident $method:ident $plain:ident),*) => {$(
        impl $operator<Rational> for Rational {
            fn $method(&mut self, other: Rational) {
                *self = (&*self).$plain(&other);
            }
        }
        impl<'a> $operator<&'a Rational> for Rational {
            fn $method(&mut self, other: &'a Rational) {
                *self = (&*self).$plain(other);
            }
        }
    )*};
}
assigning!(AddAssign add_assign add, SubAssign sub_assign sub, MulAssign mul_assign mul);

impl Sum for Rational {
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        terms.fold(Self::ZERO, |total, term| total + term)
    }
}

impl<'a> Sum<&'a Rational> for Rational {
    fn sum<I: Iterator<Item = &'a Self>>(terms: I) -> Self {
        terms.fold(Self::ZERO, |total, term| total + term)
    }
}
