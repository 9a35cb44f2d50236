//! The constants of the search, in one place, each with what speaks for its value; and what can be
//! switched off, to find out what it is worth.
//!
//! None of them decides whether a plan is valid, or whether none exists. They decide how soon an
//! answer comes.

use std::fmt;
use std::str::FromStr;

/// A technique of the search that can be switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Technique {
    /// Actions that cannot matter to the goal are left out.
    Relevance,
    /// Facts that only timed initials change restrict the times of happenings, instead of being
    /// changed by choices of the search.
    Calendars,
    /// If numbers depend on times, the linear program of a state is about the happenings only that its
    /// demands are about, and begins at times that were found for the state before.
    Projection,
    /// Of objects that can change places, one is tried.
    Symmetry,
    /// A preference for the steps of the relaxed plan (preferred operators).
    PreferredOperators,
    /// Temporal `h²`: dead ends by pairs of facts.
    DeadEnds,
    /// Forward and backward `h²` in incomplete searches: spurious actions and dead ends.
    MutexPairs,
    /// A search in which new states are expanded first (BFWS(f₂)).
    Novelty,
    /// A search for new successors (BFWS(f₅)).
    Width,
    /// Searches that count landmarks.
    Landmarks,
    /// Searches in the order of time.
    Chronological,
    /// In the relaxed problem a fact that holds only while an envelope runs does not serve who
    /// needs it for longer.
    Envelopes,
    /// Some searches start an envelope only together with one action that needs it, as a macro-operator.
    Macros,
    /// Mutual exclusions with an action under way that last for ever.
    Exclusions,
    /// An end that would break the over-all condition of an action under way waits for it in the
    /// network, from the moment at which both are under way.
    Nesting,
    /// Relaxed plans draw on what is never filled up, and searches save it.
    Consumables,
    /// Relaxed plans fill up what they use up.
    Reservoirs,
    /// Relaxed plans that fill up reservoirs count continuous changes, and those that depend on the duration.
    /// A continuous change of a fluent that concerns one action at a time counts as a change at the end.
    ContinuousDrains,
    /// The best plan's actions are tried in other orders.
    Rescheduling,
    /// A search for better orders of the best plan's actions that proves when there is none.
    Scheduling,
    /// Parts of the best plan are taken out and done otherwise.
    Repair,
    /// Plans that are a little worse than the best one are gone on from.
    Leniency,
    /// If only a first plan is asked for, better ones are looked for near it, for a share of its work.
    Cleanup,
    /// On a plateau, the newest and the oldest preferred successors take turns.
    Alternation,
}

impl Technique {
    /// All there are, with the names by which they are told.
    pub const ALL: &'static [(Self, &'static str)] = &[
        (Self::Relevance, "relevance"),
        (Self::Calendars, "calendars"),
        (Self::Projection, "projection"),
        (Self::Symmetry, "symmetry"),
        (Self::PreferredOperators, "preferred-operators"),
        (Self::DeadEnds, "dead-ends"),
        (Self::MutexPairs, "mutex-pairs"),
        (Self::Novelty, "novelty"),
        (Self::Width, "width"),
        (Self::Landmarks, "landmarks"),
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
        (Self::Alternation, "alternation"),
    ];
}

/// A search of the portfolio.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Member {
    /// Actions are compressed unless they are envelopes.
    Compressing,
    /// Actions are compressed that are no envelopes and hold no resource.
    CompressingSafe,
    /// The first one, filling up what is used up.
    Replenishing,
    /// In the order of time.
    Chronological,
    /// In the order of time, saving what is never filled up.
    Saving,
    /// Novelty decides among states of the same estimate (BFWS(f₂)).
    Novelty,
    /// Successors are new or not, and hardly any state is estimated (BFWS(f₅)).
    Width,
    /// The landmarks that are left come first, and then the estimate.
    Landmarks,
    /// Successors are new or not, among those with as many landmarks left (BFWS(f₅)).
    LandmarkWidth,
    /// Loses nothing.
    Complete,
}

impl Member {
    /// All there are, with the names by which they are told.
    pub const ALL: &'static [(Self, &'static str)] = &[
        (Self::Compressing, "compressing"),
        (Self::CompressingSafe, "compressing-safe"),
        (Self::Replenishing, "replenishing"),
        (Self::Chronological, "chronological"),
        (Self::Saving, "saving"),
        (Self::Novelty, "novelty"),
        (Self::Width, "width"),
        (Self::Landmarks, "landmarks"),
        (Self::LandmarkWidth, "landmark-width"),
        (Self::Complete, "complete"),
    ];
}

/// An error in a tuning setting.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TuningError {
    /// There is no constant, technique or search of that name.
    #[error("there is no `{name}`; choose one of {}", .known.join(", "))]
    Unknown {
        /// The name that was asked for.
        name: String,
        /// The names that exist.
        known: Vec<&'static str>,
    },
    /// The value is no number that the constant can take.
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
        /// The constants of the search, and what is switched off. See the module.
        #[derive(Clone, Debug, PartialEq)]
        #[non_exhaustive]
        pub struct Tuning {
            /// The techniques that are switched off.
            pub without: Vec<Technique>,
            /// The only search, if there is to be but one. A search that the problem gives no
            /// reason for is run as well.
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
            /// When there is none, or the value does not fit.
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
    /// How many states each incomplete search looks at in the first round of the portfolio; each
    /// round has twice as many. Not measured: most benchmark instances are solved within it, so
    /// that easy problems pay for one search only.
    first_round: u64 = 20_000;
    /// The same where searches that fill up reservoirs take turns with others. Not measured; less,
    /// as only one of the two kinds usually has a chance.
    first_round_with_reservoirs: u64 = 2_048;
    /// The same where each state is a linear program. Less, as their estimates take for granted what times
    /// decide, so that one search alone often never comes near the goal.
    first_round_symbolic: u64 = 32;
    /// The same where chronological searches take turns with others. Measured together with
    /// `patience`, on the domains with required concurrency, from 256 to 4,096: with less, problems
    /// that one search alone can solve wait less for it, and the sum of all changes little.
    first_round_with_concurrency: u64 = 1_024;
    /// The most operators of estimates that a first round comes to, so that a large problem, each
    /// state of which takes long, does not wait for one search; not where there are reservoirs: with
    /// it, the 34th of rovers with numbers (17,410 actions) has no plan within 30 s, without it one
    /// after 16 s. Measured on parking, 18th of IPC
    /// 2014, with 25,215 actions: BFWS(f₅) finds a plan after 17 states, but had no turn within 20
    /// s while the first round went by states alone.
    first_round_work: u64 = 20_000_000;
    /// A search keeps its turn as long as it found a better estimate within so many states. From
    /// machine shop (all instances take one descent of 600 to 1,600 states): with 64, the largest
    /// ones lose their turn on the way. In a search that does not compress this ends with
    /// `first_round_work`: in turn and open, with up to 18,490 actions, a chronological search would take
    /// all the time.
    patience: u64 = 128;
    /// How many states an incomplete search looks at for each one of the complete search. Not
    /// measured; the complete search seldom finds a first plan, but is needed for proofs.
    incomplete_share: u64 = 8;
    /// Share of a round for BFWS(f₂) without refilling, where there are reservoirs, in relation to other searches. From a
    /// farm with windows and fuel: no plan in 40 s of processor time with 1, one after 284,000 states with 2, after
    /// 176,000 with 4. It finds that plan after 77,000 states of its own.
    novelty_share: u64 = 4;
    /// How many states each search for better plans looks at in its first round. Not measured.
    improving_round: u64 = 4_096;
    /// How long the search near the best plan takes for each unit of time of another search. It
    /// finds most of the better plans, but only the others prove that there is none. With 8 instead
    /// of 2, makespans after 8 s of processor time are equal or better on 7 of 8 instances tried.
    refining_share: u64 = 8;
    /// Before it has come to so many operators of estimates, about a fifth of a second, it has the
    /// smaller share: of small problems, the other searches prove by then that there is no better plan.
    refining_share_after: u64 = 2_000_000;
    /// The same before that, and where it has found nothing better for long: what others find then, or
    /// prove, is worth more. Not measured.
    refining_share_later: u64 = 2;
    /// After so many turns without a better plan that is so. Not measured; small problems come to it
    /// within a second.
    refining_patience: u64 = 500;
    /// How much work each strand does between two exchanges, in operators of estimates: 10 to 100
    /// milliseconds. With ten times as much, what one strand finds is news to the other one too late: after
    /// 15 s on two threads, plans were better on 8 and worse on 8 of 25 instances than after 15 s of one.
    /// With this, better on all of nine tried
    /// in twice the processor time; with 5 million, on seven of nine, and worse on one.
    leg: u64 = 2_000_000;
    /// The same at the beginning; each time as much as so far. About a millisecond.
    first_leg: u64 = 200_000;
    /// After so much work of the first search, and again on better plans, some 20 ms to 50 ms, there are other
    /// strands beside it: small problems are done by then, and do not pay for a thread. Not measured.
    second_strand_after: u64 = 4_000_000;
    /// How many actions, about, are taken out of a plan at most, to be done otherwise. With 2 and with
    /// 8, the makespan is worse on two and one of four instances tried, and better on none and two.
    most_removed: usize = 4;
    /// How many states a repair estimates: so many, and some more for each action that was taken
    /// out. With 5 and 1, makespans are worse on three of eight instances tried, and better on one.
    repair_states: u64 = 10;
    /// How many more.
    repair_states_per_action: u64 = 3;
    /// How much work goes into repairs for each unit of work on other orders. Not measured by itself;
    /// of a thousand new orders of the same actions, about one makes a plan better.
    repair_share: u64 = 16;
    /// How much work goes into repairs and other orders for each unit of work on better orders by
    /// constraints. Not measured by itself.
    scheduling_share: u64 = 8;
    /// How much work that does in one turn. Not measured; some 25 milliseconds.
    scheduling_work: u64 = 1_000_000;
    /// How much work it does for a new plan, and after it found something, whatever its share; twice as long as
    /// it took to find that, if that is more. On the first job shop, 964 after 8 s; an earlier version, which
    /// had no more than its share, came to 1036 after 15 s.
    scheduling_burst: u64 = 4_000_000;
    /// For a new plan, that is so after so many turns without a better one. Not measured.
    scheduling_after: u64 = 16;
    /// Where there are many more actions than those of the plan, scheduling begins after so many turns without a better plan.
    /// Of 16, 100 and 400: with 16, the sampled quantum circuit came to 54.0 after 10 s, with 100 to 37.0; elevators 2011, 1,
    /// to 672 and 648, and with 400 to 648.
    scheduling_late: u64 = 100;
    /// A plan that is worse than the best one by up to one part in so many may be gone on from, now
    /// and then. With 24, makespans are a little better than with 64.
    leniency: u32 = 24;
    /// After so many turns without a better plan, the best one is gone back to. Not measured.
    return_after: u64 = 200;

    /// How many turns the preferred successors get for a better estimate. The value of LAMA
    /// (Richter & Westphal, JAIR 2010); not measured here.
    boost: i64 = 1_000;
    /// A search that has found no better estimate in so many states goes on from the newest preferred
    /// successor of a rank and from the oldest in turn. With 4 or less, the third of the delivery
    /// problems takes 15,000 to 25,000 states to its first plan, with 8 to 128 about 500, as without
    /// it. The 15th of depots takes 11,000 states with 32, and more than 27,000 without it. (Satellite
    /// 7 of 2014 takes 1,400 with 4, and has none after 30,000 with 32.)
    alternation_after: u64 = 32;
    /// In the complete search, one turn in this many goes to the successor that has waited longest.
    /// Not measured; any number keeps the search from losing itself where states are endlessly
    /// many.
    exploration_interval: u64 = 32;
    /// How many states that differ in times only are kept by compressing searches. Not measured.
    compressed_variants: usize = 4;
    /// The same in chronological searches. Not measured; more, as times are what they decide.
    chronological_variants: usize = 32;
    /// How many unsettled happenings a state of a chronological search may have: it remembers a
    /// distance for each pair of them. Not measured; chosen for memory (74 kB for each state).
    most_unsettled: u64 = 96;

    /// After how many states temporal `h²` is asked whether the root is a dead end. Not measured;
    /// problems with an easy plan are solved before.
    root_check_after: u64 = 64;
    /// After how many states it is asked about the states at which a search goes on. Not measured;
    /// as above.
    dead_end_checks_after: u64 = 512;
    /// After so many states the share of time for these checks doubles, after twice as many it is
    /// three times as large, and so on. Not measured; the longer a search takes, the likelier it is
    /// lost in dead ends.
    dead_end_patience: u64 = 4_096;
    /// Beyond so many atoms temporal `h²` is not computed: its table takes the square in memory,
    /// and each check more than that in time. Not measured.
    most_pair_atoms: usize = 400;
    /// The same for the pairs that one round of it looks up. Not measured; about 10 ms.
    most_pair_lookups: usize = 2_000_000;

    /// Beyond so many facts, only single facts make a state new, not pairs: a bit for each pair and
    /// each worth is kept. Not measured; chosen for memory (64 kB for each worth).
    most_facts_for_novel_pairs: usize = 1_024;
    /// How many worths of states the search for new states tells apart. Not measured; chosen for
    /// memory.
    most_worths: usize = 4_096;

    /// Whether landmarks are ordered reasonably, by mutex groups: 1 for yes. On each eighth temporal instance of the
    /// collection no first plan takes another number of states; of those with required concurrency only seven of
    /// majsp do: five take more with it (one 3,929 states instead of 596), and two 1 % fewer.
    reasonable_orders: u8 = 0;
    /// How much work goes into finding mutex groups: so many parts of operators, about 50 ms. Not measured.
    most_mutex_work: u64 = 20_000_000;
    /// Work limit for mutex pairs, in words of tables (20 to 40 ms). With 200 million, instances 6 and 10 of turn and open take
    /// 0.06 and 0.33 s instead of 0.04 and 0.22 s, and no other answer differs among those tried. Floor-tile needs less than 5 million.
    most_mutex_pair_work: u64 = 20_000_000;
    /// How much work goes into finding landmarks: so many entries of sets of them, about half a second. Not
    /// measured; a search that finds none until then does without its turns.
    most_landmark_work: u64 = 100_000_000;

    /// What a step of mean cost counts for, besides the one that every step counts for ("plus one";
    /// Richter & Westphal, JAIR 2010). Not measured; small, as each cost is a bucket of the queue.
    mean_step_cost: u32 = 8;
    /// The most that a step counts for. Not measured; as above.
    most_step_cost: u32 = 500;

    /// How many comparisons of actions are spent on finding interchangeable objects. Not measured;
    /// about 100 ms.
    most_symmetry_comparisons: usize = 300_000;
}

/// Whether all techniques are there. A module for browsers counts by its size, and does without scheduling and
/// reasonable orders.
pub(crate) const IS_WHOLE: bool = !cfg!(target_family = "wasm");

impl Tuning {
    /// Whether the technique is in use.
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
        assert!(message.starts_with("there is no `boots`; choose one of first_round, "));
    }

    #[test]
    fn techniques_and_searches_are_told_by_name() {
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
