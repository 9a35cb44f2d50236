//! In which cell what began in one ends, and in which cell what happens by itself does:
//! [`Chances`].

use elbowroom_sim::{Side as Part, rounding_edge};

use super::failures::Ending;
use super::world::{Act, Occurs, TimedWorld, unknown_shape};
use super::{NotTabulated, Side};

/// How likely it is that something happens in a cell, given that it has not before.
#[derive(Debug)]
pub(crate) struct Chances {
    /// The number of cells.
    pub(crate) cells: usize,
    /// By action and number of cells since it began: that it ends.
    pub(crate) ends: Vec<Vec<Ends>>,
    /// By event and cell: that it happens, if it can still.
    pub(crate) events: Vec<Vec<f64>>,
    /// By event and cell: that it happens more than once there, if it happens there.
    pub(crate) again: Vec<Vec<f64>>,
    /// By event: that it has happened before anybody could do something.
    pub(crate) before: Vec<f64>,
}

/// How likely an action ends in a cell, given that it has not before.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ends {
    pub(crate) well: f64,
    /// In each of the ways in which it can fail.
    pub(crate) badly: Vec<f64>,
}

impl Ends {
    pub(crate) fn in_all(&self) -> f64 {
        self.well + self.badly()
    }

    /// In whatever way.
    pub(crate) fn badly(&self) -> f64 {
        self.badly.iter().sum()
    }

    /// That it ends in each way, and that it does not.
    pub(super) fn ways(&self) -> impl Iterator<Item = (f64, Option<Ending>)> {
        let badly = (0_u8..).zip(&self.badly);
        let badly = badly.map(|(way, p)| (*p, Some(Ending::Badly(way))));
        let well = (self.well, Some(Ending::Well));
        let not = ((1.0 - self.in_all()).max(0.0), None);
        std::iter::once(well).chain(badly).chain([not])
    }
}

/// Into how many parts of a duration the moment of a failure is cut at most.
const MOST_SHARES: f64 = 10_000.0;

impl Chances {
    /// Cells are closed at the left for a bound from above, and at the right for one from below:
    /// what happens at a boundary counts as before it where the agent decides at boundaries only.
    pub(super) fn new(
        world: &TimedWorld,
        step: f64,
        cells: usize,
        side: Side,
    ) -> Result<Self, NotTabulated> {
        let part = match side {
            Side::Above => Part::Below,
            Side::Below => Part::UpTo,
        };
        #[allow(clippy::cast_precision_loss, reason = "at most 65,535 cells")]
        let boundary = |cell: usize| step * cell as f64;
        let resolution = world.model.resolution.to_f64();
        let mut ends = Vec::new();
        for act in &world.acts {
            let mut hazards = Vec::new();
            if act.rest.is_some() {
                let shares = shares(resolution, act.midway);
                let mut before = Ends {
                    well: 0.0,
                    badly: vec![0.0; act.failures.len()],
                };
                for cell in 0..=cells {
                    let until = boundary(cell + 1);
                    let ended =
                        ended(act, world, until, part, &shares).ok_or_else(unknown_shape)?;
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
                // What is drawn below 0 happens at 0.
                let is_there = until > 0.0 || part == Part::UpTo;
                let share = if is_there { share } else { Some(0.0) };
                share.ok_or_else(unknown_shape)
            };
            let at_once = match side {
                Side::Above => 0.0,
                Side::Below => by(0.0, Part::UpTo)?,
            };
            before.push(at_once);
            let mut hazards = Vec::new();
            let mut happened = at_once;
            for cell in 0..cells {
                let now = by(boundary(cell + 1), part)?;
                let share = |of: f64| Ends {
                    well: of,
                    badly: Vec::new(),
                };
                hazards.push(hazard(&share(now), &share(happened)).well);
                happened = now;
            }
            events.push(hazards);
        }
        Ok(Self {
            cells,
            ends,
            events,
            again,
            before,
        })
    }
}

/// How likely something happens that happens so many times on average, without a memory; and that
/// it then happens more than once.
fn occurs(mean: f64) -> (f64, f64) {
    let ever = -(-mean).exp_m1();
    if ever <= 0.0 {
        return (0.0, 0.0);
    }
    (ever, (1.0 - mean * (-mean).exp() / ever).clamp(0.0, 1.0))
}

/// What has come since, as shares of what was left; where next to nothing is left, it happens now.
fn hazard(now: &Ends, before: &Ends) -> Ends {
    let badly = now.badly.iter().zip(&before.badly);
    let come = Ends {
        well: (now.well - before.well).max(0.0),
        badly: badly.map(|(now, before)| (now - before).max(0.0)).collect(),
    };
    let (left, sum) = (1.0 - before.in_all(), come.in_all());
    let whole = if left < 1e-13 || sum >= left {
        sum
    } else {
        left
    };
    let share = |of: f64| if whole > 0.0 { of / whole } else { 0.0 };
    Ends {
        well: share(come.well),
        badly: come.badly.iter().map(|badly| share(*badly)).collect(),
    }
}

/// The shares of its duration after which an action that fails midway may do so, with how likely
/// each is: a uniform number, rounded to the resolution.
fn shares(resolution: f64, midway: f64) -> Vec<(f64, f64)> {
    if midway <= 0.0 {
        return Vec::new();
    }
    let fineness = resolution.max(1.0 / MOST_SHARES);
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

/// How likely an action has ended well, or failed in each way, on that side of a time after its start.
fn ended(
    act: &Act,
    world: &TimedWorld,
    until: f64,
    part: Part,
    shares: &[(f64, f64)],
) -> Option<Ends> {
    let over = |until: f64| {
        world
            .model
            .duration_share(&act.name, &act.planned, until, part)
    };
    let all = over(until)?;
    let resolution = world.model.resolution.to_f64();
    let mut badly = Vec::with_capacity(act.failures.len());
    for failed in &act.failures {
        let until = earlier(until, failed.delay, resolution);
        let mut p = act.at_end * over(until)?;
        for (share, weight) in shares {
            let has_failed = if *share > 0.0 {
                over(until / share)?
            } else {
                let is_over = match part {
                    Part::Below => 0.0 < until,
                    Part::UpTo => 0.0 <= until,
                };
                f64::from(u8::from(is_over))
            };
            p += act.midway * weight * has_failed;
        }
        badly.push(p * failed.share);
    }
    Some(Ends {
        well: (1.0 - act.at_end - act.midway) * all,
        badly,
    })
}

/// So much earlier than a time; a multiple of the resolution stays one, whatever is rounded.
fn earlier(time: f64, by: f64, resolution: f64) -> f64 {
    if by <= 0.0 {
        return time;
    }
    let steps = (time - by) / resolution;
    let whole = steps.round();
    if (steps - whole).abs() < 1e-6 {
        whole / (1.0 / resolution)
    } else {
        time - by
    }
}
