//! Cache of dispatchable forms.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{Dispatchable, UncertainNetwork};

use crate::horizon::{NetworkLimit, grounds};

/// Number of networks that are kept; an executor uses a few.
const MOST: usize = 8;

/// The dispatchable form of a network, or the conflict that shows that there is none.
pub(crate) type Form = Result<Arc<Dispatchable<Rational>>, Vec<NetworkLimit>>;

/// A network that was converted before.
#[derive(Clone)]
enum Known {
    /// Its form, which contains the network.
    Controllable(Arc<Dispatchable<Rational>>),
    /// The network, and the conflict.
    Refused(Arc<UncertainNetwork>, Vec<NetworkLimit>),
}

/// Cache of the dispatchable forms of a plan's networks. Each form is computed once for all
/// executions of the plan.
///
/// Copies share the cache. Networks are compared in full, so cached forms do not change any result.
#[derive(Clone, Default)]
pub struct Forms(Arc<Mutex<Vec<Known>>>);

impl Known {
    fn network(&self) -> &UncertainNetwork {
        match self {
            Self::Controllable(form) => form.network(),
            Self::Refused(network, _) => network,
        }
    }

    fn form(&self) -> Form {
        match self {
            Self::Controllable(form) => Ok(Arc::clone(form)),
            Self::Refused(_, limits) => Err(limits.clone()),
        }
    }
}

impl Forms {
    /// Returns the form of a network.
    pub(crate) fn of(&self, network: UncertainNetwork) -> Form {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let same = known()
            .iter()
            .find(|known| *known.network() == network)
            .cloned();
        if let Some(same) = same {
            return same.form();
        }
        let found = match network.into_executable() {
            Ok(form) => Known::Controllable(Arc::new(form)),
            Err((network, conflict)) => Known::Refused(Arc::new(network), grounds(&conflict.steps)),
        };
        let form = found.form();
        let mut known = known();
        if known.len() < MOST {
            known.push(found);
        }
        form
    }
}

impl fmt::Debug for Forms {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Forms").finish_non_exhaustive()
    }
}
