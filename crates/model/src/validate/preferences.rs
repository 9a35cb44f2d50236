//! Preferences: number of violations of each.

use elbowroom_num::Rational;

use super::evaluate::Fault;
use super::judge::Judge;
use super::segment::Segment;
use super::violation::{ActionInstance, Undecided, UndecidedReason};
use crate::grounder::SoftCondition;
use crate::plan::TimeTriggeredPlan;
use crate::problem::PreferenceId;
use crate::task::Task;

/// Preferences that a plan violates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Preferences {
    /// Violated instances: first those of actions, by step, then those of the goal and of the
    /// constraints.
    pub violated: Vec<ViolatedPreference>,
    /// Instances whose violation is undecided.
    pub undecided: Vec<(PreferenceId, Undecided)>,
}

/// An instance of a preference that a plan violates.
#[derive(Clone, Debug, PartialEq)]
pub struct ViolatedPreference {
    /// The preference.
    pub preference: PreferenceId,
    /// Time of the violation.
    pub time: Rational,
    /// The action whose conditions contain it.
    pub action: Option<ActionInstance>,
    /// Violated condition and reason, in words.
    pub why: String,
}

impl Preferences {
    /// Returns the value of `(is-violated …)`: the number of violated instances. Returns `None` if
    /// it is undecided.
    pub fn violations(&self, preference: PreferenceId) -> Option<usize> {
        let is_known = self.undecided.iter().all(|(other, _)| *other != preference);
        let same = self.violated.iter().filter(|v| v.preference == preference);
        is_known.then(|| same.count())
    }
}

/// Preferences among the conditions of a plan's actions.
#[derive(Debug, Default)]
pub(super) struct ActionPreferenceMonitor {
    /// By step; empty if no action has any.
    steps: Vec<Vec<Instance>>,
    /// The starts of steps before this one are not part of the plan.
    running: usize,
}

#[derive(Debug)]
struct Instance {
    soft: SoftCondition,
    /// Time of the violation, and reason.
    broken: Option<(Rational, String)>,
}

/// Part of a soft condition that is read.
#[derive(Clone, Copy)]
pub(super) enum Part {
    Start,
    End,
}

impl ActionPreferenceMonitor {
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

    /// Reads the parts that belong to a step's start or end, on arrival.
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

    /// Checks the parts that belong to the whole of a running step throughout a piece of time.
    pub(super) fn watch(
        &mut self,
        piece: &Segment<'_>,
        (step, duration, is_new): (usize, Option<&Rational>, bool),
        (task, from): (&Task, &Rational),
    ) {
        for instance in self.steps.get_mut(step).into_iter().flatten() {
            let condition = &instance.soft.over_all;
            if instance.broken.is_some() || condition.is_trivial() {
                continue;
            }
            let found: Result<_, Fault> = piece.first_falsification(condition, duration, !is_new);
            let broken = match found {
                Ok(None) => continue,
                Ok(Some(broken)) => from + broken.at,
                // An undefined condition does not hold.
                Err(_) => from.clone(),
            };
            let why = task.describe_condition(condition);
            instance.broken = Some((broken, format!("{why} does not hold over all")));
        }
    }

    /// Returns all violations.
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
                            reason: UndecidedReason::PastStates,
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
    /// Returns all violations of preferences, at the end of the plan.
    pub(super) fn preferences_of(&mut self, groups: &[super::timeline::Group<'a>]) -> Preferences {
        let of_actions = std::mem::take(&mut self.preferences);
        let mut preferences = of_actions.into_preferences(self.plan);
        let Some(course) = &self.trajectory else {
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
