//! A plan as a sequence of choices that can be split and recombined.

use super::super::apply::{Log, Step, Stepper};
use super::super::compile::{Compiled, NONE};
use super::super::network::Network;
use super::super::root::root;
use super::super::state::State;

/// A choice that does not depend on the other running actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Item {
    pub(super) kind: Kind,
    /// [`NONE`] for timed initials.
    pub(super) action: u32,
    /// The instance of the action, which its start and its end share. [`NONE`] for timed initials.
    pub(super) block: u32,
}

/// The kind of a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Start,
    End,
    /// Start and end at once, or an instantaneous action.
    Whole,
    Timed,
}

impl Item {
    pub(super) const TIMED: Self = Self {
        kind: Kind::Timed,
        action: NONE,
        block: NONE,
    };
}

/// A state, and the instances that are running in it.
#[derive(Clone, Debug)]
pub(super) struct SequenceState {
    pub(super) state: State,
    /// The blocks of `state.open`.
    pub(super) open: Vec<u32>,
}

impl SequenceState {
    /// Returns the initial scene; the running actions are the first blocks.
    pub(super) fn initial(compiled: &Compiled) -> Self {
        let state = root(compiled);
        let open = (0..).zip(&state.open).map(|(block, _)| block).collect();
        Self { state, open }
    }

    /// Returns the step of an item in this scene, or `None` if the action to end is not running.
    pub(super) fn step(&self, compiled: &Compiled, item: Item) -> Option<Step> {
        Some(match item.kind {
            Kind::Start => Step::Start(item.action),
            Kind::Whole if compiled.action(item.action).end == NONE => Step::Start(item.action),
            Kind::Whole => Step::Compressed(item.action),
            Kind::End => {
                let place = self.open.iter().position(|&block| block == item.block)?;
                Step::End(u32::try_from(place).ok()?)
            }
            Kind::Timed => Step::Timed,
        })
    }

    /// Returns the item of a step in this scene; `block` is the number of a new instance.
    pub(super) fn item(&self, compiled: &Compiled, step: Step, block: u32) -> Option<Item> {
        Some(match step {
            Step::Start(action) if compiled.action(action).end != NONE => Item {
                kind: Kind::Start,
                action,
                block,
            },
            Step::Start(action) | Step::Compressed(action) => Item {
                kind: Kind::Whole,
                action,
                block,
            },
            Step::End(place) => Item {
                kind: Kind::End,
                action: self.state.open.get(place as usize)?.action,
                block: self.open[place as usize],
            },
            Step::Macro(_) => return None,
            Step::Timed => Item::TIMED,
        })
    }

    /// Returns the scene after the item, if it is applicable.
    pub(super) fn after(&self, stepper: &mut Stepper<'_>, item: Item) -> Option<Self> {
        let step = self.step(stepper.compiled, item)?;
        let state = stepper.apply(&self.state, step)?;
        let mut open = self.open.clone();
        self.note(&mut open, item);
        Some(Self { state, open })
    }

    /// Updates the list of running instances.
    fn note(&self, open: &mut Vec<u32>, item: Item) {
        match item.kind {
            Kind::Start => {
                let others = &self.state.open;
                let place = others.partition_point(|other| other.action <= item.action);
                open.insert(place, item.block);
            }
            Kind::End => open.retain(|&block| block != item.block),
            Kind::Whole | Kind::Timed => {}
        }
    }
}

/// Returns the choices of a search as items.
pub(super) fn items_of(compiled: &Compiled, steps: &[Step]) -> Option<Vec<Item>> {
    let mut scene = SequenceState::initial(compiled);
    let mut stepper = Stepper::new(compiled);
    let first = u32::try_from(scene.open.len()).ok()?;
    let mut items = Vec::with_capacity(steps.len());
    for (block, &step) in (first..).zip(steps) {
        let item = scene.item(compiled, step, block)?;
        scene = scene.after(&mut stepper, item)?;
        items.push(item);
    }
    Some(items)
}

/// Returns the items with separate starts and ends, so that other items can be inserted between
/// them.
pub(super) fn split(compiled: &Compiled, items: &[Item]) -> Vec<Item> {
    let parts = items.iter().flat_map(|&item| {
        let has_end = item.kind == Kind::Whole && compiled.action(item.action).end != NONE;
        let of_kind = |kind| Item { kind, ..item };
        let first = if has_end { of_kind(Kind::Start) } else { item };
        [Some(first), has_end.then(|| of_kind(Kind::End))]
    });
    parts.flatten().collect()
}

/// A sequence that was applied with all happenings kept in the network.
#[derive(Debug)]
pub(super) struct AppliedSequence {
    pub(super) steps: Vec<Step>,
    pub(super) state: State,
    /// For each item, the nodes of its first and its last happening.
    pub(super) nodes: Vec<(u16, u16)>,
}

impl AppliedSequence {
    /// Applies the items. Returns `None` if one of them is inapplicable.
    pub(super) fn of(compiled: &Compiled, items: &[Item]) -> Option<Self> {
        let mut stepper = Stepper::new(compiled);
        stepper.log = Some(Log::default());
        let mut scene = SequenceState::initial(compiled);
        let (mut steps, mut nodes) = (Vec::new(), Vec::new());
        for &item in items {
            let step = scene.step(compiled, item)?;
            let before = u16::try_from(scene.state.network.node_count()).ok()?;
            let mut open = std::mem::take(&mut scene.open);
            scene.note(&mut open, item);
            scene.open = open;
            stepper.advance(&mut scene.state, step)?;
            let after = u16::try_from(scene.state.network.node_count()).ok()?;
            nodes.push((before, after.max(before + 1) - 1));
            steps.push(step);
        }
        Some(Self {
            steps,
            state: scene.state,
            nodes,
        })
    }

    pub(super) fn network(&self) -> &Network {
        &self.state.network
    }
}
