//! Problems written as text, at time 0 and in mid-execution.

use crate::reading;
use crate::reading::task;
use crate::skipped::skipped;
use crate::survey;
use elbowroom_model::problem::{Problem, TimedInitial};
use elbowroom_model::validate::{Settings, validate, validate_from};
use elbowroom_model::{RunningAction, Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};
use elbowroom_pddl::{
    ProblemText, Source, end_times, read_plan, read_problem, write_plan, write_problem,
};
use insta::assert_snapshot;

/// Returns the problem in a normal form that does not depend on the order of its parts.
fn normalized(mut problem: Problem) -> Problem {
    problem.initial_facts.sort();
    problem.initial_facts.dedup();
    problem.initial_values.sort();
    problem.timed.sort_by_key(order);
    problem.timed.dedup();
    problem
}

fn order(timed: &TimedInitial) -> (Rational, String) {
    (timed.time.clone(), format!("{:?}", timed.change))
}

#[test]
fn benchmarks_round_trip() {
    let Some(folder) = survey::folder() else {
        skipped("there is no benchmark set; set ELBOWROOM_SHARED to its folder");
        return;
    };
    let mut count = 0;
    for row in survey::rows(&folder.join("manifest.csv")) {
        let domain = survey::source(&folder, &row[3]);
        let Ok((problem, _)) = read_problem(&domain, &survey::source(&folder, &row[4])) else {
            continue;
        };
        let expected = normalized(problem.clone());
        let task = Task::new(problem);
        let text = write_problem(&task, &Situation::initial(&task), &ProblemText::default())
            .expect("nothing is running");
        let written = Source::new("written", text);
        match read_problem(&domain, &written) {
            Ok((again, _)) => assert!(normalized(again) == expected, "{}", row[4]),
            Err(errors) => panic!("{}: {}", row[4], errors.render(false)),
        }
        count += 1;
    }
    assert!(count > 700, "only {count} were compared");
}

/// Checks the property of the benchmark test on the cases of the repository.
#[test]
fn own_cases_round_trip() {
    let cases = concat!(env!("CARGO_MANIFEST_DIR"), "/../../cases");
    let mut count = 0;
    for entry in std::fs::read_dir(cases).expect("the cases") {
        let folder = entry.expect("an entry").path();
        let domain = survey::source(&folder, "domain.pddl");
        let (problem, _) = read_problem(&domain, &survey::source(&folder, "problem.pddl"))
            .expect("a case without mistakes");
        let expected = normalized(problem.clone());
        let task = Task::new(problem);
        let text = write_problem(&task, &Situation::initial(&task), &ProblemText::default())
            .expect("nothing is running");
        let (again, _) = read_problem(&domain, &Source::new("written", text)).expect("as written");
        assert!(normalized(again) == expected, "{}", folder.display());
        count += 1;
    }
    assert!(count >= 8, "only {count} were compared");
}

/// A rover that drives, digs and charges, and a base that closes.
const ROVER: &str = "(define (domain rover)
    (:types place - object)
    (:constants base - place)
    (:predicates (at ?p - place) (open) (free) (dug ?p - place))
    (:functions (charge) (draw))
    (:durative-action drive :parameters (?a ?b - place) :duration (= ?duration 10)
      :condition (and (at start (at ?a)) (at start (free)))
      :effect (and (at start (not (at ?a))) (at start (not (free))) (at end (at ?b))
                   (at end (free)) (at end (decrease (charge) (* (draw) ?duration)))))
    (:durative-action dig :parameters (?p - place)
      :duration (and (>= ?duration 3) (<= ?duration 8))
      :condition (and (over all (at ?p)) (at start (free)))
      :effect (and (at start (not (free))) (at end (free)) (at end (dug ?p))))
    (:durative-action bask :duration (= ?duration 5)
      :effect (increase (charge) (* #t 2)))
    (:durative-action hope :duration (= ?duration 5)
      :effect (when (at end (open)) (at end (free)))))";

const TRIP: &str = "(define (problem trip) (:domain rover)
    (:objects rock - place)
    (:init (at base) (free) (open) (= (charge) 50) (= (draw) 1.5)
           (at 40 (not (open))) (at 12 (= (draw) 2)))
    (:goal (and (dug rock) (forall (?p - place) (or (open) (not (at ?p))))))
    (:metric minimize (+ (total-time) (* 2 (charge)))))";

fn rover() -> (Source, Task) {
    let domain = Source::new("rover.pddl", ROVER);
    let task = task(&domain, &Source::new("trip.pddl", TRIP));
    (domain, task)
}

/// Returns the situation at `elapsed` after the start, at 0, of the plan line's action, with the
/// changes of its start applied.
fn running_situation(task: &Task, line: &str, elapsed: i64, duration: Interval) -> Situation {
    let (plan, _) = read_plan(&Source::new("plan", line), task).expect("a plan");
    let step = plan.steps.into_iter().next().expect("one step");
    let mut state = task.initial().clone();
    let fact = |name: &str| {
        state
            .facts
            .iter()
            .copied()
            .find(|&fact| task.fact_name(fact) == name)
    };
    let gone: Vec<_> = ["(free)", "(at base)"]
        .into_iter()
        .filter(|name| *name == "(free)" || line.contains("drive"))
        .filter_map(fact)
        .collect();
    for fact in gone {
        state.facts.remove(&fact);
    }
    Situation {
        time: Rational::from(elapsed),
        state,
        running: vec![RunningAction {
            action: step.action,
            start: step.start,
            duration,
        }],
    }
}

fn written(task: &Task, situation: &Situation) -> String {
    let ends = end_times(situation, &Rational::new(1, 1000)).expect("they are to come");
    let how = ProblemText { ends, digits: None };
    write_problem(task, situation, &how).expect("it can be said")
}

#[test]
fn running_action_becomes_timed_initials_at_its_end() {
    let (_, task) = rover();
    let duration = Interval::point(Rational::from(10));
    let situation = running_situation(&task, "0: (drive base rock) [10]", 4, duration);
    assert_snapshot!(written(&task, &situation), @r"
    (define (problem trip)
    (:domain rover)
    (:objects
      rock - place
    )
    (:init
      (open)
      (= (charge) 50)
      (= (draw) 1.5)
      (at 6 (at rock))
      (at 6 (free))
      (at 6 (= (charge) 35))
      (at 8 (= (draw) 2))
      (at 36 (not (open)))
    )
    (:goal (and (dug rock) (forall (?p - place) (or (open) (not (at ?p))))))
    (:metric minimize (+ (total-time) (* 2 (charge))))
    )
    ");
}

#[test]
fn plan_for_written_problem_is_valid_from_situation() {
    let (domain, task) = rover();
    let duration = Interval::point(Rational::from(10));
    let situation = running_situation(&task, "0: (drive base rock) [10]", 4, duration);
    let text = written(&task, &situation);
    let rest = reading::task(&domain, &Source::new("rest.pddl", text));
    // The goal is evaluated at the end of the plan; the later closing of the base does not count.
    let strictness = Settings {
        counts_later_timed: false,
        ..Settings::default()
    };
    for (start, expected) in [("6.001", true), ("5.9", false), ("33.1", false)] {
        let line = format!("{start}: (dig rock) [4]");
        let (plan, _) = read_plan(&Source::new("plan", line.as_str()), &rest).unwrap();
        let verdict = validate(&rest, &plan, &strictness);
        // If the rover is not away, the base closes before the goal is evaluated.
        assert_eq!(verdict.is_valid(), expected, "{start}: {verdict:?}");

        let (mut whole, _) = read_plan(&Source::new("plan", line.as_str()), &task).unwrap();
        whole.steps[0].start += &situation.time;
        let drive = situation.running[0].step(Rational::from(10));
        whole.steps.insert(0, drive);
        let verdict = validate_from(&task, &situation, &whole, &strictness);
        assert_eq!(verdict.is_valid(), expected, "{start}: {verdict:?}");
    }
}

#[test]
fn the_earliest_possible_end_is_chosen() {
    let (_, task) = rover();
    let ends = |task: &Task, elapsed, duration| {
        let situation = running_situation(task, "0: (dig base) [3]", elapsed, duration);
        end_times(&situation, &Rational::new(1, 1000)).map(|ends| ends[0].to_decimal(4))
    };
    let between = |low: i64, high: i64| Interval::closed(low.into(), high.into());
    assert_eq!(ends(&task, 1, between(3, 8)).unwrap(), "3");
    assert_eq!(ends(&task, 5, between(3, 8)).unwrap(), "5.001");
    let late = ends(&task, 8, between(3, 8)).unwrap_err();
    assert_snapshot!(late, @"(dig base) would end now or earlier: apply its end, and plan from the resulting state");
}

#[test]
fn situation_inexpressible_by_timed_initials_is_refused_with_reason() {
    let (_, task) = rover();
    let refusal = |line: &str| {
        let situation = running_situation(&task, line, 1, Interval::point(Rational::from(5)));
        let ends = vec![Rational::from(5)];
        let how = ProblemText { ends, digits: None };
        write_problem(&task, &situation, &how).unwrap_err()
    };
    assert_snapshot!(refusal("0: (bask) [5]"), @"a problem file cannot express that (bask) is running: it changes (charge) while it runs; use the embedded planner");
    assert_snapshot!(refusal("0: (hope) [5]"), @"a problem file cannot express that (hope) is running: it is undecided whether it changes (free) at its end; use the embedded planner");
    let (_, task) = rover();
    let situation = running_situation(&task, "0: (bask) [5]", 1, Interval::point(5.into()));
    let without = write_problem(&task, &situation, &ProblemText::default()).unwrap_err();
    assert_snapshot!(without, @"1 actions are running, but 0 end times are given");
    let ends = vec![Rational::from(7)];
    let how = ProblemText { ends, digits: None };
    let impossible = write_problem(&task, &situation, &how).unwrap_err();
    assert_snapshot!(impossible, @"(bask) cannot end at 7: its duration must be [5, 5]");
}

#[test]
fn numbers_without_a_finite_decimal_are_rounded_only_on_demand() {
    let (_, task) = rover();
    let (plan, _) = read_plan(&Source::new("plan", "0: (bask) [5]"), &task).unwrap();
    assert_eq!(write_plan(&task, &plan), "0.000: (bask) [5.000]\n");
    let situation = Situation {
        time: Rational::new(1, 3),
        ..Situation::initial(&task)
    };
    let mut how = ProblemText::default();
    let exact = write_problem(&task, &situation, &how).unwrap();
    assert!(exact.contains("(at 119/3 (not (open)))"), "{exact}");
    how.digits = Some(6);
    let rounded = write_problem(&task, &situation, &how).unwrap();
    assert!(rounded.contains("(at 39.666667 (not (open)))"), "{rounded}");
}

#[test]
fn quantified_variables_get_distinct_names() {
    let domain = "(define (domain d) (:predicates (p ?a ?b)) (:constants c))";
    let goal = "(exists (?x) (and (forall (?x) (p ?x ?x)) (p ?x c)))";
    let problem = format!("(define (problem e) (:domain d) (:init) (:goal {goal}))");
    let domain = Source::new("d", domain);
    let task = task(&domain, &Source::new("p", problem));
    let text = write_problem(&task, &Situation::initial(&task), &ProblemText::default()).unwrap();
    assert!(
        text.contains("(exists (?x - object) (and (forall (?x_ - object) (p ?x_ ?x_)) (p ?x c)))"),
        "{text}"
    );
    let empty = TimeTriggeredPlan::default();
    let again = reading::task(&domain, &Source::new("w", text));
    let verdict = |task: &Task| validate(task, &empty, &Settings::default()).is_valid();
    assert_eq!(verdict(&task), verdict(&again));
}
