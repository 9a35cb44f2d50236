//! The box that independent durations most likely stay in.
//!
//! The logarithm of the probability is a sum over the parameters. Each term is a jointly concave
//! function of the ends of an interval if the logarithm of the density is concave (Prékopa 1973),
//! so it lies below its tangents, like the logarithm of a volume. Values with a positive
//! probability (at cuts, and measured values) are either inside or outside. A case counts such a
//! probability proportionally to the distance, and is split if that is too imprecise. The numbers
//! are those of [`elbowroom_num::log_concave`].

use std::ops::ControlFlow;

use elbowroom_num::log_concave::{
    Cell, CutPosition, Dense, LogConcaveDistribution, Reach, Steps, TangentPoint,
};
use elbowroom_num::{Rational, Side, enclosures};
use elbowroom_plan::ParametrizedPlan;

use super::concave_maximum::{CaseContext, approximate_optimum, power_of_ten, shorten_digits};
use super::log_probability::LogProbability;
use super::master::{Master, Solved, Span};
use super::objective::Outcome;
use super::{BestSettings, BoundSource, LOG_OF_ZERO, Variables};

/// One parameter.
struct Term {
    nominal: Rational,
    scale: Rational,
    /// The variables that move its lower and its upper end.
    ends: [usize; 2],
    chance: Option<LogConcaveDistribution>,
}

/// Bound that follows from tangents at one point.
struct TangentBound {
    bound: Rational,
    /// Point with the greatest sum of the tangents.
    corner: Vec<Rational>,
    proof: Vec<(BoundSource, Rational)>,
    slopes: Vec<Rational>,
    touches: Vec<TangentPoint>,
}

/// `Σ ln P(the duration is inside its interval)`.
pub(super) struct Probability {
    terms: Vec<Term>,
    /// Weights of the variables when those ends are moved out that do not change the probability.
    tie_weights: Vec<Rational>,
    /// For each variable, the value above which the probability no longer changes. The range of its
    /// parameter is ignored.
    max_counted: Vec<Rational>,
}

impl Probability {
    pub(super) fn new(
        plan: &ParametrizedPlan,
        variables: &Variables,
        settings: &BestSettings,
    ) -> Self {
        let chances = &settings.distributions;
        let mut terms: Vec<Term> = plan
            .parameters
            .iter()
            .enumerate()
            .map(|(index, parameter)| Term {
                nominal: parameter.nominal.clone(),
                scale: Rational::ONE,
                ends: [0; 2],
                chance: chances.get(index).cloned().flatten(),
            })
            .collect();
        for (index, (ends, scale)) in variables.ends.iter().zip(&variables.scales).enumerate() {
            for end in ends {
                let term = &mut terms[end.parameter.index()];
                term.ends[end.side.index()] = index;
                term.scale = scale.clone();
            }
        }
        let even = variables.scales.iter().map(Rational::reciprocal);
        let counted = variables
            .scales
            .iter()
            .map(|scale| scale * &settings.max_deviation);
        Self {
            terms,
            max_counted: counted.collect(),
            tie_weights: even.map(Option::unwrap_or_default).collect(),
        }
    }

    /// Returns the ranges of the variables in which there is any probability, and in which it
    /// increases.
    pub(super) fn spans(&self, variables: &Variables) -> Vec<Span> {
        let mut limits: Vec<(Rational, Option<Option<Rational>>)> =
            vec![(Rational::ZERO, None); variables.count()];
        for term in &self.terms {
            let own = match &term.chance {
                Some(chance) => chance.limits(&term.nominal),
                None => [const { (Rational::ZERO, Some(Rational::ZERO)) }; 2],
            };
            for (variable, (least, most)) in term.ends.into_iter().zip(own) {
                let limit = &mut limits[variable];
                limit.0 = limit.0.clone().max(least);
                // If one variable moves both ends, it gains as long as one of them does.
                limit.1 = Some(match limit.1.take() {
                    None => most,
                    Some(other) => other.zip(most).map(|(one, other)| one.max(other)),
                });
            }
        }
        let spans = limits
            .into_iter()
            .zip(&variables.max_distances)
            .zip(&self.max_counted);
        spans
            .map(|(((least, most), limit), counted)| {
                let gains = most.flatten().unwrap_or_else(|| counted.clone());
                Span {
                    most: gains.clone().min(limit.clone()),
                    objective_max: gains.min(counted.clone()),
                    least,
                    is_open: false,
                }
            })
            .collect()
    }

    fn reach(term: &Term, values: &[Rational]) -> Reach {
        term.ends.map(|variable| values[variable].clone())
    }

    /// Returns the value of a box, rounded down to a billionth.
    pub(super) fn value(&self, values: &[Rational]) -> Rational {
        let mut sum = Rational::ZERO;
        for term in &self.terms {
            let Some(chance) = &term.chance else { continue };
            let [mass, _] = chance.probability_bounds(&term.nominal, &Self::reach(term, values));
            match enclosures::ln(&mass) {
                Some([below, _]) => sum += below,
                None => return Rational::from(LOG_OF_ZERO),
            }
        }
        enclosures::floor_to_billionth(&sum).max(Rational::from(LOG_OF_ZERO))
    }

    pub(super) fn solve(
        &self,
        master: &mut Master,
        variables: &Variables,
        case: CaseContext<'_>,
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Outcome {
        let mut is_over = false;
        let mut may_continue = || {
            let flow = flow();
            is_over |= flow.is_break();
            flow
        };
        let softs = self.terms.iter().filter_map(|term| {
            let chance = term.chance.as_ref()?;
            let cell = cell(term, case.spans);
            Some(LogProbability::new(
                chance,
                (&term.nominal, &term.scale),
                &cell,
                term.ends,
            ))
        });
        let function: Vec<LogProbability> = softs.collect();
        let guess = approximate_optimum(&function, master, variables, case, &mut may_continue);
        if is_over {
            return Outcome::Unknown;
        }
        let near = guess.clone().and_then(|guess| {
            let (_, slopes) = self.tangents(case.spans, &guess);
            let worths = self.coefficients(variables, &slopes);
            let values = master.best_within(case, (Side::Upper, &guess), &worths)?;
            let tidy = shorten_digits(values, master, variables, case, &|own| self.value(own));
            Some(
                master
                    .best_within(case, (Side::Lower, &tidy), &worths)
                    .unwrap_or(tidy),
            )
        });
        let at = near.clone().unwrap_or_else(|| {
            let known = case.known.iter().zip(case.spans);
            known
                .map(|(value, span)| value.clone().max(span.least.clone()).min(span.most.clone()))
                .collect()
        });
        // Rounding makes boxes simpler, but unrounded values give better slopes.
        let mut best: Option<TangentBound> = None;
        for at in guess.iter().chain([&at]) {
            let (touches, slopes) = self.tangents(case.spans, at);
            match master.solve(
                case.chosen,
                case.spans,
                &self.coefficients(variables, &slopes),
            ) {
                Solved::Impossible(proof) => return Outcome::Impossible(proof),
                Solved::Best {
                    values: corner,
                    worth,
                    proof,
                } => {
                    let heights = self.gap_bounds(case.spans, (&slopes, &touches));
                    let bound = heights.into_iter().sum::<Rational>() + worth;
                    let bound = enclosures::ceil_to_billionth(&bound);
                    if best.as_ref().is_none_or(|known| bound < known.bound) {
                        best = Some(TangentBound {
                            bound,
                            corner,
                            proof,
                            slopes,
                            touches,
                        });
                    }
                }
            }
        }
        let Some(best) = best else {
            return Outcome::Unknown;
        };
        let values = near.unwrap_or(best.corner);
        // Ends that do not change the probability also move out, beyond this case if possible.
        let free = CaseContext { spans: &[], ..case };
        let filled = master.best_within(free, (Side::Lower, &values), &self.tie_weights);
        Outcome::Best {
            values: filled.unwrap_or(values),
            bound: best.bound,
            proof: best.proof,
            slopes: best.slopes,
            touches: best.touches,
        }
    }

    /// Returns tangents at these values (approximately): the points where they touch, and their
    /// slopes, two for each parameter.
    fn tangents(&self, spans: &[Span], values: &[Rational]) -> (Vec<TangentPoint>, Vec<Rational>) {
        let mut touches = Vec::new();
        let mut slopes = Vec::new();
        for term in &self.terms {
            let own = term.chance.as_ref().and_then(|chance| {
                let cell = cell(term, spans);
                let mut at = Self::reach(term, values);
                match chance {
                    LogConcaveDistribution::Dense(dense) => {
                        let seen = dense.cut_positions(&term.nominal, &cell)?;
                        let (_, rises) = dense.tangent(&term.nominal, &seen, &at)?;
                        // If nothing increases any more, the point of contact does not matter.
                        let nothing = Rational::new(1, 1_000_000_000_000_000);
                        let far = [&cell.below[1], &cell.above[1]];
                        for ((at, [_, high]), far) in at.iter_mut().zip(&rises).zip(far) {
                            if *high < nothing {
                                at.clone_from(far);
                            }
                        }
                        let (_, rises) = dense.tangent(&term.nominal, &seen, &at)?;
                        let half = Rational::new(1, 2);
                        let mut slopes = rises.map(|[low, high]| (low + high) * &half);
                        for (slope, seen) in slopes.iter_mut().zip(&seen) {
                            if let CutPosition::Open { place, gain } = seen {
                                *slope += gain.checked_div(place)?;
                            }
                        }
                        Some((
                            TangentPoint::At(at),
                            slopes.map(|slope| round_slope(&slope)),
                        ))
                    }
                    LogConcaveDistribution::Values(_) => {
                        let soft = LogProbability::new(
                            chance,
                            (&term.nominal, &term.scale),
                            &cell,
                            term.ends,
                        );
                        let (mass, slopes) = soft.hull_at(&at)?;
                        Some((
                            TangentPoint::Mass(mass),
                            slopes.map(|slope| round_slope(&slope)),
                        ))
                    }
                }
            });
            let (touch, own) =
                own.unwrap_or((TangentPoint::NoContact, [Rational::ZERO, Rational::ZERO]));
            touches.push(touch);
            slopes.extend(own);
        }
        (touches, slopes)
    }

    /// Returns the coefficient of each variable in the tangents.
    fn coefficients(&self, variables: &Variables, slopes: &[Rational]) -> Vec<Rational> {
        let mut worths = vec![Rational::ZERO; variables.count()];
        for (term, slopes) in self.terms.iter().zip(slopes.chunks(2)) {
            for (variable, slope) in term.ends.into_iter().zip(slopes) {
                worths[variable] += slope;
            }
        }
        worths
    }

    /// Returns, for each parameter, an upper bound on the difference of the logarithm of its
    /// interval's probability and the linear function with these slopes.
    fn gap_bounds(
        &self,
        spans: &[Span],
        (slopes, touches): (&[Rational], &[TangentPoint]),
    ) -> Vec<Rational> {
        let terms = self.terms.iter().zip(slopes.chunks(2)).zip(touches);
        terms
            .map(|((term, slopes), touch)| {
                let Some(chance) = &term.chance else {
                    return Rational::ZERO;
                };
                let cell = cell(term, spans);
                let slopes = [slopes[0].clone(), slopes[1].clone()];
                let height = chance.gap(&term.nominal, &cell, touch, &slopes);
                height.unwrap_or_else(|| {
                    let nowhere =
                        chance.gap(&term.nominal, &cell, &TangentPoint::NoContact, &slopes);
                    nowhere.unwrap_or_default()
                })
            })
            .collect()
    }

    /// Returns the variable and the value to split a case at: the jump with the largest gap between
    /// its partial count and its probability.
    pub(super) fn split_point(
        &self,
        spans: &[Span],
        touches: &[TangentPoint],
    ) -> Option<(usize, Rational)> {
        let mut widest: Option<(f64, usize, Rational)> = None;
        for (term, touch) in self.terms.iter().zip(touches) {
            let Some(chance) = &term.chance else { continue };
            let own = cell(term, spans);
            let place = match chance {
                LogConcaveDistribution::Dense(dense) => {
                    largest_partial_cut(term, dense, &own, touch)
                }
                LogConcaveDistribution::Values(values) => median_jump(term, chance, values, &own),
            };
            if let Some((gap, side, place)) = place
                && widest.as_ref().is_none_or(|(known, _, _)| gap > *known)
            {
                widest = Some((gap, term.ends[side], place));
            }
        }
        widest.map(|(_, variable, place)| (variable, place))
    }
}

/// Returns the partially counted cut that adds most at the point of contact: the amount, the side,
/// and the distance.
fn largest_partial_cut(
    term: &Term,
    dense: &Dense,
    cell: &Cell,
    touch: &TangentPoint,
) -> Option<(f64, usize, Rational)> {
    /// Amount that does not prevent the proof that a box is the best.
    const NEGLIGIBLE_GAIN: f64 = 1e-9;
    let seen = dense.cut_positions(&term.nominal, cell)?;
    let cuts = seen.into_iter().enumerate().filter_map(|(side, seen)| {
        let CutPosition::Open { place, gain } = seen else {
            return None;
        };
        let share = match touch {
            TangentPoint::At(at) => at[side].to_f64() / place.to_f64(),
            TangentPoint::Mass(_) | TangentPoint::NoContact => 1.0,
        };
        let gap = gain.to_f64() * share;
        let near = [&cell.below[0], &cell.above[0]][side];
        (gap > NEGLIGIBLE_GAIN && place > *near).then_some((gap, side, place))
    });
    cuts.max_by(|one, other| one.0.total_cmp(&other.0))
}

/// Returns the middle one of the values that only some intervals of a case contain, on the side
/// with more of them: the range of the logarithm of the probability in the case, the side, and the
/// distance.
fn median_jump(
    term: &Term,
    chance: &LogConcaveDistribution,
    values: &[Rational],
    cell: &Cell,
) -> Option<(f64, usize, Rational)> {
    let steps = Steps::new(values, &term.nominal, cell);
    let [below, above] = &steps.sides;
    let (side, longer) = if below.len() > above.len() {
        (0, below)
    } else {
        (1, above)
    };
    let (place, _) = longer.get(longer.len() / 2)?;
    let far = [cell.below[1].clone(), cell.above[1].clone()];
    let [_, most] = chance.probability_bounds(&term.nominal, &far);
    // Lower bound for cases with intervals that contain no value.
    let least = steps.center.to_f64().max(1e-12);
    Some(((most.to_f64() / least).ln(), side, place.clone()))
}

/// Returns the cell of a parameter's intervals in a case.
fn cell(term: &Term, spans: &[Span]) -> Cell {
    let [below, above] = term.ends.map(|variable| &spans[variable]);
    Cell {
        below: [below.least.clone(), below.objective_max.clone()],
        above: [above.least.clone(), above.objective_max.clone()],
        is_open: [below.is_open, above.is_open],
    }
}

/// Rounds a slope to some fourteen digits.
fn round_slope(slope: &Rational) -> Rational {
    let grid = power_of_ten(&(slope * &Rational::new(1, 10_000_000_000_000)));
    if slope.is_positive() {
        (slope / &grid).ceil() * grid
    } else {
        Rational::ZERO
    }
}
