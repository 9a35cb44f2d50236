//! Learning from logs of known worlds: distributions, failures, and coverage of prediction
//! intervals.

use std::sync::Arc;

use elbowroom::answers::NoObserver;
use elbowroom::answers::learn::{
    ConformalBox, ConformalRequest, LearnAnswer, LearnRequest, LearntDurations, Log, Settings,
    Verdict, learn,
};
use elbowroom::answers::run::{run as answer_run, simulate};
use elbowroom::envelope::Guarantee;
use elbowroom::execute::{NamedText, RunInputs, RunSpec, WorldNames};
use elbowroom::execution::run::{TimeoutRule, Verdict as Ended};
use elbowroom::execution::{Command, Observation, TimeAdvance, World, WorldError};
use elbowroom::learning::records::{Outcome, Record, of_trace};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::{End, Rational};
use elbowroom::pddl::{read_plan, read_problem};
use elbowroom::report::trace::{Stored, TraceWriter};
use elbowroom::sim::WorldModel;
use elbowroom::text::Source;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::Distribution as _;

const DOMAIN: &str = include_str!("../../../../cases/delivery/domain.pddl");
const PROBLEM: &str = include_str!("../../../../cases/delivery/problem.pddl");
const PLAN: &str = include_str!("../../../../cases/delivery/plan.plan");

/// Drives are sometimes slow, unlocking starts late, and picking can fail midway.
const WORLD: &str = "format = \"elbowroom-world\"\nversion = 1\n\
    [[duration]]\naction = \"drive\"\nnormal = { mean = 1.2, deviation = 0.2 }\nrelative = true\n\
    [[duration]]\naction = \"unlock\"\nuniform = { from = 5, to = 15 }\n\
    [[delay]]\naction = \"unlock\"\nuniform = { from = 0, to = 2 }\n\
    [[failure]]\naction = \"pick\"\nprobability = 0.2\nwhen = \"midway\"\n";

fn spec(world: &str, seed: u64) -> RunSpec {
    let named = |name: &str, text: &str| NamedText {
        name: name.to_owned(),
        text: text.to_owned(),
    };
    RunSpec {
        world: Some(world.to_owned()),
        seed,
        has_plan: true,
        ..RunSpec::new(named("domain.pddl", DOMAIN), named("problem.pddl", PROBLEM))
    }
}

fn problem() -> (Arc<Task>, TimeTriggeredPlan) {
    let (problem, _) =
        read_problem(&Source::from(DOMAIN), &Source::from(PROBLEM)).expect("a correct test");
    let task = Arc::new(Task::new(problem));
    let (plan, _) = read_plan(&Source::from(PLAN), &task).expect("a correct test");
    (task, plan)
}

/// Runs in the world. Returns the trace, and `true` if the goal was reached.
fn run(world: &str, seed: u64) -> (String, bool) {
    let (task, plan) = problem();
    let spec = spec(world, seed);
    let mut text = String::new();
    let mut sink = |line: &str| text.push_str(line);
    let mut writer = TraceWriter::new(Arc::clone(&task), &mut sink);
    writer.header(&spec).expect("texts and numbers");
    let inputs = RunInputs::of(spec, Arc::clone(&task), &WorldNames::default()).expect("a world");
    let execution = inputs.execution(None).expect("a consistent specification");
    let execution = execution.beginning_with(plan).recorded_by(&mut writer);
    let outcome = simulate(&inputs, execution, &mut NoObserver).expect("a world");
    let is_done = *outcome.verdict() == Ended::GoalReached;
    drop(writer);
    (text, is_done)
}

fn logs(count: u64) -> Vec<Log> {
    (0..count)
        .map(|seed| {
            let (trace, _) = run(WORLD, seed);
            Log::read(&Source::new(format!("run {seed}"), trace)).expect("a trace")
        })
        .collect()
}

fn learnt(logs: Vec<Log>, inside: Option<ConformalRequest>) -> LearnAnswer {
    let request = LearnRequest {
        logs,
        settings: Settings::default(),
        conformal_box: inside,
        expected: None,
    };
    learn(&request, &mut NoObserver).expect("an answer")
}

#[test]
fn true_world_is_recovered_from_traces() {
    let (task, _) = problem();
    for count in [20, 50, 200] {
        let answer = learnt(logs(count), None);
        let of = |name: &str| {
            let action = answer.actions.iter().find(|action| action.action == name);
            action.expect("it was executed")
        };
        let LearntDurations::Relative { group } = &of("drive").durations else {
            panic!("{count}: {:?}", of("drive"));
        };
        let error = group
            .fit
            .standard_error
            .expect("a normal or lognormal distribution");
        assert!(
            (group.fit.mean - 1.2).abs() <= 3.5 * error,
            "{count}: {group:?}"
        );
        let pick = &of("pick").failures;
        let (lower, upper) = pick.interval.expect("picks have ended");
        assert!(lower <= 0.2 && 0.2 <= upper, "{count}: {pick:?}");
        assert_eq!(pick.when.as_deref(), Some("midway"), "{count}: {pick:?}");
        assert!(of("unlock").delay.is_some(), "{count}");
        assert!(of("drive").delay.is_none(), "{count}");
        let drift = of("drive")
            .drift
            .as_ref()
            .expect("drives are described together");
        assert_eq!(drift.since, None);
        // The learnt world file can be read.
        let source = Source::new("learnt.toml", answer.world.clone());
        WorldModel::read(source, task.problem()).expect("a world file");
        // No drive of the logs reaches its time-out, and future ones hardly ever do.
        let timeouts = answer.timeouts.as_deref().expect("durations were learnt");
        let timeouts: TimeoutRule = timeouts.parse().expect("a rule");
        let limit = |action: &str, planned: i64| {
            let limit = timeouts.of(action, &Rational::from(planned));
            limit.expect("all time out").to_f64()
        };
        // About twice the mean, and four to five standard deviations.
        let drive = limit("(drive rover depot shelf)", 100);
        assert!((300.0..700.0).contains(&drive), "{count}: {drive}");
        let unlock = limit("(unlock office)", 6);
        assert!((26.0..40.0).contains(&unlock), "{count}: {unlock}");
        assert!(limit("(fly rover)", 1) > 599.0, "the default");
        // The answer can be serialized.
        let json = serde_json::to_string(&answer).expect("texts and numbers");
        let read: LearnAnswer = serde_json::from_str(&json).expect("an answer");
        assert_eq!(read, answer);
    }
}

#[test]
fn runs_in_learnt_world_match_true_world() {
    let learnt = learnt(logs(200), None).world;
    let rate = |world: &str| {
        let done = (1000..1400).filter(|&seed| run(world, seed).1).count();
        f64::from(u32::try_from(done).expect("few runs")) / 400.0
    };
    let (true_rate, learnt_rate) = (rate(WORLD), rate(&learnt));
    // Twice the standard deviation of the difference of two rates of 400 runs.
    assert!(
        (true_rate - learnt_rate).abs() < 0.07,
        "{true_rate} {learnt_rate}"
    );
}

/// Cancelled actions have long durations; without them, all durations would look short.
#[test]
fn censored_durations_are_used() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let drawn = rand_distr::Normal::new(10.0, 3.0).expect("a distribution");
    let records: Vec<Record> = (0..300)
        .map(|_| {
            let duration: f64 = drawn.sample(&mut rng);
            let is_cancelled = duration > 11.0;
            Record {
                action: "(drive a b)".to_owned(),
                commanded: Some(0.0),
                start: Some(0.0),
                end: duration.min(11.0),
                outcome: if is_cancelled {
                    Outcome::Cancelled
                } else {
                    Outcome::Succeeded
                },
                planned: None,
            }
        })
        .collect();
    let mean = |records: Vec<Record>| {
        let name = "log".to_owned();
        let answer = learnt(
            vec![Log {
                name,
                records,
                fact_history: None,
                world: None,
            }],
            None,
        );
        match &answer.actions[0].durations {
            LearntDurations::Together { group } => group.fit.mean,
            other => panic!("{other:?}"),
        }
    };
    let whole: Vec<Record> = records
        .iter()
        .filter(|record| record.outcome == Outcome::Succeeded)
        .cloned()
        .collect();
    let with = mean(records);
    let without = mean(whole);
    assert!((with - 10.0).abs() < 0.5, "{with}");
    assert!(without < 9.2, "{without}");
}

/// The intervals contain all durations of the next run with the promised frequency, up to the
/// sampling error.
#[test]
fn conformal_intervals_contain_the_next_run() {
    let (task, plan) = problem();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let shape = rand_distr::LogNormal::new(0.0, 0.25).expect("a distribution");
    let (mut held, mut answered) = (0_u32, 0_u32);
    let repetitions = 150;
    for _ in 0..repetitions {
        let run = |rng: &mut ChaCha8Rng| -> Vec<Record> {
            plan.steps
                .iter()
                .map(|step| {
                    let planned = step.duration.as_ref().map(elbowroom::num::Rational::to_f64);
                    let duration = planned.unwrap_or(0.0) * shape.sample(rng);
                    Record {
                        action: step.action.name.clone(),
                        commanded: Some(0.0),
                        start: Some(0.0),
                        end: duration,
                        outcome: Outcome::Succeeded,
                        planned,
                    }
                })
                .collect()
        };
        let logs = (0..80).map(|number| Log {
            name: number.to_string(),
            records: run(&mut rng),
            fact_history: None,
            world: None,
        });
        let inside = ConformalRequest {
            task: Arc::clone(&task),
            plan: plan.clone().into(),
            guarantee: Guarantee::Dynamic,
            probability: 0.7,
        };
        let logs = logs.collect();
        let found = learnt(logs, Some(inside)).inside.expect("it was asked");
        assert_ne!(found.verdict, Verdict::TooFew);
        assert_ne!(found.verdict, Verdict::NoEnvelope);
        let next = run(&mut rng);
        let is_held = found.intervals.iter().all(|interval| {
            let own = next.iter().find(|record| record.action == interval.action);
            let duration = own.expect("each action is executed").end;
            let above = |end: &End, otherwise: f64| match end.value() {
                Some(value) => value.to_f64(),
                None => otherwise,
            };
            above(&interval.lower, 0.0) <= duration
                && duration <= above(&interval.upper, f64::INFINITY)
        });
        held += u32::from(is_held);
        answered += 1;
    }
    let rate = f64::from(held) / f64::from(answered);
    let slack = 3.0 * (0.7_f64 * 0.3 / f64::from(answered)).sqrt();
    assert!(rate >= 0.7 - slack, "{rate}");
}

#[test]
fn too_few_samples_are_reported() {
    let (task, plan) = problem();
    let inside = ConformalRequest {
        task,
        plan: plan.into(),
        guarantee: Guarantee::Dynamic,
        probability: 0.99,
    };
    let found = learnt(logs(5), Some(inside)).inside.expect("it was asked");
    assert_eq!(found.verdict, Verdict::TooFew);
    assert!(
        found
            .intervals
            .iter()
            .all(|interval| interval.needed.is_some())
    );
}

/// The water boils 10 after the beginning. Fetching takes up to 14 in the logs, but 5 in the plan.
fn fetching(throughout: &str) -> ConformalBox {
    let domain = format!(
        "(define (domain d) (:predicates (boiled) (fetched)) (:functions (heat))
        (:process heats :effect (increase (heat) (* #t 1)))
        (:event boils :precondition (and (not (boiled)) (>= (heat) 10)) :effect (boiled))
        (:durative-action fetch :duration (= ?duration 5) :condition {throughout}
         :effect (at end (fetched))))"
    );
    let problem = "(define (problem p) (:domain d) (:init (= (heat) 0)) (:goal (fetched)))";
    let read = read_problem(
        &Source::new("domain.pddl", domain),
        &Source::new("problem.pddl", problem),
    );
    let task = Arc::new(Task::new(read.expect("no mistakes").0));
    let plan = read_plan(&Source::new("plan", "0: (fetch) [5]"), &task);
    let logs = (0..40).map(|number| Log {
        name: number.to_string(),
        records: vec![Record {
            action: "(fetch)".to_owned(),
            commanded: Some(0.0),
            start: Some(0.0),
            end: 4.0 + f64::from(number % 11),
            outcome: Outcome::Succeeded,
            planned: Some(5.0),
        }],
        fact_history: None,
        world: None,
    });
    let inside = ConformalRequest {
        task,
        plan: plan.expect("a plan").0.into(),
        guarantee: Guarantee::Dynamic,
        probability: 0.9,
    };
    let found = learnt(logs.collect(), Some(inside)).inside;
    found.expect("it was asked")
}

#[test]
fn plan_feasible_in_other_trajectory_is_not_reported_as_failing() {
    let found = fetching("(and)");
    assert_eq!(found.verdict, Verdict::Undecided);
    let reason = found.reason.expect("a reason");
    assert!(reason.contains("the event (boils)"), "{reason}");
    // If the water must not boil meanwhile, the plan fails.
    let found = fetching("(over all (not (boiled)))");
    assert_eq!(found.verdict, Verdict::Outside, "{found:?}");
    let reason = found.reason.expect("a reason");
    assert!(reason.contains("boil"), "{reason}");
}

/// Only believed events count, and a truncated log has actions that are still running.
#[test]
fn truncated_trace_is_read_to_its_end() {
    let (trace, _) = run(WORLD, 3);
    let whole = of_trace(&Stored::read(&trace).expect("a trace"));
    assert!(
        whole
            .iter()
            .any(|record| record.outcome == Outcome::Succeeded)
    );
    for lines in 2..trace.lines().count() {
        let part: Vec<&str> = trace.lines().take(lines).collect();
        let records = of_trace(&Stored::read(&part.join("\n")).expect("a trace"));
        assert!(records.len() <= whole.len());
        for (record, later) in records.iter().zip(&whole) {
            assert_eq!(record.action, later.action);
            assert!(record.end <= later.end, "{record:?} {later:?}");
        }
    }
}

/// Doors are unlocked and locked spontaneously, at rates. The robot unlocks one of them itself.
#[test]
fn rates_are_recovered_without_counting_actions_and_deadlines() {
    const UP: f64 = 0.01;
    const DOWN: f64 = 0.04;
    let world = format!(
        "{WORLD}[[hazard]]\nfact = \"unlocked\"\nbecomes_true_per_second = {UP}\n\
         becomes_false_per_second = {DOWN}\n"
    );
    for count in [20, 50, 200] {
        let logs = (0..count).map(|number| {
            let (trace, _) = run(&world, 1000 * count + number);
            Log::read(&Source::new(format!("run {number}"), trace)).expect("a trace")
        });
        let answer = learnt(logs.collect(), None);
        // Neither the effects of drives and picks, nor the closing of the counter.
        let found: Vec<_> = answer
            .changes
            .iter()
            .map(|it| (it.predicate.as_str(), it.becomes))
            .collect();
        assert_eq!(found, [("unlocked", false), ("unlocked", true)], "{count}");
        for (learnt, truth) in answer.changes.iter().zip([DOWN, UP]) {
            let found = learnt.all.per_second.expect("there was time");
            let error = (truth / learnt.all.seconds).sqrt();
            assert!(learnt.all.changes > 2, "{count}: {learnt:?}");
            assert!((found - truth).abs() <= 3.5 * error, "{count}: {learnt:?}");
            assert!(learnt.apart.is_empty(), "{count}: {learnt:?}");
        }
        // The learnt model can be simulated.
        let (task, _) = problem();
        let model = WorldModel::read(answer.world.as_str(), task.problem());
        let model = model.expect("a correct world file");
        let hazard = model.hazard("(unlocked office)").expect("it has rates");
        let learnt: Vec<_> = answer.changes.iter().map(|it| it.all.per_second).collect();
        assert_eq!(
            learnt,
            [Some(hazard.becomes_false), Some(hazard.becomes_true)]
        );
    }
}

/// A failed pick leaves the parcel where it was. This is not a spontaneous change.
#[test]
fn undone_effects_are_not_spontaneous_changes() {
    let world = WORLD.replace("when = \"midway\"", "when = \"midway\"\nundone = true");
    let undone = (0..20).map(|seed| {
        let (trace, _) = run(&world, seed);
        Log::read(&Source::new(format!("run {seed}"), trace)).expect("a trace")
    });
    let answer = learnt(undone.collect(), None);
    let picks = answer.actions.iter().find(|action| action.action == "pick");
    let failures = &picks.expect("it was executed").failures;
    assert!(failures.failed > 0);
    assert_eq!(failures.undone, Some((failures.failed, failures.failed)));
    assert!(answer.world.contains("undone = true"), "{}", answer.world);
    assert_eq!(answer.changes, []);
    // If failures are not undone, the start effects remain.
    let answer = learnt(logs(20), None);
    let picks = answer.actions.iter().find(|action| action.action == "pick");
    let failures = &picks.expect("it was executed").failures;
    assert_eq!(failures.undone, Some((0, failures.failed)));
    assert!(!answer.world.contains("undone = true"), "{}", answer.world);
}

/// With the true rates, the number of observed changes is as expected. With other rates the answer
/// reports the difference, including facts that never changed.
#[test]
fn expected_and_observed_changes_are_both_reported() {
    let world = format!(
        "{WORLD}[[hazard]]\nfact = \"unlocked\"\nbecomes_true_per_second = 0.01\n\
         becomes_false_per_second = 0.04\n"
    );
    let logs: Vec<Log> = (0..50)
        .map(|number| {
            let (trace, _) = run(&world, number);
            Log::read(&Source::new(format!("run {number}"), trace)).expect("a trace")
        })
        .collect();
    let asked = |logs: &[Log], expected: &str| {
        let request = LearnRequest {
            logs: logs.to_vec(),
            settings: Settings::default(),
            conformal_box: None,
            expected: Some(Source::new("expected.toml", expected)),
        };
        learn(&request, &mut NoObserver)
    };
    let answer = asked(&logs, &world).expect("an answer");
    assert_eq!(answer.changes.len(), 2);
    for (learnt, rate) in answer.changes.iter().zip([0.04, 0.01]) {
        let expected = learnt.all.expected.expect("it was asked for");
        assert!((expected - rate * learnt.all.seconds).abs() < 1e-6 * expected);
        #[allow(clippy::cast_precision_loss, reason = "few changes")]
        let seen = learnt.all.changes as f64;
        assert!(
            (seen - expected).abs() <= 3.5 * expected.sqrt(),
            "{learnt:?}"
        );
    }
    // Two predicates: one changed unexpectedly, and the other did not change as expected.
    let other = "format = \"elbowroom-world\"\nversion = 1\n[[hazard]]\nfact = \"idle\"\n\
                 becomes_false_per_second = 0.5\n";
    let answer = asked(&logs, other).expect("an answer");
    let told: Vec<_> = answer
        .changes
        .iter()
        .map(|it| (it.predicate.as_str(), it.becomes, it.all.changes > 0))
        .collect();
    assert_eq!(
        told,
        [
            ("idle", false, false),
            ("unlocked", false, true),
            ("unlocked", true, true)
        ]
    );
    assert!(answer.changes[0].all.expected > Some(1.0));
    assert_eq!(answer.changes[1].all.expected, Some(0.0));
    // The answer lists what cannot be compared.
    let without_facts: Vec<Log> = logs
        .iter()
        .cloned()
        .map(|log| Log {
            fact_history: None,
            world: None,
            ..log
        })
        .collect();
    let refused = asked(&without_facts, &world).expect_err("tables tell nothing of facts");
    assert!(
        refused
            .to_string()
            .contains("tables of attempts contain no facts")
    );
    let wrong = world.replace("\"unlocked\"", "\"unlokced\"");
    let refused = asked(&logs, &wrong).expect_err("no such predicate");
    assert!(refused.to_string().contains("unlocked"), "{refused}");
}

/// World whose reports are slightly earlier than they are made, as with rounded binary numbers.
struct Early<'a>(Box<dyn World + 'a>);

impl World for Early<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.0.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let mut passage = self.0.wait(until)?;
        for observation in &mut passage.observations {
            observation.time = &passage.now + Rational::new(1, 1_000_000_000);
        }
        Ok(passage)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.0.look(facts, fluents)
    }
}

#[test]
fn reports_with_corrected_times_count() {
    let (task, plan) = problem();
    let spec = spec(WORLD, 3);
    let mut text = String::new();
    let mut sink = |line: &str| text.push_str(line);
    let mut writer = TraceWriter::new(Arc::clone(&task), &mut sink);
    writer.header(&spec).expect("texts and numbers");
    let inputs = RunInputs::of(spec, Arc::clone(&task), &WorldNames::default()).expect("a world");
    let model = inputs.simulation().expect("a simulation");
    let mut world = Early(model.world(&task, inputs.spec().seed));
    let execution = inputs.execution(None).expect("a consistent specification");
    let execution = execution.beginning_with(plan).recorded_by(&mut writer);
    answer_run(&inputs, execution, &mut world, &mut NoObserver).expect("a run");
    drop(writer);
    assert!(text.contains("taken as now"), "{text}");
    let records = of_trace(&Stored::read(&text).expect("a trace"));
    assert!(records.len() > 4, "{records:?}");
    for record in &records {
        assert!(record.start.is_some(), "{record:?}");
        assert!(record.outcome != Outcome::Running, "{record:?}");
    }
}
