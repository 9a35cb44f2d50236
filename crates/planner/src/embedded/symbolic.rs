//! Numbers that depend on when things happen: on durations that can be chosen, and on how far
//! continuous changes have come.
//!
//! Such a number is a linear expression over the times of the happenings chosen so far (COLIN,
//! Coles, Coles, Fox & Long, IJCAI 2009). What conditions demand of it are linear inequalities;
//! together with the temporal network they are a linear program, and a state is possible only if
//! that has a solution. Here the network keeps all happenings, since a choice made long ago may
//! still matter.

mod program;

use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::Rational;

use super::compile::{Compiled, Update};
use super::expressions::{Course, Form, Moment, Symbolic};
use super::formula::{Formula, Linear, Numeric};
use super::state::State;
pub(crate) use program::{Exact, KnownEnd, is_possible, not_before, solve};

/// The value of an expression at some moment.
pub(crate) fn value(state: &State, numeric: &Numeric, moment: &Moment) -> Option<Form> {
    let symbolic = state.symbolic.as_ref()?;
    let Numeric::Linear(linear) = numeric else {
        let mut is_governed = numeric.reads_duration();
        numeric.visit_fluents(&mut |fluent| is_governed |= symbolic.governs(fluent));
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
        match symbolic.course(*fluent) {
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

/// Demands `form comparison 0`; `None` if that is false whatever the times.
pub(crate) fn demand(state: &mut State, form: Form, comparison: Comparison) -> Option<()> {
    if let Some(constant) = form.as_constant() {
        return comparison.holds(constant, &Rational::ZERO).then_some(());
    }
    let symbolic = state.symbolic.as_mut()?;
    let demand = (form, comparison);
    if !symbolic.demands.contains(&demand) {
        symbolic.demands.push(demand);
    }
    Some(())
}

/// Demands a formula. Of a choice, the first alternative that is not plainly false is taken;
/// `has_chosen` is set if another one might have been possible.
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
        let mut is_met = false;
        for part in choice {
            let mut attempt = state.clone();
            if demand_formula(compiled, &mut attempt, part, moment, has_chosen).is_some() {
                *has_chosen |= attempt.symbolic != state.symbolic;
                *state = attempt;
                is_met = true;
                break;
            }
        }
        if !is_met {
            return None;
        }
    }
    Some(())
}

/// Reads what an update will add or assign.
pub(crate) fn read(
    state: &State,
    update: &Update,
    moment: &Moment,
) -> Option<(u32, UpdateOperator, Form)> {
    let form = value(state, &update.value, moment)?;
    Some((update.fluent, update.operator, form))
}

/// Carries out an update.
pub(crate) fn update(
    state: &mut State,
    fluent: u32,
    operator: UpdateOperator,
    amount: &Form,
    moment: &Moment,
) -> Option<()> {
    let old = course_of(state, fluent);
    let rate = old.as_ref().map_or(Rational::ZERO, |old| old.rate.clone());
    let now = |course: &Course| course.base.clone().plus(&course.rate, &moment.time);
    let new = match operator {
        UpdateOperator::Assign => amount.clone(),
        UpdateOperator::Increase => now(&old?).plus(&Rational::ONE, amount),
        UpdateOperator::Decrease => now(&old?).plus(&Rational::from(-1), amount),
        UpdateOperator::ScaleUp => now(&old?).times(amount.as_constant()?),
        UpdateOperator::ScaleDown => now(&old?).times(&amount.as_constant()?.reciprocal()?),
    };
    let base = new.plus(&-&rate, &moment.time);
    set_course(state, fluent, Course { base, rate });
    Some(())
}

/// Lets a fluent move at a rate from some time on, or end doing so with the opposite rate.
pub(crate) fn flow(state: &mut State, fluent: u32, rate: &Rational, time: &Form) -> Option<()> {
    let mut course = course_of(state, fluent)?;
    course.base = course.base.plus(&-rate, time);
    course.rate += rate;
    set_course(state, fluent, course);
    Some(())
}

fn course_of(state: &State, fluent: u32) -> Option<Course> {
    if let Some(course) = state.symbolic.as_ref()?.course(fluent) {
        return Some(course.clone());
    }
    let value = state.values[fluent as usize].clone()?;
    Some(Course {
        base: Form::constant(value),
        rate: Rational::ZERO,
    })
}

fn set_course(state: &mut State, fluent: u32, course: Course) {
    let Some(symbolic) = &mut state.symbolic else {
        return;
    };
    let place = symbolic
        .courses
        .binary_search_by_key(&fluent, |entry| entry.0);
    let constant = course.base.as_constant().filter(|_| course.rate.is_zero());
    let value = &mut state.values[fluent as usize];
    match (constant.cloned(), place) {
        (Some(constant), place) => {
            *value = Some(constant);
            if let Ok(place) = place {
                symbolic.courses.remove(place);
            }
        }
        (None, Ok(place)) => symbolic.courses[place].1 = course,
        (None, Err(place)) => {
            *value = None;
            symbolic.courses.insert(place, (fluent, course));
        }
    }
}
