//! Polynomials in one variable with rational coefficients, and their zeros.

use elbowroom_num::Rational;

/// `c0 + c1 τ + c2 τ² + …`: the coefficients in this order; the last one is not zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Polynomial(Vec<Rational>);

/// A zero of a polynomial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Root {
    /// A rational number.
    Exact(Rational),
    /// The only zero strictly between two numbers that are not zeros.
    Between(Rational, Rational),
}

impl Root {
    /// Returns a number not above the root, and equal to it if the root is known exactly.
    pub(super) fn lower(&self) -> &Rational {
        match self {
            Self::Exact(value) | Self::Between(value, _) => value,
        }
    }

    /// Returns a number not below the root, and equal to it if the root is known exactly.
    pub(super) fn upper(&self) -> &Rational {
        match self {
            Self::Exact(value) | Self::Between(_, value) => value,
        }
    }
}

impl Polynomial {
    pub(super) fn new(mut coefficients: Vec<Rational>) -> Self {
        while coefficients.last().is_some_and(Rational::is_zero) {
            coefficients.pop();
        }
        Self(coefficients)
    }

    pub(super) fn constant(value: Rational) -> Self {
        Self::new(vec![value])
    }

    pub(super) fn is_zero(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the degree; 0 for constants, including zero.
    pub(super) fn degree(&self) -> usize {
        self.0.len().saturating_sub(1)
    }

    /// Returns the value, if the polynomial is constant.
    pub(super) fn as_constant(&self) -> Option<Rational> {
        match self.0.as_slice() {
            [] => Some(Rational::ZERO),
            [value] => Some(value.clone()),
            _ => None,
        }
    }

    /// Returns the value at `at`.
    pub(super) fn at(&self, at: &Rational) -> Rational {
        self.0
            .iter()
            .rev()
            .fold(Rational::ZERO, |total, coefficient| {
                total * at + coefficient
            })
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        let length = self.0.len().max(other.0.len());
        let coefficient = |of: &Self, i: usize| of.0.get(i).cloned().unwrap_or_default();
        Self::new(
            (0..length)
                .map(|i| coefficient(self, i) + coefficient(other, i))
                .collect(),
        )
    }

    pub(super) fn negated(&self) -> Self {
        Self(self.0.iter().map(|coefficient| -coefficient).collect())
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        self.plus(&other.negated())
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return Self(Vec::new());
        }
        let mut product = vec![Rational::ZERO; self.0.len() + other.0.len() - 1];
        for (i, a) in self.0.iter().enumerate() {
            for (j, b) in other.0.iter().enumerate() {
                product[i + j] += a * b;
            }
        }
        Self::new(product)
    }

    pub(super) fn scaled(&self, factor: &Rational) -> Self {
        Self::new(
            self.0
                .iter()
                .map(|coefficient| coefficient * factor)
                .collect(),
        )
    }

    pub(super) fn derivative(&self) -> Self {
        let powers = (1_i64..).map(Rational::from);
        Self::new(
            self.0
                .iter()
                .skip(1)
                .zip(powers)
                .map(|(c, power)| c * power)
                .collect(),
        )
    }

    /// Returns the antiderivative whose value at 0 is `initial`.
    pub(super) fn integral(&self, initial: Rational) -> Self {
        let powers = (1_i64..).map(Rational::from);
        let higher = self.0.iter().zip(powers).map(|(c, power)| c / &power);
        Self::new(std::iter::once(initial).chain(higher).collect())
    }

    /// Returns all zeros strictly between 0 and `length`, sorted; none for the zero polynomial.
    ///
    /// Brackets have no common points with each other, with exact roots, or with the two ends.
    pub(super) fn roots_within(&self, length: &Rational) -> Vec<Root> {
        self.roots_with(length, Vec::new())
    }

    /// Like [`Self::roots_within`], with zeros strictly between the two ends that are already
    /// known.
    pub(super) fn roots_with(&self, length: &Rational, mut exact: Vec<Rational>) -> Vec<Root> {
        let mut rest = self.square_free();
        // The ends are divided out as well, so that no bracket begins or ends at a zero.
        for known in [&Rational::ZERO, length].into_iter().chain(&exact) {
            rest.divide_out(known);
        }
        // Exact zeros found during the search are divided out, and the search restarts without
        // them.
        let brackets = loop {
            if let Some(root) = rest.only_root() {
                rest = Self::constant(Rational::ONE);
                if root.is_positive() && root < *length {
                    exact.push(root);
                }
            }
            let mut points = vec![Rational::ZERO, length.clone()];
            points.extend(exact.iter().cloned());
            points.sort();
            match rest.isolate(&points) {
                Ok(brackets) => break brackets,
                Err(root) => {
                    rest.divide_out(&root);
                    exact.push(root);
                }
            }
        };
        let mut roots: Vec<_> = exact.into_iter().map(Root::Exact).collect();
        roots.extend(
            brackets
                .into_iter()
                .map(|(low, high)| rest.recognised(low, high)),
        );
        roots.sort_by(|a, b| a.lower().cmp(b.lower()));
        roots
    }

    /// Returns brackets of the zeros between the first and the last of `points`; no point is a zero
    /// or an end of a bracket. Returns an exact zero as an error if one is found.
    fn isolate(&self, points: &[Rational]) -> Result<Vec<(Rational, Rational)>, Rational> {
        if self.degree() == 0 {
            return Ok(Vec::new());
        }
        let chain = self.sturm_chain();
        let mut found = Vec::new();
        let mut open: Vec<_> = points
            .windows(2)
            .rev()
            .map(|pair| (pair[0].clone(), pair[1].clone()))
            .collect();
        while let Some((low, high)) = open.pop() {
            let count = changes(&chain, &low) - changes(&chain, &high);
            let touches_a_point = points.contains(&low) || points.contains(&high);
            if count == 0 {
                continue;
            }
            if count == 1 && !touches_a_point {
                found.push((low, high));
                continue;
            }
            let middle = (&low + &high) / Rational::from(2);
            if self.at(&middle).is_zero() {
                return Err(middle);
            }
            open.push((middle.clone(), high));
            open.push((low, middle));
        }
        Ok(found)
    }

    /// Returns the zero in a bracket, exact if it is rational.
    fn recognised(&self, low: Rational, high: Rational) -> Root {
        // With integer coefficients, the denominator of a rational zero divides the leading one, so
        // the zero is a multiple of `unit`.
        let whole = self
            .0
            .iter()
            .try_fold(Rational::ONE, |product, coefficient| {
                Some(product * Rational::from(coefficient.denominator()?))
            });
        let leading = self.0.last().map(Rational::abs);
        let unit = whole
            .zip(leading)
            .and_then(|(whole, leading)| (whole * leading).reciprocal());
        let bracket = Root::Between(low, high);
        let Some(unit) = unit else { return bracket };
        let narrow = self.narrowed(&bracket, &(&unit / Rational::from(2)));
        let candidate = (narrow.upper() / &unit).floor() * &unit;
        if self.at(&candidate).is_zero() && candidate >= *narrow.lower() {
            Root::Exact(candidate)
        } else {
            bracket
        }
    }

    /// Returns the number of distinct zeros strictly between two numbers that are not zeros.
    pub(super) fn count_roots_between(&self, low: &Rational, high: &Rational) -> usize {
        let chain = self.square_free().sturm_chain();
        changes(&chain, low) - changes(&chain, high)
    }

    /// Returns a bracket of the same zero, at most `width` wide; exact if the zero is found.
    pub(super) fn narrowed(&self, root: &Root, width: &Rational) -> Root {
        let Root::Between(low, high) = root else {
            return root.clone();
        };
        let (mut low, mut high) = (low.clone(), high.clone());
        while &high - &low > *width {
            let middle = (&low + &high) / Rational::from(2);
            if self.at(&middle).is_zero() {
                return Root::Exact(middle);
            }
            if self.count_roots_between(&low, &middle) > 0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        Root::Between(low, high)
    }

    /// Returns the polynomial with the same zeros, each once.
    pub(super) fn square_free(&self) -> Self {
        let derivative = self.derivative();
        if derivative.is_zero() {
            return self.clone();
        }
        self.divided(&self.common_divisor(&derivative)).0
    }

    /// Returns the greatest common divisor, up to a factor.
    pub(super) fn common_divisor(&self, other: &Self) -> Self {
        let (mut a, mut b) = (self.clone(), other.clone());
        while !b.is_zero() {
            let remainder = a.divided(&b).1.monic();
            (a, b) = (b, remainder);
        }
        a
    }

    /// Divides by the leading coefficient, to keep numbers small.
    fn monic(&self) -> Self {
        match self.0.last().and_then(Rational::reciprocal) {
            Some(factor) => self.scaled(&factor),
            None => self.clone(),
        }
    }

    /// Returns quotient and remainder; `divisor` must not be zero.
    pub(super) fn divided(&self, divisor: &Self) -> (Self, Self) {
        let leading = divisor.0.last().expect("the divisor is not zero");
        let mut remainder = self.0.clone();
        let mut quotient = Vec::new();
        while remainder.len() >= divisor.0.len() {
            let factor = remainder.last().expect("not shorter than the divisor") / leading;
            let shift = remainder.len() - divisor.0.len();
            for (i, coefficient) in divisor.0.iter().enumerate() {
                remainder[shift + i] -= coefficient * &factor;
            }
            remainder.pop();
            quotient.push(factor);
        }
        quotient.reverse();
        (Self::new(quotient), Self::new(remainder))
    }

    /// Returns the zero of a polynomial of the first degree.
    pub(super) fn only_root(&self) -> Option<Rational> {
        match self.0.as_slice() {
            [c0, c1] => Some(-(c0 / c1)),
            _ => None,
        }
    }

    /// Returns the only zero strictly between 0 and `length`, without a search, if the polynomial
    /// has at most one zero other than 0 and `length`.
    pub(super) fn plain_root_within(&self, length: &Rational) -> Option<Rational> {
        let mut rest = self.clone();
        rest.divide_out(&Rational::ZERO);
        rest.divide_out(length);
        let root = rest.only_root()?;
        (root.is_positive() && root < *length).then_some(root)
    }

    /// Removes the zero `root`, if it is one, from a square-free polynomial.
    pub(super) fn divide_out(&mut self, root: &Rational) {
        if !self.is_zero() && self.at(root).is_zero() {
            *self = self.divided(&Self::new(vec![-root, Rational::ONE])).0;
        }
    }

    /// Returns Sturm's sequence: the polynomial, its derivative, then negated remainders.
    fn sturm_chain(&self) -> Vec<Self> {
        let mut chain = vec![self.clone(), self.derivative()];
        while let [.., before, last] = chain.as_slice()
            && !last.is_zero()
        {
            let remainder = before.divided(last).1.negated();
            // Only signs matter, so remainders are scaled by a positive number.
            let scale = remainder.0.last().and_then(|c| c.abs().reciprocal());
            chain.push(scale.map_or_else(|| remainder.clone(), |scale| remainder.scaled(&scale)));
        }
        chain
    }
}

/// Returns the number of sign changes of the chain's values at `at`, without zeros.
fn changes(chain: &[Polynomial], at: &Rational) -> usize {
    let signs: Vec<_> = chain
        .iter()
        .map(|p| p.at(at).signum())
        .filter(|sign| *sign != 0)
        .collect();
    signs.windows(2).filter(|pair| pair[0] != pair[1]).count()
}
