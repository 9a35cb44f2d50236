//! Selection of the plan steps that are removed and replaced.

use std::collections::BTreeSet;

use super::super::compile::Compiled;
use super::incumbent::{Block, Incumbent};
use super::random::Random;

/// Selects the blocks to remove around a random one, which is usually on the critical path: blocks
/// that serve the same goals, that have a common object, or that happen at about the same time.
pub(super) fn removed(
    compiled: &Compiled,
    incumbent: &Incumbent,
    most: usize,
    random: &mut Random,
) -> BTreeSet<u32> {
    let free: Vec<u32> = incumbent
        .blocks
        .iter()
        .filter(|(_, block)| block.first.is_some())
        .map(|(&number, _)| number)
        .collect();
    let critical: Vec<u32> = incumbent
        .critical
        .iter()
        .map(|item| item.block)
        .filter(|number| free.binary_search(number).is_ok())
        .collect();
    let pool = if critical.is_empty() || random.once_in(3) {
        &free
    } else {
        &critical
    };
    let Some(&seed) = random.of(pool) else {
        return BTreeSet::new();
    };
    let block = &incumbent.blocks[&seed];
    let size = 1 + random.below(most.max(1));
    let mut removed = match random.below(4) {
        0 => of_one_time(incumbent, block, size),
        1 => of_one_object(compiled, incumbent, block, size, random),
        _ => of_goals(incumbent, block, size, random),
    };
    removed.insert(seed);
    removed
}

/// Returns the blocks near the given one in the sequence.
fn of_one_time(incumbent: &Incumbent, block: &Block, size: usize) -> BTreeSet<u32> {
    let Some(place) = block.first else {
        return BTreeSet::new();
    };
    nearest(incumbent, place, size, |_| true)
}

/// Returns the blocks that share one of the block's objects.
fn of_one_object(
    compiled: &Compiled,
    incumbent: &Incumbent,
    block: &Block,
    size: usize,
    random: &mut Random,
) -> BTreeSet<u32> {
    let arguments = &compiled.action(block.action).arguments;
    let (Some(object), Some(place)) = (random.of(arguments), block.first) else {
        return BTreeSet::new();
    };
    nearest(incumbent, place, 2 * size, |other| {
        compiled.action(other.action).arguments.contains(object)
    })
}

/// Returns the blocks that serve only goals of a set: one goal of the block, and perhaps others.
fn of_goals(
    incumbent: &Incumbent,
    block: &Block,
    size: usize,
    random: &mut Random,
) -> BTreeSet<u32> {
    let count = block.goals.len() * 64;
    let is_in = |bits: &[u64], goal: usize| bits[goal / 64] >> (goal % 64) & 1 == 1;
    let served: Vec<usize> = (0..count).filter(|&g| is_in(&block.goals, g)).collect();
    let Some(&goal) = random.of(&served) else {
        return BTreeSet::new();
    };
    let mut chosen = vec![0_u64; block.goals.len()];
    let mut removed = BTreeSet::new();
    let mut next = Some(goal);
    let blocks = &incumbent.blocks;
    while let Some(goal) = next {
        chosen[goal / 64] |= 1 << (goal % 64);
        let only = |other: &Block| {
            let mut words = other.goals.iter().zip(&chosen);
            other.first.is_some()
                && other.goals.iter().any(|&word| word != 0)
                && words.all(|(serves, chosen)| serves & !chosen == 0)
        };
        let numbers = blocks.iter().filter(|(_, other)| only(other));
        removed = numbers.map(|(&number, _)| number).collect();
        if removed.len() >= size || random.once_in(4) {
            break;
        }
        let others: Vec<u32> = blocks.keys().copied().collect();
        next = random.of(&others).and_then(|other| {
            let bits = &blocks[other].goals;
            let goals: Vec<usize> = (0..count)
                .filter(|&g| is_in(bits, g) && !is_in(&chosen, g))
                .collect();
            random.of(&goals).copied()
        });
    }
    removed
}

/// Returns the wanted blocks that are nearest to a position of the sequence.
fn nearest(
    incumbent: &Incumbent,
    place: usize,
    size: usize,
    is_wanted: impl Fn(&Block) -> bool,
) -> BTreeSet<u32> {
    let blocks = incumbent.blocks.iter();
    let mut near: Vec<(usize, u32)> = blocks
        .filter(|(_, block)| is_wanted(block))
        .filter_map(|(&number, block)| Some((block.first?.abs_diff(place), number)))
        .collect();
    near.sort_unstable();
    near.truncate(size);
    near.into_iter().map(|(_, number)| number).collect()
}
