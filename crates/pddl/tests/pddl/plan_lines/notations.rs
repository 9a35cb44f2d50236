//! Notations of plans other than that of the International Planning Competition.

use crate::plan_lines::{errors, notes, plan};

#[test]
fn plan_of_the_terminal_of_plansys2_is_read() {
    let text =
        "> get plan\nplan: \n0\t(walk hall kitchen)\t4\n4.001\t(wait)\t1.5\n5.502\t(snap b1)\t0\n";
    let same = "0.000: (walk hall kitchen) [4.000]; 4.001: (wait) [1.500]; 5.502: (snap b1)";
    assert_eq!(plan(text), same);
    assert!(notes(text).contains("PlanSys2"));
    assert_eq!(plan("0: (wait) 2"), "0.000: (wait) [2.000]");
    // A number without a duration may be the number of the action.
    assert_eq!(errors("1 (snap b1)"), "1: this is not an action of a plan");
}

#[test]
fn plan_of_unified_planning_is_read() {
    let text = "TimeTriggeredPlan:\n    0.0: walk(hall, kitchen) [4.0]\n    4.001: snap(b1)\n    5.0: wait [1.5]";
    assert_eq!(
        plan(text),
        "0.000: (walk hall kitchen) [4.000]; 4.001: (snap b1); 5.000: (wait) [1.500]"
    );
    assert!(notes(text).contains("unified-planning"));
    let sequence = "SequentialPlan:\n    walk(hall, kitchen)\n    snap(b1)";
    assert_eq!(
        plan(sequence),
        "0.000: (walk hall kitchen) [4.000]; 4.001: (snap b1)"
    );
    let partial = "PartialOrderPlan:\n  actions:\n    0) snap(b1)\n  constraints:\n";
    assert_eq!(errors(partial).split(':').next(), Some("3"));
}

#[test]
fn plan_without_parentheses_is_read() {
    let text = "0.0: walk hall kitchen [4.0]\n4.001: SNAP B1";
    assert_eq!(
        plan(text),
        "0.000: (walk hall kitchen) [4.000]; 4.001: (snap b1)"
    );
    assert!(notes(text).contains("Aries"));
    assert_eq!(
        errors("0: (wait) [2]\n6: launch rocket"),
        "2: unknown action `launch`\n2: unknown object `rocket`"
    );
}

#[test]
fn steps_of_ff_start_when_the_step_before_has_ended() {
    let text = "ff: found legal plan as follows\n\nstep    0: WALK HALL KITCHEN\n        1: SNAP B1\n        2: WALK KITCHEN HALL\n     \n\ntime spent:    0.00 seconds instantiating 21 easy, 0 hard action templates\n";
    assert_eq!(
        plan(text),
        "0.000: (walk hall kitchen) [4.000]; 4.001: (snap b1); 5.001: (walk kitchen hall) [4.000]"
    );
    assert!(notes(text).contains("steps of FF"));
    assert!(!notes(text).contains("Aries"));
    assert_eq!(
        errors("step 0: SNAP B1\n     2: SNAP B2"),
        "2: expected step 1 here"
    );
    assert_eq!(
        errors("step 0: SNAP B1\n1.5: (snap b2)"),
        "1: an action without a time"
    );
}

#[test]
fn steps_of_contingent_ff_are_read_unless_they_branch() {
    let rule = "-------------------------------------------------";
    let text = format!(
        "ff: found plan as follows\n{rule}\n  0||0 --- WALK HALL KITCHEN --- SON: 1||0\n{rule}\n  1||0 --- SNAP B1 --- SON: 2||-1\n{rule}\n tree layout: 2 levels"
    );
    assert_eq!(
        plan(&text),
        "0.000: (walk hall kitchen) [4.000]; 4.001: (snap b1)"
    );
    assert!(notes(&text).contains("Contingent-FF"));
    let branch = "0||0 --- SNAP B1 --- TRUESON: 1||0 --- FALSESON: 1||1\n1||0 --- SNAP B2 --- SON: 2||-1\n1||1 --- WAIT --- SON: 2||-1";
    assert!(errors(branch).starts_with("1: "), "{}", errors(branch));
}

#[test]
fn steps_of_fast_downward_are_read() {
    let text = "[t=0.003s, 10084 KB] Solution found!\nActual search time: 0.001s\nwalk hall kitchen (1)\nsnap b1 (1)\nPlan length: 2 step(s).\nPlan cost: 2\n";
    assert_eq!(errors(text), "none");
    assert_eq!(
        plan(text),
        "0.000: (walk hall kitchen) [4.000]; 4.001: (snap b1)"
    );
    assert!(notes(text).contains("Fast Downward"));
}

#[test]
fn happenings_are_paired() {
    let text = "0.000: start (wait)\n1: (snap b1)\n2.5: end (wait)\n3: start (walk hall kitchen) #1\n7: end (walk hall kitchen) #1";
    assert_eq!(
        plan(text),
        "0.000: (wait) [2.500]; 1.000: (snap b1); 3.000: (walk hall kitchen) [4.000]"
    );
    assert!(notes(text).contains("vscode-pddl"));
    let overlapping = "0: start (wait) #1\n1: start (wait) #2\n3: end (wait) #1\n5: end (wait) #2";
    assert_eq!(
        plan(overlapping),
        "0.000: (wait) [3.000]; 1.000: (wait) [4.000]"
    );
    let ambiguous = overlapping.replace(" #1", "").replace(" #2", "");
    assert_eq!(
        errors(&ambiguous),
        "2: this action starts again before it has ended"
    );
    assert_eq!(
        errors("0: start (wait)"),
        "1: this action starts, but does not end"
    );
    assert_eq!(
        errors("0: start (wait)\n2: end (wait)\n3: end (wait)"),
        "3: this action ends, but does not start"
    );
    assert_eq!(
        errors("0: start (wait)\n2: end (wait)\n3: (walk hall kitchen)"),
        "3: `walk` has no duration here"
    );
}
