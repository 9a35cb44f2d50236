//! Measured amounts, and durations that affect numbers.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use elbowroom::execute::{ExactRegion, PlanPreparer};
use elbowroom::execution::executors::{ExecutorServices, ExecutorSpec};
use elbowroom::execution::run::{Report, Verdict};
use elbowroom::execution::{
    Cause, Decided, DecisionContext, Ending, Entry, Executor, PlanForm, Planned, PreparedPlan,
    Reason, Recorder, RegionOracle, StepId,
};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::plan::{DecoupledEnvelope, ParameterId, ParametrizedPlan, Valuation};
use elbowroom::sim::SimWorld;

use crate::execution::guarantee::one_order;
use crate::execution::scene::{Scene, runs};
use crate::promise::handmade_plans;

/// Independent surveys without deadlines, which only consume charge.
const DOMAIN: &str = "(define (domain sites)
    (:requirements :typing :durative-actions :fluents) (:types site)
    (:predicates (idle) (surveyed ?s - site)) (:functions (charge))
    (:durative-action survey :parameters (?s - site) :duration (= ?duration 20)
      :condition (and (at start (idle)) (at end (>= (charge) 30)))
      :effect (and (at start (not (idle))) (at end (decrease (charge) 30))
                   (at end (surveyed ?s)) (at end (idle))))
    (:durative-action warm-up :parameters (?s - site) :duration (= ?duration 20)
      :condition (and (at start (idle)) (at start (>= (charge) 30)))
      :effect (and (at start (not (idle))) (at start (decrease (charge) 30))
                   (at end (surveyed ?s)) (at end (idle))))
    (:durative-action recharge :parameters () :duration (= ?duration 10)
      :condition (at start (idle))
      :effect (and (at start (not (idle))) (at end (idle)) (at end (assign (charge) 80)))))";
const PROBLEM: &str = "(define (problem p) (:domain sites) (:objects a b - site)
    (:init (idle) (= (charge) 80)) (:goal (and (surveyed a) (surveyed b))))";

/// A survey consumes 90 of the battery instead of 40. The domain says `(* (draw ?r) ?duration)`.
#[test]
fn amount_with_duration_uses_observed_duration() {
    let scene = Scene::case("battery");
    let model =
        scene.world("[[amount]]\naction = \"survey\"\nfluent = \"charge\"\nconstant = 90\n");
    for executor in ["fixed:0", "stn", "guarded", "live", "adaptable"] {
        let report = scene.run(executor, &model, 0);
        // Known at the first survey's end, before the next one begins.
        let since = report.reasons[0].since.clone();
        assert_eq!(since, Some(Rational::from(20)), "{executor}: {report:#?}");
    }
    let report = scene.run("adaptable", &model, 0);
    // Executors based on orders name the event after which no order was left.
    let [behind] = report.reasons[0].evidence.as_slice() else {
        panic!("{:?}", report.reasons);
    };
    assert_eq!(behind.to_string(), "(survey rover crater) succeeded at 20");
    // A larger amount due to a longer duration is not a deviation.
    let model = scene.world("[[duration]]\naction = \"recharge\"\nconstant = 10.5\n");
    let report = scene.run("fixed:10", &model, 0);
    assert_eq!(report.replans, 0, "{:?}", report.reasons);
}

/// The amounts are not parameters, and are still measured: 60 for each instead of 30.
#[test]
fn live_checks_fixed_amounts_against_remaining_plan() {
    for (plan, known) in [
        ("0: (survey a) [20]\n20.001: (survey b) [20]", 20),
        // Measured and known at the start.
        ("0: (warm-up a) [20]\n20.001: (warm-up b) [20]", 0),
    ] {
        let scene = Scene::new(DOMAIN, PROBLEM, Some(plan));
        let model = scene.world("[[amount]]\naction = \"*\"\nfluent = \"charge\"\nconstant = 60\n");
        for executor in ["guarded", "live"] {
            let report = scene.run(executor, &model, 0);
            let since = report.reasons[0].since.clone();
            assert_eq!(
                since,
                Some(Rational::from(known)),
                "{executor}: {report:#?}"
            );
        }
    }
}

/// Filling raises the level of a tank, which overflows after 20. A survey of 25 leaves too little
/// charge for the next one.
#[test]
fn live_abandons_plan_while_overlong_action_is_running() {
    for (case, action, longest, limit) in [("tank", "fill", 300, 20), ("battery", "survey", 60, 25)]
    {
        let mut scene = Scene::case(case);
        // The other durations are as planned. (The executor could choose them.)
        scene.flow.vary = vec![
            format!("duration {action}")
                .parse()
                .expect("a specification"),
        ];
        scene.settings.max_replans = 0;
        let world = format!("[[duration]]\naction = \"{action}\"\nconstant = {longest}\n");
        let model = scene.world(&world);
        let mut world = SimWorld::new(Arc::clone(&scene.task), &model, 0);
        let mut analyst = PlanPreparer::new(scene.flow.clone());
        let mut abandoned = FirstAbandoned::default();
        let report = scene.run_in("live", &mut world, &mut analyst, &mut abandoned);
        let reason = &report.reasons[0];
        assert_eq!(reason.cause, Cause::Outlived, "{case}: {report:#?}");
        let upper = reason
            .allowed
            .as_ref()
            .and_then(|allowed| allowed.upper.value());
        let upper = upper.expect("a limit");
        // Within ε below the limit.
        let (limit, epsilon) = (Rational::from(limit), Rational::new(1, 1000));
        assert!(
            *upper <= limit && *upper >= &limit - &epsilon,
            "{case}: {upper}"
        );
        let most = reason.since.clone().expect("a time") + &epsilon + &epsilon;
        let noticed = abandoned.0.expect("a time");
        assert!(noticed <= most, "{case}: {noticed}, {report:#?}");
    }
}

/// Time at which a plan was first abandoned, although no other one could be made.
#[derive(Default)]
struct FirstAbandoned(Option<Rational>);

impl Recorder for FirstAbandoned {
    fn record(&mut self, entry: &Entry<'_>) {
        if let Entry::Kept { now, .. } = entry {
            self.0.get_or_insert_with(|| (*now).clone());
        }
    }
}

/// The last action deviates, and no further planning is needed.
#[test]
fn a_goal_that_is_reached_needs_no_new_plan() {
    let problem = PROBLEM.replace(" (surveyed b)", "");
    let mut scene = Scene::new(DOMAIN, &problem, Some("0: (survey a) [20]"));
    scene.settings.max_replans = 0;
    let model = scene.world("[[amount]]\naction = \"*\"\nfluent = \"charge\"\nconstant = 60\n");
    let report = scene.run("fixed:0", &model, 0);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    assert_eq!(
        (report.replans, report.reasons.len()),
        (0, 0),
        "{report:#?}"
    );
}

/// A duration has its lower bound from one constraint and its upper bound from another; a reason
/// shows both.
#[test]
fn reason_lists_all_bounds_of_a_duration() {
    let scene = Scene::case("delivery");
    let model = scene.world("[[duration]]\naction = \"drive\"\nconstant = 12\n");
    for executor in ["stn", "fixed:10"] {
        let report = scene.run(executor, &model, 0);
        let allowed = report
            .reasons
            .iter()
            .find_map(|reason| reason.allowed.clone());
        let allowed = allowed.expect("an interval");
        let bounds = (allowed.lower.value(), allowed.upper.value());
        assert!(
            matches!(bounds, (Some(lower), Some(upper)) if lower.is_positive() && lower <= upper),
            "{executor}: {allowed}"
        );
    }
}

/// Region that counts the queries about the remaining plan, for points or for boxes.
#[derive(Default)]
struct Counting {
    queries: Arc<AtomicUsize>,
    /// `true` if it searches for boxes as usual, and counts these; otherwise each point is a query
    /// of its own.
    finds_boxes: bool,
    /// `true` if it is queried even if the observations are within a valid box.
    is_queried_inside: bool,
}

impl RegionOracle for Counting {
    fn is_feasible(
        &mut self,
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &Valuation,
    ) -> bool {
        let counts = usize::from(!self.finds_boxes);
        self.queries.fetch_add(counts, Ordering::Relaxed);
        ExactRegion.is_feasible(task, plan, values)
    }

    fn surroundings(
        &mut self,
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &Valuation,
    ) -> Result<DecoupledEnvelope, String> {
        if self.finds_boxes {
            self.queries.fetch_add(1, Ordering::Relaxed);
            return ExactRegion.surroundings(task, plan, values);
        }
        let is_feasible = self.is_feasible(task, plan, values);
        let point = is_feasible.then(|| DecoupledEnvelope::point(values));
        point.ok_or_else(|| "not feasible".to_owned())
    }

    fn is_asked_inside(&self) -> bool {
        self.is_queried_inside
    }
}

/// Executor given from outside.
struct ForwardingExecutor(Box<dyn Executor>);

impl Executor for ForwardingExecutor {
    fn need(&self) -> PlanForm {
        self.0.need()
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        self.0.adopt(mission)
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        self.0.decide(moment)
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.0.window(step, is_end)
    }
}

#[test]
fn live_rechecks_numbers_only_after_deviation() {
    let problem = "(define (problem p) (:domain sites) (:objects a b - site)
        (:init (idle) (= (charge) 200)) (:goal (and (surveyed a) (surveyed b))))";
    let plan = "0: (survey a) [20]\n20.001: (warm-up b) [20]";
    let scene = Scene::new(DOMAIN, problem, Some(plan));
    for (world, questions) in [
        ("", 0),
        (
            "[[amount]]\naction = \"*\"\nfluent = \"charge\"\nconstant = 30\n",
            0,
        ),
        (
            "[[amount]]\naction = \"survey\"\nfluent = \"charge\"\nconstant = 40\n",
            1,
        ),
        (
            "[[amount]]\naction = \"*\"\nfluent = \"charge\"\nconstant = 40\n",
            2,
        ),
    ] {
        let asked = Arc::new(AtomicUsize::new(0));
        let live: ExecutorSpec = "live".parse().unwrap();
        let live = live.build(ExecutorServices::from(Box::new(Counting {
            queries: Arc::clone(&asked),
            ..Counting::default()
        })));
        let model = scene.world(world);
        let execution = scene
            .execution("live")
            .with_executor(ForwardingExecutor(live));
        let report = execution.run_in(&mut *model.world(&scene.task, 0));
        assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
        // Later ends are only queried if the plan had no envelope.
        let count = asked.load(Ordering::Relaxed);
        assert!(
            count <= questions && (count > 0) == (questions > 0),
            "{world}: {count}"
        );
    }
}

/// The limits of a running action's duration are found with one oracle that widens a box. Separate
/// queries for each duration give the same limits up to ε, and so the same runs.
#[test]
fn duration_limits_do_not_depend_on_the_query_method() {
    let mut outlived = 0;
    for case in ["battery", "tank", "hatchery", "delivery"] {
        let scene = Scene::case(case);
        for (seed, spread) in (0..12).zip(["0.1", "0.3", "0.6", "1.2"].into_iter().cycle()) {
            let model = scene.world(&format!(
                "[[duration]]\naction = \"*\"\nnormal = {{ mean = 1.1, deviation = {spread} }}\nrelative = true\n"
            ));
            let run = |means: ExecutorServices| {
                let live: ExecutorSpec = "live".parse().unwrap();
                let execution = scene
                    .execution("live")
                    .with_executor(ForwardingExecutor(live.build(means)));
                execution.run_in(&mut *model.world(&scene.task, seed))
            };
            let widened = run(ExecutorServices::from(Box::new(ExactRegion)));
            let asked = run(ExecutorServices::from(Box::new(Counting::default())));
            let of = |it: &Report| (it.verdict.clone(), it.replans, it.starts);
            assert_eq!(of(&widened), of(&asked), "{case}, seed {seed}");
            // Limits are found up to ε.
            let difference = (&widened.time - &asked.time).abs();
            assert!(
                difference <= *scene.task.epsilon(),
                "{case}, seed {seed}: {difference}"
            );
            let mut causes = widened.reasons.iter().map(|reason| reason.cause);
            outlived += usize::from(causes.any(|cause| cause == Cause::Outlived));
        }
    }
    assert!(outlived > 3, "{outlived}");
}

/// A drive takes longer than in the envelope, so that a survey may not consume more than planned.
/// It consumes as much as the envelope allowed before.
#[test]
fn amounts_are_checked_against_remaining_plan_after_deviation() {
    let domain = "(define (domain rover)
        (:requirements :durative-actions :fluents)
        (:predicates (idle) (there) (surveyed) (sent)) (:functions (charge))
        (:durative-action drive :parameters () :duration (= ?duration 10)
          :condition (at start (idle))
          :effect (and (at start (not (idle))) (at end (idle)) (at end (there))
                       (at end (decrease (charge) ?duration))))
        (:durative-action survey :parameters () :duration (= ?duration 20)
          :condition (and (at start (idle)) (at start (there)))
          :effect (and (at start (not (idle))) (at end (idle)) (at end (surveyed))
                       (at end (decrease (charge) 30))))
        (:durative-action send :parameters () :duration (= ?duration 5)
          :condition (and (at start (idle)) (at start (surveyed)) (at end (>= (charge) 30)))
          :effect (and (at start (not (idle))) (at end (idle)) (at end (sent))
                       (at end (decrease (charge) 30)))))";
    let problem = "(define (problem p) (:domain rover)
        (:init (idle) (= (charge) 105)) (:goal (sent)))";
    let plan = "0: (drive) [10]\n10.001: (survey) [20]\n30.002: (send) [5]";
    let mut scene = Scene::new(domain, problem, Some(plan));
    scene.flow.vary = ["constant survey charge", "duration drive"]
        .map(|spec| spec.parse().expect("a specification"))
        .to_vec();
    let envelope = scene.prepared("live").envelope.expect("it has one");
    let most = |index: u32| {
        let interval = envelope.interval(ParameterId(index));
        interval.upper.value().expect("an end").clone()
    };
    let (survey, drive) = (Rational::from(60), Rational::from(20));
    assert!(most(0) >= survey && most(1) < drive, "{envelope:?}");
    let world = |survey: u32| {
        let sections = format!(
            "[[duration]]\naction = \"drive\"\nconstant = 20\n\
             [[amount]]\naction = \"survey\"\nfluent = \"charge\"\nconstant = {survey}\n"
        );
        scene.world(&sections)
    };
    let report = scene.run("live", &world(60), 0);
    let reason = report.reasons.first().expect("it is lost");
    assert_eq!(reason.cause, Cause::GuaranteeLost, "{report:#?}");
    assert_eq!(reason.since, Some("40.001".parse().expect("a number")));
    let report = scene.run("live", &world(30), 0);
    assert_eq!((report.verdict, report.replans), (Verdict::GoalReached, 0));
}

/// Twenty robots drive 32 times each. Their batteries hold an eighth more than needed. The envelope
/// assigns this reserve to some of the drives. The box for the remaining plan gives each drive a
/// share, and running actions may end earlier than planned.
#[test]
fn box_of_remaining_plan_contains_all_its_actions() {
    let domain = "(define (domain patrol)
        (:requirements :durative-actions :fluents :typing) (:types robot)
        (:predicates (idle ?r - robot)) (:functions (charge ?r - robot) (trips ?r - robot))
        (:durative-action drive :parameters (?r - robot) :duration (= ?duration 8)
          :condition (and (at start (idle ?r)) (over all (>= (charge ?r) 0)))
          :effect (and (at start (not (idle ?r))) (at end (idle ?r)) (at end (increase (trips ?r) 1))
                       (decrease (charge ?r) (* #t 1)))))";
    let robots: Vec<String> = (0..20).map(|robot| format!("r{robot}")).collect();
    let each = |text: &str| {
        let texts = robots.iter().map(|robot| text.replace('?', robot));
        texts.collect::<Vec<_>>().join(" ")
    };
    let problem = format!(
        "(define (problem p) (:domain patrol) (:objects {} - robot) (:init {}) (:goal (and {})))",
        robots.join(" "),
        each("(idle ?) (= (charge ?) 288) (= (trips ?) 0)"),
        each("(>= (trips ?) 32)")
    );
    let steps = (0..32).flat_map(|trip| {
        let starts = robots.iter().zip(0..).map(move |(robot, place)| {
            let start = Rational::new(trip * 8001 + place * 10, 1000);
            format!("{}: (drive {robot}) [8]\n", start.to_decimal(3))
        });
        starts.collect::<Vec<_>>()
    });
    let plan: String = steps.collect();
    let mut scene = Scene::new(domain, &problem, Some(&plan));
    scene.flow.vary = vec!["durations".parse().expect("a specification")];
    let world =
        "[[duration]]\naction = \"*\"\nuniform = { from = 0.9, to = 1.1 }\nrelative = true\n";
    let model = scene.world(world);
    let mut most = 0;
    for seed in 0..2 {
        let asked = Arc::new(AtomicUsize::new(0));
        let live: ExecutorSpec = "live".parse().unwrap();
        let region = Counting {
            queries: Arc::clone(&asked),
            finds_boxes: true,
            ..Counting::default()
        };
        let live = live.build(ExecutorServices::from(Box::new(region)));
        let execution = scene
            .execution("live")
            .with_executor(ForwardingExecutor(live));
        let report = execution.run_in(&mut *model.world(&scene.task, seed));
        assert_eq!(
            (report.verdict, report.replans),
            (Verdict::GoalReached, 0),
            "seed {seed}"
        );
        most = most.max(asked.load(Ordering::Relaxed));
    }
    assert!((1..=4).contains(&most), "{most}");
}

/// Returns a relevant difference between two runs. Limits of durations are found up to ε and from
/// different initial values, so it is irrelevant whether an outlived limit or a failed condition
/// comes first. It is also irrelevant if the first run detects the loss of the guarantee earlier:
/// several running actions take longer, and without events only an executor with a box checks all
/// of them.
fn difference(one: &Report, other: &Report, epsilon: &Rational) -> Option<String> {
    let lost = |report: &Report| report.reasons.first()?.since.clone();
    if let (Some(one), Some(other)) = (lost(one), lost(other))
        && &one + epsilon < other
    {
        return None;
    }
    let outline = |report: &Report| {
        let reasons = report.reasons.iter().map(|reason| &reason.action);
        let executed = report.executed.iter();
        let executed = executed.map(|step| {
            let has_succeeded = step.ending == Some(Ending::Succeeded);
            (&step.step.action.name, has_succeeded)
        });
        let reasons: Vec<_> = reasons.collect();
        let executed: Vec<_> = executed.collect();
        format!("{:?} {reasons:?} {executed:?}", report.verdict)
    };
    let times = |report: &Report| -> Vec<Rational> {
        let steps = report.executed.iter();
        let times = steps.flat_map(|own| [Some(own.step.start.clone()), own.step.duration.clone()]);
        times.flatten().chain([report.time.clone()]).collect()
    };
    if outline(one) != outline(other) {
        return Some(format!("{:#?}\n{:#?}", one.reasons, other.reasons));
    }
    let twice = epsilon + epsilon;
    let mut pairs = times(one).into_iter().zip(times(other));
    let far = pairs.find(|(one, other)| (one - other).abs() > twice);
    far.map(|(one, other)| format!("{one}, {other}"))
}

/// If the observations are within the plan's envelope, the remaining plan is feasible. An executor
/// that still queries it gets this answer, and the runs are the same.
#[test]
fn values_inside_the_envelope_cause_no_query() {
    let asked = Arc::new(AtomicUsize::new(0));
    let mut lost = 0;
    let open = |mut scene: Scene| {
        scene.flow.vary = vec!["durations".parse().expect("a specification")];
        scene
    };
    let names = [
        "battery",
        "tank",
        "hatchery",
        "match",
        "delivery",
        "paintshop",
        "lamp",
    ];
    let cases = names.map(|name| (name, open(Scene::case(name))));
    let own = handmade_plans::OWN
        .iter()
        .map(|[name, domain, problem, plan]| {
            (*name, open(Scene::new(domain, problem, Some(plan))))
        });
    let batteries = [
        ("small battery", one_order("160", "151")),
        ("large battery", one_order("180", "171")),
    ];
    for (name, scene) in cases.into_iter().chain(own).chain(batteries) {
        let seeds = 0..runs("ELBOWROOM_LIVE_RUNS", 15);
        for (seed, spread) in seeds.zip(["0.05", "0.2", "0.5"].into_iter().cycle()) {
            let varies = |heading: &str, spread: &str| {
                format!(
                    "{heading}\nnormal = {{ mean = 1, deviation = {spread} }}\nrelative = true\n"
                )
            };
            let mut world = varies("[[duration]]\naction = \"*\"", spread);
            if ["small battery", "large battery"].contains(&name) {
                for (action, fluent) in [("make-base-1", "charge"), ("make-base-2", "weight")] {
                    let heading =
                        format!("[[amount]]\naction = \"{action}\"\nfluent = \"{fluent}\"");
                    world += &varies(&heading, spread);
                }
            }
            let model = scene.world(&world);
            let run = |means: ExecutorServices| {
                let live: ExecutorSpec = "live".parse().unwrap();
                let execution = scene
                    .execution("live")
                    .with_executor(ForwardingExecutor(live.build(means)));
                execution.run_in(&mut *model.world(&scene.task, seed))
            };
            let trusting = run(ExecutorServices::from(Box::new(ExactRegion)));
            let asking = run(ExecutorServices::from(Box::new(Counting {
                queries: Arc::clone(&asked),
                is_queried_inside: true,
                ..Counting::default()
            })));
            let difference = difference(&trusting, &asking, scene.task.epsilon());
            assert_eq!(difference, None, "{name}, seed {seed}");
            let mut reasons = trusting.reasons.iter().map(|reason| reason.cause);
            lost += usize::from(reasons.any(|cause| cause == Cause::GuaranteeLost));
        }
    }
    let asked = asked.load(Ordering::Relaxed);
    assert!(asked > 10 && lost > 3, "{asked}, {lost}");
}
