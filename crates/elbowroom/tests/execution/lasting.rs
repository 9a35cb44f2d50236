//! Runs that go on when their goal is reached: what is asked of them while they run, and what comes
//! of it. No clock and no files: a script says when what is asked or seen.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use elbowroom::execute::{Embedded, Execution, read_goal};
use elbowroom::execution::run::{Report, RunSettings, Verdict};
use elbowroom::execution::{
    Command, Ending, Entry, Event, Observation, Passage, PlanAnswer, Planner, PlannerAnswer,
    Recorder, Request, Ticket, World, WorldError,
};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};

/// Robots that fetch things, in ten seconds, as long as there is power.
const DOMAIN: &str = "(define (domain errands) (:requirements :durative-actions :typing :fluents)
    (:types robot item)
    (:predicates (free ?r - robot) (here ?x - item) (have ?x - item) (power))
    (:functions (charge))
    (:durative-action fetch :parameters (?r - robot ?x - item) :duration (= ?duration 10)
      :condition (and (at start (free ?r)) (at start (here ?x)) (at start (>= (charge) 1))
        (over all (power)))
      :effect (and (at start (not (free ?r))) (at end (free ?r)) (at end (have ?x)))))";

const OBJECTS: &str = "(:objects r s - robot book cup key - item)";

fn task(init: &str, goal: &str) -> Arc<Task> {
    let problem = format!(
        "(define (problem day) (:domain errands) {OBJECTS}
           (:init (free r) (here book) (here cup) (here key) (power) (= (charge) 9) {init})
           (:goal {goal}))"
    );
    let source = |text: &str| Source::new("test", text);
    let read = pddl::read_problem(&source(DOMAIN), &source(&problem));
    Arc::new(Task::new(read.expect("a correct test").0))
}

/// A world in which actions take as long as planned, and in which a script says what else is seen
/// and asked. At its end, the run is asked to end.
pub(crate) struct Scripted {
    pub(crate) now: Rational,
    pub(crate) coming: Vec<Observation>,
    pub(crate) end: Rational,
    pub(crate) is_to_end: Arc<AtomicBool>,
    /// An action that takes so long, however long it was planned to.
    pub(crate) slow: Option<(&'static str, Rational)>,
    /// What is seen when something was cancelled.
    pub(crate) on_cancel: Option<Event>,
}

impl World for Scripted {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        let coming = &mut self.coming;
        let mut tell = |time: Rational, event: Event| coming.push(Observation { time, event });
        let measured = Vec::new;
        match command {
            Command::Start {
                ticket,
                action,
                duration,
            } => {
                let ticket = *ticket;
                let started = Event::Started {
                    ticket,
                    measured: measured(),
                };
                tell(now.clone(), started);
                if let Some(duration) = duration {
                    let slow = self.slow.as_ref().filter(|(name, _)| *name == action.name);
                    let duration = slow.map_or(duration, |(_, duration)| duration);
                    let ended = Event::Ended {
                        ticket,
                        ending: Ending::Succeeded,
                        measured: measured(),
                    };
                    tell(now + duration, ended);
                }
            }
            Command::Cancel { ticket } => {
                let about = *ticket;
                coming.retain(
                    |it| !matches!(it.event, Event::Ended { ticket, .. } if ticket == about),
                );
                let ended = Event::Ended {
                    ticket: about,
                    ending: Ending::Cancelled,
                    measured: measured(),
                };
                let time = now.clone();
                let seen = self.on_cancel.clone().into_iter().chain([ended]);
                coming.extend(seen.map(|event| Observation {
                    time: time.clone(),
                    event,
                }));
            }
        }
        Ok(())
    }

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        let until = until.min(&self.end).clone();
        let next = self.coming.iter().map(|it| it.time.clone()).min();
        let now = next.into_iter().chain([until]).min().unwrap_or_default();
        self.now = now.max(self.now.clone());
        if self.now >= self.end {
            self.is_to_end.store(true, Ordering::SeqCst);
        }
        let now = self.now.clone();
        let due = self.coming.extract_if(.., |it| it.time <= now).collect();
        Ok(Passage {
            now: self.now.clone(),
            observations: due,
        })
    }
}

/// What is said of each entry that matters here.
#[derive(Clone, Default)]
pub(crate) struct Notes(pub(crate) Arc<Mutex<Vec<String>>>);

impl Notes {
    fn note(&self, note: String) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(note);
    }
}

impl Recorder for Notes {
    fn record(&mut self, entry: &Entry<'_>) {
        let at = |time: &Rational| time.to_decimal(1);
        match entry {
            Entry::Command {
                now,
                command: Command::Start { action, .. },
                ..
            } => {
                self.note(format!("{}: start {}", at(now), action.name));
            }
            Entry::Command {
                now,
                command: Command::Cancel { .. },
                ..
            } => {
                self.note(format!("{}: cancel", at(now)));
            }
            Entry::Planning { now, reason, .. } => {
                self.note(format!("{}: plan, because {}", at(now), reason));
            }
            Entry::Kept { now, .. } => self.note(format!("{}: the plan is kept", at(now))),
            Entry::Resting {
                now,
                verdict,
                goals,
                ..
            } => {
                let verdict = verdict.map_or("no goals", Verdict::name);
                self.note(format!("{}: rest: {verdict} {}", at(now), goals.join(" ")));
            }
            Entry::Warning {
                now, action, until, ..
            } => {
                self.note(format!("{}: {action} must end by {}", at(now), at(until)));
            }
            Entry::Taken {
                remark: Some(remark),
                now,
                ..
            } => {
                self.note(format!("{}: {remark}", at(now)));
            }
            _ => {}
        }
    }
}

/// An embedded planner that counts how often it is asked.
struct Counting(Arc<Mutex<usize>>);

impl Planner for Counting {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        let answer = Embedded::default().plan(task, situation);
        PlannerAnswer {
            seconds: None,
            ..answer
        }
    }
}

struct Told {
    notes: Vec<String>,
    plans: usize,
    report: Report,
}

/// A run of that script until `end`, which goes on when its goal is reached.
fn run(task: &Arc<Task>, end: i64, script: Vec<(impl Into<Rational>, Event)>) -> Told {
    scripted(task, end, script, |execution| execution.lasting(true))
}

/// A run of that script until `end`, which can be paused and whose goal can be given up.
fn attended(task: &Arc<Task>, end: i64, script: Vec<(impl Into<Rational>, Event)>) -> Told {
    scripted(task, end, script, |execution| execution.attended(true))
}

fn scripted(
    task: &Arc<Task>,
    end: i64,
    script: Vec<(impl Into<Rational>, Event)>,
    kind: impl FnOnce(Execution<'_>) -> Execution<'_>,
) -> Told {
    let is_to_end = Arc::new(AtomicBool::new(false));
    let script = script.into_iter().map(|(time, event)| Observation {
        time: time.into(),
        event,
    });
    let mut world = Scripted {
        now: Rational::ZERO,
        coming: script.collect(),
        end: Rational::from(end),
        is_to_end: Arc::clone(&is_to_end),
        slow: None,
        on_cancel: None,
    };
    let (notes, plans) = (Notes::default(), Arc::new(Mutex::new(0)));
    let execution = Execution::of(task)
        .with_settings(RunSettings::default())
        .planned_by(Counting(Arc::clone(&plans)))
        .recorded_by(notes.clone())
        .ending_when(move || is_to_end.load(Ordering::SeqCst))
        .explaining();
    let report = kind(execution).run_in(&mut world);
    let notes = notes
        .0
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clone();
    let plans = *plans.lock().unwrap_or_else(PoisonError::into_inner);
    Told {
        notes,
        plans,
        report,
    }
}

fn pursue(name: &str, goal: &str) -> Event {
    let (name, goal) = (name.to_owned(), goal.to_owned());
    Event::Asked(Request::Pursue { name, goal })
}

fn abandon(name: &str) -> Event {
    let name = name.to_owned();
    Event::Asked(Request::Abandon { name })
}

fn fact(task: &Task, name: &str, truth: bool) -> Event {
    let fact = task.fact_named(name).expect("a correct test");
    Event::Fact { fact, truth }
}

fn has(told: &Told, note: &str) -> bool {
    told.notes.iter().any(|it| it.contains(note))
}

#[track_caller]
fn assert_has(told: &Told, notes: &[&str]) {
    let mut left = told.notes.iter();
    for note in notes {
        let found = left.any(|it| it.contains(note));
        assert!(found, "no `{note}` in its place in {:#?}", told.notes);
    }
}

#[test]
fn an_attended_run_is_over_with_its_goal_and_takes_no_other() {
    let task = task("", "(and (have book) (have cup))");
    let told = attended(&task, 100, vec![(5, pursue("key", "(have key)"))]);
    assert_has(&told, &["takes no other goals", "start"]);
    assert_eq!(told.report.verdict, Verdict::GoalReached);
    assert!(!has(&told, "key"), "{:#?}", told.notes);
    assert_eq!(told.plans, 1);
}

#[test]
fn an_attended_run_whose_goal_is_given_up_is_over_when_what_is_under_way_has_ended() {
    let task = task("", "(and (have book) (have cup))");
    let told = attended(&task, 100, vec![(5, abandon("problem"))]);
    let starts = told.notes.iter().filter(|it| it.contains("start"));
    assert_eq!(starts.count(), 1, "{:#?}", told.notes);
    assert!(!has(&told, "cancel") && !has(&told, "rest"));
    assert_eq!(told.report.verdict, Verdict::Interrupted);
    assert_eq!(told.report.time, Rational::from(10));
    assert_eq!(told.report.executed.len(), 1);
}

#[test]
fn an_attended_run_is_paused_between_two_actions() {
    let task = task("", "(and (have book) (have cup))");
    let script = vec![
        (5, Event::Asked(Request::Pause)),
        (30, Event::Asked(Request::Resume)),
    ];
    let told = attended(&task, 100, script);
    assert_has(&told, &["0: start", "30"]);
    assert_eq!(told.report.verdict, Verdict::GoalReached);
    assert!(
        told.report.time >= Rational::from(40),
        "{}",
        told.report.time
    );
    // A goal that is given up while it is paused ends it, too.
    let script = vec![
        (5, Event::Asked(Request::Pause)),
        (6, abandon("problem")),
        (30, Event::Asked(Request::Resume)),
    ];
    let told = attended(&task, 100, script);
    assert_eq!(told.report.verdict, Verdict::Interrupted);
}

#[test]
fn a_goal_is_reached_and_the_run_waits_for_the_next_one() {
    let task = task("", "(have book)");
    let told = run(&task, 100, vec![(40, pursue("cup", "(have cup)"))]);
    assert_has(
        &told,
        &[
            "start (fetch r book)",
            "rest: goal-reached problem",
            "40: plan, because the goals have changed: `cup` is to be reached",
            "40: start (fetch r cup)",
            "rest: goal-reached cup",
        ],
    );
    assert_eq!(told.report.verdict, Verdict::Interrupted);
}

#[test]
fn without_a_goal_nothing_is_done_until_one_is_given() {
    let task = task("", "(and)");
    let told = run(&task, 60, vec![(30, pursue("cup", "(have cup)"))]);
    assert_has(
        &told,
        &[
            "0: rest: no goals",
            "30: start (fetch r cup)",
            "rest: goal-reached cup",
        ],
    );
    assert_eq!(told.plans, 1);
}

#[test]
fn a_goal_that_the_rest_of_the_plan_reaches_too_costs_no_new_plan() {
    let task = task("", "(and (have book) (have cup))");
    let told = run(
        &task,
        60,
        vec![(5, pursue("again", "(or (have cup) (have key))"))],
    );
    assert_has(
        &told,
        &["5: the plan is kept", "rest: goal-reached problem again"],
    );
    assert_eq!(
        (told.plans, told.report.starts),
        (1, 2),
        "{:#?}",
        told.notes
    );
}

#[test]
fn what_is_running_goes_on_when_a_goal_comes_or_goes() {
    let task = task("", "(and (have book) (have cup))");
    for change in [pursue("key", "(have key)"), abandon("problem")] {
        let told = run(&task, 100, vec![(5, change)]);
        assert!(!has(&told, "cancel"), "{:#?}", told.notes);
        let first = &told.report.executed[0];
        assert_eq!(first.ending, Some(Ending::Succeeded));
        assert_eq!(first.step.duration, Some(Rational::from(10)));
    }
}

#[test]
fn of_an_abandoned_goal_nothing_more_is_started() {
    let task = task("", "(and (have book) (have cup))");
    let told = run(&task, 100, vec![(5, abandon("problem"))]);
    assert_has(&told, &["5: rest: no goals"]);
    assert_eq!(told.report.starts, 1);
}

#[test]
fn of_several_goals_the_others_are_pursued_when_one_is_abandoned() {
    let task = task("", "(have book)");
    let script = vec![
        (1, pursue("cup", "(have cup)")),
        (2, pursue("key", "(have key)")),
        (3, abandon("cup")),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &["start (fetch r key)", "rest: goal-reached problem key"],
    );
    assert!(!has(&told, "start (fetch r cup)"), "{:#?}", told.notes);
}

#[test]
fn a_goal_of_the_same_name_takes_the_place_of_the_earlier_one() {
    let task = task("", "(and)");
    let script = vec![
        (1, pursue("it", "(have cup)")),
        (30, pursue("it", "(have key)")),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "rest: goal-reached it",
            "start (fetch r key)",
            "rest: goal-reached it",
        ],
    );
    let script = vec![
        (1, pursue("a", "(have book)")),
        (2, pursue("it", "(have cup)")),
        (3, pursue("it", "(have key)")),
    ];
    let told = run(&task, 100, script);
    assert!(!has(&told, "start (fetch r cup)"), "{:#?}", told.notes);
    assert_has(&told, &["start (fetch r key)", "rest: goal-reached a it"]);
}

#[test]
fn a_changed_fact_that_the_plan_can_bear_changes_nothing_and_another_makes_a_new_plan() {
    let task = task("", "(and (have book) (have cup))");
    let told = run(&task, 60, vec![(5, fact(&task, "(here key)", false))]);
    assert_eq!(told.plans, 1, "{:#?}", told.notes);
    // Somebody has brought the cup already, and taken it from where it was.
    let gone = [
        fact(&task, "(here cup)", false),
        fact(&task, "(have cup)", true),
    ];
    let told = run(&task, 60, gone.into_iter().map(|it| (5_i64, it)).collect());
    assert_has(&told, &["rest: goal-reached problem"]);
    assert_eq!(told.report.starts, 1, "{:#?}", told.notes);
}

#[test]
fn a_changed_number_counts_for_what_comes_next() {
    let task = task("", "(and (have book) (have cup))");
    let fluent = task.fluent_named("(charge)").expect("a correct test");
    let value = |value: i64| Event::Value {
        fluent,
        value: Rational::from(value),
    };
    let told = run(&task, 100, vec![(5, value(0)), (50, value(3))]);
    assert_has(
        &told,
        &[
            "rest: unsolvable-from-here problem",
            "50: plan",
            "50: start",
            "rest: goal-reached problem",
        ],
    );
}

#[test]
fn where_no_plan_reaches_the_goals_the_run_says_so_and_takes_others() {
    let task = task("", "(have book)");
    let gone = fact(&task, "(here cup)", false);
    let script = vec![
        (20, gone),
        (30, pursue("cup", "(have cup)")),
        (40, abandon("cup")),
        (50, pursue("key", "(have key)")),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "30: plan",
            "rest: unsolvable-from-here cup",
            "40: rest: no goals",
            "50: start (fetch r key)",
            "rest: goal-reached key",
        ],
    );
}

#[test]
fn news_end_a_rest_but_not_more_often_than_once_a_second() {
    let task = task("", "(and (have book) (have cup))");
    let at = |time: Rational, name: &str, truth: bool| (time, fact(&task, name, truth));
    let mut script = Vec::new();
    for (time, truth) in [(5, false), (30, true)] {
        let time = Rational::from(time);
        script.push(at(time.clone(), "(here book)", truth));
        script.push(at(time, "(here cup)", truth));
    }
    // Something else flickers a hundred times in two seconds.
    script.extend((0..100).map(|n| at(Rational::new(1000 + n, 50), "(here key)", n % 2 == 1)));
    let told = run(&task, 60, script);
    assert_has(
        &told,
        &[
            "rest: unsolvable-from-here",
            "30: plan",
            "rest: goal-reached problem",
        ],
    );
    assert!(told.plans <= 8, "{} plans: {:#?}", told.plans, told.notes);
}

#[test]
fn in_a_pause_nothing_is_started_and_what_runs_goes_on() {
    let task = task("", "(and (have book) (have cup))");
    let script = vec![
        (5, Event::Asked(Request::Pause)),
        (7, pursue("key", "(have key)")),
        (50, Event::Asked(Request::Resume)),
    ];
    let told = run(&task, 100, script);
    let starts = |from: i64, to: i64| {
        let steps = told.report.executed.iter().map(|it| it.step.start.clone());
        let meanwhile = |it: &Rational| *it >= Rational::from(from) && *it < Rational::from(to);
        steps.filter(meanwhile).count()
    };
    assert_eq!(
        (starts(0, 5), starts(5, 50), starts(50, 100)),
        (1, 0, 2),
        "{:#?}",
        told.notes
    );
    assert_eq!(told.report.executed[0].ending, Some(Ending::Succeeded));
    assert_has(&told, &["50: plan", "rest: goal-reached problem key"]);
}

#[test]
fn after_a_pause_across_a_deadline_the_run_says_that_it_is_too_late() {
    let task = task("(at 40 (not (power)))", "(and (have book) (have cup))");
    let script = vec![
        (5, Event::Asked(Request::Pause)),
        (50, Event::Asked(Request::Resume)),
        (60, fact(&task, "(power)", true)),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "50: plan",
            "rest: unsolvable-from-here problem",
            "60: plan",
            "rest: goal-reached",
        ],
    );
}

#[test]
fn what_makes_no_sense_is_passed_over_with_a_remark() {
    let task = task("", "(have book)");
    let script = vec![
        (1, pursue("odd", "(have spoon)")),
        (2, abandon("odd")),
        (3, Event::Asked(Request::Resume)),
    ];
    let told = run(&task, 60, script);
    assert_has(
        &told,
        &[
            "1: it is no goal of this problem",
            "2: no goal of that name is open",
            "3: it is not paused",
            "rest: goal-reached problem",
        ],
    );
    assert_eq!(told.plans, 1);
}

#[test]
fn a_run_that_ends_with_its_goal_takes_no_requests() {
    let task = task("", "(have book)");
    let mut world = Scripted {
        now: Rational::ZERO,
        coming: vec![Observation {
            time: Rational::ONE,
            event: Event::Asked(Request::Pause),
        }],
        end: Rational::from(60),
        is_to_end: Arc::default(),
        slow: None,
        on_cancel: None,
    };
    let notes = Notes::default();
    let report = Execution::of(&task)
        .recorded_by(notes.clone())
        .run_in(&mut world);
    assert_eq!(report.verdict, Verdict::GoalReached);
    let notes = notes
        .0
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clone();
    assert!(
        notes.iter().any(|it| it.contains("takes no requests")),
        "{notes:?}"
    );
}

#[test]
fn a_goal_is_read_as_in_a_problem_and_mistakes_are_named() {
    let task = task("", "(have book)");
    for goal in [
        "(have cup)",
        "(and (have cup) (not (here key)))",
        "(>= (charge) 3)",
    ] {
        assert!(read_goal(&task, goal).is_ok(), "{goal}");
    }
    let forall = "(forall (?x - item) (have ?x))";
    assert!(read_goal(&task, forall).is_ok());
    for (goal, why) in [
        ("", "an empty goal"),
        ("(have spoon)", "spoon"),
        ("(hav cup)", "did you mean `have`"),
        ("(have cup) (have key)", "a second condition"),
        ("(have cup", "without a matching"),
    ] {
        let told = read_goal(&task, goal).expect_err(goal);
        assert!(told.contains(why), "{goal}: {told}");
        assert!(!told.contains('\n'), "{told}");
    }
}

/// Whatever is asked, in whatever order: nothing is started while the run is paused, nothing is
/// started twice at a time, and tickets are never given again.
#[test]
fn whatever_is_asked_the_run_stays_in_order() {
    let task = task("(free s)", "(have book)");
    for seed in 0..60_u64 {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut below = |limit: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) % limit
        };
        let items = ["book", "cup", "key"];
        let mut script = Vec::new();
        let mut pauses = Vec::new();
        let mut paused_at = None;
        for time in 1..40 {
            let item = items[usize::try_from(below(3)).expect("small")];
            let event = match below(8) {
                0 | 1 => pursue(item, &format!("(have {item})")),
                2 => abandon(item),
                3 => fact(&task, &format!("(have {item})"), false),
                4 => fact(&task, &format!("(here {item})"), below(2) == 0),
                5 if paused_at.is_none() => {
                    paused_at = Some(time);
                    Event::Asked(Request::Pause)
                }
                6 => {
                    pauses.extend(paused_at.take().map(|from| (from, time)));
                    Event::Asked(Request::Resume)
                }
                _ => continue,
            };
            script.push((time, event));
        }
        pauses.extend(paused_at.map(|from| (from, 1000)));
        let told = run(&task, 80, script);
        assert_eq!(told.report.verdict, Verdict::Interrupted, "{seed}");
        let mut tickets: Vec<Ticket> = Vec::new();
        for done in &told.report.executed {
            let start = &done.step.start;
            for (from, to) in &pauses {
                let is_inside = *start > Rational::from(*from) && *start < Rational::from(*to);
                assert!(!is_inside, "{seed}: started in a pause: {:#?}", told.notes);
            }
            assert!(!tickets.contains(&done.ticket), "{seed}");
            tickets.push(done.ticket);
        }
        let spans = told.report.executed.iter().map(|it| {
            let end = &it.step.start + it.step.duration.clone().unwrap_or_default();
            let robot = it.step.action.name.split(' ').nth(1).unwrap_or_default();
            (robot, it.step.start.clone(), end)
        });
        let spans: Vec<_> = spans.collect();
        for (index, one) in spans.iter().enumerate() {
            for other in &spans[index + 1..] {
                let overlap = one.0 == other.0 && one.1 < other.2 && other.1 < one.2;
                assert!(
                    !overlap,
                    "{seed}: one robot does two things: {:#?}",
                    told.notes
                );
            }
        }
    }
}

/// The planner of a test answers this, too.
#[test]
fn a_plan_that_was_made_for_goals_that_have_changed_since_is_not_begun() {
    /// Takes five seconds of the world's time.
    struct Slow;
    impl Planner for Slow {
        fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
            let answer = Embedded::default().plan(task, situation).answer;
            assert!(matches!(answer, PlanAnswer::Plan(_)));
            PlannerAnswer {
                answer,
                seconds: Some(Rational::from(5)),
            }
        }
    }
    let task = task("", "(and)");
    let is_to_end = Arc::new(AtomicBool::new(false));
    let script = [
        (10, pursue("it", "(have cup)")),
        (12, pursue("it", "(have key)")),
    ];
    let coming = script.map(|(time, event)| Observation {
        time: Rational::from(time),
        event,
    });
    let mut world = Scripted {
        now: Rational::ZERO,
        coming: coming.into(),
        end: Rational::from(60),
        is_to_end: Arc::clone(&is_to_end),
        slow: None,
        on_cancel: None,
    };
    let notes = Notes::default();
    let report = Execution::of(&task)
        .planned_by(Slow)
        .recorded_by(notes.clone())
        .ending_when(move || is_to_end.load(Ordering::SeqCst))
        .lasting(true)
        .run_in(&mut world);
    let names: Vec<_> = report
        .executed
        .iter()
        .map(|it| it.step.action.name.as_str())
        .collect();
    assert_eq!(names, ["(fetch r key)"]);
}
