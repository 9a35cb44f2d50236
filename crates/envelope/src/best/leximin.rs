//! The fairest box: all variables grow together, relative to their nominal values, until some are
//! stopped; the others continue.
//!
//! If a box is inside an envelope, so are all its sub-boxes. All growing variables have the same
//! slack, and the stopped ones keep theirs. So a variable that cannot grow alone can only gain
//! slack if a variable with no more slack loses some: it is stopped for good. The resulting box has
//! the greatest least slack, then the greatest second least slack, and so on.

use std::ops::ControlFlow;

use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan};

use super::{BestProof, BestRun, BestStep, BlockedVariable, OptimalityProof, Variables};
use crate::cut::Cut;
use crate::line_search::{LineSearch, SearchBounds, end_index};
use crate::obligations::Refusal;
use crate::oracle::Oracle;

/// The state of the search.
struct LeximinSearch<'a> {
    oracle: &'a mut Oracle,
    plan: &'a ParametrizedPlan,
    variables: &'a Variables,
    on_step: &'a mut dyn FnMut(&BestStep<'_>) -> ControlFlow<()>,
    cuts: Vec<Cut>,
    /// Slack of each stopped variable, with the cut that stopped it.
    stopped: Vec<Option<(Rational, Option<usize>)>>,
    order: Vec<usize>,
    is_cancelled: bool,
    is_proved: bool,
}

/// Searches for the fairest box.
pub(super) fn maximize_leximin(
    oracle: &mut Oracle,
    plan: &ParametrizedPlan,
    variables: &Variables,
    on_step: &mut dyn FnMut(&BestStep<'_>) -> ControlFlow<()>,
) -> Result<BestRun, Refusal> {
    let mut fill = LeximinSearch {
        oracle,
        plan,
        variables,
        on_step,
        cuts: Vec::new(),
        stopped: vec![None; variables.count()],
        order: Vec::new(),
        is_cancelled: false,
        is_proved: true,
    };
    let mut level = Rational::ZERO;
    let mut bound: Option<Rational> = None;
    while fill.stopped.iter().any(Option::is_none) {
        let reached = fill.max_slack(None, &level)?;
        bound.get_or_insert_with(|| reached.upper_bound.clone());
        fill.is_proved &= reached.lower_bound == reached.upper_bound;
        level = reached.lower_bound.clone();
        if fill.is_cancelled {
            break;
        }
        if !fill.stop_blocked(&level, &reached)? {
            fill.is_proved = false;
            // Some can grow alone, but not all of them together: the first one is stopped.
            let first = fill.stopped.iter().position(Option::is_none);
            fill.stop_variable(first.expect("some still grow"), &level, None);
        }
    }
    let slack = |stopped: &Option<(Rational, Option<usize>)>| {
        stopped.as_ref().map_or(&level, |(slack, _)| slack).clone()
    };
    let slacks: Vec<Rational> = fill.stopped.iter().map(slack).collect();
    let values: Vec<Rational> = slacks
        .iter()
        .zip(&variables.scales)
        .map(|(s, w)| s * w)
        .collect();
    let value = slacks.iter().min().cloned().unwrap_or_default();
    // The least slack is no more than the greatest possible slack of any variable.
    let far = variables.max_distances.iter().zip(&variables.scales);
    let far = far
        .filter_map(|(most, scale)| most.checked_div(scale))
        .min();
    let bound = bound.unwrap_or_default();
    let bound = far.map_or(bound.clone(), |far| far.min(bound));
    let levels = fill.order.iter().map(|&variable| BlockedVariable {
        ends: variables.ends[variable].clone(),
        slack: slacks[variable].clone(),
        cut: fill.stopped[variable].as_ref().and_then(|(_, cut)| *cut),
    });
    Ok(BestRun {
        envelope: Ok(variables.envelope(plan, &values)),
        bound: bound.max(value.clone()),
        value,
        is_proved: fill.is_proved && !fill.is_cancelled,
        checks: 0,
        is_cancelled: fill.is_cancelled,
        proof: BestProof {
            reasons: OptimalityProof::Levels(levels.collect()),
            cuts: fill.cuts,
            variables: Vec::new(),
        },
    })
}

impl LeximinSearch<'_> {
    /// Computes the greatest slack of all growing variables, or of one of them while the others
    /// stay.
    fn max_slack(
        &mut self,
        alone: Option<usize>,
        level: &Rational,
    ) -> Result<SearchBounds, Refusal> {
        let mut ray = LineSearch::new(self.plan);
        let mut most = level.clone();
        for (variable, ends) in self.variables.ends.iter().enumerate() {
            let scale = &self.variables.scales[variable];
            let reach = &self.variables.max_distances[variable];
            let grows = self.stopped[variable].is_none();
            let moves = grows && alone.is_none_or(|alone| alone == variable);
            let stays = match &self.stopped[variable] {
                Some((slack, _)) => slack * scale,
                None if moves => Rational::ZERO,
                None => (level * scale).min(reach.clone()),
            };
            for end in ends {
                let place = end_index(*end);
                ray.most[place] = Some(&ray.base[place] + reach);
                ray.base[place] += &stays;
                if moves {
                    ray.step[place] = scale.clone();
                }
            }
            if moves {
                most = most.max(reach.checked_div(scale).unwrap_or_default());
            }
        }
        let (plan, on_step, is_cancelled) = (self.plan, &mut *self.on_step, &mut self.is_cancelled);
        ray.search(
            self.oracle,
            level,
            &most,
            &mut self.cuts,
            &mut |oracle, inside| {
                let envelope: DecoupledEnvelope = ray.at(plan, inside);
                let flow = on_step(&BestStep {
                    envelope: &envelope,
                    checks: oracle.checks(),
                });
                *is_cancelled |= flow.is_break();
                flow
            },
        )
    }

    /// Stops the variables that cannot grow beyond the level. Returns `true` if there are any.
    fn stop_blocked(&mut self, level: &Rational, reached: &SearchBounds) -> Result<bool, Refusal> {
        let mut any = false;
        for variable in 0..self.variables.count() {
            let far = self.variables.max_distances[variable]
                .checked_div(&self.variables.scales[variable]);
            let far = far.unwrap_or_default();
            if self.stopped[variable].is_none() && far <= *level {
                self.stop_variable(variable, &far, None);
                any = true;
            }
        }
        // The only row that stops them all stops every variable in it.
        if let Some(index) = reached.cut
            && reached.lower_bound == reached.upper_bound
            && let [row] = &self.cuts[index].rows[..]
        {
            let (factors, _) = self.variables.row(self.plan, row);
            for (variable, factor) in factors {
                if factor.is_positive() && self.stopped[variable].is_none() {
                    self.stop_variable(variable, level, Some(index));
                    any = true;
                }
            }
        }
        if any {
            return Ok(true);
        }
        for variable in 0..self.variables.count() {
            if self.stopped[variable].is_some() || self.is_cancelled {
                continue;
            }
            let alone = self.max_slack(Some(variable), level)?;
            if alone.lower_bound <= *level {
                self.is_proved &= alone.lower_bound == alone.upper_bound;
                self.stop_variable(variable, level, alone.cut);
                any = true;
            }
        }
        Ok(any)
    }

    fn stop_variable(&mut self, variable: usize, slack: &Rational, cut: Option<usize>) {
        self.stopped[variable] = Some((slack.clone(), cut));
        self.order.push(variable);
    }
}
