//! The state in which the search begins.

use elbowroom_model::Situation;
use elbowroom_num::End;

use super::Compiled;
use super::times::known_duration;
use crate::embedded::state::{Open, State};
use crate::embedded::symbolic::{self, Form};

/// The state of the situation, with what is under way.
pub(super) fn initial(compiled: &mut Compiled, situation: &Situation) -> State {
    let facts = compiled
        .facts
        .iter()
        .map(|fact| situation.state.facts.contains(fact));
    let values = compiled
        .fluents
        .iter()
        .map(|fluent| situation.state.values.get(fluent).cloned())
        .collect();
    let mut state = State::new(compiled, facts, values);
    let mut is_exact = true;
    for (number, running) in situation.running.iter().enumerate() {
        let (start, exact) = compiled.scale.floor(&running.start);
        is_exact &= exact;
        let (least, most) = (&running.duration.lower, &running.duration.upper);
        let elapsed = &situation.time - &running.start;
        let (least, exact) = match least {
            End::Infinite => (0, true),
            End::Closed(value) => compiled.scale.ceil(value),
            End::Open(value) => (compiled.scale.floor(value).0 + 1, false),
        };
        is_exact &= exact;
        let least = least.max(compiled.scale.ceil(&elapsed).0);
        let (most, exact) = match most {
            End::Infinite => (None, true),
            End::Closed(value) => {
                let (ticks, exact) = compiled.scale.floor(value);
                (Some(ticks), exact)
            }
            End::Open(value) => (Some(compiled.scale.ceil(value).0 - 1), false),
        };
        is_exact &= exact;
        let mut open = Open::under_way(narrow(number), start, least, most);
        open.duration = known_duration(running).cloned();
        state.open.push(open);
    }
    compiled.is_exact &= is_exact;
    if compiled.is_symbolic {
        state.symbolic = Some(Box::default());
        let now = Form::constant(situation.time.clone());
        for place in 0..state.open.len() {
            for flow in &compiled.actions[place].flows {
                if let Some(rate) = flow.rate.value(&state.values, None) {
                    state.open[place].flows.push((flow.fluent, rate));
                }
            }
            for (fluent, rate) in state.open[place].flows.clone() {
                let flows = symbolic::flow(&mut state, fluent, &rate, &now);
                compiled.is_exact &= flows.is_some();
            }
        }
    }
    state
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}
