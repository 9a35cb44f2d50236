//! Removal of unnecessary plan steps (*action elimination*, Nakhost & Müller, ICAPS 2010).

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{Body, FactId, FluentId};
use elbowroom_model::validate::{self, Report, Verdict};
use elbowroom_model::{Footprint, Situation, Step, Task, TimeTriggeredPlan, validate_from};
use elbowroom_num::Rational;

/// Returns the plan without steps that it does not need. The plan of a search may contain an action
/// whose effects another action, possibly one that was already running, achieves anyway.
///
/// Only steps that supply no fact to another step are tried: there are few of them, and the
/// validator decides whether the plan is valid without them. Steps that change numbers which
/// something reads are usually needed. Trials of each kind stop after a few failures
/// ([`MAX_FAILED_TRIALS`]). `may_continue` is called before each trial; when it returns `false`, the
/// remaining steps stay.
pub(super) fn without_redundant_actions(
    task: &Task,
    situation: &Situation,
    plan: TimeTriggeredPlan,
    report: Report,
    may_continue: &mut dyn FnMut() -> bool,
) -> (TimeTriggeredPlan, Report) {
    let mut timeline = Timeline::new(task, situation, &plan.steps);
    let mut left = (plan, report);
    let (mut of_numbers, mut of_nothing) = (0, 0);
    // Running actions come first, and stay. Later steps may need earlier ones.
    for index in (situation.running.len()..left.0.steps.len()).rev() {
        let in_vain = match timeline.supplies(index) {
            SuppliedEffects::Facts => continue,
            SuppliedEffects::Numbers => &mut of_numbers,
            SuppliedEffects::Nothing => &mut of_nothing,
        };
        if *in_vain >= MAX_FAILED_TRIALS {
            continue;
        }
        if !may_continue() {
            break;
        }
        let mut fewer = left.0.clone();
        fewer.steps.remove(index);
        let verdict = validate_from(task, situation, &fewer, &validate::Settings::default());
        if let Verdict::Valid(report) = verdict {
            left = (fewer, report);
            timeline.remove(index);
        } else {
            *in_vain += 1;
        }
    }
    left
}

/// Maximum number of failed trials of a kind. Each trial validates the whole plan.
const MAX_FAILED_TRIALS: usize = 20;

/// Effects of a step that others read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SuppliedEffects {
    /// A fact that would be false without the step.
    Facts,
    /// No such fact, but a number that the step changes.
    Numbers,
    Nothing,
}

/// The reads and writes of a plan's happenings, in the order of their times.
struct Timeline<'a> {
    situation: &'a Situation,
    moments: Vec<Moment>,
    goal: Footprint,
    /// For each number, the steps that read it; `None` for a timed initial.
    readers: BTreeMap<FluentId, BTreeSet<Option<usize>>>,
}

struct Moment {
    time: Rational,
    /// Index of the step in the plan; `None` for a timed initial.
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
        // The sort is stable, so that the over-all reads of an action stay after its start.
        moments.sort_by(|one, other| one.time.cmp(&other.time));
        let mut readers: BTreeMap<FluentId, BTreeSet<Option<usize>>> = BTreeMap::new();
        for moment in &moments {
            for fluent in &moment.footprint.reads_fluents {
                readers.entry(*fluent).or_default().insert(moment.step);
            }
        }
        Self {
            situation,
            moments,
            readers,
            goal: Footprint::of_condition(task, task.goal()),
        }
    }

    /// Returns the kind of effects of a step that others read.
    fn supplies(&self, step: usize) -> SuppliedEffects {
        let own = self.moments.iter().enumerate();
        let mut own = own.filter(|(_, moment)| moment.step == Some(step));
        let mut reads_on = false;
        let has_facts = own.any(|(place, moment)| {
            let footprint = &moment.footprint;
            let mut changed = footprint.shifts.union(&footprint.assigns);
            reads_on |= changed.any(|fluent| self.is_number_read(*fluent, step));
            footprint.adds.iter().any(|fact| self.is_read(*fact, place))
        });
        match (has_facts, reads_on) {
            (true, _) => SuppliedEffects::Facts,
            (false, true) => SuppliedEffects::Numbers,
            (false, false) => SuppliedEffects::Nothing,
        }
    }

    /// Returns `true` if another step, or the goal, reads a number.
    fn is_number_read(&self, fluent: FluentId, step: usize) -> bool {
        let readers = self.readers.get(&fluent);
        self.goal.reads_fluents.contains(&fluent)
            || readers.is_some_and(|all| all.iter().any(|it| *it != Some(step)))
    }

    /// Returns `true` if a fact added at this moment is read later and would be false without the
    /// step.
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
        self.goal.reads.contains(&fact)
    }

    fn remove(&mut self, step: usize) {
        self.moments.retain(|moment| moment.step != Some(step));
        for readers in self.readers.values_mut() {
            readers.remove(&Some(step));
        }
    }
}

#[cfg(test)]
mod tests {
    use elbowroom_model::validate::Settings;
    use elbowroom_model::{Situation, Task, validate};
    use elbowroom_pddl::{Source, read_plan, read_problem};

    use super::{Verdict, without_redundant_actions};

    const DOMAIN: &str = "(define (domain d) (:requirements :durative-actions :typing :fluents)
        (:types robot item)
        (:predicates (free ?r - robot) (have ?x - item) (sold ?x - item))
        (:functions (charge ?r - robot))
        (:durative-action fetch :parameters (?r - robot ?x - item) :duration (= ?duration 5)
          :condition (and (at start (free ?r)) (at start (>= (charge ?r) 1)))
          :effect (and (at start (not (free ?r))) (at end (free ?r)) (at end (have ?x))
                       (at end (decrease (charge ?r) 1))))
        (:durative-action load :parameters (?r - robot) :duration (= ?duration 2)
          :condition (at start (free ?r))
          :effect (and (at start (not (free ?r))) (at end (free ?r)) (at end (increase (charge ?r) 2))))
        (:action sell :parameters (?x - item) :precondition (have ?x)
          :effect (and (not (have ?x)) (sold ?x))))";

    /// Returns the names of the steps that remain in the plan, one action per line of `plan`.
    fn remaining_steps(init: &str, goal: &str, plan: &str) -> Vec<String> {
        let problem = format!(
            "(define (problem p) (:domain d) (:objects r s - robot book pen - item)
              (:init (free r) (free s) {init}) (:goal {goal}))"
        );
        let source = |text: &str| Source::new("test", text);
        let (problem, _) =
            read_problem(&source(DOMAIN), &source(&problem)).expect("a correct test");
        let task = Task::new(problem);
        let (plan, _) = read_plan(&source(plan), &task).expect("a correct test");
        let Verdict::Valid(report) = validate::validate(&task, &plan, &Settings::default()) else {
            panic!("a plan that works");
        };
        let situation = Situation::initial(&task);
        let (plan, _) = without_redundant_actions(&task, &situation, plan, report, &mut || true);
        assert!(validate::validate(&task, &plan, &Settings::default()).is_valid());
        plan.steps.iter().map(|it| it.action.name.clone()).collect()
    }

    #[test]
    fn unneeded_change_of_number_is_eliminated() {
        let plan = "0: (fetch r book) [5]\n0: (fetch s pen) [5]";
        let init = "(have book) (= (charge r) 1) (= (charge s) 1)";
        assert_eq!(remaining_steps(init, "(have pen)", plan), ["(fetch s pen)"]);
        // The action that it was loaded for is then unnecessary as well.
        let plan = "0: (load r) [2]\n3: (fetch r book) [5]\n0: (fetch s pen) [5]";
        let init = "(have book) (= (charge r) 0) (= (charge s) 1)";
        assert_eq!(remaining_steps(init, "(have pen)", plan), ["(fetch s pen)"]);
    }

    #[test]
    fn action_that_supplies_needed_number_is_kept() {
        let plan = "0: (load r) [2]\n3: (fetch r book) [5]\n9: (fetch r pen) [5]";
        let init = "(= (charge r) 0) (= (charge s) 0)";
        let goal = "(and (have pen) (have book))";
        assert_eq!(remaining_steps(init, goal, plan).len(), 3);
        // It had been there before, but is sold in the meantime.
        let plan = "0: (sell book)\n1: (fetch r book) [5]";
        let init = "(have book) (= (charge r) 1) (= (charge s) 0)";
        assert_eq!(
            remaining_steps(init, "(and (sold book) (have book))", plan).len(),
            2
        );
        // The goal reads the number.
        let plan = "0: (load r) [2]";
        let init = "(= (charge r) 0) (= (charge s) 0)";
        assert_eq!(
            remaining_steps(init, "(>= (charge r) 2)", plan),
            ["(load r)"]
        );
    }
}
