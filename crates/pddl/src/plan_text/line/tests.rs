use super::*;

/// Returns `time/word word/duration` of each step.
fn shown(text: &str) -> String {
    match line(text, 0) {
        Line::Steps(steps) => steps
            .iter()
            .map(|step| {
                let text = |word: &Option<Word>| word.as_ref().map_or("", |w| w.text).to_owned();
                let words: Vec<_> = step.words.iter().map(|w| w.text).collect();
                format!(
                    "{}/{}/{}",
                    text(&step.time),
                    words.join(" "),
                    text(&step.duration)
                )
            })
            .collect::<Vec<_>>()
            .join(", "),
        Line::Heading(_) => "Heading".to_owned(),
        other => format!("{other:?}"),
    }
}

#[test]
fn action_notation_of_each_planner_is_read() {
    assert_eq!(
        shown("0.000: (move a b)  [12.000]"),
        "0.000/move a b/12.000"
    );
    assert_eq!(
        shown("0.0002:   (SWAP_6_7 Q6 Q7) [D:2.0000; C:0.1000]"),
        "0.0002/SWAP_6_7 Q6 Q7/2.0000"
    );
    assert_eq!(
        shown("0.0002:   (DRIVE ROVER DEPOT) [10.0000])"),
        "0.0002/DRIVE ROVER DEPOT/10.0000"
    );
    assert_eq!(shown(" 3 : ( go )) ; home"), "3/go/");
    assert_eq!(shown("(a b)"), "/a b/");
    assert_eq!(shown("0: (a) [1] 1: (b) [2]"), "0/a/1, 1/b/2");
}

#[test]
fn line_without_action_is_noise() {
    assert_eq!(shown("b (10.000 | 0.100)b (8.000 | 0.200)"), "Noise");
    assert_eq!(shown("; Plan found with metric 12.0"), "Heading");
    assert_eq!(shown(";;;; Solution Found"), "Heading");
    assert_eq!(shown("; then go home"), "Blank");
    assert_eq!(shown("Total time: 0.03"), "Noise");
}

#[test]
fn comments_are_headings_only_as_planners_print_them() {
    for text in [
        "; Plan found with metric 12.001",
        "; Plan found",
        "; States evaluated: 63",
        "; States evaluated so far: 365188 ",
        ";;;; Solution Found",
    ] {
        assert_eq!(shown(text), "Heading", "{text}");
    }
    for text in [
        "; new plan",
        "; plan",
        ";; the plan",
        "; Plan:",
        "; plan found by hand",
        "; Plan found with metric of mine",
        "; found plan b",
        "; solution found",
        "; Solution number 2",
        "; states evaluated by hand",
    ] {
        assert_eq!(shown(text), "Blank", "{text}");
    }
    assert_eq!(shown("new plan"), "Noise");
    assert_eq!(shown("**** Plan ****"), "Heading");
    assert_eq!(shown("Rescheduled Plan:"), "Heading");
}

#[test]
fn broken_action_reports_expected_token_and_position() {
    assert!(matches!(line("0.0: (a b", 0), Line::Broken(9, _)));
    assert!(matches!(line("0.0: [b]", 0), Line::Broken(0, _)));
    assert!(matches!(line("0.0: (a b) [3", 0), Line::Broken(13, _)));
}

#[test]
fn notation_is_recognised_from_line() {
    let forms = |text: &str| -> Vec<Form> {
        match line(text, 0) {
            Line::Steps(steps) => steps.iter().map(|step| step.form).collect(),
            other => panic!("{text}: {other:?}"),
        }
    };
    for (text, form) in [
        ("0: (a b) [1]", Form::Ipc),
        ("0\t(a b)\t5", Form::PlanSys2),
        ("0: (a b) 5", Form::PlanSys2),
        ("0.0: a(b, c) [1.0]", Form::UnifiedPlanning),
        ("a(b, c)", Form::UnifiedPlanning),
        ("0.0: a b [1.0]", Form::Words),
        ("step    0: A B", Form::Ff),
        ("  3||0 --- A B --- SON: 4||0", Form::ContingentFf),
        ("0: start (a b) #1", Form::Start),
        ("0: end (a b)", Form::End),
    ] {
        assert_eq!(forms(text), [form], "{text}");
    }
    assert_eq!(line("0.0: -----waiting---- [10.0]", 0), Line::Blank);
}
