//! Sets of instants, as ranges.

use std::ops::Range;

/// Sorted ranges that neither overlap nor touch.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Ranges(Vec<Range<i64>>);

impl Ranges {
    /// Returns the union of the ranges.
    pub(crate) fn union(mut all: Vec<Range<i64>>) -> Self {
        all.retain(|range| range.start < range.end);
        all.sort_by_key(|range| range.start);
        let mut united: Vec<Range<i64>> = Vec::with_capacity(all.len());
        for range in all {
            match united.last_mut() {
                Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
                _ => united.push(range),
            }
        }
        Self(united)
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Range<i64>> {
        self.0.iter()
    }

    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn contains(&self, instant: i64) -> bool {
        let next = self.0.partition_point(|range| range.end <= instant);
        self.0.get(next).is_some_and(|range| range.start <= instant)
    }
}

#[cfg(test)]
mod tests {
    use super::Ranges;

    #[test]
    fn overlapping_and_touching_ranges_are_united() {
        let union = Ranges::union(vec![5..9, 1..3, 3..4, 8..12, 20..20]);
        assert_eq!(union, Ranges(vec![1..4, 5..12]));
        assert!(union.contains(1) && union.contains(11));
        assert!(!union.contains(4) && !union.contains(12));
    }
}
