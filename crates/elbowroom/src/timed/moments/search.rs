//! Bounds from both sides for worlds with [known times](super): the restricted and relaxed worlds,
//! in the order of their examination.

use super::cells;
use crate::timed::above::Above;
use crate::timed::below::{Below, Manner};
use crate::timed::chances::Chances;
use crate::timed::within::fitting;
use crate::timed::world::TimedWorld;
use crate::timed::{Grid, NotTabulated, SLACK, Settings, Side, Stop, chances, graph, step};

/// The bounds found.
pub(in crate::timed) struct Found {
    pub(in crate::timed) grid: Grid,
    /// Number of cells of the lower bound.
    pub(in crate::timed) cells: usize,
    /// The restricted agent behind the lower bound.
    pub(in crate::timed) within: Option<Keeping>,
    /// `true` for each side with a computed bound: below, above.
    has: [bool; 2],
}

/// An agent restricted to a set of actions.
#[derive(Clone)]
pub(in crate::timed) struct Keeping {
    /// The world of these actions.
    pub(in crate::timed) world: TimedWorld,
    pub(in crate::timed) manner: Manner,
}

/// Effort for bounds.
#[derive(Clone, Copy, Debug)]
pub(in crate::timed) struct Effort {
    /// Divisors of the maximum number of states, for each bound; they are used one after the other
    /// until the bounds are close.
    shares: &'static [usize],
    /// `true` to stop if the first restricted world has too many states.
    gives_up: bool,
}

/// Result of a computation of one bound.
enum Look {
    /// A bound was found.
    Done,
    TooManyStates,
    Interrupted,
}

/// A restricted agent, and whether its lower bound is known.
struct FromBelow {
    keeping: Keeping,
    is_done: bool,
}

/// A relaxed world, and the approximate number of cells of its next grid; `None` after the finest.
struct FromAbove {
    world: TimedWorld,
    wanted: Option<usize>,
}

struct Search<'a> {
    settings: &'a Settings,
    goes_on: &'a dyn Fn() -> bool,
    found: Found,
}

/// Computes bounds from both sides if everything happens at known times; `None` if not, or if
/// `goes_on` returns `false`.
pub(in crate::timed) fn bounds(
    world: &TimedWorld,
    settings: &Settings,
    effort: Effort,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Found>, NotTabulated> {
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
        goes_on,
        found: Found {
            grid,
            cells,
            within: None,
            has: [false; 2],
        },
    };
    let mut below: Vec<FromBelow> = Keeping::all(world, settings)
        .into_iter()
        .map(|keeping| FromBelow {
            keeping,
            is_done: false,
        })
        .collect();
    let mut above = search.worlds_from_above(world)?;
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
                    search.look_from_below(next, most_states)?,
                    Look::Interrupted
                )
            {
                return Ok(None);
            }
            if effort.gives_up && !search.found.has[0] {
                return Ok(None);
            }
            if let Some(next) = &mut kinder
                && !search.found.is_close(settings)
            {
                match search.look_from_above(next, most_states)? {
                    Look::Interrupted => return Ok(None),
                    Look::Done if next.wanted.is_some() => {}
                    Look::Done | Look::TooManyStates => kinder = from_above.next(),
                }
            }
        }
    }
    Ok(Some(search.found))
}

impl Effort {
    /// For bounds on the success probability ([`optimum`](crate::timed::optimum)).
    pub(in crate::timed) const WHOLE: Self = Self {
        shares: &[12, 4],
        gives_up: false,
    };
    /// For a policy: the run has to wait for it.
    pub(in crate::timed) const QUICK: Self = Self {
        shares: &[12],
        gives_up: true,
    };
}

impl Found {
    fn is_close(&self, settings: &Settings) -> bool {
        self.is_bounded() && self.grid.upper - self.grid.lower <= settings.gap
    }

    /// Returns `true` if both bounds are computed.
    pub(in crate::timed) fn is_bounded(&self) -> bool {
        self.has == [true; 2]
    }
}

impl Keeping {
    /// Returns agents restricted to each of the [plans](Settings::plans), then to each of the
    /// [fallbacks](Settings::fallbacks), and finally an unrestricted one.
    fn all(world: &TimedWorld, settings: &Settings) -> Vec<Self> {
        let keeping = |worlds: Vec<TimedWorld>, sets: &[&[Vec<String>]]| {
            let keeping = worlds.into_iter().map(|world| {
                let must = sets.iter().fold(0, |all, sets| all | world.in_sets(sets));
                Self {
                    manner: Manner::ByMoments(must),
                    world,
                }
            });
            keeping.collect::<Vec<_>>()
        };
        let (plans, fallbacks) = (&settings.plans, &settings.fallbacks);
        let mut all = keeping(world.keeping_to(plans, &[]), &[plans]);
        let later = world.keeping_to(fallbacks, plans);
        all.extend(keeping(later, &[plans, fallbacks]));
        all.extend(keeping(vec![world.clone()], &[]));
        all
    }
}

impl Search<'_> {
    /// Returns the relaxed worlds, those with few states first.
    fn worlds_from_above(&self, world: &TimedWorld) -> Result<Vec<FromAbove>, NotTabulated> {
        let above = world.seen_from(Side::Above);
        let freer = above.without_numbers_over_all()?;
        let chances = chances(&freer, self.found.cells, Side::Above)?;
        let leaner = freer.without_certainties(&chances);
        let worlds = leaner.into_iter().chain([freer, above]);
        let wanted = Some(self.settings.first_cells.max(1));
        Ok(worlds.map(|world| FromAbove { world, wanted }).collect())
    }

    fn look_from_below(
        &mut self,
        next: &mut FromBelow,
        most_states: usize,
    ) -> Result<Look, NotTabulated> {
        let world = &next.keeping.world;
        let mut left = most_states;
        let chances = chances(world, self.found.cells, Side::Below)?;
        let below = Below::new(world, &chances, next.keeping.manner);
        let value = graph::value(&below, &mut left, self.goes_on);
        self.found.grid.states += most_states - left;
        let lower = match value {
            Ok(value) => value - SLACK,
            Err(Stop::Interrupted) => return Ok(Look::Interrupted),
            Err(_) => return Ok(Look::TooManyStates),
        };
        next.is_done = true;
        self.found.has[0] = true;
        if lower > self.found.grid.lower {
            self.found.grid.lower = lower;
            self.found.within = Some(next.keeping.clone());
        }
        Ok(Look::Done)
    }

    /// Computes the upper bound on one grid.
    fn look_from_above(
        &mut self,
        next: &mut FromAbove,
        most_states: usize,
    ) -> Result<Look, NotTabulated> {
        let world = &next.world;
        let wanted = next.wanted.unwrap_or(self.found.cells);
        // The last grid is exact: no duration is rounded down.
        let (step, cells) = match fitting(world, wanted, Side::Above) {
            Some(fit) if fit.cells < self.found.cells => (fit.step(), fit.cells),
            _ => (step(world, self.found.cells), self.found.cells),
        };
        let mut left = most_states;
        let chances = Chances::new(world, step, cells + 1, Side::Above)?;
        let value = graph::value(&Above::by_moments(world, &chances), &mut left, self.goes_on);
        self.found.grid.states += most_states - left;
        match value {
            Ok(value) => self.found.grid.upper = self.found.grid.upper.min(value + SLACK),
            Err(Stop::Interrupted) => return Ok(Look::Interrupted),
            Err(_) => return Ok(Look::TooManyStates),
        }
        self.found.has[1] = true;
        next.wanted = (cells < self.found.cells).then_some(wanted * 2);
        Ok(Look::Done)
    }
}
