//! Bounds on the differences of times.

use elbowroom_num::Rational;

/// For each two of some times, how much later one may be than the other at most.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Zone {
    size: usize,
    /// `time[one] - time[other] <= most[one * size + other]`, if there is a bound.
    most: Vec<Option<Rational>>,
}

impl Zone {
    /// Any times.
    pub fn any(size: usize) -> Self {
        let mut zone = Self {
            size,
            most: vec![None; size * size],
        };
        for one in 0..size {
            zone.most[one * size + one] = Some(Rational::ZERO);
        }
        zone
    }

    /// How many times there are.
    pub fn size(&self) -> usize {
        self.size
    }

    /// How much later one is than the other at most.
    pub fn get(&self, one: usize, other: usize) -> Option<&Rational> {
        self.most[one * self.size + other].as_ref()
    }

    /// One is at most so much later than the other.
    pub fn limit(&mut self, one: usize, other: usize, most: &Rational) {
        let known = &mut self.most[one * self.size + other];
        if known.as_ref().is_none_or(|known| most < known) {
            *known = Some(most.clone());
        }
    }

    /// Takes a bound away.
    pub fn forget(&mut self, one: usize, other: usize) {
        if one != other {
            self.most[one * self.size + other] = None;
        }
    }

    /// Works out what follows from the bounds; false if there are no such times (Floyd & Warshall).
    #[must_use]
    pub fn close(&mut self) -> bool {
        let size = self.size;
        for via in 0..size {
            for one in 0..size {
                let Some(first) = self.get(one, via).cloned() else {
                    continue;
                };
                for other in 0..size {
                    if let Some(second) = self.get(via, other) {
                        let sum = &first + second;
                        self.limit(one, other, &sum);
                    }
                }
            }
        }
        (0..size).all(|one| !self.get(one, one).is_some_and(Rational::is_negative))
    }

    /// These of the times, in this order; one may be there twice.
    #[must_use]
    pub fn select(&self, times: &[usize]) -> Self {
        let pairs = times
            .iter()
            .flat_map(|&one| times.iter().map(move |&other| (one, other)));
        Self {
            size: times.len(),
            most: pairs
                .map(|(one, other)| self.get(one, other).cloned())
                .collect(),
        }
    }

    /// The same with one more time, which may be any.
    #[must_use]
    pub fn with_another(&self) -> Self {
        let mut zone = Self::any(self.size + 1);
        for one in 0..self.size {
            for other in 0..self.size {
                zone.most[one * zone.size + other] = self.get(one, other).cloned();
            }
        }
        zone
    }

    /// Whether all these times, of which all bounds have been worked out, are within the others.
    pub fn is_within(&self, other: &Self) -> bool {
        self.size == other.size
            && self
                .most
                .iter()
                .zip(&other.most)
                .all(|(own, most)| match (own, most) {
                    (_, None) => true,
                    (Some(own), Some(most)) => own <= most,
                    (None, Some(_)) => false,
                })
    }
}
