//! A successor of `PExec` that knows what the world may do next: [`Lookahead`].

use std::ops::ControlFlow;

use crate::circumstances::Circumstances;
use crate::dispatch::{Choice, LayerDispatch};
use crate::network::TooCoupled;
use crate::optimum::{Optimum, Perturbed, Settings};
use crate::search::{Progress, Slot};

/// Chooses what is most likely to lead to success, counting retries, repetitions and detours.
///
/// P(A ∩ G) is the probability that an order works as it stands. But an executor can try again what
/// failed, so an order's value in execution is another. In a small world the best that can be done
/// in each state is tabulated once ([`optimum`](crate::optimum)), and looked up then. In all other
/// worlds this does what [`LayerDispatch`] does.
///
/// The model must be one of the world
/// ([`Semantics::World`](crate::Semantics::World)). With a plan of everything that can be done
/// ([`PartialOrderPlan::unordered`](elbowroom_plan::PartialOrderPlan::unordered)) no executor does
/// better; with a planner's plan, none that does only what is in the plan.
///
/// Timing: durations do not count in a table. A start is due at once, an end when it comes.
#[derive(Clone, Debug)]
pub struct Lookahead {
    table: Option<(Perturbed, Optimum)>,
    dispatch: LayerDispatch,
}

impl Lookahead {
    /// For the plan of `dispatch`; its world is tabulated here, if it can be.
    pub fn new(dispatch: LayerDispatch, settings: Settings) -> Self {
        let model = dispatch.search().model().clone();
        let table = Perturbed::new(model, settings).ok().map(|process| {
            let optimum = process.optimum();
            (process, optimum)
        });
        Self { table, dispatch }
    }

    /// Whether the world was small enough for a table.
    pub fn is_tabulated(&self) -> bool {
        self.table.is_some()
    }

    /// The probability of success from here, if the world is tabulated.
    pub fn value(&self, circumstances: &Circumstances) -> Option<f64> {
        let (process, optimum) = self.table.as_ref()?;
        Some(optimum.value(process, circumstances))
    }

    /// What to do next.
    ///
    /// # Errors
    /// As [`LayerDispatch::choose`].
    pub fn choose(
        &mut self,
        circumstances: &Circumstances,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Choice, TooCoupled> {
        let Some((process, optimum)) = &self.table else {
            return self.dispatch.choose(circumstances, watch);
        };
        let now = &circumstances.now;
        Ok(optimum.choice(process, circumstances, |node| Slot {
            node,
            earliest: now.clone(),
            latest: None,
        }))
    }
}
