//! The constants of the search, each with the reason for its value, and techniques that can be
//! switched off to measure their contribution.
//!
//! None of them affects whether a plan is valid, or whether a plan exists. They determine the time
//! to an answer.

use std::fmt;
use std::str::FromStr;

/// A technique of the search that can be switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Technique {
    /// Removal of actions that are irrelevant to the goal.
    Relevance,
    /// Facts and numeric conditions that only timed initials change restrict the times of
    /// happenings, instead of being changed by choices of the search.
    Calendars,
    /// If numbers depend on times, the linear program of a state contains only the happenings in
    /// its demands, and begins at the times found for the state before.
    Projection,
    /// Of interchangeable objects, only one is tried.
    Symmetry,
    /// Preference for the steps of the relaxed plan (preferred operators).
    PreferredOperators,
    /// Temporal `h²`: dead ends by pairs of facts.
    DeadEnds,
    /// Forward and backward `h²` in incomplete searches: spurious actions and dead ends.
    MutexPairs,
    /// A search by the novelty of successors (BFWS(f₅)).
    Width,
    /// Searches that count landmarks.
    Landmarks,
    /// A search that achieves the conjuncts of the goal one after the other.
    Serialization,
    /// Searches in chronological order.
    Chronological,
    /// In the relaxed problem, a fact that holds only while an envelope runs does not support
    /// actions that need it for longer.
    Envelopes,
    /// Some searches start an envelope only together with one action that needs it, as a macro-operator.
    Macros,
    /// Permanent mutual exclusions with a running action.
    Exclusions,
    /// If an end would break the over-all condition of another running action, the network orders
    /// it after that action's end from the moment at which both are running.
    Nesting,
    /// Relaxed plans account for consumables, and searches save them.
    Consumables,
    /// Relaxed plans replenish the resources that they use up.
    Reservoirs,
    /// Relaxed plans that replenish reservoirs account for continuous changes, and for changes that
    /// depend on the duration. A continuous change of a fluent that affects one action at a time
    /// counts as a change at the end.
    ContinuousDrains,
    /// The best plan's actions are tried in other orders.
    Rescheduling,
    /// A search for better orders of the best plan's actions that proves when there is none.
    Scheduling,
    /// Parts of the best plan are removed and replaced.
    Repair,
    /// Plans that are a little worse than the best one may be improved.
    Leniency,
    /// If only a first plan is requested, better plans near it are searched for, for a share of its
    /// work.
    Cleanup,
    /// With deadlines, plans without the last ones are improved until one is in time.
    Detours,
    /// On a plateau, the newest and the oldest preferred successors alternate.
    Alternation,
}

impl Technique {
    /// All techniques with their names.
    pub const ALL: &'static [(Self, &'static str)] = &[
        (Self::Relevance, "relevance"),
        (Self::Calendars, "calendars"),
        (Self::Projection, "projection"),
        (Self::Symmetry, "symmetry"),
        (Self::PreferredOperators, "preferred-operators"),
        (Self::DeadEnds, "dead-ends"),
        (Self::MutexPairs, "mutex-pairs"),
        (Self::Width, "width"),
        (Self::Landmarks, "landmarks"),
        (Self::Serialization, "serialization"),
        (Self::Chronological, "chronological"),
        (Self::Envelopes, "envelopes"),
        (Self::Macros, "macros"),
        (Self::Exclusions, "exclusions"),
        (Self::Nesting, "nesting"),
        (Self::Consumables, "consumables"),
        (Self::Reservoirs, "reservoirs"),
        (Self::ContinuousDrains, "continuous-drains"),
        (Self::Rescheduling, "rescheduling"),
        (Self::Scheduling, "scheduling"),
        (Self::Repair, "repair"),
        (Self::Leniency, "leniency"),
        (Self::Cleanup, "cleanup"),
        (Self::Detours, "detours"),
        (Self::Alternation, "alternation"),
    ];
}

/// A search of the portfolio.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Member {
    /// Actions are compressed unless they are envelopes.
    Compressing,
    /// Actions are compressed unless they are envelopes or hold a resource.
    CompressingSafe,
    /// As [`Compressing`](Self::Compressing), with resources replenished in estimates.
    Replenishing,
    /// In chronological order.
    Chronological,
    /// In chronological order, with consumables saved.
    Saving,
    /// Novelty of successors decides, and few states are estimated (BFWS(f₅)).
    Width,
    /// The number of remaining landmarks decides first, and then the estimate.
    Landmarks,
    /// Novelty of successors decides, among those with the same number of remaining landmarks
    /// (BFWS(f₅)).
    LandmarkWidth,
    /// The conjuncts of the goal are achieved one after the other.
    Serializing,
    /// As [`Serializing`](Self::Serializing), with higher costs of steps that must wait for an
    /// object or a window.
    Spreading,
    /// A complete search.
    Complete,
}

impl Member {
    /// All searches with their names.
    pub const ALL: &'static [(Self, &'static str)] = &[
        (Self::Compressing, "compressing"),
        (Self::CompressingSafe, "compressing-safe"),
        (Self::Replenishing, "replenishing"),
        (Self::Chronological, "chronological"),
        (Self::Saving, "saving"),
        (Self::Width, "width"),
        (Self::Landmarks, "landmarks"),
        (Self::LandmarkWidth, "landmark-width"),
        (Self::Serializing, "serializing"),
        (Self::Spreading, "spreading"),
        (Self::Complete, "complete"),
    ];
}

/// An error in a tuning setting.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TuningError {
    /// There is no constant, technique or search of that name.
    #[error("unknown setting `{name}`; choose one of {}", .known.join(", "))]
    Unknown {
        /// The requested name.
        name: String,
        /// The existing names.
        known: Vec<&'static str>,
    },
    /// The value is not a number that the constant can have.
    #[error("`{name}` takes a whole number, not `{value}`")]
    Value {
        /// The constant.
        name: &'static str,
        /// The value that was given.
        value: String,
    },
}

impl fmt::Display for Technique {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(technique, _)| technique == self);
        f.write_str(name.map_or("", |(_, name)| name))
    }
}

impl FromStr for Technique {
    type Err = TuningError;

    fn from_str(name: &str) -> Result<Self, TuningError> {
        by_name(Self::ALL, name)
    }
}

impl FromStr for Member {
    type Err = TuningError;

    fn from_str(name: &str) -> Result<Self, TuningError> {
        by_name(Self::ALL, name)
    }
}

fn by_name<T: Copy>(all: &[(T, &'static str)], name: &str) -> Result<T, TuningError> {
    let found = all.iter().find(|(_, known)| *known == name);
    found
        .map(|found| found.0)
        .ok_or_else(|| TuningError::Unknown {
            name: name.to_owned(),
            known: all.iter().map(|(_, known)| *known).collect(),
        })
}

/// Declares the constants once: fields, defaults, and a setter by name.
macro_rules! constants {
    ($($(#[$doc:meta])* $name:ident: $type:ty = $value:expr;)*) => {
        /// The constants of the search, and the techniques that are switched off.
        #[derive(Clone, Debug, PartialEq)]
        #[non_exhaustive]
        pub struct Tuning {
            /// The techniques that are switched off.
            pub without: Vec<Technique>,
            /// The only search, if the portfolio is restricted to one. It is run even if the
            /// problem gives no reason for it.
            pub only: Option<Member>,
            $($(#[$doc])* pub $name: $type,)*
        }

        impl Default for Tuning {
            fn default() -> Self {
                Self { without: Vec::new(), only: None, $($name: $value,)* }
            }
        }

        impl Tuning {
            /// The names of the constants.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),*];

            /// Sets the constant of that name.
            ///
            /// # Errors
            /// If there is no such constant, or the value does not fit.
            pub fn set(&mut self, name: &str, value: &str) -> Result<(), TuningError> {
                $(if name == stringify!($name) {
                    self.$name = value.parse().map_err(|_| TuningError::Value {
                        name: stringify!($name),
                        value: value.to_owned(),
                    })?;
                    return Ok(());
                })*
                Err(TuningError::Unknown {
                    name: name.to_owned(),
                    known: Self::NAMES.to_vec(),
                })
            }
        }
    };
}

constants! {
    /// Number of states per incomplete search in the first round of the portfolio; each round has
    /// twice as many. Not measured: most benchmark instances are solved within it, so that easy
    /// problems need one search only.
    first_round: u64 = 20_000;
    /// As `first_round`, if searches that replenish reservoirs take turns with others. Not
    /// measured; less, as only one of the two kinds usually has a chance.
    first_round_with_reservoirs: u64 = 2_048;
    /// As `first_round`, if each state needs a linear program. Less, as the estimates assume that
    /// tests which depend on times hold, so that one search alone often never approaches the goal.
    first_round_symbolic: u64 = 32;
    /// As `first_round`, if chronological searches take turns with others. Measured together with
    /// `patience`, on the domains with required concurrency, from 256 to 4,096: with less, problems
    /// that only one of the searches can solve wait less for it, and the total changes little.
    first_round_with_concurrency: u64 = 1_024;
    /// Maximum work of a first round in operators of estimates, so that a large problem, each state
    /// of which takes long, does not wait for one search. Measured on parking, 18th of IPC 2014, with 25,215 actions: BFWS(f₅) finds a
    /// plan after 17 states, but had no turn within 20 s while the first round was limited by
    /// states alone.
    first_round_work: u64 = 20_000_000;
    /// As `first_round_work`, if there are reservoirs. Less, as the searches that serialize the
    /// goal come after the first one: a farm with 21,392 actions takes 20 ms for each state.
    first_round_work_with_reservoirs: u64 = 2_500_000;
    /// A search keeps its turn as long as it finds a better estimate within this number of states.
    /// From machine shop (all instances take one descent of 600 to 1,600 states): with 64, the
    /// largest ones lose their turn on the way. A search that does not compress is also limited by
    /// `first_round_work`: in turn and open, with up to 18,490 actions, a chronological search
    /// would take all the time.
    patience: u64 = 128;
    /// Work without a plan, about a second, after which plans without the last deadlines are
    /// improved until one is in time. The next such detour begins after four times as much. With
    /// half of it, first plans of two of the problems of strangers that other searches find in
    /// about a second needed up to three.
    detour_after: u64 = 1_000_000_000;
    /// Number of states of an incomplete search for each one of the complete search. Not measured;
    /// the complete search seldom finds a first plan, but is needed for proofs.
    incomplete_share: u64 = 8;
    /// Share of a round for the search that serializes the goal and spreads work, relative to other
    /// searches before the first plan. Of the searches alone, it solves most generated problems
    /// with windows and reservoirs first. Not measured otherwise.
    serialization_share: u64 = 4;
    /// Number of states per search for better plans in its first round. Not measured.
    improving_round: u64 = 4_096;
    /// Time of the search near the best plan for each unit of time of another search. It finds most
    /// of the better plans, but only the others prove that there is none. With 8 instead of 2,
    /// makespans after 8 s of processor time are equal or better on 7 of 8 instances tried.
    refining_share: u64 = 8;
    /// Work, in operators of estimates (about a fifth of a second), before which the search near
    /// the best plan has the smaller share: for small problems, the other searches prove by then
    /// that there is no better plan.
    refining_share_after: u64 = 2_000_000;
    /// As `refining_share`, before that work, and when the search has found nothing better for
    /// long: the plans and proofs of the other searches are then worth more. Not measured.
    refining_share_later: u64 = 2;
    /// Number of turns without a better plan after which `refining_share_later` applies. Not
    /// measured; small problems reach it within a second.
    refining_patience: u64 = 500;
    /// Work of each strand between two exchanges, in operators of estimates: 10 to 100
    /// milliseconds. With ten times as much, plans of one strand reach the other one too late:
    /// after 15 s on two threads, plans were better on 8 and worse on 8 of 25 instances than after
    /// 15 s of one. With this value, better on all of nine tried in twice the processor time; with
    /// 5 million, on seven of nine, and worse on one.
    leg: u64 = 2_000_000;
    /// As `leg`, at the beginning; the length then doubles. About a millisecond.
    first_leg: u64 = 200_000;
    /// Work of the first search, and again on better plans, some 20 ms to 50 ms, after which
    /// further strands are started. Small problems are finished by then, and need no thread. Not
    /// measured.
    second_strand_after: u64 = 4_000_000;
    /// Approximate maximum number of actions removed from a plan and replaced. With 2 and with 8,
    /// the makespan is worse on two and one of four instances tried, and better on none and two.
    most_removed: usize = 4;
    /// Number of states that a repair estimates, plus some for each removed action. With 5 and 1,
    /// makespans are worse on three of eight instances tried, and better on one.
    repair_states: u64 = 10;
    /// Number of additional states per removed action.
    repair_states_per_action: u64 = 3;
    /// Work on repairs for each unit of work on other orders. Not measured separately; about one in
    /// a thousand new orders of the same actions improves a plan.
    repair_share: u64 = 16;
    /// Work on repairs and other orders for each unit of work on constraint-based scheduling. Not
    /// measured separately.
    scheduling_share: u64 = 8;
    /// Work of constraint-based scheduling in one turn. Not measured; some 25 milliseconds.
    scheduling_work: u64 = 1_000_000;
    /// Work of constraint-based scheduling on a new plan, and after it found an improvement,
    /// regardless of its share; twice the work of the last improvement, if that is more. On the
    /// first job shop, 964 after 8 s; an earlier version, which was limited to its share, reached
    /// 1036 after 15 s.
    scheduling_burst: u64 = 4_000_000;
    /// For a new plan, number of turns without a better one before `scheduling_burst` applies. Not
    /// measured.
    scheduling_after: u64 = 16;
    /// If there are many more actions than those of the plan, number of turns without a better plan
    /// before scheduling begins. Of 16, 100 and 400: with 16, the sampled quantum circuit reached
    /// 54.0 after 10 s, with 100 it reached 37.0; elevators 2011, 1, reached 672 and 648, and with
    /// 400 it reached 648.
    scheduling_late: u64 = 100;
    /// Denominator of the relative loss of a plan that the refiner may continue from occasionally.
    /// With 24, makespans are a little better than with 64.
    leniency: u32 = 24;
    /// Number of turns without a better plan after which the refiner returns to the best one. Not
    /// measured.
    return_after: u64 = 200;

    /// Number of turns of the preferred successors after a better estimate. The value of LAMA
    /// (Richter & Westphal, JAIR 2010); not measured here.
    boost: i64 = 1_000;
    /// Number of states without a better estimate after which a search alternates between the
    /// newest and the oldest preferred successor of a rank. With 4 or less, the third of the
    /// delivery problems takes 15,000 to 25,000 states to its first plan, with 8 to 128 about 500,
    /// as without it. The 15th of depots takes 11,000 states with 32, and more than 27,000 without
    /// it. (Satellite 7 of 2014 takes 1,400 with 4, and has none after 30,000 with 32.)
    alternation_after: u64 = 32;
    /// In the complete search, one turn in this many expands the successor that has waited longest.
    /// Not measured; any number prevents starvation in infinite state spaces.
    exploration_interval: u64 = 32;
    /// Number of states that differ only in times and are kept by compressing searches. Not
    /// measured.
    compressed_variants: usize = 4;
    /// As `compressed_variants`, in chronological searches. Not measured; more, as they decide
    /// times.
    chronological_variants: usize = 32;
    /// Maximum number of unsettled happenings of a state in a chronological search, which stores a
    /// distance for each pair of them. Not measured; chosen for memory (74 kB for each state).
    most_unsettled: u64 = 96;

    /// Number of states after which temporal `h²` checks whether the root is a dead end. Not
    /// measured; problems with an easy plan are solved before.
    root_check_after: u64 = 64;
    /// Number of states after which temporal `h²` checks the expanded states. Not measured; as
    /// above.
    dead_end_checks_after: u64 = 512;
    /// Number of states after which the share of time for these checks doubles; after twice as many
    /// it is three times as large, and so on. Not measured; the longer a search takes, the likelier
    /// it is lost in dead ends.
    dead_end_patience: u64 = 4_096;
    /// Maximum number of atoms for temporal `h²`: its table takes quadratic memory, and each check
    /// more than quadratic time. Not measured.
    most_pair_atoms: usize = 400;
    /// Maximum number of pairs looked up in one round of temporal `h²`. Not measured; about 10 ms.
    most_pair_lookups: usize = 2_000_000;

    /// Maximum number of facts for the novelty of pairs; beyond it, only single facts make a state
    /// novel. One bit for each pair and each worth is kept. Not measured; chosen for memory (64 kB
    /// for each worth).
    most_facts_for_novel_pairs: usize = 1_024;
    /// Maximum number of distinct worths of states in the search by novelty. Not measured; chosen
    /// for memory.
    most_worths: usize = 4_096;

    /// Work limit for mutex pairs, in words of tables (20 to 40 ms). With 200 million, instances 6 and 10 of turn and open take
    /// 0.06 and 0.33 s instead of 0.04 and 0.22 s, and no other answer differs among those tried. Floor-tile needs less than 5 million.
    most_mutex_pair_work: u64 = 20_000_000;
    /// Work limit for landmarks, in entries of label sets, about half a second. Not measured; a
    /// search that finds none until then skips its turns.
    most_landmark_work: u64 = 100_000_000;

    /// Cost of a step of mean cost, in addition to the one that every step counts for ("plus one";
    /// Richter & Westphal, JAIR 2010). Not measured; small, as each cost is a bucket of the queue.
    mean_step_cost: u32 = 8;
    /// Maximum cost of a step. Not measured; as above.
    most_step_cost: u32 = 500;

    /// Maximum number of comparisons of actions to find interchangeable objects. Not measured;
    /// about 100 ms.
    most_symmetry_comparisons: usize = 300_000;
}

impl Tuning {
    /// Returns `true` if the technique is in use.
    pub fn uses(&self, technique: Technique) -> bool {
        !self.without.contains(&technique)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_are_set_by_name() {
        let mut tuning = Tuning::default();
        tuning.set("boost", "7").unwrap();
        assert_eq!(tuning.boost, 7);
        let message = tuning.set("boost", "seven").unwrap_err().to_string();
        assert_eq!(message, "`boost` takes a whole number, not `seven`");
        let message = tuning.set("boots", "7").unwrap_err().to_string();
        assert!(message.starts_with("unknown setting `boots`; choose one of first_round, "));
    }

    #[test]
    fn techniques_and_searches_are_set_by_name() {
        for (technique, name) in Technique::ALL {
            assert_eq!(name.parse(), Ok(*technique));
            assert_eq!(technique.to_string(), *name);
        }
        for (member, name) in Member::ALL {
            assert_eq!(name.parse(), Ok(*member));
        }
        assert!("envelope".parse::<Technique>().is_err());
    }
}
