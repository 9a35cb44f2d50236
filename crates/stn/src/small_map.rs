//! Map that is optimised for few entries.

use std::collections::BTreeMap;

/// Number of entries up to which a list is used.
const MAX_LIST_LENGTH: usize = 8;

/// Map for searches of which very many exist at the same time, each with a few entries. The entries
/// are in a list of exactly the needed size; a B-tree would allocate space for eleven at once. If
/// there are many entries, they are moved to a tree.
#[derive(Clone, Debug)]
pub(crate) struct SmallMap<K, V> {
    /// Empty once there is a tree.
    list: Vec<(K, V)>,
    tree: BTreeMap<K, V>,
}

impl<K, V> Default for SmallMap<K, V> {
    fn default() -> Self {
        Self {
            list: Vec::new(),
            tree: BTreeMap::new(),
        }
    }
}

impl<K: Copy + Ord, V> SmallMap<K, V> {
    pub(crate) fn get(&self, key: K) -> Option<&V> {
        if self.tree.is_empty() {
            let entry = self.list.iter().find(|(own, _)| *own == key);
            entry.map(|(_, value)| value)
        } else {
            self.tree.get(&key)
        }
    }

    pub(crate) fn get_mut(&mut self, key: K) -> Option<&mut V> {
        if self.tree.is_empty() {
            let entry = self.list.iter_mut().find(|(own, _)| *own == key);
            entry.map(|(_, value)| value)
        } else {
            self.tree.get_mut(&key)
        }
    }

    /// Inserts a value, replacing the key's current one if there is one.
    pub(crate) fn insert(&mut self, key: K, value: V) {
        if let Some(own) = self.get_mut(key) {
            *own = value;
        } else if self.tree.is_empty() && self.list.len() < MAX_LIST_LENGTH {
            if self.list.len() == self.list.capacity() {
                self.list.reserve_exact(self.list.len().max(1));
            }
            self.list.push((key, value));
        } else {
            self.tree.extend(std::mem::take(&mut self.list));
            self.tree.insert(key, value);
        }
    }

    pub(crate) fn clear(&mut self) {
        self.list.clear();
        self.tree.clear();
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::SmallMap;

    proptest! {
        #[test]
        fn small_map_agrees_with_btree_map(steps in prop::collection::vec((0..30_usize, 0..40_u32), 0..80)) {
            let (mut few, mut map) = (SmallMap::default(), BTreeMap::new());
            for (key, value) in steps {
                // One step in forty clears the map.
                if value == 0 {
                    few.clear();
                    map.clear();
                } else {
                    few.insert(key, value);
                    map.insert(key, value);
                }
                for key in 0..30 {
                    prop_assert_eq!(few.get(key), map.get(&key));
                    prop_assert_eq!(few.get_mut(key), map.get_mut(&key));
                }
            }
        }
    }
}
