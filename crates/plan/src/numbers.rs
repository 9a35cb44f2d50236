//! Common operations of lists of numbers that are indexed by identifiers.

/// Implements the operations of a list of numbers. Lists of different kinds are different types,
/// and only their own identifiers index them.
macro_rules! numbers_by_id {
    ($list:ident, $id:ty) => {
        impl $list {
            /// Creates a list of numbers, by position.
            pub fn new(numbers: Vec<elbowroom_num::Rational>) -> Self {
                Self { numbers }
            }

            /// Returns the number of entries.
            pub fn len(&self) -> usize {
                self.numbers.len()
            }

            /// Returns `true` if there are no entries.
            pub fn is_empty(&self) -> bool {
                self.numbers.is_empty()
            }

            /// Returns the numbers, by position.
            pub fn iter(&self) -> std::slice::Iter<'_, elbowroom_num::Rational> {
                self.numbers.iter()
            }
        }

        impl std::ops::Index<$id> for $list {
            type Output = elbowroom_num::Rational;
            fn index(&self, id: $id) -> &elbowroom_num::Rational {
                &self.numbers[id.index()]
            }
        }

        impl std::ops::IndexMut<$id> for $list {
            fn index_mut(&mut self, id: $id) -> &mut elbowroom_num::Rational {
                &mut self.numbers[id.index()]
            }
        }

        impl FromIterator<elbowroom_num::Rational> for $list {
            fn from_iter<I: IntoIterator<Item = elbowroom_num::Rational>>(numbers: I) -> Self {
                Self::new(numbers.into_iter().collect())
            }
        }

        impl IntoIterator for $list {
            type Item = elbowroom_num::Rational;
            type IntoIter = std::vec::IntoIter<elbowroom_num::Rational>;
            fn into_iter(self) -> Self::IntoIter {
                self.numbers.into_iter()
            }
        }

        impl<'a> IntoIterator for &'a $list {
            type Item = &'a elbowroom_num::Rational;
            type IntoIter = std::slice::Iter<'a, elbowroom_num::Rational>;
            fn into_iter(self) -> Self::IntoIter {
                self.iter()
            }
        }
    };
}

pub(crate) use numbers_by_id;
