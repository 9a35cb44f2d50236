//! Plans under constraints of every form, compared with all plans on a grid of times: if the
//! validator accepts one of these, the planner also finds a plan.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_planner::{Answer, plan};

use crate::embedded::world::{answer_from, describe, task};

/// Pseudo-random numbers with a fixed seed (Marsaglia's xorshift).
pub(crate) struct Rng(pub(crate) u64);

impl Rng {
    pub(crate) fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % end
    }

    pub(crate) fn one<'a>(&mut self, of: &[&'a str]) -> &'a str {
        let count = u64::try_from(of.len()).expect("few");
        of[usize::try_from(self.below(count)).expect("few")]
    }
}

/// Constraints; `{t}` and `{u}` are times, `{c}` and `{d}` conditions.
const FORMS: [&str; 11] = [
    "(at end {c})",
    "(always {c})",
    "(sometime {c})",
    "(within {t} {c})",
    "(at-most-once {c})",
    "(sometime-after {c} {d})",
    "(sometime-before {c} {d})",
    "(always-within {t} {c} {d})",
    "(hold-during {t} {u} {c})",
    "(hold-after {t} {c})",
    "(and (always-within {t} {c} {d}) (sometime {c}) (at-most-once {d}))",
];

pub(crate) const CONDITIONS: [&str; 10] = [
    "(p)",
    "(q)",
    "(r)",
    "(not (p))",
    "(not (r))",
    "(or (p) (q))",
    "(and (p) (not (q)))",
    "(or (r) (and (p) (q)))",
    "(>= (x) 1)",
    "(or (q) (< (x) 1))",
];

const EFFECTS: [&str; 9] = [
    "(p)",
    "(not (p))",
    "(q)",
    "(not (q))",
    "(r)",
    "(not (r))",
    "(increase (x) 1)",
    "(decrease (x) 1)",
    "(when (q) (p))",
];

/// Returns a domain with three actions that are durative or instantaneous, and never end when
/// another one does.
pub(crate) fn domain(dice: &mut Rng) -> String {
    let mut text = "(:predicates (p) (q) (r) (g)) (:functions (x))".to_owned();
    for action in 0..3 {
        let mut effects = [String::new(), String::new()];
        for effect in &mut effects {
            for _ in 0..dice.below(3) {
                let new = dice.one(&EFFECTS);
                // Neither the same literal twice, nor its negation.
                let about = ["(p)", "(q)", "(r)", "(x)"];
                let about = about.iter().find(|fact| new.contains(*fact)).expect("one");
                if !effect.contains(about) {
                    write!(effect, "{new} ").unwrap();
                }
            }
        }
        let [start, end] = effects;
        let goal = if action == 0 { "(g)" } else { "" };
        let condition = dice.one(&["(and)", "(and)", "(p)", "(not (q))"]);
        if action == 2 {
            write!(
                text,
                "(:action a{action} :parameters () :precondition {condition}
                   :effect (and {start} {goal}))"
            )
            .unwrap();
        } else {
            let timed = |when: &str, all: &str| {
                let parts = parts(all);
                parts.iter().fold(String::new(), |text, part| {
                    match part.strip_prefix("(when (q) ") {
                        Some(rest) => text + &format!("(when (at {when} (q)) (at {when} {rest}) "),
                        None => text + &format!("(at {when} {part}) "),
                    }
                })
            };
            write!(
                text,
                "(:durative-action a{action} :parameters () :duration (= ?duration {}.0{})
                   :condition (at start {condition})
                   :effect (and {} {} (at end {goal})))",
                1 + dice.below(4),
                3 + 4 * action,
                timed("start", &start),
                timed("end", &end)
            )
            .unwrap();
        }
    }
    text.replace("(at end )", "")
}

/// Returns the lists in a sequence of lists.
fn parts(all: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let (mut depth, mut begin) = (0, 0);
    for (place, letter) in all.char_indices() {
        match letter {
            '(' => {
                if depth == 0 {
                    begin = place;
                }
                depth += 1;
            }
            ')' => {
                depth -= 1;
                if depth == 0 {
                    parts.push(&all[begin..=place]);
                }
            }
            _ => {}
        }
    }
    parts
}

/// Returns a problem with the constraint as the only counted preference, or as a hard constraint.
fn problem(form: &str, is_soft: bool, dice: &mut Rng) -> String {
    let from = dice.below(7);
    let constraint = form
        .replace("{t}", &format!("{from}.5"))
        .replace("{u}", &format!("{}.5", from + 1 + dice.below(4)))
        .replace("{c}", dice.one(&CONDITIONS))
        .replace("{d}", dice.one(&CONDITIONS));
    let constraint = if is_soft {
        format!("(preference kept {constraint})) (:metric minimize (is-violated kept)")
    } else {
        constraint
    };
    let initial = dice.one(&["", "(p)", "(q)", "(p) (r)", "(q) (r)"]);
    let timed = ["", "(at 4.7 (r))", "(at 4.7 (not (r)))"];
    format!(
        "(:init {initial} (= (x) {}) {}) (:goal (g)) (:constraints {constraint})",
        dice.below(3),
        dice.one(&timed)
    )
}

/// Returns a plan of up to two steps, or among many of three, whose happenings are all separate,
/// and which violates no preference.
fn reference(task: &Task, dice: &mut Rng) -> Option<TimeTriggeredPlan> {
    let schemas = 0..task.problem().schemas.len();
    let actions: Vec<Arc<Action>> = schemas
        .map(|schema| Arc::new(task.instantiate(schema.into(), &[]).unwrap()))
        .collect();
    let step = |action: u64, time: u64, place: i64| {
        let action = &actions[usize::try_from(action).expect("few")];
        let duration = action.durative().map(|body| {
            let bound = &body.duration[0].bound;
            bound.evaluate(&mut |_| None).expect("a constant")
        });
        Step {
            start: Rational::from(i64::try_from(time).expect("few")) + Rational::new(place, 10),
            action: Arc::clone(action),
            duration,
        }
    };
    let is_valid = |plan: &TimeTriggeredPlan| {
        let verdict = validate(task, plan, &Settings::default());
        matches!(verdict, Verdict::Valid(report) if report.preferences.violated.is_empty())
    };
    let choices = || (0..3).flat_map(|action| (0..8).map(move |time| (action, time)));
    let one = choices().map(|(action, time)| vec![step(action, time, 1)]);
    let two =
        choices().flat_map(|first| choices().map(move |(action, time)| (first, (action, time))));
    let two =
        two.map(|(first, second)| vec![step(first.0, first.1, 1), step(second.0, second.1, 2)]);
    let mut plans = one.chain(two).map(|steps| TimeTriggeredPlan { steps });
    plans.find(|plan| is_valid(plan)).or_else(|| {
        (0..1500).find_map(|_| {
            let mut any = |place| step(dice.below(3), dice.below(9), place);
            let plan = TimeTriggeredPlan {
                steps: vec![any(1), any(2), any(3)],
            };
            is_valid(&plan).then_some(plan)
        })
    })
}

#[test]
fn existing_plan_under_constraints_is_found() {
    let mut dice = Rng(0x9e37_79b9_7f4a_7c15);
    for form in FORMS {
        let (mut found, mut missed, mut none) = (0, Vec::new(), 0);
        for _ in 0..40 {
            let (domain, problem) = (domain(&mut dice), problem(form, false, &mut dice));
            let task = task(&domain, &problem);
            let situation = Situation::initial(&task);
            let answer = answer_from(&task, &situation, 150);
            if let Answer::Plan { found: plan, .. } = &answer {
                let verdict = validate(&task, &plan.plan, &Settings::default());
                assert!(verdict.is_valid(), "{domain}\n{problem}\n{verdict:?}");
                found += 1;
                continue;
            }
            assert!(
                !matches!(answer, Answer::Unsupported(_)),
                "{}",
                describe(&answer)
            );
            let Some(plan) = reference(&task, &mut dice) else {
                none += 1;
                continue;
            };
            let steps = plan
                .steps
                .iter()
                .map(|step| (step.start.to_decimal(1), &step.action.name));
            let text = format!(
                "{domain}\n{problem}\n{}\n{:?}",
                describe(&answer),
                steps.collect::<Vec<_>>()
            );
            assert!(!matches!(answer, Answer::Unsolvable { .. }), "{text}");
            missed.push(text);
        }
        // A condition that a timed initial may have ended is over.
        let is_known = |text: &&String| !form.contains("at-most-once") || !text.contains("(r))");
        let missed: Vec<_> = missed.iter().filter(is_known).collect();
        assert!(missed.is_empty(), "{form}: {}\n{}", missed.len(), missed[0]);
        assert!(found > 6, "{form}: {found} found, {none} without a plan");
    }
}

#[test]
fn satisfiable_preference_is_satisfied() {
    let mut dice = Rng(0x2545_f491_4f6c_dd1d);
    for form in FORMS {
        let mut kept = 0;
        for _ in 0..10 {
            let (domain, problem) = (domain(&mut dice), problem(form, true, &mut dice));
            let task = task(&domain, &problem);
            let mut left = 60;
            let settings = elbowroom_planner::Settings::default();
            let answer = plan(
                &task,
                &Situation::initial(&task),
                &settings,
                &mut |progress| {
                    left -= 1;
                    let is_best = progress.best == Some(Rational::ZERO);
                    if left == 0 || is_best {
                        ControlFlow::Break(())
                    } else {
                        ControlFlow::Continue(())
                    }
                },
            );
            let Some(found) = answer.found() else {
                continue;
            };
            let verdict = validate(&task, &found.plan, &Settings::default());
            let Verdict::Valid(report) = verdict else {
                panic!("{domain}\n{problem}\n{verdict:?}");
            };
            assert_eq!(report.metric(&task), found.metric);
            if found.metric == Some(Rational::ZERO) {
                kept += 1;
            } else if !form.contains("at-most-once") {
                let better = reference(&task, &mut dice);
                assert!(better.is_none(), "{domain}\n{problem}\n{better:?}");
            }
        }
        assert!(kept > 1, "{form}: {kept}");
    }
}
