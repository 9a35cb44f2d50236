//! Selection of the next end to move, and of the step size.

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, Parameter, ParameterId, ParametrizedPlan, Side};
use serde::{Deserialize, Serialize};

/// Change of the step size after a successful widening.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Growth {
    /// Steps double until both directions of the parameter have been rejected for the first time,
    /// as in the authors' code.
    #[default]
    Doubling,
    /// Steps stay constant, as in the paper.
    Constant,
}

/// Open directions and step sizes (Θ and Δ of Algorithm 1).
///
/// One function both decides whether to continue and picks the end, so lines 6 and 7 of the
/// algorithm, which test different bounds, cannot disagree.
#[derive(Clone, Debug)]
pub(crate) struct Frontier {
    growth: Growth,
    parameters: Vec<Progress>,
    /// Number of parameters with a step worth taking; the search continues while there are any.
    active_count: usize,
    /// Position of the round robin.
    next: usize,
}

/// One parameter's part of the frontier.
#[derive(Clone, Debug)]
struct Progress {
    step: Rational,
    /// The parameter's precision.
    precision: Rational,
    /// Open directions with the present step: lower, upper.
    is_open: [bool; 2],
    /// Directions without further gain: lower, upper.
    is_done: [bool; 2],
    /// `true` if both directions have been rejected at least once.
    has_halved: bool,
}

impl Frontier {
    /// Creates the frontier with all directions open. Steps are as in the authors' code,
    /// `max(nominal, 1) · weight`, or `scale · weight` if there are scales, but at least the
    /// precision.
    pub(crate) fn new(
        plan: &ParametrizedPlan,
        precisions: Vec<Rational>,
        scales: Option<&[Rational]>,
        growth: Growth,
    ) -> Self {
        let scale = |index: usize, parameter: &Parameter| match scales {
            Some(scales) => scales[index].clone(),
            None => parameter.nominal.abs().max(Rational::ONE),
        };
        let parameters: Vec<Progress> = plan
            .parameters
            .iter()
            .zip(precisions)
            .enumerate()
            .map(|(index, (parameter, precision))| Progress {
                step: (&scale(index, parameter) * &parameter.weight).max(precision.clone()),
                precision,
                is_open: [true; 2],
                is_done: [false; 2],
                has_halved: false,
            })
            .collect();
        Self {
            growth,
            active_count: parameters.iter().filter(|own| own.is_active()).count(),
            parameters,
            next: 0,
        }
    }

    /// Returns the next end to move, and the step; `None` when every step is below the precision.
    ///
    /// Round robin over the parameters, the upper end first. While some step is at least the
    /// precision, parameters with at least half the precision also take part, as in the authors'
    /// code.
    pub(crate) fn next_end(&mut self) -> Option<(BoxEnd, Rational)> {
        if self.active_count == 0 {
            return None;
        }
        let count = self.parameters.len();
        for offset in 0..count {
            let index = (self.next + offset) % count;
            let progress = &self.parameters[index];
            if progress.is_done == [true; 2] || &progress.step + &progress.step < progress.precision
            {
                continue;
            }
            for side in [Side::Upper, Side::Lower] {
                let place = side.index();
                if progress.is_open[place] && !progress.is_done[place] {
                    self.next = index + 1;
                    let end = BoxEnd {
                        parameter: ParameterId::from(index),
                        side,
                    };
                    return Some((end, progress.step.clone()));
                }
            }
        }
        None
    }

    /// Records that the end was moved.
    pub(crate) fn accept(&mut self, end: BoxEnd) {
        let growth = self.growth;
        self.change(end, |progress, _| {
            if growth == Growth::Doubling && !progress.has_halved {
                progress.step = &progress.step + &progress.step;
            }
        });
    }

    /// Records that the end could not be moved: the direction closes. When both directions are
    /// closed, the step is halved and they open again.
    pub(crate) fn reject(&mut self, end: BoxEnd) {
        self.change(end, |progress, place| {
            progress.is_open[place] = false;
            progress.reopen_if_closed();
        });
    }

    /// Records that the end cannot move any further: it is infinite, or at the border of its range.
    pub(crate) fn finish(&mut self, end: BoxEnd) {
        self.change(end, |progress, place| {
            progress.is_done[place] = true;
            progress.reopen_if_closed();
        });
    }

    fn change(&mut self, end: BoxEnd, change: impl FnOnce(&mut Progress, usize)) {
        let progress = &mut self.parameters[end.parameter.index()];
        self.active_count -= usize::from(progress.is_active());
        change(progress, end.side.index());
        self.active_count += usize::from(progress.is_active());
    }
}

impl Progress {
    /// Returns `true` if this parameter has a step worth taking.
    fn is_active(&self) -> bool {
        self.is_done != [true; 2] && self.step >= self.precision
    }

    fn reopen_if_closed(&mut self) {
        let is_closed = (0..2).all(|place| !self.is_open[place] || self.is_done[place]);
        if is_closed {
            self.step = &self.step * &Rational::new(1, 2);
            self.is_open = [true; 2];
            self.has_halved = true;
        }
    }
}
