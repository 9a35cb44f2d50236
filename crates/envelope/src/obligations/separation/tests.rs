//! The nearest interfering pairs, compared with a direct search.

use proptest::prelude::*;

use super::*;

/// Generates footprints over a few facts and fluents.
fn footprints() -> impl Strategy<Value = Vec<Footprint>> {
    let uses = prop::collection::vec((0..6, 0..3_u32), 0..4);
    let footprint = uses.prop_map(|uses| {
        let mut footprint = Footprint::default();
        for (kind, number) in uses {
            let (fact, fluent) = (FactId(number), FluentId(number));
            match kind {
                0 => footprint.reads.insert(fact),
                1 => footprint.adds.insert(fact),
                2 => footprint.deletes.insert(fact),
                3 => footprint.reads_fluents.insert(fluent),
                4 => footprint.shifts.insert(fluent),
                _ => footprint.assigns.insert(fluent),
            };
        }
        footprint
    });
    prop::collection::vec(footprint, 0..25)
}

/// Examines all pairs, and keeps those without a third footprint between them.
fn nearest_pairs_by_brute_force(footprints: &[Footprint]) -> Vec<(usize, usize)> {
    let count = footprints.len();
    let mut is_before = vec![vec![false; count]; count];
    let mut pairs = Vec::new();
    for later in 0..count {
        for first in (0..later).rev() {
            if footprints[first].interferes_with(&footprints[later]) && !is_before[first][later] {
                pairs.push((first, later));
                for row in &mut is_before[..=first] {
                    row[later] |= row[first];
                }
                is_before[first][later] = true;
            }
        }
    }
    pairs
}

proptest! {
    #[test]
    fn nearest_pairs_equal_brute_force(footprints in footprints()) {
        let found = nearest_pairs(footprints.iter().cloned());
        prop_assert_eq!(found, nearest_pairs_by_brute_force(&footprints));
    }
}
