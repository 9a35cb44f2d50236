//! Known reasons for which goals are not reached: missed deadlines, and goals that exclude each
//! other.

use std::collections::BTreeSet;

use super::GoalManager;
use super::open_goal::{GivenGoal, Goals, OpenGoal};
use elbowroom_model::Task;

use crate::planning::Shortfall;
use crate::reason::{Cause, Reason, Subject};

/// Goals that exclude each other.
pub(super) struct Conflict {
    /// Their names.
    pub(super) goals: BTreeSet<String>,
    /// The conjuncts of these goals that exclude each other.
    conjuncts: Vec<String>,
}

impl Conflict {
    /// Returns `true` if this goal excludes goals that are all pursued.
    pub(super) fn is_excluding(&self, goal: &str, pursued: &BTreeSet<String>) -> bool {
        let mut others = self.goals.iter().filter(|name| *name != goal);
        self.goals.contains(goal) && others.all(|name| pursued.contains(name))
    }

    /// Returns the conjuncts as a list in words.
    pub(super) fn in_words(&self) -> String {
        let quoted: Vec<String> = self.conjuncts.iter().map(|it| format!("`{it}`")).collect();
        match quoted.split_last() {
            Some((last, others)) if !others.is_empty() => {
                format!("{} and {last}", others.join(", "))
            }
            _ => quoted.concat(),
        }
    }
}

impl GoalManager<'_> {
    /// Records the information about these goals in the planner's answer.
    pub(in crate::run) fn note_shortfall(&mut self, goals: &Goals, shortfall: &Shortfall) {
        if !self.accepts_requests() {
            return;
        }
        let is_choosing = self.is_selecting_goals();
        if !is_choosing {
            self.conflicts.clear();
            for goal in &mut self.goals {
                goal.is_proven_late = false;
            }
        }
        if !shortfall.conflict.is_empty() {
            self.conflicts.push(shortfall.conflict.clone());
        }
        let pursued: Vec<&GivenGoal> = goals
            .open
            .iter()
            .filter(|it| it.set_aside.is_none())
            .collect();
        let is_alone = pursued.len() == 1;
        let with_deadlines = pursued.iter().filter(|it| it.terms.deadline.is_some());
        for late in &shortfall.missed_deadlines {
            let Some(given) = with_deadlines.clone().nth(late.deadline_index) else {
                continue;
            };
            let same = |goal: &&mut OpenGoal| goal.name == given.name && goal.terms == given.terms;
            let goal = self.goals.iter_mut().find(same);
            let Some((goal, deadline)) = goal.zip(given.terms.deadline.as_ref()) else {
                continue;
            };
            goal.is_proven_late |= late.proven_lower_bound.is_some();
            let mut late = late.clone();
            // A plan for several goals may reach this one later than necessary.
            late.achieved_at = late.achieved_at.filter(|_| is_alone);
            goal.missed_deadline = late.in_words(deadline).or(goal.missed_deadline.take());
        }
    }

    /// Returns the known conflicts among the open goals without deadlines.
    pub(super) fn conflicts(&self, task: &Task) -> Vec<Conflict> {
        let conflicts = self.conflicts.iter().map(|conjuncts| {
            let is_member = |goal: &&OpenGoal| {
                let mut own = goal.ground.conjuncts().into_iter();
                goal.terms.deadline.is_none()
                    && own.any(|it| conjuncts.contains(&task.describe_condition(it)))
            };
            let members = self.goals.iter().filter(is_member);
            Conflict {
                goals: members.map(|goal| goal.name.clone()).collect(),
                conjuncts: conjuncts.clone(),
            }
        });
        conflicts.collect()
    }

    /// Returns a known conflict in words.
    pub(in crate::run) fn first_conflict(&self, task: &Task) -> Option<String> {
        let conflict = self.conflicts(task).into_iter().next();
        conflict.map(|conflict| conflict.in_words())
    }

    /// Returns the number of pursued goals.
    pub(in crate::run) fn pursued_goals(&self) -> usize {
        let goals = self.goals.iter();
        goals.filter(|goal| goal.is_pursued()).count()
    }

    /// Returns the lateness of the pursued goals with deadlines, as far as it is known.
    pub(in crate::run) fn missed_deadlines(&self) -> Vec<Reason> {
        let goals = self.goals.iter();
        let late = goals.filter(|goal| goal.is_pursued()).filter_map(|goal| {
            let late = goal.missed_deadline.as_ref()?;
            let words = format!("`{}` would be reached {late}", goal.name);
            Some(Reason::new(Cause::TooLate).about(Subject::ExternalMessage(words)))
        });
        late.collect()
    }
}
