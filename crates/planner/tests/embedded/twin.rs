//! A slow search over all sequences of happenings, each scheduled by Bellman and Ford and shown to
//! the judge, finds a plan exactly when the planner does.

use std::fmt::Write;
use std::ops::ControlFlow;

use elbowroom_model::ground::Action;
use elbowroom_model::validate::{self, Settings as Strictness, Verdict};
use elbowroom_model::{Footprint, Situation, Step, Task, TimeTriggeredPlan, validate_from};
use elbowroom_num::Rational;
use elbowroom_planner::{Answer, Settings, Stopped, plan};
use proptest::prelude::*;

use crate::world::{describe, task};

/// The most happenings of a plan that the twin looks for.
const MOST: usize = 6;

/// Facts f0 … f3, an action for each entry, and timed initials.
#[derive(Clone, Debug)]
struct Draft {
    actions: Vec<DraftAction>,
    initial: u8,
    goal: u8,
    timed: Vec<(u8, u8, bool)>,
}

#[derive(Clone, Debug)]
struct DraftAction {
    /// 0: it takes no time.
    duration: u8,
    at_start: Option<(u8, bool)>,
    over_all: Option<u8>,
    start: Vec<(u8, bool)>,
    end: Vec<(u8, bool)>,
    /// Taken from the store at the start, which must have so much.
    cost: u8,
    /// Put into the store at the end.
    gain: i8,
    /// Whether the store must not run out meanwhile.
    minds: bool,
}

fn drafts() -> impl Strategy<Value = Draft> {
    let literal = || (0..4_u8, any::<bool>());
    let effects = || prop::collection::vec(literal(), 0..3);
    let action = (
        0..4_u8,
        prop::option::of(literal()),
        prop::option::of(0..4_u8),
        effects(),
        effects(),
        0..2_u8,
        (-2..2_i8, any::<bool>()),
    );
    let action = action.prop_map(
        |(duration, at_start, over_all, start, end, cost, (gain, minds))| DraftAction {
            duration,
            at_start,
            over_all,
            start,
            end,
            cost,
            gain,
            minds,
        },
    );
    (
        prop::collection::vec(action, 1..4),
        0..16_u8,
        1..16_u8,
        prop::collection::vec((1..5_u8, 0..4_u8, any::<bool>()), 0..3),
    )
        .prop_map(|(actions, initial, goal, timed)| Draft {
            actions,
            initial,
            goal,
            timed,
        })
}

/// Drafts with an end: the store is never refilled. Several happenings of one time that touch it,
/// which are beyond the planner, do not matter to anyone.
fn thrifty_drafts() -> impl Strategy<Value = Draft> {
    drafts().prop_map(|mut draft| {
        for action in &mut draft.actions {
            action.minds = false;
            action.gain = action.gain.min(0);
        }
        draft
    })
}

fn written(literals: &[(u8, bool)], when: &str) -> String {
    let mut text = String::new();
    // A fact both added and deleted at once is not what is tested here.
    let mut seen = Vec::new();
    for (fact, truth) in literals {
        if seen.contains(fact) {
            continue;
        }
        seen.push(*fact);
        let literal = if *truth {
            format!("(f{fact})")
        } else {
            format!("(not (f{fact}))")
        };
        if when.is_empty() {
            write!(text, " {literal}").expect("as written above");
        } else {
            write!(text, " (at {when} {literal})").expect("as written above");
        }
    }
    text
}

/// What an action costs: at its start, at its end, and for each unit of its duration.
type Price = (u8, u8, u8);

/// What is to be minimized, or not.
const METRICS: &[&str] = &[
    "minimize (cost)",
    "minimize (+ (cost) (total-time))",
    "minimize (+ (* 3 (cost)) (* 0.5 (total-time)))",
    "minimize (- (cost) (store))",
    "minimize (total-time)",
];

impl Draft {
    fn task(&self) -> Task {
        self.task_with(&[], "")
    }

    /// The task in which actions cost something.
    fn task_with(&self, prices: &[Price], metric: &str) -> Task {
        let mut domain = "(:requirements :durative-actions :numeric-fluents :adl
            :timed-initial-literals) (:predicates (f0) (f1) (f2) (f3)) (:functions (store) (cost))"
            .to_owned();
        for (number, action) in self.actions.iter().enumerate() {
            let (at_start, at_end, rate) = prices.get(number).copied().unwrap_or_default();
            let needs = action.at_start.iter().copied().collect::<Vec<_>>();
            if action.duration == 0 {
                let mut needs = written(&needs, "");
                let mut effects = written(&action.start, "");
                if action.cost > 0 {
                    write!(needs, " (>= (store) {})", action.cost).expect("strings take all");
                    write!(effects, " (decrease (store) {})", action.cost)
                        .expect("strings take all");
                }
                if at_start > 0 {
                    write!(effects, " (increase (cost) {at_start})").expect("strings take all");
                }
                write!(
                    domain,
                    "(:action a{number} :parameters () :precondition (and{needs})
                      :effect (and{effects}))",
                )
                .expect("as written above");
                continue;
            }
            let mut needs = written(&needs, "start");
            let mut effects = written(&action.start, "start");
            effects += &written(&action.end, "end");
            if let Some(fact) = action.over_all {
                write!(needs, " (over all (f{fact}))").expect("strings take all");
            }
            if action.minds {
                needs += " (over all (>= (store) 0))";
            }
            if action.gain != 0 {
                write!(effects, " (at end (increase (store) {}))", action.gain)
                    .expect("strings take all");
            }
            if action.cost > 0 {
                write!(needs, " (at start (>= (store) {}))", action.cost)
                    .expect("strings take all");
                write!(effects, " (at start (decrease (store) {}))", action.cost)
                    .expect("strings take all");
            }
            if at_start > 0 {
                write!(effects, " (at start (increase (cost) {at_start}))")
                    .expect("strings take all");
            }
            if at_end + rate > 0 {
                write!(
                    effects,
                    " (at end (increase (cost) (+ {at_end} (* {rate} ?duration))))"
                )
                .expect("strings take all");
            }
            write!(
                domain,
                "(:durative-action a{number} :parameters () :duration (= ?duration {})
                  :condition (and{needs}) :effect (and{effects}))",
                action.duration
            )
            .expect("as written above");
        }
        let facts = |bits: u8| {
            let facts = (0..4).filter(|bit| bits >> bit & 1 == 1);
            facts
                .map(|bit| format!("(f{bit})"))
                .collect::<Vec<_>>()
                .concat()
        };
        let mut initial = facts(self.initial) + "(= (store) 2) (= (cost) 0)";
        for (time, fact, truth) in &self.timed {
            let literal = written(&[(*fact, *truth)], "");
            write!(initial, " (at {time}{literal})").expect("as written above");
        }
        let goal = facts(self.goal);
        let metric = match metric {
            "" => String::new(),
            metric => format!("(:metric {metric})"),
        };
        task(
            &domain,
            &format!("(:init {initial}) (:goal (and {goal})) {metric}"),
        )
    }
}

impl Draft {
    fn ground(&self, task: &mut Task) -> Vec<Action> {
        let numbers = 0..self.actions.len();
        let ground = |number: usize| {
            let schema = task.problem().schema(&format!("a{number}"));
            let schema = schema.expect("as written above");
            task.instantiate(schema, &[]).expect("as written above")
        };
        numbers.map(ground).collect()
    }
}

fn happenings(plan: &TimeTriggeredPlan) -> usize {
    let steps = plan.steps.iter();
    steps
        .map(|step| 1 + usize::from(step.duration.is_some()))
        .sum()
}

/// One happening of a sequence: an action's start or instant, or the end of an earlier one.
#[derive(Clone, Copy, Debug)]
enum Choice {
    Start(usize),
    End(usize),
}

/// All sequences of happenings up to a length, timed initials put in between in all ways.
struct Twin<'a> {
    task: &'a Task,
    actions: Vec<Action>,
    sequence: Vec<Choice>,
    budget: usize,
}

impl Twin<'_> {
    /// Whether some continuation of the sequence is a plan; `None` if the budget does not suffice.
    fn finds(&mut self) -> Option<bool> {
        let mut finds = false;
        let _ = self.walk(&mut |_| {
            finds = true;
            ControlFlow::Break(())
        })?;
        Some(finds)
    }

    /// The least metric of all continuations, if some are plans, and the least makespan with that;
    /// `None` if the budget does not suffice.
    fn least_metric(&mut self) -> Option<Option<(Rational, Rational)>> {
        let mut least: Option<(Rational, Rational)> = None;
        let task = self.task;
        let _ = self.walk(&mut |report| {
            let metric = report.metric(task).expect("the problems have one");
            let worth = (metric, report.makespan.clone());
            if least.as_ref().is_none_or(|least| worth < *least) {
                least = Some(worth);
            }
            ControlFlow::Continue(())
        })?;
        Some(least)
    }

    /// Visits all continuations that are plans; `None` if the budget does not suffice.
    fn walk(
        &mut self,
        visit: &mut dyn FnMut(&validate::Report) -> ControlFlow<()>,
    ) -> Option<ControlFlow<()>> {
        self.budget = self.budget.checked_sub(1)?;
        let open = self.open();
        if open.is_empty() && self.visit_schedules(visit).is_break() {
            return Some(ControlFlow::Break(()));
        }
        let room = MOST - self.sequence.len();
        let ends = open.iter().map(|&place| Choice::End(place));
        let starts = (0..self.actions.len()).filter(|&number| {
            let takes = 1 + usize::from(self.actions[number].durative().is_some());
            open.len() + takes <= room
        });
        let choices: Vec<Choice> = ends.chain(starts.map(Choice::Start)).collect();
        for choice in choices {
            self.sequence.push(choice);
            let flow = self.walk(visit);
            self.sequence.pop();
            if flow? == ControlFlow::Break(()) {
                return flow;
            }
        }
        Some(ControlFlow::Continue(()))
    }

    /// The places of the starts that have not ended.
    fn open(&self) -> Vec<usize> {
        let mut open = Vec::new();
        for (place, choice) in self.sequence.iter().enumerate() {
            match choice {
                Choice::Start(action) if self.actions[*action].durative().is_some() => {
                    open.push(place);
                }
                Choice::Start(_) => {}
                Choice::End(start) => open.retain(|other| other != start),
            }
        }
        open
    }

    /// Visits the interleavings with the timed initials that give a valid plan.
    fn visit_schedules(
        &self,
        visit: &mut dyn FnMut(&validate::Report) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let timed = self.task.timed().len();
        let count = self.sequence.len();
        // For each timed initial, how many happenings come before it; not descending.
        let mut places = vec![0; timed];
        loop {
            if let Some(report) = self.report(&places) {
                visit(&report)?;
            }
            let Some(next) = (0..timed).rev().find(|&t| places[t] < count) else {
                return ControlFlow::Continue(());
            };
            let place = places[next] + 1;
            places[next..].fill(place);
        }
    }

    /// Schedules the happenings as early as their order allows, and asks the judge.
    fn report(&self, places: &[usize]) -> Option<validate::Report> {
        let epsilon = Rational::new(1, 1000);
        let prints: Vec<Footprint> = self
            .sequence
            .iter()
            .map(|choice| match *choice {
                Choice::Start(action) => Footprint::of_start(self.task, &self.actions[action]),
                Choice::End(start) => Footprint::of_end(self.task, self.action_at(start)),
            })
            .collect();
        let count = self.sequence.len();
        // `to >= from + distance`; the last node is time 0.
        let mut edges: Vec<(usize, usize, Rational)> = Vec::new();
        for (to, choice) in self.sequence.iter().enumerate() {
            edges.push((count, to, Rational::ZERO));
            for from in 0..to {
                let apart = if prints[from].interferes_with(&prints[to]) {
                    epsilon.clone()
                } else {
                    Rational::ZERO
                };
                edges.push((from, to, apart));
            }
            if let Choice::End(start) = *choice {
                let duration = self.duration_at(start);
                edges.push((start, to, duration.clone()));
                edges.push((to, start, -duration));
            }
        }
        for (timed, &place) in self.task.timed().iter().zip(places) {
            let footprint = Footprint::of_timed(timed);
            for (node, print) in prints.iter().enumerate() {
                let apart = if print.interferes_with(&footprint) {
                    epsilon.clone()
                } else {
                    Rational::ZERO
                };
                if node < place {
                    edges.push((node, count, apart - &timed.time));
                } else {
                    edges.push((count, node, &timed.time + apart));
                }
            }
        }
        let mut times = vec![Rational::ZERO; count + 1];
        for round in 0..=count + 1 {
            let mut changed = false;
            for (from, to, distance) in &edges {
                let time = &times[*from] + distance;
                if time > times[*to] {
                    times[*to] = time;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
            if round > count || times[count].is_positive() {
                return None;
            }
        }
        let steps = self.sequence.iter().enumerate();
        let steps = steps.filter_map(|(place, choice)| match *choice {
            Choice::Start(action) => Some(Step {
                start: times[place].clone(),
                action: self.actions[action].clone(),
                duration: self.actions[action]
                    .durative()
                    .map(|_| self.duration_at(place)),
            }),
            Choice::End(_) => None,
        });
        let candidate = TimeTriggeredPlan {
            steps: steps.collect(),
        };
        match validate::validate(self.task, &candidate, &Strictness::default()) {
            Verdict::Valid(report) => Some(report),
            _ => None,
        }
    }

    fn action_at(&self, place: usize) -> &Action {
        match self.sequence[place] {
            Choice::Start(action) => &self.actions[action],
            Choice::End(_) => unreachable!("ends point to starts"),
        }
    }

    fn duration_at(&self, place: usize) -> Rational {
        let body = self.action_at(place).durative();
        match &body.expect("durative").duration[0].bound {
            elbowroom_model::ground::Expression::Constant(value) => value.clone(),
            _ => unreachable!("durations are constants here"),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn the_planner_finds_a_plan_exactly_when_its_twin_does(draft in drafts()) {
        let mut task = draft.task();
        let situation = Situation::initial(&task);
        let mut turns = 0;
        let settings = Settings { first_plan_only: true, ..Settings::default() };
        let answer = plan(&mut task, &situation, &settings, &mut |_| {
            turns += 1;
            if turns > 200 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let actions = draft.ground(&mut task);
        let mut twin = Twin { task: &task, actions, sequence: Vec::new(), budget: 1_200 };
        let found = twin.finds();
        match &answer {
            Answer::Plan { found: ours, .. } => {
                let verdict =
                    validate_from(&task, &situation, &ours.plan, &Strictness::default());
                prop_assert!(matches!(verdict, Verdict::Valid(_)));
                if happenings(&ours.plan) <= MOST {
                    prop_assert_ne!(found, Some(false), "{}", describe(&answer));
                }
            }
            Answer::Unsolvable { .. } => {
                prop_assert_ne!(found, Some(true), "{}", describe(&answer));
            }
            Answer::NoneFound { .. } | Answer::Unsupported(_) => {
                // Ends of one time that run the store out together are beyond the planner.
                let is_plain = draft.actions.iter().all(|action| !action.minds);
                prop_assert!(!is_plain || found != Some(true), "{}", describe(&answer));
            }
        }
    }

    #[test]
    fn a_search_that_ends_has_found_the_best_metric(
        draft in thrifty_drafts(),
        prices in prop::collection::vec((1..5_u8, 0..5_u8, 0..3_u8), 4),
        metric in 0..METRICS.len(),
    ) {
        let mut task = draft.task_with(&prices, METRICS[metric]);
        let situation = Situation::initial(&task);
        let mut turns = 0;
        let answer = plan(&mut task, &situation, &Settings::default(), &mut |_| {
            turns += 1;
            if turns > 100 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let Answer::Plan { found, stopped, .. } = &answer else { return Ok(()) };
        let verdict = validate_from(&task, &situation, &found.plan, &Strictness::default());
        let Verdict::Valid(report) = verdict else { panic!("an invalid plan") };
        prop_assert_eq!(&report.metric(&task), &found.metric);
        if *stopped != Stopped::Exhausted {
            return Ok(());
        }
        let actions = draft.ground(&mut task);
        let mut twin = Twin { task: &task, actions, sequence: Vec::new(), budget: 1_500 };
        if let Some(Some(least)) = twin.least_metric() {
            let metric = found.metric.clone().expect("there is a metric");
            let ours = (metric, found.makespan.clone());
            prop_assert!(ours <= least, "{least:?}, not {ours:?}:\n{}", describe(&answer));
            if happenings(&found.plan) <= MOST {
                prop_assert_eq!(ours, least, "{}", describe(&answer));
            }
        }
    }
}
