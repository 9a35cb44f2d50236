use super::*;

fn at(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

fn greeted(speed: f64) -> World {
    let mut world = World::new("plansys2", speed);
    let mut said = vec![];
    let hello = r#"{"type":"hello","protocol":"elbowroom-world","version":1,"versions":[1,2]}"#;
    assert_eq!(
        world.handle_line(hello, at(0.0), &mut said).expect("JSON"),
        None
    );
    assert_eq!(
        said,
        [r#"{"type":"hello","version":2,"name":"plansys2","can":["cancel","feedback"]}"#]
    );
    world
}

fn hears(world: &mut World, line: &str, now: f64) -> Option<Command> {
    world.handle_line(line, at(now), &mut vec![]).expect("JSON")
}

const START: &str = r#"{"type":"start","ticket":3,"action":"(drive r a b)","duration":{"exact":"5","decimal":5.0},"now":{"exact":"0","decimal":0.0}}"#;
const WAIT: &str = r#"{"type":"wait","until":{"exact":"4","decimal":4.0},"question":9}"#;

#[test]
fn repeated_start_is_executed_once() {
    let mut world = greeted(1.0);
    let action = Action {
        ticket: 3,
        name: "drive".into(),
        arguments: ["r", "a", "b"].map(String::from).into(),
        is_instantaneous: false,
    };
    assert_eq!(hears(&mut world, START, 0.0), Some(Command::Begin(action)));
    assert_eq!(hears(&mut world, START, 0.1), None);
}

#[test]
fn clock_starts_with_first_request_and_runs_at_set_speed() {
    let mut world = greeted(2.0);
    hears(&mut world, START, 10.0);
    world.report(3, &ActionUpdate::Started, at(10.5));
    hears(&mut world, WAIT, 10.5);
    assert_eq!(
        world.answer(at(10.75)),
        [
            r#"{"type":"started","ticket":3,"time":1.0}"#,
            r#"{"type":"time","now":1.5,"question":9}"#
        ]
    );
}

#[test]
fn question_is_answered_at_its_time() {
    let mut world = greeted(1.0);
    hears(&mut world, WAIT, 1.0);
    assert!(world.answer(at(4.99)).is_empty());
    assert!(world.due_in(at(4.5)).is_some_and(|left| left >= at(0.5)));
    assert_eq!(
        world.answer(at(5.0)),
        [r#"{"type":"time","now":4.0,"question":9}"#]
    );
    assert_eq!(world.due_in(at(5.0)), None);
}

#[test]
fn each_start_and_each_end_is_reported_once_and_in_this_order() {
    let mut world = greeted(1.0);
    hears(&mut world, START, 0.0);
    for told in [
        ActionUpdate::Succeeded,
        ActionUpdate::Started,
        ActionUpdate::Cancelled,
        ActionUpdate::Failed("late".into()),
    ] {
        world.report(3, &told, at(2.0));
    }
    hears(&mut world, WAIT, 2.0);
    let lines = world.answer(at(2.0));
    assert_eq!(lines[0], r#"{"type":"started","ticket":3,"time":2.0}"#);
    assert_eq!(
        lines[1],
        r#"{"type":"ended","ticket":3,"time":2.0,"outcome":"succeeded"}"#
    );
    assert_eq!(lines.len(), 3);
    let cancel = r#"{"type":"cancel","ticket":3}"#;
    assert_eq!(hears(&mut world, cancel, 2.0), None, "it has ended");
    assert!(world.running().is_empty());
}

#[test]
fn instantaneous_action_ends_at_start() {
    let mut world = greeted(1.0);
    let start = r#"{"type":"start","ticket":1,"action":"(beep)","duration":null}"#;
    let Some(Command::Begin(action)) = hears(&mut world, start, 0.0) else {
        panic!("a start");
    };
    assert!(action.is_instantaneous && action.arguments.is_empty());
    assert_eq!(world.running(), [1]);
    world.report(1, &ActionUpdate::Started, at(1.0));
    assert!(world.running().is_empty());
}

#[test]
fn version_1_receives_no_feedback() {
    let mut world = World::new("plansys2", 1.0);
    let mut said = vec![];
    let hello = r#"{"type":"hello","protocol":"elbowroom-world","version":1}"#;
    world.handle_line(hello, at(0.0), &mut said).expect("JSON");
    assert!(said.is_empty());
    hears(&mut world, START, 0.0);
    let feedback = ActionUpdate::Feedback {
        completion: f32::NAN,
        note: String::new(),
    };
    world.report(3, &feedback, at(1.0));
    hears(&mut world, r#"{"type":"look","facts":[]}"#, 1.0);
    assert_eq!(world.answer(at(1.0)), [r#"{"type":"time","now":1.0}"#]);
}

#[test]
fn unknown_messages_are_ignored_and_invalid_json_is_an_error() {
    let mut world = greeted(1.0);
    for line in [
        r#"{"type":"dance"}"#,
        "{}",
        r#"{"type":"cancel","ticket":99}"#,
        r#"{"type":"start","ticket":5,"action":"()"}"#,
    ] {
        assert_eq!(hears(&mut world, line, 0.0), None, "{line}");
    }
    assert!(world.handle_line("[1]", at(0.0), &mut vec![]).is_err());
    assert!(world.handle_line("nonsense", at(0.0), &mut vec![]).is_err());
    assert_eq!(
        hears(&mut world, r#"{"type":"stop"}"#, 0.0),
        Some(Command::Stop)
    );
}

#[test]
fn beliefs_are_received_and_external_changes_reported() {
    let mut world = World::new("plansys2", 1.0).with_beliefs();
    let mut said = vec![];
    let hello = r#"{"type":"hello","protocol":"elbowroom-world","version":1,"versions":[1,2]}"#;
    world.handle_line(hello, at(0.0), &mut said).expect("JSON");
    assert!(said[0].contains(r#""can":["cancel","feedback","facts","beliefs"]"#));
    let told = r#"{"type":"believed","now":{"exact":"0","decimal":0.0},"facts":{"(at r a)":false},"values":{"(charge r)":{"exact":"7/2","decimal":3.5},"(driven r)":null}}"#;
    let facts = vec![("(at r a)".to_owned(), false)];
    let values = vec![
        ("(charge r)".to_owned(), Some(3.5)),
        ("(driven r)".to_owned(), None),
    ];
    assert_eq!(
        hears(&mut world, told, 0.0),
        Some(Command::Believe { facts, values })
    );
    hears(&mut world, WAIT, 1.0);
    assert!(world.answer(at(1.5)).is_empty());
    world.report_change(
        &ExternalChange::Fact("(blocked b)".to_owned(), true),
        at(1.5),
    );
    world.report_change(
        &ExternalChange::Value("(charge r)".to_owned(), 2.0),
        at(1.5),
    );
    assert_eq!(
        world.answer(at(1.5)),
        [
            r#"{"type":"fact","fact":"(blocked b)","becomes":true,"time":0.5}"#,
            r#"{"type":"value","fluent":"(charge r)","value":2.0,"time":0.5}"#,
            r#"{"type":"time","now":0.5,"question":9}"#
        ]
    );
}
