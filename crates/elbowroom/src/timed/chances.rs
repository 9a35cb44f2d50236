//! In which cell what began in one ends, and in which cell what happens by itself does:
//! [`Chances`].

use elbowroom_sim::Side as Part;

use super::world::{Act, TimedWorld, unknown_shape};
use super::{NotTabulated, Side};

/// How likely it is that something happens in a cell, given that it has not before.
#[derive(Debug)]
pub(crate) struct Chances {
    /// The number of cells.
    pub(crate) cells: usize,
    /// By action and number of cells since it began: that it ends well, and that it fails.
    pub(crate) ends: Vec<Vec<(f64, f64)>>,
    /// By event and cell.
    pub(crate) events: Vec<Vec<f64>>,
    /// By event: that it has happened before anybody could do something.
    pub(crate) before: Vec<f64>,
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
                let (mut well, mut badly) = (0.0, 0.0);
                for cell in 0..=cells {
                    let until = boundary(cell + 1);
                    let ended =
                        ended(act, world, until, part, &shares).ok_or_else(unknown_shape)?;
                    let left: f64 = 1.0 - well - badly;
                    hazards.push(hazard(ended.0 - well, ended.1 - badly, left));
                    (well, badly) = ended;
                }
            }
            ends.push(hazards);
        }
        let (mut events, mut before) = (Vec::new(), Vec::new());
        for event in &world.events {
            let by = |until: f64, part| {
                let share = event.time.share(until, part, 0.0, resolution);
                // What is drawn below 0 happens at 0.
                let is_there = until > 0.0 || part == Part::UpTo;
                let share = if is_there { share } else { Some(0.0) };
                share
                    .map(|share| share * event.probability)
                    .ok_or_else(unknown_shape)
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
                hazards.push(hazard(now - happened, 0.0, 1.0 - happened).0);
                happened = now;
            }
            events.push(hazards);
        }
        Ok(Self {
            cells,
            ends,
            events,
            before,
        })
    }
}

/// Shares of what is left; where next to nothing is left, it happens now.
fn hazard(well: f64, badly: f64, left: f64) -> (f64, f64) {
    let (well, badly) = (well.max(0.0), badly.max(0.0));
    if left < 1e-13 || well + badly >= left {
        let sum = well + badly;
        return if sum > 0.0 {
            (well / sum, badly / sum)
        } else {
            (0.0, 0.0)
        };
    }
    (well / left, badly / left)
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

/// How likely an action has ended well, or failed, on that side of a time after its start.
fn ended(
    act: &Act,
    world: &TimedWorld,
    until: f64,
    part: Part,
    shares: &[(f64, f64)],
) -> Option<(f64, f64)> {
    let over = |until: f64| {
        world
            .model
            .duration_share(&act.name, &act.planned, until, part)
    };
    let all = over(until)?;
    let mut badly = act.at_end * all;
    for (share, weight) in shares {
        let has_failed = if *share > 0.0 {
            over(until / share)?
        } else {
            1.0
        };
        badly += act.midway * weight * has_failed;
    }
    Some(((1.0 - act.at_end - act.midway) * all, badly))
}
