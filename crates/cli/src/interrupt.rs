//! Ctrl-C, or a request to terminate, ends a search with the best result so far, and a run in
//! order.

use std::sync::OnceLock;

use elbowroom::num::work::Stop;

use crate::exit::Exit;

/// A request of the user to stop.
#[derive(Clone, Debug, Default)]
pub(crate) struct Interrupt(Stop);

impl Interrupt {
    /// From now on, the first Ctrl-C (SIGINT, SIGTERM or SIGHUP) asks to stop, and the second ends
    /// the program. A process has one handler of signals, so this is the same flag whenever it is
    /// asked for. Computations of this thread end early as well.
    pub(crate) fn listen() -> Self {
        static LISTENED: OnceLock<Interrupt> = OnceLock::new();
        let listened = LISTENED.get_or_init(|| {
            let interrupt = Self::default();
            let flag = interrupt.clone();
            // Where no handler can be installed, Ctrl-C ends the program, as it does anyway.
            let _ = ctrlc::set_handler(move || {
                if flag.is_requested() {
                    std::process::exit(Exit::Interrupted as i32);
                }
                flag.request();
            });
            interrupt
        });
        listened.0.obey();
        listened.clone()
    }

    /// Asks to stop, as the first Ctrl-C does.
    pub(crate) fn request(&self) {
        self.0.request();
    }

    /// Whether Ctrl-C was pressed, or a stop was asked for in another way.
    pub(crate) fn is_requested(&self) -> bool {
        self.0.is_requested()
    }
}

#[cfg(test)]
mod tests {
    use elbowroom::num::work::Stop;

    use super::Interrupt;

    #[test]
    fn whoever_listens_again_hears_the_same() {
        let (one, other) = (Interrupt::listen(), Interrupt::listen());
        assert_eq!(one.0, other.0);
        assert_eq!(Stop::of_this_thread(), Some(one.0));
    }
}
