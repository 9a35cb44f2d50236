//! Probabilities of the ends of actions and of events in each cell: [`CellProbabilities`].

use elbowroom_sim::{Side as Part, rounding_edge};

use super::process::action_model::{ActionModel, Ending, Occurs};
use super::process::world::{TimedWorld, unknown_shape};
use super::settings::{NotTabulated, Side};

/// Conditional probabilities of happenings in a cell, given that they have not taken place before.
#[derive(Debug)]
pub struct CellProbabilities {
    /// The number of cells.
    pub cells: usize,
    /// Ends of actions, by action and number of cells since the start.
    pub ends: Vec<Vec<EndProbabilities>>,
    /// Events, by event and cell.
    pub events: Vec<Vec<f64>>,
    /// Conditional probability that an event happens more than once in a cell if it happens there,
    /// by event and cell.
    pub(crate) repeated: Vec<Vec<f64>>,
    /// Probability that an event happens before the first decision, by event.
    pub initial: Vec<f64>,
    /// The next number of cells with a possible end, by action and number of cells since the start;
    /// the next cell with a possible occurrence, by event and cell.
    pub(super) next_end: Vec<Vec<u32>>,
    pub(super) next_event: Vec<Vec<u32>>,
}

/// Marks that no further occurrence is possible.
pub(super) const NEVER: u32 = u32::MAX;

/// Conditional probabilities of the ends of an action in a cell, given that it has not ended
/// before.
#[derive(Clone, Debug, PartialEq)]
pub struct EndProbabilities {
    /// The probability of success.
    pub success: f64,
    /// The probability of each kind of failure.
    pub failures: Vec<f64>,
}

impl EndProbabilities {
    pub(crate) fn total(&self) -> f64 {
        self.success + self.any_failure()
    }

    /// Returns the probability of any failure.
    pub fn any_failure(&self) -> f64 {
        self.failures.iter().sum()
    }

    /// Returns the possible ends with their probabilities, and that of no end.
    pub(super) fn outcomes(
        &self,
        act: &ActionModel,
    ) -> impl Iterator<Item = (f64, Option<Ending>)> {
        let badly = (0_u8..).zip(&self.failures);
        let badly = badly.map(|(way, p)| (*p, Some(Ending::Failure(way))));
        let draws = act.rest.iter().flat_map(|(_, end)| &end.draws);
        let well = (0_u16..).zip(draws);
        let well = well.map(|(draw, (p, _))| (self.success * p, Some(Ending::Success(draw))));
        let not = ((1.0 - self.total()).max(0.0), None);
        let all: Vec<_> = well.chain(badly).chain([not]).collect();
        all.into_iter()
    }
}

/// Maximum number of parts of a duration that are distinguished for the time of a failure.
const MAX_SHARES: f64 = 10_000.0;

/// Returns the length of a cell, in seconds.
pub(crate) fn step(world: &TimedWorld, cells: usize) -> f64 {
    #[allow(clippy::cast_precision_loss, reason = "at most 65,535")]
    let cells = cells as f64;
    world.horizon / cells
}

/// Returns the probabilities of happenings in each of `cells` cells, for a bound; `cells` is below
/// 65,534.
///
/// # Errors
/// When a distribution has no known probabilities.
pub fn cell_probabilities_of(
    world: &TimedWorld,
    cells: usize,
    side: Side,
) -> Result<CellProbabilities, NotTabulated> {
    // In the upper bound, a happening at the horizon belongs to a further cell.
    let all = cells + usize::from(side == Side::Above);
    CellProbabilities::new(world, step(world, cells), all, side)
}

impl CellProbabilities {
    /// Computes the probabilities on a grid. Cells are closed at the left for an upper bound, and
    /// at the right for a lower bound: if the agent decides only at boundaries, a happening at a
    /// boundary comes before the decision.
    pub(super) fn new(
        world: &TimedWorld,
        step: f64,
        cells: usize,
        side: Side,
    ) -> Result<Self, NotTabulated> {
        let part = match side {
            Side::Above => Part::Below,
            Side::Below => Part::AtMost,
        };
        let resolution = world.model.resolution.to_f64();
        #[allow(clippy::cast_precision_loss, reason = "at most 65,535 cells")]
        let boundary = |cell: usize| subtract_time(step * cell as f64, 0.0, resolution);
        let mut ends = Vec::new();
        for act in &world.acts {
            let mut hazards = Vec::new();
            if act.rest.is_some() {
                let shares = shares(resolution, act.midway_failure);
                let mut before = EndProbabilities {
                    success: 0.0,
                    failures: vec![0.0; act.failures.len()],
                };
                for cell in 0..=cells {
                    let until = boundary(cell + 1);
                    let ended = end_probabilities(act, world, until, part, &shares)
                        .ok_or_else(unknown_shape)?;
                    hazards.push(hazard(&ended, &before));
                    before = ended;
                }
            }
            ends.push(hazards);
        }
        let (mut events, mut before, mut again) = (Vec::new(), Vec::new(), Vec::new());
        for event in &world.events {
            if let Occurs::Rate(rate) = event.occurs {
                let edge = |time| rounding_edge(time, part, resolution).max(0.0);
                let mean = |cell| rate * (edge(boundary(cell + 1)) - edge(boundary(cell)));
                before.push(occurs(rate * edge(0.0)).0);
                let cells = (0..cells).map(|cell| occurs(mean(cell)));
                let (once, more) = cells.unzip();
                events.push(once);
                again.push(more);
                continue;
            }
            again.push(vec![0.0; cells]);
            let by = |until: f64, part| {
                let share = event.is_over_by(until, part, resolution);
                // Negative draws count as 0.
                let is_there = until > 0.0 || part == Part::AtMost;
                let share = if is_there { share } else { Some(0.0) };
                share.ok_or_else(unknown_shape)
            };
            let at_once = match side {
                Side::Above => 0.0,
                Side::Below => by(0.0, Part::AtMost)?,
            };
            before.push(at_once);
            let mut hazards = Vec::new();
            let mut happened = at_once;
            for cell in 0..cells {
                let now = by(boundary(cell + 1), part)?;
                let share = |of: f64| EndProbabilities {
                    success: of,
                    failures: Vec::new(),
                };
                hazards.push(hazard(&share(now), &share(happened)).success);
                happened = now;
            }
            events.push(hazards);
        }
        let next_end = ends.iter().map(|hazards: &Vec<EndProbabilities>| {
            next(hazards.iter().map(|ends| ends.total() > 0.0))
        });
        let next_event = events
            .iter()
            .map(|hazards| next(hazards.iter().map(|p| *p > 0.0)));
        Ok(Self {
            cells,
            next_end: next_end.collect(),
            next_event: next_event.collect(),
            ends,
            events,
            repeated: again,
            initial: before,
        })
    }
}

/// Returns, for each position, the first position from there on with `true`.
fn next(is_so: impl DoubleEndedIterator<Item = bool> + ExactSizeIterator) -> Vec<u32> {
    let mut next = NEVER;
    let mut all = vec![NEVER; is_so.len()];
    for (place, is_so) in is_so.enumerate().rev() {
        if is_so {
            next = u32::try_from(place).unwrap_or(NEVER);
        }
        all[place] = next;
    }
    all
}

/// Returns the probability of an occurrence in a Poisson process with this mean number of
/// occurrences, and the conditional probability of more than one.
fn occurs(mean: f64) -> (f64, f64) {
    let ever = -(-mean).exp_m1();
    if ever <= 0.0 {
        return (0.0, 0.0);
    }
    (ever, (1.0 - mean * (-mean).exp() / ever).clamp(0.0, 1.0))
}

/// Returns the probabilities since `before`, relative to the remaining probability. If almost
/// nothing remains, the happening is certain.
fn hazard(now: &EndProbabilities, before: &EndProbabilities) -> EndProbabilities {
    let badly = now.failures.iter().zip(&before.failures);
    let come = EndProbabilities {
        success: (now.success - before.success).max(0.0),
        failures: badly.map(|(now, before)| (now - before).max(0.0)).collect(),
    };
    let (left, sum) = (1.0 - before.total(), come.total());
    let whole = if left < 1e-13 || sum >= left {
        sum
    } else {
        left
    };
    let share = |of: f64| if whole > 0.0 { of / whole } else { 0.0 };
    EndProbabilities {
        success: share(come.success),
        failures: come.failures.iter().map(|badly| share(*badly)).collect(),
    }
}

/// Returns the shares of its duration after which an action may fail midway, with their
/// probabilities: a uniform number, rounded to the resolution.
fn shares(resolution: f64, midway: f64) -> Vec<(f64, f64)> {
    if midway <= 0.0 {
        return Vec::new();
    }
    let fineness = resolution.max(1.0 / MAX_SHARES);
    let below = |value: f64| value.clamp(0.0, 1.0);
    let mut shares = Vec::new();
    let mut at = 0.0;
    loop {
        let weight = below(at + fineness / 2.0) - below(at - fineness / 2.0);
        if weight <= 0.0 {
            return shares;
        }
        shares.push((at, weight));
        at += fineness;
    }
}

/// Returns the probabilities that an action has succeeded, or failed in each way, by a time after
/// its start.
fn end_probabilities(
    act: &ActionModel,
    world: &TimedWorld,
    until: f64,
    part: Part,
    shares: &[(f64, f64)],
) -> Option<EndProbabilities> {
    let over = |until: f64| {
        world
            .model
            .duration_probability(&act.name, &act.planned, until, part)
    };
    let all = over(until)?;
    let resolution = world.model.resolution.to_f64();
    let mut badly = Vec::with_capacity(act.failures.len());
    for failed in &act.failures {
        let until = if failed.delay > 0.0 {
            subtract_time(until, failed.delay, resolution)
        } else {
            until
        };
        let mut p = act.end_failure * over(until)?;
        for (share, weight) in shares {
            let has_failed = if *share > 0.0 {
                over(until / share)?
            } else {
                let is_over = match part {
                    Part::Below => 0.0 < until,
                    Part::AtMost => 0.0 <= until,
                };
                f64::from(u8::from(is_over))
            };
            p += act.midway_failure * weight * has_failed;
        }
        badly.push(p * failed.share);
    }
    Some(EndProbabilities {
        success: (1.0 - act.end_failure - act.midway_failure) * all,
        failures: badly,
    })
}

/// Subtracts times. Multiples of the resolution remain multiples despite rounding.
fn subtract_time(time: f64, by: f64, resolution: f64) -> f64 {
    let steps = (time - by) / resolution;
    let whole = steps.round();
    if (steps - whole).abs() < 1e-6 {
        whole / (1.0 / resolution)
    } else {
        time - by
    }
}
