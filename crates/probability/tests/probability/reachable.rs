//! Optimal values on reachable states, compared with the table of all states and with closed forms.

use crate::reference::random::{Case, Taste, case, with_failing_ends, with_outcomes};
use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_probability::optimum::{Perturbed, Settings, ValueBounds, best_value, value_bounds};
use elbowroom_probability::{
    Likelihoods, Model, SearchState, Semantics, all_actions_under, likelihoods,
};
use rand::Rng;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const TASTE: Taste = Taste {
    facts: 3,
    actions: 3,
    couples: false,
    negations: true,
    is_easy: true,
    timed: false,
    numbers: false,
};

/// Returns a random problem. In half of them, no fact changes by itself; in a third of them, initial
/// facts are uncertain.
fn random_case(rng: &mut ChaCha8Rng, round: usize) -> Case {
    let mut case = case(rng, TASTE);
    if round % 3 == 1 {
        case = with_failing_ends(rng, case);
    }
    if round % 5 == 1 {
        case = with_outcomes(rng, case);
    }
    if round.is_multiple_of(2) {
        let likelihoods = &mut case.likelihoods;
        likelihoods.defaults.becomes_true = Some(0.0);
        likelihoods.defaults.becomes_false = Some(0.0);
        let entries = likelihoods.predicates.values_mut();
        for entry in entries.chain(likelihoods.facts.values_mut()) {
            entry.becomes_true = entry.becomes_true.map(|_| 0.0);
            entry.becomes_false = entry.becomes_false.map(|_| 0.0);
        }
    }
    case.circumstances = SearchState::initial(&case.task);
    if round.is_multiple_of(3) {
        for fact in case.facts().collect::<Vec<_>>() {
            let probability = [0.0, 0.3, 1.0][rng.random_range(0..3)];
            case.circumstances.belief.set(fact, probability);
        }
    }
    case
}

#[test]
fn value_on_reachable_states_equals_table_of_all_states() {
    let mut rng = ChaCha8Rng::seed_from_u64(46);
    let (mut between, mut wide) = (0, 0);
    for round in 0..3000 {
        let case = random_case(&mut rng, round);
        let model = Model::new(
            case.task.clone(),
            case.plan.clone(),
            &case.likelihoods,
            Semantics::World,
        );
        let model = model.unwrap();
        let settings = Settings {
            most_running: 3,
            enforces_over_all: round % 4 < 2,
            ..Settings::default()
        };
        let process = Perturbed::new(model.clone(), settings.clone()).unwrap();
        let value = process.optimum().value(&process, &case.circumstances);
        let bounds = |nodes| value_bounds(&model, &settings, &case.circumstances, nodes).unwrap();
        let exact = bounds(100_000);
        assert!(exact.is_exact(), "{exact:?} {}", case.text);
        // Both stop when a sweep adds at most 1e-12.
        assert!(
            (exact.lower - value).abs() < 1e-8,
            "{round}: {exact:?} {value} {}",
            case.text
        );
        between += usize::from(value > 0.01 && value < 0.99);
        let partial = bounds(rng.random_range(1..30));
        assert!(
            partial.lower < value + 1e-8 && value < partial.upper + 1e-8,
            "{round}: {partial:?} {value} {}",
            case.text
        );
        wide += usize::from(!partial.is_exact());
    }
    assert!(between > 200, "{between}");
    assert!(wide > 100, "{wide}");
}

fn read_task(domain: &str, problem: &str) -> Task {
    let (domain, problem) = (
        Source::new("domain", domain),
        Source::new("problem", problem),
    );
    Task::new(read_problem(&domain, &problem).unwrap().0)
}

/// Robots that each have to visit all rooms of a row. A move that fails leaves its robot where it
/// was, or, with probability `lost`, nowhere.
struct Corridors {
    robots: usize,
    rooms: usize,
    lost: f64,
}

impl Corridors {
    fn value(&self, entries: &str) -> ValueBounds {
        let (task, likelihoods) = self.read(entries);
        let actions = all_actions_under(&task, &likelihoods).unwrap();
        let initial = SearchState::initial_with_beliefs(&task, &likelihoods);
        best_value(&task, actions, &likelihoods, &initial).unwrap()
    }

    /// Returns the problem with actions and facts of this shape.
    fn read(&self, entries: &str) -> (Task, Likelihoods) {
        use std::fmt::Write;
        let domain = "(define (domain rooms) (:types robot room)
            (:predicates (at ?r - robot ?p - room) (visited ?r - robot ?p - room) (door ?p ?q - room))
            (:durative-action move :parameters (?r - robot ?p ?q - room) :duration (= ?duration 2)
             :condition (and (at start (at ?r ?p)) (at start (door ?p ?q)))
             :effect (and (at start (not (at ?r ?p))) (at end (at ?r ?q)) (at end (visited ?r ?q)))))";
        let (mut init, mut goal) = (String::new(), String::new());
        for robot in 0..self.robots {
            let _ = write!(init, "(at r{robot} p0)");
            for room in 1..self.rooms {
                let _ = write!(goal, "(visited r{robot} p{room})");
            }
        }
        for room in 1..self.rooms {
            let (near, far) = (room - 1, room);
            let _ = write!(init, "(door p{near} p{far})(door p{far} p{near})");
        }
        let names = |prefix: &str, count| {
            let names = (0..count).map(|i| format!("{prefix}{i}"));
            names.collect::<Vec<_>>().join(" ")
        };
        let problem = format!(
            "(define (problem p) (:domain rooms) (:objects {} - robot {} - room)
             (:init {init}) (:goal (and {goal})))",
            names("r", self.robots),
            names("p", self.rooms)
        );
        let task = read_task(domain, &problem);
        let text = format!(
            "format = \"elbowroom-likelihoods\"\nversion = 1\n[defaults]\nbecomes_true = 0.0
             becomes_false = 0.0\nstart = 0.9\neffect = 1.0\n[actions.move]\nend = 0.8\nundone = true
             [[actions.move.outcome]]\nprobability = {}\nbecomes_false = [\"(at ?r ?p)\"]\n{entries}",
            self.lost
        );
        let likelihoods = likelihoods::read(text.as_str(), &task).unwrap();
        (task, likelihoods)
    }

    /// Each move is repeated until it succeeds, or its robot is lost.
    fn closed_form(&self) -> f64 {
        let step = 0.8 / (0.8 + 0.2 * self.lost);
        let exponent = i32::try_from(self.robots * (self.rooms - 1)).unwrap();
        step.powi(exponent)
    }
}

#[test]
fn robots_in_rooms_have_the_value_of_the_closed_form() {
    for (robots, rooms) in [(1, 6), (1, 100), (2, 20), (4, 10), (10, 5)] {
        let world = Corridors {
            robots,
            rooms,
            lost: 0.1,
        };
        let value = world.value("");
        let expected = world.closed_form();
        assert!(value.is_exact(), "{robots} {rooms}: {value:?}");
        assert!(
            (value.lower - expected).abs() < 1e-9,
            "{robots} {rooms}: {value:?} {expected}"
        );
    }
}

#[test]
fn facts_that_change_by_themselves_couple_the_robots() {
    let world = Corridors {
        robots: 2,
        rooms: 2,
        lost: 0.1,
    };
    let alone = Corridors { robots: 1, ..world };
    let closing = "[facts.door]\nbecomes_true = 0.0\nbecomes_false = 0.05\n";
    let (alone, both) = (alone.value(closing), world.value(closing));
    assert!(alone.is_exact() && both.is_exact(), "{alone:?} {both:?}");
    // The door may close while the first robot moves.
    assert!(
        both.lower < alone.lower.powi(2) - 0.01,
        "{alone:?} {both:?}"
    );
}

#[test]
fn large_coupled_world_has_bounds() {
    let world = Corridors {
        robots: 3,
        rooms: 5,
        lost: 0.0,
    };
    let closing = "[facts.door]\nbecomes_true = 0.0\nbecomes_false = 0.01\n";
    let bounds = world.value(closing);
    assert!(!bounds.is_exact(), "{bounds:?}");
    assert!(0.0 <= bounds.lower && bounds.lower < bounds.upper && bounds.upper <= 1.0);
    let again = world.value(closing);
    assert_eq!(bounds, again);
}

#[test]
fn extreme_goals_have_certain_values() {
    let domain = "(define (domain d) (:predicates (a) (b) (c))
        (:durative-action make :parameters () :duration (= ?duration 1)
         :condition (at start (a)) :effect (at end (b))))";
    let value = |init: &str, goal: &str, start: f64, with_actions: bool| {
        let problem = format!("(define (problem p) (:domain d) (:init {init}) (:goal {goal}))");
        let task = read_task(domain, &problem);
        let mut likelihoods = Likelihoods::certain();
        likelihoods.defaults.start = Some(start);
        let actions = if with_actions {
            all_actions_under(&task, &likelihoods).unwrap()
        } else {
            Vec::new()
        };
        let initial = SearchState::initial(&task);
        let bounds = best_value(&task, actions, &likelihoods, &initial).unwrap();
        (bounds.lower, bounds.upper)
    };
    // The goal holds at first, with and without actions.
    assert_eq!(value("(b)", "(b)", 0.5, true), (1.0, 1.0));
    assert_eq!(value("(b)", "(b)", 0.5, false), (1.0, 1.0));
    assert_eq!(value("", "(and)", 0.5, true), (1.0, 1.0));
    // No action makes the goal true, or there is no action.
    assert_eq!(value("(a)", "(c)", 0.5, true), (0.0, 0.0));
    assert_eq!(value("(a)", "(b)", 0.5, false), (0.0, 0.0));
    // Actions that never start, and actions that start after some attempts.
    assert_eq!(value("(a)", "(b)", 0.0, true), (0.0, 0.0));
    assert_eq!(value("(a)", "(b)", 0.5, true), (1.0, 1.0));
    assert_eq!(value("(a)", "(not (a))", 0.5, true), (0.0, 0.0));
}
