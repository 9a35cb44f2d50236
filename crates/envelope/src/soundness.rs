//! Check that every schedule of a plan is valid, for every value in a box.
//!
//! The second half of paper 1's CHECKINENVELOPE, `enc_tn ∧ enc_eff ∧ enc_R → enc_proofs`, without
//! an SMT solver. Each way of violating an obligation is a system of linear inequalities over the
//! schedules of the box ([`BadCase`]). A path or a flow in the plan's network proves that it has no
//! solution or, if parameters are coupled, a linear program. Such proofs are sums of constraints,
//! and they are stored. When a box is widened, only proofs that use the moved end and no longer
//! hold are searched again.

mod certificate;
mod corner;
mod flow;
mod half_space;
mod lazy_network;
mod linear_program;
mod margins;
mod proof;
mod proof_export;
mod scale;
mod sound_box;
mod violation_case;

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_stn::ConsistentNetwork;

use crate::linear::Linear;
use crate::obligations::{BadCase, Difference, Obligations, OverAll, Refusal, Requirement};
use crate::reduction::Reduction;
use certificate::Certificate;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, NodeId, ParametrizedPlan, Schedule, Valuation};
use lazy_network::{LazyNetwork, numbers};
use proof::Proof;
use scale::Numbers;
use violation_case::Outcome;

pub(crate) use margins::ProofMargins;
pub use sound_box::SoundBox;

/// Decides, box by box, whether every schedule of a plan is valid.
///
/// It does not store the task and the plan, only data derived from them. The caller passes both
/// with each query, and they must be the ones that it was created for.
#[derive(Clone, Debug)]
pub(crate) struct Soundness {
    reduction: Reduction,
    obligations: Obligations,
    /// Schedule that defines the order of happenings.
    schedule: Schedule,
    direct: Vec<DirectCase>,
    over_all: Vec<Option<Proof>>,
    /// `true` if these proofs are about boxes within the ranges of the parameters.
    is_in_ranges: bool,
    /// The numbers in all bounds except the ends of boxes; `None` if they are large.
    numbers: Option<Numbers>,
    /// The case that was violated last, which is likely to be violated next. Initially one past the
    /// end.
    last_violated: usize,
    /// The number of bad cases refuted from scratch.
    refutations: usize,
    /// `true` if new proofs do not replace the stored ones.
    keeps_proofs: bool,
}

/// Bad case of a direct obligation with the proofs that it is impossible.
#[derive(Clone, Debug)]
struct DirectCase {
    obligation: usize,
    case: usize,
    proofs: Option<Vec<Certificate>>,
}

/// Obligation that some schedule of a box violates.
#[derive(Clone, Debug, PartialEq)]
pub struct Broken {
    /// The requirement.
    pub requirement: Requirement,
    /// Violated case.
    pub case: BadCase,
}

/// Values of the parameters and a schedule that violate an obligation.
#[derive(Clone, Debug, PartialEq)]
pub struct Counterexample {
    /// The parameters' values.
    pub valuation: Valuation,
    /// A time for each node.
    pub schedule: Schedule,
    /// For an over-all condition, the moment at which it is false.
    pub moment: Option<Rational>,
}

/// Returns the first obligation that some schedule for some value in the box (not empty) violates;
/// `None` if every schedule is valid.
///
/// It does not check that there is a schedule for every value: see [`Oracle`](crate::Oracle) for
/// the whole check.
///
/// # Errors
/// If the plan has no schedule at the values in the box nearest to its nominal ones, or contains
/// something beyond exact linear reasoning.
pub fn broken_in(
    task: &Task,
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> Result<Option<Broken>, Refusal> {
    let nearest = envelope.nearest(&plan.nominal());
    let soundness = Soundness::for_values(task, plan, &nearest)?;
    let mut soundness = soundness.ok_or(Refusal::NoNominalSchedule)?;
    soundness.broken(task, plan, envelope, None)
}

/// Numbers of conditions of a plan, by the mechanism that enforces them in all its schedules.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conditions {
    /// Bounds on the difference of two times: the network implies them, so an executor that
    /// respects the network also respects them.
    pub differences: usize,
    /// Conditions on numbers, or on several differences at once. They hold in every schedule of the
    /// network, so that an executor need not check them.
    pub all_schedules: usize,
}

impl Soundness {
    /// Returns the numbers of conditions, by the mechanism that enforces them.
    pub(crate) fn conditions(&self) -> Conditions {
        let direct = self.obligations.direct.iter();
        let is_difference =
            |case: &BadCase| case.differences.len() == 1 && case.inequalities.is_empty();
        let differences = direct
            .filter(|obligation| obligation.bad_cases.iter().all(is_difference))
            .count();
        let all = self.obligations.direct.len() + self.obligations.over_all.len();
        Conditions {
            differences,
            all_schedules: all - differences,
        }
    }

    /// Compiles a plan's obligations for boxes that contain these values; `None` if it has no
    /// schedule there.
    ///
    /// Happenings are required to keep the order that they have there. In a box that contains these
    /// values, this is not a restriction. In others, a different order may also work.
    ///
    /// # Errors
    /// If the plan contains something beyond exact linear reasoning.
    pub(crate) fn for_values(
        task: &Task,
        plan: &ParametrizedPlan,
        valuation: &Valuation,
    ) -> Result<Option<Self>, Refusal> {
        let reduction = Reduction::new(plan);
        let Some(schedule) = earliest_schedule(&reduction, valuation) else {
            return Ok(None);
        };
        let obligations =
            Obligations::compile(task, plan, (&schedule, valuation), &reduction.substitution)?;
        let mut direct = Vec::new();
        for (index, obligation) in obligations.direct.iter().enumerate() {
            for (case, bad) in obligation.bad_cases.iter().enumerate() {
                check_products(plan, &reduction, bad)?;
                direct.push(DirectCase {
                    obligation: index,
                    case,
                    proofs: None,
                });
            }
        }
        let point = DecoupledEnvelope::point(valuation);
        let is_in_ranges = DecoupledEnvelope::ranges(plan).includes(&point);
        for over_all in &obligations.over_all {
            check_over_all(
                (task, plan),
                &reduction,
                over_all,
                (&schedule, is_in_ranges),
            )?;
        }
        let over_all = vec![None; obligations.over_all.len()];
        let numbers = numbers(&reduction, &obligations);
        Ok(Some(Self {
            reduction,
            obligations,
            schedule,
            direct,
            over_all,
            is_in_ranges: true,
            numbers,
            last_violated: usize::MAX - 1,
            refutations: 0,
            keeps_proofs: false,
        }))
    }

    /// Returns the plan's network with rigidly connected nodes merged.
    pub(crate) fn reduction(&self) -> &Reduction {
        &self.reduction
    }

    /// Returns the number of bad cases refuted from scratch so far: a measure of work.
    pub(crate) fn refutations(&self) -> usize {
        self.refutations
    }

    /// Returns the first obligation that some schedule for some value in the box violates. The box
    /// must contain the values that this was created [around](Self::around).
    ///
    /// Stores the proofs it finds. `moved` is a hint, for speed: the box differs only in that end,
    /// which is further out, from the last box with the result `None`, and all boxes checked since
    /// have been that one with an end moved out.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub(crate) fn broken(
        &mut self,
        task: &Task,
        plan: &ParametrizedPlan,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
    ) -> Result<Option<Broken>, Refusal> {
        let mut found = self.all_broken(task, plan, envelope, moved, 1)?;
        Ok(found.pop())
    }

    /// Does the same for a box that differs from the last one with the result `None` in `moved`
    /// only, and keeps the proofs of that one.
    pub(crate) fn broken_if_moved(
        &mut self,
        task: &Task,
        plan: &ParametrizedPlan,
        envelope: &DecoupledEnvelope,
        moved: BoxEnd,
    ) -> Result<Option<Broken>, Refusal> {
        self.keeps_proofs = true;
        let broken = self.broken(task, plan, envelope, Some(moved));
        self.keeps_proofs = false;
        broken
    }

    /// Like [`broken`](Self::broken), but returns at most `most` obligations: if possible, those
    /// that give better reasons.
    ///
    /// # Errors
    /// If there are too many cases to decide, and no violation is known.
    pub(crate) fn all_broken(
        &mut self,
        task: &Task,
        plan: &ParametrizedPlan,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
        most: usize,
    ) -> Result<Vec<Broken>, Refusal> {
        let Self {
            reduction,
            obligations,
            direct,
            over_all,
            is_in_ranges,
            numbers,
            last_violated: suspect,
            refutations,
            keeps_proofs,
            ..
        } = self;
        let mut schedules = LazyNetwork::Unbuilt(reduction, envelope, numbers.as_ref());
        // Deviations accumulate, so in a box later conditions are violated first, and the one that
        // was violated last is the most likely. In a point, the earliest violation is reported.
        let is_point = envelope.is_point();
        let count = direct.len();
        let first = (*suspect + 1).min(count);
        let (mut found, mut apart) = (Vec::new(), Vec::new());
        let upwards = (0..count).filter(|_| is_point);
        let downwards = (0..first).rev().chain((first..count).rev());
        for index in upwards.chain(downwards.filter(|_| !is_point)) {
            let direct = &mut direct[index];
            let obligation = &obligations.direct[direct.obligation];
            let is_separation = matches!(obligation.requirement, Requirement::Separation { .. });
            // The values that happenings read are only known if interfering ones keep their order.
            // So a violated separation is the better reason, and the only one with a
            // counterexample.
            let is_enough = found.len() >= most || !apart.is_empty();
            if is_enough && !is_separation || direct.proofs_hold(envelope, moved) {
                continue;
            }
            let Some(schedules) = schedules.get()? else {
                return Ok(Vec::new());
            };
            *refutations += 1;
            match schedules.possible(&obligation.bad_cases[direct.case]) {
                Outcome::Impossible(_) if *keeps_proofs => {}
                Outcome::Impossible(proofs) => direct.proofs = Some(proofs),
                Outcome::Possible => {
                    *suspect = index;
                    let reasons = if is_separation {
                        &mut apart
                    } else {
                        &mut found
                    };
                    reasons.push(Broken {
                        requirement: obligation.requirement.clone(),
                        case: obligation.bad_cases[direct.case].clone(),
                    });
                    if apart.len() >= most {
                        return Ok(apart);
                    }
                }
                Outcome::Unknown(parameter) if found.is_empty() && apart.is_empty() => {
                    return Err(Refusal::Coupled {
                        name: plan.parameter(parameter).name.clone(),
                    });
                }
                Outcome::Unknown(_) => {}
            }
        }
        if !apart.is_empty() || !found.is_empty() {
            return Ok(if apart.is_empty() { found } else { apart });
        }
        let is_within = DecoupledEnvelope::ranges(plan).includes(envelope);
        if is_within != *is_in_ranges && !*keeps_proofs {
            *is_in_ranges = is_within;
            over_all.fill(None);
        }
        let mut in_turn: Vec<_> = obligations.over_all.iter().zip(over_all).collect();
        if !is_point {
            in_turn.reverse();
        }
        for (over_all, proof) in in_turn {
            if proof
                .as_ref()
                .is_some_and(|proof| proof.holds_in(envelope, moved))
            {
                continue;
            }
            let Some(schedules) = schedules.get()? else {
                return Ok(Vec::new());
            };
            *refutations += 1;
            match schedules.prove(task, plan, over_all, is_within, (proof.as_ref(), moved)) {
                Ok(Ok(_)) if *keeps_proofs => {}
                Ok(Ok(new)) => *proof = Some(new),
                Ok(Err(case)) => {
                    found.push(Broken {
                        requirement: Requirement::OverAll {
                            instance: over_all.instance,
                            condition: over_all.condition.clone(),
                        },
                        case,
                    });
                    if found.len() >= most {
                        break;
                    }
                }
                Err(refusal) if found.is_empty() => return Err(refusal),
                Err(_) => break,
            }
        }
        Ok(found)
    }

    /// Returns values and a schedule in the box that violate the obligation in the given case.
    pub(crate) fn counterexample(
        &self,
        envelope: &DecoupledEnvelope,
        broken: &Broken,
    ) -> Option<Counterexample> {
        if let Requirement::Separation { first, second } = broken.requirement
            && broken.case.differences.len() == 1
        {
            // The reverse order may be harmless if the happenings are far apart. But schedules are
            // convex: between such a schedule and the reference schedule there is one with the
            // happenings in order, and too close.
            let mut near = broken.case.clone();
            near.differences.push(Difference::not_after(first, second));
            let witness = violation_case::witness(&self.reduction, envelope, &near, None);
            if witness.is_some() {
                return witness;
            }
        }
        violation_case::witness(&self.reduction, envelope, &broken.case, None)
    }

    /// Like [`counterexample`](Self::counterexample), but with the greatest violation of the
    /// obligation. Two happenings that should be apart may then be far apart in the reverse order,
    /// which is harmless.
    pub(crate) fn worst_case(
        &self,
        envelope: &DecoupledEnvelope,
        broken: &Broken,
    ) -> Option<Counterexample> {
        let gap = match broken.requirement {
            Requirement::Separation { first, second } => Some(Linear::difference(first, second)),
            _ => None,
        };
        violation_case::witness(&self.reduction, envelope, &broken.case, gap.as_ref())
    }
}

impl DirectCase {
    /// Returns `true` if the known proofs still hold.
    fn proofs_hold(&self, envelope: &DecoupledEnvelope, moved: Option<BoxEnd>) -> bool {
        let Some(proofs) = &self.proofs else {
            return false;
        };
        proofs.iter().all(|proof| match moved {
            Some(end) => !proof.depends_on(end) || proof.holds_in(envelope, moved),
            None => proof.holds_in(envelope, None),
        })
    }
}

/// Returns the earliest schedule at these values, by node.
pub(crate) fn earliest_schedule(reduction: &Reduction, valuation: &Valuation) -> Option<Schedule> {
    let point = DecoupledEnvelope::point(valuation);
    let network = reduction.network(&point).network;
    let consistent = ConsistentNetwork::try_from(network).ok()?;
    let earliest = consistent.earliest_schedule(elbowroom_stn::NodeId(0));
    let times: Vec<Rational> = earliest
        .times()
        .iter()
        .map(|time| time.real.clone())
        .collect();
    Some(reduction.times(&times))
}

/// Checks that products are exact: that holds only for one inequality at a time, and only if the
/// multiplied parameter does not also move the times.
fn check_products(
    plan: &ParametrizedPlan,
    reduction: &Reduction,
    case: &BadCase,
) -> Result<(), Refusal> {
    match reduction.undecided_at_corners(case) {
        Some(parameter) => Err(Refusal::Coupled {
            name: plan.parameter(parameter).name.clone(),
        }),
        None => Ok(()),
    }
}

/// Checks the products of an over-all condition, read at any place of its moment among the events
/// of the nominal schedule. Other places are checked for each box.
fn check_over_all(
    (task, plan): (&Task, &ParametrizedPlan),
    reduction: &Reduction,
    over_all: &OverAll,
    (nominal, is_in_ranges): (&Schedule, bool),
) -> Result<(), Refusal> {
    let (start, end) = (&nominal[over_all.start], &nominal[over_all.end]);
    let mut moments = vec![start];
    let events = over_all.events(is_in_ranges);
    moments.extend(
        events
            .iter()
            .map(|event| &nominal[*event])
            .filter(|&time| time > start && time < end),
    );
    for moment in moments {
        let cut = |node: NodeId| nominal[node] <= *moment;
        for mut inequalities in over_all.cases(task, &plan.plan, is_in_ranges, &cut)? {
            inequalities.extend(over_all.assumptions.iter().cloned());
            let case = BadCase {
                differences: Vec::new(),
                inequalities,
            };
            check_products(plan, reduction, &case)?;
        }
    }
    Ok(())
}
