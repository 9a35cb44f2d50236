//! The initial state of the search.

use super::compile::Compiled;
use super::expressions::Form;
use super::network::Network;
use super::state::{OpenAction, State};
use super::symbolic;

/// Returns the state of the situation, with its running actions.
pub(crate) fn root(compiled: &Compiled) -> State {
    let beginning = &compiled.initial;
    let mut state = State::new(compiled, &beginning.facts, beginning.values.clone());
    state.cost.clone_from(&beginning.cost);
    state.network = Network::with_windows(compiled.windows.clone());
    for (number, running) in (0..).zip(&beginning.running) {
        let mut open =
            OpenAction::running_initially(number, running.start, running.least, running.most);
        open.duration.clone_from(&running.duration);
        if let Some(latest) = compiled.latest_end_in_window(number) {
            open.most = open.most.min(latest - running.start);
        }
        state.open.push(open);
    }
    if compiled.is_symbolic {
        state.symbolic = Some(Box::default());
        let now = Form::constant(beginning.time.clone());
        for place in 0..state.open.len() {
            for flow in &compiled.actions[place].flows {
                if let Some(rate) = flow.rate.value(&state.values, None) {
                    state.open[place].flows.push((flow.fluent, rate));
                }
            }
            for (fluent, rate) in state.open[place].flows.clone() {
                // Without a value there is nothing to change; then the compilation is not marked as
                // exact.
                let _ = symbolic::flow(&mut state, fluent, &rate, &now);
            }
        }
    }
    state
}
