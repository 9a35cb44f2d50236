//! Sparse coefficients of a linear expression.

use elbowroom_num::Rational;

/// Coefficients with their keys, sorted by key; none is zero.
///
/// Nearly all expressions of a plan have one or two coefficients, and a long plan has a hundred
/// thousand expressions. So they are stored in one sorted list of exactly the needed size; a B-tree
/// would allocate space for eleven at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Terms<K>(Vec<(K, Rational)>);

impl<K> Default for Terms<K> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: Copy + Ord> Terms<K> {
    /// Creates a single coefficient, which must not be zero.
    pub(crate) fn one(key: K, coefficient: Rational) -> Self {
        debug_assert!(!coefficient.is_zero(), "no coefficient is zero");
        Self(vec![(key, coefficient)])
    }

    /// Returns the number of coefficients.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns `true` if there are no coefficients.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the coefficient, if there is one.
    pub fn get(&self, key: K) -> Option<&Rational> {
        self.position_of(key).ok().map(|place| &self.0[place].1)
    }

    /// Returns the keys, in order.
    pub fn keys(&self) -> impl Iterator<Item = K> + '_ {
        self.0.iter().map(|(key, _)| *key)
    }

    /// Returns all keys with their coefficients, in order.
    pub fn iter(&self) -> std::slice::Iter<'_, (K, Rational)> {
        self.0.iter()
    }

    /// Adds to a coefficient, dropping it when it becomes zero.
    pub(crate) fn add(&mut self, key: K, coefficient: &Rational) {
        if coefficient.is_zero() {
            return;
        }
        match self.position_of(key) {
            Ok(place) => {
                let own = &mut self.0[place].1;
                *own += coefficient;
                if own.is_zero() {
                    self.0.remove(place);
                }
            }
            Err(place) => {
                if self.0.len() == self.0.capacity() {
                    self.0.reserve_exact(self.0.len().max(1));
                }
                self.0.insert(place, (key, coefficient.clone()));
            }
        }
    }

    /// Removes a coefficient and returns it.
    pub(crate) fn remove(&mut self, key: K) -> Option<Rational> {
        let place = self.position_of(key).ok()?;
        Some(self.0.remove(place).1)
    }

    /// Removes all coefficients.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Returns the position of a key, or the position to insert it at. Most keys are appended at
    /// the end.
    fn position_of(&self, key: K) -> Result<usize, usize> {
        if self.0.last().is_none_or(|(last, _)| *last < key) {
            return Err(self.0.len());
        }
        self.0.binary_search_by_key(&key, |(own, _)| *own)
    }
}

/// Collects coefficients that are sorted by key, none zero.
impl<K: Copy + Ord> FromIterator<(K, Rational)> for Terms<K> {
    fn from_iter<I: IntoIterator<Item = (K, Rational)>>(terms: I) -> Self {
        let mut all = Vec::from_iter(terms);
        debug_assert!(
            all.windows(2).all(|two| two[0].0 < two[1].0),
            "each is after the one before"
        );
        debug_assert!(
            all.iter().all(|(_, coefficient)| !coefficient.is_zero()),
            "no coefficient is zero"
        );
        all.shrink_to_fit();
        Self(all)
    }
}

impl<'a, K: Copy + Ord> IntoIterator for &'a Terms<K> {
    type Item = &'a (K, Rational);
    type IntoIter = std::slice::Iter<'a, (K, Rational)>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
