//! Cache of dispatchable forms.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{Dispatchable, UncertainNetwork};

use crate::window_propagation::{NetworkLimit, constraints_of_steps};

/// Number of networks that are kept; an executor uses a few.
const MAX_NETWORKS: usize = 8;

/// The dispatchable form of a network, or the conflict that shows that there is none.
pub(crate) type Form = Result<Arc<Dispatchable<Rational>>, Vec<NetworkLimit>>;

/// A network that was converted before.
#[derive(Clone)]
enum CachedForm {
    /// Its form, which contains the network.
    Controllable(Arc<Dispatchable<Rational>>),
    /// The network, and the conflict.
    NotControllable(Arc<UncertainNetwork>, Vec<NetworkLimit>),
}

/// Cache of the dispatchable forms of a plan's networks. Each form is computed once for all
/// executions of the plan.
///
/// Copies share the cache. Networks are compared in full, so cached forms do not change any result.
#[derive(Clone, Default)]
pub struct DispatchableCache(Arc<Mutex<Vec<CachedForm>>>);

impl CachedForm {
    fn network(&self) -> &UncertainNetwork {
        match self {
            Self::Controllable(form) => form.network(),
            Self::NotControllable(network, _) => network,
        }
    }

    fn form(&self) -> Form {
        match self {
            Self::Controllable(form) => Ok(Arc::clone(form)),
            Self::NotControllable(_, limits) => Err(limits.clone()),
        }
    }
}

impl DispatchableCache {
    /// Returns the form of a network.
    pub(crate) fn get_or_compute(&self, network: UncertainNetwork) -> Form {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let same = known()
            .iter()
            .find(|known| *known.network() == network)
            .cloned();
        if let Some(same) = same {
            return same.form();
        }
        let found = match network.into_executable() {
            Ok(form) => CachedForm::Controllable(Arc::new(form)),
            Err((network, conflict)) => CachedForm::NotControllable(
                Arc::new(network),
                constraints_of_steps(&conflict.steps),
            ),
        };
        let form = found.form();
        let mut known = known();
        if known.len() < MAX_NETWORKS {
            known.push(found);
        }
        form
    }
}

impl fmt::Debug for DispatchableCache {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Forms").finish_non_exhaustive()
    }
}
