//! Compiles a grounded task.

use elbowroom_model::ground::{self, Body, Change as ModelChange, Condition, DurativeBody};
use elbowroom_model::problem::{self, Comparison};
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{Footprint, Situation, Task};
use elbowroom_num::{End, Rational};

use super::directions::Shifts;
use super::eager;
use super::gaps;
use super::interference::{Access, Links, Stamps, TimedWishes, Wishes};
use super::symbols::Symbols;
use super::{
    Action, Bound, Change, Compiled, Conditional, Duration, Eagerness, Flow, NONE, Rule, Snap,
    Timed, Update,
};
use crate::embedded::formula::{Formula, Numeric};
use crate::embedded::state::{Open, State};
use crate::embedded::symbolic::{self, Form};
use crate::embedded::time::{Scale, Ticks};

/// A feature that the embedded planner does not handle, with the action or the like that uses it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the embedded planner does not handle {feature} ({place}); try an external planner")]
pub struct Unsupported {
    /// What it is.
    pub feature: String,
    /// Where it was met.
    pub place: String,
}

/// Compiles `grounding`, which is what `task` can reach from `situation`.
pub(crate) fn compile(
    task: &mut Task,
    grounding: &Grounding,
    situation: &Situation,
    epsilon: &Rational,
) -> Result<Compiled, Unsupported> {
    let mut full = full_actions(task, grounding);
    let mut builder = Builder::new(task);
    builder.links = Links::new(has_fixed_numbers(grounding, situation));
    builder.read_conditions(grounding, situation);
    for running in &situation.running {
        check(&running.action)?;
        builder.links_of(&running.action);
    }
    for action in &grounding.actions {
        check(action)?;
        builder.links_of(action);
    }
    let scale = scale_of(task, grounding, situation, epsilon);
    builder.epsilon = scale.ceil(epsilon).0.max(1);
    for running in &situation.running {
        builder.running(&running.action);
    }
    for (number, action) in grounding.actions.iter().enumerate() {
        builder.action(action, full.get_mut(number).and_then(Option::take).as_ref());
    }
    Ok(builder.finish(grounding, situation, scale))
}

/// Refuses what cannot be searched.
fn check(action: &ground::Action) -> Result<(), Unsupported> {
    let refuse = |feature: &str| {
        Err(Unsupported {
            feature: feature.to_owned(),
            place: format!("action {}", action.name),
        })
    };
    let mut has_unknown = false;
    let _ = action.map_leaves(&mut |leaf| {
        has_unknown |= matches!(leaf, ground::Expression::Unknown(_));
        None
    });
    if has_unknown {
        return refuse("numbers left open (:synth-parameters)");
    }
    let Some(body) = action.durative() else {
        return Ok(());
    };
    let guarded = |effect: &&ground::Effect| !effect.guard.over_all.is_trivial();
    if body.end.effects.iter().any(|e| guarded(&e)) {
        return refuse("effects under a condition over the whole action");
    }
    if body
        .continuous
        .iter()
        .any(|e| !e.guard.over_all.is_trivial())
    {
        return refuse("continuous effects under a condition over the whole action");
    }
    Ok(())
}

struct Builder<'a> {
    task: &'a Task,
    symbols: Symbols,
    links: Links,
    epsilon: Ticks,
    snaps: Vec<Snap>,
    wishes: Vec<Wishes>,
    actions: Vec<Action>,
    over_all: Vec<Condition>,
}

/// In full, as the judge sees them, the actions of which grounding may have dropped something that
/// reads or writes a changing fact: a conditional effect that never happens, or a part of a
/// disjunction that other parts decide. These interfere all the same.
fn full_actions(task: &mut Task, grounding: &Grounding) -> Vec<Option<ground::Action>> {
    let schemas = &task.problem().schemas;
    let is_shortened: Vec<bool> = schemas.iter().map(may_be_shortened).collect();
    if !is_shortened.contains(&true) {
        return Vec::new();
    }
    grounding
        .actions
        .iter()
        .map(|action| {
            if !is_shortened[action.schema.index()] {
                return None;
            }
            task.instantiate(action.schema, &action.arguments).ok()
        })
        .collect()
}

/// Whether it is plain that no number depends on when things happen: nothing changes continuously,
/// and no duration is chosen.
fn has_fixed_numbers(grounding: &Grounding, situation: &Situation) -> bool {
    let running = situation.running.iter().map(|running| &running.action);
    running.chain(&grounding.actions).all(|action| {
        action.durative().is_none_or(|body| {
            let is_fixed = body
                .duration
                .iter()
                .any(|bound| bound.comparison == Comparison::Equal);
            body.continuous.is_empty() && is_fixed
        })
    })
}

fn may_be_shortened(schema: &problem::Schema) -> bool {
    let is_conditional = |effect: &problem::Effect| {
        let guard = &effect.guard;
        !(guard.at_start.is_trivial() && guard.over_all.is_trivial() && guard.now.is_trivial())
    };
    match &schema.body {
        problem::Body::Instantaneous { condition, effects } => {
            !is_conjunction(condition) || effects.iter().any(is_conditional)
        }
        problem::Body::Durative {
            at_start,
            at_end,
            start_effects,
            end_effects,
            continuous,
            ..
        } => {
            let mut effects = start_effects.iter().chain(end_effects);
            !is_conjunction(at_start)
                || !is_conjunction(at_end)
                || effects.any(is_conditional)
                || continuous
                    .iter()
                    .any(|effect| !effect.guard.at_start.is_trivial())
        }
    }
}

/// Whether nothing but constants can be dropped from a condition.
fn is_conjunction(condition: &problem::Condition) -> bool {
    match condition {
        problem::Condition::Atom(_)
        | problem::Condition::Equal(..)
        | problem::Condition::Compare(..) => true,
        problem::Condition::Not(part) => matches!(
            **part,
            problem::Condition::Atom(_) | problem::Condition::Equal(..)
        ),
        problem::Condition::And(parts) => parts.iter().all(is_conjunction),
        problem::Condition::Forall(_, part) => is_conjunction(part),
        problem::Condition::Or(_) | problem::Condition::Exists(..) => false,
    }
}

/// The grid for all times and constant durations.
fn scale_of(
    task: &Task,
    grounding: &Grounding,
    situation: &Situation,
    epsilon: &Rational,
) -> Scale {
    let mut numbers: Vec<&Rational> = vec![epsilon, &situation.time];
    numbers.extend(task.timed().iter().map(|timed| &timed.time));
    for running in &situation.running {
        numbers.push(&running.start);
        for end in [&running.duration.lower, &running.duration.upper] {
            numbers.extend(end.value());
        }
    }
    for action in &grounding.actions {
        for constraint in action.durative().map_or(&[][..], |body| &body.duration) {
            if let ground::Expression::Constant(value) = &constraint.bound {
                numbers.push(value);
            }
        }
    }
    Scale::of(numbers.into_iter())
}

impl<'a> Builder<'a> {
    fn new(task: &'a Task) -> Self {
        Self {
            task,
            symbols: Symbols::new(task),
            links: Links::default(),
            epsilon: 1,
            snaps: Vec::new(),
            wishes: Vec::new(),
            actions: Vec::new(),
            over_all: Vec::new(),
        }
    }

    /// Numbers all facts that are read, and all fluents that matter, before any effect is looked
    /// at: what nothing reads is left out of the states.
    fn read_conditions(&mut self, grounding: &Grounding, situation: &Situation) {
        let symbols = &mut self.symbols;
        symbols.formula(&grounding.goal);
        for rule in &grounding.rules {
            symbols.fact(rule.head);
            symbols.formula(&rule.body);
        }
        let running = situation.running.iter().map(|running| &running.action);
        for action in running.clone().chain(&grounding.actions) {
            read_action(symbols, action);
        }
        // A value that another fluent's change reads matters if that fluent does.
        loop {
            let before = symbols.fluents.len();
            for action in running.clone().chain(&grounding.actions) {
                visit_changes(action, &mut |fluent, value| {
                    if symbols.known_fluent(fluent).is_some() {
                        value.visit_fluents(&mut |read| {
                            symbols.fluent(read);
                        });
                    }
                });
            }
            if symbols.fluents.len() == before {
                break;
            }
        }
        // An increase of a fluent without a value is a mistake that the judge would find.
        for action in running.chain(&grounding.actions) {
            visit_changes(action, &mut |fluent, _| {
                if !situation.state.values.contains_key(&fluent) {
                    symbols.fluent(fluent);
                }
            });
        }
    }

    fn links_of(&mut self, action: &ground::Action) {
        if let Some(body) = action.durative() {
            self.links.note(self.task, &body.over_all);
        }
    }

    fn push_snap(&mut self, snap: Snap, wishes: Wishes) -> u32 {
        self.snaps.push(snap);
        self.wishes.push(wishes);
        narrow(self.snaps.len() - 1)
    }

    /// An action that is under way: only its end is to come.
    fn running(&mut self, action: &ground::Action) {
        let Some(body) = action.durative() else {
            return;
        };
        let footprint = Footprint::of_end(self.task, action);
        let end = self.end_of(body, &footprint);
        let compiled = self.durative(action, body, NONE, end, Vec::new());
        self.actions.push(compiled);
        self.over_all.push(body.over_all.clone());
    }

    fn action(&mut self, action: &ground::Action, full: Option<&ground::Action>) {
        let full = full.unwrap_or(action);
        let (starts, ends) = (
            Footprint::of_start(self.task, full),
            Footprint::of_end(self.task, full),
        );
        let shifts = match &full.body {
            Body::Instantaneous(body) => Shifts::of(&body.effects),
            Body::Durative(body) => Shifts::of(&body.start.effects),
        };
        let mut wishes = Wishes::of(&starts, &shifts, self.epsilon, &self.links);
        match &action.body {
            Body::Instantaneous(body) => {
                let snap = self.snap(body, &mut Vec::new());
                let start = self.push_snap(snap, wishes);
                self.actions.push(Action {
                    schema: action.schema,
                    arguments: action.arguments.clone(),
                    start,
                    end: NONE,
                    over_all: Formula::default(),
                    guards: Vec::new(),
                    duration: Duration {
                        least: Rational::ZERO,
                        most: Some(Rational::ZERO),
                        bounds: Vec::new(),
                    },
                    flows: Vec::new(),
                    breaking_timed: Vec::new(),
                    eagerness: Eagerness::Offers,
                    only_adds_at_end: false,
                    excludes_itself: true,
                    uses_duration: false,
                });
                self.over_all.push(Condition::TRUE);
            }
            Body::Durative(body) => {
                wishes.need_from_now_on(self.task, &body.over_all, &self.links);
                let mut guards = Vec::new();
                let snap = self.snap(&body.start, &mut guards);
                let start = self.push_snap(snap, wishes);
                let shifts = full
                    .durative()
                    .map_or_else(Shifts::default, |body| Shifts::of(&body.end.effects));
                let end = self.end_with(body, &ends, &shifts, &mut guards);
                let compiled = self.durative(action, body, start, end, guards);
                self.actions.push(compiled);
                self.over_all.push(body.over_all.clone());
            }
        }
    }

    /// The end of an action that is under way; its guards are decided.
    fn end_of(&mut self, body: &DurativeBody, footprint: &Footprint) -> u32 {
        let mut decided = body.clone();
        for effect in &mut decided.end.effects {
            effect.guard.at_start = Condition::TRUE;
        }
        let shifts = Shifts::of(&body.end.effects);
        self.end_with(&decided, footprint, &shifts, &mut Vec::new())
    }

    fn end_with(
        &mut self,
        body: &DurativeBody,
        footprint: &Footprint,
        shifts: &Shifts,
        guards: &mut Vec<Formula>,
    ) -> u32 {
        let mut wishes = Wishes::of(footprint, shifts, self.epsilon, &self.links);
        wishes.needed_until_now(self.task, &body.over_all, &self.links);
        let snap = self.snap(&body.end, guards);
        self.push_snap(snap, wishes)
    }

    fn snap(&mut self, body: &ground::SnapAction, guards: &mut Vec<Formula>) -> Snap {
        let mut snap = Snap {
            condition: self.symbols.formula(&body.condition),
            ..Snap::default()
        };
        for effect in &body.effects {
            let change = match &effect.change {
                ModelChange::Add(fact) => self.symbols.known_fact(*fact).map(Change::Add),
                ModelChange::Delete(fact) => self.symbols.known_fact(*fact).map(Change::Delete),
                ModelChange::Update {
                    operator,
                    fluent,
                    value,
                } => self.symbols.known_fluent(*fluent).map(|fluent| {
                    Change::Update(Update {
                        fluent,
                        operator: *operator,
                        value: self.symbols.numeric(value),
                    })
                }),
            };
            let Some(change) = change else { continue };
            if effect.guard.is_trivial() {
                match change {
                    Change::Add(fact) => snap.adds.push(fact),
                    Change::Delete(fact) => snap.deletes.push(fact),
                    Change::Update(update) => snap.updates.push(update),
                }
                continue;
            }
            let at_start = (!effect.guard.at_start.is_trivial()).then(|| {
                guards.push(self.symbols.formula(&effect.guard.at_start));
                u8::try_from(guards.len() - 1).unwrap_or(u8::MAX)
            });
            let now = self.symbols.formula(&effect.guard.now);
            snap.conditional.push(Conditional {
                at_start,
                now,
                change,
            });
        }
        // An addition wins over a deletion by the same happening.
        let adds = std::mem::take(&mut snap.adds);
        snap.deletes.retain(|fact| !adds.contains(fact));
        snap.adds = adds;
        snap
    }

    fn durative(
        &mut self,
        action: &ground::Action,
        body: &DurativeBody,
        start: u32,
        end: u32,
        mut guards: Vec<Formula>,
    ) -> Action {
        let mut flows = Vec::new();
        for effect in &body.continuous {
            let guard = (start != NONE && !effect.guard.at_start.is_trivial()).then(|| {
                guards.push(self.symbols.formula(&effect.guard.at_start));
                u8::try_from(guards.len() - 1).unwrap_or(u8::MAX)
            });
            if let Some(fluent) = self.symbols.known_fluent(effect.fluent) {
                flows.push(Flow {
                    fluent,
                    rate: self.symbols.numeric(&effect.rate),
                    guard,
                });
            }
        }
        let over_all = self.symbols.formula(&body.over_all);
        let mut duration = Duration {
            least: Rational::ZERO,
            most: None,
            bounds: Vec::new(),
        };
        for constraint in &body.duration {
            duration.constrain(constraint, self.symbols.numeric(&constraint.bound));
        }
        let uses_duration = !flows.is_empty() || {
            let mut reads = false;
            let mut look = |leaf: &ground::Expression| {
                reads |= *leaf == ground::Expression::Duration;
            };
            body.over_all
                .visit_expressions(&mut |e| e.visit_leaves(&mut look));
            for snap in [&body.start, &body.end] {
                snap.condition
                    .visit_expressions(&mut |e| e.visit_leaves(&mut look));
                for effect in &snap.effects {
                    effect
                        .guard
                        .now
                        .visit_expressions(&mut |e| e.visit_leaves(&mut look));
                    if let ModelChange::Update { value, .. } = &effect.change {
                        value.visit_leaves(&mut look);
                    }
                }
            }
            reads
        };
        Action {
            schema: action.schema,
            arguments: action.arguments.clone(),
            start,
            end,
            over_all,
            guards,
            duration,
            flows,
            breaking_timed: Vec::new(),
            eagerness: Eagerness::Offers,
            only_adds_at_end: false,
            excludes_itself: start != NONE && excludes_itself(&self.snaps[start as usize]),
            uses_duration,
        }
    }

    #[allow(
        clippy::too_many_lines,
        reason = "one part of the compiled problem after the other"
    )]
    fn finish(mut self, grounding: &Grounding, situation: &Situation, scale: Scale) -> Compiled {
        let goal = self.symbols.formula(&grounding.goal);
        let mut rules: Vec<Rule> = Vec::new();
        for rule in &grounding.rules {
            let body = self.symbols.formula(&rule.body);
            let head = self.symbols.fact(rule.head);
            rules.push(Rule { head, body });
        }
        let (strata, derived) = stratified(rules, self.task, &self.symbols);
        let coming: Vec<_> = self
            .task
            .timed()
            .iter()
            .filter(|timed| timed.time > situation.time)
            .collect();
        let timed_wishes: Vec<Wishes> = coming
            .iter()
            .map(|timed| {
                let footprint = Footprint::of_timed(timed);
                Wishes::of(&footprint, &Shifts::default(), self.epsilon, &self.links)
            })
            .collect();
        let stamps = Stamps::of(self.wishes.iter().chain(&timed_wishes));
        let waiting = TimedWishes::of(&timed_wishes);
        for (snap, wishes) in self.snaps.iter_mut().zip(&self.wishes) {
            snap.after = stamps.after(wishes);
            snap.marks = stamps.marks(wishes);
            snap.before_timed = waiting.before(&wishes.makes);
        }
        if !coming.is_empty() {
            for (action, over_all) in self.actions.iter_mut().zip(&self.over_all) {
                let mut needs = Wishes::default();
                for conjunct in over_all.conjuncts() {
                    if matches!(conjunct, Condition::Fact(_) | Condition::Not(_)) {
                        needs.needed_until_now(self.task, conjunct, &self.links);
                    }
                }
                let breaking = waiting.before(&needs.makes);
                action.breaking_timed = breaking.into_iter().map(|(number, _)| number).collect();
            }
        }
        let mut is_exact = scale.exactly(&Rational::ONE).is_some();
        let timed: Vec<Timed> = coming
            .iter()
            .zip(&timed_wishes)
            .map(|(happening, wishes)| {
                let (time, exact) = scale.floor(&happening.time);
                is_exact &= exact;
                let mut timed = Timed {
                    time,
                    adds: Vec::new(),
                    deletes: Vec::new(),
                    assigns: Vec::new(),
                    marks: stamps.marks(wishes),
                };
                for change in &happening.changes {
                    match change {
                        ModelChange::Add(fact) => timed.adds.extend(self.symbols.known_fact(*fact)),
                        ModelChange::Delete(fact) => {
                            timed.deletes.extend(self.symbols.known_fact(*fact));
                        }
                        ModelChange::Update { fluent, value, .. } => {
                            if let (Some(fluent), ground::Expression::Constant(value)) =
                                (self.symbols.known_fluent(*fluent), value)
                            {
                                timed.assigns.push((fluent, value.clone()));
                            }
                        }
                    }
                }
                timed
            })
            .collect();
        let ends = eager::Ends::of(&self.actions, &self.snaps, &timed, self.symbols.facts.len());
        for number in 0..self.actions.len() {
            let action = &self.actions[number];
            if action.end == NONE || !strata.is_empty() {
                continue;
            }
            let makes = &self.wishes[action.end as usize].makes;
            let is_plain = makes.iter().all(|&access| match access {
                Access::Added(fact) => {
                    self.symbols.known_fact(fact).is_some() || !stamps.has(access)
                }
                Access::NeededTrue(_) | Access::NeededFalse(_) => true,
                _ => !stamps.has(access),
            });
            let only_adds = is_plain && ends.only_add(action, &self.snaps);
            self.actions[number].only_adds_at_end = only_adds;
        }
        let readers = readers(&self.actions, &self.snaps, self.symbols.facts.len());
        for number in 0..self.actions.len() {
            let action = &self.actions[number];
            if action.start != NONE && action.end != NONE {
                let (start, end) = (
                    &self.snaps[action.start as usize],
                    &self.snaps[action.end as usize],
                );
                let offers = |fact: u32| readers[fact as usize].has_other_than(narrow(number));
                // What changes continuously is there to be read meanwhile.
                if action.flows.is_empty() {
                    self.actions[number].eagerness = eagerness(start, end, &offers);
                }
            }
        }
        let mut goal_wishes = Wishes::default();
        goal_wishes.need_from_now_on(self.task, &grounding.goal, &self.links);
        let goal_accesses: Vec<_> = goal_wishes
            .after
            .iter()
            .map(|(access, _)| *access)
            .collect();
        let goal_timed = (0..coming.len())
            .filter(|&number| {
                let makes = &timed_wishes[number].makes;
                makes.iter().any(|access| goal_accesses.contains(access))
            })
            .map(narrow)
            .collect();
        let now = scale.floor(&situation.time);
        let epsilon = scale.ceil(&Rational::ZERO).0.max(self.epsilon);
        is_exact &= now.1;
        let mut compiled = Compiled {
            scale,
            epsilon,
            now: now.0,
            fact_stamps: self
                .symbols
                .facts
                .iter()
                .map(|&fact| stamps.of_fact(fact))
                .collect(),
            facts: self.symbols.facts,
            fluents: self.symbols.fluents,
            tests: self.symbols.tests,
            snaps: self.snaps,
            actions: self.actions,
            stamp_count: stamps.count(),
            timed,
            goal,
            goal_timed,
            strata,
            derived,
            initial: State::default(),
            is_exact,
            gap: None,
            relaxed_gap: None,
            is_symbolic: false,
        };
        compiled.is_symbolic = is_symbolic(&compiled);
        let fact_count = compiled.facts.len();
        compiled.relaxed_gap = gaps::among_facts(&compiled.actions, &compiled.snaps, fact_count);
        compiled.gap = gaps::among_numbers(&compiled.actions, &compiled.snaps, fact_count)
            .or(compiled.relaxed_gap);
        if compiled.is_symbolic {
            compiled.gap = Some("values that depend on when things happen");
        }
        compiled.initial = initial(&mut compiled, situation);
        compiled
    }
}

impl Duration {
    fn constrain(&mut self, constraint: &ground::DurationConstraint, value: Numeric) {
        let Some(constant) = value.as_constant() else {
            self.bounds.push(Bound {
                comparison: constraint.comparison,
                value,
                at_end: constraint.at_end,
            });
            return;
        };
        if !matches!(constraint.comparison, Comparison::AtMost | Comparison::Less)
            && *constant > self.least
        {
            self.least = constant.clone();
        }
        if !matches!(
            constraint.comparison,
            Comparison::AtLeast | Comparison::Greater
        ) && self.most.as_ref().is_none_or(|most| constant < most)
        {
            self.most = Some(constant.clone());
        }
    }
}

/// Which actions need a fact to be true.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Readers {
    None,
    Only(u32),
    Many,
}

impl Readers {
    fn note(&mut self, action: u32) {
        *self = match *self {
            Self::None => Self::Only(action),
            Self::Only(other) if other == action => Self::Only(action),
            _ => Self::Many,
        };
    }

    fn has_other_than(self, action: u32) -> bool {
        !matches!(self, Self::None) && self != Self::Only(action)
    }
}

/// For each fact, who needs it to be true.
fn readers(actions: &[Action], snaps: &[Snap], count: usize) -> Vec<Readers> {
    let mut readers = vec![Readers::None; count];
    for (number, action) in (0..).zip(actions) {
        let mut note = |formula: &Formula| {
            formula.visit_literals(&mut |literal| {
                if literal.truth() {
                    readers[literal.fact() as usize].note(number);
                }
            });
        };
        note(&action.over_all);
        for snap in [action.start, action.end] {
            if let Some(snap) = snaps.get(snap as usize) {
                note(&snap.condition);
                snap.conditional.iter().for_each(|effect| note(&effect.now));
            }
        }
    }
    readers
}

fn eagerness(start: &Snap, end: &Snap, is_read_by_others: &dyn Fn(u32) -> bool) -> Eagerness {
    let conditional = end
        .conditional
        .iter()
        .filter_map(|effect| match effect.change {
            Change::Delete(fact) => Some(fact),
            _ => None,
        });
    let mut withdrawn = end.deletes.iter().copied().chain(conditional);
    let offers = withdrawn.any(|fact| start.adds.contains(&fact) && is_read_by_others(fact));
    let lends = end.updates.iter().any(|back| {
        back.operator.is_additive()
            && start
                .updates
                .iter()
                .any(|out| out.fluent == back.fluent && out.operator != back.operator)
    });
    match (offers, lends) {
        (true, _) => Eagerness::Offers,
        (false, true) => Eagerness::Lends,
        (false, false) => Eagerness::Free,
    }
}

fn excludes_itself(start: &Snap) -> bool {
    start.condition.literals.iter().any(|literal| {
        if literal.truth() {
            start.deletes.contains(&literal.fact())
        } else {
            start.adds.contains(&literal.fact())
        }
    })
}

fn read_action(symbols: &mut Symbols, action: &ground::Action) {
    let snap = |symbols: &mut Symbols, snap: &ground::SnapAction| {
        symbols.formula(&snap.condition);
        for effect in &snap.effects {
            symbols.formula(&effect.guard.now);
            symbols.formula(&effect.guard.at_start);
        }
    };
    match &action.body {
        Body::Instantaneous(body) => snap(symbols, body),
        Body::Durative(body) => {
            snap(symbols, &body.start);
            snap(symbols, &body.end);
            symbols.formula(&body.over_all);
            for constraint in &body.duration {
                symbols.numeric(&constraint.bound);
            }
            for effect in &body.continuous {
                symbols.formula(&effect.guard.at_start);
            }
        }
    }
}

/// Calls `visit` for each numeric effect of the action.
fn visit_changes(
    action: &ground::Action,
    visit: &mut impl FnMut(ground::FluentId, &ground::Expression),
) {
    let effects = |effects: &[ground::Effect], visit: &mut dyn FnMut(_, &_)| {
        for effect in effects {
            if let ModelChange::Update { fluent, value, .. } = &effect.change {
                visit(*fluent, value);
            }
        }
    };
    match &action.body {
        Body::Instantaneous(body) => effects(&body.effects, visit),
        Body::Durative(body) => {
            effects(&body.start.effects, visit);
            effects(&body.end.effects, visit);
            for effect in &body.continuous {
                visit(effect.fluent, &effect.rate);
            }
        }
    }
}

/// Whether some number depends on when things happen: on a duration that can be chosen, or on
/// how far a continuous change has come.
fn is_symbolic(compiled: &Compiled) -> bool {
    compiled.actions.iter().any(|action| {
        !action.flows.is_empty()
            || action.uses_duration
                && !(action
                    .duration
                    .bounds
                    .iter()
                    .any(|b| b.comparison == Comparison::Equal)
                    || action.duration.most.as_ref() == Some(&action.duration.least))
    })
}

/// The rules by strata, and the heads of each.
fn stratified(rules: Vec<Rule>, task: &Task, symbols: &Symbols) -> (Vec<Vec<Rule>>, Vec<Vec<u32>>) {
    if rules.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let mut level = vec![0_usize; symbols.facts.len()];
    let is_derived: Vec<bool> = symbols.facts.iter().map(|&f| task.is_derived(f)).collect();
    // As deep as there are derived facts, unless one rests on its own negation; the task has made
    // sure that none does.
    for _ in 0..=rules.len() {
        let mut changed = false;
        for rule in &rules {
            let mut needed = level[rule.head as usize];
            rule.body.visit_literals(&mut |literal| {
                let fact = literal.fact() as usize;
                if is_derived[fact] {
                    needed = needed.max(level[fact] + usize::from(!literal.truth()));
                }
            });
            if needed > level[rule.head as usize] {
                level[rule.head as usize] = needed;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    let count = level.iter().max().copied().unwrap_or(0) + 1;
    let mut strata = vec![Vec::new(); count];
    let mut derived = vec![Vec::new(); count];
    for (fact, _) in is_derived
        .iter()
        .enumerate()
        .filter(|(_, derived)| **derived)
    {
        derived[level[fact]].push(narrow(fact));
    }
    for rule in rules {
        strata[level[rule.head as usize]].push(rule);
    }
    (strata, derived)
}

fn initial(compiled: &mut Compiled, situation: &Situation) -> State {
    let facts = compiled
        .facts
        .iter()
        .map(|fact| situation.state.facts.contains(fact));
    let values = compiled
        .fluents
        .iter()
        .map(|fluent| situation.state.values.get(fluent).cloned())
        .collect();
    let mut state = State::new(compiled, facts, values);
    let mut is_exact = true;
    for (number, running) in situation.running.iter().enumerate() {
        let (start, exact) = compiled.scale.floor(&running.start);
        is_exact &= exact;
        let (least, most) = (&running.duration.lower, &running.duration.upper);
        let elapsed = &situation.time - &running.start;
        let (least, exact) = match least {
            End::Infinite => (0, true),
            End::Closed(value) => compiled.scale.ceil(value),
            End::Open(value) => (compiled.scale.floor(value).0 + 1, false),
        };
        is_exact &= exact;
        let least = least.max(compiled.scale.ceil(&elapsed).0);
        let (most, exact) = match most {
            End::Infinite => (None, true),
            End::Closed(value) => {
                let (ticks, exact) = compiled.scale.floor(value);
                (Some(ticks), exact)
            }
            End::Open(value) => (Some(compiled.scale.ceil(value).0 - 1), false),
        };
        is_exact &= exact;
        state
            .open
            .push(Open::under_way(narrow(number), start, least, most));
    }
    compiled.is_exact &= is_exact;
    if compiled.is_symbolic {
        state.symbolic = Some(Box::default());
        let now = Form::constant(situation.time.clone());
        for place in 0..state.open.len() {
            for flow in &compiled.actions[place].flows {
                if let Some(rate) = flow.rate.value(&state.values, None) {
                    state.open[place].flows.push((flow.fluent, rate));
                }
            }
            for (fluent, rate) in state.open[place].flows.clone() {
                let flows = symbolic::flow(&mut state, fluent, &rate, &now);
                compiled.is_exact &= flows.is_some();
            }
        }
    }
    state
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}
