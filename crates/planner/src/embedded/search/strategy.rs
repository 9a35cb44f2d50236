//! How a search goes about it.

use super::super::compile::{Compiled, Compressibility};
use super::super::relaxed::Relaxed;
use super::super::tuning::{Member, Technique, Tuning};

/// How a search goes about it.
#[derive(Clone, Copy, Debug)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is one way to go about it, and any of them may be combined"
)]
pub(crate) struct Strategy {
    /// If present, actions that can be compressed at least so safely are, and states are compared
    /// roughly. Some plans are lost.
    pub(crate) compresses: Option<Compressibility>,
    /// `true` if envelopes that have macro-operators start as parts of these only. Some plans are lost.
    pub(crate) uses_macros: bool,
    /// How many states that differ in times only are kept; more are dropped, and some plans lost.
    pub(crate) variants: usize,
    /// Whether what is chosen later also happens later, or at the same time. Then it is known, of
    /// what is under way, by when it must be over. Some plans are lost.
    pub(crate) is_chronological: bool,
    /// Whether what is new comes first, and then what has more of the goal; and whether successors
    /// are looked at one by one for that, or the states that are expanded.
    pub(crate) novelty: Option<NoveltyOf>,
    /// Whether the landmarks left come before the estimate, or count as what is left of the goal.
    pub(crate) counts_landmarks: bool,
    /// Whether relaxed plans draw on what is never filled up.
    pub(crate) draws_on_consumables: bool,
    /// Whether what is used up and never filled up is spared.
    pub(crate) saves_consumables: bool,
    /// Whether the estimate counts what a relaxed plan uses up, and fills it up.
    pub(crate) replenishes: bool,
    /// `true` if happenings of one moment may bring about the over-all conditions of each other in any
    /// order; see [`State::joint`](super::super::state::State::joint).
    pub(crate) joins: bool,
    /// `true` if the number of steps that led to a state is added to its estimate.
    pub(crate) counts_steps: bool,
    /// The number of states that it visits in a round before the first plan, in relation to other searches.
    pub(crate) share: u64,
    /// The aim.
    pub(crate) aim: Aim,
}

/// Of what a search asks how new it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoveltyOf {
    /// Of the states that are expanded, among those of as much of the goal and the same estimate
    /// (BFWS(f₂); Lipovetzky & Geffner, AAAI 2017).
    Expanded,
    /// Of each successor, among those of as much of the goal and of a relaxed plan (BFWS(f₅)).
    /// States are estimated only where they have one more goal.
    Successors,
}

/// The aim of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Aim {
    /// A plan, whatever its metric, and then shorter ones. The nearest goal comes first.
    Goal,
    /// Plans of a better metric. What costs least to finish comes first.
    CostToGo,
    /// Plans of a better metric. What has been spent counts too, what is still to be spent so many
    /// times as much (weighted A*; Pohl 1970).
    WeightedAStar(i64),
    /// Shorter plans of the same metric.
    Shortest,
}

impl Strategy {
    /// Loses nothing but what [`Search::is_incomplete`](super::Search::is_incomplete) tells.
    pub(crate) const COMPLETE: Self = Self {
        compresses: None,
        uses_macros: false,
        variants: usize::MAX,
        is_chronological: false,
        draws_on_consumables: false,
        saves_consumables: false,
        novelty: None,
        counts_landmarks: false,
        replenishes: false,
        joins: false,
        counts_steps: false,
        share: 1,
        aim: Aim::Goal,
    };

    /// Loses nothing, and joins happenings of one moment.
    pub(crate) const JOINING: Self = Self {
        joins: true,
        ..Self::COMPLETE
    };

    /// The strategy of that member of the portfolio.
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
            Member::Novelty => Self {
                novelty: Some(NoveltyOf::Expanded),
                draws_on_consumables: false,
                uses_macros,
                ..Self::of(Member::Compressing, tuning)
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
            Member::LandmarkWidth => Self {
                counts_landmarks: true,
                ..Self::of(Member::Width, tuning)
            },
            Member::Complete => Self::COMPLETE,
        }
    }

    /// Returns `true` if macro-operators take the place of the starts of some envelopes.
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
        relaxed.lists_subgoals = self.novelty == Some(NoveltyOf::Successors);
        relaxed
    }

    /// Compresses actions that are at least so safe.
    fn compressing(least: Compressibility, tuning: &Tuning) -> Self {
        Self {
            compresses: Some(least),
            variants: tuning.compressed_variants,
            draws_on_consumables: true,
            ..Self::COMPLETE
        }
    }

    /// Whether the newest and the oldest preferred successors take turns on a plateau: where actions are
    /// compressed and only the estimate decides. A search for what is new leaves plateaus by itself.
    pub(crate) fn alternates(&self) -> bool {
        self.compresses.is_some() && self.novelty.is_none() && self.aim == Aim::Goal
    }

    /// Whether it loses nothing but what
    /// [`Search::is_incomplete`](super::Search::is_incomplete) tells.
    pub(crate) fn is_complete(&self) -> bool {
        self.compresses.is_none() && !self.is_chronological
    }

    /// The same, filling up what is used up.
    pub(crate) fn replenishing(self) -> Self {
        Self {
            replenishes: true,
            ..self
        }
    }

    /// The same, with another share of a round.
    pub(crate) fn with_share(self, share: u64) -> Self {
        Self { share, ..self }
    }

    /// The same, adding the number of steps to the estimate.
    pub(crate) fn counting_steps(self) -> Self {
        Self {
            counts_steps: true,
            ..self
        }
    }

    /// The same with another aim.
    pub(crate) fn towards(self, aim: Aim) -> Self {
        Self { aim, ..self }
    }
}
