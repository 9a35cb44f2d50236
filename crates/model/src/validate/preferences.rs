//! Preferences: how often a plan violates each.

use elbowroom_num::Rational;

use super::judge::Judge;
use super::piece::Piece;
use super::reading::Fault;
use super::violation::{ActionInstance, Difficulty, Undecided};
use crate::grounder::SoftCondition;
use crate::plan::TimeTriggeredPlan;
use crate::problem::PreferenceId;
use crate::task::Task;

/// What a plan violates of the preferences.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Preferences {
    /// Each violated instance: first those of actions, by step, then those of the goal and of the
    /// constraints.
    pub violated: Vec<ViolatedPreference>,
    /// The instances of which it is not known whether they are violated.
    pub undecided: Vec<(PreferenceId, Undecided)>,
}

/// An instance of a preference that a plan violates.
#[derive(Clone, Debug, PartialEq)]
pub struct ViolatedPreference {
    /// Which one.
    pub preference: PreferenceId,
    /// Since when.
    pub time: Rational,
    /// The action among whose conditions it stands.
    pub action: Option<ActionInstance>,
    /// What is violated, and why.
    pub why: String,
}

impl Preferences {
    /// `(is-violated …)`: how many instances the plan violates; `None` where that is not known.
    pub fn violations(&self, preference: PreferenceId) -> Option<usize> {
        let is_known = self.undecided.iter().all(|(other, _)| *other != preference);
        let same = self.violated.iter().filter(|v| v.preference == preference);
        is_known.then(|| same.count())
    }
}

/// The preferences among the conditions of a plan's actions.
#[derive(Debug, Default)]
pub(super) struct OfActions {
    /// By step; empty if no action has any.
    steps: Vec<Vec<Instance>>,
    /// Of steps before this one, the start has not been seen.
    running: usize,
}

#[derive(Debug)]
struct Instance {
    soft: SoftCondition,
    /// Since when it is violated.
    broken: Option<(Rational, String)>,
}

/// Which part of a soft condition is read.
#[derive(Clone, Copy)]
pub(super) enum Part {
    Start,
    End,
}

impl OfActions {
    pub(super) fn of(task: &Task, plan: &TimeTriggeredPlan, running: usize) -> Self {
        let preferences = &task.problem().action_preferences;
        if preferences.is_empty() {
            return Self::default();
        }
        let of_step = |step: &crate::plan::Step| {
            let mut found = Vec::new();
            let own = preferences.iter();
            for preference in own.filter(|own| own.schema == step.action.schema) {
                task.grounding(|grounder| {
                    let arguments = &step.action.arguments;
                    grounder.action_preference(preference, arguments, &mut found);
                });
            }
            let new = |soft| Instance { soft, broken: None };
            found.into_iter().map(new).collect()
        };
        Self {
            steps: plan.steps.iter().map(of_step).collect(),
            running,
        }
    }

    /// Reads, on arrival at a step's start or end, what belongs there.
    pub(super) fn read(&mut self, judge: &Judge<'_>, step: usize, part: Part, time: &Rational) {
        for instance in self.steps.get_mut(step).into_iter().flatten() {
            let condition = match part {
                Part::Start => &instance.soft.at_start,
                Part::End => &instance.soft.at_end,
            };
            if instance.broken.is_none() && !matches!(judge.reads(condition, Some(step)), Ok(true))
            {
                let why = judge.task.describe_condition(condition);
                instance.broken = Some((time.clone(), format!("{why} does not hold")));
            }
        }
    }

    /// Watches what belongs to all of a running step throughout a piece of time.
    pub(super) fn watch(
        &mut self,
        piece: &Piece<'_>,
        (step, duration, is_new): (usize, Option<&Rational>, bool),
        (task, from): (&Task, &Rational),
    ) {
        for instance in self.steps.get_mut(step).into_iter().flatten() {
            let condition = &instance.soft.over_all;
            if instance.broken.is_some() || condition.is_trivial() {
                continue;
            }
            let found: Result<_, Fault> = piece.first_break(condition, duration, !is_new);
            let broken = match found {
                Ok(None) => continue,
                Ok(Some(broken)) => from + broken.at,
                // What says nothing does not hold.
                Err(_) => from.clone(),
            };
            let why = task.describe_condition(condition);
            instance.broken = Some((broken, format!("{why} does not hold over all")));
        }
    }

    /// All that is violated.
    pub(super) fn into_preferences(self, plan: &TimeTriggeredPlan) -> Preferences {
        let mut preferences = Preferences::default();
        for (position, instances) in self.steps.into_iter().enumerate() {
            for Instance { soft, broken } in instances {
                let preference = soft.preference;
                match broken {
                    Some((time, why)) => preferences.violated.push(ViolatedPreference {
                        preference,
                        time,
                        action: Some(ActionInstance::of(plan, position)),
                        why,
                    }),
                    None if position < self.running => preferences.undecided.push((
                        preference,
                        Undecided {
                            time: None,
                            difficulty: Difficulty::Past,
                        },
                    )),
                    None => {}
                }
            }
        }
        preferences
    }
}

impl<'a> Judge<'a> {
    /// All that the plan violates of the preferences, now that it is over.
    pub(super) fn preferences_of(&mut self, groups: &[super::timeline::Group<'a>]) -> Preferences {
        let of_actions = std::mem::take(&mut self.preferences);
        let mut preferences = of_actions.into_preferences(self.plan);
        let Some(course) = &self.course else {
            return preferences;
        };
        let end = groups.last().map(|group| group.time.clone());
        let found = course.soft(self, &end.unwrap_or_default());
        for (soft, found) in self.task.constraints().soft.iter().zip(found) {
            let preference = soft.preference;
            match found {
                Ok(None) => {}
                Ok(Some((time, why))) => preferences.violated.push(ViolatedPreference {
                    preference,
                    time,
                    action: None,
                    why,
                }),
                Err(undecided) => preferences.undecided.push((preference, undecided)),
            }
        }
        preferences
    }
}
