//! The relaxed problem: propositions and operators without deletions.

mod timetables;

use std::ops::Range;

use super::super::compile::{Action, Change, Compiled, Eagerness, NONE, Snap, Update};
use super::super::formula::Formula;
use super::super::guide::Guide;
use super::super::time::{NEVER, Ticks};
use super::numbers;
pub(crate) use timetables::Window;

/// What an operator stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Start(u32),
    Whole(u32),
    /// The end of some instance of the action.
    End(u32),
    Timed(u32),
    /// A consequence, not a step.
    Axiom,
}

/// Once all its preconditions are reached, its effects are.
#[derive(Clone, Debug)]
pub(crate) struct Operator {
    pub(crate) kind: Kind,
    pub(crate) cost: u32,
    /// Whether this stands for the step itself, not for one of its conditional effects.
    pub(crate) is_step: bool,
    pub(crate) preconditions: Range<usize>,
    pub(crate) effects: Range<usize>,
    pub(crate) gains: Range<usize>,
    /// Positions in [`Graph::windows`].
    pub(crate) windows: Range<usize>,
    /// The least time from when the preconditions hold to when it is over.
    pub(crate) span: Ticks,
}

/// See the module.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    pub(crate) proposition_count: usize,
    pub(crate) operators: Vec<Operator>,
    pub(crate) preconditions: Vec<u32>,
    pub(crate) precondition_counts: Vec<u32>,
    pub(crate) effects: Vec<u32>,
    /// For each effect, the least time after the beginning of its operator.
    pub(crate) delays: Vec<Ticks>,
    /// See [`Window`].
    pub(crate) windows: Vec<Window>,
    /// From when until when a literal holds that changes at fixed times only.
    pub(crate) timetable: Vec<Vec<(Ticks, Ticks)>>,
    /// The timetable of each literal; [`NONE`] if it has none.
    timetable_of: Vec<u32>,
    /// Tests, and what an operator adds to their difference.
    pub(crate) gains: Vec<(u32, f64)>,
    /// Operators without preconditions.
    pub(crate) sources: Vec<u32>,
    pub(crate) goal: Vec<u32>,
    /// For each action its end's operator.
    pub(crate) end_of: Vec<u32>,
    /// For each action the operator of its start, or of the whole.
    start_of: Vec<u32>,
    /// Tests that the relaxation takes for granted: they read `?duration`.
    pub(crate) is_free_test: Vec<bool>,
    needing_ends: Vec<u32>,
    pub(crate) needing_list: Vec<u32>,
    first_test: u32,
    first_running: u32,
    tests_of_fluent: Vec<Vec<u32>>,
}

/// An operator before it enters the graph.
struct Draft<'a> {
    kind: Kind,
    needs: Vec<u32>,
    is_running: Option<u32>,
    action: &'a Action,
    snaps: &'a [&'a Snap],
}

impl Graph {
    pub(crate) fn of(compiled: &Compiled, haste: Option<Eagerness>) -> Self {
        let first_test = narrow(2 * compiled.facts.len());
        let first_running = first_test + narrow(compiled.tests.len());
        let mut tests_of_fluent = vec![Vec::new(); compiled.fluents.len()];
        let mut is_free_test = Vec::new();
        for (number, test) in compiled.tests.iter().enumerate() {
            is_free_test.push(test.difference.reads_duration());
            test.difference.visit_fluents(&mut |fluent| {
                tests_of_fluent[fluent as usize].push(narrow(number));
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
        for (number, action) in compiled.actions.iter().enumerate() {
            graph.add_action(compiled, narrow(number), action, haste);
        }
        graph.add_rules(compiled);
        graph.add_timed(compiled);
        graph.goal = graph.propositions(&compiled.goal);
        graph.index();
        graph
    }

    /// Lets each step count for what it costs.
    pub(crate) fn weigh(&mut self, guide: &Guide) {
        for operator in &mut self.operators {
            operator.cost = match operator.kind {
                Kind::Start(action) => guide.start(action),
                Kind::End(action) => guide.end(action),
                Kind::Whole(action) => guide.start(action) + guide.end(action),
                Kind::Timed(_) | Kind::Axiom => operator.cost,
            };
        }
    }

    /// The proposition that a test is passed.
    pub(crate) fn test(&self, test: u32) -> u32 {
        self.first_test + test
    }

    /// The proposition that an instance of the action is under way.
    pub(crate) fn running(&self, action: u32) -> u32 {
        self.first_running + action
    }

    /// The operators of an action's start and end; [`NONE`] if there is none.
    pub(crate) fn operators_of(&self, action: u32) -> (u32, u32) {
        let end = self.end_of[action as usize];
        (self.start_of[action as usize], end)
    }

    /// Where in `needing_list` the operators stand that need the proposition.
    pub(crate) fn needing(&self, proposition: u32) -> Range<usize> {
        let begin = match proposition {
            0 => 0,
            _ => self.needing_ends[proposition as usize - 1],
        };
        begin as usize..self.needing_ends[proposition as usize] as usize
    }

    /// The propositions that a formula asks for.
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
        gains: Vec<(u32, f64)>,
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

    fn add_action(
        &mut self,
        compiled: &Compiled,
        number: u32,
        action: &Action,
        haste: Option<Eagerness>,
    ) {
        if action.end == NONE {
            let snap = compiled.snap(action.start);
            let needs = self.propositions(&snap.condition);
            self.start_of[number as usize] = self.add_snaps(
                compiled,
                &Draft {
                    kind: Kind::Start(number),
                    needs,
                    is_running: None,
                    action,
                    snaps: &[snap],
                },
            );
            return;
        }
        let end = compiled.snap(action.end);
        let running = self.running(number);
        let mut end_needs = self.propositions(&end.condition);
        if action.start != NONE {
            let start = compiled.snap(action.start);
            let mut needs = self.propositions(&start.condition);
            // What must hold from the start on, and is not the start's own doing. Another start
            // at the same moment may bring it about, if such a pair exists; see the compiler's
            // gap.
            let gained: Vec<u32> = effects_of(start).collect();
            let over_all = self.propositions(&action.over_all);
            let tests = self.first_test..self.first_running;
            needs.extend(
                over_all
                    .iter()
                    .filter(|need| !gained.contains(need) && !tests.contains(need)),
            );
            let is_whole = haste.is_some_and(|haste| action.eagerness >= haste)
                && end_needs
                    .iter()
                    .all(|need| over_all.contains(need) || gained.contains(need));
            let (snaps, kind) = if is_whole {
                (vec![start, end], Kind::Whole(number))
            } else {
                (vec![start], Kind::Start(number))
            };
            self.start_of[number as usize] = self.add_snaps(
                compiled,
                &Draft {
                    kind,
                    needs,
                    is_running: (!is_whole).then_some(running),
                    action,
                    snaps: &snaps,
                },
            );
        }
        end_needs.push(running);
        self.end_of[number as usize] = self.add_snaps(
            compiled,
            &Draft {
                kind: Kind::End(number),
                needs: end_needs,
                is_running: None,
                action,
                snaps: &[end],
            },
        );
    }

    /// Adds an operator for the snaps together, and one for each conditional effect.
    fn add_snaps(&mut self, compiled: &Compiled, draft: &Draft<'_>) -> u32 {
        let least = least_ticks(compiled, draft.action);
        let mut effects: Vec<(u32, Ticks)> = Vec::new();
        effects.extend(draft.is_running.map(|running| (running, least)));
        for (snap, delay) in draft.snaps.iter().zip([0, least]) {
            effects.extend(effects_of(snap).map(|effect| (effect, delay)));
        }
        let span = if draft.snaps.len() > 1 { least } else { 0 };
        let updates: Vec<&Update> = draft.snaps.iter().flat_map(|snap| &snap.updates).collect();
        let mut gains = self.gains_of(compiled, &updates);
        // A continuous change may reach any value, from the start to the end.
        for flow in &draft.action.flows {
            self.add_any_gain(flow.fluent, &mut gains);
        }
        let windows = self.windows_of(compiled, draft);
        let operator = self.add(draft.kind, 1, draft.needs.clone(), &effects, gains);
        self.operators[operator as usize].windows = windows.clone();
        self.operators[operator as usize].span = span;
        for effect in draft.snaps.iter().flat_map(|snap| &snap.conditional) {
            let mut needs = draft.needs.clone();
            needs.extend(self.propositions(&effect.now));
            if let Some(guard) = effect.at_start
                && !matches!(draft.kind, Kind::End(_))
            {
                needs.extend(self.propositions(&draft.action.guards[guard as usize]));
            }
            let (effects, gains) = match &effect.change {
                Change::Add(fact) => (vec![(2 * fact, 0)], Vec::new()),
                Change::Delete(fact) => (vec![(2 * fact + 1, 0)], Vec::new()),
                Change::Update(update) => (Vec::new(), self.gains_of(compiled, &[update])),
                Change::Cost(_) => continue,
            };
            let extra = self.add(draft.kind, 1, needs, &effects, gains);
            self.operators[extra as usize].is_step = false;
            self.operators[extra as usize].windows = windows.clone();
        }
        operator
    }

    fn gains_of(&self, compiled: &Compiled, updates: &[&Update]) -> Vec<(u32, f64)> {
        let mut gains: Vec<(u32, f64)> = Vec::new();
        for update in updates {
            for &test in &self.tests_of_fluent[update.fluent as usize] {
                if gains.iter().all(|(known, _)| *known != test) {
                    let gain = numbers::gain(compiled, test, updates);
                    if gain.abs() > 0.0 {
                        gains.push((test, gain));
                    }
                }
            }
        }
        gains
    }

    fn add_any_gain(&self, fluent: u32, gains: &mut Vec<(u32, f64)>) {
        for &test in &self.tests_of_fluent[fluent as usize] {
            gains.retain(|(known, _)| *known != test);
            gains.push((test, f64::INFINITY));
        }
    }

    fn add_rules(&mut self, compiled: &Compiled) {
        for rule in compiled.strata.iter().flatten() {
            let needs = self.propositions(&rule.body);
            self.add(Kind::Axiom, 0, needs, &[(2 * rule.head, 0)], Vec::new());
        }
        // What makes a derived fact false is not followed up: it is taken to be possible.
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

    /// Sorts the operators by what they need.
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

/// The least duration of an action, as far as it does not depend on the state.
fn least_ticks(compiled: &Compiled, action: &Action) -> Ticks {
    compiled.scale.floor(&action.duration.least).0
}

fn most_ticks(compiled: &Compiled, action: &Action) -> Ticks {
    let most = action.duration.most.as_ref();
    most.map_or(NEVER, |most| compiled.scale.ceil(most).0)
}

fn effects_of(snap: &Snap) -> impl Iterator<Item = u32> + '_ {
    let adds = snap.adds.iter().map(|fact| 2 * fact);
    adds.chain(snap.deletes.iter().map(|fact| 2 * fact + 1))
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}
