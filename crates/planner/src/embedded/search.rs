//! Greedy best-first search with deferred evaluation: a successor waits in the queue under its
//! parent's estimate and is made only when its turn comes (Helmert 2006; Richter & Helmert 2009).
//!
//! Two queues take turns, one with all successors and one with the preferred ones only; whenever
//! a better estimate is found, the preferred ones get a long turn.
//!
//! A search for plans of a better metric weighs what a state has spent against what the relaxed
//! plan will still cost, and drops what cannot become better than the best plan (branch and bound).

mod doubt;
mod goals;
mod known;
mod limit;
mod novelty;
mod queue;
mod style;
mod successors;

use std::collections::VecDeque;

use super::answer::Counts;
use super::apply::{Step, Stepper};
use super::compile::Compiled;
use super::guide::Guide;
use super::hash::Map;
use super::relaxed::{Relaxed, Stock, stocks};
use super::state::{Outlook, State};
use super::symmetry::Symmetry;
use super::time::{NEVER, Ticks};
use doubt::Doubt;
pub(crate) use limit::Limit;
use novelty::Novelty;
use queue::Queue;
pub(crate) use style::{Aim, Style};

/// How many turns the preferred successors get for a better estimate.
const BOOST: i64 = 1000;

/// What a chronological search keeps of a state at most: it remembers a distance for each pair.
const MOST_UNSETTLED: u64 = 96;

/// Each turn of that number goes to the successor that has waited longest, in a complete search. So
/// it does not lose itself where an estimate is good, and endlessly many states are no goal.
const FAIRNESS: u64 = 32;

/// After how many states the stronger bound is asked about the beginning.
pub(crate) const PATIENCE: u64 = 64;

/// After how many states the stronger bound is asked about the next ones too.
const DOUBT: u64 = 512;

/// A search in progress.
#[derive(Debug)]
pub(crate) struct Search<'a> {
    compiled: &'a Compiled,
    symmetry: &'a Symmetry,
    style: Style,
    stepper: Stepper<'a>,
    relaxed: Relaxed<'a>,
    doubt: Doubt<'a>,
    has_begun: bool,
    nodes: Vec<Node>,
    /// The nodes of each discrete hash.
    known: Map<u64, Vec<u32>>,
    all: Queue,
    preferred: Queue,
    /// All successors, first come first served, in a search that has to come by everywhere.
    oldest: VecDeque<(u32, Step)>,
    turns: [i64; 2],
    best_steps: u32,
    /// The estimate of the first state.
    first_estimate: u32,
    /// What was seen before, if new states come first.
    novelty: Option<Novelty>,
    /// What is used up and not filled up, if it is to be spared.
    stocks: Vec<Stock>,
    /// Whether times are irrelevant but for their distances.
    is_timeless: bool,
    /// What steps cost, in a search for a better metric.
    guide: Option<Guide>,
    /// What plans must be better than.
    limit: Option<Limit>,
    /// Nothing may happen later, whatever it costs.
    horizon: Ticks,
    /// Whether something was dropped that could have led to a plan.
    pub(crate) has_lost: bool,
    /// How much the last turn counts for.
    price: u64,
    /// How many successors had their turn.
    drawn: u64,
    pub(crate) expanded: u64,
    pub(crate) generated: u64,
    pub(crate) evaluated: u64,
    pub(crate) memory: usize,
}

#[derive(Debug)]
struct Node {
    parent: u32,
    step: Step,
    state: State,
    /// What of the unsettled past matters, in a search that compares it exactly.
    outlook: Option<Box<Outlook>>,
    hope: Hope,
}

/// What the stronger bound says of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hope {
    /// It was not asked.
    Unknown,
    /// There may be a plan, or nobody asks any more.
    Some,
    None,
}

const ROOT: u32 = u32::MAX;

/// What a turn of the search brought.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    /// The choices that lead to a state in which the goal holds.
    Goal(Vec<Step>),
    Nothing,
    /// There is nothing left to look at.
    Over,
}

impl<'a> Search<'a> {
    pub(crate) fn new(compiled: &'a Compiled, symmetry: &'a Symmetry, style: Style) -> Self {
        let has_deadline = |most: Ticks| most < NEVER;
        let is_weighing = style.aim != Aim::Goal;
        let metric = compiled.metric.as_ref().filter(|_| is_weighing);
        let guide = metric.map(|metric| Guide::of(compiled, metric));
        let mut relaxed = Relaxed::new(compiled, style.haste);
        relaxed.is_chronological = style.is_chronological;
        if style.is_chronological && !style.is_sparing {
            relaxed.draw_on_stocks();
        }
        let mut stepper = Stepper::new(compiled);
        stepper.is_chronological = style.is_chronological;
        if style.fills_up {
            relaxed.count_resources();
        }
        if let Some(guide) = &guide {
            relaxed.weigh(guide);
        }
        let is_timeless = compiled.timed.is_empty()
            && metric.is_none_or(Limit::is_timeless)
            && !compiled
                .initial
                .open
                .iter()
                .any(|open| has_deadline(open.most));
        Self {
            compiled,
            symmetry,
            style,
            stepper,
            doubt: Doubt::new(compiled, relaxed.size()),
            relaxed,
            has_begun: false,
            nodes: Vec::new(),
            known: Map::default(),
            all: Queue::default(),
            preferred: Queue::default(),
            oldest: VecDeque::new(),
            turns: [0, 0],
            best_steps: u32::MAX,
            first_estimate: 0,
            novelty: style.seeks_novelty.then(|| Novelty::new(compiled)),
            stocks: if style.is_sparing {
                stocks(compiled)
            } else {
                Vec::new()
            },
            is_timeless,
            guide,
            limit: None,
            horizon: NEVER,
            has_lost: style.is_chronological,
            price: 1,
            drawn: 0,
            expanded: 0,
            generated: 0,
            evaluated: 0,
            memory: 0,
        }
    }

    /// From now on only plans count that end by then.
    pub(crate) fn set_horizon(&mut self, horizon: Ticks) {
        self.horizon = horizon;
        self.is_timeless = false;
    }

    /// From now on only plans count that are within the limit.
    pub(crate) fn set_limit(&mut self, limit: Limit) {
        if self.compiled.is_symbolic {
            self.stepper.limit = Some(limit.clone());
        }
        self.limit = Some(limit);
    }

    /// Whether the search claims more than it can: it has dropped or rounded something.
    pub(crate) fn is_incomplete(&self) -> bool {
        self.has_lost || self.stepper.has_rounded
    }

    /// Whether it loses plans for the sake of speed.
    pub(crate) fn is_hasty(&self) -> bool {
        !self.style.is_complete()
    }

    /// What it looks for.
    pub(crate) fn aim(&self) -> Aim {
        self.style.aim
    }

    /// Statistics.
    pub(crate) fn counts(&self) -> Counts {
        Counts {
            actions: 0,
            expanded: self.expanded,
            generated: self.generated,
            evaluated: self.evaluated,
            memory: self.memory,
        }
    }

    /// How much there is to an estimate: the number of operators.
    pub(crate) fn size(&self) -> u64 {
        self.relaxed.size()
    }

    /// How many turns the last one counts for: more where much is unsettled.
    pub(crate) fn price(&self) -> u64 {
        self.price
    }

    /// How many pairs the stronger bound has looked up.
    pub(crate) fn lookups(&self) -> u64 {
        self.doubt.lookups()
    }

    /// Looks at one more state.
    pub(crate) fn turn(&mut self) -> Turn {
        self.price = 1;
        if !std::mem::replace(&mut self.has_begun, true) {
            let initial = self.compiled.initial.clone();
            if initial.earliest_end() > self.horizon {
                return Turn::Over;
            }
            return self.visit(ROOT, Step::Timed, initial);
        }
        let entry = self.next_entry();
        let Some((parent, step)) = entry else {
            return Turn::Over;
        };
        let latest_end = self.latest_end(&self.nodes[parent as usize].state);
        if !self.looks_no_later_than(latest_end) || self.is_cut(parent) {
            return Turn::Nothing;
        }
        let Some((step, state)) = self.make(parent, step) else {
            return Turn::Nothing;
        };
        self.visit(parent, step, state)
    }

    /// Whose turn it is.
    fn next_entry(&mut self) -> Option<(u32, Step)> {
        self.drawn += 1;
        if self.drawn.is_multiple_of(FAIRNESS)
            && !self.all.is_empty()
            && let Some(oldest) = self.oldest.pop_front()
        {
            return Some(oldest);
        }
        let is_preferred_turn = self.turns[0] <= self.turns[1] && !self.preferred.is_empty();
        let queue = usize::from(!is_preferred_turn);
        self.turns[queue] += 1;
        match queue {
            0 => self.preferred.pop(),
            _ => self.all.pop().or_else(|| self.preferred.pop()),
        }
    }

    fn visit(&mut self, parent: u32, step: Step, state: State) -> Turn {
        let unsettled = state.network.node_count() as u64;
        self.price += unsettled * unsettled / (8 * (1 + self.size()));
        if self.style.is_chronological && unsettled > MOST_UNSETTLED {
            return Turn::Nothing;
        }
        let latest_end = self.latest_end(&state);
        let is_in_time = latest_end.is_some_and(|latest| state.earliest_end() <= latest);
        if !is_in_time || !self.looks_no_later_than(latest_end) {
            return Turn::Nothing;
        }
        let hash = state.discrete_hash();
        let outlook = (self.style.haste.is_none() && !state.network.is_empty())
            .then(|| Box::new(state.outlook()));
        if self.is_known(hash, &state, outlook.as_deref()) {
            return Turn::Nothing;
        }
        self.evaluated += 1;
        let Some(mut estimate) = self.relaxed.evaluate(&state) else {
            // In haste, what the relaxed plan does without may be what a plan needs.
            self.has_lost |= self.style.haste.is_some();
            return Turn::Nothing;
        };
        self.symmetry
            .thin_out(&state, self.is_timeless, &mut estimate.applicable);
        let kept = &estimate.applicable;
        estimate
            .preferred
            .retain(|step| kept.binary_search(step).is_ok());
        let number = u32::try_from(self.nodes.len()).expect("memory is used up long before");
        self.known.entry(hash).or_default().push(number);
        let outlook_size = outlook.as_ref().map_or(0, |outlook| outlook.size());
        self.memory += state.size() + outlook_size + size_of::<Node>() + 64;
        let is_goal = self.is_goal(&state);
        self.nodes.push(Node {
            parent,
            step,
            state,
            outlook,
            hope: Hope::Unknown,
        });
        // A state in which the goal holds may still have successors worth looking at: the judge can
        // refuse the plan, and another one can be better.
        self.expand(number, &estimate);
        if is_goal && self.may_be_better(number) {
            return Turn::Goal(self.steps_to(number));
        }
        Turn::Nothing
    }

    /// Whether the stronger bound shows that no plan begins like this. It is asked when the first
    /// successor of a state has its turn.
    fn is_cut(&mut self, number: u32) -> bool {
        let node = &mut self.nodes[number as usize];
        match node.hope {
            Hope::Some => return false,
            Hope::None => return true,
            Hope::Unknown => {}
        }
        if self.is_timeless || self.evaluated < DOUBT {
            return false;
        }
        self.doubt.evaluated = self.evaluated;
        self.doubt.horizon = self.stepper.horizon;
        let is_hopeless = self.doubt.is_hopeless(&node.state);
        node.hope = if is_hopeless { Hope::None } else { Hope::Some };
        is_hopeless
    }

    /// The latest time at which a plan may end that begins like this; `None` if there is none.
    fn latest_end(&self, state: &State) -> Option<Ticks> {
        let (Some(limit), Some(metric)) = (&self.limit, &self.compiled.metric) else {
            return Some(self.horizon);
        };
        let latest = limit.latest_end(metric, self.compiled.scale, state)?;
        Some(latest.min(self.horizon))
    }

    /// Sets the horizon for what follows a state. Whether anything can follow it.
    fn looks_no_later_than(&mut self, latest_end: Option<Ticks>) -> bool {
        let Some(horizon) = latest_end else {
            return false;
        };
        self.stepper.horizon = horizon;
        self.relaxed.horizon = horizon;
        true
    }
}
