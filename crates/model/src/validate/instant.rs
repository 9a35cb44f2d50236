//! Moments between two happenings, rational or irrational.

use std::cmp::Ordering;

use elbowroom_num::Rational;

use super::polynomial::{Polynomial, Root};

/// Precision for the approximation of an irrational moment.
const CLOSE: (i64, i64) = (1, 1_000_000);

/// A moment, as the time since the beginning of a piece: a number, or a zero of a polynomial.
#[derive(Clone, Debug)]
pub(super) struct Instant {
    root: Root,
    /// A square-free polynomial that is zero at the moment.
    zero: Polynomial,
}

impl Instant {
    pub(super) fn exact(value: Rational) -> Self {
        let zero = Polynomial::new(vec![-&value, Rational::ONE]);
        Self {
            root: Root::Exact(value),
            zero,
        }
    }

    /// Creates a moment from a zero of a square-free polynomial.
    pub(super) fn of(root: Root, zero: &Polynomial) -> Self {
        match root {
            Root::Exact(value) => Self::exact(value),
            Root::Between(..) => Self {
                root,
                zero: zero.clone(),
            },
        }
    }

    /// Returns the same moment as a zero of the one of these polynomials that has the lowest
    /// degree, without its zeros at `others`. A lower degree makes it possible to recognise more
    /// values as rational, including the moment itself. The polynomials must not have other zeros
    /// than the one that defined the moment.
    pub(super) fn zero_of_one(self, polynomials: &[Polynomial], others: &[Rational]) -> Self {
        let zeros = polynomials.iter().filter(|one| self.sign(one) == 0);
        let Some(zero) = zeros.min_by_key(|one| one.degree()) else {
            return self;
        };
        let mut zero = zero.square_free();
        for other in others {
            if self.as_exact() != Some(other) {
                zero.divide_out(other);
            }
        }
        match zero.only_root() {
            Some(value) => Self::exact(value),
            None => Self::of(self.root.clone(), &zero),
        }
    }

    pub(super) fn as_exact(&self) -> Option<&Rational> {
        match &self.root {
            Root::Exact(value) => Some(value),
            Root::Between(..) => None,
        }
    }

    /// Returns the polynomial that is zero at the moment.
    pub(super) fn zero(&self) -> &Polynomial {
        &self.zero
    }

    /// Returns the moment, or a number within a millionth below it.
    pub(super) fn near(&self) -> Rational {
        let narrow = self
            .zero
            .narrowed(&self.root, &Rational::new(CLOSE.0, CLOSE.1));
        narrow.lower().clone()
    }

    /// Returns the sign of a polynomial at the moment.
    pub(super) fn sign(&self, polynomial: &Polynomial) -> i32 {
        let mut root = self.root.clone();
        if let Root::Between(low, high) = &root
            && polynomial.degree() > 0
        {
            let common = self.zero.common_divisor(polynomial);
            if common.degree() > 0 && common.count_roots_between(low, high) > 0 {
                return 0;
            }
        }
        loop {
            match &root {
                Root::Exact(value) => return polynomial.at(value).signum(),
                Root::Between(low, high) => {
                    // The polynomial is not zero at the moment, so it has no zero in a sufficiently
                    // small neighbourhood.
                    let has_signs = !polynomial.at(low).is_zero() && !polynomial.at(high).is_zero();
                    if polynomial.degree() == 0
                        || has_signs && polynomial.count_roots_between(low, high) == 0
                    {
                        return polynomial.at(low).signum();
                    }
                    let half = (high - low) / Rational::from(2);
                    root = self.zero.narrowed(&root, &half);
                }
            }
        }
    }

    /// Returns the value of a polynomial at the moment, if it is recognised as rational.
    pub(super) fn value(&self, polynomial: &Polynomial) -> Option<Rational> {
        match &self.root {
            Root::Exact(value) => Some(polynomial.at(value)),
            Root::Between(..) => polynomial.divided(&self.zero).1.as_constant(),
        }
    }

    /// Compares two moments of a piece.
    pub(super) fn order(&self, other: &Self) -> Ordering {
        match (&self.root, &other.root) {
            (Root::Exact(own), Root::Exact(other)) => own.cmp(other),
            (_, Root::Exact(value)) => self.order_to(value),
            (Root::Exact(value), _) => other.order_to(value).reverse(),
            (Root::Between(..), Root::Between(..)) => self.order_between(other),
        }
    }

    fn order_to(&self, value: &Rational) -> Ordering {
        self.sign(&Polynomial::new(vec![-value, Rational::ONE]))
            .cmp(&0)
    }

    fn order_between(&self, other: &Self) -> Ordering {
        let common = self.zero.common_divisor(&other.zero);
        let (mut own, mut their) = (self.root.clone(), other.root.clone());
        let low = own.lower().max(their.lower()).clone();
        let high = own.upper().min(their.upper()).clone();
        // A common zero inside both brackets is the only zero of either there.
        if low < high && common.degree() > 0 && common.count_roots_between(&low, &high) > 0 {
            return Ordering::Equal;
        }
        loop {
            if own.upper() <= their.lower() {
                return Ordering::Less;
            }
            if their.upper() <= own.lower() {
                return Ordering::Greater;
            }
            let half = |root: &Root| (root.upper() - root.lower()) / Rational::from(2);
            own = self.zero.narrowed(&own, &half(&own));
            their = other.zero.narrowed(&their, &half(&their));
        }
    }
}

impl PartialEq for Instant {
    fn eq(&self, other: &Self) -> bool {
        self.order(other) == Ordering::Equal
    }
}
