//! The bound from above where everything happens at [known times](super): an action that is ready to end
//! may end at any time at which something happens or gets ready.
//!
//! Most had best end at once. An end that is put off comes right before something that it would have been in the way
//! of, or it never comes. So where nothing of the kind can come about any more while the action is
//! under way, the agent ends it or lets it go before it does anything else.

use indexmap::{IndexMap, IndexSet};

use crate::timed::Side;
use crate::timed::above::{Coming, forced, revealed};
use crate::timed::chances::Chances;
use crate::timed::failures::Ending;
use crate::timed::graph::{Choice, Expansion, Hopes, Layers, Nodes, Target};
use crate::timed::state::{Phase, State};
use crate::timed::world::{Facts, TimedWorld};

use super::waiting::may_be_better_later;

/// See [the module](self).
pub(in crate::timed) struct Stretched<'a> {
    world: &'a TimedWorld,
    chances: &'a Chances,
}

/// A state within a cell, with the events that are still to come in it.
type Moment = (State, Coming);

/// Whether an end has a reason to wait, by facts, what is under way, what has happened, and the end.
type Reasons = IndexMap<(Facts, u64, u32, usize, Ending), bool>;

/// What is being put together of one cell.
struct Cell<'c> {
    bound: &'c Stretched<'c>,
    number: usize,
    /// After the nodes of the cell's beginning.
    moments: IndexSet<Moment>,
    first: usize,
    later: &'c mut Layers,
    hopes: &'c mut Hopes,
    reasons: Reasons,
}

impl<'a> Stretched<'a> {
    pub(in crate::timed) fn new(world: &'a TimedWorld, chances: &'a Chances) -> Self {
        Self { world, chances }
    }
}

impl Expansion for Stretched<'_> {
    fn cells(&self) -> usize {
        self.chances.cells
    }

    fn initial(&self) -> Vec<(f64, State)> {
        vec![(1.0, State::initial(self.world))]
    }

    fn expand(
        &self,
        cell: usize,
        states: &IndexSet<State>,
        later: &mut Layers,
        hopes: &mut Hopes,
        most: usize,
    ) -> Option<Nodes> {
        let mut here = Cell {
            bound: self,
            number: cell,
            moments: IndexSet::new(),
            first: states.len(),
            later,
            hopes,
            reasons: Reasons::new(),
        };
        let mut nodes = Nodes::of(cell);
        for state in states {
            let revealed = revealed(self.world, self.chances, cell, state).into_iter();
            let ways = revealed.map(|(p, moment)| (p, vec![here.target(moment)]));
            nodes.push(vec![ways.collect()]);
        }
        let mut done = 0;
        while let Some(moment) = here.moments.get_index(done).cloned() {
            if nodes.len() >= most {
                return None;
            }
            nodes.push(here.choices(&moment));
            done += 1;
        }
        Some(nodes)
    }

    fn last(&self, state: &State) -> f64 {
        // Whoever may still get there, does.
        let (under_way, happened) = (state.under_way(), state.happened);
        f64::from(u8::from(self.world.is_hopeful(
            state.facts,
            under_way,
            happened,
        )))
    }
}

impl Cell<'_> {
    fn target(&mut self, moment: Moment) -> Target {
        let world = self.bound.world;
        let moment = forced(world, moment);
        if world.goal.hold(moment.0.facts) {
            return Target::Won;
        }
        if !moment.0.is_hopeful(world, self.hopes) {
            return Target::Lost;
        }
        Target::here(self.first + self.moments.insert_full(moment).0)
    }

    fn choices(&mut self, moment: &Moment) -> Vec<Choice> {
        let world = self.bound.world;
        let (state, coming) = moment;
        let startable = state.startable(world);
        if state.must_start(world, &startable) {
            return vec![self.start(state, *coming, startable[0])];
        }
        if let Some(act) = startable
            .iter()
            .find(|act| self.starts_for_nothing(state, **act))
        {
            return vec![self.start(state, *coming, *act)];
        }
        let mut choices: Vec<Choice> = Vec::new();
        for (place, running) in state.running.iter().enumerate() {
            let Phase::Ready(ending) = running.phase else {
                continue;
            };
            let act = usize::from(running.act);
            let end = (place, ending);
            if !self.has_reason_to_wait(state, act, ending) {
                let mut only = vec![self.end(state, *coming, end)];
                if world.may_gain_by_cancelling(act) {
                    only.push(self.without(state, *coming, place));
                }
                return only;
            }
            choices.push(self.end(state, *coming, end));
        }
        for event in 0..world.events.len() {
            if coming.must & (1 << event) != 0 && !world.is_best_last(event) {
                let after = (state.changed(world, event), coming.without(event));
                choices.push(vec![(1.0, vec![self.target(after)])]);
            }
        }
        for act in startable {
            choices.push(self.start(state, *coming, act));
        }
        // Letting something go is only of use for beginning it anew.
        for (place, running) in state.running.iter().enumerate() {
            let act = usize::from(running.act);
            let is_of_use = !world.acts[act].start.does_nothing() || world.acts[act].has_chances();
            if is_of_use
                && world.may_gain_by_cancelling(act)
                && world.acts[act].start.needs.hold(state.facts)
            {
                let mut without = state.clone();
                without.running.remove(place);
                choices.push(self.start(&without, *coming, act));
            }
        }
        // Harm for good is best done last.
        let (mut after, mut left) = (state.clone(), *coming);
        for event in 0..world.events.len() {
            if coming.must & (1 << event) != 0 && world.is_best_last(event) {
                after = after.changed(world, event);
                left = left.without(event);
            }
        }
        if left.must == 0 {
            choices.push(vec![(1.0, vec![self.pass(after)])]);
        }
        choices
    }

    /// Whether an action had best be started as soon as one can: its start does nothing, and where it may end as late as
    /// one likes and be let go, there is nothing to lose.
    fn starts_for_nothing(&self, state: &State, act: usize) -> bool {
        let act = &self.bound.world.acts[act];
        let rest = act.rest.as_ref();
        act.start.does_nothing() && rest.is_some_and(|(over_all, _)| over_all.hold(state.facts))
    }

    fn end(&mut self, state: &State, coming: Coming, (place, ending): (usize, Ending)) -> Choice {
        let after = state.ended(self.bound.world, place, ending);
        vec![(1.0, vec![self.target((after, coming))])]
    }

    fn without(&mut self, state: &State, coming: Coming, place: usize) -> Choice {
        let mut after = state.clone();
        after.running.remove(place);
        vec![(1.0, vec![self.target((after, coming))])]
    }

    /// An action starts, which may be ready at once.
    fn start(&mut self, state: &State, coming: Coming, act: usize) -> Choice {
        let world = self.bound.world;
        let ways: Vec<_> = match world.acts[act].rest {
            Some(_) => self.bound.chances.ends[act][0]
                .ways(&world.acts[act])
                .collect(),
            None => vec![(1.0, None)],
        };
        let ways = ways.into_iter().filter(|(p, _)| *p > 0.0);
        let ways = ways.map(|(p, ending)| {
            let phase = ending.map_or(Phase::Goes, Phase::Ready);
            let after = state.started(world, act, self.number, phase);
            (p, vec![self.target((after, coming))])
        });
        ways.collect()
    }

    /// Nothing more is done until something may happen.
    fn pass(&mut self, mut state: State) -> Target {
        // When what is ready began does not matter any more.
        for running in &mut state.running {
            if running.phase != Phase::Goes {
                running.since = 0;
            }
        }
        state.running.sort_unstable();
        let (world, chances) = (self.bound.world, self.bound.chances);
        let Some(cell) = chances.next(&state, self.number + 1) else {
            return Target::Lost;
        };
        let has_hope = state.is_hopeful(world, self.hopes)
            && chances.is_in_time(world, &state, cell, Side::Above);
        if has_hope {
            Target::later(self.later, cell, state)
        } else {
            Target::Lost
        }
    }

    /// Whether an end may be better after something that can come about while its action is under way.
    fn has_reason_to_wait(&mut self, state: &State, act: usize, ending: Ending) -> bool {
        let key = (
            state.facts | self.bound.world.tested,
            state.under_way(),
            state.happened,
            act,
            ending,
        );
        let world = self.bound.world;
        *self
            .reasons
            .entry(key)
            .or_insert_with(|| may_be_better_later(world, key))
    }
}
