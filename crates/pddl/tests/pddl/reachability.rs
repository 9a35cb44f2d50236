//! Actions that grounding reaches, one sentence each.

use elbowroom_model::Task;
use elbowroom_model::reachability::{Answer, Grounding, Settings, ground};
use elbowroom_pddl::{Source, read_problem};

/// A domain with one type `place`, the given predicates, functions and actions, and a problem
/// in it. The places are `a`, `b` and `c`.
struct World {
    declarations: &'static str,
    actions: &'static str,
    init: &'static str,
    goal: &'static str,
}

impl World {
    fn task(&self) -> Task {
        let domain = format!(
            "(define (domain d) (:requirements :adl :durative-actions :fluents
               :derived-predicates :timed-initial-literals :duration-inequalities)
             (:types place) (:constants a b c - place) {} {})",
            self.declarations, self.actions
        );
        let problem = format!(
            "(define (problem p) (:domain d) (:init {}) (:goal {}))",
            self.init, self.goal
        );
        let domain = Source::new("domain.pddl", domain);
        let problem = Source::new("problem.pddl", problem);
        let (problem, _) = read_problem(&domain, &problem).expect("a correct problem");
        Task::new(problem)
    }

    fn ground(&self) -> (Task, Grounding) {
        let task = self.task();
        match ground(&task, &Settings::default()) {
            Answer::Complete(grounding) => (task, grounding),
            Answer::LimitReached => panic!("the problem is small"),
        }
    }

    /// Returns the names of the reached actions.
    fn reached(&self) -> String {
        let (_, grounding) = self.ground();
        let names: Vec<_> = grounding.actions.iter().map(|a| a.name.as_str()).collect();
        names.join(" ")
    }
}

const NOTHING: World = World {
    declarations: "(:predicates (at ?p - place) (road ?p ?q - place) (lit) (seen ?p - place))",
    actions: "",
    init: "",
    goal: "(and)",
};

const GO: &str = "(:durative-action go :parameters (?p ?q - place) :duration (= ?duration 1)
    :condition (and (at start (at ?p)) (over all (road ?p ?q)))
    :effect (and (at start (not (at ?p))) (at end (at ?q))))";

#[test]
fn only_drives_on_reachable_roads_are_instantiated() {
    let world = World {
        actions: GO,
        init: "(at a) (road a b) (road c b)",
        ..NOTHING
    };
    assert_eq!(world.reached(), "(go a b)");
}

#[test]
fn static_conditions_are_dropped_from_the_action() {
    let world = World {
        actions: GO,
        init: "(at a) (road a b)",
        ..NOTHING
    };
    let (_, grounding) = world.ground();
    let body = grounding.actions[0].durative().expect("it takes time");
    assert!(body.over_all.is_trivial());
    assert!(!body.start.condition.is_trivial());
}

#[test]
fn a_timed_literal_makes_an_action_possible() {
    let world = World {
        actions: GO,
        init: "(at a) (at 5 (road a b)) (road b c)",
        ..NOTHING
    };
    assert_eq!(world.reached(), "(go a b) (go b c)");
}

#[test]
fn a_timed_deletion_makes_a_negative_condition_possible() {
    let look = "(:action look :parameters (?p - place) :precondition (not (at ?p))
        :effect (seen ?p))";
    let world = |init| World {
        actions: look,
        init,
        ..NOTHING
    };
    assert_eq!(world("(at a) (at b)").reached(), "(look c)");
    assert_eq!(
        world("(at a) (at b) (at 5 (not (at a)))").reached(),
        "(look a) (look c)"
    );
}

#[test]
fn a_derived_fact_is_reached_through_its_rules() {
    let world = World {
        declarations: "(:predicates (road ?p ?q - place) (joined ?p ?q - place) (done ?p - place))
            (:derived (joined ?p ?q - place)
                (or (road ?p ?q) (exists (?r - place) (and (road ?p ?r) (joined ?r ?q)))))",
        actions: "(:action ship :parameters (?p ?q - place) :precondition (joined ?p ?q)
            :effect (done ?q))",
        init: "(road a b) (road b c)",
        goal: "(and)",
    };
    assert_eq!(world.reached(), "(ship a b) (ship a c) (ship b c)");
}

#[test]
fn action_can_need_start_effect_of_running_action() {
    let world = World {
        actions: "(:durative-action mend :parameters () :duration (= ?duration 2)
        :condition (over all (lit)) :effect (at end (seen a)))
      (:durative-action strike :parameters () :duration (= ?duration 3)
        :condition (and) :effect (and (at start (lit)) (at end (not (lit)))))",
        ..NOTHING
    };
    assert_eq!(world.reached(), "(mend) (strike)");
}

#[test]
fn action_can_need_its_own_start_effects() {
    let world = World {
        actions: "(:durative-action burn :parameters () :duration (= ?duration 2)
            :condition (over all (lit)) :effect (and (at start (lit)) (at end (not (lit)))))",
        ..NOTHING
    };
    assert_eq!(world.reached(), "(burn)");
}

#[test]
fn effects_of_action_that_cannot_end_are_unreachable() {
    let world = World {
        actions: "(:durative-action burn :parameters () :duration (= ?duration 2)
            :condition (at end (seen a)) :effect (at start (lit)))
          (:action read :parameters () :precondition (lit) :effect (seen b))",
        goal: "(lit)",
        ..NOTHING
    };
    let (task, grounding) = world.ground();
    assert_eq!(grounding.actions, []);
    assert!(grounding.facts.is_empty());
    assert_eq!(grounding.unreachable_goals, [task.goal().clone()]);
}

#[test]
fn a_universal_condition_waits_for_its_last_instance() {
    let world = |init| World {
        actions: "(:action rest :parameters () :precondition (forall (?p - place) (seen ?p))
                :effect (lit))
            (:action look :parameters (?p - place) :precondition (at ?p) :effect (seen ?p))",
        init,
        ..NOTHING
    };
    assert_eq!(world("(at a) (at b)").reached(), "(look a) (look b)");
    assert_eq!(
        world("(at a) (at b) (at c)").reached(),
        "(rest) (look a) (look b) (look c)"
    );
}

#[test]
fn an_existential_condition_needs_one_instance() {
    let world = World {
        actions: "(:action leave :parameters (?p - place)
            :precondition (exists (?q - place) (and (at ?q) (road ?p ?q))) :effect (seen ?p))",
        init: "(at a) (at b) (road c a) (road c b) (road b c)",
        ..NOTHING
    };
    assert_eq!(world.reached(), "(leave c)");
}

#[test]
fn conditional_effect_is_reachable_once_its_condition_is() {
    let world = World {
        actions: "(:action push :parameters ()
                :effect (forall (?p - place) (when (at ?p) (seen ?p))))
            (:action rest :parameters (?p - place) :precondition (seen ?p) :effect (at b))",
        init: "(at a)",
        ..NOTHING
    };
    assert_eq!(world.reached(), "(push) (rest a) (rest b)");
}

#[test]
fn a_parameter_of_either_type_takes_objects_of_both() {
    let domain = "(define (domain d) (:requirements :typing) (:types boat car tree)
        (:predicates (ready ?v - (either boat car)))
        (:action use :parameters (?v - (either boat car)) :precondition (and)
            :effect (ready ?v)))";
    let problem = "(define (problem p) (:domain d)
        (:objects b - boat c - car t - tree) (:init) (:goal (ready b)))";
    let (domain, problem) = (Source::new("d", domain), Source::new("p", problem));
    let (problem, _) = read_problem(&domain, &problem).expect("a correct problem");
    let Answer::Complete(grounding) = ground(&Task::new(problem), &Settings::default()) else {
        panic!("the problem is small");
    };
    let names: Vec<_> = grounding.actions.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["(use b)", "(use c)"]);
}

#[test]
fn inequality_condition_excludes_equal_objects() {
    let world = World {
        actions: "(:action swap :parameters (?p ?q - place)
            :precondition (and (at ?p) (at ?q) (not (= ?p ?q))) :effect (seen ?p))",
        init: "(at a) (at b)",
        ..NOTHING
    };
    assert_eq!(world.reached(), "(swap a b) (swap b a)");
}

const FUEL: &str = "(:predicates (at ?p - place))
    (:functions (fuel) (length ?p ?q - place))";

#[test]
fn comparisons_of_constants_are_evaluated() {
    let world = World {
        declarations: FUEL,
        actions: "(:action hop :parameters (?p ?q - place)
            :precondition (and (at ?p) (< (length ?p ?q) 5)) :effect (at ?q))",
        init: "(at a) (= (length a b) 4) (= (length b c) 5)",
        goal: "(at c)",
    };
    assert_eq!(world.reached(), "(hop a b)");
    let (_, grounding) = world.ground();
    assert_eq!(grounding.unreachable_goals.len(), 1);
}

#[test]
fn changing_numbers_can_have_any_value() {
    let world = World {
        declarations: FUEL,
        actions: "(:action hop :parameters (?q - place) :precondition (>= (fuel) 5)
                :effect (and (at ?q) (decrease (fuel) 1)))
            (:action fill :parameters (?p - place) :precondition (at ?p)
                :effect (increase (fuel) 1))",
        init: "(at a) (= (fuel) 0)",
        goal: "(at c)",
    };
    assert_eq!(
        world.reached(),
        "(hop a) (hop b) (hop c) (fill a) (fill b) (fill c)"
    );
}

#[test]
fn a_duration_without_value_makes_an_action_impossible() {
    let world = World {
        declarations: FUEL,
        actions: "(:durative-action go :parameters (?p ?q - place)
            :duration (= ?duration (length ?p ?q)) :condition (at start (at ?p))
            :effect (at end (at ?q)))",
        init: "(at a) (= (length a b) 4) (= (length b c) -1)",
        goal: "(at b)",
    };
    assert_eq!(world.reached(), "(go a b)");
}

#[test]
fn action_limit_is_reported() {
    let world = World {
        actions: "(:action meet :parameters (?p ?q ?r - place) :precondition (and)
            :effect (lit))",
        ..NOTHING
    };
    let answer = |action_limit| {
        let settings = Settings {
            action_limit,
            ..Settings::default()
        };
        ground(&world.task(), &settings)
    };
    assert_eq!(answer(26), Answer::LimitReached);
    assert_ne!(answer(27), Answer::LimitReached);
}

#[test]
fn work_limit_is_reported() {
    let world = World {
        actions: "(:action meet :parameters (?p ?q ?r - place) :precondition (and (at ?p) (not (= ?q ?q)))
            :effect (lit))",
        init: "(at a)",
        ..NOTHING
    };
    let settings = Settings {
        step_limit: 3,
        ..Settings::default()
    };
    assert_eq!(world.reached(), "");
    assert_eq!(ground(&world.task(), &settings), Answer::LimitReached);
}
