//! The compiled problem, once all actions are numbered: stamps, timed initials, and what follows
//! from looking at all actions together.

use elbowroom_model::ground::{self, Change as ModelChange, Condition};
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{Footprint, Situation};
use elbowroom_num::Rational;

use super::super::directions::Shifts;
use super::super::eagerness::{eagerness, readers};
use super::super::initial::initial;
use super::super::interference::{Access, Stamps, TimedWishes, Wishes};
use super::super::metric::only_grows;
use super::super::rules::stratified;
use super::super::times::is_symbolic;
use super::super::{Compiled, NONE, Rule, Snap, Timed, eager, gaps};
use super::{Builder, narrow};
use crate::embedded::formula::Literal;
use crate::embedded::state::State;
use crate::embedded::time::{Scale, Ticks};

/// How many happenings get their stamps between two questions whether to go on.
const SNAPS_PER_QUESTION: usize = 1024;

/// The longest distance that some snap keeps from some stamp.
fn longest_distance(snaps: &[Snap]) -> Ticks {
    let distances = snaps.iter().flat_map(|snap| &snap.after);
    distances.map(|&(_, distance)| distance).max().unwrap_or(0)
}

impl Builder<'_> {
    #[allow(
        clippy::too_many_lines,
        reason = "one part of the compiled problem after the other"
    )]
    pub(super) fn finish(
        mut self,
        grounding: &Grounding,
        situation: &Situation,
        scale: Scale,
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Option<Compiled> {
        let goal = self.symbols.formula(&grounding.goal);
        let mut rules: Vec<Rule> = Vec::new();
        for rule in &grounding.rules {
            let body = self.symbols.formula(&rule.body);
            let head = self.symbols.fact(rule.head);
            rules.push(Rule { head, body });
        }
        let (strata, derived) = stratified(rules, self.task, &self.symbols);
        let coming: Vec<_> = self
            .task
            .timed()
            .iter()
            .filter(|timed| timed.time > situation.time)
            .collect();
        let timed_wishes: Vec<Wishes> = coming
            .iter()
            .map(|timed| {
                let footprint = Footprint::of_timed(timed);
                Wishes::of(&footprint, &Shifts::default(), self.epsilon, &self.links)
            })
            .collect();
        let stamps = Stamps::of(self.wishes.iter().chain(&timed_wishes));
        let waiting = TimedWishes::of(&timed_wishes);
        for (number, (snap, wishes)) in self.snaps.iter_mut().zip(&self.wishes).enumerate() {
            if number % SNAPS_PER_QUESTION == 0 && !goes_on() {
                return None;
            }
            snap.after = stamps.after(wishes);
            snap.marks = stamps.marks(wishes);
            snap.before_timed = waiting.before(&wishes.makes);
        }
        if !coming.is_empty() {
            for (action, over_all) in self.actions.iter_mut().zip(&self.over_all) {
                let mut needs = Wishes::default();
                for conjunct in over_all.conjuncts() {
                    if matches!(conjunct, Condition::Fact(_) | Condition::Not(_)) {
                        needs.needed_until_now(self.task, conjunct, &self.links);
                    }
                }
                let breaking = waiting.before(&needs.makes);
                action.breaking_timed = breaking.into_iter().map(|(number, _)| number).collect();
            }
        }
        let mut is_exact = scale.exactly(&Rational::ONE).is_some();
        let timed: Vec<Timed> = coming
            .iter()
            .zip(&timed_wishes)
            .map(|(happening, wishes)| {
                let (time, exact) = scale.floor(&happening.time);
                is_exact &= exact;
                let mut timed = Timed {
                    time,
                    adds: Vec::new(),
                    deletes: Vec::new(),
                    assigns: Vec::new(),
                    marks: stamps.marks(wishes),
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
            })
            .collect();
        if !goes_on() {
            return None;
        }
        let ends = eager::Ends::of(&self.actions, &self.snaps, &timed, self.symbols.facts.len());
        for number in 0..self.actions.len() {
            let action = &self.actions[number];
            if action.end == NONE || !strata.is_empty() {
                continue;
            }
            let makes = &self.wishes[action.end as usize].makes;
            let is_plain = makes.iter().all(|&access| match access {
                Access::Added(fact) => {
                    self.symbols.known_fact(fact).is_some() || !stamps.has(access)
                }
                Access::NeededTrue(_) | Access::NeededFalse(_) => true,
                _ => !stamps.has(access),
            });
            let only_adds = is_plain && ends.only_add(action, &self.snaps);
            self.actions[number].only_adds_at_end = only_adds;
        }
        let readers = readers(&self.actions, &self.snaps, self.symbols.facts.len());
        for number in 0..self.actions.len() {
            let action = &self.actions[number];
            if action.start != NONE && action.end != NONE {
                let (start, end) = (
                    &self.snaps[action.start as usize],
                    &self.snaps[action.end as usize],
                );
                let offers = |l: Literal| readers[l.index()].has_other_than(narrow(number));
                // What changes continuously is there to be read meanwhile.
                if action.flows.is_empty() {
                    self.actions[number].eagerness = eagerness(start, end, &offers);
                }
            }
        }
        let mut goal_wishes = Wishes::default();
        goal_wishes.need_from_now_on(self.task, &grounding.goal, &self.links);
        let goal_accesses: Vec<_> = goal_wishes
            .after
            .iter()
            .map(|(access, _)| *access)
            .collect();
        let goal_timed = (0..coming.len())
            .filter(|&number| {
                let makes = &timed_wishes[number].makes;
                makes.iter().any(|access| goal_accesses.contains(access))
            })
            .map(narrow)
            .collect();
        let now = scale.floor(&situation.time);
        let epsilon = scale.ceil(&Rational::ZERO).0.max(self.epsilon);
        is_exact &= now.1;
        let metric = self.metric.take();
        let initial_cost = metric
            .as_ref()
            .map_or(Rational::ZERO, |metric| metric.initial_cost(situation));
        let metric = metric.map(|metric| metric.finish(&mut self.symbols));
        let mut compiled = Compiled {
            scale,
            epsilon,
            longest_distance: longest_distance(&self.snaps),
            now: now.0,
            fact_stamps: self
                .symbols
                .facts
                .iter()
                .map(|&fact| stamps.of_fact(fact))
                .collect(),
            facts: self.symbols.facts,
            fluents: self.symbols.fluents,
            tests: self.symbols.tests,
            snaps: self.snaps,
            actions: self.actions,
            stamp_count: stamps.count(),
            timed,
            goal,
            metric,
            goal_timed,
            strata,
            derived,
            initial: State::default(),
            is_exact,
            gap: None,
            relaxed_gap: None,
            is_symbolic: false,
        };
        if !goes_on() {
            return None;
        }
        compiled.is_symbolic = is_symbolic(&compiled, situation);
        let fact_count = compiled.facts.len();
        compiled.relaxed_gap = gaps::among_facts(&compiled.actions, &compiled.snaps, fact_count);
        compiled.gap = gaps::among_numbers(&compiled.actions, &compiled.snaps, fact_count)
            .or(compiled.relaxed_gap);
        if compiled.is_symbolic {
            compiled.gap = Some("values that depend on when things happen");
        }
        if let Some(mut metric) = compiled.metric.take() {
            metric.only_grows = only_grows(&metric, &compiled);
            compiled.metric = Some(metric);
        }
        compiled.initial = initial(&mut compiled, situation);
        compiled.initial.cost = initial_cost;
        Some(compiled)
    }
}
