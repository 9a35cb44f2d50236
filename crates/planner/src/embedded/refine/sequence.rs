//! A plan as a sequence of choices that can be cut up and put together again.

use super::super::apply::{Log, Step, Stepper};
use super::super::compile::{Compiled, NONE};
use super::super::network::Network;
use super::super::root::root;
use super::super::state::State;

/// A choice, told without reference to what else is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Item {
    pub(super) kind: Kind,
    /// [`NONE`] of timed initials.
    pub(super) action: u32,
    /// The instance of the action: its start and its end are of one block. [`NONE`] of timed
    /// initials.
    pub(super) block: u32,
}

/// The kind of a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Start,
    End,
    /// Start and end at once, or an action that takes no time.
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

/// A state, and which instances are under way in it.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    pub(super) state: State,
    /// The blocks of `state.open`.
    pub(super) open: Vec<u32>,
}

impl Scene {
    /// The beginning: what is under way are the first blocks.
    pub(super) fn beginning(compiled: &Compiled) -> Self {
        let state = root(compiled);
        let open = (0..).zip(&state.open).map(|(block, _)| block).collect();
        Self { state, open }
    }

    /// The step that an item stands for here; `None` if what should end is not under way.
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

    /// The item that a step stands for here; a new instance is `block`.
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

    /// The scene after the item, if it is possible.
    pub(super) fn after(&self, stepper: &mut Stepper<'_>, item: Item) -> Option<Self> {
        let step = self.step(stepper.compiled, item)?;
        let state = stepper.apply(&self.state, step)?;
        let mut open = self.open.clone();
        self.note(&mut open, item);
        Some(Self { state, open })
    }

    /// Keeps the list of what is under way.
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

/// The choices of a search as items.
pub(super) fn items_of(compiled: &Compiled, steps: &[Step]) -> Option<Vec<Item>> {
    let mut scene = Scene::beginning(compiled);
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

/// The items with starts and ends by themselves, so that something can come between them.
pub(super) fn split(compiled: &Compiled, items: &[Item]) -> Vec<Item> {
    let parts = items.iter().flat_map(|&item| {
        let has_end = item.kind == Kind::Whole && compiled.action(item.action).end != NONE;
        let of_kind = |kind| Item { kind, ..item };
        let first = if has_end { of_kind(Kind::Start) } else { item };
        [Some(first), has_end.then(|| of_kind(Kind::End))]
    });
    parts.flatten().collect()
}

/// A sequence that was carried out with all happenings kept.
#[derive(Debug)]
pub(super) struct Course {
    pub(super) steps: Vec<Step>,
    pub(super) state: State,
    /// For each item the nodes of what it lets happen: the first and the last.
    pub(super) nodes: Vec<(u16, u16)>,
}

impl Course {
    /// Carries out the items; `None` if that is not possible.
    pub(super) fn of(compiled: &Compiled, items: &[Item]) -> Option<Self> {
        let mut stepper = Stepper::new(compiled);
        stepper.log = Some(Log::default());
        let mut scene = Scene::beginning(compiled);
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
