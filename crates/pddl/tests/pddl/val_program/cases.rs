//! Our own cases, and plans of others, unchanged and with times shifted.

use std::path::PathBuf;

use elbowroom_num::Rational;
use elbowroom_pddl::Source;

use crate::skipped::skipped;
use crate::val_program::program::{PlanVerdict, Val, ours, task};

/// Returns the plan with one number of one line changed: the start of an action, or its duration.
fn shifted(plan: &str, line: usize, is_duration: bool, by: &Rational) -> Option<String> {
    let mut lines: Vec<String> = plan.lines().map(str::to_owned).collect();
    let changed = lines.get_mut(line)?;
    let (before, number, after) = if is_duration {
        let (before, rest) = changed.rsplit_once('[')?;
        let (number, after) = rest.split_once(']')?;
        (format!("{before}["), number, format!("]{after}"))
    } else {
        let (number, after) = changed.split_once(':')?;
        (String::new(), number, format!(":{after}"))
    };
    let number = number.trim().parse::<Rational>().ok()? + by;
    if number.is_negative() || number == Rational::ZERO {
        return None;
    }
    *changed = format!("{before}{}{after}", number.to_decimal(5));
    Some(lines.join("\n") + "\n")
}

/// Returns the lines of a plan that contain actions.
fn steps(plan: &str) -> Vec<usize> {
    let lines = plan.lines().enumerate();
    let steps = lines.filter(|(_, line)| line.contains(": (") || line.contains(":("));
    steps.map(|(number, _)| number).collect()
}

/// Compares the verdicts on a plan and on its variants with one number changed. Returns the
/// disagreements and the number of comparisons.
fn compare(
    val: &Val,
    [domain, problem, plan]: [&str; 3],
    changes: &[(usize, bool, Rational)],
) -> (Vec<String>, usize) {
    let (Some(task), mut differ, mut compared) = (
        task(
            &Source::new("domain", domain),
            &Source::new("problem", problem),
        ),
        Vec::new(),
        0,
    ) else {
        return (Vec::new(), 0);
    };
    let shifts = changes
        .iter()
        .filter_map(|(line, is_duration, by)| shifted(plan, *line, *is_duration, by));
    for plan in std::iter::once(plan.to_owned()).chain(shifts) {
        let theirs = val.verdict(domain, problem, &plan);
        let (ours, why) = ours(&task, &Source::new("plan", plan.clone()));
        if ours == PlanVerdict::NoVerdict && theirs == PlanVerdict::Invalid {
            // VAL does not report that it is undecided.
            continue;
        }
        compared += 1;
        if !ours.agrees_with(&theirs) {
            differ.push(format!("VAL {theirs:?}, we {ours:?} {why}\n{plan}"));
        }
    }
    (differ, compared)
}

/// Returns changes of every step's start and duration, to earlier and later times.
fn all_changes(plan: &str) -> Vec<(usize, bool, Rational)> {
    let mut changes = Vec::new();
    for line in steps(plan) {
        for is_duration in [false, true] {
            for by in [-5, -1, 1, 5] {
                changes.push((line, is_duration, Rational::new(by, 10)));
            }
            changes.push((line, is_duration, Rational::new(-1, 100)));
        }
    }
    changes
}

#[test]
fn own_cases_and_mutations_get_same_verdict_as_val() {
    let Some(val) = Val::find("cases") else {
        return;
    };
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    // VAL does not read conditions on `?duration`.
    for name in [
        "crossing",
        "delivery",
        "hatchery",
        "lamp",
        "match",
        "paintshop",
        "tank",
    ] {
        let read = |file: &str| {
            let text = std::fs::read_to_string(root.join(name).join(file)).expect("a case");
            // VAL requires a condition.
            text.replace(":condition ()", ":condition (and)")
        };
        let [domain, problem, plan] = ["domain.pddl", "problem.pddl", "plan.plan"].map(read);
        let (differ, compared) = compare(&val, [&domain, &problem, &plan], &all_changes(&plan));
        assert!(
            differ.is_empty(),
            "{name}: {} differ\n{}",
            differ.len(),
            differ.join("\n")
        );
        assert!(compared > 3, "{name}: {compared}");
    }
}

#[test]
fn processes_and_events_get_same_verdict_as_val() {
    let Some(val) = Val::find("processes") else {
        return;
    };
    let domain = "(define (domain basin)
        (:requirements :strips :fluents :durative-actions :time :negative-preconditions)
        (:predicates (open) (flooded) (rung))
        (:functions (level) (rate))
        (:process flow :parameters () :precondition (open)
          :effect (increase (level) (* #t (rate))))
        (:event flood :parameters () :precondition (and (>= (level) 10) (not (flooded)))
          :effect (flooded))
        (:event ring :parameters () :precondition (and (>= (level) 6) (not (rung)))
          :effect (and (rung) (assign (rate) 1)))
        (:action turn-on :parameters () :precondition (not (open)) :effect (open))
        (:action turn-off :parameters () :precondition (open) :effect (not (open)))
        (:durative-action drain :parameters () :duration (= ?duration 2)
          :condition (at start (>= (level) 4))
          :effect (decrease (level) (* #t 1.5))))";
    let problem = "(define (problem p) (:domain basin) (:init (= (level) 0) (= (rate) 2))
        (:goal (and (>= (level) 3) (<= (level) 7) (not (flooded)) (not (open)))))";
    for (plan, name) in [
        (
            "1.000: (turn-on)\n4.500: (turn-off)\n5.000: (drain) [2.000]\n",
            "rung",
        ),
        (
            "1.000: (turn-on)\n3.200: (drain) [2.000]\n4.900: (turn-off)\n",
            "drained meanwhile",
        ),
        (
            "1.000: (turn-on)\n8.550: (turn-off)\n9.000: (drain) [2.000]\n",
            "flooded",
        ),
    ] {
        let changes = all_changes(plan);
        let (differ, compared) = compare(&val, [domain, problem, plan], &changes);
        assert!(
            differ.is_empty(),
            "{name}: {} differ\n{}",
            differ.len(),
            differ.join("\n")
        );
        assert!(compared > 8, "{name}: {compared}");
    }
}

#[test]
fn preference_counts_agree_with_val() {
    let Some(val) = Val::find("preferences") else {
        return;
    };
    let domain = "(define (domain d)
        (:requirements :typing :durative-actions :preferences :constraints
          :negative-preconditions :universal-preconditions)
        (:types room) (:predicates (at ?r - room) (seen ?r - room) (lit))
        (:durative-action go :parameters (?a ?b - room) :duration (= ?duration 4)
          :condition (and (at start (at ?a)) (preference dark (over all (not (lit)))))
          :effect (and (at start (not (at ?a))) (at end (at ?b))))
        (:action look :parameters (?r - room)
          :precondition (and (at ?r) (preference light (lit))) :effect (seen ?r))
        (:action switch :parameters () :precondition (and) :effect (lit)))";
    let problem = "(define (problem p) (:domain d) (:objects a b c - room)
        (:init (at a))
        (:goal (and (seen c) (preference home (at a)) (forall (?r - room) (preference all (seen ?r)))))
        (:constraints (and (preference soon (within 9 (seen c)))
           (forall (?r - room) (preference visited (sometime (at ?r))))
           (preference back (sometime-after (at b) (at a)))))
        (:metric minimize (+ (* 1 (is-violated dark)) (+ (* 10 (is-violated light))
           (+ (* 100 (is-violated home)) (+ (* 1000 (is-violated all))
           (+ (* 10000 (is-violated soon)) (+ (* 100000 (is-violated visited))
              (* 1000000 (is-violated back))))))))))";
    assert!(
        task(
            &Source::new("domain", domain),
            &Source::new("problem", problem)
        )
        .is_some()
    );
    for plan in [
        "1.000: (go a c) [4.000]\n6.000: (look c)\n",
        "1.000: (go a b) [4.000]\n6.000: (look b)\n7.000: (go b c) [4.000]\n12.000: (look c)\n",
        "0.500: (switch)\n1.000: (go a b) [4.000]\n6.000: (look b)\n7.000: (go b c) [4.000]\n12.000: (look c)\n",
        "1.000: (go a b) [4.000]\n6.000: (look b)\n7.000: (go b c) [4.000]\n11.350: (switch)\n12.000: (look c)\n13.000: (go c a) [4.000]\n18.000: (look a)\n",
    ] {
        let (differ, compared) = compare(&val, [domain, problem, plan], &all_changes(plan));
        assert!(
            differ.is_empty(),
            "{} differ\n{}",
            differ.len(),
            differ.join("\n")
        );
        assert!(compared > 8, "{compared}");
    }
}

#[test]
fn benchmark_plans_and_mutations_get_same_verdict_as_val() {
    let Some(val) = Val::find("others") else {
        return;
    };
    let shared = std::env::var_os("ELBOWROOM_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let root = shared.join("data/pddl");
    let Ok(table) = std::fs::read_to_string(root.join("plans.csv")) else {
        skipped("no benchmark set; set ELBOWROOM_SHARED to where it is");
        return;
    };
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    let column = |name: &str| {
        let position = header.iter().position(|column| *column == name);
        position.expect("a column of this name")
    };
    let columns = ["domain_file", "problem_file", "plan_file"].map(column);
    // A division by zero, and the window alarm: see the document.
    let known = [
        "val-samples/drive/",
        "val-samples/sleeping-beauty-with-magnetic-window-alarm/",
    ];
    let (mut differ, mut compared) = (Vec::new(), 0);
    for cells in lines {
        if known
            .iter()
            .any(|known| cells[columns[2]].starts_with(known))
        {
            continue;
        }
        let texts = columns.map(|column| {
            let bytes = std::fs::read(root.join(cells[column])).expect("a file of the table");
            Source::from_bytes(cells[column], &bytes).text().to_owned()
        });
        let steps = steps(&texts[2]);
        let Some(&middle) = steps.get(steps.len() / 2) else {
            continue;
        };
        let changes = [
            (middle, false, Rational::new(-1, 10)),
            (middle, false, Rational::new(1, 5)),
            (steps[0], true, Rational::new(1, 10)),
        ];
        let texts = texts.each_ref().map(String::as_str);
        let (own, count) = compare(&val, texts, &changes);
        compared += count;
        differ.extend(own.into_iter().map(|one| {
            format!(
                "{}: {}",
                cells[columns[2]],
                one.lines().next().unwrap_or("")
            )
        }));
    }
    println!("{compared} compared");
    assert!(
        differ.is_empty(),
        "{} of {compared} differ\n{}",
        differ.len(),
        differ.join("\n")
    );
}

/// The smallest examples for the document's sections on events and divisions.
#[test]
fn document_lists_missed_events_and_divisions_by_zero_of_val() {
    let Some(val) = Val::find("smallest") else {
        return;
    };
    let judged = |domain: &str, problem: &str, plan: &str| {
        let sources = (
            Source::new("domain", domain),
            Source::new("problem", problem),
        );
        let task = task(&sources.0, &sources.1).expect("the texts can be read");
        let (ours, _) = ours(&task, &Source::new("plan", plan));
        (val.verdict(domain, problem, plan), ours)
    };
    let basin = "(define (domain basin)
        (:requirements :strips :fluents :time :negative-preconditions)
        (:predicates (open) (flooded)) (:functions (level))
        (:process flow :parameters () :precondition (open)
          :effect (increase (level) (* #t 1)))
        (:event flood :parameters () :precondition (and (>= (level) 10) (not (flooded)))
          :effect (flooded))
        (:action turn-on :parameters () :precondition (not (open)) :effect (open))
        (:action turn-off :parameters () :precondition (open) :effect (not (open))))";
    let dry = "(define (problem p) (:domain basin) (:init (= (level) 0)) (:goal (not (flooded))))";
    // At 11, the basin holds 10, whatever action is applied then.
    let (theirs, ours) = judged(basin, dry, "1.0: (turn-on)\n11.0: (turn-off)\n");
    assert!(
        matches!(theirs, PlanVerdict::Valid(_)) && ours == PlanVerdict::Invalid,
        "{theirs:?} {ours:?}"
    );
    let (theirs, ours) = judged(basin, dry, "1.0: (turn-on)\n11.5: (turn-off)\n");
    assert!(
        theirs == PlanVerdict::Invalid && ours == PlanVerdict::Invalid,
        "{theirs:?} {ours:?}"
    );

    // The flow ends at 9. After any happening in between, VAL lets it continue until an event.
    let bounded = basin
        .replace(
            ":precondition (open)\n          :effect (increase",
            ":precondition (and (open) (< (level) 9))\n          :effect (increase",
        )
        .replace(
            "(:action turn-on",
            "(:action look :parameters () :precondition (open) :effect (and))\n(:action turn-on",
        );
    assert!(bounded.contains("(< (level) 9)"));
    let (theirs, ours) = judged(&bounded, dry, "1.0: (turn-on)\n20.0: (turn-off)\n");
    assert!(
        theirs.agrees_with(&ours) && matches!(ours, PlanVerdict::Valid(_)),
        "{theirs:?} {ours:?}"
    );
    let looked = "1.0: (turn-on)\n6.0: (look)\n20.0: (turn-off)\n";
    let (theirs, ours) = judged(&bounded, dry, looked);
    assert!(
        theirs == PlanVerdict::Invalid && matches!(ours, PlanVerdict::Valid(_)),
        "{theirs:?} {ours:?}"
    );

    let share = "(define (domain share) (:requirements :strips :fluents)
        (:predicates (done)) (:functions (each) (people))
        (:action divide :parameters () :precondition (and)
          :effect (and (done) (assign (each) (/ 1 (people))))))";
    // In our semantics, the reads of a preference require no separation, since a preference never
    // makes a plan invalid.
    let lamp = "(define (domain lamp) (:requirements :strips :preferences)
        (:predicates (lit) (seen))
        (:action switch :parameters () :precondition (and) :effect (lit))
        (:action look :parameters () :precondition (and (preference light (lit)))
          :effect (seen)))";
    let seen = "(define (problem p) (:domain lamp) (:init) (:goal (seen)))";
    let (theirs, ours) = judged(lamp, seen, "1.0: (switch)\n1.0: (look)\n");
    assert!(
        theirs == PlanVerdict::Invalid && matches!(ours, PlanVerdict::Valid(_)),
        "{theirs:?} {ours:?}"
    );

    let nobody = "(define (problem p) (:domain share) (:init (= (people) 0)) (:goal (done)))";
    let (theirs, ours) = judged(share, nobody, "1.0: (divide)\n");
    assert!(
        matches!(theirs, PlanVerdict::Valid(_)) && ours == PlanVerdict::Invalid,
        "{theirs:?} {ours:?}"
    );
}
