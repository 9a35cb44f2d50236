//! Rules of the bound: the earliest times of operators, and the atoms that can hold with them.

use super::super::compile::NONE;
use super::super::network::SETTLED;
use super::super::relaxed::in_windows;
use super::super::state::{OpenAction, State};
use super::super::time::{NEVER, Ticks};
use super::model::Kind;
use super::{H2, MAX_ENDED};

impl H2<'_> {
    /// Returns the earliest time of an operator, or `None` if it cannot happen.
    pub(super) fn earliest(&self, state: &State, number: usize) -> Option<Ticks> {
        let operator = &self.model.operators[number];
        let mut begin = self.earliest_joint_time(&self.needs[number]);
        if !self.allows(number, &operator.keeps) {
            return None;
        }
        match operator.kind {
            Kind::Timed(timed) => {
                // The actions whose over-all conditions it would break must have ended by then.
                let time = self.compiled.timed[timed as usize].time;
                return (timed >= state.timed && begin <= time).then_some(time);
            }
            Kind::Start(action) => {
                begin = self.in_windows(operator.relaxed, begin);
                if begin > self.horizon - self.model.least[action as usize] {
                    return None;
                }
            }
            Kind::End(action) => {
                begin = begin.max(self.earliest_end(state, action));
                begin = self.in_windows(operator.relaxed, begin);
                if begin > self.horizon {
                    return None;
                }
                let is_late = |open: &OpenAction| {
                    open.action != action || open.most < NEVER && begin > open.start + open.most
                };
                if self.compiled.action(action).start == NONE && state.open.iter().all(is_late) {
                    return None;
                }
            }
        }
        (begin < NEVER).then_some(begin)
    }

    /// Returns `true` if the atoms that an operator keeps can hold together with these atoms and
    /// with its needs.
    fn allows(&self, number: usize, atoms: &[usize]) -> bool {
        let keeps = &self.model.operators[number].keeps;
        keeps.iter().all(|&kept| {
            let row = &self.time[kept * self.count..(kept + 1) * self.count];
            atoms
                .iter()
                .chain(&self.needs[number])
                .all(|&other| row[other] < NEVER)
        })
    }

    fn in_windows(&self, relaxed: u32, begin: Ticks) -> Ticks {
        if begin >= NEVER {
            return NEVER;
        }
        in_windows(&self.graph, &self.graph.operators[relaxed as usize], begin)
    }

    /// Returns the earliest time at which some instance of the action can end, according to
    /// durations only.
    fn earliest_end(&self, state: &State, action: u32) -> Ticks {
        let start = self.model.start_of[action as usize];
        let mut end = NEVER;
        if start != NONE && self.earliest_starts[start as usize] < NEVER {
            end = self.earliest_starts[start as usize] + self.model.least[action as usize];
        }
        for open in state.open.iter().filter(|open| open.action == action) {
            end = end.min(start_of(state, open) + open.least);
        }
        end
    }

    /// Computes for each atom the earliest time at which an operator has happened and the atom
    /// persists; [`NEVER`] if that is impossible.
    pub(super) fn find_companions(
        &mut self,
        state: &State,
        number: usize,
        begin: Ticks,
        with: &mut Vec<Ticks>,
    ) {
        let operator = &self.model.operators[number];
        let count = self.count;
        with.clear();
        with.resize(count, begin);
        let row = |atom: usize| &self.time[atom * count..(atom + 1) * count];
        for &need in &self.needs[number] {
            for (time, &known) in with.iter_mut().zip(row(need)) {
                *time = (*time).max(known);
            }
        }
        if self.needs[number].is_empty() {
            for (atom, time) in with.iter_mut().enumerate() {
                *time = (*time).max(row(atom)[atom]);
            }
        }
        self.work += ((1 + self.needs[number].len() + operator.adds.len()) * count) as u64;
        for &kept in &operator.keeps {
            for (time, &known) in with.iter_mut().zip(row(kept)) {
                if known >= NEVER {
                    *time = NEVER;
                }
            }
        }
        for (time, &ends) in with.iter_mut().zip(&operator.ends) {
            if ends {
                *time = NEVER;
            }
        }
        let mut has_windows = false;
        match operator.kind {
            Kind::Timed(_) => return,
            Kind::Start(_) => {
                has_windows = !self.graph.operators[operator.relaxed as usize]
                    .windows
                    .is_empty();
            }
            Kind::End(_) => {}
        }
        for (atom, time) in with.iter_mut().enumerate() {
            if *time >= NEVER {
                continue;
            }
            if has_windows && self.is_before(number, atom) {
                *time = self.in_windows(operator.relaxed, *time);
            }
            if let Kind::End(action) = operator.kind {
                *time = (*time).max(self.end_with(state, action, atom));
            }
            if *time > self.latest(atom) {
                *time = NEVER;
            }
        }
    }

    /// Returns the latest relevant time of an atom. Timed initials may come after the end of the
    /// plan.
    pub(super) fn latest(&self, atom: usize) -> Ticks {
        let is_timed = self.model.is_timed.get(atom).copied().unwrap_or(false);
        if is_timed {
            NEVER - 1
        } else {
            self.horizon.min(NEVER - 1)
        }
    }

    /// Returns `true` if an atom that became true before an operator, in the order of choices, also
    /// became true earlier in time.
    fn is_before(&self, number: usize, atom: usize) -> bool {
        let since = self.since[atom];
        let comes_after = &self.model.operators[number].comes_after;
        (since >= NEVER || since <= self.earliest_starts[number])
            && comes_after.get(atom).copied().unwrap_or(false)
    }

    /// Returns the earliest time of the end of an action together with an atom that holds when it
    /// ends. The atom has held since before the start, or became true while the action was running.
    fn end_with(&self, state: &State, action: u32, atom: usize) -> Ticks {
        let most = self.model.atom_count + MAX_ENDED;
        let place = action as usize * most + atom;
        let mut best = NEVER;
        if self.started[place] < NEVER {
            let start = self.model.start_of[action as usize] as usize;
            let least = self.model.least[action as usize];
            best = if self.is_before(start, atom) {
                self.started[place] + least
            } else {
                self.started[place].max(self.earliest_starts[start] + least)
            };
        }
        let under_way = || state.open.iter().filter(|open| open.action == action);
        // If the atom states that the action is running, another instance must be running.
        let is_other = atom != self.model.running[action as usize] || under_way().count() > 1;
        if self.since[atom] < NEVER && is_other {
            for open in under_way() {
                best = best.min(self.since[atom].max(start_of(state, open) + open.least));
            }
        }
        if self.meanwhile[place] < NEVER {
            best = best.min(self.meanwhile[place].max(self.earliest_end(state, action)));
        }
        best
    }
}

/// Returns the earliest start time of a running action.
pub(super) fn start_of(state: &State, open: &OpenAction) -> Ticks {
    if open.node == SETTLED {
        open.start
    } else {
        state.network.earliest(open.node)
    }
}
