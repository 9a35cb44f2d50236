//! Operators of macro-operators.

#[cfg(test)]
mod tests;

use super::super::super::compile::{Compiled, Macro, NONE, Update};
use super::super::super::time::Ticks;
use super::actions::{effects_of, least_ticks};
use super::{Graph, Kind, Stays, narrow};

impl Graph {
    /// Adds the operators of macro-operators.
    pub(super) fn add_macros(&mut self, compiled: &Compiled, stays: &Stays, macros: &[Macro]) {
        for (number, &data) in macros.iter().enumerate() {
            self.add_macro(compiled, stays, narrow(number), data);
        }
    }

    fn add_macro(&mut self, compiled: &Compiled, stays: &Stays, number: u32, data: Macro) {
        let (outer, inner) = (
            compiled.action(data.envelope),
            compiled.action(data.content),
        );
        let [mut needs, needs_of_content] = [outer, inner].map(|action| {
            let mut needs = self.propositions(&compiled.snap(action.start).condition);
            needs.extend(self.propositions(&compiled.needed_before_start(action)));
            needs.extend(stays.needs(compiled, action));
            needs
        });
        let mut offered: Vec<u32> = effects_of(compiled.snap(outer.start)).collect();
        offered.extend(stays.offers(compiled, data.envelope));
        needs.extend(
            needs_of_content
                .iter()
                .filter(|need| !offered.contains(need)),
        );
        let end_of_content = least_ticks(compiled, inner);
        let span = least_ticks(compiled, outer).max(end_of_content);
        let happenings = [
            (outer.start, 0),
            (inner.start, 0),
            (inner.end, end_of_content),
            (outer.end, span),
        ];
        let happenings = happenings.into_iter().filter(|&(snap, _)| snap != NONE);
        let mut effects: Vec<(u32, Ticks)> = Vec::new();
        let mut updates: Vec<&Update> = Vec::new();
        for (snap, delay) in happenings {
            let snap = compiled.snap(snap);
            for effect in effects_of(snap) {
                // A literal and its negation have adjacent numbers. The last effect on a fact
                // decides.
                effects.retain(|&(known, _)| known / 2 != effect / 2);
                effects.push((effect, delay));
            }
            updates.extend(&snap.updates);
        }
        let mut gains = self.gains_of(compiled, &updates);
        for flow in &inner.flows {
            self.add_flow_gain(compiled, flow, &mut gains);
        }
        let operator = self.add(Kind::Macro(number), 1, needs, &effects, gains);
        self.operators[operator as usize].span = span;
    }
}
