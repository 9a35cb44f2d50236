//! Bounds on the differences of times.

use elbowroom_num::Rational;

/// Upper bounds on the pairwise differences of a sequence of times.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Zone {
    size: usize,
    /// `time[one] - time[other] <= most[one * size + other]`, if there is a bound.
    most: Vec<Option<Rational>>,
}

impl Zone {
    /// Returns a zone without bounds.
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

    /// Returns the number of times.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Returns the upper bound of `time[one] - time[other]`, if there is one.
    pub fn get(&self, one: usize, other: usize) -> Option<&Rational> {
        self.most[one * self.size + other].as_ref()
    }

    /// Adds the bound `time[one] - time[other] <= most`.
    pub fn limit(&mut self, one: usize, other: usize, most: &Rational) {
        let known = &mut self.most[one * self.size + other];
        if known.as_ref().is_none_or(|known| most < known) {
            *known = Some(most.clone());
        }
    }

    /// Removes a bound.
    pub fn forget(&mut self, one: usize, other: usize) {
        if one != other {
            self.most[one * self.size + other] = None;
        }
    }

    /// Adds all implied bounds; returns `false` if the bounds are contradictory (Floyd & Warshall).
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

    /// Returns the zone of these times, in this order. A time may be listed twice.
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

    /// Returns the zone with one more time, which is unbounded.
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

    /// Returns `true` if all times of this zone, which has to be closed, are within the other one.
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
