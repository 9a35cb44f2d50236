//! Known reasons for which goals are not reached: missed deadlines, and goals that exclude each
//! other.

use std::collections::BTreeSet;

use super::GoalManager;
use super::open_goal::{GivenGoal, Goals, OpenGoal};
use elbowroom_model::Task;
use elbowroom_model::ground::Condition;

use crate::planning::Shortfall;
use crate::reason::{Cause, Reason, Subject};
use crate::record::UnreachedGoal;
use crate::run::settings::Verdict;

/// Goals that exclude each other.
pub(in crate::run) struct Conflict {
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

    /// Returns the reason that the conjuncts exclude each other.
    pub(in crate::run) fn reason(&self) -> Reason {
        Reason::new(Cause::NotTogether).about(Subject::ExternalMessage(self.in_words()))
    }

    /// Returns `true` if all conjuncts are parts of this goal.
    fn is_within(&self, goal: &OpenGoal, task: &Task) -> bool {
        let own = goal.ground.conjuncts().into_iter();
        let own: BTreeSet<String> = own.map(|it| task.describe_condition(it)).collect();
        self.conjuncts.iter().all(|it| own.contains(it))
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
                goal.failed_search = None;
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

    /// Returns a known conflict.
    pub(in crate::run) fn first_conflict(&self, task: &Task) -> Option<Conflict> {
        self.conflicts(task).into_iter().next()
    }

    /// Records the verdict of a search for a single goal.
    pub(super) fn note_failed_search(&mut self, verdict: &Verdict) {
        let mut pursued = self.goals.iter_mut().filter(|goal| goal.is_pursued());
        if let (Some(only), None) = (pursued.next(), pursued.next()) {
            only.failed_search = Some(verdict.clone());
        }
    }

    /// Returns `true` if an open goal can never become true.
    pub(in crate::run) fn is_any_unreachable(&self) -> bool {
        self.goals.iter().any(|goal| goal.unreachable.is_some())
    }

    /// Returns the verdict of the search for the first of these goals that is not proven to be
    /// impossible.
    pub(in crate::run) fn undecided_verdict(&self, unreached: &[UnreachedGoal]) -> Option<Verdict> {
        let open = unreached.iter().find(|goal| !goal.is_impossible)?;
        let goal = self.goals.iter().find(|goal| goal.name == open.name)?;
        goal.failed_search.clone()
    }

    /// Returns the open goals after this verdict, which is not that they are reached, with the
    /// reasons about each of them. `parts` are conditions that can never become true again.
    pub(in crate::run) fn unreached(
        &self,
        task: &Task,
        verdict: &Verdict,
        parts: &[(Condition, Reason)],
    ) -> Vec<UnreachedGoal> {
        if *verdict == Verdict::GoalReached {
            return Vec::new();
        }
        let conflicts = self.conflicts(task);
        let goals = self.goals.iter();
        let unreached = goals.map(|goal| {
            let own = goal.ground.conjuncts();
            let lost = parts.iter().filter(|(part, _)| own.contains(&part));
            let inner = conflicts.iter().filter(|it| it.is_within(goal, task));
            let proofs = lost.map(|(_, reason)| reason.clone());
            let proofs: Vec<Reason> = proofs.chain(inner.map(Conflict::reason)).collect();
            // Each goal was sought alone, unless that was not necessary.
            let failed = goal.failed_search.as_ref().unwrap_or(verdict);
            let is_impossible = goal.is_proven_late
                || goal.unreachable.is_some()
                || !proofs.is_empty()
                || *failed == Verdict::Unsolvable;
            let mut reasons: Vec<Reason> = goal.lateness().into_iter().chain(proofs).collect();
            if reasons.is_empty() {
                reasons.push(goal.reason_without_plan(is_impossible, failed));
            }
            UnreachedGoal {
                name: goal.name.clone(),
                is_impossible,
                reasons,
            }
        });
        unreached.collect()
    }

    /// Returns the number of pursued goals.
    pub(in crate::run) fn pursued_goals(&self) -> usize {
        let goals = self.goals.iter();
        goals.filter(|goal| goal.is_pursued()).count()
    }

    /// Returns the lateness of the pursued goals with deadlines, as far as it is known.
    pub(in crate::run) fn missed_deadlines(&self) -> Vec<Reason> {
        let goals = self.goals.iter();
        let pursued = goals.filter(|goal| goal.is_pursued());
        pursued.filter_map(OpenGoal::lateness).collect()
    }
}

impl OpenGoal {
    /// Returns the lateness, if it is known.
    fn lateness(&self) -> Option<Reason> {
        let late = self.missed_deadline.as_ref()?;
        let words = format!("`{}` would be reached {late}", self.name);
        Some(Reason::new(Cause::TooLate).about(Subject::ExternalMessage(words)))
    }

    /// Returns the reason without a plan if nothing more is known.
    fn reason_without_plan(&self, is_impossible: bool, verdict: &Verdict) -> Reason {
        let deadline = self.terms.deadline.as_ref();
        let in_time = deadline.map_or("", |_| " by its deadline");
        let words = match &self.unreachable {
            Some(why) => why.clone(),
            None if is_impossible => {
                format!("a certificate proves that no plan reaches it{in_time}")
            }
            None => match verdict {
                Verdict::PlannerFailed { why } => format!("the planner failed: {why}"),
                Verdict::ReplanLimit => "too many plans were abandoned".to_owned(),
                _ => {
                    let why = verdict.why().map(|why| format!(": {why}"));
                    let why = why.unwrap_or_default();
                    format!("no plan was found that reaches it{in_time}{why}")
                }
            },
        };
        Reason::new(Cause::NoPlan).about(Subject::ExternalMessage(words))
    }
}
