//! Strategies of searches.

use super::super::compile::{Compiled, Compressibility};
use super::super::relaxed::Relaxed;
use super::super::tuning::{Member, Technique, Tuning};

/// Strategy of a search.
#[derive(Clone, Copy, Debug)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is one way to go about it, and any of them may be combined"
)]
pub(crate) struct Strategy {
    /// If present, actions that are at least as safe to compress are compressed, and states are
    /// compared approximately. Some plans are lost.
    pub(crate) compresses: Option<Compressibility>,
    /// `true` if envelopes with macro-operators start only as parts of these. Some plans are lost.
    pub(crate) uses_macros: bool,
    /// Maximum number of states that differ only in times. Further ones are dropped, and some plans
    /// lost.
    pub(crate) variants: usize,
    /// `true` if later choices happen no earlier. The latest ends of the running actions are then
    /// known. Some plans are lost.
    pub(crate) is_chronological: bool,
    /// If present, novel states come first, among those with the same subgoal if the goal is
    /// serialized. The value selects whether the novelty of each successor or of each expanded
    /// state is computed.
    pub(crate) novelty: Option<NoveltyOf>,
    /// `true` if the number of remaining landmarks has priority over the estimate, or counts as the
    /// number of remaining goals.
    pub(crate) counts_landmarks: bool,
    /// `true` if the conjuncts of the goal are achieved one after the other.
    pub(crate) serializes_goals: bool,
    /// `true` if subgoals prefer objects that are free early.
    pub(crate) spreads_work: bool,
    /// `true` if relaxed plans account for consumables, which are never replenished.
    pub(crate) draws_on_consumables: bool,
    /// `true` if consumables are saved.
    pub(crate) saves_consumables: bool,
    /// `true` if the estimate accounts for the resources that a relaxed plan uses up, and
    /// replenishes them.
    pub(crate) replenishes: bool,
    /// `true` if happenings of one moment may satisfy each other's over-all conditions in any
    /// order; see [`State::joint`](super::super::state::State::joint).
    pub(crate) joins: bool,
    /// `true` if the number of steps that led to a state is added to its estimate.
    pub(crate) counts_steps: bool,
    /// The number of states that it visits in a round before the first plan, relative to other
    /// searches.
    pub(crate) share: u64,
    /// The aim.
    pub(crate) aim: Aim,
}

/// States whose novelty a search computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoveltyOf {
    /// The expanded states, among those with the same subgoal and the same estimate.
    Expanded,
    /// Each successor, among those with the same number of goals and achieved literals of a relaxed
    /// plan (BFWS(f₅)). States are estimated only if they have one more goal.
    Successors,
}

/// The aim of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Aim {
    /// A plan, regardless of its metric, and then shorter ones. States nearest to a goal come
    /// first.
    Goal,
    /// Plans with a better metric. States with the lowest remaining cost come first.
    CostToGo,
    /// Plans with a better metric. The rank is the cost spent plus the remaining cost times this
    /// factor (weighted A*; Pohl 1970).
    WeightedAStar(i64),
    /// Shorter plans with the same metric.
    Shortest,
}

impl Strategy {
    /// Loses no plans, except as [`Search::is_incomplete`](super::Search::is_incomplete) reports.
    pub(crate) const COMPLETE: Self = Self {
        compresses: None,
        uses_macros: false,
        variants: usize::MAX,
        is_chronological: false,
        draws_on_consumables: false,
        saves_consumables: false,
        novelty: None,
        counts_landmarks: false,
        serializes_goals: false,
        spreads_work: false,
        replenishes: false,
        joins: false,
        counts_steps: false,
        share: 1,
        aim: Aim::Goal,
    };

    /// Loses no plans, and joins happenings of one moment.
    pub(crate) const JOINING: Self = Self {
        joins: true,
        ..Self::COMPLETE
    };

    /// Returns the strategy of that member of the portfolio.
    pub(crate) fn of(member: Member, tuning: &Tuning) -> Self {
        let uses_macros = tuning.uses(Technique::Macros);
        match member {
            Member::Compressing => Self::compressing(Compressibility::HoldsResource, tuning),
            Member::CompressingSafe => Self::compressing(Compressibility::Safe, tuning),
            Member::Replenishing => Self::of(Member::Compressing, tuning).replenishing(),
            Member::Chronological => Self {
                variants: tuning.chronological_variants,
                is_chronological: true,
                draws_on_consumables: true,
                ..Self::COMPLETE
            },
            Member::Saving => Self {
                variants: tuning.compressed_variants,
                is_chronological: true,
                saves_consumables: true,
                ..Self::COMPLETE
            },
            Member::Width => Self {
                novelty: Some(NoveltyOf::Successors),
                draws_on_consumables: false,
                uses_macros,
                ..Self::of(Member::Compressing, tuning)
            },
            Member::Landmarks => Self {
                counts_landmarks: true,
                uses_macros,
                ..Self::of(Member::Compressing, tuning)
            },
            Member::Serializing => Self {
                serializes_goals: true,
                novelty: Some(NoveltyOf::Expanded),
                replenishes: tuning.uses(Technique::Reservoirs),
                uses_macros,
                ..Self::of(Member::Compressing, tuning)
            },
            Member::Spreading => Self {
                spreads_work: true,
                ..Self::of(Member::Serializing, tuning)
            },
            Member::LandmarkWidth => Self {
                counts_landmarks: true,
                ..Self::of(Member::Width, tuning)
            },
            Member::Complete => Self::COMPLETE,
        }
    }

    /// Returns `true` if macro-operators replace the starts of some envelopes.
    pub(super) fn replaces_starts(self, compiled: &Compiled) -> bool {
        self.uses_macros && !compiled.macros.is_empty()
    }

    /// Returns the heuristic for its states.
    pub(super) fn relaxed(self, compiled: &Compiled) -> Relaxed<'_> {
        let with_macros = self
            .replaces_starts(compiled)
            .then(|| Relaxed::with_macros(compiled, self.compresses));
        let mut relaxed = with_macros
            .flatten()
            .unwrap_or_else(|| Relaxed::new(compiled, self.compresses));
        relaxed.is_chronological = self.is_chronological;
        if self.draws_on_consumables && compiled.tuning.uses(Technique::Consumables) {
            relaxed.count_consumables();
        }
        if self.replenishes {
            relaxed.count_resources();
        }
        relaxed.lists_actions = self.serializes_goals;
        relaxed.lists_subgoals = self.novelty == Some(NoveltyOf::Successors);
        relaxed
    }

    /// Compresses actions that are at least as safe as `least`.
    fn compressing(least: Compressibility, tuning: &Tuning) -> Self {
        Self {
            compresses: Some(least),
            variants: tuning.compressed_variants,
            draws_on_consumables: true,
            ..Self::COMPLETE
        }
    }

    /// Returns `true` if the newest and the oldest preferred successors alternate on a plateau: if
    /// actions are compressed and only the estimate counts. A search by novelty leaves plateaus by
    /// itself.
    pub(crate) fn alternates(&self) -> bool {
        self.compresses.is_some() && self.novelty.is_none() && self.aim == Aim::Goal
    }

    /// Returns `true` if the number of remaining landmarks or conjuncts has priority over the
    /// estimate.
    pub(super) fn ranks_remaining(&self) -> bool {
        self.counts_landmarks || self.serializes_goals
    }

    /// Returns `true` if it loses no plans, except as
    /// [`Search::is_incomplete`](super::Search::is_incomplete) reports.
    pub(crate) fn is_complete(&self) -> bool {
        self.compresses.is_none() && !self.is_chronological
    }

    /// Returns the same strategy with replenishing.
    pub(crate) fn replenishing(self) -> Self {
        Self {
            replenishes: true,
            ..self
        }
    }

    /// Returns the same strategy with another share of a round.
    pub(crate) fn with_share(self, share: u64) -> Self {
        Self { share, ..self }
    }

    /// Returns the same strategy with the number of steps added to the estimate.
    pub(crate) fn counting_steps(self) -> Self {
        Self {
            counts_steps: true,
            ..self
        }
    }

    /// Returns the same strategy with another aim.
    pub(crate) fn with_aim(self, aim: Aim) -> Self {
        Self { aim, ..self }
    }
}
