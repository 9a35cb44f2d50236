//! Choice among many plans by their probability or their slack.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use elbowroom::answers::odds::{OddsFinding, OddsRequest, OddsSettings, odds};
use elbowroom::answers::plan::{
    BestPlanRequest, PlanAim, PlanChoice, PlanFinding, PlanOutcome, PlanStop, PlanValue, best_plan,
};
use elbowroom::answers::run::simulate;
use elbowroom::answers::{NoObserver, Observer, StopRequest};
use elbowroom::execute::{
    Candidates, Choice, Embedded, Execution, FirstPlan, Limits, NamedText, PlanSelector,
    Replanning, Rollouts, RunInputs, RunSpec, Value, WorldKnowledge,
};
use elbowroom::execution::run::{PlanningTime, RunSettings, Verdict};
use elbowroom::execution::{Entry, Planner, Recorder};
use elbowroom::model::validate::{Settings, validate};
use elbowroom::model::{Situation, Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};
use elbowroom::pipeline;
use elbowroom::probability::{Likelihoods, likelihoods};
use elbowroom::sim::WorldModel;

const WORLDS: [&str; 5] = ["counter", "weld", "detour", "rendezvous", "door"];

fn text(path: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    std::fs::read_to_string(root.join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn task(folder: &str) -> Arc<Task> {
    let [domain, problem] = ["domain", "problem"]
        .map(|name| Source::new(name, text(&format!("{folder}/{name}.pddl")).as_str()));
    Arc::new(Task::new(pddl::read_problem(&domain, &problem).unwrap().0))
}

fn world(folder: &str, task: &Task) -> WorldModel {
    let source = Source::new("world", text(&format!("{folder}/world.toml")).as_str());
    WorldModel::read(source, task.problem()).unwrap()
}

fn settings() -> RunSettings {
    RunSettings {
        planning_time: PlanningTime::Seconds(Rational::ONE),
        ..RunSettings::default()
    }
}

/// Returns the choice for an executor in a world of `experiments`.
fn chosen(name: &str, executor: &str) -> (Arc<Task>, WorldModel, Choice) {
    chosen_within(u64::MAX, 1, name, executor)
}

/// Returns the choice with a planning budget and a number of threads.
fn chosen_within(
    work: u64,
    threads: usize,
    name: &str,
    executor: &str,
) -> (Arc<Task>, WorldModel, Choice) {
    let folder = format!("experiments/{name}");
    let task = task(&folder);
    let world = world(&folder, &task);
    let mut planner = Embedded::default();
    planner.settings.threads = threads;
    let chooser = PlanSelector {
        work,
        settings: planner.settings.clone(),
        most_states: planner.most_states,
        improve_states: planner.improve_states,
        knowledge: WorldKnowledge::World(Rollouts {
            world: Arc::new(world.clone()),
            executor: executor.parse().unwrap(),
            settings: settings(),
            flow: pipeline::Settings::default(),
            likelihoods: Arc::new(Likelihoods::certain()),
            replanning: Some(Replanning::within(&planner)),
            is_ready: true,
        }),
        may_continue: &|| true,
    };
    let choice = chooser.choose(&task, &Situation::initial(&task)).unwrap();
    (task, world, choice)
}

/// Counts in how many of `runs` runs the goal is reached, starting with a plan.
fn count(task: &Arc<Task>, world: &WorldModel, plan: &TimeTriggeredPlan, runs: u64) -> u64 {
    let reaches = |seed: &u64| {
        let task = Arc::new(task.with_own_table());
        let run = Execution::of(&task)
            .by("live".parse().unwrap())
            .with_settings(settings())
            .beginning_with(plan.clone());
        run.run_in(&mut *world.world(&task, *seed)).verdict == Verdict::GoalReached
    };
    (1000..1000 + runs).filter(reaches).count() as u64
}

fn starts(plan: &TimeTriggeredPlan) -> Vec<String> {
    let mut steps: Vec<_> = plan.steps.iter().collect();
    steps.sort_by(|a, b| (&a.start, &a.action.name).cmp(&(&b.start, &b.action.name)));
    steps.iter().map(|step| step.action.name.clone()).collect()
}

#[test]
fn small_budget_selects_shortest_plan() {
    let (_, _, unlimited) = chosen("detour", "guarded");
    let (_, _, limited) = chosen_within(1, 1, "detour", "guarded");
    assert!(unlimited.plans > 1, "{unlimited}");
    assert_eq!(limited.plans, 1, "{limited}");
    assert!(limited.made_for.is_empty(), "{limited}");
}

#[test]
fn choice_within_a_budget_does_not_depend_on_the_number_of_threads() {
    for work in [1_000_000, 10_000_000, 100_000_000] {
        let (_, _, alone) = chosen_within(work, 1, "detour", "guarded");
        let (_, _, several) = chosen_within(work, 3, "detour", "guarded");
        assert_eq!(alone, several, "{work}");
    }
}

/// The number of states is infinite, and no plan exists: only a budget ends the search.
#[test]
fn search_ends_with_its_budget_and_names_the_option() {
    let domain = "(define (domain parity) (:requirements :durative-actions :numeric-fluents)
        (:functions (n))
        (:durative-action step :parameters () :duration (= ?duration 1) :condition ()
          :effect (at end (increase (n) 2)))
        (:durative-action back :parameters () :duration (= ?duration 1) :condition ()
          :effect (at end (decrease (n) 4))))";
    let problem = "(define (problem odd) (:domain parity) (:init (= (n) 0)) (:goal (= (n) 1001)))";
    let (domain, problem) = (
        Source::new("domain", domain),
        Source::new("problem", problem),
    );
    let task = Task::new(pddl::read_problem(&domain, &problem).unwrap().0);
    let why = |work: u64, threads: usize| {
        let mut planner = Embedded {
            most_states: u64::MAX,
            work,
            ..Embedded::default()
        };
        planner.settings.threads = threads;
        let answer = planner.plan(&task, &Situation::initial(&task)).answer;
        answer
            .failure_reason()
            .expect("there is no plan")
            .to_owned()
    };
    let little = why(1_000_000, 1);
    assert!(little.contains("--planning-budget"), "{little}");
    let more = why(100_000_000, 1);
    assert_ne!(little, more, "the number of states");
    assert_eq!(more, why(100_000_000, 3));
}

#[test]
fn candidates_are_valid_distinct_and_deterministic() {
    let folders = WORLDS.map(|name| (format!("experiments/{name}"), true));
    let cases = ["crossing", "errand", "delivery"].map(|name| (format!("cases/{name}"), false));
    for (folder, has_world) in folders.into_iter().chain(cases) {
        let make = || {
            let task = task(&folder);
            let world = has_world.then(|| world(&folder, &task));
            let situation = Situation::initial(&task);
            let limits = Limits {
                work: u64::MAX,
                first_plan_factor: 1,
                most_states: 20_000,
                improve_states: 500,
                other_states: 20_000,
                searches: 12,
            };
            let planner = elbowroom::planner::Settings::default();
            let mut source = Candidates::new(&task, &situation, world.as_ref(), planner, limits);
            let plans: Vec<_> = std::iter::from_fn(|| source.next(&mut |_| true)).collect();
            for candidate in &plans {
                let verdict = validate(&task, &candidate.plan, &Settings::default());
                assert!(verdict.is_valid(), "{folder}: {verdict:?}");
                let without = candidate.made_for.split_once("without ");
                for name in starts(&candidate.plan) {
                    assert!(without.is_none_or(|(_, others)| !others.contains(&name)));
                }
            }
            plans
        };
        let plans = make();
        let orders: BTreeSet<_> = plans.iter().map(|it| starts(&it.plan)).collect();
        assert_eq!(orders.len(), plans.len(), "{folder}");
        assert!(plans.len() > 1, "{folder} has other plans");
        assert!(plans[0].made_for.is_empty(), "{folder}");
        let names = |plans: &[elbowroom::execute::Candidate]| {
            let each = plans
                .iter()
                .map(|it| (starts(&it.plan), it.made_for.clone()));
            each.collect::<Vec<_>>()
        };
        assert_eq!(names(&plans), names(&make()), "{folder}");
    }
}

/// A workpiece often consumes more charge than planned. The shortest plan starts with the initial
/// charge. The battery can also be filled first, which takes almost no time.
#[test]
fn uncertain_amounts_yield_plans_for_scarcer_amounts() {
    let folder = "experiments/table2";
    let problem = text(&format!("{folder}/problem.pddl"))
        .replace("{capacity}", "160")
        .replace("{charge}", "151");
    let domain = Source::new("domain", text(&format!("{folder}/domain.pddl")).as_str());
    let read = pddl::read_problem(&domain, &Source::new("problem", problem.as_str()));
    let task = Arc::new(Task::new(read.unwrap().0));
    let source = Source::new("world", text(&format!("{folder}/world.toml")).as_str());
    let world = WorldModel::read(source, task.problem()).unwrap();
    let situation = Situation::initial(&task);
    let limits = Limits {
        work: u64::MAX,
        first_plan_factor: 1,
        most_states: 2_000,
        improve_states: 256,
        other_states: 10_000,
        searches: 12,
    };
    let planner = elbowroom::planner::Settings::default();
    let mut source = Candidates::new(&task, &situation, Some(&world), planner, limits);
    let plans: Vec<_> = std::iter::from_fn(|| source.next(&mut |_| true)).collect();
    assert!(
        !starts(&plans[0].plan)
            .iter()
            .any(|it| it.contains("throw-away"))
    );
    let filled = plans
        .iter()
        .find(|it| it.made_for == "for charge scarcer than in 80 % of cases");
    let filled = filled.expect("there is time to fill it up");
    let first = |name: &str| {
        let names = starts(&filled.plan);
        names.iter().position(|it| it.contains(name)).unwrap()
    };
    assert!(first("throw-away") < first("make-base-1"), "{filled:?}");
}

#[test]
fn estimate_agrees_with_independent_runs() {
    for name in ["counter", "weld"] {
        let (task, world, choice) = chosen(name, "live");
        let Value::Sampled { successes, samples } = choice.value else {
            panic!("it was tried out");
        };
        let runs = 400;
        let counted = count(&task, &world, &choice.plan, runs);
        #[expect(clippy::cast_precision_loss, reason = "some hundreds")]
        let (of, all) = ((successes + counted) as f64, (samples + runs) as f64);
        let share = of / all;
        #[expect(clippy::cast_precision_loss, reason = "some hundreds")]
        let (told, found) = (
            successes as f64 / samples as f64,
            counted as f64 / runs as f64,
        );
        #[expect(clippy::cast_precision_loss, reason = "some hundreds")]
        let error = (share * (1.0 - share) * (1.0 / samples as f64 + 1.0 / runs as f64)).sqrt();
        assert!(
            (told - found).abs() <= 3.0 * error + 1e-9,
            "{name}: {told} told, {found} counted"
        );
        assert!(choice.value.probability() > choice.shortest.probability() + 0.1);
    }
}

/// Actions of a plan, and a remark about it.
type Remarked = (Vec<String>, Option<String>);

/// Recorder of the first plan of a run.
#[derive(Clone, Default)]
struct First(Arc<Mutex<Option<Remarked>>>);

impl Recorder for First {
    fn record(&mut self, entry: &Entry<'_>) {
        if let Entry::Planned { plan, remark, .. } = entry {
            let mut first = self.0.lock().unwrap();
            first.get_or_insert_with(|| {
                let remark = remark.map(str::to_owned);
                (plan.map(starts).unwrap_or_default(), remark)
            });
        }
    }
}

fn first_plan_of_a_run(spec: &RunSpec) -> (Vec<String>, Option<String>) {
    let (inputs, _) = RunInputs::read(spec.clone()).unwrap();
    let first = First::default();
    let execution = inputs.execution(None).unwrap().recorded_by(first.clone());
    let outcome = simulate(&inputs, execution, &mut NoObserver).unwrap();
    let first = first.0.lock().unwrap().take().unwrap();
    assert_eq!(outcome.answer.first_plan, first.1);
    first
}

fn spec(name: &str, seed: u64, first_plan: FirstPlan) -> RunSpec {
    let file = |name: &str, path: String| NamedText {
        name: name.to_owned(),
        text: text(&path),
    };
    RunSpec {
        world: Some(text(&format!("experiments/{name}/world.toml"))),
        seed,
        first_plan,
        executor: "live".parse().unwrap(),
        planning_time: PlanningTime::Seconds(Rational::ONE),
        ..RunSpec::new(
            file("domain", format!("experiments/{name}/domain.pddl")),
            file("problem", format!("experiments/{name}/problem.pddl")),
        )
    }
}

#[test]
fn first_plan_does_not_depend_on_the_seed() {
    let (plan, remark) = first_plan_of_a_run(&spec("counter", 1, FirstPlan::Likeliest));
    let (other, also) = first_plan_of_a_run(&spec("counter", 2, FirstPlan::Likeliest));
    assert_eq!((&plan, &remark), (&other, &also));
    let remark = remark.unwrap();
    assert!(remark.starts_with("chosen among "), "{remark}");
    assert!(plan.iter().any(|name| name.contains("hand-over-carefully")));
    let (shortest, remark) = first_plan_of_a_run(&spec("counter", 1, FirstPlan::Shortest));
    assert!(
        shortest
            .iter()
            .any(|name| name.contains("hand-over-quickly"))
    );
    assert_eq!(remark, None);
}

#[test]
fn untimed_choice_uses_exact_probability() {
    let task = task("experiments/counter");
    let likely = "format = \"elbowroom-likelihoods\"\nversion = 1\n[defaults]\n\
         becomes_true = 0.0\nbecomes_false = 0.0\nstart = 1.0\neffect = 1.0\n\
         [actions.grasp-quickly]\nstart = 0.4\n[actions.grasp-carefully]\nstart = 0.98\n";
    let likelihoods = Arc::new(likelihoods::read(likely, &task).unwrap());
    let planner = Embedded::default();
    let chooser = PlanSelector {
        work: u64::MAX,
        settings: planner.settings.clone(),
        most_states: planner.most_states,
        improve_states: planner.improve_states,
        knowledge: WorldKnowledge::Likelihoods {
            likelihoods: Arc::clone(&likelihoods),
            reorders: true,
        },
        may_continue: &|| true,
    };
    let choice = chooser.choose(&task, &Situation::initial(&task)).unwrap();
    // By hand: everything else is certain, and there is one grasp.
    assert_eq!(choice.value, Value::Exact(0.98));
    assert_eq!(choice.shortest, Value::Exact(0.4));
    let request = OddsRequest {
        task: &task,
        plan: Some(choice.plan),
        likelihoods: &likelihoods,
        world: None,
        settings: OddsSettings::default(),
    };
    let OddsFinding::Odds(odds) = odds(&request, &mut NoObserver).unwrap().finding else {
        panic!("it has odds");
    };
    assert!((odds.order.probability - 0.98).abs() < 1e-12);
}

/// Watcher that ends a search after this number of polls.
struct Impatient(usize);

impl Observer for Impatient {
    fn elapsed(&mut self) -> Duration {
        Duration::ZERO
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 {
            ControlFlow::Break(StopRequest::Cancelled)
        } else {
            ControlFlow::Continue(())
        }
    }
}

fn best(task: &Arc<Task>, aim: PlanAim<'_>, watcher: &mut dyn Observer) -> PlanOutcome {
    let request = BestPlanRequest {
        task,
        aim,
        most_searches: Some(12),
        self_overlap: false,
        most_memory: None,
    };
    best_plan(&request, watcher).unwrap()
}

fn choice(outcome: &PlanOutcome) -> &PlanChoice {
    outcome.answer.choice.as_ref().unwrap()
}

#[test]
fn longer_plan_is_selected_if_the_shortest_has_no_slack() {
    let task = task("cases/crossing");
    let outcome = best(&task, PlanAim::Slack, &mut NoObserver);
    let choice = choice(&outcome);
    // Computed by hand in the problem file.
    let worth = |slack: Rational| PlanValue::Slack { slack };
    assert_eq!(choice.value, worth(Rational::new(2999, 7000)));
    assert_eq!(choice.shortest, worth(Rational::ZERO));
    let plan = outcome.plan.as_ref().unwrap();
    assert_eq!(starts(plan), ["(go-round)", "(hand-over)"]);
    assert!(validate(&task, plan, &Settings::default()).is_valid());
    let PlanFinding::Plan { makespan, .. } = &outcome.answer.finding else {
        panic!("there is a plan");
    };
    assert_eq!(*makespan, Rational::new(14_001, 1000));
    assert_eq!(choice.shortest_makespan.0, Rational::new(7001, 1000));
}

#[test]
fn selected_plan_is_never_worse_than_the_shortest() {
    for name in ["crossing", "delivery", "battery", "errand", "match", "tank"] {
        let task = task(&format!("cases/{name}"));
        for patience in [40, 400, usize::MAX] {
            let outcome = best(&task, PlanAim::Slack, &mut Impatient(patience));
            let Some(plan) = &outcome.plan else {
                assert_eq!(outcome.answer.stop, PlanStop::Cancelled, "{name}");
                continue;
            };
            assert!(validate(&task, plan, &Settings::default()).is_valid());
            let choice = choice(&outcome);
            match (&choice.value, &choice.shortest) {
                (PlanValue::Slack { slack }, PlanValue::Slack { slack: shortest }) => {
                    assert!(slack >= shortest, "{name}: {choice:?}");
                }
                (
                    PlanValue::Slack { .. } | PlanValue::Unknown { .. },
                    PlanValue::Unknown { .. },
                ) => {}
                _ => panic!("{name}: {choice:?}"),
            }
        }
    }
}

#[test]
fn success_rate_matches_reported_probability() {
    let task = task("experiments/counter");
    let world = world("experiments/counter", &task);
    let outcome = best(&task, PlanAim::Probability(&world), &mut NoObserver);
    let choice = choice(&outcome);
    let (
        PlanValue::Sampled { interval, .. },
        PlanValue::Sampled {
            interval: of_shortest,
            ..
        },
    ) = (&choice.value, &choice.shortest)
    else {
        panic!("it was tried out");
    };
    let (least, most) = interval.unwrap();
    // Without replanning: both careful moves succeed, and the drives are not too long.
    assert!(
        least > 0.85 && most <= 0.98_f64.powi(2) + 0.02,
        "{choice:?}"
    );
    assert!(of_shortest.unwrap().1 < 0.3, "{choice:?}");
}
