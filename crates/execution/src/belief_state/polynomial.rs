//! Polynomials in the time since the last happening, and their sign changes.

use elbowroom_num::Rational;

/// A polynomial: its coefficients by power, without leading zeros.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Polynomial(Vec<Rational>);

/// Part of an open interval where each polynomial of a set has one sign.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    /// An open piece, by a point in it.
    Piece(Rational),
    /// A single zero of one of the polynomials, isolated between two times. No polynomial is zero
    /// at these two times, unless both are the zero itself.
    Zero(Rational, Rational),
    /// A sufficiently short interval after time 0.
    JustAfterZero,
}

impl Polynomial {
    pub(super) fn constant(value: Rational) -> Self {
        Self::of(vec![value])
    }

    fn of(mut coefficients: Vec<Rational>) -> Self {
        while coefficients.last().is_some_and(Rational::is_zero) {
            coefficients.pop();
        }
        Self(coefficients)
    }

    /// Returns the value if the polynomial is constant.
    pub(super) fn as_constant(&self) -> Option<Rational> {
        match self.0.as_slice() {
            [] => Some(Rational::ZERO),
            [value] => Some(value.clone()),
            _ => None,
        }
    }

    fn is_zero(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        let count = self.0.len().max(other.0.len());
        let at = |p: &Self, i: usize| p.0.get(i).cloned().unwrap_or_default();
        Self::of((0..count).map(|i| at(self, i) + at(other, i)).collect())
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        let count = (self.0.len() + other.0.len()).saturating_sub(1);
        let mut product = vec![Rational::ZERO; count];
        for (i, a) in self.0.iter().enumerate() {
            for (j, b) in other.0.iter().enumerate() {
                product[i + j] += a * b;
            }
        }
        Self::of(product)
    }

    pub(super) fn scaled(&self, factor: &Rational) -> Self {
        Self::of(self.0.iter().map(|c| c * factor).collect())
    }

    /// Returns the antiderivative with this value at 0.
    pub(super) fn integral(&self, initial: Rational) -> Self {
        let mut power = Rational::ZERO;
        let raised = self.0.iter().map(|c| {
            power += &Rational::ONE;
            c / &power
        });
        let mut coefficients = vec![initial];
        coefficients.extend(raised);
        Self::of(coefficients)
    }

    fn derivative(&self) -> Self {
        let mut power = Rational::ZERO;
        let lowered = self.0.iter().skip(1).map(|c| {
            power += &Rational::ONE;
            c * &power
        });
        Self::of(lowered.collect())
    }

    pub(super) fn at(&self, time: &Rational) -> Rational {
        let horner = |value: Rational, c: &Rational| value * time + c;
        self.0.iter().rev().fold(Rational::ZERO, horner)
    }

    /// Returns quotient and remainder. `divisor` must not be zero.
    fn divided(&self, divisor: &Self) -> (Self, Self) {
        let mut rest = self.0.clone();
        let mut quotient = vec![Rational::ZERO; (rest.len() + 1).saturating_sub(divisor.0.len())];
        let Some(lead) = divisor.0.last() else {
            return (Self(Vec::new()), self.clone());
        };
        for shift in (0..quotient.len()).rev() {
            let factor = &rest[shift + divisor.0.len() - 1] / lead;
            for (i, c) in divisor.0.iter().enumerate() {
                rest[shift + i] = &rest[shift + i] - &(c * &factor);
            }
            quotient[shift] = factor;
        }
        (Self::of(quotient), Self::of(rest))
    }

    fn common_divisor(&self, other: &Self) -> Self {
        let (mut a, mut b) = (self.clone(), other.clone());
        while !b.is_zero() {
            let (_, rest) = a.divided(&b);
            a = std::mem::replace(&mut b, rest);
        }
        a
    }

    /// Returns the polynomial with the same zeros, all of them simple.
    fn with_simple_zeros(&self) -> Self {
        if self.is_zero() {
            return self.clone();
        }
        self.divided(&self.common_divisor(&self.derivative())).0
    }

    /// Returns the sign in a cell of [`cells`] of this and other polynomials.
    pub(super) fn sign_in(&self, cell: &Cell) -> i32 {
        match cell {
            Cell::Piece(time) => self.at(time).signum(),
            Cell::JustAfterZero => {
                let first = self.0.iter().find(|c| !c.is_zero());
                first.map_or(0, Rational::signum)
            }
            Cell::Zero(from, to) if from == to => self.at(from).signum(),
            Cell::Zero(from, to) => {
                let simple = self.with_simple_zeros();
                if simple.at(from).signum() * simple.at(to).signum() < 0 {
                    0
                } else {
                    self.at(from).signum()
                }
            }
        }
    }
}

/// Splits the open interval from 0 to `length` into cells in which each polynomial has one sign.
/// With `precision`, zeros are isolated up to it.
pub(super) fn cells(
    polynomials: &[Polynomial],
    length: &Rational,
    precision: Option<&Rational>,
) -> Vec<Cell> {
    let mut product = Polynomial::constant(Rational::ONE);
    for polynomial in polynomials.iter().filter(|p| p.as_constant().is_none()) {
        let simple = polynomial.with_simple_zeros();
        // Common zeros of two polynomials count once.
        let (new, _) = simple.divided(&simple.common_divisor(&product));
        product = product.times(&new);
    }
    let mut found = Vec::new();
    let sturm = Sturm::of(product);
    part(&sturm, [&Rational::ZERO, length], precision, &mut found);
    found
}

fn part(
    sturm: &Sturm,
    [from, to]: [&Rational; 2],
    precision: Option<&Rational>,
    found: &mut Vec<Cell>,
) {
    let middle = (from + to) / Rational::from(2);
    let zeros = sturm.zeros_between(from, to);
    let is_precise = precision.is_none_or(|precision| to - from <= *precision);
    if zeros == 0 {
        found.push(Cell::Piece(middle));
    } else if zeros == 1 && is_precise && !sturm.is_zero_at(from) && !sturm.is_zero_at(to) {
        // The ends lie inside the pieces on both sides. At the ends of the interval, they have the
        // sign of the piece.
        found.push(Cell::Piece(from.clone()));
        found.push(Cell::Zero(from.clone(), to.clone()));
        found.push(Cell::Piece(to.clone()));
    } else {
        part(sturm, [from, &middle], precision, found);
        if sturm.is_zero_at(&middle) {
            found.push(Cell::Zero(middle.clone(), middle.clone()));
        }
        part(sturm, [&middle, to], precision, found);
    }
}

/// Sturm's sequence of a polynomial with simple zeros, which counts them.
struct Sturm(Vec<Polynomial>);

impl Sturm {
    fn of(polynomial: Polynomial) -> Self {
        let mut next = polynomial.derivative();
        let mut sequence = vec![polynomial];
        while !next.is_zero() {
            let (_, rest) = sequence[sequence.len() - 1].divided(&next);
            sequence.push(std::mem::replace(&mut next, rest.scaled(&-Rational::ONE)));
        }
        Self(sequence)
    }

    fn is_zero_at(&self, time: &Rational) -> bool {
        self.0[0].at(time).is_zero()
    }

    /// Returns the number of sign changes along the sequence.
    fn changes_at(&self, time: &Rational) -> usize {
        let signs = self.0.iter().map(|p| p.at(time).signum());
        let signs: Vec<i32> = signs.filter(|sign| *sign != 0).collect();
        signs.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }

    /// Returns the number of zeros strictly between two times.
    fn zeros_between(&self, from: &Rational, to: &Rational) -> usize {
        let up_to = self.changes_at(from).saturating_sub(self.changes_at(to));
        up_to.saturating_sub(usize::from(self.is_zero_at(to)))
    }
}

#[cfg(test)]
mod tests {
    use super::{Cell, Polynomial, cells};
    use elbowroom_num::Rational;

    fn polynomial(coefficients: &[i64]) -> Polynomial {
        Polynomial::of(coefficients.iter().map(|&c| Rational::from(c)).collect())
    }

    /// Returns the signs of each polynomial from cell to cell, without repetitions.
    fn signs(polynomials: &[Polynomial], length: i64) -> Vec<Vec<i32>> {
        let cells = cells(polynomials, &Rational::from(length), None);
        let signs = cells
            .iter()
            .map(|cell| polynomials.iter().map(|p| p.sign_in(cell)).collect());
        let mut signs: Vec<Vec<i32>> = signs.collect();
        signs.dedup();
        signs
    }

    #[test]
    fn signs_change_exactly_at_zeros() {
        // t - 2, and t² - 2, whose zero is irrational.
        let (line, parabola) = (polynomial(&[-2, 1]), polynomial(&[-2, 0, 1]));
        assert_eq!(
            signs(&[line.clone(), parabola.clone()], 3),
            [[-1, -1], [-1, 0], [-1, 1], [0, 1], [1, 1]]
        );
        // The interval is open, so a polynomial that is zero only at its ends has one sign in it.
        assert_eq!(signs(&[line], 2), [[-1]]);
        assert_eq!(signs(&[polynomial(&[0, 1])], 2), [[1]]);
        // A double zero touches the axis.
        assert_eq!(signs(&[polynomial(&[1, -2, 1])], 3), [[1], [0], [1]]);
        // A common zero of two polynomials.
        let twice = parabola.times(&parabola).times(&polynomial(&[5, 1]));
        assert_eq!(signs(&[twice, parabola], 3), [[1, -1], [0, 0], [1, 1]]);
    }

    #[test]
    fn first_cell_has_sign_of_lowest_coefficient() {
        assert_eq!(polynomial(&[0, 0, -1, 9]).sign_in(&Cell::JustAfterZero), -1);
        assert_eq!(polynomial(&[3, -1]).sign_in(&Cell::JustAfterZero), 1);
        assert_eq!(polynomial(&[]).sign_in(&Cell::JustAfterZero), 0);
    }

    /// Comparison with a slow reference: many points, and the zeros by construction.
    #[test]
    fn signs_of_linear_products_match_zeros() {
        for seed in 0_i64..200 {
            let zero =
                |n: i64| Rational::new((seed * (7 + 5 * n) + n * n) % 23, 1 + (seed + n) % 4);
            let zeros: Vec<Rational> = (0..4).map(zero).collect();
            let line = |zero: &Rational| Polynomial::of(vec![-zero, Rational::ONE]);
            let one = zeros[..2]
                .iter()
                .fold(polynomial(&[1]), |p, z| p.times(&line(z)));
            let two = zeros[1..]
                .iter()
                .fold(polynomial(&[-1]), |p, z| p.times(&line(z)));
            let length = Rational::from(12);
            let mut marks: Vec<Rational> = zeros.clone();
            marks.retain(|mark| mark.is_positive() && *mark < length);
            marks.extend([Rational::ZERO, length.clone()]);
            marks.sort();
            marks.dedup();
            let mut expected: Vec<[i32; 2]> = Vec::new();
            for pair in marks.windows(2) {
                let middle = (&pair[0] + &pair[1]) / Rational::from(2);
                for time in [&middle, &pair[1]] {
                    expected.push([one.at(time).signum(), two.at(time).signum()]);
                }
            }
            expected.pop();
            expected.dedup();
            let both = [one, two];
            let cells = cells(&both, &length, None);
            let mut found: Vec<[i32; 2]> = cells
                .iter()
                .map(|cell| [both[0].sign_in(cell), both[1].sign_in(cell)])
                .collect();
            found.dedup();
            assert_eq!(found, expected, "{seed}: {zeros:?}");
        }
    }
}
