//! Constraints of every form on the course of random plans.

use elbowroom_pddl::Source;

use crate::val_program::program::{PlanVerdict, Val, ours, task};

/// Pseudo-random numbers with a fixed seed (Marsaglia's xorshift).
struct Rng(u64);

impl Rng {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % end
    }

    fn one<'a>(&mut self, of: &[&'a str]) -> &'a str {
        let count = u64::try_from(of.len()).expect("few");
        of[usize::try_from(self.below(count)).expect("few")]
    }
}

/// Constraints; `{t}` and `{u}` are times, `{c}` and `{d}` conditions.
const FORMS: [&str; 10] = [
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
];

const CONDITIONS: [&str; 8] = [
    "(p)",
    "(q)",
    "(r)",
    "(not (p))",
    "(or (p) (q))",
    "(and (p) (not (q)))",
    "(or (r) (and (p) (q)))",
    "(>= (x) 1)",
];

/// Returns a domain with four actions, each with a change at its start and end.
fn domain(dice: &mut Rng) -> String {
    let mut text = "(define (domain d)
        (:requirements :strips :durative-actions :fluents :constraints :preferences
          :timed-initial-literals :negative-preconditions :disjunctive-preconditions)
        (:predicates (p) (q) (r) (w)) (:functions (x))\n"
        .to_owned();
    for action in 0..4 {
        let mut effect = String::new();
        for when in ["start", "end"] {
            for fact in ["(p)", "(q)", "(r)"] {
                match dice.below(7) {
                    0 => effect += &format!("(at {when} {fact}) "),
                    1 => effect += &format!("(at {when} (not {fact})) "),
                    _ => {}
                }
            }
            match dice.below(8) {
                0 => effect += &format!("(at {when} (increase (x) 1)) "),
                1 => effect += &format!("(at {when} (decrease (x) 1)) "),
                _ => {}
            }
        }
        text += &format!(
            "(:durative-action a{action} :parameters () :duration (= ?duration {}.0{action}1)
               :condition (and) :effect (and {effect}))\n",
            1 + dice.below(6)
        );
    }
    text + ")"
}

/// Returns a problem with a constraint of this form. If VAL does not support the form, an
/// equivalent problem is returned as well, in which the condition always holds while a timed
/// initial is true.
fn problem(form: &str, is_soft: bool, dice: &mut Rng) -> (String, Option<String>) {
    let from = format!("{}.5", dice.below(12));
    let until = format!("{}.5", 13 + dice.below(5));
    let (c, d) = (dice.one(&CONDITIONS), dice.one(&CONDITIONS));
    let constraint = form.replace("{t}", &from).replace("{u}", &until);
    let constraint = constraint.replace("{c}", c).replace("{d}", d);
    let initial = dice.one(&["", "(p)", "(q) (r)", "(p) (r)"]);
    let timed = dice.one(&["", "(at 6.77 (r))", "(at 6.77 (not (r)))"]);
    let text = |timed: &str, constraint: &str, time: &str| {
        let (constraint, metric) = if is_soft {
            let metric = format!("(:metric minimize (+ (* 7 (is-violated k)) {time}))");
            (format!("(preference k {constraint})"), metric)
        } else {
            (constraint.to_owned(), String::new())
        };
        format!(
            "(define (problem p) (:domain d) (:init {initial} (= (x) 0) {timed}) (:goal (and))
               (:constraints {constraint}) {metric})"
        )
    };
    let same = format!("(always (or (not (w)) {c}))");
    let window = if form.contains("hold-during") {
        format!("{timed} (at {from} (w)) (at {until} (not (w)))")
    } else {
        format!("{timed} (at {from} (w))")
    };
    if form.contains("hold-") {
        (
            text(timed, &constraint, "0"),
            Some(text(&window, &same, "0")),
        )
    } else {
        (text(timed, &constraint, "(* 0.5 (total-time))"), None)
    }
}

/// Returns a plan with each action once, at a separate time.
fn plan(domain: &str, dice: &mut Rng) -> String {
    let mut text = String::new();
    for (action, line) in domain
        .lines()
        .filter(|line| line.contains("?duration"))
        .enumerate()
    {
        if dice.below(5) > 0 {
            let (_, duration) = line.split_once("?duration ").expect("there is one");
            let duration = duration.trim_end_matches(')');
            text += &format!(
                "{}.{}00: (a{action}) [{duration}]\n",
                1 + dice.below(12),
                2 * action
            );
        }
    }
    text
}

/// Returns the disagreements under one form, each with both answers.
fn disagreements(val: &Val, form: &str, is_soft: bool, count: usize) -> (Vec<String>, usize) {
    let mut dice = Rng(0x9e37_79b9_7f4a_7c15);
    let (mut differ, mut valid) = (Vec::new(), 0);
    for _ in 0..count {
        let domain = domain(&mut dice);
        let (problem, same) = problem(form, is_soft, &mut dice);
        let plan = plan(&domain, &mut dice);
        let theirs = val.verdict(&domain, same.as_ref().unwrap_or(&problem), &plan);
        let task = task(
            &Source::new("domain", domain.clone()),
            &Source::new("problem", problem.clone()),
        );
        let task = task.expect("the texts can be read");
        let (ours, why) = ours(&task, &Source::new("plan", plan.clone()));
        valid += usize::from(matches!(ours, PlanVerdict::Valid(_)));
        if !ours.agrees_with(&theirs) {
            differ.push(format!(
                "VAL {theirs:?}, we {ours:?} {why}\n{domain}\n{problem}\n{plan}"
            ));
        }
    }
    (differ, valid)
}

#[test]
fn constraints_of_every_form_get_same_verdict_as_val() {
    let Some(val) = Val::find("course") else {
        return;
    };
    for is_soft in [false, true] {
        for form in FORMS {
            let (differ, valid) = disagreements(&val, form, is_soft, 60);
            assert!(
                differ.is_empty(),
                "{form}: {} differ, {}",
                differ.len(),
                differ[0]
            );
            // A preference never makes a plan invalid.
            let range = if is_soft { 60..=60 } else { 5..=55 };
            assert!(range.contains(&valid), "{form}: {valid} valid");
        }
    }
}

/// Returns both verdicts on one action that makes (p) true from 2 to 4, and another one later.
fn known(val: &Val, constraint: &str) -> (PlanVerdict, PlanVerdict) {
    let domain = "(define (domain d) (:requirements :strips :durative-actions :constraints)
        (:predicates (p) (q))
        (:durative-action a :parameters () :duration (= ?duration 2) :condition (and)
          :effect (and (at start (p)) (at end (not (p)))))
        (:durative-action b :parameters () :duration (= ?duration 3) :condition (and)
          :effect (and (at start (q)) (at end (not (q))))))";
    let problem = format!(
        "(define (problem p) (:domain d) (:init) (:goal (and)) (:constraints {constraint}))"
    );
    let plan = "2.0: (a) [2.0]\n5.0: (b) [3.0]\n";
    let theirs = val.verdict(domain, &problem, plan);
    let task = task(
        &Source::new("domain", domain),
        &Source::new("problem", problem),
    );
    let (ours, _) = ours(
        &task.expect("the texts can be read"),
        &Source::new("plan", plan),
    );
    (theirs, ours)
}

#[test]
fn document_lists_wrong_verdicts_of_val() {
    let Some(val) = Val::find("known") else {
        return;
    };
    let document = include_str!("../../../../../docs/research/val-agreement.md");
    let (valid, failed) = (PlanVerdict::Valid(None), PlanVerdict::Invalid);
    for (constraint, theirs, ours) in [
        ("(hold-during 2 5 (p))", &valid, &failed),
        ("(hold-during 0.5 1.5 (p))", &valid, &failed),
        ("(hold-after 4 (not (p)))", &PlanVerdict::NoVerdict, &valid),
    ] {
        let (val_says, we_say) = known(&val, constraint);
        assert!(val_says.agrees_with(theirs), "{constraint}: {val_says:?}");
        assert!(we_say.agrees_with(ours), "{constraint}: {we_say:?}");
        assert!(document.contains(constraint), "{constraint}");
    }
}
