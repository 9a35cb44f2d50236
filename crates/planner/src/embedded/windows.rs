//! Temporal windows: the intervals of time in which a condition holds that only timed initials
//! change.
//!
//! The constraint that a happening is in one of several disjoint intervals, or that a start and its
//! end are in the same one, is closed under the minimum, as simple temporal constraints are: of two
//! assignments of times that satisfy it, the earlier time of each happening makes another one (for
//! a pair, the earlier start decides the interval of both). So constraints of both kinds together
//! have a least solution, if they have one, and propagation of lower bounds finds it without
//! branching (min-closed constraints; Jeavons & Cooper, "Tractable constraints on ordered domains",
//! Artificial Intelligence 79, 1995; for temporal problems: Kumar, "On the tractability of
//! restricted disjunctive temporal problems", ICAPS 2005).

use super::time::Ticks;

/// A closed interval of time.
pub(crate) type Interval = (Ticks, Ticks);

/// Lists of disjoint intervals, each list in ascending order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Windows {
    lists: Vec<Vec<Interval>>,
}

impl Windows {
    /// Returns `true` if there are no lists.
    pub(crate) fn is_empty(&self) -> bool {
        self.lists.is_empty()
    }

    /// Returns the number of a list; equal lists share one.
    pub(crate) fn number(&mut self, list: Vec<Interval>) -> u32 {
        let known = self.lists.iter().position(|other| *other == list);
        let number = known.unwrap_or_else(|| {
            self.lists.push(list);
            self.lists.len() - 1
        });
        u32::try_from(number).expect("fewer than 2^32 lists")
    }

    /// Returns the first interval of a list that ends no earlier than `tail` after `time`, and is no
    /// shorter than `tail`; and whether it is the last such interval.
    pub(crate) fn fit(&self, list: u32, time: Ticks, tail: Ticks) -> Option<(Interval, bool)> {
        let list = &self.lists[list as usize];
        let passed = list.partition_point(|&(_, end)| end - tail < time);
        let mut fitting = list[passed..]
            .iter()
            .filter(|(begin, end)| *begin <= end - tail);
        let first = *fitting.next()?;
        Some((first, fitting.next().is_none()))
    }

    /// Returns all intervals of a list.
    pub(crate) fn list(&self, list: u32) -> &[Interval] {
        &self.lists[list as usize]
    }
}

/// Returns the intersection of two lists.
pub(crate) fn intersection(left: &[Interval], right: &[Interval]) -> Vec<Interval> {
    let pairs = left
        .iter()
        .flat_map(|a| right.iter().map(move |b| (a.0.max(b.0), a.1.min(b.1))));
    // In ascending order, as both lists are.
    pairs.filter(|(begin, end)| begin <= end).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_fitting_interval_is_found() {
        let mut windows = Windows::default();
        let list = windows.number(vec![(0, 10), (20, 22), (30, 50)]);
        assert_eq!(windows.number(vec![(0, 10), (20, 22), (30, 50)]), list);
        assert_eq!(windows.fit(list, 3, 0), Some(((0, 10), false)));
        assert_eq!(windows.fit(list, 11, 0), Some(((20, 22), false)));
        assert_eq!(windows.fit(list, 6, 5), Some(((30, 50), true)));
        assert_eq!(windows.fit(list, 46, 5), None);
    }

    #[test]
    fn intersection_contains_common_intervals() {
        let both = intersection(&[(0, 10), (20, 30)], &[(5, 22), (25, 40)]);
        assert_eq!(both, [(5, 10), (20, 22), (25, 30)]);
    }
}
