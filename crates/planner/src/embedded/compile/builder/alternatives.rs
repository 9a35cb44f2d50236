//! One action for each alternative of its disjunctions over moving numbers.

use super::super::Action;
use super::Builder;
use crate::embedded::compile::NONE;
use crate::embedded::formula::Formula;

/// Maximum number of alternatives of one condition, and of variants of one action.
const MOST: usize = 16;

impl Builder<'_> {
    /// Adds an action, with its over-all condition as the last one that was recorded, in as many
    /// variants as its disjunctions over moving numbers have alternatives.
    ///
    /// While the action runs, the over-all condition may pass from one alternative to another. So
    /// the original action is kept in addition to such variants.
    pub(super) fn push_action(&mut self, action: Action) {
        if self.moving.is_empty() || action.start == NONE {
            self.actions.push(action);
            return;
        }
        let start = self.split(&self.snaps[action.start as usize].condition);
        let over_all = self.split(&action.over_all);
        let end = if action.end == NONE {
            vec![Formula::default()]
        } else {
            self.split(&self.snaps[action.end as usize].condition)
        };
        if start.len() * over_all.len() * end.len() > MOST {
            self.actions.push(action);
            return;
        }
        let (first_start, first_end) = (action.start, action.end);
        let mut throughout = over_all;
        if throughout.len() > 1 {
            throughout.insert(0, action.over_all.clone());
        }
        let starts = self.snaps_with(first_start, start);
        let ends = if first_end == NONE {
            vec![NONE]
        } else {
            self.snaps_with(first_end, end)
        };
        let condition = self.over_all.last().cloned();
        let mut is_first = true;
        for over_all in &throughout {
            for &start in &starts {
                for &end in &ends {
                    self.actions.push(Action {
                        start,
                        end,
                        over_all: over_all.clone(),
                        ..action.clone()
                    });
                    if !std::mem::take(&mut is_first) {
                        self.over_all.extend(condition.clone());
                    }
                }
            }
        }
    }

    /// Returns copies of the snap with each of the conditions.
    fn snaps_with(&mut self, snap: u32, conditions: Vec<Formula>) -> Vec<u32> {
        let mut numbers = vec![snap];
        for (place, condition) in conditions.into_iter().enumerate() {
            if place == 0 {
                self.snaps[snap as usize].condition = condition;
                continue;
            }
            let mut other = self.snaps[snap as usize].clone();
            other.condition = condition;
            let separations = self.separations[snap as usize].clone();
            numbers.push(self.push_snap(other, separations));
        }
        numbers
    }

    /// Returns the alternatives of a condition between which moving numbers decide, or the
    /// condition itself if there are too many.
    fn split(&self, condition: &Formula) -> Vec<Formula> {
        let is_moving = |part: &Formula| self.reads_moving(part);
        let alternatives = condition.alternatives(&is_moving, MOST);
        alternatives.unwrap_or_else(|| vec![condition.clone()])
    }

    fn reads_moving(&self, formula: &Formula) -> bool {
        let mut is_moving = false;
        formula.visit_tests(&mut |test| {
            let difference = &self.symbols.tests[test as usize].difference;
            is_moving |= difference.reads_duration();
            difference.visit_fluents(&mut |fluent| {
                is_moving |= self.moving.contains(&self.symbols.fluents[fluent as usize]);
            });
        });
        is_moving
    }
}
