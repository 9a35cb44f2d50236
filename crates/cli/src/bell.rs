//! Rings when a plan that is made in another thread is there.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Between the thread that makes a plan and the run that goes on meanwhile. Clones are the same.
#[derive(Clone, Default)]
pub(crate) struct Bell(Arc<Inner>);

#[derive(Default)]
struct Inner {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// Whether what is waited for is done; `None` if nothing is.
    awaited: Option<(Arc<AtomicBool>, Ring)>,
    /// Whether nobody has waited for it yet.
    is_new: bool,
}

/// What it rings for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ring {
    /// A plan is there.
    PlanMade,
    /// A plan is ready.
    PlanReady,
}

/// So long it is waited for a plan to be ready before the world is asked again: most are by then, and
/// the run goes on without a detour.
const SOON: Duration = Duration::from_millis(2);

/// Rings when it is dropped, however its thread ends.
pub(crate) struct Clapper {
    is_done: Arc<AtomicBool>,
    bell: Bell,
}

impl Drop for Clapper {
    fn drop(&mut self) {
        self.is_done.store(true, Ordering::SeqCst);
        // Whoever looks holds the lock until it waits.
        drop(self.bell.lock());
        self.bell.0.changed.notify_all();
    }
}

impl Bell {
    fn lock(&self) -> MutexGuard<'_, State> {
        let state = self.0.state.lock();
        state.unwrap_or_else(PoisonError::into_inner)
    }

    /// What rings it, once it is [followed](Bell::follow).
    pub(crate) fn clapper(&self) -> (Clapper, Arc<AtomicBool>) {
        let is_done = Arc::new(AtomicBool::new(false));
        let clapper = Clapper {
            is_done: Arc::clone(&is_done),
            bell: self.clone(),
        };
        (clapper, is_done)
    }

    /// It is to ring when that is done, and for nothing else.
    pub(crate) fn follow(&self, is_done: Arc<AtomicBool>, ring: Ring) {
        let mut state = self.lock();
        state.awaited = Some((is_done, ring));
        state.is_new = true;
    }

    /// It is not to ring.
    pub(crate) fn silence(&self) {
        self.lock().awaited = None;
    }

    /// Whether something is waited for, and has not been heard.
    pub(crate) fn is_awaited(&self) -> bool {
        self.lock().awaited.is_some()
    }

    /// What it rings for, if it does; it is heard once.
    pub(crate) fn heard(&self) -> Option<Ring> {
        let mut state = self.lock();
        if !state.rings() {
            return None;
        }
        state.awaited.take().map(|(_, ring)| ring)
    }

    /// The same for a plan that is made ready, for which it is waited a moment, once.
    pub(crate) fn heard_soon(&self) -> Option<Ring> {
        let mut state = self.lock();
        let is_new = std::mem::take(&mut state.is_new);
        let is_readying = matches!(state.awaited, Some((_, Ring::PlanReady)));
        drop(state);
        if !is_new || !is_readying {
            return None;
        }
        self.wait(SOON);
        self.heard()
    }

    /// Waits until it rings, but not for longer.
    pub(crate) fn wait(&self, at_most: Duration) {
        let state = self.lock();
        let waits = |state: &mut State| !state.rings();
        let waited = self.0.changed.wait_timeout_while(state, at_most, waits);
        drop(waited);
    }
}

impl State {
    fn rings(&self) -> bool {
        let awaited = self.awaited.as_ref();
        awaited.is_some_and(|(is_done, _)| is_done.load(Ordering::SeqCst))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Bell, Ring};

    #[test]
    fn it_rings_once_and_only_for_what_is_awaited() {
        let bell = Bell::default();
        let (clapper, is_done) = bell.clapper();
        assert!(!bell.is_awaited() && bell.heard().is_none());
        bell.follow(is_done, Ring::PlanMade);
        assert!(bell.is_awaited() && bell.heard().is_none());
        // Something that nobody waits for any more.
        drop(bell.clapper());
        bell.wait(Duration::from_millis(1));
        assert!(bell.heard().is_none() && bell.heard_soon().is_none());
        // However its thread ends.
        let thread = std::thread::spawn(move || {
            let _rings = clapper;
        });
        thread.join().expect("it ends");
        bell.wait(Duration::from_secs(60));
        assert_eq!(bell.heard(), Some(Ring::PlanMade));
        assert!(bell.heard().is_none() && !bell.is_awaited());
        let (clapper, is_done) = bell.clapper();
        drop(clapper);
        bell.follow(is_done, Ring::PlanMade);
        bell.silence();
        assert!(bell.heard().is_none());
    }

    #[test]
    fn a_plan_that_is_ready_soon_is_waited_for_a_moment() {
        let bell = Bell::default();
        let (clapper, is_done) = bell.clapper();
        bell.follow(is_done, Ring::PlanReady);
        // Not yet; and then it is not waited for any more.
        assert!(bell.heard_soon().is_none() && bell.is_awaited());
        drop(clapper);
        assert!(bell.heard_soon().is_none());
        assert_eq!(bell.heard(), Some(Ring::PlanReady));
        let (clapper, is_done) = bell.clapper();
        bell.follow(is_done, Ring::PlanReady);
        drop(clapper);
        assert_eq!(bell.heard_soon(), Some(Ring::PlanReady));
    }
}
