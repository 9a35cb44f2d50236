//! Check that a certificate is about a plan of a problem: [`check`].
//!
//! The network and the conditions of a certificate are derived from the problem and the plan by the rules
//! of this module. It shares no code with the crates that make networks, conditions and boxes. The check
//! establishes two properties.
//!
//! **Every schedule of the network is a valid plan**, for all values in the box:
//!
//! - The plan is valid at its own times, and these are a schedule of the network.
//! - Any two interfering happenings are at least ε apart in all schedules, in the same order. So a
//!   happening reads the same facts in each schedule as in the plan, because every other happening that writes
//!   them comes before it in both, or after it in both. The numbers that it reads are the same expressions in
//!   times and parameters ([`Histories`]).
//! - No condition on numbers that vary can fail ([`Numbers`]).
//! - Over-all conditions hold. Either all writers of the facts and fluents that a condition reads come
//!   before the action, after it, or inside it in a fixed order; or the condition is a fact that is
//!   established before the action, and changed only before that point or after the action; or the condition
//!   cannot fail at any moment inside the action, for each set of writers that can come before that moment.
//! - The points that change facts in trajectory constraints keep their order and,
//!   where the constraint has times, their bounds ([`TrajectoryDerivation`]).
//! - Durations are parameters, or those that the domain allows. Timed initials happen at their times. Initial
//!   values are parameters or those of the problem.
//!
//! Bounds on differences of times are shortest paths in the network. A parameter counts with the lower end
//! of its interval as a lower bound, and with the upper end as an upper bound.
//!
//! **Every inequality on boxes is needed.** Each bound of the network keeps the plan's order of two interfering
//! happenings, of an action and a writer that its over-all condition depends on, or of two instances of one action,
//! which are not to overlap; or a trajectory constraint needs it; or it sets a duration or the time of
//! timed initials. Each inequality that the certificate only states follows from a condition on numbers or from a
//! separation:
//! in a box that breaks it, there are values for which each schedule breaks the condition, or there is none. This
//! uses that a box contains the plan's own times. If a schedule for values in a box had interfering
//! happenings in another order, some schedule between it and the plan would have them less than ε apart.
//!
//! A plan file with constraints ([`GivenPlan`]) has a network already. The certificate has exactly its constraints then
//! ([`Given`]), and the plan's own times are its earliest schedule at nominal values. The network need not keep durations
//! that the domain allows, so bounds on durations are conditions like others.
//!
//! Plans that need more are [not derivable](NotDerived::Unknown). Examples are conditions on numbers that are not
//! linear in times and parameters. Where nothing reads such a number, its value does not matter.

mod decisions;
mod distances;
mod failures;
mod given;
mod histories;
mod labels;
mod linear;
mod needed;
mod numbers;
mod offset_components;
mod point_state;
mod subject;
mod trajectory;
mod valid;

use std::collections::BTreeMap;

use elbowroom_model::ground::FluentId;
use elbowroom_model::{Task, TimeTriggeredPlan, validate};
use elbowroom_num::Rational;

use crate::certificate::{Certificate, Parameter, Proof};
use crate::flaw::Flaw;
use crate::given::GivenPlan;
use crate::intervals::Intervals;
use crate::sound::Control;
use distances::Distances;
use failures::Failure;
use given::Given;
use histories::Histories;
pub(crate) use labels::{Label, LabelText};
use linear::Linear;
use numbers::Numbers;
use offset_components::OffsetComponents;
use subject::Subject;
use trajectory::TrajectoryDerivation;

/// Reason for a certificate that cannot be shown to be about a plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotDerived {
    /// The certificate does not match the plan.
    #[error(transparent)]
    Flaw(#[from] Flaw),
    /// The checker has no rule for this.
    #[error("not derivable here: {0}")]
    Unknown(String),
}

impl NotDerived {
    fn unknown(what: impl Into<String>) -> Self {
        Self::Unknown(what.into())
    }

    fn differs(what: impl Into<String>) -> Self {
        Self::Flaw(Flaw::Files(what.into()))
    }
}

/// The plan that a certificate has to match.
#[derive(Clone, Copy, Debug)]
pub enum Plan<'a> {
    /// Actions with fixed times.
    Times(&'a TimeTriggeredPlan),
    /// Actions with constraints on their times.
    Network(&'a GivenPlan),
}

/// Checks that the network of a certificate is that of the plan, and that every schedule of it is a
/// valid plan, for all values in its box. [`verify`](crate::verify()) checks the proofs of the
/// certificate.
///
/// # Errors
/// The first difference from the plan, or the first feature without a rule in this checker.
pub(crate) fn check(
    certificate: &Certificate,
    task: &Task,
    plan: Plan<'_>,
    initials: BTreeMap<FluentId, usize>,
) -> Result<Derived, NotDerived> {
    let Some(sound) = &certificate.sound else {
        let what = "the certificate does not prove that the box is inside the envelope";
        return Err(NotDerived::unknown(what));
    };
    if sound.control == Control::Assumed {
        let what = "the certificate does not contain a schedule of the plan";
        return Err(NotDerived::unknown(what));
    }
    let given = match plan {
        Plan::Times(_) => None,
        Plan::Network(network) => Some(Given::new(task, network)?),
    };
    let (own, nominal) = match (plan, &given) {
        (Plan::Times(plan), _) => (plan, plan),
        (Plan::Network(_), Some(given)) => (&given.steps, &given.nominal),
        (Plan::Network(_), None) => return Err(NotDerived::unknown("the plan")),
    };
    let subject = Subject::new(task, own, given.as_ref(), initials)?;
    subject.labels(certificate)?;
    if let validate::Verdict::Invalid(violation) =
        validate::validate(task, nominal, &validate::Settings::default())
    {
        let times = match given {
            None => "its own times",
            Some(_) => "the earliest times of its network",
        };
        let what = format!("the plan is not valid at {times}: {violation}");
        return Err(NotDerived::Unknown(what));
    }
    let course = TrajectoryDerivation::new(&subject)?;
    let places = OffsetComponents::new(certificate);
    // Times are not negative. Other parameters occur in the network only as bounds.
    let is_bound = |parameter: usize| {
        let kind = given.as_ref().and_then(|given| given.kind(parameter));
        kind == Some(BOUND)
    };
    let mut widest = Distances::new(certificate, &Intervals::widest(certificate, &is_bound))?;
    let nominal = certificate.parameters.iter();
    let nominal = nominal.map(|own| own.nominal.clone()).collect();
    let histories = Histories::new(&subject, &places, &mut widest, nominal)?;
    let quantities = match &given {
        None => needed::check(certificate, &histories, &course)?,
        Some(given) => given.check(certificate)?,
    };
    let intervals = Intervals::new(certificate, &sound.endless)?;
    contains_plan(certificate, &quantities, &intervals)?;
    match &given {
        None => ranges(certificate, &histories, &quantities)?,
        Some(given) => given.ranges(certificate)?,
    }
    let mut numbers = Numbers {
        certificate,
        intervals: &intervals,
        places: &places,
        distances: Distances::new(certificate, &intervals)?,
        is_bound: &is_bound,
    };
    course.check(&subject, &mut numbers.distances)?;
    let refuted = valid::check(&subject, &histories, &mut numbers)?;
    let mut known = refuted.conditions;
    let is_open = |step: usize| match &given {
        None => quantities.iter().any(|own| own.step == Some(step)),
        Some(given) => given.is_open(step),
    };
    let decisions = histories.decisions.iter();
    let decisions = decisions.flat_map(|own| own.otherwise.iter().cloned());
    let at_points = failures::at_points(&subject, &histories, &places, &is_open)?;
    for failure in decisions.chain(at_points) {
        if !numbers.refutes(&failure)? {
            let what = format!(
                "in some schedules of the network, {} may fail",
                failure.description
            );
            return Err(NotDerived::Unknown(what));
        }
        known.push(failure);
    }
    // If plans with other decisions may be valid, the conditions imply nothing about boxes that
    // contain such decisions.
    let of_all_boxes = if histories.needs_decisions(&mut widest) {
        known.as_slice()
    } else {
        &[]
    };
    assumed(certificate, &numbers, [of_all_boxes, &refuted.separations])?;
    // The certificate omits conditions that cannot fail at any times.
    let told = sound.conditions.as_ref().map_or(0, Vec::len);
    Ok(Derived {
        labels: labels::labels(&subject, &quantities),
        quantities,
        conditions: told.max(known.len()),
    })
}

/// Checks that the box contains the nominal values, and that no time in it is negative.
fn contains_plan(
    certificate: &Certificate,
    quantities: &[Quantity],
    intervals: &Intervals,
) -> Result<(), NotDerived> {
    for quantity in quantities {
        let nominal = &certificate.parameters[quantity.parameter].nominal;
        let [least, most] = intervals.of(quantity.parameter)?;
        let is_below = |bound: &Option<Rational>, from: &Rational| {
            bound.as_ref().is_none_or(|bound| bound <= from)
        };
        let is_time = least.as_ref().is_some_and(|least| !least.is_negative());
        if !is_below(least, nominal)
            || most.as_ref().is_some_and(|most| most < nominal)
            || (quantity.is_time() && !is_time)
        {
            let what = "the box has negative times, or does not contain the times of the plan";
            return Err(NotDerived::differs(what));
        }
    }
    Ok(())
}

/// Checks that inequalities that the certificate only states follow from conditions on numbers, or from the
/// separation of happenings.
fn assumed(
    certificate: &Certificate,
    numbers: &Numbers<'_>,
    known: [&[Failure]; 2],
) -> Result<(), NotDerived> {
    let mut rows = None;
    for proof in &certificate.proofs {
        let Proof::Assumed { why, sums } = proof else {
            continue;
        };
        if rows.is_none() {
            let own = known.concat();
            let own = own.iter().map(|failure| numbers.rows(failure));
            let own: Vec<Vec<Linear>> = own.collect::<Result<_, Flaw>>()?;
            rows = Some(own.concat());
        }
        if !numbers::is_implied(rows.as_deref().unwrap_or_default(), sums) {
            let what = format!("an inequality that the certificate states without a proof ({why})");
            return Err(NotDerived::Unknown(what));
        }
    }
    Ok(())
}

/// Checks that a parameter can deviate as far as it naturally does, or as far as deviations are counted. In a symmetric
/// box it deviates equally far in both directions.
fn is_not_narrower(
    certificate: &Certificate,
    own: &Parameter,
    [below, above]: [Option<Rational>; 2],
) -> Result<(), NotDerived> {
    let counted = &own.scale * &certificate.counted;
    let limited = |natural: Option<Rational>| {
        natural.map_or_else(|| counted.clone(), |own| own.min(counted.clone()))
    };
    let [mut below, mut above] = [below, above].map(limited);
    if certificate.symmetric {
        below = below.min(above);
        above = below.clone();
    }
    let is_narrow = |most: &Option<crate::Exact>, natural: &Rational| {
        most.as_ref().is_some_and(|most| most.0 < *natural)
    };
    if is_narrow(&own.most_below, &below) || is_narrow(&own.most_above, &above) {
        let what = format!(
            "the range of {}, which is an option of the command",
            own.name
        );
        return Err(NotDerived::Unknown(what));
    }
    Ok(())
}

/// The part of a certificate's subject that its answer is compared with.
pub(crate) struct Derived {
    /// The quantity of each parameter that is not an initial value.
    pub(crate) quantities: Vec<Quantity>,
    /// The label of each parameter, by position.
    pub(crate) labels: BTreeMap<usize, Label>,
    /// The number of conditions.
    pub(crate) conditions: usize,
}

/// The quantity of the plan that a parameter represents.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Quantity {
    /// The parameter, by position.
    pub(crate) parameter: usize,
    /// The word for the kind of quantity in answers.
    pub(crate) kind: &'static str,
    /// The position of the step whose duration or number it is, if it belongs to one.
    pub(crate) step: Option<usize>,
    /// The position of the timed initials whose time it is.
    pub(crate) group: Option<usize>,
    /// The name of that step's action.
    pub(crate) action: Option<String>,
}

/// The kind of a bound between two time points. Times of all other kinds are not negative.
pub(crate) const BOUND: &str = "bound";

impl Quantity {
    /// Returns `true` for durations and for times of timed initials.
    fn is_time(&self) -> bool {
        matches!(self.kind, "duration" | "timed")
    }
}

/// Checks that no parameter has a narrower range than its kind has: times down to 0, a duration for which the domain
/// gives an interval all of that interval, initial values without limit, all as far as deviations are counted. A
/// narrower range comes from an option of the command, not from the plan. Checks also that initial values are at their
/// nominal values in the problem.
fn ranges(
    certificate: &Certificate,
    histories: &Histories<'_>,
    quantities: &[Quantity],
) -> Result<(), NotDerived> {
    let subject = histories.subject;
    let times = quantities.iter().map(|own| {
        let interval = |step: usize| subject.domain_interval(step, histories);
        let domain = own.step.map(interval);
        (own.parameter, true, domain.unwrap_or_default())
    });
    let initials = subject.initials.values();
    let initials = initials.map(|own| (*own, false, [None, None]));
    for (parameter, is_time, [least, most]) in times.chain(initials) {
        let Some(own) = certificate.parameters.get(parameter) else {
            return Err(NotDerived::differs(format!(
                "there is no parameter {parameter}"
            )));
        };
        let below = is_time.then(|| &own.nominal - least.unwrap_or_default());
        let above = most.map(|most| most - &own.nominal);
        is_not_narrower(certificate, own, [below, above])?;
    }
    for (fluent, parameter) in &subject.initials {
        let nominal = &certificate.parameters[*parameter].nominal;
        if subject.task.initial().values.get(fluent) != Some(nominal) {
            let name = subject.task.fluent_name(*fluent);
            return Err(NotDerived::differs(format!(
                "{name} has another initial value"
            )));
        }
    }
    Ok(())
}
