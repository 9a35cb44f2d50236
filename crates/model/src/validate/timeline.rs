//! A plan and a task's timed initials as one sequence of happening groups.

use elbowroom_num::Rational;

use super::Settings;
use crate::ground::Body;
use crate::interference::Footprint;
use crate::plan::TimeTriggeredPlan;
use crate::situation::Situation;
use crate::state::TimedHappening;
use crate::task::Task;

/// The event of a happening.
#[derive(Clone, Copy, Debug)]
pub(super) enum HappeningKind<'a> {
    /// Start of the step at this position.
    Start(usize),
    /// End of the step at this position.
    End(usize),
    /// The step at this position, which takes no time.
    Instant(usize),
    /// Timed initial literals and fluents.
    Timed(&'a TimedHappening),
    /// The task's event at this position.
    Event(usize),
}

impl HappeningKind<'_> {
    /// Returns the position of the step that it belongs to.
    pub(super) fn step(&self) -> Option<usize> {
        match self {
            Self::Start(step) | Self::End(step) | Self::Instant(step) => Some(*step),
            Self::Timed(_) | Self::Event(_) => None,
        }
    }
}

/// A happening with its time and footprint.
#[derive(Clone, Debug)]
pub(super) struct Happening<'a> {
    pub(super) kind: HappeningKind<'a>,
    pub(super) time: Rational,
    pub(super) footprint: Footprint,
}

/// All happenings at one time.
#[derive(Clone, Debug)]
pub(super) struct Group<'a> {
    pub(super) time: Rational,
    pub(super) happenings: Vec<Happening<'a>>,
}

/// Returns all happenings by time. Those that are equal within the tolerance form one group.
///
/// Timed initials after the last happening of the plan are left out if they do not count.
/// Happenings before the beginning of a plan that continues a situation are left out as well.
pub(super) fn timeline<'a>(
    task: &'a Task,
    situation: Option<&Situation>,
    plan: &TimeTriggeredPlan,
    settings: &Settings,
) -> Vec<Group<'a>> {
    let mut happenings = Vec::new();
    let running = situation.map_or(0, |situation| situation.running.len());
    for (position, step) in plan.steps.iter().enumerate() {
        let footprint = Footprint::of_start(task, &step.action);
        let time = step.start.clone();
        if let (Body::Durative(_), Some(duration)) = (&step.action.body, &step.duration) {
            let end = &time + duration;
            if position >= running {
                happenings.push(Happening {
                    kind: HappeningKind::Start(position),
                    time,
                    footprint,
                });
            }
            let footprint = Footprint::of_end(task, &step.action);
            happenings.push(Happening {
                kind: HappeningKind::End(position),
                time: end,
                footprint,
            });
        } else {
            happenings.push(Happening {
                kind: HappeningKind::Instant(position),
                time,
                footprint,
            });
        }
    }
    let last = happenings
        .iter()
        .map(|happening| &happening.time)
        .max()
        .cloned();
    let is_to_come =
        |timed: &&TimedHappening| situation.is_none_or(|situation| timed.time > situation.time);
    for timed in task.timed().iter().filter(is_to_come) {
        happenings.push(Happening {
            kind: HappeningKind::Timed(timed),
            time: timed.time.clone(),
            footprint: Footprint::of_timed(timed),
        });
    }
    happenings.sort_by(|a, b| a.time.cmp(&b.time));

    let width = settings.group_width();
    let mut groups: Vec<Group<'_>> = Vec::new();
    for happening in happenings {
        match groups.last_mut() {
            Some(group) if happening.time <= &group.time + &width => {
                group.happenings.push(happening);
            }
            _ => groups.push(Group {
                time: happening.time.clone(),
                happenings: vec![happening],
            }),
        }
    }
    if !settings.counts_later_timed {
        groups.retain(|group| last.as_ref().is_some_and(|last| group.time <= *last));
    }
    groups
}
