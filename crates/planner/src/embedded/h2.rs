//! Lower bounds on the times at which pairs of atoms can be true together, which prove that a goal
//! is too late.
//!
//! `h²` of temporal planning (Haslum & Geffner, "Heuristic planning with time and resources", ECP
//! 2001; the table is that of TGP, Smith & Weld, IJCAI 1999), over starts and ends: for each pair
//! of atoms, a time before which no sequence of choices has both. For example, a robot cannot have
//! delivered an object before it has driven, which no bound on single facts detects.
//!
//! The time of a pair is that of the later of the two happenings that made the atoms true. A
//! sequence of choices need not be in chronological order (see [`State`](super::state::State)). So
//! a duration counts from the time at which two atoms held together only if the happenings that
//! made them true must come before the start, because they interfere.

mod model;
mod operators;
#[cfg(test)]
pub(super) mod tests;

use super::compile::{Compiled, NONE};
use super::formula::Literal;
use super::relaxed::{Graph, Missing, last_end};
use super::state::{OpenAction, State};
use super::time::{NEVER, Ticks};
use model::{Kind, Model};
use operators::start_of;

/// Maximum number of running actions that are required to end before happenings that they exclude.
const MAX_ENDED: usize = 16;

/// Bounds of one problem. Reuses its tables from one state to the next.
#[derive(Debug)]
pub(crate) struct H2<'a> {
    compiled: &'a Compiled,
    graph: Graph,
    model: Model,
    /// Latest time of a happening.
    pub(crate) horizon: Ticks,
    /// Number of atoms: those of the model, then one for each running action in the state, which
    /// states that the action has ended.
    count: usize,
    /// For each pair, the earliest time, by row.
    time: Vec<Ticks>,
    /// The time at which an atom of the state became true; [`NEVER`] if it does not hold.
    since: Vec<Ticks>,
    /// For each action and atom, the earliest time of both if the action was started after the atom
    /// became true, or together with it, in the order of choices.
    started: Vec<Ticks>,
    /// As [`started`](Self::started), for atoms that became true after the start.
    meanwhile: Vec<Ticks>,
    /// The needs of each operator in this state.
    needs: Vec<Vec<usize>>,
    /// The earliest time of each operator.
    earliest_starts: Vec<Ticks>,
    /// The round in which a row, or the data of an action, was last lowered.
    row_round: Vec<u32>,
    action_round: Vec<u32>,
    operator_round: Vec<u32>,
    round: u32,
    /// For each atom, the earliest time at which it can hold together with the effects of an
    /// operator.
    with: Vec<Ticks>,
    /// The number of pairs looked up so far.
    pub(crate) work: u64,
}

impl<'a> H2<'a> {
    /// Returns `None` if the problem is too large.
    pub(crate) fn of(compiled: &'a Compiled) -> Option<Self> {
        let graph = Graph::of(compiled, None, &[]);
        let model = Model::of(compiled, &graph)?;
        let most = model.atom_count + MAX_ENDED;
        let (actions, operators) = (compiled.actions.len(), model.operators.len());
        Some(Self {
            compiled,
            horizon: NEVER,
            count: model.atom_count,
            time: vec![NEVER; most * most],
            since: vec![NEVER; most],
            started: vec![NEVER; actions * most],
            meanwhile: vec![NEVER; actions * most],
            needs: vec![Vec::new(); operators],
            earliest_starts: vec![NEVER; operators],
            row_round: vec![0; most],
            action_round: vec![0; actions],
            operator_round: vec![0; operators],
            round: 0,
            with: Vec::new(),
            work: 0,
            graph,
            model,
        })
    }

    /// Returns the number of timetables: literals that change at fixed times only.
    pub(crate) fn timetable_count(&self) -> usize {
        self.graph.timetable.len()
    }

    /// Assumes that the literal of a timetable is always true, and returns the spans in which it is
    /// true.
    pub(crate) fn ignore_timetable(&mut self, number: usize) -> Vec<(Ticks, Ticks)> {
        self.graph.forget_timetable(number)
    }

    /// Reverts [`ignore_timetable`](Self::ignore_timetable).
    pub(crate) fn restore_timetable(&mut self, number: usize, spans: Vec<(Ticks, Ticks)>) {
        self.graph.timetable[number] = spans;
    }

    /// Returns the literal of a timetable, and the time at which it last becomes false.
    pub(crate) fn deadline(
        &self,
        number: usize,
        spans: &[(Ticks, Ticks)],
    ) -> Option<(Literal, Ticks)> {
        let end = last_end(spans)?;
        Some((self.graph.timetable_literal(number)?, end))
    }

    /// Returns the parts of the goal that are too late by themselves. If there are none, returns two
    /// that are too late together, or those that are too late together with a running action; then
    /// `true` is returned, too. Valid after [`is_dead_end`](Self::is_dead_end) has returned `true`.
    pub(crate) fn missing_goals(&self) -> (Vec<Missing>, bool) {
        let goal = &self.model.goal;
        let is_late = |one: usize, other: usize| self.time[one * self.count + other] >= NEVER;
        let parts = |late: Vec<usize>| {
            let literals = late.iter().map(|&atom| self.model.literals[atom]);
            literals.map(Missing::Literal).collect()
        };
        let those = |is_late: &dyn Fn(usize) -> bool| -> Vec<usize> {
            goal.iter().copied().filter(|&atom| is_late(atom)).collect()
        };
        let alone = those(&|atom| is_late(atom, atom));
        if !alone.is_empty() {
            return (parts(alone), false);
        }
        for &one in goal {
            if let Some(&other) = goal.iter().find(|&&other| is_late(one, other)) {
                return (parts(vec![one, other]), true);
            }
        }
        let is_late = |atom| (self.model.atom_count..self.count).any(|other| is_late(atom, other));
        (parts(those(&is_late)), true)
    }

    /// Returns `true` if no plan has this beginning: the goal, with all running actions ended, is
    /// too late or unreachable.
    pub(crate) fn is_dead_end(&mut self, state: &State) -> bool {
        let ended = self.prepare(state);
        loop {
            self.round += 1;
            let before = self.round;
            let mut changed = false;
            for number in 0..self.model.operators.len() {
                if self.is_due(number) {
                    self.operator_round[number] = before;
                    changed |= self.fire(state, &ended, number);
                }
            }
            if !changed {
                break;
            }
        }
        let runs_for_ever = |open: &OpenAction| {
            let end = self.model.end_of[open.action as usize];
            self.earliest_starts[end as usize] >= NEVER
        };
        if state.open.iter().any(runs_for_ever) {
            return true;
        }
        let mut goal = self.model.goal.clone();
        goal.extend(ended.iter().map(|&(_, atom)| atom));
        let is_late = |one: usize, other: usize| {
            self.time[one * self.count + other] > self.latest(one).max(self.latest(other))
        };
        let mut pairs = goal
            .iter()
            .flat_map(|&one| goal.iter().map(move |&other| (one, other)));
        pairs.any(|(one, other)| is_late(one, other))
    }

    /// Initializes the tables from the state. Returns the running actions with the atoms which
    /// state that they have ended.
    fn prepare(&mut self, state: &State) -> Vec<(u32, usize)> {
        let mut ended: Vec<(u32, usize)> = Vec::new();
        for open in &state.open {
            let has_twin = state
                .open
                .iter()
                .filter(|other| other.action == open.action)
                .count()
                > 1;
            if !has_twin && ended.len() < MAX_ENDED {
                ended.push((open.action, self.model.atom_count + ended.len()));
            }
        }
        self.count = self.model.atom_count + ended.len();
        for (needs, operator) in self.needs.iter_mut().zip(&self.model.operators) {
            needs.clone_from(&operator.needs);
        }
        for &(action, atom) in &ended {
            for &breaker in &self.model.breakers[action as usize] {
                self.needs[breaker as usize].push(atom);
            }
        }
        let count = self.count;
        self.time[..count * count].fill(NEVER);
        self.since.fill(NEVER);
        self.started.fill(NEVER);
        self.meanwhile.fill(NEVER);
        self.earliest_starts.fill(NEVER);
        self.row_round.fill(0);
        self.action_round.fill(0);
        self.operator_round.fill(0);
        self.round = 0;
        let compiled = self.compiled;
        for (atom, literal) in self.model.literals.iter().enumerate() {
            if !literal.holds(&state.facts) {
                continue;
            }
            let annotation =
                compiled.fact_annotations[literal.fact() as usize][usize::from(!literal.truth())];
            let mut time = compiled.now;
            if annotation != NONE {
                time = time.max(state.annotations[annotation as usize]);
                for &(marked, node) in &state.network.marks {
                    if marked == annotation {
                        time = time.max(state.network.earliest(node));
                    }
                }
            }
            self.since[atom] = time;
        }
        for open in &state.open {
            let atom = self.model.running[open.action as usize];
            let start = start_of(state, open).max(compiled.now);
            self.since[atom] = self.since[atom].min(start);
        }
        for one in 0..count {
            for other in 0..count {
                let time = self.since[one].max(self.since[other]);
                self.time[one * count + other] = time;
            }
        }
        ended
    }

    /// Returns `true` if the inputs of an operator have changed.
    fn is_due(&self, number: usize) -> bool {
        let last = self.operator_round[number];
        let needs = &self.needs[number];
        let keeps = &self.model.operators[number].keeps;
        let action_changed = match self.model.operators[number].kind {
            Kind::End(action) => self.action_round[action as usize] >= last,
            _ => false,
        };
        last == 0
            || needs.is_empty()
            || action_changed
            || needs
                .iter()
                .chain(keeps)
                .any(|&need| self.row_round[need] >= last)
    }

    /// Returns the earliest time at which all of these atoms can hold.
    fn earliest_joint_time(&self, atoms: &[usize]) -> Ticks {
        let mut time = self.compiled.now;
        for (place, &one) in atoms.iter().enumerate() {
            let row = &self.time[one * self.count..(one + 1) * self.count];
            for &other in &atoms[place..] {
                time = time.max(row[other]);
            }
        }
        time
    }

    /// Adds the effects of the operator, together with all atoms that may persist. Returns `true`
    /// if anything changed.
    fn fire(&mut self, state: &State, ended: &[(u32, usize)], number: usize) -> bool {
        let Some(begin) = self.earliest(state, number) else {
            return false;
        };
        self.earliest_starts[number] = begin;
        let kind = self.model.operators[number].kind;
        let mut adds = self.model.operators[number].adds.clone();
        if let Kind::End(action) = kind {
            adds.extend(ended.iter().filter(|entry| entry.0 == action).map(|e| e.1));
        }
        let mut changed = false;
        for (place, &one) in adds.iter().enumerate() {
            for &other in &adds[place..] {
                changed |= self.lower(one, other, begin);
            }
            if let Kind::Start(action) = kind
                && one != self.model.running[action as usize]
            {
                changed |= self.note_started(action, one, begin);
            }
        }
        let mut with = std::mem::take(&mut self.with);
        self.find_companions(state, number, begin, &mut with);
        for &one in &adds {
            changed |= self.lower_row(one, &with);
        }
        if let Kind::Start(action) = kind {
            changed |= self.lower_started(action, &with);
        }
        for (offset, &time) in with[self.model.literals.len()..self.model.atom_count]
            .iter()
            .enumerate()
        {
            if time < NEVER {
                let action = self.model.action_of(self.model.literals.len() + offset);
                for &one in &adds {
                    changed |= self.note_meanwhile(action, one, time);
                }
            }
        }
        self.with = with;
        changed
    }

    fn lower(&mut self, one: usize, other: usize, time: Ticks) -> bool {
        let atoms = self.model.atom_count;
        if one < atoms && other < atoms && self.model.excludes[one * atoms + other] {
            return false;
        }
        if time >= self.time[one * self.count + other] {
            return false;
        }
        self.time[one * self.count + other] = time;
        self.time[other * self.count + one] = time;
        self.row_round[one] = self.round;
        self.row_round[other] = self.round;
        true
    }

    /// Lowers the times of an atom's pairs with all others.
    fn lower_row(&mut self, one: usize, with: &[Ticks]) -> bool {
        let mut changed = false;
        for (other, &time) in with.iter().enumerate() {
            if time < self.time[one * self.count + other] {
                changed |= self.lower(one, other, time);
            }
        }
        changed
    }

    fn lower_started(&mut self, action: u32, with: &[Ticks]) -> bool {
        let most = self.model.atom_count + MAX_ENDED;
        let row = &mut self.started[action as usize * most..];
        let mut changed = false;
        for (known, &time) in row.iter_mut().zip(with) {
            if time < *known {
                *known = time;
                changed = true;
            }
        }
        if changed {
            self.action_round[action as usize] = self.round;
        }
        changed
    }

    fn note_started(&mut self, action: u32, atom: usize, time: Ticks) -> bool {
        let place = action as usize * (self.model.atom_count + MAX_ENDED) + atom;
        let is_lower = time < self.started[place];
        if is_lower {
            self.started[place] = time;
            self.action_round[action as usize] = self.round;
        }
        is_lower
    }

    fn note_meanwhile(&mut self, action: u32, atom: usize, time: Ticks) -> bool {
        let place = action as usize * (self.model.atom_count + MAX_ENDED) + atom;
        let is_lower = time < self.meanwhile[place];
        if is_lower {
            self.meanwhile[place] = time;
            self.action_round[action as usize] = self.round;
        }
        is_lower
    }
}
