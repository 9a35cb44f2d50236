//! Selection of the goals to pursue if there is no plan for all of them (oversubscription
//! planning).
//!
//! The only source of information is the planner: does it find a plan for a set of goals? With up
//! to [`MAX_EXACT_GOALS`] goals, the sets are tried in order of their value, which is the sum of
//! the values of their goals; sets of equal value are tried in order of size and preference. So the
//! first set with a plan has the greatest value. A superset of a set without a plan is not tried. A
//! goal that is proven to have no plan is not tried again. With more goals, the selection grows:
//! first by one goal, after each success by twice as many as before, and after each failure by half
//! as many. In the end it is maximal, and each plan on the way is executed at once.

use std::collections::BTreeSet;

use elbowroom_num::Rational;

/// Maximum number of goals for an exact selection, which has the greatest value.
const MAX_EXACT_GOALS: usize = 5;

/// The goals, by position in the order of preference.
pub(super) type GoalSet = BTreeSet<usize>;

/// The state of a selection.
#[derive(Clone, Debug)]
pub(super) enum Selection {
    /// The values of the goals, and the sets without a plan.
    Exact {
        values: Vec<Rational>,
        failed: Vec<GoalSet>,
    },
    /// See [`Growth`].
    Growth(GrowingSelection),
}

/// A growing selection.
#[derive(Clone, Debug)]
pub(super) struct GrowingSelection {
    /// The selected goals, for which there is a plan.
    selected: GoalSet,
    /// The goals that have not been tried, the next one last.
    rest: Vec<usize>,
    /// The goals being tried together with the selected ones.
    tried: Vec<usize>,
    /// The goals that are proven to have no plan.
    excluded: GoalSet,
    /// `true` if goals were excluded from the tried ones since the last step.
    is_reduced: bool,
}

/// The next step of a selection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum SelectionStep {
    /// Try this set.
    Try(GoalSet),
    /// The selection is complete. For an empty set: there is no plan for any goal.
    Select(GoalSet),
}

impl Selection {
    /// Selects among goals with these values, for which there is no plan if all are pursued.
    pub(super) fn among(values: Vec<Rational>) -> Self {
        if values.len() <= MAX_EXACT_GOALS {
            let failed = Vec::new();
            return Self::Exact { values, failed };
        }
        Self::Growth(GrowingSelection::new(GoalSet::new(), values.len()))
    }

    /// Adds goals to the first `selected` ones, for which there is a plan.
    pub(super) fn growing(selected: usize, count: usize) -> Self {
        let mut growth = GrowingSelection::new((0..selected).collect(), count);
        growth.tried = std::mem::take(&mut growth.rest);
        growth.tried.reverse();
        Self::Growth(growth)
    }

    /// Records that there is no plan for this set, which may not have been tried.
    pub(super) fn exclude(&mut self, set: GoalSet) {
        match self {
            Self::Exact { failed, .. } => failed.push(set),
            Self::Growth(growth) if set.len() == 1 => {
                growth.rest.retain(|goal| !set.contains(goal));
                let tried = growth.tried.len();
                growth.tried.retain(|goal| !set.contains(goal));
                growth.is_reduced |= growth.tried.len() < tried;
                growth.excluded.extend(set);
            }
            Self::Growth(_) => {}
        }
    }

    /// Returns `true` if it is known that there is no plan for this goal alone.
    pub(super) fn is_excluded(&self, goal: usize) -> bool {
        match self {
            Self::Exact { failed, .. } => failed.contains(&GoalSet::from([goal])),
            Self::Growth(growth) => growth.excluded.contains(&goal),
        }
    }

    /// Returns `true` if no set with this goal was tried since the selection last grew.
    pub(super) fn is_untried(&self, goal: usize) -> bool {
        match self {
            Self::Exact { .. } => false,
            Self::Growth(growth) => growth.rest.contains(&goal),
        }
    }

    /// Returns the next step after no plan was found for this set.
    pub(super) fn after_failure(&mut self, set: GoalSet) -> SelectionStep {
        match self {
            Self::Exact { values, failed } => {
                failed.push(set);
                let is_open = |set: &GoalSet| !failed.iter().any(|failed| failed.is_subset(set));
                let next = sets(values).into_iter().find(is_open);
                next.map_or_else(|| SelectionStep::Select(GoalSet::new()), SelectionStep::Try)
            }
            Self::Growth(growth) => {
                let again = growth.tried.len().div_ceil(2);
                if std::mem::take(&mut growth.is_reduced) && !growth.tried.is_empty() {
                    // The rest of the tried goals may have a plan.
                } else if growth.tried.len() > 1 {
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
    pub(super) fn after_success(&mut self, set: GoalSet) -> SelectionStep {
        match self {
            Self::Exact { .. } => SelectionStep::Select(set),
            Self::Growth(growth) => {
                growth.selected = set;
                let next = 2 * growth.tried.len().max(1);
                growth.take(next);
                growth.step()
            }
        }
    }
}

impl GrowingSelection {
    fn new(selected: GoalSet, count: usize) -> Self {
        let rest: Vec<usize> = (selected.len()..count).rev().collect();
        Self {
            selected,
            rest,
            tried: Vec::new(),
            excluded: GoalSet::new(),
            is_reduced: false,
        }
    }

    /// Takes the next goals to try.
    fn take(&mut self, count: usize) {
        let left = self.rest.len().saturating_sub(count);
        self.tried = self.rest.split_off(left);
        self.tried.reverse();
    }

    fn step(&self) -> SelectionStep {
        if self.tried.is_empty() {
            return SelectionStep::Select(self.selected.clone());
        }
        SelectionStep::Try(self.selected.iter().chain(&self.tried).copied().collect())
    }
}

/// Returns all sets of goals with these values, in the order of trial.
fn sets(values: &[Rational]) -> Vec<GoalSet> {
    let all = 1_u32..1 << values.len();
    let set = |bits: u32| -> Vec<usize> {
        let positions = 0..values.len();
        positions.filter(|it| bits >> it & 1 == 1).collect()
    };
    let mut sets: Vec<(Rational, Vec<usize>)> = all
        .map(|bits| {
            let set = set(bits);
            (set.iter().map(|it| &values[*it]).sum(), set)
        })
        .collect();
    sets.sort_by(|(value, set), (other_value, other)| {
        let by_value = other_value.cmp(value);
        by_value
            .then(other.len().cmp(&set.len()))
            .then(set.cmp(other))
    });
    sets.into_iter()
        .map(|(_, set)| set.into_iter().collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use elbowroom_num::Rational;

    use super::{GoalSet, MAX_EXACT_GOALS, Selection, SelectionStep};

    /// Goals of equal value.
    fn equal(count: usize) -> Vec<Rational> {
        vec![Rational::ONE; count]
    }

    /// Runs a selection among goals of these values to its end. Returns the selected set and the
    /// number of queries.
    fn select(values: &[Rational], has_plan: impl Fn(&GoalSet) -> bool) -> (GoalSet, usize) {
        let all: GoalSet = (0..values.len()).collect();
        let mut selection = Selection::among(values.to_vec());
        let mut step = selection.after_failure(all);
        for questions in 1.. {
            step = match step {
                SelectionStep::Select(set) => return (set, questions),
                SelectionStep::Try(set) if has_plan(&set) => selection.after_success(set),
                SelectionStep::Try(set) => selection.after_failure(set),
            };
        }
        unreachable!("a selection ends")
    }

    fn value(values: &[Rational], set: &GoalSet) -> Rational {
        set.iter().map(|it| &values[*it]).sum()
    }

    /// Returns the greatest value of a set without a conflict, by trying all sets.
    fn greatest_value(values: &[Rational], conflicts: &[GoalSet]) -> Rational {
        let count = values.len();
        let sets = (0_u32..1 << count)
            .map(|bits| -> GoalSet { (0..count).filter(|it| bits >> it & 1 == 1).collect() });
        let fits = |set: &GoalSet| !conflicts.iter().any(|conflict| conflict.is_subset(set));
        let fitting = sets.filter(fits).map(|set| value(values, &set));
        fitting.max().unwrap_or_default()
    }

    proptest! {
        #[test]
        fn selections_are_maximal_and_small_ones_optimal(
            values in prop::collection::vec(1_i64..9, 1..12),
            conflicts in prop::collection::vec(prop::collection::btree_set(0_usize..12, 1..4), 0..6),
        ) {
            let values: Vec<Rational> = values.into_iter().map(Rational::from).collect();
            let count = values.len();
            let all: GoalSet = (0..count).collect();
            let mut conflicts: Vec<GoalSet> = conflicts.into_iter().filter(|it| it.is_subset(&all)).collect();
            if conflicts.is_empty() {
                conflicts.push(all);
            }
            let fits = |set: &GoalSet| !conflicts.iter().any(|conflict| conflict.is_subset(set));
            let (selected, _) = select(&values, fits);
            prop_assert!(fits(&selected));
            for other in 0..count {
                let mut more = selected.clone();
                prop_assert!(!more.insert(other) || !fits(&more), "{selected:?} and {other}");
            }
            if count <= MAX_EXACT_GOALS {
                prop_assert_eq!(value(&values, &selected), greatest_value(&values, &conflicts));
            }
        }
    }

    #[test]
    fn preferred_goals_remain_selected() {
        let conflict: GoalSet = [0, 1].into();
        let (selected, _) = select(&equal(3), |set| !conflict.is_subset(set));
        assert_eq!(selected, [0, 2].into());
        let conflict: GoalSet = [3, 8].into();
        let (selected, _) = select(&equal(10), |set| !conflict.is_subset(set));
        assert_eq!(selected, (0..10).filter(|it| *it != 8).collect());
    }

    #[test]
    fn single_impossible_goal_needs_few_attempts() {
        let (selected, questions) = select(&equal(200), |set| !set.contains(&77));
        assert_eq!(selected.len(), 199);
        assert!(questions < 30, "{questions}");
    }

    #[test]
    fn goals_without_plan_by_proof_are_not_tried_again() {
        for count in [3, 4, 5, 8, 40] {
            // No plan reaches goal 1, which is proven by the first attempt with it.
            let mut selection = Selection::among(equal(count));
            let mut step = selection.after_failure((0..count).collect());
            let mut failures = 0;
            let selected = loop {
                step = match step {
                    SelectionStep::Select(set) => break set,
                    SelectionStep::Try(set) if set.contains(&1) => {
                        failures += 1;
                        selection.exclude([1].into());
                        selection.after_failure(set)
                    }
                    SelectionStep::Try(set) => selection.after_success(set),
                };
            };
            assert_eq!(selected, (0..count).filter(|it| *it != 1).collect());
            assert!(selection.is_excluded(1), "{count}");
            assert_eq!(failures, 1, "{count}");
        }
    }

    #[test]
    fn new_goals_are_added_to_selection() {
        let mut selection = Selection::growing(2, 4);
        let tried = |step: SelectionStep| match step {
            SelectionStep::Try(set) => set,
            SelectionStep::Select(set) => panic!("{set:?} is selected"),
        };
        // The selection begins with a failure, because all goals are already pursued.
        let set = tried(selection.after_failure((0..4).collect()));
        assert_eq!(set, [0, 1, 2].into());
        let set = tried(selection.after_failure(set));
        assert_eq!(set, [0, 1, 3].into());
        assert_eq!(
            selection.after_success(set),
            SelectionStep::Select([0, 1, 3].into())
        );
    }
}
