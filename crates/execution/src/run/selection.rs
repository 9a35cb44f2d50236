//! Selection of the goals to pursue if there is no plan for all of them (oversubscription planning).
//!
//! The only source of knowledge is the planner: whether it finds a plan for a set of goals. Up to [`MOST_EXACT`] goals,
//! the sets are tried in order of size, and sets of equal size in order of preference, so that the first set with a plan is
//! a largest one. A set that contains a set without a plan is not tried. With more goals, the selection grows: by one goal
//! first, after each success by twice as many as before, after each failure by half as many. It is maximal in the
//! end, and each plan on the way there is executed at once.

use std::collections::BTreeSet;

/// The greatest number of goals for which the largest set is selected.
const MOST_EXACT: usize = 5;

/// The goals, by position in the order of preference.
pub(super) type Set = BTreeSet<usize>;

/// The state of a selection.
#[derive(Clone, Debug)]
pub(super) enum Selection {
    /// The number of goals, and the sets without a plan.
    Exact { count: usize, failed: Vec<Set> },
    /// See [`Growth`].
    Growth(Growth),
}

/// A selection that grows.
#[derive(Clone, Debug)]
pub(super) struct Growth {
    /// The selected goals: there is a plan for these.
    selected: Set,
    /// The goals that have not been tried, the next one last.
    rest: Vec<usize>,
    /// The goals that are tried together with the selected ones.
    tried: Vec<usize>,
}

/// The next step of a selection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Try this set.
    Try(Set),
    /// The selection is complete. For an empty set: there is no plan for any goal.
    Select(Set),
}

impl Selection {
    /// Selects among goals for which there is no plan if all are pursued.
    pub(super) fn among(count: usize) -> Self {
        if count <= MOST_EXACT {
            let failed = Vec::new();
            return Self::Exact { count, failed };
        }
        Self::Growth(Growth::new(Set::new(), count))
    }

    /// Adds goals to the first `selected` ones, for which there is a plan.
    pub(super) fn grown(selected: usize, count: usize) -> Self {
        let mut growth = Growth::new((0..selected).collect(), count);
        growth.tried = std::mem::take(&mut growth.rest);
        growth.tried.reverse();
        Self::Growth(growth)
    }

    /// Returns `true` if it is known that there is no plan for this goal alone.
    pub(super) fn is_excluded(&self, goal: usize) -> bool {
        match self {
            Self::Exact { failed, .. } => failed.contains(&Set::from([goal])),
            Self::Growth(_) => false,
        }
    }

    /// Returns the next step after no plan was found for this set.
    pub(super) fn after_failure(&mut self, set: Set) -> Step {
        match self {
            Self::Exact { count, failed } => {
                failed.push(set);
                let is_open = |set: &Set| !failed.iter().any(|failed| failed.is_subset(set));
                let mut sizes = (1..*count).rev();
                let next = sizes.find_map(|size| subsets(*count, size).into_iter().find(is_open));
                next.map_or_else(|| Step::Select(Set::new()), Step::Try)
            }
            Self::Growth(growth) => {
                let again = growth.tried.len().div_ceil(2);
                if growth.tried.len() > 1 {
                    growth.rest.extend(growth.tried.drain(again..).rev());
                } else {
                    growth.tried.clear();
                    growth.take(1);
                }
                growth.step()
            }
        }
    }

    /// Returns the next step after a plan was found for this set.
    pub(super) fn after_success(&mut self, set: Set) -> Step {
        match self {
            Self::Exact { .. } => Step::Select(set),
            Self::Growth(growth) => {
                growth.selected = set;
                let next = 2 * growth.tried.len().max(1);
                growth.take(next);
                growth.step()
            }
        }
    }
}

impl Growth {
    fn new(selected: Set, count: usize) -> Self {
        let rest: Vec<usize> = (selected.len()..count).rev().collect();
        let tried = Vec::new();
        Self {
            selected,
            rest,
            tried,
        }
    }

    /// The next goals to try.
    fn take(&mut self, count: usize) {
        let left = self.rest.len().saturating_sub(count);
        self.tried = self.rest.split_off(left);
        self.tried.reverse();
    }

    fn step(&self) -> Step {
        if self.tried.is_empty() {
            return Step::Select(self.selected.clone());
        }
        Step::Try(self.selected.iter().chain(&self.tried).copied().collect())
    }
}

/// The sets of `size` goals among `count`, those with preferred goals first.
fn subsets(count: usize, size: usize) -> Vec<Set> {
    let all = (0_u32..1 << count).filter(|bits| bits.count_ones() as usize == size);
    let set = |bits: u32| -> Vec<usize> { (0..count).filter(|it| bits >> it & 1 == 1).collect() };
    let mut sets: Vec<Vec<usize>> = all.map(set).collect();
    sets.sort_unstable();
    sets.into_iter()
        .map(|set| set.into_iter().collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{MOST_EXACT, Selection, Set, Step};

    /// Runs a selection among `count` goals to its end. Returns the selected set and the number of questions.
    fn select(count: usize, has_plan: impl Fn(&Set) -> bool) -> (Set, usize) {
        let all: Set = (0..count).collect();
        let mut selection = Selection::among(count);
        let mut step = selection.after_failure(all);
        for questions in 1.. {
            step = match step {
                Step::Select(set) => return (set, questions),
                Step::Try(set) if has_plan(&set) => selection.after_success(set),
                Step::Try(set) => selection.after_failure(set),
            };
        }
        unreachable!("a selection ends")
    }

    /// The size of a largest set without a conflict: all sets are tried.
    fn largest(count: usize, conflicts: &[Set]) -> usize {
        let sets = (0_u32..1 << count)
            .map(|bits| -> Set { (0..count).filter(|it| bits >> it & 1 == 1).collect() });
        let fits = |set: &Set| !conflicts.iter().any(|conflict| conflict.is_subset(set));
        sets.filter(fits).map(|set| set.len()).max().unwrap_or(0)
    }

    proptest! {
        #[test]
        fn selections_are_maximal_and_small_ones_are_largest(
            count in 1_usize..12,
            conflicts in prop::collection::vec(prop::collection::btree_set(0_usize..12, 1..4), 0..6),
        ) {
            let all: Set = (0..count).collect();
            let mut conflicts: Vec<Set> = conflicts.into_iter().filter(|it| it.is_subset(&all)).collect();
            if conflicts.is_empty() {
                conflicts.push(all);
            }
            let fits = |set: &Set| !conflicts.iter().any(|conflict| conflict.is_subset(set));
            let (selected, _) = select(count, fits);
            prop_assert!(fits(&selected));
            for other in 0..count {
                let mut more = selected.clone();
                prop_assert!(!more.insert(other) || !fits(&more), "{selected:?} and {other}");
            }
            if count <= MOST_EXACT {
                prop_assert_eq!(selected.len(), largest(count, &conflicts));
            }
        }
    }

    #[test]
    fn preferred_goals_stay() {
        let conflict: Set = [0, 1].into();
        let (selected, _) = select(3, |set| !conflict.is_subset(set));
        assert_eq!(selected, [0, 2].into());
        let conflict: Set = [3, 8].into();
        let (selected, _) = select(10, |set| !conflict.is_subset(set));
        assert_eq!(selected, (0..10).filter(|it| *it != 8).collect());
    }

    #[test]
    fn one_impossible_goal_among_many_costs_few_questions() {
        let (selected, questions) = select(200, |set| !set.contains(&77));
        assert_eq!(selected.len(), 199);
        assert!(questions < 30, "{questions}");
    }

    #[test]
    fn a_selection_grows_by_new_goals() {
        let mut selection = Selection::grown(2, 4);
        let tried = |step: Step| match step {
            Step::Try(set) => set,
            Step::Select(set) => panic!("{set:?} is selected"),
        };
        // A failure is announced before anything was asked: the goals are pursued already.
        let set = tried(selection.after_failure((0..4).collect()));
        assert_eq!(set, [0, 1, 2].into());
        let set = tried(selection.after_failure(set));
        assert_eq!(set, [0, 1, 3].into());
        assert_eq!(selection.after_success(set), Step::Select([0, 1, 3].into()));
    }
}
