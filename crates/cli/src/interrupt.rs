//! Ctrl-C and requests to terminate: a search ends with its best result, and a run ends in order.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elbowroom::num::work::Stop;

use crate::exit::Exit;
use elbowroom_executive::clock::Clock;

/// A second signal within this time counts as the same request: `timeout` sends two, to the program
/// and to its group.
const DEBOUNCE_TIME: Duration = Duration::from_millis(300);

/// A second signal is ignored for this time, while actions are cancelled and the world is stopped.
const SHUTDOWN_TIME: Duration = Duration::from_secs(5);

/// `true` if the program must cancel actions and stop a world before it ends.
static HAS_WORLD: AtomicBool = AtomicBool::new(false);

/// A request of the user to stop.
#[derive(Clone, Debug, Default)]
pub(crate) struct Interrupt(Stop);

impl Interrupt {
    /// Installs the handler: the first Ctrl-C (SIGINT, SIGTERM or SIGHUP) requests a stop, and a
    /// later one ends the program, see [`must_exit`]. A process has only one handler, so all calls
    /// return the same flag. Computations of this thread also end early.
    pub(crate) fn listen() -> Self {
        static INSTALLED: OnceLock<Interrupt> = OnceLock::new();
        let listened = INSTALLED.get_or_init(|| {
            let interrupt = Self::default();
            let flag = interrupt.clone();
            // If no handler can be installed, Ctrl-C ends the program as usual.
            let (mut count, mut first) = (0, None);
            let _ = ctrlc::set_handler(move || {
                count += 1;
                let since = first.get_or_insert_with(Clock::start).elapsed();
                if must_exit(count, since, HAS_WORLD.load(Ordering::SeqCst)) {
                    std::process::exit(Exit::Interrupted as i32);
                }
                flag.request();
            });
            interrupt
        });
        listened.0.install_for_thread();
        listened.clone()
    }

    /// The same, for a command that must cancel actions and stop a world before it ends.
    pub(crate) fn listen_with_world() -> Self {
        HAS_WORLD.store(true, Ordering::SeqCst);
        Self::listen()
    }

    /// Returns the stop request that the first Ctrl-C makes.
    pub(crate) fn stop(&self) -> &Stop {
        &self.0
    }

    /// Requests a stop, like the first Ctrl-C.
    pub(crate) fn request(&self) {
        self.0.request();
    }

    /// Returns `true` if Ctrl-C was pressed or a stop was requested in another way.
    pub(crate) fn is_requested(&self) -> bool {
        self.0.is_requested()
    }
}

/// Returns `true` if a signal ends the program at once. `number` counts signals, `since_first` is
/// the time since the first one. The third signal always ends it. The second one does unless it is
/// the same request or a world is being stopped.
fn must_exit(number: u32, since_first: Duration, has_world: bool) -> bool {
    let patience = if has_world {
        SHUTDOWN_TIME
    } else {
        DEBOUNCE_TIME
    };
    match number {
        0 | 1 => false,
        2 => since_first >= patience,
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use elbowroom::num::work::Stop;

    use super::{Interrupt, must_exit};

    #[test]
    fn third_signal_does_not_wait_for_the_world() {
        let after = Duration::from_millis;
        for (milliseconds, has_world, expected) in [
            (1, false, false),
            (400, false, true),
            (400, true, false),
            (5001, true, true),
        ] {
            let told = must_exit(2, after(milliseconds), has_world);
            assert_eq!(told, expected, "{milliseconds}, {has_world}");
            assert!(!must_exit(1, after(milliseconds), has_world));
            assert!(must_exit(3, after(milliseconds), has_world));
        }
    }

    #[test]
    fn repeated_listen_returns_the_same_interrupt() {
        let (one, other) = (Interrupt::listen(), Interrupt::listen());
        assert_eq!(one.0, other.0);
        assert_eq!(Stop::current(), Some(one.0));
    }
}
