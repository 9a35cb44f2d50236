//! Executions, event by event.

use std::sync::Arc;

use elbowroom_num::Rational;

use super::world::{World, number};
use crate::ground::Action;
use crate::problem::SchemaId;
use crate::task::Task;
use crate::validate::Execution;

/// A problem with an execution of it.
struct Executed {
    task: Task,
    execution: Execution,
}

impl Executed {
    fn of(world: World) -> Self {
        let task = Task::new(world.problem);
        let execution = Execution::new(&task);
        Self { task, execution }
    }

    fn action(&self, name: &str) -> Arc<Action> {
        let schemas = &self.task.problem().schemas;
        let schema = schemas
            .iter()
            .position(|schema| schema.name == name)
            .unwrap();
        Arc::new(self.task.instantiate(SchemaId::from(schema), &[]).unwrap())
    }

    /// Commands a start, and returns the verdict.
    fn command(&mut self, id: u64, time: &str, name: &str, duration: &str) -> String {
        let action = self.action(name);
        let duration: Option<Rational> = (!duration.is_empty()).then(|| number(duration));
        self.execution.advance(&number(time));
        let judged = self.execution.command(id, &action, duration.as_ref());
        judged.map_or_else(|violation| violation.to_string(), |()| "valid".to_owned())
    }

    /// Commands a start that takes place at once.
    fn start(&mut self, id: u64, time: &str, name: &str, duration: &str) -> String {
        let judged = self.command(id, time, name, duration);
        self.execution.start(id, &number(time), &[]);
        judged
    }

    fn end(&mut self, id: u64, time: &str) {
        self.execution.end(id, &number(time), &[]);
    }

    fn stop(&mut self, id: u64, time: &str) {
        self.execution.stop(id, &number(time));
    }

    fn see(&mut self, time: &str, name: &str, truth: bool) {
        let fact = self.task.fact_named(name).unwrap();
        self.execution.observe_fact(&number(time), fact, truth);
    }
}

fn trip_world() -> World {
    World::new("(home)")
        .durative(
            "go",
            &[
                ("duration", "(= 6)"),
                ("start", "(home)"),
                ("start effect", "(not (home))"),
                ("end effect", "(mid)"),
            ],
        )
        .instant("ring", "(mid)", "(rung)")
}

#[test]
fn start_needs_its_condition_on_arrival() {
    let mut executed = Executed::of(trip_world());
    assert_eq!(executed.start(0, "0", "go", "6"), "valid");
    executed.end(0, "9");
    assert!(
        executed
            .command(1, "9", "ring", "")
            .starts_with("at 9.000: (ring)")
    );
    assert_eq!(executed.command(2, "9.001", "ring", ""), "valid");
}

#[test]
fn failed_action_keeps_observed_state() {
    let mut executed = Executed::of(trip_world());
    assert_eq!(executed.start(0, "0", "go", "6"), "valid");
    executed.stop(0, "6");
    assert!(executed.command(1, "6", "go", "6").contains("(home)"));
    executed.see("6", "(home)", true);
    assert_eq!(executed.start(2, "6.001", "go", "6"), "valid");
    assert_eq!(
        executed.command(3, "7", "go", "2.749"),
        "at 7.000: (go) takes 2.749, but its duration must be = 6"
    );
}

#[test]
fn commanded_duration_satisfies_over_all_conditions_on_duration() {
    let world = World::new("").durative(
        "soak",
        &[
            ("duration", "(<= 6)"),
            ("over all", "(>= ?duration 3)"),
            ("end effect", "(wet)"),
        ],
    );
    let mut executed = Executed::of(world);
    let judged = executed.command(0, "0", "soak", "2.885");
    assert!(judged.contains("(>= ?duration 3) over all"), "{judged}");
    assert_eq!(executed.command(1, "1", "soak", "3"), "valid");
    // With duration 0, there is no moment between start and end.
    assert_eq!(executed.command(2, "2", "soak", "0"), "valid");
}

#[test]
fn action_is_validated_against_unmodified_domain() {
    let mut executed = Executed::of(trip_world());
    let mut remainder = Action::clone(&executed.action("go"));
    if let crate::ground::Body::Durative(body) = &mut remainder.body {
        body.duration.clear();
    }
    let judged = executed
        .execution
        .command(0, &Arc::new(remainder), Some(&number("2")));
    assert_eq!(
        judged.unwrap_err().to_string(),
        "at 0.000: (go) takes 2, but its duration must be = 6"
    );
}

#[test]
fn numbers_change_continuously_while_action_runs() {
    let world = World::new("(= x 0)")
        .durative("fill", &[("duration", "(= 4)"), ("rate", "x 2")])
        .instant("use", "(>= x 5)", "(decrease x 5)");
    let mut executed = Executed::of(world);
    assert_eq!(executed.start(0, "0", "fill", "4"), "valid");
    assert!(
        executed
            .command(1, "2", "use", "")
            .starts_with("at 2.000: (use)")
    );
    executed.end(0, "3");
    assert_eq!(executed.start(2, "4", "use", ""), "valid");
    assert!(
        executed
            .command(3, "5", "use", "")
            .starts_with("at 5.000: (use)")
    );
}

#[test]
fn end_effects_of_cancelled_action_are_doubtful_until_it_ends() {
    let mut executed = Executed::of(trip_world());
    assert_eq!(executed.start(0, "0", "go", "6"), "valid");
    executed.execution.cancel(0);
    // The action may have been faster than the command.
    assert_eq!(executed.command(1, "3", "ring", ""), "valid");
    executed.stop(0, "4");
    assert!(
        executed
            .command(2, "5", "ring", "")
            .starts_with("at 5.000: (ring)")
    );
}

#[test]
fn timed_initials_happen_and_are_separated() {
    let world = World::new("").timed("3", "(p)").instant("go", "(p)", "(q)");
    let mut executed = Executed::of(world);
    assert!(
        executed
            .command(0, "3", "go", "")
            .starts_with("at 3.000: (go)")
    );
    assert_eq!(executed.command(1, "3.001", "go", ""), "valid");
}

#[test]
fn goal_counts_after_all_timed_initials() {
    let world = World::new("(p)").goal("(p)").timed("3", "(not (p))");
    let executed = Executed::of(world);
    assert_eq!(
        executed.execution.reaches_goal(executed.task.goal()),
        Some(false)
    );
}

#[test]
fn two_starts_at_once_that_interfere_are_invalid() {
    let world = World::new("")
        .instant("set", "", "(p)")
        .instant("unset", "", "(not (p))");
    let mut executed = Executed::of(world);
    assert_eq!(executed.start(0, "1", "set", ""), "valid");
    assert!(executed.start(1, "1", "unset", "").contains("interferes"));
}

#[test]
fn refused_start_has_no_effect() {
    let mut executed = Executed::of(trip_world());
    assert_eq!(executed.command(0, "1", "go", "6"), "valid");
    executed.stop(0, "1");
    assert_eq!(executed.start(1, "1", "go", "6"), "valid");
}
