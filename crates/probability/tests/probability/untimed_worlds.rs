//! The optimum of random worlds without time, compared with an independent value iteration: the
//! worlds are described once as numbers, and once as PDDL and likelihoods.

use std::fmt::Write as _;

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_plan::PartialOrderPlan;
use elbowroom_probability::optimum::{DeadEnds, Perturbed, Settings};
use elbowroom_probability::{
    Likelihoods, Model, SearchState, Semantics, all_actions_under, likelihoods,
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const FACTS: usize = 3;
const ACTIONS: usize = 3;

/// Facts by number, each with a truth value.
type Literals = Vec<(usize, bool)>;

/// A start, an end, or an instantaneous action.
#[derive(Clone, Debug, Default)]
struct Snap {
    condition: Literals,
    /// Each fact at most once.
    effects: Literals,
}

#[derive(Clone, Debug)]
struct ActionSpec {
    start: Snap,
    over_all: Literals,
    /// `None` for an instantaneous action.
    end: Option<Snap>,
    starts: f64,
    ends: f64,
    is_undone: bool,
    /// Share of the failures, and the facts that are set.
    outcome: Option<(f64, Literals)>,
}

#[derive(Clone, Debug)]
struct World {
    actions: Vec<ActionSpec>,
    /// By fact: the probabilities of becoming true and false.
    flips: Vec<(f64, f64)>,
    effect: f64,
    initial: usize,
    goal: Literals,
}

/// Generates a random list of literals: each fact with probability `share`.
fn literals(rng: &mut ChaCha8Rng, share: f64) -> Literals {
    let facts = 0..FACTS;
    let chosen = facts.filter_map(|fact| {
        let is_chosen = rng.random::<f64>() < share;
        is_chosen.then(|| (fact, rng.random::<f64>() < 0.6))
    });
    chosen.collect()
}

fn tenths(rng: &mut ChaCha8Rng, least: u32) -> f64 {
    f64::from(rng.random_range(least..=10)) / 10.0
}

fn world(rng: &mut ChaCha8Rng) -> World {
    let action = |rng: &mut ChaCha8Rng| {
        let snap = |rng: &mut ChaCha8Rng, condition: f64| Snap {
            condition: literals(rng, condition),
            effects: literals(rng, 0.4),
        };
        let is_durative = rng.random::<f64>() < 0.75;
        let ends = if is_durative { tenths(rng, 5) } else { 1.0 };
        let fails = ends < 1.0;
        ActionSpec {
            start: snap(rng, 0.4),
            over_all: if is_durative {
                literals(rng, 0.15)
            } else {
                Vec::new()
            },
            end: is_durative.then(|| snap(rng, 0.25)),
            starts: tenths(rng, 5),
            ends,
            is_undone: fails && rng.random(),
            outcome: (fails && rng.random())
                .then(|| (tenths(rng, 1), literals(rng, 0.5)))
                .filter(|(_, changes)| !changes.is_empty()),
        }
    };
    let actions = (0..ACTIONS).map(|_| action(rng)).collect();
    let flip = |rng: &mut ChaCha8Rng| {
        if rng.random::<f64>() < 0.5 {
            0.0
        } else {
            f64::from(rng.random_range(1..4)) / 20.0
        }
    };
    let mut goal = literals(rng, 0.4);
    if goal.is_empty() {
        goal = vec![(0, true)];
    }
    World {
        actions,
        flips: (0..FACTS).map(|_| (flip(rng), flip(rng))).collect(),
        effect: tenths(rng, 7),
        initial: rng.random_range(0..1 << FACTS),
        goal,
    }
}

fn is_true(state: usize, fact: usize) -> bool {
    state & (1 << fact) != 0
}

fn set(state: usize, (fact, truth): (usize, bool)) -> usize {
    if truth {
        state | (1 << fact)
    } else {
        state & !(1 << fact)
    }
}

fn holds(literals: &Literals, state: usize) -> bool {
    let mut all = literals.iter();
    all.all(|(fact, truth)| is_true(state, *fact) == *truth)
}

// The world as text.

fn pddl(literals: &Literals) -> String {
    let mut text = String::from("(and");
    for (fact, truth) in literals {
        let atom = format!("(p{fact})");
        let literal = if *truth {
            atom
        } else {
            format!("(not {atom})")
        };
        let _ = write!(text, " {literal}");
    }
    text + ")"
}

impl World {
    fn domain(&self) -> String {
        let mut text = String::from(
            "(define (domain d) (:requirements :durative-actions :negative-preconditions) (:predicates",
        );
        for fact in 0..FACTS {
            let _ = write!(text, " (p{fact})");
        }
        text.push(')');
        for (number, action) in self.actions.iter().enumerate() {
            let (condition, effects) = (pddl(&action.start.condition), pddl(&action.start.effects));
            let _ = match &action.end {
                None => write!(
                    text,
                    "(:action a{number} :parameters () :precondition {condition} :effect {effects})"
                ),
                Some(end) => write!(
                    text,
                    "(:durative-action a{number} :parameters () :duration (= ?duration 1)
                       :condition (and (at start {condition}) (over all {}) (at end {}))
                       :effect (and (at start {effects}) (at end {})))",
                    pddl(&action.over_all),
                    pddl(&end.condition),
                    pddl(&end.effects)
                ),
            };
        }
        text + ")"
    }

    fn problem(&self) -> String {
        let mut text = String::from("(define (problem p) (:domain d) (:init");
        for fact in (0..FACTS).filter(|fact| is_true(self.initial, *fact)) {
            let _ = write!(text, " (p{fact})");
        }
        let _ = write!(text, ") (:goal {}))", pddl(&self.goal));
        text
    }

    fn likelihoods(&self) -> String {
        let mut text = format!(
            "format = \"elbowroom-likelihoods\"\nversion = 1\n[defaults]\nbecomes_true = 0.0\n\
             becomes_false = 0.0\nstart = 1.0\neffect = {:?}\n",
            self.effect
        );
        for (fact, (up, down)) in self.flips.iter().enumerate() {
            let _ = write!(
                text,
                "[facts.p{fact}]\nbecomes_true = {up:?}\nbecomes_false = {down:?}\n"
            );
        }
        for (number, action) in self.actions.iter().enumerate() {
            let _ = write!(text, "[actions.a{number}]\nstart = {:?}\n", action.starts);
            if action.ends < 1.0 {
                let _ = write!(
                    text,
                    "end = {:?}\nundone = {}\n",
                    action.ends, action.is_undone
                );
            }
            if let Some((share, changes)) = &action.outcome {
                let of = |truth: bool| {
                    let own = changes.iter().filter(|(_, becomes)| *becomes == truth);
                    let own = own.map(|(fact, _)| format!("\"(p{fact})\""));
                    own.collect::<Vec<_>>().join(", ")
                };
                let _ = write!(
                    text,
                    "[[actions.a{number}.outcome]]\nprobability = {share:?}\nbecomes_true = [{}]\n\
                     becomes_false = [{}]\n",
                    of(true),
                    of(false)
                );
            }
        }
        text
    }

    fn task(&self) -> (Task, Likelihoods) {
        let (domain, problem) = (self.domain(), self.problem());
        let domain = Source::new("domain", domain.as_str());
        let problem = Source::new("problem", problem.as_str());
        let (problem, _) = read_problem(&domain, &problem).unwrap();
        let task = Task::new(problem);
        let text = self.likelihoods();
        let likelihoods = likelihoods::read(Source::new("likelihoods", text.as_str()), &task);
        let likelihoods = likelihoods.unwrap_or_else(|wrong| panic!("{text}\n{wrong:?}"));
        (task, likelihoods)
    }

    /// Returns the optimum computed by the library.
    fn optimum(&self, settings: &Settings) -> f64 {
        let (task, likelihoods) = self.task();
        let actions = all_actions_under(&task, &likelihoods).unwrap();
        let plan = PartialOrderPlan::unordered(&task, actions);
        let initial = SearchState::initial(&task);
        let model = Model::new(task, plan, &likelihoods, Semantics::World).unwrap();
        let process = Perturbed::new(model, settings.clone()).unwrap();
        process.optimum().value(&process, &initial)
    }
}

// Independent value iteration.

/// A state of the world, and the set of running actions, as bits.
type Place = (usize, usize);

const STATES: usize = 1 << FACTS;
const SETS: usize = 1 << ACTIONS;

struct Iteration<'w> {
    world: &'w World,
    enforces_over_all: bool,
    /// The distribution of the next state over spontaneous changes, by state.
    flipped: Vec<Vec<(usize, f64)>>,
    is_solvable: Vec<Vec<bool>>,
}

#[derive(Clone, Copy)]
enum Step {
    Attempt(usize),
    End(usize),
}

impl<'w> Iteration<'w> {
    fn new(world: &'w World, enforces_over_all: bool) -> Self {
        let flipped = (0..STATES).map(|state| {
            let mut all = vec![(state, 1.0)];
            for (fact, (up, down)) in world.flips.iter().enumerate() {
                let split = |(state, p): (usize, f64)| {
                    let (truth, change) = if is_true(state, fact) {
                        (true, *down)
                    } else {
                        (false, *up)
                    };
                    [
                        (state, p * (1.0 - change)),
                        (set(state, (fact, !truth)), p * change),
                    ]
                };
                all = all.into_iter().flat_map(split).collect();
                all.retain(|(_, p)| *p > 0.0);
            }
            all
        });
        let mut iteration = Self {
            world,
            enforces_over_all,
            flipped: flipped.collect(),
            is_solvable: vec![vec![false; SETS]; STATES],
        };
        iteration.solve();
        iteration
    }

    /// Returns the possible steps, without abandoning.
    fn steps(&self, (state, running): Place) -> Vec<Step> {
        let actions = self.world.actions.iter().enumerate();
        let step = |(number, action): (usize, &ActionSpec)| {
            if running & (1 << number) == 0 {
                return holds(&action.start.condition, state).then_some(Step::Attempt(number));
            }
            let end = action.end.as_ref()?;
            holds(&end.condition, state).then_some(Step::End(number))
        };
        actions.filter_map(step).collect()
    }

    /// Returns the places after a step, before spontaneous changes.
    fn after(&self, (state, running): Place, step: Step) -> Vec<(Place, f64)> {
        let (number, is_end) = match step {
            Step::Attempt(number) => (number, false),
            Step::End(number) => (number, true),
        };
        let action = &self.world.actions[number];
        let snap = match &action.end {
            Some(end) if is_end => end,
            _ => &action.start,
        };
        let success = if is_end { action.ends } else { action.starts };
        let is_instantaneous = action.end.is_none();
        let then = if is_end || is_instantaneous {
            running & !(1 << number)
        } else {
            running | (1 << number)
        };
        let mut places = vec![((state, then), success)];
        for &effect in &snap.effects {
            let split = |((state, set_then), p): (Place, f64)| {
                let done = p * self.world.effect;
                [
                    ((set(state, effect), set_then), done),
                    ((state, set_then), p - done),
                ]
            };
            places = places.into_iter().flat_map(split).collect();
        }
        let failure = 1.0 - success;
        if !is_end {
            places.push(((state, running), failure));
            return places;
        }
        let mut undone = state;
        if action.is_undone {
            for &(fact, truth) in &action.start.effects {
                undone = set(undone, (fact, !truth));
            }
        }
        let share = action.outcome.as_ref().map_or(0.0, |(share, _)| *share);
        if let Some((_, changes)) = &action.outcome {
            let left = changes
                .iter()
                .fold(undone, |state, &change| set(state, change));
            places.push(((left, then), failure * share));
        }
        places.push(((undone, then), failure * (1.0 - share)));
        places
    }

    /// Abandons the actions whose over-all condition does not hold, if that is the rule.
    fn settled(&self, (state, running): Place) -> Place {
        if !self.enforces_over_all {
            return (state, running);
        }
        let actions = self.world.actions.iter().enumerate();
        let kept = actions.filter(|(_, action)| holds(&action.over_all, state));
        let kept: usize = kept.map(|(number, _)| 1 << number).sum();
        (state, running & kept)
    }

    /// Computes the states that reach the goal without failures.
    fn solve(&mut self) {
        loop {
            let mut is_changed = false;
            for state in 0..STATES {
                for running in 0..SETS {
                    if self.is_solvable[state][running] {
                        continue;
                    }
                    let reaches = |(state, running): Place| self.is_solvable[state][running];
                    let abandons = (0..ACTIONS).any(|number| {
                        running & (1 << number) != 0 && reaches((state, running & !(1 << number)))
                    });
                    let nominal = |step: &Step| {
                        let (number, is_end) = match *step {
                            Step::Attempt(number) => (number, false),
                            Step::End(number) => (number, true),
                        };
                        let action = &self.world.actions[number];
                        let (snap, then) = match &action.end {
                            None => (&action.start, running),
                            Some(end) if is_end => (end, running & !(1 << number)),
                            Some(_) => (&action.start, running | (1 << number)),
                        };
                        let effects = snap.effects.iter();
                        reaches((effects.fold(state, |state, &it| set(state, it)), then))
                    };
                    let is_goal = running == 0 && holds(&self.world.goal, state);
                    if is_goal || abandons || self.steps((state, running)).iter().any(nominal) {
                        self.is_solvable[state][running] = true;
                        is_changed = true;
                    }
                }
            }
            if !is_changed {
                return;
            }
        }
    }

    /// Returns the optimum under a rule for dead ends.
    fn value(&self, dead_ends: DeadEnds) -> f64 {
        let layers = match dead_ends {
            DeadEnds::Patience(steps) => steps,
            DeadEnds::Harmless | DeadEnds::Lost => 1,
        };
        // With no layer left, the run is lost.
        let mut below: Option<Vec<Vec<f64>>> = None;
        for _ in 0..layers {
            let mut values = vec![vec![0.0_f64; SETS]; STATES];
            loop {
                let mut greatest = 0.0_f64;
                for state in 0..STATES {
                    for running in 0..SETS {
                        let best = self.best((state, running), &values, below.as_ref(), dead_ends);
                        greatest = greatest.max(best - values[state][running]);
                        values[state][running] = best;
                    }
                }
                if greatest < 1e-14 {
                    break;
                }
            }
            below = Some(values);
        }
        below.unwrap()[self.world.initial][0]
    }

    fn best(
        &self,
        (state, running): Place,
        values: &[Vec<f64>],
        below: Option<&Vec<Vec<f64>>>,
        dead_ends: DeadEnds,
    ) -> f64 {
        if running == 0 && holds(&self.world.goal, state) {
            return 1.0;
        }
        if dead_ends == DeadEnds::Lost && !self.is_solvable[state][running] {
            return 0.0;
        }
        let is_patient = matches!(dead_ends, DeadEnds::Patience(_));
        let landing = |place: Place| {
            let (state, running) = self.settled(place);
            if is_patient && !self.is_solvable[state][running] {
                below.map_or(0.0, |below| below[state][running])
            } else {
                values[state][running]
            }
        };
        let abandoned = (0..ACTIONS).filter(|number| running & (1 << number) != 0);
        let abandoned = abandoned.map(|number| values[state][running & !(1 << number)]);
        let stepped = self.steps((state, running)).into_iter().map(|step| {
            let after = self.after((state, running), step).into_iter();
            let expected = after.map(|((state, running), p)| {
                let flipped = self.flipped[state].iter();
                p * flipped
                    .map(|(state, p)| p * landing((*state, running)))
                    .sum::<f64>()
            });
            expected.sum::<f64>()
        });
        abandoned.chain(stepped).fold(0.0, f64::max)
    }
}

/// Compares one world under all rules. Returns two flags: it begins in a dead end, and the goal is
/// uncertain.
fn compare(seed: u64) -> (bool, bool) {
    let world = world(&mut ChaCha8Rng::seed_from_u64(seed));
    let mut is_uncertain = false;
    let mut begins_in_dead_end = false;
    for enforces_over_all in [false, true] {
        let iteration = Iteration::new(&world, enforces_over_all);
        begins_in_dead_end = !iteration.is_solvable[world.initial][0];
        for dead_ends in [
            DeadEnds::Harmless,
            DeadEnds::Lost,
            DeadEnds::Patience(1),
            DeadEnds::Patience(3),
        ] {
            let settings = Settings {
                dead_ends,
                enforces_over_all,
                ..Settings::default()
            };
            let (found, expected) = (world.optimum(&settings), iteration.value(dead_ends));
            assert!(
                (found - expected).abs() < 1e-7,
                "seed {seed}, {settings:?}: {found}, value iteration {expected}\n{}\n{}\n{}",
                world.domain(),
                world.problem(),
                world.likelihoods()
            );
            is_uncertain |= expected > 0.01 && expected < 0.99;
        }
    }
    (begins_in_dead_end, is_uncertain)
}

#[test]
fn optimum_of_random_worlds_equals_value_iteration() {
    let (mut dead_ends, mut uncertain_dead_ends, mut uncertain) = (0, 0, 0);
    // For a longer run: `UNTIMED_WORLDS=5000`.
    let worlds = std::env::var("UNTIMED_WORLDS").ok();
    let worlds = worlds.map_or(60, |worlds| worlds.parse().unwrap());
    for seed in 0..worlds {
        let (begins_in_dead_end, is_uncertain) = compare(seed);
        dead_ends += usize::from(begins_in_dead_end);
        uncertain_dead_ends += usize::from(begins_in_dead_end && is_uncertain);
        uncertain += usize::from(is_uncertain);
    }
    assert!(dead_ends > 5, "{dead_ends}");
    assert!(uncertain_dead_ends > 2, "{uncertain_dead_ends}");
    assert!(uncertain > 15, "{uncertain}");
}
