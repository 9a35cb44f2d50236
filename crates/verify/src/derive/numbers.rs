//! Check that no condition on numbers can fail in a schedule of the network for values in the box,
//! and the inequalities that all boxes inside the envelope satisfy because of such conditions:
//! [`Numbers`].

use elbowroom_num::Rational;

use super::distances::Distances;
use super::failures::{Failure, Place};
use super::linear::{Inequality, Linear};
use super::offset_components::OffsetComponents;
use crate::certificate::{Certificate, End, Sum};
use crate::flaw::Flaw;
use crate::intervals::Intervals;
use crate::sound;

/// Refutes failures. Each inequality is bounded from below with intervals of parameters and shortest paths; where
/// this is not enough, the certificate's own refutation of that failure counts, which
/// [`verify`](crate::verify()) has checked.
pub(super) struct Numbers<'a> {
    pub(super) certificate: &'a Certificate,
    pub(super) intervals: &'a Intervals,
    pub(super) places: &'a OffsetComponents,
    pub(super) distances: Distances,
    /// Returns `true` for parameters that are bounds between time points, which may be negative.
    pub(super) is_bound: &'a dyn Fn(usize) -> bool,
}

impl Numbers<'_> {
    /// Returns `true` if the failure is possible in no schedule for values in the box.
    ///
    /// # Errors
    /// When the network has no schedule.
    pub(super) fn refutes(&mut self, failure: &Failure) -> Result<bool, Flaw> {
        if let Some(place) = &failure.moment
            && self.has_no_moment(place)?
        {
            return Ok(true);
        }
        for inequality in &failure.inequalities {
            if self.is_impossible(inequality, failure.moment.as_ref())? {
                return Ok(true);
            }
        }
        let conditions = self.certificate.sound.as_ref();
        let conditions = conditions.and_then(|sound| sound.conditions.as_ref());
        for condition in conditions.into_iter().flatten() {
            if self.is_refuted_by(failure, condition)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Returns `true` if there is no such moment.
    fn has_no_moment(&mut self, place: &Place) -> Result<bool, Flaw> {
        for &earlier in place.before.iter().chain([&place.start]) {
            for &later in place.after.iter().chain([&place.end]) {
                if self.distances.is_before(later, earlier, &Rational::ZERO)? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Returns `true` if the inequality holds at no possible time.
    fn is_impossible(
        &mut self,
        inequality: &Inequality,
        place: Option<&Place>,
    ) -> Result<bool, Flaw> {
        let moment = self.certificate.points.len();
        let slope = inequality.expression.times.get(&moment).cloned();
        let (Some(slope), Some(place)) = (slope, place) else {
            return self.is_positive(&inequality.expression, inequality.is_strict);
        };
        // The expression is least at the earliest or at the latest time.
        let is_early = slope.is_positive();
        let (edge, others) = if is_early {
            (place.start, &place.before)
        } else {
            (place.end, &place.after)
        };
        for &point in others.iter().chain([&edge]) {
            let expression =
                substitute_time(&inequality.expression, moment, &self.places.time(point));
            // The moment may be at the time of a point that comes before it, but of no other.
            let is_open = !is_early || point == edge;
            if self.is_positive(&expression, inequality.is_strict || is_open)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Returns `true` if the expression is greater than 0, or at least 0, in all schedules.
    fn is_positive(&mut self, expression: &Linear, or_zero: bool) -> Result<bool, Flaw> {
        let least = self.least(expression)?;
        Ok(least.is_some_and(|least| least.is_positive() || (or_zero && least.is_zero())))
    }

    /// Returns a lower bound of an expression, or `None` if there is none that the rules here find: of the
    /// parameters at their ends, and the times, of at most two components, by a shortest path.
    fn least(&mut self, expression: &Linear) -> Result<Option<Rational>, Flaw> {
        let mut roots: Vec<(usize, Rational)> = expression
            .times
            .iter()
            .map(|(root, factor)| (*root, factor.clone()))
            .collect();
        let rest = roots
            .iter()
            .fold(Rational::ZERO, |sum, (_, factor)| sum - factor);
        if !rest.is_zero() {
            roots.push((0, rest));
        }
        let (to, from, factor) = match &roots[..] {
            [] => return Ok(self.least_of_parameters(expression)),
            [(one, factor), (other, _)] => {
                if factor.is_positive() {
                    (*one, *other, factor.clone())
                } else {
                    (*other, *one, -factor)
                }
            }
            _ => return Ok(None),
        };
        let mut greatest: Option<Rational> = None;
        let (to, from): (Vec<usize>, Vec<usize>) = (
            self.places.members(to).collect(),
            self.places.members(from).collect(),
        );
        for &to in &to {
            for &from in &from {
                let Some(between) = self.distances.least(from, to)? else {
                    continue;
                };
                let difference = self.places.time(to).minus(&self.places.time(from));
                let mut rest = expression.clone();
                rest.add_scaled(&difference, &-&factor);
                let Some(rest) = self.least_of_parameters(&rest) else {
                    continue;
                };
                let bound = rest + &between * &factor;
                greatest = Some(greatest.map_or(bound.clone(), |known| known.max(bound)));
            }
        }
        Ok(greatest)
    }

    fn least_of_parameters(&self, expression: &Linear) -> Option<Rational> {
        let minus: Vec<(usize, Rational)> = expression
            .parameters
            .iter()
            .map(|(parameter, factor)| (*parameter, -factor))
            .collect();
        let minus = minus.iter().map(|(parameter, factor)| (*parameter, factor));
        let greatest = self.intervals.greatest(-&expression.constant, minus)?;
        Some(-greatest)
    }

    /// Returns `true` if the certificate proves that a condition cannot fail in this way.
    fn is_refuted_by(
        &mut self,
        failure: &Failure,
        condition: &sound::Condition,
    ) -> Result<bool, Flaw> {
        let is_there = match (condition.during, &failure.moment) {
            (None, _) => true,
            (Some(during), Some(place)) => during == [place.start, place.end],
            (Some(_), None) => false,
        };
        if !is_there || condition.cases.is_empty() {
            return Ok(false);
        }
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            match condition.cases.get(index) {
                None => return Ok(false),
                Some(sound::FailureCase::Never(_)) => {}
                Some(sound::FailureCase::Either { event, cases }) => {
                    let Some(place) = &failure.moment else {
                        return Ok(false);
                    };
                    if *event == place.start || place.before.contains(event) {
                        open.push(cases[0]);
                    } else if *event == place.end || place.after.contains(event) {
                        open.push(cases[1]);
                    } else {
                        open.extend(cases);
                    }
                }
                Some(sound::FailureCase::Ways(ways)) => {
                    let mut is_found = false;
                    for way in ways {
                        is_found = is_found || self.implies_violation(failure, way)?;
                    }
                    if !is_found {
                        return Ok(false);
                    }
                }
            }
        }
        Ok(true)
    }

    /// Returns `true` if the failure implies all bounds of a way that the certificate refutes.
    fn implies_violation(
        &mut self,
        failure: &Failure,
        way: &sound::Violation,
    ) -> Result<bool, Flaw> {
        for own in &way.inequalities {
            let Some(own) = self.inequality(own) else {
                return Ok(false);
            };
            if !failure.inequalities.iter().any(|known| known.implies(&own)) {
                return Ok(false);
            }
        }
        for own in &way.differences {
            if !self.is_known(failure.moment.as_ref(), own)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Returns the certificate's inequality in normal form, or `None` if there are products in it.
    fn inequality(&self, own: &sound::Inequality) -> Option<Inequality> {
        if !own.products.is_empty() {
            return None;
        }
        let mut expression = Linear::number(own.constant.clone());
        for time in &own.times {
            expression.add_time(time.point, &time.factor);
        }
        for value in &own.parameters {
            expression.add_parameter(value.parameter, &value.factor);
        }
        Some(Inequality {
            expression: self.places.normalised(&expression),
            is_strict: own.strict,
        })
    }

    /// Returns `true` if a bound on a difference holds at the place of a failure.
    fn is_known(&mut self, place: Option<&Place>, own: &sound::Difference) -> Result<bool, Flaw> {
        let moment = self.certificate.points.len();
        let holds = |most: &Rational, is_strict: bool| {
            own.most > *most || (own.most == *most && (is_strict || !own.strict))
        };
        let zero = Rational::ZERO;
        match (own.from == moment, own.to == moment, place) {
            (true, false, Some(place)) => {
                let is_strict = own.to == place.start;
                let is_known = is_strict || place.before.contains(&own.to);
                Ok(is_known && holds(&zero, is_strict))
            }
            (false, true, Some(place)) => {
                let is_known = own.from == place.end || place.after.contains(&own.from);
                Ok(is_known && holds(&zero, true))
            }
            (false, false, _) if own.from < moment && own.to < moment => {
                let least = self.distances.least(own.to, own.from)?;
                Ok(least.is_some_and(|least| holds(&-least, false)))
            }
            _ => Ok(false),
        }
    }

    /// Returns the expressions in parameters that are not negative anywhere in a box inside the envelope, because
    /// otherwise this failure is possible.
    ///
    /// The failure has to be a single inequality on parameters alone, or to be there at each moment of its place. For the
    /// values at which the expression is least there is a schedule, or the box is not inside; in each the condition
    /// fails. A moment inside an action is taken as close to a point as one likes, if in all these schedules it can be
    /// there.
    ///
    /// # Errors
    /// When the network has no schedule.
    pub(super) fn rows(&self, failure: &Failure) -> Result<Vec<Linear>, Flaw> {
        if let (Some(place), []) = (&failure.moment, &failure.inequalities[..]) {
            return self.rows_without_moment(place);
        }
        let [inequality] = &failure.inequalities[..] else {
            return Ok(Vec::new());
        };
        let moment = self.certificate.points.len();
        let Some(place) = &failure.moment else {
            let own = &inequality.expression;
            return Ok(own
                .times
                .is_empty()
                .then(|| own.clone())
                .into_iter()
                .collect());
        };
        let mut rows = Vec::new();
        let edges = [place.start, place.end];
        for &point in edges.iter().chain(&place.before).chain(&place.after) {
            let expression =
                substitute_time(&inequality.expression, moment, &self.places.time(point));
            if expression.times.is_empty()
                && !expression.parameters.is_empty()
                && self.is_possible(place, point, &expression)?
            {
                rows.push(expression);
            }
        }
        Ok(rows)
    }

    /// Returns the expressions in parameters that are not negative if there is no moment at a place: a point that comes
    /// before all its moments is not before a point that comes after them.
    fn rows_without_moment(&self, place: &Place) -> Result<Vec<Linear>, Flaw> {
        let earliest: Vec<usize> = place.before.iter().chain([&place.start]).copied().collect();
        let latest: Vec<usize> = place.after.iter().chain([&place.end]).copied().collect();
        let mut rows = Vec::new();
        for &earlier in &earliest {
            for &later in &latest {
                let time = |point: usize| self.places.time(point);
                let expression = time(earlier).minus(&time(later));
                if !expression.times.is_empty() || expression.parameters.is_empty() {
                    continue;
                }
                // Wherever these two are in this order, the other pairs must be in this order too.
                let mut distances = Distances::new(self.certificate, &self.corner(&expression))?;
                let mut are_others = true;
                for &first in &earliest {
                    for &last in &latest {
                        let apart = distances.least(first, last)?;
                        are_others = are_others
                            && (apart.is_some_and(|apart| apart.is_positive())
                                || (distances.is_before(first, earlier, &Rational::ZERO)?
                                    && distances.is_before(later, last, &Rational::ZERO)?));
                    }
                }
                if are_others {
                    rows.push(expression);
                }
            }
        }
        Ok(rows)
    }

    /// Returns the parameters of an expression at values that lower it, and the others at their nominal values.
    fn corner(&self, expression: &Linear) -> Intervals {
        Intervals::around_nominal(self.certificate, self.is_bound, |parameter| {
            let factor = expression.parameters.get(&parameter)?;
            Some(!factor.is_positive())
        })
    }

    /// Returns `true` if a moment just before or just after a point is always at the place. This is checked for
    /// schedules with the parameters of `expression` at values that lower it, and the others nominal.
    fn is_possible(&self, place: &Place, point: usize, expression: &Linear) -> Result<bool, Flaw> {
        let mut distances = Distances::new(self.certificate, &self.corner(expression))?;
        for is_after in [false, true] {
            let mut is_there = true;
            for &earlier in place.before.iter().chain([&place.start]) {
                is_there = is_there
                    && if is_after {
                        distances.is_before(earlier, point, &Rational::ZERO)?
                    } else {
                        let least = distances.least(earlier, point)?;
                        least.is_some_and(|least| least.is_positive())
                    };
            }
            for &later in place.after.iter().chain([&place.end]) {
                is_there = is_there
                    && if is_after {
                        let least = distances.least(point, later)?;
                        least.is_some_and(|least| least.is_positive())
                    } else {
                        distances.is_before(point, later, &Rational::ZERO)?
                    };
            }
            if is_there {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Returns an expression with one time in the place of a point's.
fn substitute_time(expression: &Linear, point: usize, time: &Linear) -> Linear {
    let mut moved = expression.clone();
    if let Some(factor) = moved.times.remove(&point) {
        moved.add_scaled(time, &factor);
    }
    moved
}

/// Returns `true` if one of these sums is not negative in each box where all expressions in `rows`
/// are nowhere negative.
pub(super) fn is_implied(rows: &[Linear], sums: &[Sum]) -> bool {
    sums.iter().any(|sum| {
        minimum_expression(sum).is_some_and(|own| {
            rows.iter().any(|row| {
                let factor = own.ratio(row);
                factor.is_some_and(|factor| {
                    !factor.is_negative() && &row.constant * &factor <= own.constant
                })
            })
        })
    })
}

/// Returns the expression whose least value in a box is the sum, or `None` if there is no such expression.
fn minimum_expression(sum: &Sum) -> Option<Linear> {
    let mut lowest = Linear::number(sum.constant.clone());
    for term in &sum.terms {
        let is_lowest = match term.end {
            End::Lower => term.factor.is_positive(),
            End::Upper => term.factor.is_negative(),
        };
        if !is_lowest || lowest.parameters.contains_key(&term.parameter) {
            return None;
        }
        lowest.add_parameter(term.parameter, &term.factor);
    }
    Some(lowest)
}
