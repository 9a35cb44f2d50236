//! Random cases around a schedule that works.

use elbowroom_model::problem::{
    Atom, Body, Change, Comparison, Condition, ContinuousEffect, DurationConstraint, Effect,
    Expression, Fluent, Function, FunctionId, Guard, Predicate, PredicateId, Schema, TimedChange,
    TimedInitial, Type, Unknown, UpdateOperator,
};
use elbowroom_model::validate::Verdict;
use elbowroom_model::{Footprint, Problem, Task};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{
    Bound, DecoupledEnvelope, InstanceId, Node, Parameter, ParameterId, ParameterKind,
};

use crate::case::{Case, Gap, instance_of};
use crate::dice::Dice;
use crate::numbers;
use crate::system::System;

/// What a case has more of than others.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Theme {
    /// Nothing.
    Mixed,
    /// Timed initials, open ones, and disjunctions that depend on them.
    Timed,
    /// Continuous effects, and numbers left open in them.
    Rates,
    /// Conditional effects.
    Guards,
}

impl Theme {
    const ALL: [Self; 6] = [
        Self::Mixed,
        Self::Mixed,
        Self::Mixed,
        Self::Timed,
        Self::Rates,
        Self::Guards,
    ];
}

/// The case of that number.
pub(crate) fn generate(seed: u64) -> Case {
    let mut dice = Dice::new(seed);
    loop {
        if let Some(case) = attempt(&mut dice) {
            return case;
        }
    }
}

/// Nothing if the happenings as drawn get in each other's way.
fn attempt(dice: &mut Dice) -> Option<Case> {
    let theme = *dice.pick(&Theme::ALL);
    let case = Case {
        problem: skeleton(dice, theme),
        gaps: Vec::new(),
        parameters: Vec::new(),
        initial: std::collections::BTreeMap::new(),
        timed: std::collections::BTreeMap::new(),
        epsilon: dice
            .pick(&[
                Rational::new(1, 1000),
                Rational::new(1, 2),
                Rational::new(1, 4),
            ])
            .clone(),
    };
    let schedule = (0..8).find_map(|_| {
        let schedule = times(dice, &case);
        case.judge(&[], &schedule).is_valid().then_some(schedule)
    })?;
    let mut nominal = Nominal {
        case,
        schedule,
        theme,
        dice,
    };
    nominal.add_conditions();
    nominal.add_durations();
    nominal.add_gaps();
    nominal.open_numbers();
    if nominal.dice.chance(75) {
        nominal.tighten();
    }
    Some(nominal.case)
}

/// Actions with effects only, and timed initials.
fn skeleton(dice: &mut Dice, theme: Theme) -> Problem {
    let (facts, fluents) = (1 + dice.below(3), 1 + dice.below(2));
    let name = |prefix: &str, index: usize| format!("{prefix}{index}");
    let mut problem = Problem {
        types: vec![Type {
            name: "object".to_owned(),
            parents: Vec::new(),
        }],
        predicates: (0..facts)
            .map(|index| Predicate {
                name: name("p", index),
                parameters: Vec::new(),
                is_derived: false,
            })
            .collect(),
        functions: (0..fluents)
            .map(|index| Function {
                name: name("x", index),
                parameters: Vec::new(),
            })
            .collect(),
        ..Problem::default()
    };
    for fact in 0..facts {
        if dice.chance(50) {
            problem
                .initial_facts
                .push((PredicateId::from(fact), Vec::new()));
        }
    }
    for fluent in 0..fluents {
        if dice.chance(97) {
            let value = dice.half(0, 10);
            let entry = (FunctionId::from(fluent), Vec::new(), value);
            problem.initial_values.push(entry);
        }
    }
    for index in 0..*dice.pick(&[2, 2, 3, 3, 3, 4, 4, 5]) {
        let body = body(dice, facts, fluents, theme);
        problem.schemas.push(Schema {
            name: name("a", index),
            parameters: Vec::new(),
            unknowns: Vec::new(),
            body,
        });
    }
    let mut time = Rational::ZERO;
    let timed: &[usize] = if theme == Theme::Timed {
        &[2, 3]
    } else {
        &[0, 0, 1, 1, 2]
    };
    for _ in 0..*dice.pick(timed) {
        time += dice.half(1, if theme == Theme::Timed { 3 } else { 6 });
        for _ in 0..=dice.below(2) {
            problem.timed.push(TimedInitial {
                time: time.clone(),
                change: timed_change(dice, facts, fluents),
            });
        }
    }
    problem
}

fn timed_change(dice: &mut Dice, facts: usize, fluents: usize) -> TimedChange {
    let fact = PredicateId::from(dice.below(facts));
    match dice.below(3) {
        0 => TimedChange::Add(fact, Vec::new()),
        1 => TimedChange::Delete(fact, Vec::new()),
        _ => {
            let fluent = FunctionId::from(dice.below(fluents));
            TimedChange::Assign(fluent, Vec::new(), dice.half(0, 10))
        }
    }
}

fn body(dice: &mut Dice, facts: usize, fluents: usize, theme: Theme) -> Body {
    if dice.chance(30) {
        return Body::Instantaneous {
            condition: Condition::TRUE,
            effects: effects(dice, facts, fluents, (false, theme)),
        };
    }
    let continuous = if dice.chance(if theme == Theme::Rates { 90 } else { 40 }) {
        vec![ContinuousEffect {
            variables: Vec::new(),
            guard: if dice.chance(guarded(theme) / 2) {
                Guard {
                    at_start: literal(dice, facts, fluents),
                    ..Guard::default()
                }
            } else {
                Guard::default()
            },
            fluent: fluent(dice.below(fluents)),
            rate: rate(dice, fluents),
        }]
    } else {
        Vec::new()
    };
    let start_effects = effects(dice, facts, fluents, (true, theme));
    let mut end_effects = effects(dice, facts, fluents, (true, theme));
    for effect in &mut end_effects {
        if dice.chance(guarded(theme)) {
            effect.guard.at_start = literal(dice, facts, fluents);
        }
    }
    Body::Durative {
        duration: Vec::new(),
        at_start: Condition::TRUE,
        over_all: Condition::TRUE,
        at_end: Condition::TRUE,
        start_effects,
        end_effects,
        continuous,
    }
}

/// How many effects in a hundred depend on a condition.
fn guarded(theme: Theme) -> usize {
    if theme == Theme::Guards { 40 } else { 4 }
}

fn rate(dice: &mut Dice, fluents: usize) -> Expression {
    let number = constant(dice.pick(&[1, 1, 2, -1, -2]).to_owned().into());
    match dice.below(12) {
        0 => Expression::Fluent(fluent(dice.below(fluents))),
        1 => Expression::Multiply(vec![number, constant(dice.half(1, 2))]),
        2 => Expression::Add(vec![
            number,
            Expression::Fluent(fluent(dice.below(fluents))),
        ]),
        _ => number,
    }
}

fn effects(
    dice: &mut Dice,
    facts: usize,
    fluents: usize,
    (is_durative, theme): (bool, Theme),
) -> Vec<Effect> {
    let count = *dice.pick(&[0, 1, 1, 2]);
    let effect = |dice: &mut Dice| {
        let guard = if dice.chance(guarded(theme)) {
            Guard {
                now: literal(dice, facts, fluents),
                ..Guard::default()
            }
        } else {
            Guard::default()
        };
        let change = match dice.below(10) {
            0..=2 => Change::Add(atom(dice.below(facts))),
            3..=4 => Change::Delete(atom(dice.below(facts))),
            which => Change::Update {
                operator: match which {
                    5..=6 => UpdateOperator::Increase,
                    7..=8 => UpdateOperator::Decrease,
                    _ if dice.chance(10) => UpdateOperator::ScaleUp,
                    _ => UpdateOperator::Assign,
                },
                fluent: fluent(dice.below(fluents)),
                value: amount(dice, fluents, is_durative),
            },
        };
        Effect {
            variables: Vec::new(),
            guard,
            change,
        }
    };
    (0..count).map(|_| effect(dice)).collect()
}

fn amount(dice: &mut Dice, fluents: usize, is_durative: bool) -> Expression {
    let number = constant(dice.half(0, 4));
    match dice.below(12) {
        0 if is_durative => Expression::Duration,
        1 if is_durative => Expression::Multiply(vec![number, Expression::Duration]),
        2 if is_durative => Expression::Add(vec![Expression::Duration, number]),
        3 => Expression::Fluent(fluent(dice.below(fluents))),
        4 => Expression::Subtract(
            Box::new(number),
            Box::new(Expression::Fluent(fluent(dice.below(fluents)))),
        ),
        _ => number,
    }
}

fn literal(dice: &mut Dice, facts: usize, fluents: usize) -> Condition {
    if dice.chance(70) {
        let atom = Condition::Atom(atom(dice.below(facts)));
        if dice.chance(50) {
            atom
        } else {
            Condition::Not(Box::new(atom))
        }
    } else {
        let comparison = *dice.pick(&[Comparison::AtLeast, Comparison::Less]);
        let left = Expression::Fluent(fluent(dice.below(fluents)));
        Condition::Compare(comparison, left, constant(dice.half(0, 10)))
    }
}

fn constant(value: Rational) -> Expression {
    Expression::Constant(value)
}

fn atom(fact: usize) -> Atom {
    Atom {
        predicate: PredicateId::from(fact),
        arguments: Vec::new(),
    }
}

fn fluent(function: usize) -> Fluent {
    Fluent {
        function: FunctionId::from(function),
        arguments: Vec::new(),
    }
}

/// Times for all nodes, on a grid of halves.
fn times(dice: &mut Dice, case: &Case) -> Vec<Rational> {
    let mut schedule = vec![Rational::ZERO];
    for schema in &case.problem.schemas {
        let start = dice.half(0, 9);
        match &schema.body {
            Body::Instantaneous { .. } => schedule.push(start),
            Body::Durative { .. } => {
                let duration = if dice.chance(4) {
                    Rational::ZERO
                } else {
                    dice.half(1, 6)
                };
                let end = &start + &duration;
                schedule.extend([start, end]);
            }
        }
    }
    schedule.extend(case.timed_times());
    schedule
}

/// The place of a condition in an action, or the goal.
#[derive(Clone, Copy)]
enum Place {
    Start(usize),
    OverAll(usize),
    End(usize),
    Goal,
}

struct Nominal<'d> {
    case: Case,
    schedule: Vec<Rational>,
    theme: Theme,
    dice: &'d mut Dice,
}

impl Nominal<'_> {
    fn works(&self, case: &Case) -> bool {
        let valuation: Vec<_> = case.parameters.iter().map(|p| p.nominal.clone()).collect();
        case.judge(&valuation, &self.schedule).is_valid()
    }

    /// Adds conditions that hold in the nominal schedule; now and then one that does not.
    fn add_conditions(&mut self) {
        let mut places = vec![Place::Goal, Place::Goal];
        for (index, schema) in self.case.problem.schemas.iter().enumerate() {
            places.push(Place::Start(index));
            if matches!(schema.body, Body::Durative { .. }) {
                places.extend([Place::OverAll(index), Place::OverAll(index)]);
                places.push(Place::End(index));
            }
        }
        for place in places {
            for _ in 0..*self.dice.pick(&[0, 0, 1, 1, 1]) {
                for _ in 0..4 {
                    let mut candidate = self.case.clone();
                    let condition = self.condition(place);
                    add(&mut candidate.problem, place, condition);
                    if self.works(&candidate) || self.dice.chance(1) {
                        self.case = candidate;
                        break;
                    }
                }
            }
        }
    }

    fn condition(&mut self, place: Place) -> Condition {
        let compound = if self.theme == Theme::Timed { 4 } else { 10 };
        match self.dice.below(compound) {
            0 => Condition::Or(vec![self.simple(place), self.simple(place)]),
            1 => {
                let parts = vec![self.simple(place), self.simple(place)];
                let part = if self.dice.chance(50) {
                    Condition::Or(parts)
                } else {
                    Condition::And(parts)
                };
                Condition::Not(Box::new(part))
            }
            _ => self.simple(place),
        }
    }

    fn simple(&mut self, place: Place) -> Condition {
        let (facts, fluents) = (
            self.case.problem.predicates.len(),
            self.case.problem.functions.len(),
        );
        if self.dice.chance(40) {
            let atom = Condition::Atom(atom(self.dice.below(facts)));
            return if self.dice.chance(50) {
                atom
            } else {
                Condition::Not(Box::new(atom))
            };
        }
        let first = Expression::Fluent(fluent(self.dice.below(fluents)));
        let left = match self.dice.below(6) {
            0 if fluents > 1 => {
                let second = Expression::Fluent(fluent(1 - self.dice.below(2)));
                if self.dice.chance(50) {
                    Expression::Add(vec![first, second])
                } else {
                    Expression::Subtract(Box::new(first), Box::new(second))
                }
            }
            1 if self.has_duration(place) => {
                Expression::Subtract(Box::new(first), Box::new(Expression::Duration))
            }
            _ => first,
        };
        let (comparison, right) = self.near(place, &left);
        Condition::Compare(comparison, left, constant(right))
    }

    fn has_duration(&self, place: Place) -> bool {
        match place {
            Place::Goal => false,
            Place::Start(index) | Place::OverAll(index) | Place::End(index) => {
                matches!(self.case.problem.schemas[index].body, Body::Durative { .. })
            }
        }
    }

    /// A comparison that holds by a little, as far as the judge can tell the value.
    fn near(&mut self, place: Place, left: &Expression) -> (Comparison, Rational) {
        let comparison = *self.dice.pick(&[
            Comparison::AtLeast,
            Comparison::AtLeast,
            Comparison::Greater,
            Comparison::AtMost,
            Comparison::AtMost,
            Comparison::Less,
            Comparison::Equal,
        ]);
        let is_upper = matches!(comparison, Comparison::AtMost | Comparison::Less);
        let far = Rational::from(if is_upper { 10_000 } else { -10_000 });
        let asked = if is_upper {
            Comparison::AtMost
        } else {
            Comparison::AtLeast
        };
        let mut probe = self.case.clone();
        let condition = Condition::Compare(asked, left.clone(), constant(far.clone()));
        add(&mut probe.problem, place, condition);
        let valuation = Vec::new();
        let Verdict::Valid(report) = probe.judge(&valuation, &self.schedule) else {
            return (comparison, self.dice.half(0, 10));
        };
        let margins = report.margins.iter().map(|margin| &margin.margin);
        let huge = margins.filter(|margin| **margin > Rational::from(5000));
        let Some(margin) = huge.min() else {
            return (comparison, self.dice.half(0, 10));
        };
        let slack = match comparison {
            Comparison::Equal => Rational::ZERO,
            _ => self
                .dice
                .pick(&[
                    Rational::ZERO,
                    Rational::new(1, 2),
                    Rational::ONE,
                    Rational::from(3),
                ])
                .clone(),
        };
        let right = if is_upper {
            far - margin + slack
        } else {
            far + margin - slack
        };
        (comparison, right)
    }

    /// Bounds on durations, as domains have them.
    fn add_durations(&mut self) {
        let starts: Vec<_> = self.durations();
        for (index, duration) in starts {
            let limit = |comparison, bound| DurationConstraint {
                comparison,
                bound,
                at_end: false,
            };
            let slack = self.dice.half(0, 4);
            let fluents = self.case.problem.functions.len();
            let mut limits = match self.dice.below(8) {
                0..=3 => vec![limit(Comparison::Equal, constant(duration.clone()))],
                4 => vec![
                    limit(Comparison::AtLeast, constant(&duration - &slack)),
                    limit(Comparison::AtMost, constant(&duration + &slack)),
                ],
                5 => {
                    let bound = Expression::Fluent(fluent(self.dice.below(fluents)));
                    vec![limit(Comparison::AtMost, bound)]
                }
                6 => vec![limit(Comparison::AtMost, constant(&duration + &slack))],
                _ => Vec::new(),
            };
            if self.dice.chance(15) {
                for limit in &mut limits {
                    limit.at_end = true;
                }
            }
            let mut candidate = self.case.clone();
            set_duration(&mut candidate.problem, index, limits);
            if !self.works(&candidate) {
                let exact = limit(Comparison::Equal, constant(duration));
                set_duration(&mut candidate.problem, index, vec![exact]);
            }
            self.case = candidate;
        }
    }

    /// Durative actions with their nominal durations.
    fn durations(&self) -> Vec<(usize, Rational)> {
        let mut durations = Vec::new();
        for (index, schema) in self.case.problem.schemas.iter().enumerate() {
            if matches!(schema.body, Body::Durative { .. }) {
                let id = InstanceId::from(index);
                let gap = &self.time(Node::End(id)) - &self.time(Node::Start(id));
                durations.push((index, gap));
            }
        }
        durations
    }

    fn nodes(&self) -> Vec<Node> {
        self.case.build().1.plan.nodes
    }

    fn time(&self, node: Node) -> Rational {
        let position = self.nodes().iter().position(|&other| other == node);
        self.schedule[position.expect("a node of the plan")].clone()
    }

    /// Constraints around the nominal schedule: on durations, on happenings that interfere, on
    /// those that change what an over-all condition reads, and some at random.
    fn add_gaps(&mut self) {
        let nodes = self.nodes();
        let (task, plan) = self.case.build();
        for (index, _) in self.durations() {
            let id = InstanceId::from(index);
            let width = *self.dice.pick(&[0, 0, 0, 1, 3]);
            self.add_gap(Node::Start(id), Node::End(id), width, None);
        }
        for (later, &second) in nodes.iter().enumerate() {
            for (earlier, &first) in nodes.iter().enumerate() {
                let ordered = (&self.schedule[earlier], earlier) < (&self.schedule[later], later);
                let is_timed = matches!((first, second), (Node::Timed(_), Node::Timed(_)));
                let is_own = instance_of(first) == instance_of(second);
                if !ordered || earlier == 0 || is_timed || is_own {
                    continue;
                }
                let footprint = |node: usize| {
                    plan.plan
                        .footprint(&task, elbowroom_plan::NodeId::from(node))
                };
                let must = footprint(earlier).interferes_with(&footprint(later));
                let watch = over_all_reads(&task, &plan, first, second, &footprint(earlier))
                    || over_all_reads(&task, &plan, second, first, &footprint(later));
                let gap = &self.schedule[later] - &self.schedule[earlier];
                if must && self.dice.chance(94) {
                    let least = self.case.epsilon.clone().min(gap);
                    let width = *self.dice.pick(&[0, 1, 2, 4, 40, 40]);
                    self.add_gap(first, second, width, Some(least));
                } else if watch && self.dice.chance(85) {
                    let width = *self.dice.pick(&[0, 1, 2, 40]);
                    self.add_gap(first, second, width, Some(Rational::ZERO));
                } else if self.dice.chance(10) {
                    let width = *self.dice.pick(&[0, 1, 2, 4, 40]);
                    self.add_gap(first, second, width, None);
                }
            }
        }
        for &node in &nodes[1..] {
            if !matches!(node, Node::Timed(_)) && self.dice.chance(20) {
                let width = *self.dice.pick(&[0, 1, 2, 4]);
                self.add_gap(Node::Zero, node, width, None);
            }
        }
    }

    /// A constraint so many halves wide around the nominal difference, or without end.
    fn add_gap(&mut self, from: Node, to: Node, width: i64, least: Option<Rational>) {
        let gap = &self.time(to) - &self.time(from);
        let slack = Rational::new(width, 2);
        let lower = &gap - &slack;
        let lower = match least {
            Some(least) if width >= 40 => Bound::Finite(least),
            Some(least) => Bound::Finite(lower.max(least)),
            None if width >= 40 => Bound::Infinite,
            None => Bound::Finite(lower),
        };
        let upper = if width >= 40 {
            Bound::Infinite
        } else {
            Bound::Finite(gap + slack)
        };
        self.case.gaps.push(Gap {
            from,
            to,
            lower,
            upper,
        });
    }

    /// Makes one to four numbers parameters.
    fn open_numbers(&mut self) {
        for _ in 0..*self.dice.pick(&[1, 1, 2, 2, 3, 4]) {
            let which = match self.theme {
                Theme::Timed if self.dice.chance(60) => 8,
                Theme::Rates if self.dice.chance(70) => 5,
                _ => self.dice.below(10),
            };
            match which {
                0..=3 => self.open_duration(),
                4 => self.open_bound(),
                5..=6 => self.open_constant(),
                7 => self.open_initial(),
                8 => self.open_timed(),
                _ => self.open_again(),
            }
        }
    }

    fn new_parameter(&mut self, kind: ParameterKind, nominal: &Rational) -> ParameterId {
        let id = ParameterId::from(self.case.parameters.len());
        self.case.parameters.push(Parameter {
            name: format!("q{}", id.0),
            kind,
            nominal: nominal.clone(),
            weight: Rational::ONE,
            range: match kind {
                ParameterKind::Duration(_) | ParameterKind::Timed(_) => kind.natural_range(nominal),
                _ => Interval::EVERYTHING,
            },
        });
        id
    }

    fn open_duration(&mut self) {
        let durations = self.durations();
        if durations.is_empty() {
            return;
        }
        let (index, duration) = self.dice.pick(&durations).clone();
        let id = InstanceId::from(index);
        let kind = ParameterKind::Duration(id);
        if self.case.parameters.iter().any(|p| p.kind == kind) {
            return;
        }
        let parameter = self.new_parameter(kind, &duration);
        let (from, to) = (Node::Start(id), Node::End(id));
        self.case
            .gaps
            .retain(|gap| (gap.from, gap.to) != (from, to));
        self.case.gaps.push(Gap {
            from,
            to,
            lower: Bound::Parameter(parameter),
            upper: Bound::Parameter(parameter),
        });
    }

    fn open_bound(&mut self) {
        if self.case.gaps.is_empty() {
            return;
        }
        let index = self.dice.below(self.case.gaps.len());
        let gap = self.case.gaps[index].clone();
        let is_lower = self.dice.chance(50);
        let bound = if is_lower { &gap.lower } else { &gap.upper };
        if let Bound::Finite(value) = bound {
            let parameter = self.new_parameter(ParameterKind::Bound, &value.clone());
            let gap = &mut self.case.gaps[index];
            let place = if is_lower {
                &mut gap.lower
            } else {
                &mut gap.upper
            };
            *place = Bound::Parameter(parameter);
        }
    }

    /// One number in an action or the goal, or all numbers there that equal it.
    fn open_constant(&mut self) {
        let mut found = Vec::new();
        numbers::visit(&mut self.case.problem.clone(), &mut |leaf| {
            if let Expression::Constant(value) = leaf {
                found.push(value.clone());
            }
        });
        if found.is_empty() {
            return;
        }
        let chosen = self.dice.below(found.len());
        let everywhere = self.dice.chance(15);
        let value = found[chosen].clone();
        let parameter = self.new_parameter(ParameterKind::Domain, &value);
        let mut index = 0;
        numbers::visit(&mut self.case.problem, &mut |leaf| {
            if let Expression::Constant(other) = leaf {
                if index == chosen || (everywhere && *other == value) {
                    *leaf = Expression::Unknown(Unknown::Domain(parameter.0));
                }
                index += 1;
            }
        });
    }

    fn open_initial(&mut self) {
        let values = self.case.problem.initial_values.clone();
        if values.is_empty() {
            return;
        }
        let (function, _, value) = self.dice.pick(&values).clone();
        if self.case.initial.contains_key(&function) {
            return;
        }
        let fluent = Task::new(self.case.problem.clone()).find_fluent(function, &[]);
        let fluent = fluent.expect("it has a value");
        let parameter = self.new_parameter(ParameterKind::Initial(fluent), &value);
        self.case.initial.insert(function, parameter);
    }

    fn open_timed(&mut self) {
        let times = self.case.timed_times();
        if times.is_empty() {
            return;
        }
        let group = self.dice.below(times.len());
        if self.case.timed.contains_key(&group) {
            return;
        }
        let parameter = self.new_parameter(ParameterKind::Timed(group), &times[group]);
        self.case.timed.insert(group, parameter);
    }

    /// A parameter that is there already in one more place, where its nominal value fits.
    fn open_again(&mut self) {
        if self.case.parameters.is_empty() {
            return;
        }
        let index = self.dice.below(self.case.parameters.len());
        let nominal = self.case.parameters[index].nominal.clone();
        let parameter = ParameterId::from(index);
        if self.dice.chance(40) {
            let mut done = false;
            numbers::visit(&mut self.case.problem, &mut |leaf| {
                if !done && matches!(leaf, Expression::Constant(value) if *value == nominal) {
                    *leaf = Expression::Unknown(Unknown::Domain(parameter.0));
                    done = true;
                }
            });
            if done {
                return;
            }
        }
        let nodes = self.nodes();
        let (mut from, mut to) = (*self.dice.pick(&nodes), *self.dice.pick(&nodes));
        let mut gap = &self.time(to) - &self.time(from);
        if gap.is_negative() {
            std::mem::swap(&mut from, &mut to);
            gap = -gap;
        }
        if from == to {
            return;
        }
        let (lower, upper) = match gap.cmp(&nominal) {
            std::cmp::Ordering::Less => (Bound::Infinite, Bound::Parameter(parameter)),
            std::cmp::Ordering::Greater => (Bound::Parameter(parameter), Bound::Infinite),
            std::cmp::Ordering::Equal => (Bound::Parameter(parameter), Bound::Parameter(parameter)),
        };
        self.case.gaps.push(Gap {
            from,
            to,
            lower,
            upper,
        });
    }

    /// Looks for schedules that do not work at the nominal values, and narrows constraints until
    /// none is found: so that a good part of the boxes is inside.
    fn tighten(&mut self) {
        for _ in 0..8 {
            let (_, plan) = self.case.build();
            let valuation = plan.nominal();
            let system = System::new(&plan, &DecoupledEnvelope::point(&valuation));
            let Some(bad) = self.bad_schedule(system, &valuation) else {
                return;
            };
            let nodes = self.nodes();
            let differs =
                |a: usize, b: usize| &bad[b] - &bad[a] != &self.schedule[b] - &self.schedule[a];
            let mut pairs = Vec::new();
            for a in 0..nodes.len() {
                for b in a + 1..nodes.len() {
                    if differs(a, b) {
                        pairs.push((a, b));
                    }
                }
            }
            if pairs.is_empty() {
                return;
            }
            let (a, b) = *self.dice.pick(&pairs);
            let width = *self.dice.pick(&[0, 0, 1]);
            self.add_gap(nodes[a], nodes[b], width, None);
        }
    }

    fn bad_schedule(
        &mut self,
        mut system: System,
        valuation: &[Rational],
    ) -> Option<Vec<Rational>> {
        (0..8).find_map(|_| {
            let schedule = sample(&mut system, self.dice)?.1;
            let is_valid = self.case.judge(valuation, &schedule).is_valid();
            (!is_valid).then_some(schedule)
        })
    }
}

/// Whether an over-all condition of the running action reads what the footprint writes.
fn over_all_reads(
    task: &Task,
    plan: &elbowroom_plan::ParametrizedPlan,
    running: Node,
    writer: Node,
    footprint: &Footprint,
) -> bool {
    let (Node::Start(id) | Node::End(id)) = running else {
        return false;
    };
    let action = &plan.plan.instance(id).action;
    instance_of(writer) != Some(id)
        && action.durative().is_some_and(|body| {
            footprint.writes_what_is_read_by(&Footprint::of_condition(task, &body.over_all))
        })
}

fn add(problem: &mut Problem, place: Place, condition: Condition) {
    let target = match place {
        Place::Goal => &mut problem.goal,
        Place::Start(index) => match &mut problem.schemas[index].body {
            Body::Instantaneous { condition, .. } => condition,
            Body::Durative { at_start, .. } => at_start,
        },
        Place::OverAll(index) | Place::End(index) => match &mut problem.schemas[index].body {
            Body::Durative {
                over_all, at_end, ..
            } => {
                if matches!(place, Place::OverAll(_)) {
                    over_all
                } else {
                    at_end
                }
            }
            Body::Instantaneous { .. } => unreachable!("only durative actions have these"),
        },
    };
    if let Condition::And(parts) = target {
        parts.push(condition);
    }
}

fn set_duration(problem: &mut Problem, index: usize, limits: Vec<DurationConstraint>) {
    if let Body::Durative { duration, .. } = &mut problem.schemas[index].body {
        *duration = limits;
    }
}

/// Some schedule for some values: far out in a random direction, or halfway between two such.
pub(crate) fn sample(
    system: &mut System,
    dice: &mut Dice,
) -> Option<(Vec<Rational>, Vec<Rational>)> {
    let mut weights = || (0..20).map(|_| dice.between(-1, 1)).collect::<Vec<_>>();
    let (first, second) = (weights(), weights());
    let (values, times) = system.extreme(&first, HORIZON)?;
    if dice.chance(50) {
        return Some((values, times));
    }
    let (other_values, other_times) = system.extreme(&second, HORIZON)?;
    let middle = |a: Vec<Rational>, b: Vec<Rational>| {
        let pairs = a.into_iter().zip(b);
        pairs.map(|(a, b)| (a + b) * Rational::new(1, 2)).collect()
    };
    Some((middle(values, other_values), middle(times, other_times)))
}

/// No sampled schedule is longer.
const HORIZON: i64 = 60;
