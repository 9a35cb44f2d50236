//! The relaxed problem: propositions and operators without deletions.

mod actions;
mod envelopes;
mod exclusions;
mod macros;
mod timetables;

use std::ops::Range;

use super::super::compile::{Compiled, Compressibility, Macro, NONE};
use super::super::formula::Formula;
use super::super::step_costs::StepCosts;
use super::super::time::Ticks;
use super::super::tuning::Technique;
pub(crate) use super::numbers::Gain;
use envelopes::{Stay, Stays};
pub(crate) use timetables::Window;

/// The happening that an operator represents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Start(u32),
    Compressed(u32),
    /// An envelope and its content.
    Macro(u32),
    /// The end of some instance of the action.
    End(u32),
    Timed(u32),
    /// A consequence, not a step.
    Axiom,
}

/// An operator of the relaxed problem: once all its preconditions are reached, its effects are.
#[derive(Clone, Debug)]
pub(crate) struct Operator {
    pub(crate) kind: Kind,
    pub(crate) cost: u32,
    /// `true` for the step itself, `false` for one of its conditional effects.
    pub(crate) is_step: bool,
    pub(crate) preconditions: Range<usize>,
    pub(crate) effects: Range<usize>,
    pub(crate) gains: Range<usize>,
    /// Positions in [`Graph::windows`].
    pub(crate) windows: Range<usize>,
    /// The minimum time from when the preconditions hold until the operator is over.
    pub(crate) span: Ticks,
}

/// Propositions and operators of the relaxed problem, with their indices.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    pub(crate) proposition_count: usize,
    pub(crate) operators: Vec<Operator>,
    pub(crate) preconditions: Vec<u32>,
    pub(crate) precondition_counts: Vec<u32>,
    pub(crate) effects: Vec<u32>,
    /// For each effect, the minimum time after the beginning of its operator.
    pub(crate) delays: Vec<Ticks>,
    /// See [`Window`].
    pub(crate) windows: Vec<Window>,
    /// The intervals in which a literal holds that changes at fixed times only.
    pub(crate) timetable: Vec<Vec<(Ticks, Ticks)>>,
    /// The timetable of each literal; [`NONE`] if it has none.
    timetable_of: Vec<u32>,
    /// Tests, with the amounts that an operator adds to their difference.
    pub(crate) gains: Vec<(u32, Gain)>,
    /// Operators without preconditions.
    pub(crate) sources: Vec<u32>,
    pub(crate) goal: Vec<u32>,
    /// See [`Stay`].
    pub(crate) stays: Vec<Stay>,
    /// For each action, the operators that are applicable neither while it is running, nor after
    /// it.
    pub(crate) excluded_operators: Vec<Vec<u32>>,
    /// For each action, the operator of its end.
    pub(crate) end_of: Vec<u32>,
    /// For each action, the operator of its start, or of the whole action.
    start_of: Vec<u32>,
    /// Tests that the relaxation assumes to hold because they read `?duration`.
    pub(crate) is_free_test: Vec<bool>,
    needing_ends: Vec<u32>,
    pub(crate) needing_list: Vec<u32>,
    /// `true` if an action starts and ends in different steps.
    pub(crate) has_single_starts: bool,
    first_test: u32,
    first_running: u32,
    tests_of_fluent: Vec<Vec<u32>>,
}

impl Graph {
    /// Builds the graph. `macros` are the macro-operators that replace the starts of their
    /// envelopes.
    pub(crate) fn of(
        compiled: &Compiled,
        compresses: Option<Compressibility>,
        macros: &[Macro],
    ) -> Self {
        let first_test = narrow(2 * compiled.facts.len());
        let first_running = first_test + narrow(compiled.tests.len());
        let mut tests_of_fluent = vec![Vec::new(); compiled.fluents.len()];
        let mut is_free_test = Vec::new();
        for (number, test) in compiled.tests.iter().enumerate() {
            is_free_test.push(test.difference.reads_duration());
            test.difference.visit_fluents(&mut |fluent| {
                let tests: &mut Vec<u32> = &mut tests_of_fluent[fluent as usize];
                if tests.last() != Some(&narrow(number)) {
                    tests.push(narrow(number));
                }
            });
        }
        let mut graph = Self {
            proposition_count: first_running as usize + compiled.actions.len(),
            end_of: vec![NONE; compiled.actions.len()],
            start_of: vec![NONE; compiled.actions.len()],
            is_free_test,
            first_test,
            first_running,
            tests_of_fluent,
            ..Self::default()
        };
        graph.add_timetables(compiled);
        let stays = if compiled.tuning.uses(Technique::Envelopes) {
            Stays::of(compiled, narrow(graph.proposition_count))
        } else {
            Stays::default()
        };
        graph.proposition_count += stays.list.len();
        for number in 0..compiled.actions.len() {
            let number = narrow(number);
            let place = macros.partition_point(|data| data.envelope < number);
            let starts_alone = macros.get(place).is_none_or(|next| next.envelope != number);
            graph.add_action(compiled, &stays, number, compresses, starts_alone);
        }
        graph.add_macros(compiled, &stays, macros);
        graph.add_rules(compiled);
        graph.add_timed(compiled);
        graph.goal = graph.propositions(&compiled.goal);
        graph.follow_up_assignments(compiled.tests.len());
        graph.stays = stays.list;
        graph.has_single_starts = graph.operators.iter().any(|operator| {
            matches!(operator.kind, Kind::Start(action) if graph.end_of[action as usize] != NONE)
        });
        graph.index();
        graph.excluded_operators = if compiled.tuning.uses(Technique::Exclusions) {
            graph.find_excluded_operators(compiled)
        } else {
            vec![Vec::new(); compiled.actions.len()]
        };
        graph
    }

    /// Sets the cost of each step.
    pub(crate) fn set_step_costs(&mut self, step_costs: &StepCosts) {
        for operator in &mut self.operators {
            operator.cost = match operator.kind {
                Kind::Start(action) => step_costs.start(action),
                Kind::End(action) => step_costs.end(action),
                Kind::Compressed(action) => step_costs.start(action) + step_costs.end(action),
                Kind::Macro(_) | Kind::Timed(_) | Kind::Axiom => operator.cost,
            };
        }
    }

    /// Excludes the starts of these actions, by action number.
    pub(crate) fn exclude_starts(&mut self, compiled: &Compiled, is_left_out: &[bool]) {
        for (number, operator) in self.operators.iter().enumerate() {
            let is_out = match operator.kind {
                Kind::Start(action) | Kind::Compressed(action) => is_left_out[action as usize],
                Kind::Macro(number) => {
                    let Macro { envelope, content } = compiled.macros[number as usize];
                    is_left_out[envelope as usize] || is_left_out[content as usize]
                }
                Kind::End(_) | Kind::Timed(_) | Kind::Axiom => false,
            };
            if is_out {
                // Add a precondition that never holds.
                self.precondition_counts[number] += 1;
                self.sources.retain(|&source| source != narrow(number));
            }
        }
    }

    /// Returns the cost of a repetition of an operator. An end needs another start.
    pub(crate) fn cost_of_repetition(&self, operator: u32) -> u32 {
        let data = &self.operators[operator as usize];
        let start = match data.kind {
            Kind::End(action) => self.start_of[action as usize],
            _ => NONE,
        };
        let start = self.operators.get(start as usize);
        data.cost + start.map_or(0, |start| start.cost)
    }

    /// Returns the proposition that a test passes.
    pub(crate) fn test(&self, test: u32) -> u32 {
        self.first_test + test
    }

    /// Returns `true` if it is a literal or a test.
    pub(crate) fn is_listed(&self, proposition: u32) -> bool {
        proposition < self.first_running
    }

    /// Returns the test of the proposition, if it is one.
    pub(crate) fn test_of(&self, proposition: u32) -> Option<u32> {
        let is_test = (self.first_test..self.first_running).contains(&proposition);
        is_test.then(|| proposition - self.first_test)
    }

    /// Returns the proposition that an instance of the action is running.
    pub(crate) fn running(&self, action: u32) -> u32 {
        self.first_running + action
    }

    /// Returns the operators of an action's start and end; [`NONE`] if there is none.
    pub(crate) fn operators_of(&self, action: u32) -> (u32, u32) {
        let end = self.end_of[action as usize];
        (self.start_of[action as usize], end)
    }

    /// Returns the range in `needing_list` of the operators that need the proposition.
    pub(crate) fn dependents(&self, proposition: u32) -> Range<usize> {
        let begin = match proposition {
            0 => 0,
            _ => self.needing_ends[proposition as usize - 1],
        };
        begin as usize..self.needing_ends[proposition as usize] as usize
    }

    /// Returns the propositions that a formula requires.
    fn propositions(&mut self, formula: &Formula) -> Vec<u32> {
        let literals = formula.literals.iter().map(|literal| literal.0);
        let tests = formula.tests.iter().map(|&test| self.test(test));
        let mut list: Vec<u32> = literals.chain(tests).collect();
        for choice in &formula.choices {
            let chosen = narrow(self.proposition_count);
            self.proposition_count += 1;
            for part in choice {
                let needs = self.propositions(part);
                self.add(Kind::Axiom, 0, needs, &[(chosen, 0)], Vec::new());
            }
            list.push(chosen);
        }
        list
    }

    fn add(
        &mut self,
        kind: Kind,
        cost: u32,
        mut needs: Vec<u32>,
        effects: &[(u32, Ticks)],
        gains: Vec<(u32, Gain)>,
    ) -> u32 {
        needs.sort_unstable();
        needs.dedup();
        let preconditions = self.preconditions.len()..self.preconditions.len() + needs.len();
        self.precondition_counts.push(narrow(needs.len()));
        self.preconditions.extend(needs);
        let first_effect = self.effects.len();
        for &(effect, delay) in effects {
            self.effects.push(effect);
            self.delays.push(delay);
        }
        let first_gain = self.gains.len();
        self.gains.extend(gains);
        self.operators.push(Operator {
            kind,
            cost,
            is_step: kind != Kind::Axiom,
            preconditions,
            effects: first_effect..self.effects.len(),
            gains: first_gain..self.gains.len(),
            windows: 0..0,
            span: 0,
        });
        narrow(self.operators.len() - 1)
    }

    fn add_rules(&mut self, compiled: &Compiled) {
        for rule in compiled.strata.iter().flatten() {
            let needs = self.propositions(&rule.body);
            self.add(Kind::Axiom, 0, needs, &[(2 * rule.head, 0)], Vec::new());
        }
        // The causes of a derived fact's becoming false are not analysed: it is assumed to be
        // possible.
        for &head in compiled.derived.iter().flatten() {
            self.add(Kind::Axiom, 1, Vec::new(), &[(2 * head + 1, 0)], Vec::new());
        }
    }

    fn add_timed(&mut self, compiled: &Compiled) {
        for (number, timed) in compiled.timed.iter().enumerate() {
            let adds = timed.adds.iter().map(|fact| 2 * fact);
            let deletes = timed.deletes.iter().map(|fact| 2 * fact + 1);
            let effects: Vec<(u32, Ticks)> = adds.chain(deletes).map(|e| (e, 0)).collect();
            let mut gains = Vec::new();
            for (fluent, _) in &timed.assigns {
                self.add_any_gain(*fluent, &mut gains);
            }
            let kind = Kind::Timed(narrow(number));
            self.add(kind, 1, Vec::new(), &effects, gains);
        }
    }

    /// Replaces [`Gain::Sets`] by [`Gain::Reaches`] where later changes of the difference can close
    /// the remaining gap.
    fn follow_up_assignments(&mut self, test_count: usize) {
        // For each test the greatest gains upwards and downwards; infinite for changes that may
        // reach any value.
        let mut best = vec![[0.0_f64; 2]; test_count];
        for &(test, gain) in &self.gains {
            let best = &mut best[test as usize];
            match gain {
                Gain::Adds(gain) => {
                    let direction = usize::from(gain < 0.0);
                    best[direction] = best[direction].max(gain.abs());
                }
                Gain::Reaches(_) => *best = [f64::INFINITY; 2],
                Gain::Sets(_) => {}
            }
        }
        for (test, gain) in &mut self.gains {
            let Gain::Sets(gap) = *gain else { continue };
            let best = best[*test as usize][usize::from(gap < 0.0)];
            if best > 0.0 {
                #[allow(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "clamped to a small positive range"
                )]
                let more = (gap.abs() / best).ceil().clamp(1.0, 1000.0) as u32;
                *gain = Gain::Reaches(more);
            }
        }
    }

    /// Indexes the operators by their preconditions.
    fn index(&mut self) {
        let mut counts = vec![0_u32; self.proposition_count];
        for &need in &self.preconditions {
            counts[need as usize] += 1;
        }
        let mut end = 0;
        let mut places = Vec::with_capacity(self.proposition_count);
        self.needing_ends = Vec::with_capacity(self.proposition_count);
        for &count in &counts {
            places.push(end);
            end += count;
            self.needing_ends.push(end);
        }
        self.needing_list = vec![0; self.preconditions.len()];
        for (number, operator) in self.operators.iter().enumerate() {
            for &need in &self.preconditions[operator.preconditions.clone()] {
                let place = &mut places[need as usize];
                self.needing_list[*place as usize] = narrow(number);
                *place += 1;
            }
            if operator.preconditions.is_empty() {
                self.sources.push(narrow(number));
            }
        }
    }
}

pub(super) fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}
