//! Registry of the executors without time. To add an executor, write a file with its
//! [`UntimedExecutor`] and its [`ExecutorEntry`], and add a line to [`EXECUTORS`].

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use elbowroom_execution::executors;
use elbowroom_model::Task;
use elbowroom_probability::Likelihoods;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{
    LookaheadPolicy, NotTabulated, UntimedExecutor, adaptable, esterel, lookahead, published,
};

/// Registry entry of an executor: name, documentation and constructor.
#[derive(Clone, Copy)]
pub struct ExecutorEntry {
    /// Its name. An executor that also exists on a clock has the same name there
    /// ([`executors::EXECUTORS`]).
    pub name: &'static str,
    /// Summary, in one or two sentences.
    pub summary: &'static str,
    /// Its source.
    pub paper: &'static str,
    /// Constructor.
    pub(super) construct:
        fn(&ExecutorServices<'_>) -> Result<Box<dyn UntimedExecutor>, NotTabulated>,
}

/// Services for the construction of an executor.
pub struct ExecutorServices<'m> {
    /// The problem.
    pub task: Arc<Task>,
    /// Likelihoods of failures and spontaneous changes.
    pub likelihoods: Arc<Likelihoods>,
    /// The table of the sound world, computed at its first use.
    pub foresight: &'m dyn Fn() -> Result<LookaheadPolicy, NotTabulated>,
}

/// All executors, in the order of the results.
pub const EXECUTORS: &[ExecutorEntry] = &[
    esterel::REGISTERED,
    adaptable::REGISTERED,
    published::REGISTERED,
    lookahead::REGISTERED,
];

impl ExecutorServices<'_> {
    /// Returns the task and its likelihoods.
    pub(super) fn task_and_likelihoods(&self) -> (Arc<Task>, Arc<Likelihoods>) {
        (Arc::clone(&self.task), Arc::clone(&self.likelihoods))
    }
}

impl fmt::Debug for ExecutorEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Registered({})", self.name)
    }
}

/// Executor of the list. Names are sorted in the order of the list.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ExecutorName(usize);

impl ExecutorName {
    /// Returns its registry entry.
    pub fn entry(self) -> &'static ExecutorEntry {
        &EXECUTORS[self.0]
    }

    /// Returns its name.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// Creates the executor.
    ///
    /// # Errors
    /// It needs a table of the world, and there can be none.
    pub fn build(
        self,
        means: &ExecutorServices<'_>,
    ) -> Result<Box<dyn UntimedExecutor>, NotTabulated> {
        (self.entry().construct)(means)
    }
}

/// There is no executor of that name without a clock.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown executor `{name}`{clock}; choose one of {known}",
    clock = if *.needs_clock { " without a clock" } else { "" },
    known = EXECUTORS.iter().map(|known| known.name).collect::<Vec<_>>().join(", ")
)]
pub struct UnknownExecutor {
    /// The given name.
    pub name: String,
    /// `true` if there is such an executor on a clock.
    pub needs_clock: bool,
}

impl FromStr for ExecutorName {
    type Err = UnknownExecutor;

    fn from_str(name: &str) -> Result<Self, UnknownExecutor> {
        let found = EXECUTORS.iter().position(|known| known.name == name);
        found.map(Self).ok_or_else(|| UnknownExecutor {
            name: name.to_owned(),
            needs_clock: name.parse::<executors::ExecutorSpec>().is_ok(),
        })
    }
}

impl fmt::Debug for ExecutorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for ExecutorName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.name().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for ExecutorName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        name.parse().map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::{EXECUTORS, ExecutorName};

    #[test]
    fn names_round_trip_and_sort_in_list_order() {
        let names = EXECUTORS.iter().map(|known| known.name);
        let read: Vec<ExecutorName> = names.clone().map(|name| name.parse().unwrap()).collect();
        assert!(read.is_sorted());
        assert!(read.iter().map(|read| read.name()).eq(names));
    }

    #[test]
    fn timed_only_and_unknown_executors_are_distinguished() {
        let wrong = |name: &str| name.parse::<ExecutorName>().unwrap_err().to_string();
        assert!(wrong("guarded").contains("`guarded` without a clock"));
        assert!(wrong("gaurded").starts_with("unknown executor `gaurded`; choose one of"));
        assert!(wrong("guarded").ends_with("esterel, adaptable, as-published, lookahead"));
    }

    #[test]
    fn page_matches_the_list_of_executors() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../docs/research/perturbed-worlds.md"
        );
        let page = std::fs::read_to_string(path).unwrap();
        for known in EXECUTORS {
            let row = format!("| `{}` | {} |\n", known.name, known.summary);
            assert!(
                page.contains(&row),
                "docs/research/perturbed-worlds.md lacks\n{row}"
            );
        }
    }
}
