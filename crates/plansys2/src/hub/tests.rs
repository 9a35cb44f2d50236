//! Tests of each row of the table in `docs/reference/plansys2.md`.

use super::*;

/// Hub with one performer or more, and its outputs.
struct Fixture {
    hub: Hub,
    now: Duration,
    sent: Vec<(i16, String)>,
    told: Vec<(ActionHandle, ActionUpdate)>,
    remarks: Vec<String>,
}

impl Fixture {
    fn new() -> Self {
        Self {
            hub: Hub::new("elbowroom"),
            now: Duration::ZERO,
            sent: vec![],
            told: vec![],
            remarks: vec![],
        }
    }

    fn settle(&mut self) {
        for effect in self.hub.effects() {
            match effect {
                Effect::Send(message) => self.sent.push((message.kind, message.node_id)),
                Effect::Report(ticket, told) => self.told.push((ticket, told)),
                Effect::Remark(text) => self.remarks.push(text),
            }
        }
    }

    /// Begins an action. `text` is that of a plan, without parentheses.
    fn begin(&mut self, ticket: ActionHandle, text: &str) {
        let (name, arguments) = split(text);
        let action = Action {
            ticket,
            name,
            arguments,
            is_instantaneous: false,
        };
        self.hub.begin(action, self.now);
        self.settle();
    }

    fn says(&mut self, kind: i16, node: &str, text: &str) {
        self.says_more(kind, node, text, kind == kind::FINISH, "");
    }

    fn says_more(&mut self, kind: i16, node: &str, text: &str, success: bool, status: &str) {
        let (action, arguments) = split(text);
        let message = ActionExecution {
            kind,
            node_id: node.into(),
            action,
            arguments,
            success,
            completion: 0.5,
            status: status.into(),
        };
        self.hub.message(&message, self.now);
        self.settle();
    }

    fn is_in(&mut self, state: i8, node: &str) {
        let status = ActionPerformerStatus {
            state,
            node_name: node.into(),
            action: "move".into(),
            ..ActionPerformerStatus::default()
        };
        self.hub.status(&status, self.now);
        self.settle();
    }

    /// Advances the time. The performer `alive` reports its status each second.
    fn after(&mut self, seconds: u32, alive: Option<(&str, i8)>) {
        for quarter in 1..=seconds * 4 {
            self.now += Duration::from_millis(250);
            if let Some((node, state)) = alive.filter(|_| quarter % 4 == 0) {
                self.is_in(state, node);
            }
            self.hub.tick(self.now);
            self.settle();
        }
    }

    fn outcomes(&self, ticket: ActionHandle) -> Vec<&ActionUpdate> {
        let its = self.told.iter().filter(|(it, _)| *it == ticket);
        its.map(|(_, told)| told).collect()
    }

    fn last_sent(&self) -> (i16, &str) {
        let (kind, node) = self.sent.last().expect("something was sent");
        (*kind, node)
    }
}

fn split(text: &str) -> (String, Vec<String>) {
    let mut words = text.split(' ').map(str::to_owned);
    (words.next().expect("a name"), words.collect())
}

fn failed(why: &str) -> ActionUpdate {
    ActionUpdate::Failed(why.into())
}

#[test]
fn performer_reports_response_feedback_and_finish() {
    let mut scene = Fixture::new();
    scene.begin(7, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.says_more(kind::FEEDBACK, "robot1", "MOVE R A B", false, "half-way");
    scene.says(kind::FINISH, "robot1", "move r a b");
    let feedback = ActionUpdate::Feedback {
        completion: 0.5,
        note: "half-way".into(),
    };
    assert_eq!(
        scene.outcomes(7),
        [&ActionUpdate::Started, &feedback, &ActionUpdate::Succeeded]
    );
    let expected = [(kind::REQUEST, "elbowroom"), (kind::CONFIRM, "robot1")];
    assert_eq!(scene.sent, expected.map(|(kind, node)| (kind, node.into())));
}

#[test]
fn a_request_that_is_lost_is_repeated_each_second() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.after(2, None);
    assert_eq!(scene.sent, vec![(kind::REQUEST, "elbowroom".into()); 3]);
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.after(2, Some(("robot1", state::RUNNING)));
    assert_eq!(scene.sent.len(), 4, "{:?}", scene.sent);
}

#[test]
fn a_repeated_answer_of_the_same_performer_changes_nothing() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    assert_eq!(scene.last_sent(), (kind::CONFIRM, "robot1"));
    assert_eq!(scene.outcomes(1), [&ActionUpdate::Started]);
}

#[test]
fn late_responses_are_rejected_and_ignored() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.says(kind::RESPONSE, "robot2", "move r a b");
    assert_eq!(scene.last_sent(), (kind::REJECT, "robot2"));
    scene.says(kind::FINISH, "robot2", "move r a b");
    assert_eq!(scene.outcomes(1), [&ActionUpdate::Started]);
    scene.says(kind::FINISH, "robot1", "move r a b");
    scene.says(kind::RESPONSE, "robot3", "move r a b");
    assert_eq!(scene.last_sent(), (kind::REJECT, "robot3"));
}

#[test]
fn unanswered_request_lists_known_performers() {
    let mut scene = Fixture::new();
    scene.begin(1, "pick r box");
    scene.after(31, Some(("robot1", state::READY)));
    let why = "no performer answered within 30 s; discovered performers: robot1 (move)";
    assert_eq!(scene.outcomes(1), [&failed(why)]);
    scene.says(kind::RESPONSE, "robot2", "pick r box");
    assert_eq!(scene.last_sent(), (kind::REJECT, "robot2"));
}

#[test]
fn a_failure_has_the_reason_that_the_performer_gives() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.says_more(
        kind::FINISH,
        "robot1",
        "move r a b",
        false,
        "the wheels slip",
    );
    assert_eq!(scene.outcomes(1)[1], &failed("the wheels slip"));
    scene.begin(2, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.says_more(kind::FINISH, "robot1", "move r a b", false, "");
    assert_eq!(scene.outcomes(2)[1], &failed("robot1 gave no reason"));
}

#[test]
fn a_repeated_finish_counts_once() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.says(kind::FINISH, "robot1", "move r a b");
    scene.says_more(kind::FINISH, "robot1", "move r a b", false, "");
    assert_eq!(
        scene.outcomes(1),
        [&ActionUpdate::Started, &ActionUpdate::Succeeded]
    );
}

#[test]
fn silent_performer_is_named_and_cancelled() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.after(20, Some(("robot1", state::RUNNING)));
    assert_eq!(scene.outcomes(1), [&ActionUpdate::Started]);
    scene.after(6, None);
    let why = "robot1 is lost: no message from it for 5 s";
    assert_eq!(scene.outcomes(1)[1..], [&failed(why)]);
    assert_eq!(scene.last_sent(), (kind::CANCEL, "robot1"));
    scene.says(kind::FINISH, "robot1", "move r a b");
    assert_eq!(scene.outcomes(1).len(), 2);
}

#[test]
fn feedback_is_a_sign_of_life() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.is_in(state::RUNNING, "robot1");
    for _ in 0..4 {
        scene.after(3, None);
        scene.says(kind::FEEDBACK, "robot1", "move r a b");
    }
    assert!(
        !scene
            .told
            .iter()
            .any(|(_, told)| matches!(told, ActionUpdate::Failed(_)))
    );
}

#[test]
fn action_fails_if_its_performer_is_idle() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.after(2, Some(("robot1", state::READY)));
    scene.after(1, Some(("robot1", state::RUNNING)));
    scene.after(3, Some(("robot1", state::READY)));
    assert_eq!(scene.outcomes(1), [&ActionUpdate::Started]);
    scene.after(1, Some(("robot1", state::READY)));
    let why = "robot1 is idle, and has not reported the outcome";
    assert_eq!(scene.outcomes(1)[1..], [&failed(why)]);
    assert_eq!(scene.last_sent(), (kind::CANCEL, "robot1"));
}

#[test]
fn a_performer_that_reports_the_state_failure_has_failed() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.is_in(state::FAILURE, "robot1");
    assert_eq!(scene.outcomes(1)[1], &failed("robot1 reports a failure"));
}

#[test]
fn cancelled_action_is_not_reassigned_before_confirmation() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.hub.cancel(1);
    scene.hub.cancel(1);
    scene.settle();
    assert_eq!(scene.sent[2..], [(kind::CANCEL, "robot1".to_owned())]);
    scene.is_in(state::RUNNING, "robot1");
    assert_eq!(scene.outcomes(1), [&ActionUpdate::Started]);
    scene.begin(2, "move r a b");
    let why = "robot1 has not confirmed that it has stopped the same action";
    assert_eq!(scene.outcomes(2), [&failed(why)]);
    scene.is_in(state::READY, "robot1");
    assert_eq!(
        scene.outcomes(1),
        [&ActionUpdate::Started, &ActionUpdate::Cancelled]
    );
    scene.begin(3, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    assert_eq!(scene.last_sent(), (kind::CONFIRM, "robot1"));
}

#[test]
fn unassigned_action_is_cancelled_at_once() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.hub.cancel(1);
    scene.settle();
    assert_eq!(scene.outcomes(1), [&ActionUpdate::Cancelled]);
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    assert_eq!(scene.last_sent(), (kind::REJECT, "robot1"));
}

#[test]
fn a_success_after_a_cancel_counts() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r a b");
    scene.says(kind::RESPONSE, "robot1", "move r a b");
    scene.hub.cancel(1);
    scene.says(kind::FINISH, "robot1", "move r a b");
    assert_eq!(
        scene.outcomes(1),
        [&ActionUpdate::Started, &ActionUpdate::Succeeded]
    );
}

#[test]
fn the_same_action_is_not_done_twice_at_a_time_but_others_are() {
    let mut scene = Fixture::new();
    scene.begin(1, "move r1 a b");
    scene.begin(2, "move r2 a b");
    scene.says(kind::RESPONSE, "robot1", "move r1 a b");
    scene.says(kind::RESPONSE, "robot2", "move r2 a b");
    scene.begin(3, "move r1 a b");
    let why = "robot1 is still busy with the same action";
    assert_eq!(scene.outcomes(3), [&failed(why)]);
    scene.says(kind::FINISH, "robot2", "move r2 a b");
    assert_eq!(scene.outcomes(1), [&ActionUpdate::Started]);
    assert_eq!(
        scene.outcomes(2),
        [&ActionUpdate::Started, &ActionUpdate::Succeeded]
    );
}

#[test]
fn an_action_without_arguments_may_come_as_its_own_argument() {
    for (ticket, text) in [(1, "beep"), (2, "beep beep")] {
        let mut scene = Fixture::new();
        scene.begin(ticket, "beep");
        scene.says(kind::RESPONSE, "robot1", text);
        scene.says(kind::FINISH, "robot1", text);
        assert_eq!(
            scene.outcomes(ticket),
            [&ActionUpdate::Started, &ActionUpdate::Succeeded]
        );
    }
}

#[test]
fn another_executor_on_the_topic_is_named_once() {
    let mut scene = Fixture::new();
    for name in ["executor", "elbowroom", "executor"] {
        scene.says(kind::REQUEST, name, "move r a b");
    }
    assert_eq!(scene.remarks.len(), 1);
    assert!(scene.remarks[0].contains("another executor, executor,"));
}
