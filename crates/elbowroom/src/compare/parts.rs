//! Experiments in parts: which parts belong together, and what they make together.

use std::fmt::Debug;

/// Results of a part of an experiment, or of several.
pub(crate) trait Partial: Clone {
    /// What distinguishes the experiment, and into how many parts it was split.
    fn origin(&self) -> (&str, u64);
    /// Whether both have the same rows and columns.
    fn has_shape_of(&self, other: &Self) -> bool;
    /// Into how many parts it was split, and which of them are in here.
    fn parts(&mut self) -> (&mut u64, &mut Vec<u64>);
    /// Adds the counts of another part.
    fn add(&mut self, other: &Self);
}

/// Puts parts of one experiment together.
///
/// # Errors
/// When they are parts of different ones, or the same part comes twice; the message for the user.
pub(crate) fn merged<P: Partial>(parts: &[P]) -> Result<P, String> {
    let Some((first, rest)) = parts.split_first() else {
        return Err("there is nothing to put together".to_owned());
    };
    let mut whole = first.clone();
    for part in rest {
        if part.origin() != whole.origin() || !part.has_shape_of(&whole) {
            return Err("these are parts of different experiments".to_owned());
        }
        whole.add(part);
        let mut part = part.clone();
        let (theirs, mine) = (part.parts().1, whole.parts().1);
        if let Some(twice) = theirs.iter().find(|shard| mine.contains(shard)) {
            return Err(format!("part {twice} is there twice"));
        }
        mine.append(theirs);
    }
    let (count, shards) = whole.parts();
    shards.sort_unstable();
    if (0..*count).eq(shards.iter().copied()) {
        (*count, *shards) = (1, vec![0]);
    }
    Ok(whole)
}

/// A number that is different for different experiments: FNV-1a over all that they depend on.
pub(crate) fn fingerprint(experiment: &impl Debug, trials: u64) -> String {
    let everything = format!("{trials} {experiment:?}");
    let hash = everything
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
    format!("{hash:016x}")
}
