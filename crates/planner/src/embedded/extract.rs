//! Conversion of the choices of a search to a plan with times.

use std::sync::Arc;

use elbowroom_model::validate::{self, Verdict};
use elbowroom_model::{Situation, Step as PlanStep, Task, TimeTriggeredPlan, validate_from};
use elbowroom_num::{End, Rational};

use super::apply::{Log, Step, Stepper};
use super::compile::{Compiled, NONE};
use super::network::{Network, NodeId, SETTLED};
use super::root::root;
use super::state::State;
use super::symbolic::{self, Exact, KnownEnd, exact_distance, not_before};
use super::time::{NEVER, Ticks};

/// A step of the plan being built.
#[derive(Clone, Debug)]
struct Timing {
    action: u32,
    /// `None` if it was already running in the situation.
    start: Option<NodeId>,
    end: Option<NodeId>,
}

/// Number of choices replayed between two calls of `may_continue`.
const STEPS_PER_QUESTION: usize = 16;

/// Returns the plan for these choices, with every happening as early as possible. Returns `None` if
/// the validator rejects it, or `may_continue` returned `false`.
pub(crate) fn plan_of(
    task: &Task,
    situation: &Situation,
    compiled: &Compiled,
    steps: &[Step],
    may_continue: &mut dyn FnMut() -> bool,
) -> Option<(TimeTriggeredPlan, validate::Report)> {
    let mut replay = Replay::new(compiled);
    for (number, &step) in steps.iter().enumerate() {
        replay.take(step)?;
        if number % STEPS_PER_QUESTION == STEPS_PER_QUESTION - 1 && !may_continue() {
            return None;
        }
    }
    while replay.state.timed < compiled.timed_until_goal {
        replay.take(Step::Timed)?;
    }
    if replay.state.symbolic.is_some() {
        replay.stepper.reach_goal(&mut replay.state)?;
    }
    let Replay {
        stepper,
        state,
        timings,
        ..
    } = replay;
    let log = stepper.log.as_ref()?;
    let exact = Exact {
        distances: exact_distances(log),
        ends: known_ends(situation, compiled, &timings),
    };
    let times = if state.symbolic.is_none() {
        exact_times(compiled, &state.network, log, (task.epsilon(), &exact))?
    } else {
        // A linear program over all happenings can take longer than all earlier steps.
        if !may_continue() {
            return None;
        }
        symbolic::solve(&state, compiled, &exact)?
    };
    let plan = written(task, situation, compiled, &timings, &times)?;
    match validate_from(task, situation, &plan, &validate::Settings::default()) {
        Verdict::Valid(report) => Some((plan, report)),
        Verdict::Invalid(_) | Verdict::Undecided(_) => None,
    }
}

/// Replays the choices, and records the node of each happening.
struct Replay<'a> {
    stepper: Stepper<'a>,
    state: State,
    timings: Vec<Timing>,
    /// Index of the timing of each running action.
    open: Vec<usize>,
}

impl<'a> Replay<'a> {
    fn new(compiled: &'a Compiled) -> Self {
        let mut stepper = Stepper::new(compiled);
        stepper.log = Some(Log::default());
        stepper.joins = compiled.needs_joining;
        let under_way = compiled.initial.running.len();
        let timings = (0..).take(under_way).map(|action| Timing {
            action,
            start: None,
            end: None,
        });
        Self {
            stepper,
            state: root(compiled),
            timings: timings.collect(),
            open: (0..under_way).collect(),
        }
    }

    fn take(&mut self, step: Step) -> Option<()> {
        let node = NodeId::try_from(self.state.network.node_count()).ok()?;
        let (ended, foreseen_end) = match step {
            Step::End(place) => {
                let place = place as usize;
                (Some(self.open.remove(place)), self.state.open[place].end)
            }
            _ => (None, SETTLED),
        };
        self.stepper.advance(&mut self.state, step)?;
        match step {
            Step::Start(action) | Step::Compressed(action) => {
                let place = self.state.open.iter().position(|open| open.node == node);
                let is_compressed = matches!(step, Step::Compressed(_));
                self.timings.push(Timing {
                    action,
                    start: Some(node),
                    end: is_compressed.then_some(node + 1),
                });
                if let Some(place) = place {
                    self.open.insert(place, self.timings.len() - 1);
                }
            }
            Step::End(_) => {
                let is_new = foreseen_end == SETTLED;
                self.timings[ended?].end = Some(if is_new { node } else { foreseen_end });
            }
            Step::Macro(_) | Step::Timed => {}
        }
        Some(())
    }
}

/// Returns the plan with these times of its nodes.
fn written(
    task: &Task,
    situation: &Situation,
    compiled: &Compiled,
    timings: &[Timing],
    times: &[Rational],
) -> Option<TimeTriggeredPlan> {
    let at = |node: NodeId| times[node as usize].clone();
    let mut plan = TimeTriggeredPlan::default();
    for (number, timing) in timings.iter().enumerate() {
        if let Some(running) = situation.running.get(number) {
            let duration = at(timing.end?) - &running.start;
            plan.steps.push(running.step(duration));
            continue;
        }
        let action = compiled.action(timing.action);
        let start = at(timing.start?);
        let ground = task.instantiate(action.schema, &action.arguments).ok()?;
        let duration = match action.end {
            NONE => ground.durative().map(|_| Rational::ZERO),
            _ => Some(at(timing.end?) - &start),
        };
        plan.steps.push(PlanStep {
            start,
            action: Arc::new(ground),
            duration,
        });
    }
    PlanStep::sort_by_start(&mut plan.steps[situation.running.len()..]);
    Some(plan)
}

/// Returns the exact distances between starts and ends.
fn exact_distances(log: &Log) -> Vec<(NodeId, NodeId, Rational)> {
    let mut distances = Vec::new();
    for (end, start, least, most) in &log.ends {
        distances.push((*start, *end, least.clone()));
        distances.extend(most.as_ref().map(|most| (*end, *start, -most)));
    }
    distances
}

/// Returns the exact times at which the running actions may end, since their starts may be off the
/// grid. Excluded duration bounds are avoided by a tick, as in the search.
fn known_ends(situation: &Situation, compiled: &Compiled, timings: &[Timing]) -> Vec<KnownEnd> {
    let tick = compiled.scale.units(1);
    let each = situation.running.iter().zip(timings);
    let ends = each.zip(&compiled.initial.running);
    ends.filter_map(|((running, timing), rounded)| {
        let earliest = match &running.duration.lower {
            End::Closed(least) => &running.start + least,
            End::Open(least) => &running.start + least + &tick,
            End::Infinite => situation.time.clone(),
        };
        let earliest = earliest.max(situation.time.clone());
        let latest = match &running.duration.upper {
            End::Closed(most) => Some(&running.start + most),
            End::Open(most) => Some(&running.start + most - &tick),
            End::Infinite => None,
        };
        let most = rounded.most.unwrap_or(NEVER);
        Some(KnownEnd {
            node: timing.end?,
            rounded: (
                rounded.start + rounded.least,
                rounded.start.saturating_add(most).min(NEVER),
            ),
            latest: latest.map(|latest| latest.max(earliest.clone())),
            earliest,
        })
    })
    .collect()
}

/// Computes the earliest times of all happenings in exact numbers, some of which are known exactly.
///
/// If everything is on the grid, these are the network's own times. Otherwise exact durations
/// replace rounded ones, and a bound by a fixed time is moved by a tick to compensate for its
/// rounding. Happenings that can happen immediately happen at the situation's time, which may be
/// later than its tick.
fn exact_times(
    compiled: &Compiled,
    network: &Network,
    log: &Log,
    (epsilon, exact): (&Rational, &Exact),
) -> Option<Vec<Rational>> {
    let scale = compiled.scale;
    let is_on_grid = |number: &Rational| scale.exactly(number).is_some();
    let are_durations_on_grid = log
        .ends
        .iter()
        .all(|(_, _, least, most)| is_on_grid(least) && most.as_ref().is_none_or(is_on_grid));
    let is_exact = are_durations_on_grid && compiled.is_exact && is_on_grid(epsilon);
    if is_exact {
        let nodes = 0..network.node_count();
        return nodes
            .map(|node| Some(scale.units(network.earliest(NodeId::try_from(node).ok()?))))
            .collect();
    }
    let mut times: Vec<Rational> = network
        .bounds()
        .map(|(floor, _)| not_before(floor, compiled))
        .collect();
    let floors: Vec<Ticks> = network.bounds().map(|(floor, _)| floor).collect();
    for end in &exact.ends {
        let node = usize::from(end.node);
        times[node] = end.after(floors[node], compiled);
    }
    // Windows are on the grid, rounded to the inside.
    for (node, begin) in network.window_begins() {
        if begin > compiled.now {
            let time = &mut times[usize::from(node)];
            *time = std::mem::take(time).max(scale.units(begin));
        }
    }
    let of_end = |from: NodeId, to: NodeId| {
        let found = exact
            .distances
            .iter()
            .find(|known| (known.0, known.1) == (from, to));
        found.map(|known| known.2.clone())
    };
    let edges: Vec<(usize, usize, Rational)> = network
        .edges()
        .map(|(from, to, distance)| {
            let rounded = if distance == compiled.epsilon {
                epsilon.clone()
            } else {
                scale.units(distance)
            };
            let exact = match of_end(from, to) {
                Some(known) => exact_distance(&rounded, &known, compiled),
                None => rounded,
            };
            (usize::from(from), usize::from(to), exact)
        })
        .collect();
    for _ in 0..=times.len() {
        let mut changed = false;
        for (from, to, distance) in &edges {
            let time = &times[*from] + distance;
            if time > times[*to] {
                times[*to] = time;
                changed = true;
            }
        }
        if !changed {
            return Some(times);
        }
    }
    None
}
