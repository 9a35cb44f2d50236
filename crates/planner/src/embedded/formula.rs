//! Conditions and numeric expressions in the form used by the search.
//!
//! Facts and fluents are small integers, by position in [`Compiled`](super::compile::Compiled).

use elbowroom_model::ground::Expression;
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

/// A fact with a required truth: twice the fact, plus one for false.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Literal(pub(crate) u32);

impl Literal {
    pub(crate) fn new(fact: u32, truth: bool) -> Self {
        Self(2 * fact + u32::from(!truth))
    }

    pub(crate) fn fact(self) -> u32 {
        self.0 / 2
    }

    pub(crate) fn truth(self) -> bool {
        self.0.is_multiple_of(2)
    }

    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }

    /// Returns `true` if it holds in the state whose true facts are set in `facts`.
    pub(crate) fn holds(self, facts: &[u64]) -> bool {
        is_set(facts, self.fact()) == self.truth()
    }
}

/// Returns `true` if a bit is set.
pub(crate) fn is_set(bits: &[u64], index: u32) -> bool {
    bits[index as usize / 64] >> (index % 64) & 1 == 1
}

/// Sets or clears a bit.
pub(crate) fn set(bits: &mut [u64], index: u32, value: bool) {
    let mask = 1 << (index % 64);
    let word = &mut bits[index as usize / 64];
    if value {
        *word |= mask;
    } else {
        *word &= !mask;
    }
}

/// All literals, all tests, and one alternative of each choice.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Formula {
    pub(crate) literals: Vec<Literal>,
    /// Positions in [`Compiled::tests`](super::compile::Compiled::tests).
    pub(crate) tests: Vec<u32>,
    /// A choice without alternatives never holds.
    pub(crate) choices: Vec<Vec<Formula>>,
}

impl Formula {
    /// Returns `true` if it always holds.
    pub(crate) fn is_trivial(&self) -> bool {
        self.literals.is_empty() && self.tests.is_empty() && self.choices.is_empty()
    }

    /// Returns `true` if it holds. `test` evaluates a numeric test.
    pub(crate) fn holds(&self, facts: &[u64], test: &mut dyn FnMut(u32) -> bool) -> bool {
        self.literals.iter().all(|literal| literal.holds(facts))
            && self.tests.iter().all(|&number| test(number))
            && self
                .choices
                .iter()
                .all(|choice| choice.iter().any(|part| part.holds(facts, test)))
    }

    /// Returns `true` if it may hold for some facts. `test` returns `true` for a numeric test that may hold.
    pub(crate) fn may_hold(&self, test: &mut dyn FnMut(u32) -> bool) -> bool {
        self.tests.iter().all(|&number| test(number))
            && self
                .choices
                .iter()
                .all(|choice| choice.iter().any(|part| part.may_hold(test)))
    }

    /// Calls `visit` for each literal, including nested ones.
    pub(crate) fn visit_literals(&self, visit: &mut dyn FnMut(Literal)) {
        self.literals.iter().copied().for_each(&mut *visit);
        for part in self.choices.iter().flatten() {
            part.visit_literals(visit);
        }
    }

    /// Calls `visit` for each test, including nested ones.
    pub(crate) fn visit_tests(&self, visit: &mut dyn FnMut(u32)) {
        self.tests.iter().copied().for_each(&mut *visit);
        for part in self.choices.iter().flatten() {
            part.visit_tests(visit);
        }
    }

    /// Returns formulas whose disjunction is this one, without the choices that have an alternative
    /// for which `splits` returns `true`. Returns `None` if there are more than `most`.
    pub(crate) fn alternatives(
        &self,
        splits: &dyn Fn(&Self) -> bool,
        most: usize,
    ) -> Option<Vec<Self>> {
        let mut choices = self.choices.iter();
        let Some(place) = choices.position(|choice| choice.iter().any(splits)) else {
            return Some(vec![self.clone()]);
        };
        let mut rest = self.clone();
        let choice = rest.choices.remove(place);
        let mut found = Vec::new();
        for part in choice {
            let mut with = rest.clone();
            with.join(part);
            found.extend(with.alternatives(splits, most)?);
            if found.len() > most {
                return None;
            }
        }
        Some(found)
    }

    /// Adds the conjuncts of another formula.
    pub(crate) fn join(&mut self, other: Self) {
        for literal in other.literals {
            if !self.literals.contains(&literal) {
                self.literals.push(literal);
            }
        }
        for test in other.tests {
            if !self.tests.contains(&test) {
                self.tests.push(test);
            }
        }
        self.choices.extend(other.choices);
    }
}

/// `difference comparison 0`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Test {
    pub(crate) comparison: Comparison,
    pub(crate) difference: Numeric,
}

/// A numeric expression.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Numeric {
    /// Linear in fluents and `?duration`.
    Linear(Linear),
    /// Anything else; its fluents are positions in
    /// [`Compiled::fluents`](super::compile::Compiled::fluents).
    Other(Expression),
}

/// `Σ coefficient · fluent + duration · ?duration + constant`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Linear {
    /// Ascending, without zeros.
    pub(crate) terms: Vec<(u32, Rational)>,
    pub(crate) duration: Rational,
    pub(crate) constant: Rational,
}

impl Linear {
    pub(crate) fn constant(constant: Rational) -> Self {
        Self {
            constant,
            ..Self::default()
        }
    }

    fn is_constant(&self) -> bool {
        self.terms.is_empty() && self.duration.is_zero()
    }

    /// Adds `factor · other`.
    pub(crate) fn add(&mut self, factor: &Rational, other: &Self) {
        for (fluent, coefficient) in &other.terms {
            let change = factor * coefficient;
            match self.terms.binary_search_by_key(fluent, |term| term.0) {
                Ok(found) => self.terms[found].1 += change,
                Err(place) => self.terms.insert(place, (*fluent, change)),
            }
        }
        self.terms.retain(|term| !term.1.is_zero());
        self.duration += factor * &other.duration;
        self.constant += factor * &other.constant;
    }

    fn scaled(&self, factor: &Rational) -> Self {
        let mut scaled = Self::default();
        scaled.add(factor, self);
        scaled
    }

    /// Returns the linear form of an expression, if it has one.
    pub(crate) fn of(expression: &Expression) -> Option<Self> {
        Some(match expression {
            Expression::Constant(value) => Self::constant(value.clone()),
            Expression::Fluent(fluent) => Self {
                terms: vec![(fluent.0, Rational::ONE)],
                ..Self::default()
            },
            Expression::Duration => Self {
                duration: Rational::ONE,
                ..Self::default()
            },
            Expression::TotalTime | Expression::Violations(_) | Expression::Unknown(_) => {
                return None;
            }
            Expression::Add(parts) => {
                let mut sum = Self::default();
                for part in parts {
                    sum.add(&Rational::ONE, &Self::of(part)?);
                }
                sum
            }
            Expression::Subtract(left, right) => {
                let mut difference = Self::of(left)?;
                difference.add(&Rational::from(-1), &Self::of(right)?);
                difference
            }
            Expression::Negate(part) => Self::of(part)?.scaled(&Rational::from(-1)),
            Expression::Multiply(parts) => {
                let mut product = Self::constant(Rational::ONE);
                for part in parts {
                    let part = Self::of(part)?;
                    product = if part.is_constant() {
                        product.scaled(&part.constant)
                    } else if product.is_constant() {
                        part.scaled(&product.constant)
                    } else {
                        return None;
                    };
                }
                product
            }
            Expression::Divide(left, right) => {
                let divisor = Self::of(right)?;
                if !divisor.is_constant() {
                    return None;
                }
                Self::of(left)?.scaled(&divisor.constant.reciprocal()?)
            }
        })
    }
}

impl Numeric {
    pub(crate) fn of(expression: Expression) -> Self {
        match Linear::of(&expression) {
            Some(linear) => Self::Linear(linear),
            None => Self::Other(expression),
        }
    }

    /// Returns the value, unless the expression reads a fluent without a value.
    pub(crate) fn value(
        &self,
        values: &[Option<Rational>],
        duration: Option<&Rational>,
    ) -> Option<Rational> {
        match self {
            Self::Linear(linear) => {
                let mut sum = linear.constant.clone();
                for (fluent, coefficient) in &linear.terms {
                    sum += coefficient * values[*fluent as usize].as_ref()?;
                }
                if !linear.duration.is_zero() {
                    sum += &linear.duration * duration?;
                }
                Some(sum)
            }
            Self::Other(expression) => expression.evaluate(&mut |leaf| match leaf {
                Expression::Fluent(fluent) => values[fluent.index()].clone(),
                Expression::Duration => duration.cloned(),
                _ => None,
            }),
        }
    }

    /// Returns its value if it reads no fluents.
    pub(crate) fn as_constant(&self) -> Option<&Rational> {
        match self {
            Self::Linear(linear) if linear.is_constant() => Some(&linear.constant),
            _ => None,
        }
    }

    /// Calls `visit` for each fluent that the expression reads.
    pub(crate) fn visit_fluents(&self, visit: &mut dyn FnMut(u32)) {
        match self {
            Self::Linear(linear) => linear.terms.iter().for_each(|term| visit(term.0)),
            Self::Other(expression) => expression.visit_fluents(&mut |fluent| visit(fluent.0)),
        }
    }

    /// Returns `true` if it reads `?duration`.
    pub(crate) fn reads_duration(&self) -> bool {
        match self {
            Self::Linear(linear) => !linear.duration.is_zero(),
            Self::Other(expression) => {
                let mut reads = false;
                expression.visit_leaves(&mut |leaf| reads |= *leaf == Expression::Duration);
                reads
            }
        }
    }
}
