//! Random temporal problems with a valid plan. The plan is drawn first; the goal is taken from its final state.

use std::fmt::Write;

use elbowroom::model::validate::{Settings, Verdict, validate};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::pddl::{read_plan, read_problem};
use elbowroom::text::Source;

use crate::game::Random;

const FACTS: usize = 4;
const PLANS: usize = 40;

/// Problem with a plan that the validator accepts.
pub(crate) struct Solved {
    pub(crate) text: String,
    pub(crate) task: Task,
    pub(crate) plan: TimeTriggeredPlan,
}

struct Action {
    name: String,
    /// Possible durations; `None` for an instantaneous action.
    durations: Option<Vec<&'static str>>,
    text: String,
}

/// Draws a problem. Returns `None` if none of the plans drawn for it is valid, or if the valid one
/// changes nothing.
pub(crate) fn solved(random: &mut Random) -> Option<Solved> {
    let actions: Vec<Action> = (0..=random.below(3))
        .map(|number| action(random, number))
        .collect();
    let bodies: String = actions.iter().map(|own| own.text.as_str()).collect();
    let rule = match random.below(3) {
        0 => "(p0)",
        1 => "(or (p1) (and (p2) (not (p3))))",
        _ => "(exists (?x - item) (q ?x))",
    };
    let domain = format!(
        "(define (domain d) (:requirements :adl :durative-actions :fluents :derived-predicates :typing
           :duration-inequalities :continuous-effects :timed-initial-literals)
         (:types item) (:constants i j - item)
         (:predicates (p0) (p1) (p2) (p3) (q ?x - item) (derived))
         (:functions (n))
         (:derived (derived) {rule})
         {bodies})"
    );
    let init = init(random);
    let task = |goal: &str| {
        let problem =
            format!("(define (problem p) (:domain d) (:init {init}) (:goal (and {goal})))");
        let texts = (
            Source::new("domain", domain.as_str()),
            Source::new("problem", problem.as_str()),
        );
        match read_problem(&texts.0, &texts.1) {
            Ok((read, _)) => (Task::new(read), problem),
            Err(diagnostics) => panic!("{}\n{domain}\n{problem}", diagnostics.render(false)),
        }
    };
    let (open, _) = task("");
    for _ in 0..PLANS {
        let text = plan(random, &actions);
        let Ok((plan, _)) = read_plan(&Source::new("plan", text.as_str()), &open) else {
            continue;
        };
        let Verdict::Valid(report) = validate(&open, &plan, &Settings::default()) else {
            continue;
        };
        let goal = goal(random, &open, &report.state)?;
        let (task, problem) = task(&goal);
        let (plan, _) = read_plan(&Source::new("plan", text.as_str()), &task).ok()?;
        let verdict = validate(&task, &plan, &Settings::default());
        return verdict.is_valid().then_some(Solved {
            text: format!("{domain}\n{problem}\n{text}"),
            task,
            plan,
        });
    }
    None
}

/// Returns up to three literals and comparisons that hold in the state. The first one does not hold
/// initially.
fn goal(random: &mut Random, task: &Task, state: &elbowroom::model::State) -> Option<String> {
    let initial = task.initial();
    let mut new = Vec::new();
    let mut old = Vec::new();
    for name in ["p0", "p1", "p2", "p3"] {
        let predicate = task.problem().predicate(name)?;
        let holds = |state: &elbowroom::model::State| {
            let fact = task.find_fact(predicate, &[]);
            fact.is_some_and(|fact| state.facts.contains(&fact))
        };
        let literal = if holds(state) {
            format!("({name})")
        } else {
            format!("(not ({name}))")
        };
        let list = if holds(state) == holds(initial) {
            &mut old
        } else {
            &mut new
        };
        list.push(literal);
    }
    let fluent = task.fluent_named("(n)");
    let value = |state: &elbowroom::model::State| state.values.get(&fluent?).cloned();
    if let (Some(before), Some(after)) = (value(initial), value(state))
        && before != after
    {
        new.push(format!("(= (n) {after})"));
    }
    if new.is_empty() {
        return None;
    }
    let mut goal = new.swap_remove(random.below(new.len()));
    for list in [new, old] {
        if !list.is_empty() && random.below(2) == 0 {
            let more = &list[random.below(list.len())];
            let _ = write!(goal, " {more}");
        }
    }
    Some(goal)
}

fn init(random: &mut Random) -> String {
    let mut init = format!("(= (n) {})", random.below(3));
    for fact in 0..FACTS {
        if random.below(3) == 0 {
            let _ = write!(init, " (p{fact})");
        }
    }
    if random.below(2) == 0 {
        init.push_str(" (q i)");
    }
    let mut timed = Vec::new();
    for _ in 0..random.below(3) {
        let (time, fact) = (1 + random.below(4), random.below(FACTS));
        if timed.contains(&(time, fact)) {
            continue;
        }
        timed.push((time, fact));
        let literal = change(&format!("(p{fact})"), random.below(2) == 0);
        let _ = write!(init, " (at {time} {literal})");
    }
    init
}

fn change(fact: &str, is_true: bool) -> String {
    if is_true {
        fact.to_owned()
    } else {
        format!("(not {fact})")
    }
}

fn literal(random: &mut Random) -> String {
    let fact = format!("(p{})", random.below(FACTS));
    change(&fact, random.below(3) > 0)
}

fn condition(random: &mut Random) -> String {
    match random.below(10) {
        0 => "(derived)".to_owned(),
        1 => "(not (derived))".to_owned(),
        2 => format!("(or {} {})", literal(random), literal(random)),
        3 => format!("(>= (n) {})", random.below(3)),
        4 => format!("(< (n) {})", 1 + random.below(3)),
        _ => literal(random),
    }
}

fn effect(random: &mut Random) -> String {
    match random.below(9) {
        0 => format!("(increase (n) {})", 1 + random.below(2)),
        1 => format!("(decrease (n) {})", 1 + random.below(2)),
        2 => format!("(assign (n) {})", random.below(3)),
        3 => "(q j)".to_owned(),
        _ => literal(random),
    }
}

/// Returns an effect at a moment, `at start`, `at end` or none, perhaps with a condition or for all
/// items.
fn effect_at(random: &mut Random, moment: &str) -> String {
    let at = |text: &str| {
        if moment.is_empty() {
            text.to_owned()
        } else {
            format!("({moment} {text})")
        }
    };
    match random.below(6) {
        0 => {
            let guard = at(&condition(random));
            format!("(when {guard} {})", at(&effect(random)))
        }
        1 => {
            let guard = at("(q ?x)");
            format!(
                "(forall (?x - item) (when {guard} {}))",
                at(&literal(random))
            )
        }
        _ => at(&effect(random)),
    }
}

fn action(random: &mut Random, number: usize) -> Action {
    let name = format!("a{number}");
    if random.below(5) == 0 {
        let (condition, effect) = (condition(random), effect_at(random, ""));
        let text = format!(
            "(:action {name} :parameters () :precondition (and {condition}) :effect (and {effect}))\n"
        );
        return Action {
            name,
            durations: None,
            text,
        };
    }
    let (bounds, durations): (&str, &[&'static str]) = match random.below(6) {
        0 => ("(= ?duration 0)", &["0"]),
        1 => ("(and (>= ?duration 0) (<= ?duration 2))", &["0", "1", "2"]),
        2 => ("(and (>= ?duration 1) (<= ?duration 3))", &["1", "2", "3"]),
        3 => ("(= ?duration 2)", &["2"]),
        _ => ("(= ?duration 1)", &["1"]),
    };
    let mut conditions = String::new();
    for when in ["at start", "over all", "at end"] {
        let share = if when == "over all" { 2 } else { 4 };
        if random.below(share) == 0 {
            let _ = write!(conditions, "({when} {}) ", condition(random));
        }
    }
    let mut effects = String::new();
    for moment in ["at start", "at end"] {
        for _ in 0..=random.below(2) {
            let _ = write!(effects, "{} ", effect_at(random, moment));
        }
    }
    if random.below(8) == 0 {
        effects.push_str("(increase (n) (* #t 1))");
    }
    let text = format!(
        "(:durative-action {name} :parameters () :duration {bounds}
           :condition (and {conditions}) :effect (and {effects}))\n"
    );
    Action {
        name,
        durations: Some(durations.to_vec()),
        text,
    }
}

fn plan(random: &mut Random, actions: &[Action]) -> String {
    let mut text = String::new();
    for _ in 0..=random.below(4) {
        let own = &actions[random.below(actions.len())];
        let start = ["0", "0", "0.001", "1", "1.001", "2", "2.002", "3"][random.below(8)];
        let _ = match &own.durations {
            None => writeln!(text, "{start}: ({})", own.name),
            Some(durations) => {
                let duration = durations[random.below(durations.len())];
                writeln!(text, "{start}: ({}) [{duration}]", own.name)
            }
        };
    }
    text
}
