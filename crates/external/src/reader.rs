//! Reading thread of a run: reads output and plan files, and enforces the limits.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use super::channel::PlanQueue;
use super::output_parser::{FoundPhrases, OutputParser};
use super::registry::Planner;
use super::supervise::{Ending, Stream, Watcher};
use super::workspace::Workspace;

/// The state shared by the reading and the validating thread.
#[derive(Default)]
pub(super) struct Shared {
    pub(super) mailbox: PlanQueue,
    /// Set by the validating thread, to end the run.
    pub(super) stop: AtomicBool,
    /// The last measured memory use, in bytes.
    pub(super) memory: AtomicU64,
}

/// State of the reading thread.
pub(super) struct Reader<'s> {
    output: OutputParser,
    error: OutputParser,
    workspace: Workspace,
    shared: &'s Shared,
    is_even: bool,
}

impl<'s> Reader<'s> {
    pub(super) fn new(planner: &Planner, workspace: Workspace, shared: &'s Shared) -> Self {
        Self {
            output: OutputParser::new(planner.exit_phrases),
            error: OutputParser::new(planner.exit_phrases),
            workspace,
            shared,
            is_even: false,
        }
    }

    /// Returns the number of bytes read.
    pub(super) fn printed_bytes(&self) -> u64 {
        self.output.bytes + self.error.bytes
    }

    /// Reads the rest after the end of the process.
    pub(super) fn finish(&mut self, ending: Option<Ending>) {
        let by_itself = matches!(ending, Some(Ending::Exited(_) | Ending::Signalled(_)));
        let mut put = |text| self.shared.mailbox.push(text);
        self.output.finish(by_itself, &mut put);
        self.error.finish(by_itself, &mut put);
        for text in self.workspace.new_plans(true) {
            self.shared.mailbox.push(text);
        }
        self.shared.mailbox.close();
    }

    /// Returns the known phrases in the output; the more informative one if both streams have one
    /// of a kind.
    pub(super) fn phrases(&self) -> FoundPhrases {
        let (output, error) = (&self.output.phrases, &self.error.phrases);
        let more = |output: &Option<String>, error: &Option<String>| {
            let said = output.iter().chain(error);
            said.max_by_key(|line| line.len()).cloned()
        };
        FoundPhrases {
            unsolvable: more(&output.unsolvable, &error.unsolvable),
            gave_up: more(&output.gave_up, &error.gave_up),
            unsupported: more(&output.unsupported, &error.unsupported),
            missing: more(&output.missing, &error.missing),
            out_of_memory: more(&output.out_of_memory, &error.out_of_memory),
        }
    }

    /// Returns the end of standard error, or of standard output if the former is empty.
    pub(super) fn excerpt(&self) -> String {
        let error = self.error.excerpt();
        if error.is_empty() {
            self.output.excerpt()
        } else {
            error
        }
    }
}

impl Watcher for Reader<'_> {
    fn printed(&mut self, stream: Stream, bytes: &[u8]) {
        let mut put = |text| self.shared.mailbox.push(text);
        match stream {
            Stream::Output => self.output.feed(bytes, &mut put),
            Stream::Error => self.error.feed(bytes, &mut put),
        }
    }

    fn tick(&mut self, memory: u64) {
        self.shared.memory.store(memory, Ordering::Relaxed);
        self.is_even = !self.is_even;
        if self.is_even {
            for text in self.workspace.new_plans(false) {
                self.shared.mailbox.push(text);
            }
        }
    }
}
