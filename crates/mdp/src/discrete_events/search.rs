//! Bounds from both sides for worlds with [known times](super): the restricted and relaxed worlds,
//! in the order of their examination.

use super::cells;
use crate::cell_probabilities::{CellProbabilities, cell_probabilities_of, step};
use crate::graph;
use crate::lower_bound::{DecisionEpochs, LowerBound};
use crate::process::world::TimedWorld;
use crate::restricted_policy::fitting;
use crate::settings::{Grid, NotTabulated, ROUNDING_MARGIN, Settings, Side, Stop};
use crate::upper_bound::UpperBound;

/// Bounds from both sides, with the restricted agent behind the lower one.
pub(crate) struct FoundBounds {
    pub(crate) grid: Grid,
    /// Number of cells of the lower bound.
    pub(crate) cells: usize,
    /// The restricted agent that attains the lower bound.
    pub(crate) within: Option<RestrictedAgent>,
    /// For each side (below, above), `true` if a bound was computed.
    is_computed: [bool; 2],
}

/// An agent restricted to a set of actions.
#[derive(Clone)]
pub(crate) struct RestrictedAgent {
    /// The world of these actions.
    pub(crate) world: TimedWorld,
    pub(crate) epochs: DecisionEpochs,
}

/// Effort for bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Divisors of the maximum number of states, for each bound; they are used one after the other
    /// until the bounds are close.
    shares: &'static [usize],
    /// `true` to stop if the first restricted world has too many states.
    stops_at_too_many_states: bool,
}

/// Result of a computation of one bound.
enum BoundResult {
    /// A bound was found.
    Done,
    TooManyStates,
    Interrupted,
}

/// A restricted agent, and whether its lower bound is known.
struct LowerCandidate {
    agent: RestrictedAgent,
    is_done: bool,
}

/// A relaxed world, and the approximate number of cells of its next grid; `None` after the finest.
struct UpperCandidate {
    world: TimedWorld,
    wanted: Option<usize>,
}

struct Search<'a> {
    settings: &'a Settings,
    may_continue: &'a dyn Fn() -> bool,
    found: FoundBounds,
}

/// Computes bounds from both sides if everything happens at known times; `None` if not, or if
/// `may_continue` returns `false`.
pub(crate) fn bounds(
    world: &TimedWorld,
    settings: &Settings,
    effort: Effort,
    may_continue: &dyn Fn() -> bool,
) -> Result<Option<FoundBounds>, NotTabulated> {
    let Some(cells) = cells(world) else {
        return Ok(None);
    };
    let grid = Grid {
        step: step(world, cells),
        lower: 0.0,
        upper: 1.0,
        states: 0,
    };
    let mut search = Search {
        settings,
        may_continue,
        found: FoundBounds {
            grid,
            cells,
            within: None,
            is_computed: [false; 2],
        },
    };
    let mut below: Vec<LowerCandidate> = RestrictedAgent::all(world, settings)
        .into_iter()
        .map(|keeping| LowerCandidate {
            agent: keeping,
            is_done: false,
        })
        .collect();
    let mut above = search.relaxed_worlds(world)?;
    for share in effort.shares {
        let most_states = settings.most_states / share;
        let mut from_below = below.iter_mut().filter(|next| !next.is_done);
        let mut from_above = above.iter_mut().filter(|next| next.wanted.is_some());
        let mut kinder = from_above.next();
        // Alternate between the sides, because the harder one is not known in advance.
        loop {
            let keeping = from_below.next();
            if search.found.is_close(settings) || (keeping.is_none() && kinder.is_none()) {
                break;
            }
            if let Some(next) = keeping
                && matches!(
                    search.compute_lower_bound(next, most_states)?,
                    BoundResult::Interrupted
                )
            {
                return Ok(None);
            }
            if effort.stops_at_too_many_states && !search.found.is_computed[0] {
                return Ok(None);
            }
            if let Some(next) = &mut kinder
                && !search.found.is_close(settings)
            {
                match search.compute_upper_bound(next, most_states)? {
                    BoundResult::Interrupted => return Ok(None),
                    BoundResult::Done if next.wanted.is_some() => {}
                    BoundResult::Done | BoundResult::TooManyStates => kinder = from_above.next(),
                }
            }
        }
    }
    Ok(Some(search.found))
}

impl Effort {
    /// For bounds on the success probability ([`optimum`](crate::optimum)).
    pub(crate) const WHOLE: Self = Self {
        shares: &[12, 4],
        stops_at_too_many_states: false,
    };
    /// For a policy: the run has to wait for it.
    pub(crate) const QUICK: Self = Self {
        shares: &[12],
        stops_at_too_many_states: true,
    };
}

impl FoundBounds {
    fn is_close(&self, settings: &Settings) -> bool {
        self.is_bounded() && self.grid.upper - self.grid.lower <= settings.gap
    }

    /// Returns `true` if both bounds are computed.
    pub(crate) fn is_bounded(&self) -> bool {
        self.is_computed == [true; 2]
    }
}

impl RestrictedAgent {
    /// Returns agents restricted to each of the [plans](Settings::plans), then to each of the
    /// [fallbacks](Settings::fallbacks), and finally an unrestricted one.
    fn all(world: &TimedWorld, settings: &Settings) -> Vec<Self> {
        let keeping = |worlds: Vec<TimedWorld>, sets: &[&[Vec<String>]]| {
            let keeping = worlds.into_iter().map(|world| {
                let must = sets.iter().fold(0, |all, sets| all | world.in_sets(sets));
                Self {
                    epochs: DecisionEpochs::AtKnownTimes(must),
                    world,
                }
            });
            keeping.collect::<Vec<_>>()
        };
        let (plans, fallbacks) = (&settings.plans, &settings.fallbacks);
        let mut all = keeping(world.restricted_to(plans, &[]), &[plans]);
        let later = world.restricted_to(fallbacks, plans);
        all.extend(keeping(later, &[plans, fallbacks]));
        all.extend(keeping(vec![world.clone()], &[]));
        all
    }
}

impl Search<'_> {
    /// Returns the relaxed worlds, those with few states first.
    fn relaxed_worlds(&self, world: &TimedWorld) -> Result<Vec<UpperCandidate>, NotTabulated> {
        let above = world.for_bound(Side::Above);
        let freer = above.without_numbers_over_all()?;
        let chances = cell_probabilities_of(&freer, self.found.cells, Side::Above)?;
        let leaner = freer.without_certainties(&chances);
        let worlds = leaner.into_iter().chain([freer, above]);
        let wanted = Some(self.settings.first_cells.max(1));
        Ok(worlds
            .map(|world| UpperCandidate { world, wanted })
            .collect())
    }

    fn compute_lower_bound(
        &mut self,
        next: &mut LowerCandidate,
        most_states: usize,
    ) -> Result<BoundResult, NotTabulated> {
        let world = &next.agent.world;
        let mut left = most_states;
        let chances = cell_probabilities_of(world, self.found.cells, Side::Below)?;
        let below = LowerBound::new(world, &chances, next.agent.epochs);
        let value = graph::value(&below, &mut left, self.may_continue);
        self.found.grid.states += most_states - left;
        let lower = match value {
            Ok(value) => value - ROUNDING_MARGIN,
            Err(Stop::Interrupted) => return Ok(BoundResult::Interrupted),
            Err(_) => return Ok(BoundResult::TooManyStates),
        };
        next.is_done = true;
        self.found.is_computed[0] = true;
        if lower > self.found.grid.lower {
            self.found.grid.lower = lower;
            self.found.within = Some(next.agent.clone());
        }
        Ok(BoundResult::Done)
    }

    /// Computes the upper bound on one grid.
    fn compute_upper_bound(
        &mut self,
        next: &mut UpperCandidate,
        most_states: usize,
    ) -> Result<BoundResult, NotTabulated> {
        let world = &next.world;
        let wanted = next.wanted.unwrap_or(self.found.cells);
        // The last grid is exact: no duration is rounded down.
        let (step, cells) = match fitting(world, wanted, Side::Above) {
            Some(fit) if fit.cells < self.found.cells => (fit.step(), fit.cells),
            _ => (step(world, self.found.cells), self.found.cells),
        };
        let mut left = most_states;
        let chances = CellProbabilities::new(world, step, cells + 1, Side::Above)?;
        let value = graph::value(
            &UpperBound::at_known_times(world, &chances),
            &mut left,
            self.may_continue,
        );
        self.found.grid.states += most_states - left;
        match value {
            Ok(value) => self.found.grid.upper = self.found.grid.upper.min(value + ROUNDING_MARGIN),
            Err(Stop::Interrupted) => return Ok(BoundResult::Interrupted),
            Err(_) => return Ok(BoundResult::TooManyStates),
        }
        self.found.is_computed[1] = true;
        next.wanted = (cells < self.found.cells).then_some(wanted * 2);
        Ok(BoundResult::Done)
    }
}
