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
    awaited: Option<Arc<AtomicBool>>,
}

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
    pub(crate) fn follow(&self, is_done: Arc<AtomicBool>) {
        self.lock().awaited = Some(is_done);
    }

    /// It is not to ring.
    pub(crate) fn silence(&self) {
        self.lock().awaited = None;
    }

    /// Whether something is waited for, and has not been heard.
    pub(crate) fn is_awaited(&self) -> bool {
        self.lock().awaited.is_some()
    }

    /// Whether it rings; it is heard once.
    pub(crate) fn is_heard(&self) -> bool {
        let mut state = self.lock();
        let rings = state.rings();
        if rings {
            state.awaited = None;
        }
        rings
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
        awaited.is_some_and(|is_done| is_done.load(Ordering::SeqCst))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::Bell;

    #[test]
    fn it_rings_once_and_only_for_what_is_awaited() {
        let bell = Bell::default();
        let (clapper, is_done) = bell.clapper();
        assert!(!bell.is_awaited() && !bell.is_heard());
        bell.follow(is_done);
        assert!(bell.is_awaited() && !bell.is_heard());
        // Something that nobody waits for any more.
        drop(bell.clapper());
        bell.wait(Duration::from_millis(1));
        assert!(!bell.is_heard());
        // However its thread ends.
        let thread = std::thread::spawn(move || {
            let _rings = clapper;
        });
        thread.join().expect("it ends");
        bell.wait(Duration::from_secs(60));
        assert!(bell.is_heard() && !bell.is_heard() && !bell.is_awaited());
        let (clapper, is_done) = bell.clapper();
        drop(clapper);
        bell.follow(is_done);
        bell.silence();
        assert!(!bell.is_heard());
    }
}
