//! Earliest times of propositions and operators, and the exclusion of operators that are too late
//! for their deadlines.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::super::compile::{Compiled, NONE};
use super::super::end_windows::EndWindows;
use super::super::network::SETTLED;
use super::super::state::State;
use super::super::time::{NEVER, Ticks};
use super::graph::{Graph, Kind, Operator};

/// Tables that are reused from one state to the next.
#[derive(Debug, Default)]
pub(super) struct Deadlines {
    /// The earliest time of each proposition.
    time: Vec<Ticks>,
    missing: Vec<u32>,
    /// The earliest start of each operator; [`NEVER`] while a precondition is missing.
    pub(super) earliest_starts: Vec<Ticks>,
    queue: BinaryHeap<Reverse<(Ticks, u32)>>,
}

impl Deadlines {
    /// Excludes the operators that are too late: those whose conditions cannot be true in time,
    /// even if reached facts are never lost and everything happens as early as possible (`h_max`,
    /// Haslum & Geffner, ECP 2001, with the windows of timed initials).
    ///
    /// If choices come in chronological order, `spans` gives the latest ends of the running
    /// actions. Returns `true` if all of them may still end in time.
    pub(super) fn exclude_late_operators(
        &mut self,
        compiled: &Compiled,
        graph: &Graph,
        state: &State,
        horizon: Ticks,
        spans: Option<&EndWindows>,
        waiting: &mut [u32],
    ) -> bool {
        self.time.clear();
        self.time.resize(graph.proposition_count, NEVER);
        self.missing.clone_from(&graph.precondition_counts);
        self.earliest_starts.clear();
        let now = spans.map_or(compiled.now, |spans| spans.now);
        self.earliest_starts.resize(graph.operators.len(), now);
        self.queue.clear();
        self.reach_true_propositions(compiled, graph, state, spans);
        for &operator in &graph.sources {
            self.fire(compiled, graph, state, operator, horizon);
        }
        while let Some(Reverse((time, proposition))) = self.queue.pop() {
            if self.time[proposition as usize] != time {
                continue;
            }
            for position in graph.dependents(proposition) {
                let operator = graph.needing_list[position];
                self.missing[operator as usize] -= 1;
                let begin = &mut self.earliest_starts[operator as usize];
                *begin = (*begin).max(time);
                if self.missing[operator as usize] == 0 {
                    self.fire(compiled, graph, state, operator, horizon);
                }
            }
        }
        for (number, waiting) in waiting.iter_mut().enumerate() {
            if self.missing[number] > 0 || self.earliest_starts[number] >= NEVER {
                *waiting += 1;
            }
        }
        spans.is_none_or(|spans| self.can_all_end_in_time(graph, state, spans))
    }

    /// Returns the operators whose conditions were reached, but too late.
    pub(super) fn late_operators(&self) -> Box<[u32]> {
        let starts = (0..).zip(self.missing.iter().zip(&self.earliest_starts));
        let late = starts.filter(|(_, (missing, start))| **missing == 0 && **start >= NEVER);
        late.map(|(operator, _)| operator).collect()
    }

    /// Returns `true` if the end condition of each running action may become true before the action
    /// has to end.
    fn can_all_end_in_time(&self, graph: &Graph, state: &State, spans: &EndWindows) -> bool {
        let mut ends = state.open.iter().zip(&spans.ends);
        ends.all(|(open, &(_, latest))| {
            let end = graph.end_of[open.action as usize] as usize;
            self.missing[end] == 0 && self.earliest_starts[end] <= latest
        })
    }

    fn reach_true_propositions(
        &mut self,
        compiled: &Compiled,
        graph: &Graph,
        state: &State,
        spans: Option<&EndWindows>,
    ) {
        let now = spans.map_or(compiled.now, |spans| spans.now);
        for (fact, annotations) in compiled.fact_annotations.iter().enumerate() {
            let is_true = state.facts[fact / 64] >> (fact % 64) & 1 == 1;
            let annotation = annotations[usize::from(!is_true)];
            let mut time = now;
            if annotation != NONE && spans.is_none() {
                time = time.max(state.annotations[annotation as usize]);
                for &(marked, node) in &state.network.marks {
                    if marked == annotation {
                        time = time.max(state.network.earliest(node));
                    }
                }
            }
            self.lower(graph, 2 * fact + usize::from(!is_true), time);
        }
        for test in 0..compiled.tests.len() {
            let number = u32::try_from(test).expect("few tests");
            let is_free =
                graph.is_free_test[test] || super::depends_on_times(compiled, number, state);
            if is_free || state.test_holds(compiled, number, None) {
                self.lower(graph, graph.test(number) as usize, now);
            }
        }
        for stay in &graph.stays {
            if stay.holds(state, spans) {
                self.lower(graph, stay.proposition as usize, now);
            }
        }
        for (place, open) in state.open.iter().enumerate() {
            let running = graph.running(open.action) as usize;
            if let Some(spans) = spans {
                self.lower(graph, running, spans.ends[place].0);
                continue;
            }
            let start = if open.node == SETTLED {
                open.start
            } else {
                state.network.earliest(open.node)
            };
            self.lower(graph, running, start + open.least);
        }
    }

    fn lower(&mut self, graph: &Graph, proposition: usize, time: Ticks) {
        if time < self.time[proposition] {
            self.time[proposition] = time;
            let number = u32::try_from(proposition).expect("numbered by u32");
            if graph.dependents(number).is_empty() {
                return;
            }
            self.queue.push(Reverse((time, number)));
        }
    }

    fn fire(
        &mut self,
        compiled: &Compiled,
        graph: &Graph,
        state: &State,
        number: u32,
        horizon: Ticks,
    ) {
        let operator = &graph.operators[number as usize];
        let mut begin = self.earliest_starts[number as usize];
        if let Kind::Timed(timed) = operator.kind {
            if timed < state.timed {
                begin = NEVER;
            } else {
                begin = begin.max(compiled.timed[timed as usize].time);
            }
        } else {
            begin = in_windows(graph, operator, begin);
            if begin > horizon - operator.span {
                begin = NEVER;
            }
        }
        if let Kind::End(action) = operator.kind {
            // An end that is too late for all running instances, where no other instance can start.
            let is_running_only = compiled.action(action).start == NONE;
            let is_late = |open: &super::super::state::OpenAction| {
                open.action != action || open.most < NEVER && begin > open.start + open.most
            };
            if is_running_only && state.open.iter().all(is_late) {
                begin = NEVER;
            }
        }
        self.earliest_starts[number as usize] = begin;
        if begin >= NEVER {
            return;
        }
        for position in operator.effects.clone() {
            let time = begin + graph.delays[position];
            self.lower(graph, graph.effects[position] as usize, time);
        }
        for position in operator.gains.clone() {
            let (test, _) = graph.gains[position];
            self.lower(graph, graph.test(test) as usize, begin);
        }
    }
}

/// Returns the earliest time, not before `begin`, at which the operator can begin according to the
/// literals that change at fixed times.
pub(crate) fn in_windows(graph: &Graph, operator: &Operator, mut begin: Ticks) -> Ticks {
    let windows = &graph.windows[operator.windows.clone()];
    loop {
        let before = begin;
        for window in windows {
            let spans = &graph.timetable[window.timetable as usize];
            let fitting = spans.iter().find_map(|&(from, until)| {
                let time = begin.max(from.saturating_add(window.lead));
                (until >= NEVER || time <= until - window.tail).then_some(time)
            });
            let Some(time) = fitting else {
                return NEVER;
            };
            begin = time;
        }
        if begin == before {
            return begin;
        }
    }
}
