//! Interchangeable objects.
//!
//! Two objects are interchangeable if swapping them leaves the problem unchanged. If a state is
//! also unchanged, a step with one of them leads to nothing that a step with the other does not
//! lead to, so only one is tried (Fox & Long, "The detection and exploitation of symmetry in
//! planning problems", IJCAI 1999).

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::problem::ObjectId;

use super::apply::Step;
use super::compile::{Action, Compiled, Macro, NONE, Snap};
use super::formula::{Formula, Linear, Literal, Numeric, is_set};
use super::hash::Map;
use super::state::State;

/// A pair of interchangeable objects.
#[derive(Clone, Debug)]
struct Exchange {
    /// The facts that are swapped.
    facts: Vec<(u32, u32)>,
    fluents: Vec<(u32, u32)>,
    /// The annotations of these facts that are swapped.
    annotations: Vec<(u32, u32)>,
    /// The actions with one of the objects, and their images; ascending.
    actions: Vec<(u32, u32)>,
}

/// The pairs of interchangeable objects of a problem.
#[derive(Clone, Debug, Default)]
pub(crate) struct Symmetry {
    exchanges: Vec<Exchange>,
    macros: Vec<Macro>,
}

impl Symmetry {
    pub(crate) fn of(task: &Task, compiled: &Compiled) -> Self {
        let problem = task.problem();
        let mut finder = Finder::new(task, compiled);
        let mut exchanges = Vec::new();
        for second in 1..problem.objects.len() {
            // Use the nearest object before this one that is interchangeable with it, so that pairs
            // form chains.
            let candidates = (0..second).rev().filter(|&first| {
                let types = |object: usize| &problem.objects[object].types;
                types(first) == types(second)
            });
            for first in candidates.take(4) {
                let pair = (ObjectId::from(first), ObjectId::from(second));
                if let Some(exchange) = finder.exchange(pair) {
                    exchanges.push(exchange);
                    break;
                }
            }
        }
        Self {
            exchanges,
            macros: compiled.macros.clone(),
        }
    }

    /// Removes steps that are equivalent to others in the list. Preferred steps are replaced by their equivalents in
    /// the list.
    pub(crate) fn thin_out(
        &self,
        state: &State,
        is_timeless: bool,
        (steps, preferred): (&mut Vec<Step>, &mut Vec<Step>),
    ) {
        // From the last object to the first one: the pairs form chains, and a preferred step moves
        // along them to the one step that is left.
        for exchange in self.exchanges.iter().rev() {
            if steps.len() < 2 {
                break;
            }
            if !exchange.preserves(state, is_timeless) {
                continue;
            }
            steps.retain(|step| match step {
                Step::Start(action) | Step::Compressed(action) => {
                    exchange.image(*action) >= *action
                }
                Step::Macro(number) => {
                    let Macro { envelope, content } = self.macros[*number as usize];
                    [envelope, content].map(|part| exchange.image(part)) >= [envelope, content]
                }
                _ => true,
            });
            for step in preferred.iter_mut() {
                if let Step::Start(action) | Step::Compressed(action) = step {
                    *action = exchange.image(*action).min(*action);
                }
            }
        }
        preferred.sort_unstable();
        preferred.dedup();
        preferred.retain(|step| steps.binary_search(step).is_ok());
    }
}

impl Exchange {
    /// Returns the image of an action.
    fn image(&self, action: u32) -> u32 {
        let found = self.actions.binary_search_by_key(&action, |pair| pair.0);
        found.map_or(action, |place| self.actions[place].1)
    }

    fn preserves(&self, state: &State, is_timeless: bool) -> bool {
        let touches = |action: u32| {
            let found = self.actions.binary_search_by_key(&action, |pair| pair.0);
            found.is_ok()
        };
        self.facts
            .iter()
            .all(|&(a, b)| is_set(&state.facts, a) == is_set(&state.facts, b))
            && self
                .fluents
                .iter()
                .all(|&(a, b)| state.values[a as usize] == state.values[b as usize])
            && state.open.iter().all(|open| !touches(open.action))
            && (is_timeless && state.network.is_empty()
                || self.annotations.iter().all(|&(a, b)| {
                    let is_marked =
                        |annotation| state.network.marks.iter().any(|m| m.0 == annotation);
                    state.annotations[a as usize] == state.annotations[b as usize]
                        && (a == b || !is_marked(a) && !is_marked(b))
                }))
            && state.symbolic.as_ref().is_none_or(|symbolic| {
                self.fluents
                    .iter()
                    .all(|&(a, _)| !symbolic.is_time_dependent(a))
            })
    }
}

/// Finds interchangeable objects.
struct Finder<'a> {
    task: &'a Task,
    compiled: &'a Compiled,
    facts: Map<(u32, Vec<ObjectId>), u32>,
    fluents: Map<(u32, Vec<ObjectId>), u32>,
    /// The forms of each action, by schema, arguments, and whether the action is durative.
    actions: Map<(u32, Vec<ObjectId>, bool), Vec<u32>>,
    budget: usize,
}

/// The permutation of facts, fluents and actions under a swap of two objects.
struct Images {
    facts: Vec<u32>,
    fluents: Vec<u32>,
}

impl<'a> Finder<'a> {
    fn new(task: &'a Task, compiled: &'a Compiled) -> Self {
        let facts = compiled.facts.iter().map(|&fact| {
            let (predicate, arguments) = task.atom(fact);
            (predicate.0, arguments)
        });
        let fluents = compiled.fluents.iter().map(|&fluent| {
            let (function, arguments) = task.application(fluent);
            (function.0, arguments)
        });
        let mut actions: Map<_, Vec<u32>> = Map::default();
        for (number, action) in (0..).zip(&compiled.actions) {
            if action.start != NONE {
                let arguments = action.arguments.clone();
                let key = (action.schema.0, arguments, action.end != NONE);
                actions.entry(key).or_default().push(number);
            }
        }
        Self {
            task,
            compiled,
            facts: facts.zip(0..).collect(),
            fluents: fluents.zip(0..).collect(),
            actions,
            budget: compiled.tuning.most_symmetry_comparisons,
        }
    }

    /// Returns the exchange of two objects, if it leaves the problem unchanged.
    fn exchange(&mut self, pair: (ObjectId, ObjectId)) -> Option<Exchange> {
        if self.budget < self.compiled.actions.len() {
            return None;
        }
        let images = Images {
            facts: images(&self.facts, pair)?,
            fluents: images(&self.fluents, pair)?,
        };
        self.preserves_goal_and_timed(&images)?;
        self.budget -= self.compiled.actions.len();
        let mut actions = Vec::new();
        for (number, action) in (0..).zip(&self.compiled.actions) {
            if action.start == NONE {
                // Running actions must not change.
                let is_touched = action.arguments.iter().any(|&o| o == pair.0 || o == pair.1);
                if is_touched {
                    return None;
                }
                continue;
            }
            let key = |arguments| (action.schema.0, arguments, action.end != NONE);
            // Both actions have their forms in the same order.
            let own = self.actions.get(&key(action.arguments.clone()))?;
            let form = own.binary_search(&number).ok()?;
            let images_of = self.actions.get(&key(swapped(&action.arguments, pair)))?;
            let image = *images_of.get(form)?;
            let other = self.compiled.action(image);
            if !images.are_alike(self.compiled, action, other) {
                return None;
            }
            if image != number {
                actions.push((number, image));
            }
        }
        let moved = |images: &[u32]| -> Vec<(u32, u32)> {
            let pairs = (0..).zip(images.iter().copied());
            pairs.filter(|(from, to)| from < to).collect()
        };
        let facts = moved(&images.facts);
        // The annotations that the actions mark, which are equal for swapped snaps.
        let mut annotations: Vec<(u32, u32)> = Vec::new();
        for &(from, to) in &actions {
            let (from, to) = (self.compiled.action(from), self.compiled.action(to));
            for (a, b) in [(from.start, to.start), (from.end, to.end)] {
                if a != NONE && b != NONE {
                    let (a, b) = (self.compiled.snap(a), self.compiled.snap(b));
                    let all = |snap: &Snap| -> BTreeSet<u32> {
                        let after = snap.after.iter().map(|entry| entry.0);
                        after.chain(snap.marks.iter().copied()).collect()
                    };
                    let (a, b) = (all(a), all(b));
                    // An exchange is its own inverse. It maps the annotations of only one snap to those of
                    // only the other.
                    for &annotation in a.difference(&b) {
                        annotations.extend(b.difference(&a).map(|&other| (annotation, other)));
                    }
                }
            }
        }
        annotations.sort_unstable();
        annotations.dedup();
        Some(Exchange {
            facts,
            fluents: moved(&images.fluents),
            annotations,
            actions,
        })
    }

    fn preserves_goal_and_timed(&self, images: &Images) -> Option<()> {
        let compiled = self.compiled;
        let is_kept = images.formula_is_kept(compiled, &compiled.goal);
        let are_kept = compiled.timed.iter().all(|timed| {
            images.preserves_facts(&timed.adds)
                && images.preserves_facts(&timed.deletes)
                && timed
                    .assigns
                    .iter()
                    .all(|(fluent, _)| images.fluents[*fluent as usize] == *fluent)
        });
        let metric = compiled.metric.as_ref();
        let is_measured_alike =
            metric.is_none_or(|metric| images.numeric_is(&metric.values, &metric.values));
        let has_rules = !self.task.rules().is_empty();
        (is_kept && are_kept && is_measured_alike && !has_rules).then_some(())
    }
}

impl Images {
    fn literal(&self, literal: Literal) -> Literal {
        Literal::new(self.facts[literal.fact() as usize], literal.truth())
    }

    fn preserves_facts(&self, facts: &[u32]) -> bool {
        self.same_facts(facts, facts)
    }

    /// Returns `true` if the image of `facts` is `others`.
    fn same_facts(&self, facts: &[u32], others: &[u32]) -> bool {
        facts.len() == others.len()
            && facts
                .iter()
                .all(|&fact| others.contains(&self.facts[fact as usize]))
    }

    fn linear(&self, linear: &Linear) -> Linear {
        let mut image = linear.clone();
        for term in &mut image.terms {
            term.0 = self.fluents[term.0 as usize];
        }
        image.terms.sort_by_key(|term| term.0);
        image
    }

    fn numeric_is(&self, numeric: &Numeric, other: &Numeric) -> bool {
        match (numeric, other) {
            (Numeric::Linear(a), Numeric::Linear(b)) => self.linear(a) == *b,
            (a, b) => {
                let mut is_fixed = true;
                a.visit_fluents(&mut |f| is_fixed &= self.fluents[f as usize] == f);
                is_fixed && a == b
            }
        }
    }

    fn formula_is_kept(&self, compiled: &Compiled, formula: &Formula) -> bool {
        self.formula_is(compiled, formula, formula)
    }

    /// Returns `true` if the image of the formula is the other formula. Formulas that are too
    /// complex to compare count as different, unless they are unchanged.
    fn formula_is(&self, compiled: &Compiled, formula: &Formula, other: &Formula) -> bool {
        let test_is = |a: u32, b: u32| {
            let (a, b) = (&compiled.tests[a as usize], &compiled.tests[b as usize]);
            a.comparison == b.comparison && self.numeric_is(&a.difference, &b.difference)
        };
        formula.literals.len() == other.literals.len()
            && formula.tests.len() == other.tests.len()
            && formula
                .literals
                .iter()
                .all(|&literal| other.literals.contains(&self.literal(literal)))
            && formula
                .tests
                .iter()
                .all(|&test| other.tests.iter().any(|&image| test_is(test, image)))
            && (formula.choices.is_empty() && other.choices.is_empty()
                || formula.choices == other.choices && self.is_formula_fixed(compiled, formula))
    }

    fn is_formula_fixed(&self, compiled: &Compiled, formula: &Formula) -> bool {
        let mut is_fixed = true;
        formula.visit_literals(&mut |literal| is_fixed &= self.literal(literal) == literal);
        formula.visit_tests(&mut |test| {
            let difference = &compiled.tests[test as usize].difference;
            difference.visit_fluents(&mut |f| is_fixed &= self.fluents[f as usize] == f);
        });
        is_fixed
    }

    fn are_alike(&self, compiled: &Compiled, action: &Action, other: &Action) -> bool {
        let (mine, theirs) = (&action.duration, &other.duration);
        mine.least == theirs.least
            && mine.most == theirs.most
            && mine.bounds.len() == theirs.bounds.len()
            && mine.bounds.iter().zip(&theirs.bounds).all(|(a, b)| {
                a.comparison == b.comparison
                    && a.at_end == b.at_end
                    && self.numeric_is(&a.value, &b.value)
            })
            && action.flows.len() == other.flows.len()
            && action.flows.iter().zip(&other.flows).all(|(a, b)| {
                self.fluents[a.fluent as usize] == b.fluent
                    && self.numeric_is(&a.rate, &b.rate)
                    && a.guard == b.guard
            })
            && (action.guards.is_empty() && other.guards.is_empty())
            && self.formula_is(compiled, &action.over_all, &other.over_all)
            && action.dates.windows == other.dates.windows
            && [(action.start, other.start), (action.end, other.end)]
                .iter()
                .all(|&(a, b)| {
                    a == NONE && b == NONE
                        || a != NONE
                            && b != NONE
                            && self.snap_is(compiled, compiled.snap(a), compiled.snap(b))
                })
    }

    fn snap_is(&self, compiled: &Compiled, snap: &Snap, other: &Snap) -> bool {
        self.formula_is(compiled, &snap.condition, &other.condition)
            && snap.dates.windows == other.dates.windows
            && self.same_facts(&snap.adds, &other.adds)
            && self.same_facts(&snap.deletes, &other.deletes)
            && snap.conditional.is_empty()
            && other.conditional.is_empty()
            && snap.before_timed == other.before_timed
            && snap.after.len() == other.after.len()
            && snap.marks.len() == other.marks.len()
            && snap.updates.len() == other.updates.len()
            && match (&snap.cost, &other.cost) {
                (Some(a), Some(b)) => self.numeric_is(a, b),
                (a, b) => a.is_none() && b.is_none(),
            }
            && snap.updates.iter().all(|a| {
                other.updates.iter().any(|b| {
                    self.fluents[a.fluent as usize] == b.fluent
                        && a.operator == b.operator
                        && self.numeric_is(&a.value, &b.value)
                })
            })
    }
}

/// Returns the images of the symbols, or `None` if an image is not a symbol.
fn images(table: &Map<(u32, Vec<ObjectId>), u32>, pair: (ObjectId, ObjectId)) -> Option<Vec<u32>> {
    let image = |(key, &number): (&(u32, Vec<ObjectId>), &u32)| {
        if key.1.iter().any(|&o| o == pair.0 || o == pair.1) {
            table.get(&(key.0, swapped(&key.1, pair))).copied()
        } else {
            Some(number)
        }
    };
    table.iter().map(image).collect()
}

fn swapped(objects: &[ObjectId], (a, b): (ObjectId, ObjectId)) -> Vec<ObjectId> {
    let image = |&object: &ObjectId| match object {
        object if object == a => b,
        object if object == b => a,
        object => object,
    };
    objects.iter().map(image).collect()
}
