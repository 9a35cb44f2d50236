//! Each search of the portfolio by itself, and the portfolio without each technique.

use std::ops::ControlFlow;

use elbowroom_model::Situation;
use elbowroom_planner::{Answer, FoundPlan, Member, Settings, Technique, Tuning, plan};

use crate::embedded::world::{describe, task};

/// Returns a problem with a shelf that is one cell wide and `depth` deep, and a crane in front of
/// it. Boxes have to fill the shelf, so the deepest cell comes first: a box in a cell blocks the
/// cells behind it.
pub(crate) fn shelf(depth: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions)
        (:types place box) (:predicates (crane ?p - place) (next ?p ?q - place) (free ?p - place)
          (shelf ?p - place) (at ?b - box ?p - place) (held ?b - box) (empty) (stored ?b - box))
        (:durative-action move :parameters (?p ?q - place) :duration (= ?duration 1)
          :condition (and (at start (crane ?p)) (over all (next ?p ?q)) (at start (free ?q)))
          :effect (and (at start (not (crane ?p))) (at start (not (free ?q))) (at start (free ?p))
                       (at end (crane ?q))))
        (:durative-action lift :parameters (?b - box ?from ?p - place) :duration (= ?duration 2)
          :condition (and (over all (crane ?p)) (over all (next ?p ?from)) (at start (empty))
                          (at start (at ?b ?from)))
          :effect (and (at start (not (empty))) (at start (not (at ?b ?from)))
                       (at start (not (stored ?b))) (at end (free ?from)) (at end (held ?b))))
        (:durative-action drop :parameters (?b - box ?to ?p - place) :duration (= ?duration 2)
          :condition (and (over all (crane ?p)) (over all (next ?p ?to)) (at start (held ?b))
                          (at start (free ?to)) (over all (shelf ?to)))
          :effect (and (at start (not (held ?b))) (at start (not (free ?to))) (at end (at ?b ?to))
                       (at end (stored ?b)) (at end (empty))))";
    let cells: Vec<String> = (0..depth).map(|n| format!("c{n}")).collect();
    let boxes: Vec<String> = (0..depth).map(|n| format!("b{n}")).collect();
    let mut init = String::from("(crane gate) (empty) ");
    let mut row = vec!["gate".to_owned()];
    row.extend(cells.iter().cloned());
    for two in row.windows(2) {
        init += &format!("(next {0} {1})(next {1} {0})", two[0], two[1]);
    }
    for (cell, item) in cells.iter().zip(&boxes) {
        init += &format!("(free {cell})(shelf {cell})");
        init += &format!("(at {item} lot-{item})(next gate lot-{item})");
    }
    let lots: Vec<String> = boxes.iter().map(|item| format!("lot-{item}")).collect();
    let goal: String = boxes
        .iter()
        .map(|item| format!("(stored {item})"))
        .collect();
    let problem = format!(
        "(:objects gate {} {} - place {} - box) (:init {init}) (:goal (and {goal}))",
        cells.join(" "),
        lots.join(" "),
        boxes.join(" "),
    );
    (domain.to_owned(), problem)
}

/// Returns the first plan within `states` states.
fn found(domain: &str, problem: &str, tuning: Tuning, states: u64) -> Answer {
    let task = task(domain, problem);
    let situation = Situation::initial(&task);
    let settings = Settings {
        first_plan_only: true,
        tuning,
        ..Settings::default()
    };
    plan(&task, &situation, &settings, &mut |progress| {
        if progress.counts.evaluated > states {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
}

#[test]
fn each_search_finds_a_plan_by_itself() {
    let (domain, problem) = shelf(2);
    for &(member, name) in Member::ALL {
        let mut tuning = Tuning::default();
        tuning.only = Some(member);
        let answer = found(&domain, &problem, tuning, 20_000);
        assert!(answer.found().is_some(), "{name}: {}", describe(&answer));
    }
}

#[test]
fn plan_is_found_without_each_technique() {
    let (domain, problem) = shelf(3);
    for &(technique, name) in Technique::ALL {
        let mut tuning = Tuning::default();
        tuning.without.push(technique);
        let answer = found(&domain, &problem, tuning, 20_000);
        assert!(answer.found().is_some(), "{name}: {}", describe(&answer));
    }
}

/// The shelf must be filled from its end, which relaxed plans do not represent.
#[test]
fn novelty_search_fills_shelf_from_its_end() {
    let (domain, problem) = shelf(6);
    let mut tuning = Tuning::default();
    tuning.only = Some(Member::Width);
    let answer = found(&domain, &problem, tuning, 5_000);
    assert!(answer.found().is_some(), "{}", describe(&answer));
}

/// With any technique switched off, a full shelf holds no further box, and no plan is reported.
#[test]
fn overfull_shelf_is_unsolvable_without_any_technique() {
    let (domain, problem) = shelf(1);
    let more = problem
        .replace("b0 - box", "b0 spare - box")
        .replace("(:init ", "(:init (at spare lot-b0) ")
        .replace("(stored b0)", "(stored b0) (stored spare)");
    for &(technique, name) in Technique::ALL {
        let mut tuning = Tuning::default();
        tuning.without.push(technique);
        let answer = found(&domain, &more, tuning, 20_000);
        assert!(
            matches!(answer, Answer::Unsolvable { .. }),
            "{name}: {}",
            describe(&answer)
        );
    }
}

/// Relations that no action and no rule achieves stay false for all intervals.
#[test]
fn unachievable_goal_is_proved_unreachable() {
    let domain = "
        (:requirements :typing :durative-actions) (:types interval)
        (:predicates (started ?i - interval) (ended ?i - interval) (before ?i ?j - interval))
        (:functions (length ?i - interval))
        (:durative-action apply :parameters (?i - interval) :duration (= ?duration (length ?i))
          :effect (and (at start (started ?i)) (at end (ended ?i))))";
    let problem = "(:objects i j - interval) (:init (= (length i) 5) (= (length j) 5))
        (:goal (before i j))";
    let answer = found(domain, problem, Tuning::default(), 1_000);
    assert_eq!(
        describe(&answer),
        "no plan exists: `(before i j)` cannot become true"
    );
}

/// Returns a problem with robots that inspect places in any order and return to their dock. Each
/// place is open for 5 at the beginning of each period of 20.
fn inspection(robots: usize, places: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions :timed-initial-literals)
        (:types robot place)
        (:predicates (at ?r - robot ?p - place) (idle ?r - robot) (open) (seen ?p - place))
        (:durative-action move :parameters (?r - robot ?p ?q - place) :duration (= ?duration 4)
          :condition (and (at start (at ?r ?p)) (at start (idle ?r)))
          :effect (and (at start (not (at ?r ?p))) (at end (at ?r ?q))))
        (:durative-action look :parameters (?r - robot ?p - place) :duration (= ?duration 3)
          :condition (and (over all (at ?r ?p)) (at start (idle ?r)) (over all (open)))
          :effect (and (at start (not (idle ?r))) (at end (idle ?r)) (at end (seen ?p))))";
    let robots: Vec<String> = (0..robots).map(|n| format!("r{n}")).collect();
    let docks: Vec<String> = robots.iter().map(|robot| format!("d{robot}")).collect();
    let places: Vec<String> = (0..places).map(|n| format!("p{n}")).collect();
    let each = |names: &[String], text: &str| -> String {
        names.iter().map(|name| text.replace('*', name)).collect()
    };
    let opening = |n: usize| {
        format!(
            "(at {} (open)) (at {} (not (open)))",
            20 * n + 1,
            20 * n + 6
        )
    };
    let windows: String = (0..30).map(opening).collect();
    let problem = format!(
        "(:objects {} - robot {} {} - place)
         (:init {windows} {})
         (:goal (and {} {})) (:metric minimize (total-time))",
        robots.join(" "),
        docks.join(" "),
        places.join(" "),
        each(&robots, "(at * d*) (idle *) "),
        each(&robots, "(at * d*) "),
        each(&places, "(seen *) "),
    );
    (domain.to_owned(), problem)
}

/// Returns the first plan of that search.
fn serialized(member: Member, domain: &str, problem: &str) -> Answer {
    let mut tuning = Tuning::default();
    tuning.only = Some(member);
    tuning.without.push(Technique::Cleanup);
    found(domain, problem, tuning, 1_000)
}

/// Returns the number of steps whose actions begin with that text.
fn count(found: &FoundPlan, action: &str) -> usize {
    let steps = found.plan.steps.iter();
    steps
        .filter(|step| step.action.name.starts_with(action))
        .count()
}

/// A robot that returned to its dock after each place would need two moves for each of them.
#[test]
fn undone_goals_are_achieved_last() {
    let (domain, problem) = inspection(1, 12);
    let answer = serialized(Member::Serializing, &domain, &problem);
    let found = answer
        .found()
        .unwrap_or_else(|| panic!("{}", describe(&answer)));
    assert_eq!(count(found, "(move "), 13, "{}", describe(&answer));
}

#[test]
fn spreading_search_uses_idle_robots() {
    let (domain, problem) = inspection(4, 12);
    let answer = serialized(Member::Spreading, &domain, &problem);
    let found = answer
        .found()
        .unwrap_or_else(|| panic!("{}", describe(&answer)));
    for robot in ["r0", "r1", "r2", "r3"] {
        let looks = count(found, &format!("(look {robot} "));
        assert!((2..=4).contains(&looks), "{looks} of {robot}");
    }
}

/// Returns a problem with aircraft whose departure slots are short, and `crews` crews for all of
/// them. One crew could serve them one after the other, but too late.
fn turnaround(aircraft: usize, crews: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions :timed-initial-literals)
        (:types aircraft crew)
        (:predicates (free ?c - crew) (slot ?a - aircraft) (unloaded ?a - aircraft)
          (cleaned ?a - aircraft) (boarded ?a - aircraft) (gone ?a - aircraft))
        (:durative-action unload :parameters (?a - aircraft ?c - crew) :duration (= ?duration 10)
          :condition (at start (free ?c))
          :effect (and (at start (not (free ?c))) (at end (free ?c)) (at end (unloaded ?a))))
        (:durative-action clean :parameters (?a - aircraft ?c - crew) :duration (= ?duration 12)
          :condition (and (at start (free ?c)) (at start (unloaded ?a)))
          :effect (and (at start (not (free ?c))) (at end (free ?c)) (at end (cleaned ?a))))
        (:durative-action board :parameters (?a - aircraft ?c - crew) :duration (= ?duration 15)
          :condition (and (at start (free ?c)) (at start (cleaned ?a)))
          :effect (and (at start (not (free ?c))) (at end (free ?c)) (at end (boarded ?a))))
        (:durative-action depart :parameters (?a - aircraft) :duration (= ?duration 5)
          :condition (and (at start (boarded ?a)) (at start (slot ?a)))
          :effect (at end (gone ?a)))";
    let names: Vec<String> = (0..aircraft).map(|n| format!("a{n}")).collect();
    let crews: Vec<String> = (0..crews).map(|n| format!("c{n}")).collect();
    let mut init: String = crews.iter().map(|crew| format!("(free {crew})")).collect();
    for (number, name) in names.iter().enumerate() {
        let opens = 80 + 7 * number % 41;
        let closes = opens + 40;
        init += &format!("(at {opens} (slot {name})) (at {closes} (not (slot {name})))");
    }
    let goal: String = names.iter().map(|name| format!("(gone {name})")).collect();
    let problem = format!(
        "(:objects {} - aircraft {} - crew) (:init {init}) (:goal (and {goal}))",
        names.join(" "),
        crews.join(" "),
    );
    (domain.to_owned(), problem)
}

/// The relaxed plan gives the work to the last crew, and the search tries only the first one of the
/// crews that are interchangeable.
#[test]
fn preferred_steps_are_kept_for_interchangeable_objects() {
    let (domain, problem) = turnaround(12, 6);
    let mut tuning = Tuning::default();
    tuning.only = Some(Member::Spreading);
    let answer = found(&domain, &problem, tuning, 500);
    assert!(answer.found().is_some(), "{}", describe(&answer));
}

/// Returns a problem with satellites that take an image, and send it during a pass over a station
/// before they take another one. All images are to be sent by `horizon`.
fn passes(satellites: usize, images: usize, horizon: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions :timed-initial-literals)
        (:types sat target image)
        (:predicates (pointing ?s - sat ?t - target) (idle ?s - sat) (of ?i - image ?t - target)
          (empty ?s - sat) (holds ?s - sat ?i - image) (visible ?s - sat) (antenna)
          (sent ?i - image) (open))
        (:durative-action turn :parameters (?s - sat ?a ?b - target) :duration (= ?duration 4)
          :condition (and (at start (idle ?s)) (at start (pointing ?s ?a)))
          :effect (and (at start (not (idle ?s))) (at start (not (pointing ?s ?a)))
                       (at end (idle ?s)) (at end (pointing ?s ?b))))
        (:durative-action take :parameters (?s - sat ?i - image ?t - target)
          :duration (= ?duration 3)
          :condition (and (at start (idle ?s)) (over all (pointing ?s ?t))
                          (at start (of ?i ?t)) (at start (empty ?s)))
          :effect (and (at start (not (idle ?s))) (at start (not (empty ?s)))
                       (at end (idle ?s)) (at end (holds ?s ?i))))
        (:durative-action send :parameters (?s - sat ?i - image) :duration (= ?duration 4)
          :condition (and (at start (holds ?s ?i)) (at start (antenna)) (over all (visible ?s))
                          (at end (open)))
          :effect (and (at start (not (antenna))) (at start (not (holds ?s ?i)))
                       (at end (antenna)) (at end (empty ?s)) (at end (sent ?i))))";
    let targets = 6;
    let list = |kind: char, count: usize| (0..count).map(|n| format!("{kind}{n} ")).collect();
    let lists: [String; 3] = [list('s', satellites), list('t', targets), list('i', images)];
    let [sats, places, pictures] = lists;
    let mut init = String::from("(antenna) (open)");
    for sat in 0..satellites {
        init += &format!("(pointing s{sat} t0) (idle s{sat}) (empty s{sat})");
        for pass in 0..10 {
            let opens = 6 + 5 * sat + 30 * pass;
            let closes = opens + 9;
            init += &format!("(at {opens} (visible s{sat})) (at {closes} (not (visible s{sat})))");
        }
    }
    for image in 0..images {
        init += &format!("(of i{image} t{})", image * 5 % targets);
    }
    init += &format!("(at {horizon} (not (open)))");
    let goal: String = (0..images)
        .map(|image| format!("(sent i{image})"))
        .collect();
    let problem = format!(
        "(:objects {sats}- sat {places}- target {pictures}- image) (:init {init})
         (:goal (and {goal}))"
    );
    (domain.to_owned(), problem)
}

/// Best-first search revises the last choices only; plans without the horizon become shorter as a
/// whole.
#[test]
fn detour_meets_tight_horizon() {
    let (domain, problem) = passes(4, 14, 140);
    let answers = [true, false].map(|detours| {
        let mut tuning = Tuning::default();
        tuning.detour_after = 500_000_000;
        // As in searches for plans to choose from.
        tuning.without = vec![Technique::Rescheduling, Technique::Repair];
        if !detours {
            tuning.without.push(Technique::Detours);
        }
        found(&domain, &problem, tuning, 25_000)
    });
    assert!(answers[0].found().is_some(), "{}", describe(&answers[0]));
    assert!(answers[1].found().is_none(), "{}", describe(&answers[1]));
}
