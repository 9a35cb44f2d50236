//! Final steps of the compilation, once all actions are numbered: annotations, timed initials, and
//! properties that depend on all actions.

mod dates;

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::{self, Change as ModelChange, Condition};
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{Footprint, Situation, TimedHappening};
use elbowroom_num::Rational;

use super::super::compressibility::{compressibility, readers};
use super::super::directions::Shifts;
use super::super::exclusive::{self, implied_tests};
use super::super::initial_state::{InitialState, has_values_to_change, running};
use super::super::interference::{Access, Annotations, Separations, TimedSeparations};
use super::super::metric::{Metric, only_grows};
use super::super::rules::stratified;
use super::super::times::is_symbolic;
use super::super::{Compiled, Compressibility, NONE, Rule, Snap, Timed, completeness, compression};
use super::{Builder, CompileInput, narrow};
use crate::embedded::formula::Literal;
use crate::embedded::time::{Scale, Ticks};
use crate::embedded::tuning::Technique;
use crate::embedded::windows::Windows;

/// Number of happenings annotated between two calls of `may_continue`.
const SNAPS_PER_QUESTION: usize = 1024;

/// The future timed initials, each with its separations.
struct FutureTimed {
    happenings: Vec<TimedHappening>,
    separations: Vec<Separations>,
}

/// Returns the longest distance that some snap keeps from some annotation.
fn longest_distance(snaps: &[Snap]) -> Ticks {
    let distances = snaps.iter().flat_map(|snap| &snap.after);
    distances.map(|&(_, distance)| distance).max().unwrap_or(0)
}

impl Builder<'_> {
    /// Assembles the compiled problem. Returns `None` if `may_continue` returned `false`.
    pub(super) fn finish(
        mut self,
        grounding: &Grounding,
        wanted: CompileInput<'_>,
        scale: Scale,
        may_continue: &mut dyn FnMut() -> bool,
    ) -> Option<Compiled> {
        let situation = wanted.situation;
        let goal = self.symbols.formula(&grounding.goal);
        let (strata, derived) = self.rules(grounding);
        let is_symbolic = is_symbolic(&self.actions, situation);
        let mut coming = self.future_timed(situation);
        let (calendars, windows, calendars_are_exact) = if wanted.tuning.uses(Technique::Calendars)
        {
            let rules = strata.iter().flatten().map(|rule| &rule.body);
            let others: Vec<_> = rules.chain([&goal]).collect();
            self.extract_calendars(&mut coming, situation, &others, scale)
        } else {
            (Vec::new(), Windows::default(), true)
        };
        let windows = (!windows.is_empty()).then(|| Arc::new(windows));
        let annotations = Annotations::of(self.separations.iter().chain(&coming.separations));
        self.annotate(&annotations, &coming, may_continue)?;
        let (timed, timed_is_exact) = self.timed(&coming, &annotations, scale);
        if !may_continue() {
            return None;
        }
        self.note_compression_safe(&annotations, &timed, !strata.is_empty());
        let counts_drains = is_symbolic && wanted.tuning.uses(Technique::ContinuousDrains);
        let exclusive = self.compile_drains(situation, &timed, &strata, counts_drains);
        let timed_until_goal = self.timed_until_goal(grounding, &coming);
        let (metric, cost) = self.metric(situation, &timed);
        if !may_continue() {
            return None;
        }
        let facts = self.symbols.facts;
        let fact_annotations = facts.iter().map(|&fact| annotations.of_fact(fact));
        let state = &situation.state;
        let values = |fluent| state.values.get(fluent).cloned();
        let (running, running_is_exact) = running(situation, scale);
        let beginning = InitialState {
            time: situation.time.clone(),
            facts: facts
                .iter()
                .map(|fact| state.facts.contains(fact))
                .collect(),
            values: self.symbols.fluents.iter().map(values).collect(),
            cost,
            running,
        };
        let (now, now_is_exact) = scale.floor(&situation.time);
        let parts = completeness::Parts {
            actions: &self.actions,
            snaps: &self.snaps,
            timed: &timed,
            tests: &self.symbols.tests,
            strata: &strata,
            fact_count: facts.len(),
        };
        let relaxation_incomplete_because = completeness::obstacle_among_facts(parts);
        let starts_depend_on_each_other = relaxation_incomplete_because.is_some()
            && completeness::do_starts_depend_on_each_other(parts);
        let numbers = completeness::obstacle_among_numbers(parts);
        let incomplete_because = if is_symbolic {
            Some("values that depend on when things happen")
        } else {
            numbers.or(relaxation_incomplete_because)
        };
        let changes_have_values =
            has_values_to_change(&self.actions, beginning.running.len(), &beginning.values);
        Some(Compiled {
            scale,
            tuning: wanted.tuning.clone(),
            epsilon: scale.ceil(&Rational::ZERO).0.max(self.epsilon),
            longest_distance: longest_distance(&self.snaps),
            now,
            fact_annotations: fact_annotations.collect(),
            facts,
            fluents: self.symbols.fluents,
            exclusive_fluents: exclusive,
            tests: self.symbols.tests,
            snaps: self.snaps,
            actions: self.actions,
            macros: Vec::new(),
            annotation_count: annotations.count(),
            timed,
            calendars,
            windows,
            goal,
            metric,
            timed_until_goal,
            strata,
            derived,
            initial: beginning,
            is_exact: scale.exactly(&Rational::ONE).is_some()
                && timed_is_exact
                && calendars_are_exact
                && now_is_exact
                && running_is_exact
                && (!is_symbolic || changes_have_values),
            incomplete_because,
            relaxation_incomplete_because,
            needs_joining: numbers.or(relaxation_incomplete_because).is_some(),
            starts_depend_on_each_other,
            is_symbolic,
        })
    }

    /// Returns the rules of derived facts by stratum, and their heads.
    fn rules(&mut self, grounding: &Grounding) -> (Vec<Vec<Rule>>, Vec<Vec<u32>>) {
        let symbols = &mut self.symbols;
        let rules = grounding.rules.iter().map(|rule| {
            let body = symbols.formula(&rule.body);
            let head = symbols.fact(rule.head);
            Rule { head, body }
        });
        let rules = rules.collect();
        stratified(rules, self.task, &self.symbols)
    }

    /// Returns the timed initials after the situation that matter to some happening, condition or
    /// number.
    fn future_timed(&self, situation: &Situation) -> FutureTimed {
        let makes = self.separations.iter().flat_map(|s| &s.makes);
        let is_write = |access: &&Access| matches!(access, Access::Added(_) | Access::Deleted(_));
        let written: BTreeSet<Access> = makes.filter(is_write).copied().collect();
        // A fact that nothing reads, and no action writes, requires no separation.
        let matters = |change: &ModelChange| match change {
            ModelChange::Add(fact) | ModelChange::Delete(fact) => {
                self.symbols.known_fact(*fact).is_some()
                    || written.contains(&Access::Added(*fact))
                    || written.contains(&Access::Deleted(*fact))
            }
            ModelChange::Update { .. } => true,
        };
        let timed = self.task.timed().iter();
        let happenings: Vec<_> = timed
            .filter(|timed| timed.time > situation.time && timed.changes.iter().any(matters))
            .cloned()
            .collect();
        FutureTimed {
            separations: self.separations_of(&happenings),
            happenings,
        }
    }

    fn separations_of(&self, happenings: &[TimedHappening]) -> Vec<Separations> {
        let separations = happenings.iter().map(|timed| {
            let footprint = Footprint::of_timed(timed);
            Separations::of(&footprint, &Shifts::default(), self.epsilon, &self.links)
        });
        separations.collect()
    }

    /// Sets the annotations of the happenings, and records the timed initials that must follow them
    /// or would break an over-all condition.
    fn annotate(
        &mut self,
        annotations: &Annotations,
        coming: &FutureTimed,
        may_continue: &mut dyn FnMut() -> bool,
    ) -> Option<()> {
        let waiting = TimedSeparations::of(&coming.separations);
        for (number, (snap, separations)) in
            self.snaps.iter_mut().zip(&self.separations).enumerate()
        {
            if number % SNAPS_PER_QUESTION == 0 && !may_continue() {
                return None;
            }
            snap.after = annotations.after(separations);
            snap.marks = annotations.marks(separations);
            snap.before_timed = waiting.before(&separations.makes);
        }
        if coming.happenings.is_empty() {
            return Some(());
        }
        for (action, over_all) in self.actions.iter_mut().zip(&self.over_all) {
            let mut needs = Separations::default();
            for conjunct in over_all.conjuncts() {
                let fact = match conjunct {
                    Condition::Fact(fact) => Some(*fact),
                    Condition::Not(part) => match **part {
                        Condition::Fact(fact) => Some(fact),
                        _ => None,
                    },
                    _ => None,
                };
                if fact.is_some_and(|fact| !self.task.is_derived(fact)) {
                    needs.add_over_all_end(self.task, conjunct, &self.links);
                }
            }
            let breaking = waiting.before(&needs.makes);
            action.breaking_timed = breaking.into_iter().map(|(number, _)| number).collect();
        }
        Some(())
    }

    /// Returns the future timed initials, and whether all their times are on the grid.
    fn timed(
        &self,
        coming: &FutureTimed,
        annotations: &Annotations,
        scale: Scale,
    ) -> (Vec<Timed>, bool) {
        let mut are_exact = true;
        let coming = coming.happenings.iter().zip(&coming.separations);
        let timed = coming.map(|(happening, separations)| {
            let (time, is_exact) = scale.floor(&happening.time);
            are_exact &= is_exact;
            let mut timed = Timed {
                time,
                adds: Vec::new(),
                deletes: Vec::new(),
                assigns: Vec::new(),
                marks: annotations.marks(separations),
            };
            for change in &happening.changes {
                match change {
                    ModelChange::Add(fact) => timed.adds.extend(self.symbols.known_fact(*fact)),
                    ModelChange::Delete(fact) => {
                        timed.deletes.extend(self.symbols.known_fact(*fact));
                    }
                    ModelChange::Update { fluent, value, .. } => {
                        if let (Some(fluent), ground::Expression::Constant(value)) =
                            (self.symbols.known_fluent(*fluent), value)
                        {
                            timed.assigns.push((fluent, value.clone()));
                        }
                    }
                }
            }
            timed
        });
        (timed.collect(), are_exact)
    }

    /// Marks the actions whose ends only add facts that matter only when true; see `compression`.
    fn note_compression_safe(
        &mut self,
        annotations: &Annotations,
        timed: &[Timed],
        has_rules: bool,
    ) {
        if has_rules {
            return;
        }
        let ends = compression::PositiveFacts::of(
            &self.actions,
            &self.snaps,
            timed,
            self.symbols.facts.len(),
        );
        for action in self.actions.iter_mut().filter(|action| action.end != NONE) {
            let makes = &self.separations[action.end as usize].makes;
            let is_plain = makes.iter().all(|&access| match access {
                Access::Added(fact) => {
                    self.symbols.known_fact(fact).is_some() || !annotations.has(access)
                }
                Access::NeededTrue(_) | Access::NeededFalse(_) => true,
                _ => !annotations.has(access),
            });
            action.is_compression_safe =
                is_plain && ends.only_adds_positive_facts(action, &self.snaps);
        }
    }

    /// Determines the actions that may be compressed, and compiles continuous changes of exclusive
    /// fluents to their ends. Returns for each fluent whether it is exclusive.
    fn compile_drains(
        &mut self,
        situation: &Situation,
        timed: &[Timed],
        strata: &[Vec<Rule>],
        counts_drains: bool,
    ) -> Vec<bool> {
        let mut exclusive = vec![false; self.symbols.fluents.len()];
        if counts_drains {
            exclusive = self.exclusive_fluents(situation, timed, strata);
            self.add_implied_tests(&exclusive);
        }
        self.note_compressibility(&exclusive, counts_drains);
        exclusive
    }

    /// Returns for each fluent whether its continuous changes affect at most one action at a time.
    fn exclusive_fluents(
        &self,
        situation: &Situation,
        timed: &[Timed],
        strata: &[Vec<Rule>],
    ) -> Vec<bool> {
        let facts = self.symbols.facts.iter();
        let holds: Vec<bool> = facts
            .map(|fact| situation.state.facts.contains(fact))
            .collect();
        let parts = exclusive::Parts {
            actions: &self.actions,
            snaps: &self.snaps,
            timed,
            strata,
            symbols: &self.symbols,
            holds: &holds,
        };
        parts.exclusive_fluents()
    }

    /// Adds the tests implied by continuous changes to the conditions of starts.
    fn add_implied_tests(&mut self, exclusive: &[bool]) {
        for action in self
            .actions
            .iter()
            .filter(|action| !action.flows.is_empty())
        {
            let implied = implied_tests(action, exclusive, &self.snaps, &self.symbols.tests);
            for (comparison, difference) in implied {
                let test = self.symbols.linear_test(comparison, difference);
                let tests = &mut self.snaps[action.start as usize].condition.tests;
                if !tests.contains(&test) {
                    tests.push(test);
                }
            }
        }
    }

    /// Sets the compressibility of each action. For `exclusive`, see [`exclusive`].
    fn note_compressibility(&mut self, exclusive: &[bool], compresses_flows: bool) {
        let readers = readers(&self.actions, &self.snaps, self.symbols.facts.len());
        for (number, action) in self.actions.iter_mut().enumerate() {
            if action.start == NONE || action.end == NONE {
                continue;
            }
            let snaps = [action.start, action.end].map(|snap| &self.snaps[snap as usize]);
            let offers = |l: Literal| readers[l.index()].has_other_than(narrow(number));
            action.compressibility = compressibility(snaps[0], snaps[1], &offers);
            // Other actions may read a continuously changing value meanwhile.
            let mut flows = action.flows.iter();
            if flows.any(|flow| !exclusive[flow.fluent as usize]) {
                let most = if compresses_flows {
                    Compressibility::HoldsResource
                } else {
                    Compressibility::Envelope
                };
                action.compressibility = action.compressibility.min(most);
            }
        }
    }

    /// Computes [`Compiled::timed_until_goal`].
    fn timed_until_goal(&self, grounding: &Grounding, coming: &FutureTimed) -> u32 {
        let mut goal = Separations::default();
        goal.add_over_all_start(self.task, &grounding.goal, &self.links);
        let is_read = |access: &Access| goal.after.iter().any(|(read, _)| read == access);
        let mut timed = coming.separations.iter();
        let last = timed.rposition(|separations| separations.makes.iter().any(is_read));
        last.map_or(0, |last| narrow(last + 1))
    }

    /// Returns the metric and its value in the situation.
    fn metric(&mut self, situation: &Situation, timed: &[Timed]) -> (Option<Metric>, Rational) {
        let Some(draft) = self.metric.take() else {
            return (None, Rational::ZERO);
        };
        let cost = draft.initial_cost(situation);
        let mut metric = draft.finish(&mut self.symbols);
        metric.only_grows = only_grows(&metric, &self.snaps, &self.actions, timed);
        (Some(metric), cost)
    }
}
