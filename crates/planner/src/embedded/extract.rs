//! From the choices of a search to a plan with times.

use elbowroom_model::validate::{self, Verdict};
use elbowroom_model::{Situation, Step as PlanStep, Task, TimeTriggeredPlan, validate_from};
use elbowroom_num::Rational;

use super::answer::Settings;
use super::apply::{Step, Stepper};
use super::compile::{Compiled, NONE};
use super::network::NodeId;
use super::time::NEVER;

/// A step of the plan to be.
#[derive(Clone, Debug)]
struct Timing {
    action: u32,
    /// `None`: it was under way before.
    start: Option<NodeId>,
    end: Option<NodeId>,
    /// The duration, if it leaves no choice.
    duration: Option<Rational>,
}

/// The plan that the choices stand for, everything as early as possible; `None` if the judge does
/// not find it valid.
pub(crate) fn plan_of(
    task: &mut Task,
    situation: &Situation,
    compiled: &Compiled,
    steps: &[Step],
    settings: &Settings,
) -> Option<(TimeTriggeredPlan, validate::Report)> {
    let mut stepper = Stepper::new(compiled);
    stepper.keeps_all = true;
    let mut state = compiled.initial.clone();
    let under_way = situation.running.len();
    let mut timings: Vec<Timing> = (0..under_way)
        .map(|number| Timing {
            action: u32::try_from(number).unwrap_or(NONE),
            start: None,
            end: None,
            duration: None,
        })
        .collect();
    // For each action under way, its step.
    let mut open: Vec<usize> = (0..under_way).collect();
    for &step in steps {
        let node = NodeId::try_from(state.network.node_count()).ok()?;
        let ended = match step {
            Step::End(place) => Some(open.remove(place as usize)),
            _ => None,
        };
        stepper.advance(&mut state, step)?;
        match step {
            Step::Start(action) | Step::Whole(action) => {
                let place = state.open.iter().position(|open| open.node == node);
                let is_whole = matches!(step, Step::Whole(_));
                timings.push(Timing {
                    action,
                    start: Some(node),
                    end: is_whole.then_some(node + 1),
                    duration: None,
                });
                if let Some(place) = place {
                    timings[under_way..]
                        .last_mut()?
                        .duration
                        .clone_from(&state.open[place].duration);
                    open.insert(place, timings.len() - 1);
                }
            }
            Step::End(_) => timings[ended?].end = Some(node),
            Step::Timed => {}
        }
    }
    // The goal may need a timed initial that comes after all else: then something must wait.
    let needed = compiled
        .goal_timed
        .iter()
        .filter(|&&timed| timed < state.timed)
        .map(|&timed| compiled.timed[timed as usize].time)
        .max()
        .unwrap_or(-NEVER);
    if state.earliest_end() < needed {
        let nodes = (0..state.network.node_count()).rev();
        state.network = nodes
            .filter_map(|node| {
                let mut network = state.network.clone();
                let node = NodeId::try_from(node).ok()?;
                network.delay(node, needed).ok().map(|()| network)
            })
            .next()?;
    }
    let mut plan = TimeTriggeredPlan::default();
    for (number, timing) in timings.iter().enumerate() {
        let at = |node: NodeId| compiled.scale.units(state.network.earliest(node));
        if let Some(running) = situation.running.get(number) {
            let duration = at(timing.end?) - &running.start;
            plan.steps.push(running.step(duration));
            continue;
        }
        let action = compiled.action(timing.action);
        let start = at(timing.start?);
        let duration = match (&timing.duration, action.end) {
            (_, NONE) => None,
            (Some(duration), _) => Some(duration.clone()),
            (None, _) => Some(at(timing.end?) - &start),
        };
        let ground = task.instantiate(action.schema, &action.arguments).ok()?;
        plan.steps.push(PlanStep {
            start,
            action: ground,
            duration,
        });
    }
    plan.steps[under_way..].sort_by(|a, b| a.start.cmp(&b.start));
    let strictness = validate::Settings {
        epsilon: Some(settings.epsilon.clone()),
        ..validate::Settings::default()
    };
    match validate_from(task, situation, &plan, &strictness) {
        Verdict::Valid(report) => Some((plan, report)),
        Verdict::Invalid(_) | Verdict::Undecided(_) => None,
    }
}
