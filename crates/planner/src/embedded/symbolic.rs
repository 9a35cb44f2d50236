//! Numbers that depend on the times of happenings: on durations that can be chosen, and on the
//! progress of continuous changes.
//!
//! Such a number is a linear expression over the times of the happenings chosen so far (COLIN,
//! Coles, Coles, Fox & Long, IJCAI 2009). Conditions on it are linear inequalities. Together with
//! the temporal network they form a linear program, and a state is possible only if it has a
//! solution. The network keeps all happenings in this case, since an early choice may still matter.

mod levels;
mod program;
mod projected;
mod windows;

use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::Rational;

use super::compile::{Change, Compiled, Update};
use super::expressions::{Form, LinearFunction, Moment, Symbolic};
use super::formula::{Formula, Linear, Numeric};
use super::network::{NodeId, SETTLED};
use super::state::{OpenAction, State};
pub(crate) use levels::highest_level;
pub(crate) use program::{Exact, KnownEnd, exact_distance, is_possible, not_before, solve};

/// Returns the value of an expression at some moment.
pub(crate) fn value(state: &State, numeric: &Numeric, moment: &Moment) -> Option<Form> {
    let symbolic = state.symbolic.as_ref()?;
    let Numeric::Linear(linear) = numeric else {
        let mut is_governed = numeric.reads_duration();
        numeric.visit_fluents(&mut |fluent| is_governed |= symbolic.is_time_dependent(fluent));
        let duration = moment.duration.as_ref().and_then(Form::as_constant);
        return if is_governed && duration.is_none() {
            None
        } else {
            numeric.value(&state.values, duration).map(Form::constant)
        };
    };
    linear_value(state, symbolic, linear, moment)
}

fn linear_value(
    state: &State,
    symbolic: &Symbolic,
    linear: &Linear,
    moment: &Moment,
) -> Option<Form> {
    let mut sum = Form::constant(linear.constant.clone());
    for (fluent, coefficient) in &linear.terms {
        match symbolic.linear_function(*fluent) {
            None => sum.constant += coefficient * state.values[*fluent as usize].as_ref()?,
            Some(course) => {
                sum = sum.plus(coefficient, &course.base);
                sum = sum.plus(&(coefficient * &course.rate), &moment.time);
            }
        }
    }
    if !linear.duration.is_zero() {
        sum = sum.plus(&linear.duration, moment.duration.as_ref()?);
    }
    Some(sum)
}

/// Demands `form comparison 0`. Returns `None` if it is false for all times.
pub(crate) fn demand(state: &mut State, form: Form, comparison: Comparison) -> Option<()> {
    if let Some(constant) = form.as_constant() {
        return comparison.holds(constant, &Rational::ZERO).then_some(());
    }
    let symbolic = state.symbolic.as_mut()?;
    symbolic.demand(form, comparison);
    Some(())
}

/// Demands a formula. For a choice, demands the first alternative that is possible at this stage.
/// Sets `has_chosen` if another alternative might have been possible.
pub(crate) fn demand_formula(
    compiled: &Compiled,
    state: &mut State,
    formula: &Formula,
    moment: &Moment,
    has_chosen: &mut bool,
) -> Option<()> {
    if !formula.literals.iter().all(|l| l.holds(&state.facts)) {
        return None;
    }
    for &test in &formula.tests {
        let test = &compiled.tests[test as usize];
        let form = value(state, &test.difference, moment)?;
        demand(state, form, test.comparison)?;
    }
    for choice in &formula.choices {
        demand_choice(compiled, state, choice, moment, has_chosen)?;
    }
    Some(())
}

/// Demands the first alternative of a choice that is possible at this stage, and returns its position.
fn demand_choice(
    compiled: &Compiled,
    state: &mut State,
    choice: &[Formula],
    moment: &Moment,
    has_chosen: &mut bool,
) -> Option<usize> {
    for (number, part) in choice.iter().enumerate() {
        let mut attempt = state.clone();
        if demand_formula(compiled, &mut attempt, part, moment, has_chosen).is_some() {
            let is_conditional = attempt.symbolic != state.symbolic;
            *has_chosen |= is_conditional;
            let is_last = number + 1 == choice.len();
            if is_conditional && !is_last && !is_possible(&mut attempt, compiled, None) {
                continue;
            }
            *state = attempt;
            return Some(number);
        }
    }
    None
}

/// Part of an over-all condition's open interval that a moment borders on. In such a piece, numbers are
/// linear in time.
#[derive(Debug)]
pub(crate) enum Piece<'a> {
    /// The first piece begins, excluding the moment.
    Begins(&'a mut Vec<(u32, Form)>),
    /// A piece ends, excluding the moment. For the first piece, these are the initial differences
    /// of strict tests.
    Ends(&'a [(u32, Form)]),
    /// The moment lies inside the interval.
    Within,
}

/// Demands an over-all condition at a moment. A strict test need not hold at an open end: it holds
/// throughout a piece if it holds, not strictly, at both ends, and strictly at one of them. For a
/// choice on numbers, the alternative at the end of a piece must be that of its beginning:
/// otherwise one alternative may hold at one end and another one at the other end, and none in
/// between.
pub(crate) fn demand_over_all(
    compiled: &Compiled,
    state: &mut State,
    formula: &Formula,
    (mut piece, moment, chosen): (Piece<'_>, &Moment, &mut Vec<Option<usize>>),
    has_chosen: &mut bool,
) -> Option<()> {
    let is_open = !matches!(piece, Piece::Within);
    let is_strict = |test: u32| {
        let comparison = compiled.tests[test as usize].comparison;
        matches!(comparison, Comparison::Less | Comparison::Greater)
    };
    let (strict, plain): (Vec<u32>, Vec<u32>) = formula
        .tests
        .iter()
        .partition(|&&test| is_open && is_strict(test));
    for test in strict {
        let data = &compiled.tests[test as usize];
        let form = value(state, &data.difference, moment)?;
        let closed = match data.comparison {
            Comparison::Less => Comparison::AtMost,
            _ => Comparison::AtLeast,
        };
        demand(state, form.clone(), closed)?;
        match &mut piece {
            Piece::Begins(beginnings) => beginnings.push((test, form)),
            Piece::Ends(beginnings) => {
                if let Some((_, first)) = beginnings.iter().find(|(known, _)| *known == test) {
                    demand(state, form.plus(&Rational::ONE, first), data.comparison)?;
                }
            }
            Piece::Within => {}
        }
    }
    let rest = Formula {
        literals: formula.literals.clone(),
        tests: plain,
        choices: Vec::new(),
    };
    demand_formula(compiled, state, &rest, moment, has_chosen)?;
    chosen.resize(formula.choices.len(), None);
    for (choice, chosen) in formula.choices.iter().zip(chosen) {
        let mut earlier = None;
        if matches!(piece, Piece::Ends(_)) {
            earlier = chosen.filter(|&number| !choice[number].tests.is_empty());
        }
        if let Some(number) = earlier {
            *has_chosen = true;
            demand_formula(compiled, state, &choice[number], moment, has_chosen)?;
        } else {
            *chosen = Some(demand_choice(compiled, state, choice, moment, has_chosen)?);
        }
    }
    Some(())
}

/// Evaluates the amount that an update adds or assigns.
pub(crate) fn read(
    state: &State,
    update: &Update,
    moment: &Moment,
) -> Option<(u32, UpdateOperator, Form)> {
    let form = value(state, &update.value, moment)?;
    Some((update.fluent, update.operator, form))
}

/// Applies an update.
pub(crate) fn update(
    state: &mut State,
    fluent: u32,
    operator: UpdateOperator,
    amount: &Form,
    moment: &Moment,
) -> Option<()> {
    let old = function_of(state, fluent);
    let rate = old.as_ref().map_or(Rational::ZERO, |old| old.rate.clone());
    let now = |course: &LinearFunction| course.base.clone().plus(&course.rate, &moment.time);
    let new = match operator {
        UpdateOperator::Assign => amount.clone(),
        UpdateOperator::Increase => now(&old?).plus(&Rational::ONE, amount),
        UpdateOperator::Decrease => now(&old?).plus(&Rational::from(-1), amount),
        UpdateOperator::ScaleUp => now(&old?).times(amount.as_constant()?),
        UpdateOperator::ScaleDown => now(&old?).times(&amount.as_constant()?.reciprocal()?),
    };
    let base = new.plus(&-&rate, &moment.time);
    set_function(state, fluent, LinearFunction { base, rate });
    Some(())
}

/// Starts a continuous change of a fluent at a time, or ends it if called with the opposite rate.
pub(crate) fn flow(state: &mut State, fluent: u32, rate: &Rational, time: &Form) -> Option<()> {
    let mut course = function_of(state, fluent)?;
    course.base = course.base.plus(&-rate, time);
    course.rate += rate;
    set_function(state, fluent, course);
    Some(())
}

/// Returns the value of a fluent after the ends of all running actions, if nothing else starts and
/// the value does not depend on times.
pub(crate) fn settled_value(compiled: &Compiled, state: &State, fluent: u32) -> Option<Rational> {
    let symbolic = state.symbolic.as_ref()?;
    if is_assigned_later(compiled, state, fluent) {
        return None;
    }
    for open in &state.open {
        let end = compiled.snap(compiled.action(open.action).end);
        let conditional = end
            .conditional
            .iter()
            .filter_map(|effect| match &effect.change {
                Change::Update(update) => Some(update),
                _ => None,
            });
        let mut updates = end.updates.iter().chain(conditional);
        if updates.any(|update| update.fluent == fluent) {
            return None;
        }
    }
    match settled_function(compiled, symbolic, state, fluent) {
        None => state.values[fluent as usize].clone(),
        Some(course) => {
            let is_settled = course.rate.is_zero();
            course.base.as_constant().filter(|_| is_settled).cloned()
        }
    }
}

/// Returns `true` if a future timed initial assigns the fluent.
fn is_assigned_later(compiled: &Compiled, state: &State, fluent: u32) -> bool {
    let mut to_come = compiled.timed[state.timed as usize..].iter();
    to_come.any(|timed| timed.assigns.iter().any(|(own, _)| *own == fluent))
}

/// Returns the course of a fluent after the ends of all running actions, without its jumps at these
/// ends, or `None` if its value does not depend on times.
fn settled_function(
    compiled: &Compiled,
    symbolic: &Symbolic,
    state: &State,
    fluent: u32,
) -> Option<LinearFunction> {
    let mut course = symbolic.linear_function(fluent)?.clone();
    for open in &state.open {
        for (_, rate) in open.flows.iter().filter(|(own, _)| *own == fluent) {
            let time = end_form(compiled, open, open.end);
            course.base = std::mem::take(&mut course.base).plus(rate, &time);
            course.rate -= rate;
        }
    }
    Some(course)
}

/// Returns the time of an action's end. A fixed duration counts from the start, so that the total
/// of a continuous change is a constant.
pub(crate) fn end_form(compiled: &Compiled, open: &OpenAction, end: NodeId) -> Form {
    let Some(duration) = &open.duration else {
        return Form::node(end);
    };
    if open.node != SETTLED {
        return Form::constant(duration.clone()).plus(&Rational::ONE, &Form::node(open.node));
    }
    let initial = &compiled.initial;
    let running = initial.running.get(open.action as usize);
    let known = running.map(|running| &running.exact_start + duration);
    known
        .filter(|known| *known >= initial.time)
        .map_or_else(|| Form::node(end), Form::constant)
}

fn function_of(state: &State, fluent: u32) -> Option<LinearFunction> {
    if let Some(course) = state.symbolic.as_ref()?.linear_function(fluent) {
        return Some(course.clone());
    }
    let value = state.values[fluent as usize].clone()?;
    Some(LinearFunction {
        base: Form::constant(value),
        rate: Rational::ZERO,
    })
}

fn set_function(state: &mut State, fluent: u32, course: LinearFunction) {
    let Some(symbolic) = &mut state.symbolic else {
        return;
    };
    let place = symbolic
        .functions
        .binary_search_by_key(&fluent, |entry| entry.0);
    let constant = course.base.as_constant().filter(|_| course.rate.is_zero());
    let value = &mut state.values[fluent as usize];
    match (constant.cloned(), place) {
        (Some(constant), place) => {
            *value = Some(constant);
            if let Ok(place) = place {
                symbolic.functions.remove(place);
            }
        }
        (None, Ok(place)) => symbolic.functions[place].1 = course,
        (None, Err(place)) => {
            *value = None;
            symbolic.functions.insert(place, (fluent, course));
        }
    }
}
