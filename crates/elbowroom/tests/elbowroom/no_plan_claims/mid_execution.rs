//! Random problems in the middle of their execution, with running actions that may be overdue. The
//! verifier accepts all proposed certificates, no certificate contradicts a plan, and modified
//! certificates are rejected.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom::model::ground::Change;
use elbowroom::model::validate::{Settings, validate_from};
use elbowroom::model::{RunningAction, Situation, Task};
use elbowroom::no_plan::{no_plan_certificate_from, with_any_ends};
use elbowroom::num::{Interval, Rational};
use elbowroom::pddl::read_problem;
use elbowroom::planner::{self, Answer};
use elbowroom::text::Source;
use elbowroom::verify::Exact;
use elbowroom::verify::no_plan::{ClosedState, Kind, NoPlan, verify_no_plan_from};

use crate::game::Random;
use crate::shared;

const OBJECTS: [&str; 3] = ["a", "b", "c"];

/// Problem in the middle of its execution.
struct MidExecution {
    text: String,
    task: Task,
    situation: Situation,
    is_overdue: bool,
}

fn atom(random: &mut Random, variable: &str) -> String {
    match random.below(5) {
        0 => "(q)".to_owned(),
        1 => "(r)".to_owned(),
        number => format!("(p{} {variable})", number - 2),
    }
}

fn literal(random: &mut Random, variable: &str) -> String {
    let atom = atom(random, variable);
    if random.below(3) == 0 {
        format!("(not {atom})")
    } else {
        atom
    }
}

fn action(random: &mut Random, number: usize) -> String {
    let mut conditions = String::new();
    for when in ["at start", "at start", "over all", "at end"] {
        if random.below(2) == 0 {
            let _ = write!(conditions, "({when} {}) ", literal(random, "?x"));
        }
    }
    let mut effects = String::new();
    for when in ["at start", "at end", "at end"] {
        if random.below(4) > 0 {
            let _ = write!(effects, "({when} {}) ", literal(random, "?x"));
        }
    }
    let duration = random.whole(1, 3);
    let duration = match random.below(4) {
        0 => format!(
            "(and (>= ?duration {duration}) (<= ?duration {}))",
            duration + 2
        ),
        _ => format!("(= ?duration {duration})"),
    };
    format!(
        "(:durative-action a{number} :parameters (?x - thing) :duration {duration}
           :condition (and {conditions}) :effect (and {effects}))\n"
    )
}

fn ground(random: &mut Random) -> String {
    let object = OBJECTS[random_object(random)];
    atom(random, object)
}

fn random_object(random: &mut Random) -> usize {
    random.below(OBJECTS.len())
}

/// Draws a problem with tokens that actions carry between three places. With one token too few the
/// goal is unreachable, which needs a closed set of states as its proof.
fn tokens(random: &mut Random) -> MidExecution {
    let [carry, wait] = [random.whole(1, 3), random.whole(1, 3)];
    let domain = format!(
        "(define (domain d) (:requirements :adl :durative-actions :typing :timed-initial-literals)
         (:types thing) (:predicates (p0 ?x - thing) (p1 ?x - thing) (p2 ?x - thing) (q) (r))
         (:durative-action a1 :parameters (?x - thing) :duration (= ?duration {wait})
           :condition (and (at start (r)) (at start (not (p0 ?x)))) :effect (and (at start (not (r))) (at end (p1 ?x))))
         (:durative-action a0 :parameters (?x - thing) :duration (= ?duration {carry})
           :condition (at start (p0 ?x)) :effect (and (at start (not (p0 ?x))) (at end (r))))
         (:durative-action a2 :parameters (?x - thing) :duration (= ?duration {carry})
           :condition (and (at start (r)) (over all (q)) (at start (not (p0 ?x))))
           :effect (and (at start (not (r))) (at end (p0 ?x)))))"
    );
    let mut init = "(q)".to_owned();
    for object in OBJECTS.iter().take(random.below(3)) {
        let _ = write!(init, " (p0 {object})");
    }
    if random.below(2) == 0 {
        let _ = write!(init, " (at {} (not (q)))", random.whole(1, 12));
    }
    let goal = ["(p0 a) (p0 b) (p0 c)", "(p0 a) (p0 b)", "(p0 a) (p1 b)"][random.below(3)];
    mid_execution_problem(random, &domain, &init, goal, 3)
}

fn draw(random: &mut Random) -> MidExecution {
    if random.below(4) == 0 {
        return tokens(random);
    }
    let count = 2 + random.below(3);
    let actions: String = (0..count).map(|number| action(random, number)).collect();
    let domain = format!(
        "(define (domain d) (:requirements :adl :durative-actions :typing :duration-inequalities
           :timed-initial-literals)
         (:types thing) (:predicates (p0 ?x - thing) (p1 ?x - thing) (p2 ?x - thing) (q) (r))
         {actions})"
    );
    let mut init = String::new();
    for _ in 0..random.below(4) {
        let _ = write!(init, " {}", ground(random));
    }
    let mut timed = BTreeSet::new();
    for _ in 0..random.below(3) {
        let (time, fact) = (random.whole(1, 12), ground(random));
        if timed.insert((time, fact.clone())) {
            let change = if random.below(3) > 0 {
                format!("(not {fact})")
            } else {
                fact
            };
            let _ = write!(init, " (at {time} {change})");
        }
    }
    let mut goal = String::new();
    for _ in 0..=random.below(2) {
        let _ = write!(goal, " {}", ground(random));
    }
    mid_execution_problem(random, &domain, &init, &goal, count)
}

/// Draws a situation in the middle of the execution of a problem with `count` actions.
fn mid_execution_problem(
    random: &mut Random,
    domain: &str,
    init: &str,
    goal: &str,
    count: usize,
) -> MidExecution {
    let problem = format!(
        "(define (problem p) (:domain d) (:objects a b c - thing) (:init {init}) (:goal (and {goal})))"
    );
    let sources = (
        Source::new("domain", domain),
        Source::new("problem", problem.as_str()),
    );
    let task = match read_problem(&sources.0, &sources.1) {
        Ok((read, _)) => Task::new(read),
        Err(diagnostics) => panic!("{}\n{domain}\n{problem}", diagnostics.render(false)),
    };
    let (situation, is_overdue, words) = situation(random, &task, count);
    MidExecution {
        text: format!("{domain}\n{problem}\n{words}"),
        task,
        situation,
        is_overdue,
    }
}

/// Draws a time, its facts, and up to three running actions.
fn situation(random: &mut Random, task: &Task, count: usize) -> (Situation, bool, String) {
    let mut situation = Situation::initial(task);
    situation.time = Rational::new(random.whole(0, 20), 2);
    let mut words = format!("at {}:", situation.time);
    for happening in task.timed().iter().filter(|it| it.time <= situation.time) {
        for change in &happening.changes {
            match change {
                Change::Add(fact) => drop(situation.state.facts.insert(*fact)),
                Change::Delete(fact) => drop(situation.state.facts.remove(fact)),
                Change::Update { .. } => {}
            }
        }
    }
    let mut is_overdue = false;
    let mut known = BTreeSet::new();
    for _ in 0..random.below(4) {
        let (number, object) = (random.below(count), random_object(random));
        if !known.insert((number, object)) {
            continue;
        }
        let schema = task.problem().schema(&format!("a{number}")).unwrap();
        let argument = task.problem().object(OBJECTS[object]).unwrap();
        let action = task.instantiate(schema, &[argument]).unwrap();
        let passed = Rational::new(random.whole(0, 10), 2);
        let start = &situation.time - Rational::min(passed, situation.time.clone());
        let most = random.whole(1, 4);
        is_overdue |= &situation.time - &start > Rational::from(most);
        let _ = write!(words, " {} since {start} for {most};", action.name);
        situation.running.push(RunningAction {
            action: Arc::new(action),
            start,
            duration: Interval::closed(Rational::from(most), Rational::from(most)),
        });
    }
    (situation, is_overdue, words)
}

/// Returns `true` if the planner finds a plan, which the validator accepts.
fn has_plan(task: &Task, situation: &Situation) -> bool {
    let settings = planner::Settings {
        first_plan_only: true,
        ..planner::Settings::default()
    };
    let mut turns = 0;
    let answer = planner::plan(task, situation, &settings, &mut |_| {
        turns += 1;
        if turns > 20 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let Answer::Plan { found, .. } = answer else {
        return false;
    };
    validate_from(task, situation, &found.plan, &Settings::default()).is_valid()
}

fn certificate(task: &Task, situation: &Situation) -> Result<NoPlan, String> {
    let mut left = 500;
    no_plan_certificate_from(task, situation, &mut || {
        left -= 1;
        left > 0
    })
}

/// Returns situations that differ from this one in one respect.
fn others(situation: &Situation, random: &mut Random) -> Vec<Situation> {
    let mut others = Vec::new();
    let mut note = |change: &dyn Fn(&mut Situation)| {
        let mut other = situation.clone();
        change(&mut other);
        if other != *situation {
            others.push(other);
        }
    };
    for place in 0..situation.running.len() {
        note(&|own| drop(own.running.remove(place)));
        note(&|own| {
            let passed = &own.time - &own.running[place].start;
            own.running[place].duration = Interval::at_least(passed);
        });
    }
    for fact in situation.state.facts.clone() {
        note(&|own| {
            own.state.facts.remove(&fact);
        });
    }
    let earlier = Rational::from(random.whole(1, 4));
    note(&|own| {
        own.time = Rational::max(&own.time - &earlier, Rational::ZERO);
        let time = own.time.clone();
        for running in &mut own.running {
            running.start = Rational::min(running.start.clone(), time.clone());
        }
    });
    others
}

/// Returns certificates of closed sets with one modification each. None of them is a proof.
fn forged(certificate: &NoPlan) -> Vec<NoPlan> {
    let mut all = Vec::new();
    let Some(closed) = &certificate.closed else {
        return all;
    };
    let mut note = |change: &dyn Fn(&mut Vec<ClosedState>)| {
        let mut other = certificate.clone();
        if let Some(closed) = &mut other.closed {
            change(&mut closed.states);
        }
        if other != *certificate {
            all.push(other);
        }
    };
    note(&|states| states.clear());
    for state in 0..closed.states.len().min(6) {
        note(&|states| drop(states.remove(state)));
        // Running actions never end.
        note(&|states| states[state].under_way.clear());
        for place in 0..closed.states[state].under_way.len() {
            note(&|states| {
                let least = &mut states[state].under_way[place].1;
                *least = Exact(&least.0 + &Rational::ONE);
            });
            note(&|states| {
                let own = &mut states[state].under_way[place];
                own.2 = match &own.2 {
                    None => Some(own.1.clone()),
                    Some(most) => Some(Exact(&most.0 - &Rational::ONE)),
                };
            });
        }
    }
    all
}

/// Number of random problems.
const PROBLEMS: usize = 1_500;

#[test]
fn certificates_in_mid_execution_are_sound() {
    let mut random = Random(5);
    let (mut kinds, mut reasons) = (BTreeMap::<(Kind, bool), usize>::new(), BTreeMap::new());
    let (mut solved, mut refused, mut forgeries) = (0, 0, 0);
    let n = shared::one_in::<usize>(3);
    for number in 0..PROBLEMS / n {
        let amid = draw(&mut random);
        let task = &amid.task;
        for from in [with_any_ends(&amid.situation), amid.situation.clone()] {
            let certificate = match certificate(task, &from) {
                Ok(certificate) => certificate,
                Err(why) => {
                    let is_refused = why.contains("verifier refuses");
                    assert!(!is_refused, "problem {number}: {why}\n{}", amid.text);
                    *reasons.entry(why).or_insert(0) += 1;
                    continue;
                }
            };
            *kinds
                .entry((certificate.kind(), amid.is_overdue))
                .or_default() += 1;
            assert_eq!(verify_no_plan_from(task, &from, &certificate), Ok(()));
            assert!(!has_plan(task, &from), "problem {number}\n{}", amid.text);
            for other in others(&from, &mut random) {
                if has_plan(task, &other) {
                    solved += 1;
                    let verdict = verify_no_plan_from(task, &other, &certificate);
                    assert!(
                        verdict.is_err(),
                        "problem {number}: {other:?}\n{}",
                        amid.text
                    );
                }
            }
            for other in forged(&certificate) {
                forgeries += 1;
                let verdict = verify_no_plan_from(task, &from, &other);
                refused += usize::from(verdict.is_err());
                assert!(
                    verdict.is_err(),
                    "problem {number}: {other:?}\n{certificate:?}\n{}",
                    amid.text
                );
            }
        }
    }
    println!(
        "{kinds:?}, {reasons:?}, {solved} solvable, {refused} of {forgeries} forgeries refused"
    );
    let of = |kind| kinds.get(&(kind, true)).copied().unwrap_or_default();
    assert!(
        [Kind::Reached, Kind::Apart, Kind::Closed]
            .into_iter()
            .all(|kind| of(kind) > 0),
        "{kinds:?}"
    );
    assert!(solved * n > 50 && forgeries * n > 100);
}
