//! Symmetric relation on atoms, and sets of atoms, as bit sets.

/// Symmetric relation with one bit set for each atom.
#[derive(Debug)]
pub(super) struct Table {
    count: usize,
    words: usize,
    bits: Vec<u64>,
    /// Round of the last change, by row.
    changed: Vec<u32>,
}

impl Table {
    pub(super) fn new(count: usize) -> Self {
        let words = count.div_ceil(64);
        Self {
            count,
            words,
            bits: vec![0; count * words],
            changed: vec![0; count],
        }
    }

    pub(super) fn row(&self, atom: usize) -> &[u64] {
        &self.bits[atom * self.words..(atom + 1) * self.words]
    }

    pub(super) fn changed(&self, atom: usize) -> u32 {
        self.changed[atom]
    }

    pub(super) fn is_row_empty(&self, atom: usize) -> bool {
        self.row(atom).iter().all(|&word| word == 0)
    }

    /// Adds the pairs of an atom with a set. Returns `true` if one is new.
    pub(super) fn add(&mut self, atom: usize, set: &[u64], round: u32) -> bool {
        let mut has_changed = false;
        for (place, &word) in set.iter().enumerate() {
            let own = &mut self.bits[atom * self.words + place];
            let new = word & !*own;
            *own |= new;
            has_changed |= new != 0;
            for other in ones(new, 64 * place) {
                insert(&mut self.bits[other * self.words..], atom);
                self.changed[other] = round;
            }
        }
        if has_changed {
            self.changed[atom] = round;
        }
        has_changed
    }

    /// As [`add`](Self::add), without the pair of the atom and its negation.
    pub(super) fn add_consistent(
        &mut self,
        atom: usize,
        set: &[u64],
        opposite: Option<usize>,
        round: u32,
    ) -> bool {
        match opposite {
            Some(opposite) if contains(set, opposite) => {
                let mut set = set.to_vec();
                remove(&mut set, opposite);
                self.add(atom, &set, round)
            }
            _ => self.add(atom, set, round),
        }
    }

    /// Returns `true` if every two of these atoms are a pair, and each atom with itself.
    pub(super) fn has_all_pairs(&self, atoms: &[usize]) -> bool {
        atoms.iter().all(|&atom| is_subset(atoms, self.row(atom)))
    }

    /// Returns the atoms that form pairs with all of these and with themselves.
    pub(super) fn all_of(&self, atoms: &[usize]) -> Vec<u64> {
        let Some((&first, rest)) = atoms.split_first() else {
            let mut all = vec![0; self.words];
            for atom in (0..self.count).filter(|&atom| contains(self.row(atom), atom)) {
                insert(&mut all, atom);
            }
            return all;
        };
        let mut all = self.row(first).to_vec();
        for &atom in rest {
            for (all, word) in all.iter_mut().zip(self.row(atom)) {
                *all &= word;
            }
        }
        all
    }

    /// Removes the pairs of another table.
    pub(super) fn without(mut self, other: &Self) -> Self {
        for (own, other) in self.bits.iter_mut().zip(&other.bits) {
            *own &= !other;
        }
        self
    }
}

pub(super) fn contains(set: &[u64], atom: usize) -> bool {
    set[atom / 64] >> (atom % 64) & 1 == 1
}

pub(super) fn insert(set: &mut [u64], atom: usize) {
    set[atom / 64] |= 1 << (atom % 64);
}

pub(super) fn remove(set: &mut [u64], atom: usize) {
    set[atom / 64] &= !(1 << (atom % 64));
}

pub(super) fn intersects(one: &[u64], other: &[u64]) -> bool {
    one.iter().zip(other).any(|(one, other)| one & other != 0)
}

pub(super) fn is_subset(atoms: &[usize], set: &[u64]) -> bool {
    atoms.iter().all(|&atom| contains(set, atom))
}

/// Returns the atoms of a set, in ascending order.
pub(super) fn bits(set: &[u64]) -> impl Iterator<Item = usize> + '_ {
    let words = set.iter().enumerate();
    words.flat_map(|(place, &word)| ones(word, 64 * place))
}

fn ones(mut word: u64, offset: usize) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize)?;
        word &= word - 1;
        Some(offset + bit)
    })
}
