//! The box with the greatest sum or product of widths: branch and bound over the cuts with
//! alternatives, the most promising case first. Each case is a linear program, or nearly so.

use std::ops::ControlFlow;

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParametrizedPlan};

use super::concave_maximum::CaseContext;
use super::master::{Master, Span};
use super::objective::{ObjectiveFunction, Outcome};
use super::{BestProof, BestRun, BestStep, OptimalityProof, ProofCase, TangentPoint, Variables};
use crate::cut::{Cut, Ground};
use crate::cut_generation::CheckOutcome;
use crate::line_search::{LineSearch, end_index};
use crate::linear::Terms;
use crate::obligations::Refusal;
use crate::oracle::Oracle;
use crate::row::Row;

/// Number of halvings of each end when a rejected box is shrunk because no linear cut is known.
const HALVINGS: usize = 16;
/// Limit on boxes that are shrunk before the search stops with its current result.
const MAX_SHRUNK: usize = 24;

/// Case that has not been split.
struct Leaf {
    /// Position in the tree.
    case: usize,
    /// The rows that hold in it.
    chosen: Vec<(usize, usize)>,
    /// Ranges of the variables in it; empty if they may have all values.
    spans: Vec<Span>,
    /// An upper bound on the objective.
    bound: Rational,
    /// `true` if the bound was computed from all known cuts.
    is_fresh: bool,
    values: Vec<Rational>,
    /// For a probability, the points of contact of its bound.
    touches: Vec<TangentPoint>,
}

struct Search<'a> {
    oracle: &'a mut Oracle,
    plan: &'a ParametrizedPlan,
    variables: &'a Variables,
    goal: ObjectiveFunction,
    master: Master,
    cuts: Vec<Cut>,
    tree: Vec<ProofCase>,
    leaves: Vec<Leaf>,
    best: (Rational, Vec<Rational>),
    shrunk: usize,
    on_step: &'a mut dyn FnMut(&BestStep<'_>) -> ControlFlow<()>,
    is_cancelled: bool,
}

/// Searches for the best box by a goal.
pub(super) fn branch(
    oracle: &mut Oracle,
    plan: &ParametrizedPlan,
    variables: &Variables,
    goal: ObjectiveFunction,
    start: Option<&DecoupledEnvelope>,
    on_step: &mut dyn FnMut(&BestStep<'_>) -> ControlFlow<()>,
) -> Result<BestRun, Refusal> {
    let nothing = vec![Rational::ZERO; variables.count()];
    let tolerance = goal.tolerance();
    let mut search = Search {
        master: Master::new(variables),
        oracle,
        plan,
        variables,
        best: (goal.lower_bound(&nothing), nothing),
        goal,
        cuts: Vec::new(),
        tree: Vec::new(),
        leaves: Vec::new(),
        shrunk: 0,
        on_step,
        is_cancelled: false,
    };
    if let Some(start) = start {
        search.record_if_better(search.values_in(start));
    }
    let spans = search.goal.spans(variables);
    search.add_case((Vec::new(), spans), search.goal.upper_bound(variables));
    let mut steps = 0_u64;
    // Greatest bound of the cases that were closed undecided.
    let mut left: Option<Rational> = None;
    while let (false, Some(at)) = (search.is_cancelled, search.most_promising()) {
        if search.leaves[at].bound <= &search.best.0 + &tolerance {
            break;
        }
        if !search.leaves[at].is_fresh {
            search.solve_case(at);
            continue;
        }
        if search.split(at) {
            continue;
        }
        if search.report_step().is_break() {
            break;
        }
        steps += 1;
        let values = search.leaves[at].values.clone();
        let candidate = variables.envelope(plan, &values);
        match search.oracle.check_with_cuts(&candidate, 1)? {
            CheckOutcome::Accepted => {
                search.record_if_better(values);
                if search.leaves[at].bound > &search.best.0 + &tolerance && !search.bisect(at) {
                    // The bound of this case cannot be approached any closer.
                    let leaf = search.leaves.remove(at);
                    left = left.max(Some(leaf.bound));
                }
                continue;
            }
            CheckOutcome::Cuts(cuts) if !search.is_implied(&cuts[0], &values) => {
                for cut in cuts {
                    search.add_cut(cut);
                }
            }
            _ => {
                if let Some(cut) = search.shrink(&candidate)? {
                    search.add_cut(cut);
                } else {
                    let leaf = search.leaves.remove(at);
                    left = left.max(Some(leaf.bound));
                }
            }
        }
        if steps.is_power_of_two() {
            search.improve(&values)?;
        }
    }
    let open = search.leaves.iter().map(|leaf| leaf.bound.clone());
    let bound = open.chain(left).max();
    let bound = bound.map_or(search.best.0.clone(), |bound| {
        bound.max(search.best.0.clone())
    });
    Ok(BestRun {
        envelope: Ok(variables.envelope(plan, &search.best.1)),
        is_proved: bound <= &search.best.0 + &tolerance,
        value: search.best.0,
        bound,
        checks: 0,
        is_cancelled: search.is_cancelled,
        proof: BestProof {
            cuts: search.cuts,
            reasons: OptimalityProof::Tree(search.tree),
            variables: Vec::new(),
        },
    })
}

impl Search<'_> {
    /// Reports the best box so far, and returns the caller's answer.
    fn report_step(&mut self) -> ControlFlow<()> {
        let step = BestStep {
            envelope: &self.variables.envelope(self.plan, &self.best.1),
            checks: self.oracle.checks(),
        };
        let flow = (self.on_step)(&step);
        self.is_cancelled |= flow.is_break();
        flow
    }

    /// Replaces the best box by the one with these values, which is inside the envelope, if it is
    /// better.
    fn record_if_better(&mut self, values: Vec<Rational>) {
        let worth = self.goal.lower_bound(&values);
        if worth > self.best.0 {
            self.best = (worth, values);
        }
    }

    /// Returns values of the variables whose box lies inside another one.
    fn values_in(&self, envelope: &DecoupledEnvelope) -> Vec<Rational> {
        let point = DecoupledEnvelope::point(&self.plan.nominal());
        let variables = self
            .variables
            .ends
            .iter()
            .zip(&self.variables.max_distances);
        let values = variables.map(|(ends, most)| {
            let moved = ends.iter().map(|end| {
                let far = end.reach(envelope);
                let near = end.reach(&point).unwrap_or_default();
                far.map_or(most.clone(), |far| (far - near).min(most.clone()))
            });
            moved.min().unwrap_or_default()
        });
        values.collect()
    }

    /// Adds a case, with the bound of its parent until it is solved.
    fn add_case(
        &mut self,
        (chosen, spans): (Vec<(usize, usize)>, Vec<Span>),
        bound: Rational,
    ) -> usize {
        let case = self.tree.len();
        self.tree.push(ProofCase::Bounded {
            multipliers: Vec::new(),
            slopes: Vec::new(),
            touches: Vec::new(),
            is_impossible: false,
        });
        self.leaves.push(Leaf {
            case,
            chosen,
            spans,
            bound,
            is_fresh: false,
            values: Vec::new(),
            touches: Vec::new(),
        });
        let last = self.leaves.len() - 1;
        self.solve_case(last);
        case
    }

    fn most_promising(&self) -> Option<usize> {
        let leaves = self.leaves.iter().enumerate();
        // Ties go to the first case, so that the result does not depend on the order of the list.
        let best = leaves.max_by(|(_, one), (_, other)| {
            one.bound
                .cmp(&other.bound)
                .then_with(|| other.case.cmp(&one.case))
        });
        best.map(|(index, _)| index)
    }

    /// Solves a case with all known cuts.
    fn solve_case(&mut self, at: usize) {
        let leaf = &mut self.leaves[at];
        let known = &self.best.1;
        let (master, variables) = (&mut self.master, self.variables);
        let envelope = variables.envelope(self.plan, known);
        let step = BestStep {
            envelope: &envelope,
            checks: self.oracle.checks(),
        };
        let mut flow = || (self.on_step)(&step);
        let case = CaseContext {
            chosen: &leaf.chosen,
            spans: &leaf.spans,
            known,
        };
        match self.goal.solve(master, variables, case, &mut flow) {
            Outcome::Unknown => self.is_cancelled = true,
            Outcome::Best {
                values,
                bound,
                proof,
                slopes,
                touches,
            } => {
                leaf.bound = bound;
                leaf.values = values;
                leaf.touches.clone_from(&touches);
                leaf.is_fresh = true;
                self.tree[leaf.case] = ProofCase::Bounded {
                    multipliers: proof,
                    slopes,
                    touches,
                    is_impossible: false,
                };
            }
            Outcome::Impossible(proof) => {
                self.tree[leaf.case] = ProofCase::Bounded {
                    multipliers: proof,
                    slopes: Vec::new(),
                    touches: Vec::new(),
                    is_impossible: true,
                };
                self.leaves.remove(at);
            }
        }
    }

    /// Splits a case by a cut without a row that holds in its best box. Returns `false` if there is
    /// none.
    fn split(&mut self, at: usize) -> bool {
        let leaf = &self.leaves[at];
        let candidate = self.variables.envelope(self.plan, &leaf.values);
        let is_broken = |cut: &Cut| {
            cut.rows.len() > 1
                && cut
                    .rows
                    .iter()
                    .all(|row| row.value(&candidate).is_none_or(|value| value > row.bound))
        };
        let Some(cut) = self.cuts.iter().position(is_broken) else {
            return false;
        };
        let leaf = self.leaves.remove(at);
        let mut cases = Vec::new();
        for row in 0..self.cuts[cut].rows.len() {
            let mut chosen = leaf.chosen.clone();
            chosen.push((cut, row));
            cases.push(self.add_case((chosen, leaf.spans.clone()), leaf.bound.clone()));
        }
        self.tree[leaf.case] = ProofCase::AnyRow { cut, cases };
        true
    }

    /// Splits a case into two parts with tighter bounds on the objective. Returns `false` if that
    /// is not possible.
    fn bisect(&mut self, at: usize) -> bool {
        let leaf = &self.leaves[at];
        let Some((variable, place)) = self.goal.split_point(&leaf.spans, &leaf.touches) else {
            return false;
        };
        let leaf = self.leaves.remove(at);
        let (mut nearer, mut farther) = (leaf.spans.clone(), leaf.spans);
        let own = &mut nearer[variable];
        own.most = own.most.clone().min(place.clone());
        own.objective_max.clone_from(&place);
        nearer[variable].is_open = true;
        farther[variable].least.clone_from(&place);
        let cases = [nearer, farther]
            .map(|spans| self.add_case((leaf.chosen.clone(), spans), leaf.bound.clone()));
        self.tree[leaf.case] = ProofCase::Split {
            variable,
            at: place,
            cases,
        };
        true
    }

    fn add_cut(&mut self, cut: Cut) {
        let index = self.cuts.len();
        self.master.add(self.plan, self.variables, &cut, index);
        self.cuts.push(cut);
        for leaf in &mut self.leaves {
            leaf.is_fresh = false;
        }
    }

    /// Returns `true` if the master already contains the cut: the cut holds, except for being
    /// strict.
    fn is_implied(&self, cut: &Cut, values: &[Rational]) -> bool {
        let candidate = self.variables.envelope(self.plan, values);
        let holds = |row: &Row| {
            row.value(&candidate)
                .is_some_and(|value| value <= row.bound)
        };
        cut.rows.iter().any(holds)
    }

    /// Searches for a better box between the nominal values and one that was rejected.
    fn improve(&mut self, values: &[Rational]) -> Result<(), Refusal> {
        let mut ray = LineSearch::new(self.plan);
        for (ends, value) in self.variables.ends.iter().zip(values) {
            for end in ends {
                ray.step[end_index(*end)] = value.clone();
            }
        }
        let mut cuts = self.cuts.clone();
        let known = cuts.len();
        let (zero, one) = (Rational::ZERO, Rational::ONE);
        let reached = ray.search(self.oracle, &zero, &one, &mut cuts, &mut |_, _| {
            ControlFlow::Continue(())
        })?;
        self.record_if_better(
            values
                .iter()
                .map(|value| value * &reached.lower_bound)
                .collect(),
        );
        for cut in cuts.into_iter().skip(known) {
            self.add_cut(cut);
        }
        Ok(())
    }

    /// Shrinks a rejected box as far as possible, and returns the cut that one of its ends has to
    /// be nearer. Used if no linear cut is known. `None` after too many of them.
    fn shrink(&mut self, refused: &DecoupledEnvelope) -> Result<Option<Cut>, Refusal> {
        self.shrunk += 1;
        if self.shrunk > MAX_SHRUNK {
            return Ok(None);
        }
        let point = DecoupledEnvelope::point(&self.plan.nominal());
        let half = Rational::new(1, 2);
        let mut smallest = refused.clone();
        let mut ends = Vec::new();
        for end in BoxEnd::all(self.plan.parameters.len()) {
            let near = end.reach(&point).unwrap_or_default();
            if end.reach(&smallest).as_ref() == Some(&near) {
                continue;
            }
            let without = end.with_reach(&smallest, Some(near.clone()));
            if self.oracle.objection(&without)?.is_some() {
                smallest = without;
                continue;
            }
            let (mut inside, mut outside) = (near, end.reach(&smallest).unwrap_or_default());
            for _ in 0..HALVINGS {
                let middle = (&inside + &outside) * &half;
                let nearer = end.with_reach(&smallest, Some(middle.clone()));
                if self.oracle.objection(&nearer)?.is_some() {
                    outside = middle;
                } else {
                    inside = middle;
                }
            }
            smallest = end.with_reach(&smallest, Some(outside.clone()));
            ends.push((end, outside));
        }
        let rows = ends.into_iter().map(|(end, bound)| Row {
            factors: Terms::one(end, Rational::ONE),
            bound,
            is_strict: true,
        });
        let cut = Cut {
            rows: rows.collect(),
            ground: Ground::Box(smallest),
        };
        let makes_progress = cut
            .rows
            .iter()
            .all(|row| row.value(refused).is_some_and(|value| value > row.bound));
        Ok(makes_progress.then_some(cut))
    }
}
