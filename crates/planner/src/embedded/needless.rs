//! Plans without steps that nothing needs (*action elimination*, Nakhost & Müller, ICAPS 2010).

use std::collections::BTreeSet;

use elbowroom_model::ground::{Body, FactId};
use elbowroom_model::validate::{self, Report, Verdict};
use elbowroom_model::{Footprint, Situation, Step, Task, TimeTriggeredPlan, validate_from};
use elbowroom_num::Rational;

/// The plan without the steps that it works without. A search can come to a goal by way of an
/// action that makes true what another one, perhaps under way before, makes true anyway.
///
/// Only steps are tried that change no number and supply no fact that is read before anything else
/// supplies it: there are few of them, and whether the plan works without one is for the judge to
/// say. `goes_on` is asked before each trial; once it says no, the other steps stay.
pub(super) fn without_needless(
    task: &Task,
    situation: &Situation,
    plan: TimeTriggeredPlan,
    report: Report,
    goes_on: &mut dyn FnMut() -> bool,
) -> (TimeTriggeredPlan, Report) {
    let mut timeline = Timeline::new(task, situation, &plan.steps);
    let mut left = (plan, report);
    // What is under way comes first, and stays. Later steps may need earlier ones.
    for index in (situation.running.len()..left.0.steps.len()).rev() {
        if !timeline.may_be_needless(index) {
            continue;
        }
        if !goes_on() {
            break;
        }
        let mut fewer = left.0.clone();
        fewer.steps.remove(index);
        let verdict = validate_from(task, situation, &fewer, &validate::Settings::default());
        if let Verdict::Valid(report) = verdict {
            left = (fewer, report);
            timeline.remove(index);
        }
    }
    left
}

/// The reads and writes of a plan's happenings, in the order of their times.
struct Timeline<'a> {
    situation: &'a Situation,
    moments: Vec<Moment>,
    goal: BTreeSet<FactId>,
}

struct Moment {
    time: Rational,
    /// The step's place in the plan; `None` of a timed initial.
    step: Option<usize>,
    footprint: Footprint,
}

impl<'a> Timeline<'a> {
    fn new(task: &Task, situation: &'a Situation, steps: &[Step]) -> Self {
        let mut moments = Vec::with_capacity(3 * steps.len());
        for (index, step) in steps.iter().enumerate() {
            let mut add = |time, footprint| {
                moments.push(Moment {
                    time,
                    step: Some(index),
                    footprint,
                });
            };
            if index >= situation.running.len() {
                add(step.start.clone(), Footprint::of_start(task, &step.action));
            }
            if let Body::Durative(body) = &step.action.body {
                let guards = body.end.effects.iter().map(|effect| &effect.guard.over_all);
                for condition in std::iter::once(&body.over_all).chain(guards) {
                    let reads = Footprint::of_condition(task, condition);
                    add(step.start.clone(), reads);
                }
                add(step.end(), Footprint::of_end(task, &step.action));
            }
        }
        let timed = task.timed().iter();
        moments.extend(
            timed
                .filter(|timed| timed.time > situation.time)
                .map(|timed| Moment {
                    time: timed.time.clone(),
                    step: None,
                    footprint: Footprint::of_timed(timed),
                }),
        );
        // Stable: what is read throughout an action comes after its start.
        moments.sort_by(|one, other| one.time.cmp(&other.time));
        Self {
            situation,
            moments,
            goal: Footprint::of_condition(task, task.goal()).reads,
        }
    }

    /// Whether nothing is known to need the step.
    fn may_be_needless(&self, step: usize) -> bool {
        let own = self.moments.iter().enumerate();
        own.filter(|(_, moment)| moment.step == Some(step))
            .all(|(place, moment)| {
                let footprint = &moment.footprint;
                footprint.shifts.is_empty()
                    && footprint.assigns.is_empty()
                    && footprint
                        .adds
                        .iter()
                        .all(|fact| !self.is_read(*fact, place))
            })
    }

    /// Whether a fact is read as this moment's step makes it, and would be false without that step.
    fn is_read(&self, fact: FactId, place: usize) -> bool {
        let step = self.moments[place].step;
        let is_other = |moment: &&Moment| moment.step != step;
        let writes = |moment: &&Moment| {
            let footprint = &moment.footprint;
            footprint.adds.contains(&fact) || footprint.deletes.contains(&fact)
        };
        let before = self.moments[..place].iter().filter(is_other).rfind(writes);
        let holds_anyway = match before {
            Some(moment) => moment.footprint.adds.contains(&fact),
            None => self.situation.state.facts.contains(&fact),
        };
        if holds_anyway {
            return false;
        }
        for moment in self.moments[place + 1..].iter().filter(is_other) {
            if moment.footprint.reads.contains(&fact) {
                return true;
            }
            if writes(&moment) {
                return false;
            }
        }
        self.goal.contains(&fact)
    }

    fn remove(&mut self, step: usize) {
        self.moments.retain(|moment| moment.step != Some(step));
    }
}
