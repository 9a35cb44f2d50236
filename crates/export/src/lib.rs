//! Exports for other programs, as independent checks of this one.
//!
//! - [`stnu`]: the network of a plan whose parameters lie in a box, as an STNU, for any checker of
//!   controllability.
//! - [`box_check`]: the check whether a plan is guaranteed to work in a box, as SMT-LIB 2. The plan
//!   is guaranteed to work exactly if each answer is `unsat`.
//! - [`region`]: all values for which a plan works, as SMT-LIB 2.
//! - [`prism`]: decision processes in the language of PRISM, without time and on a clock. Their
//!   optimum is the success probability of the best executor.
//!
//! Dynamic controllability is a game, which SMT-LIB cannot express. For the dynamic guarantee,
//! [`box_check`] therefore only checks that every schedule is valid; [`stnu`] covers the other half.
//!
//! ```
//! use std::sync::Arc;
//!
//! use elbowroom::answers::EnvelopeRequest;
//! use elbowroom::envelope::Guarantee;
//! use elbowroom_export::{box_check, parametrized_plan};
//! use elbowroom::model::Task;
//! use elbowroom::parse_box;
//! use elbowroom::pddl::{self, Source};
//!
//! let domain = Source::new(
//!     "post.pddl",
//!     "(define (domain post)
//!        (:requirements :durative-actions :timed-initial-literals)
//!        (:predicates (open) (delivered))
//!        (:durative-action deliver :parameters () :duration (= ?duration 10)
//!          :condition (at end (open)) :effect (at end (delivered))))",
//! );
//! let problem = Source::new(
//!     "letter.pddl",
//!     "(define (problem letter) (:domain post)
//!        (:init (open) (at 30 (not (open)))) (:goal (delivered)))",
//! );
//! let task = Arc::new(Task::new(pddl::read_problem(&domain, &problem)?.0));
//! let (plan, _) = pddl::read_plan(&Source::new("plan", "0: (deliver) [10]"), &task)?;
//! let plan = parametrized_plan(&EnvelopeRequest::new(&task, plan))?;
//! let envelope = parse_box("dur_0=[5,28]", &plan)?;
//! let text = box_check(&task, &plan, &envelope, Guarantee::Weak)?;
//! assert_eq!(text.matches("(check-sat)").count(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod names;
pub mod prism;
mod smt;
mod write;

use elbowroom::answers::envelope::{self, EnvelopeFinding, Range};
use elbowroom::answers::{EnvelopeAnswer, EnvelopeRequest};
use elbowroom::pipeline::PipelineError;
use elbowroom_envelope::Guarantee;
use elbowroom_envelope::linear_form::LinearForm;
use elbowroom_envelope::obligations::Refusal;
use elbowroom_model::Task;
use elbowroom_network::{Format, NetworkFile};
use elbowroom_plan::{
    BoxEnd, DecoupledEnvelope, NodeId, ParameterId, ParametrizedPlan, network_node,
};

/// Largest number of positions that are distinguished for a moment inside an action.
const MAX_POSITIONS: usize = 4_096;

/// Reasons why a document cannot be exported.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The plan has no schedules to write conditions for.
    #[error(
        "the plan has no schedule at the values of this box that are nearest to the nominal ones, \
         so the box is not inside the envelope, and there are no conditions to write"
    )]
    NoSchedule,
    /// The plan is beyond exact analysis.
    #[error("this plan cannot be exported: {0}")]
    Refused(Refusal),
    /// A bound would have to hold for all values of an unbounded parameter.
    #[error(
        "a bound of the plan must hold for all values of {parameter}, but its interval is \
         unbounded: give finite bounds"
    )]
    Unlimited {
        /// The parameter's name.
        parameter: String,
    },
    /// The box of the answer has other parameters.
    #[error(
        "the parameters of the answer differ from those of this plan ({}): give the same domain, \
         problem, plan and --vary as for the answer",
        difference
    )]
    OtherParameters {
        /// The difference.
        difference: String,
    },
    /// The answer has no box.
    #[error("the answer has no box: the plan fails, or the search was stopped before it found one")]
    NoBox,
}

/// Returns the plan of a request with its open quantities.
///
/// # Errors
/// When the validator rejects the plan, or the request names quantities that the plan does not have.
pub fn parametrized_plan(request: &EnvelopeRequest) -> Result<ParametrizedPlan, PipelineError> {
    Ok(envelope::parametrized_plan(request)?.0)
}

/// Returns the box of an answer: the envelope that was found, or the box that was checked.
///
/// # Errors
/// When the answer has no box, or a box of other parameters.
pub fn box_of(
    answer: &EnvelopeAnswer,
    plan: &ParametrizedPlan,
) -> Result<DecoupledEnvelope, ExportError> {
    let ranges: Vec<&Range> = match &answer.finding {
        EnvelopeFinding::Envelope { parameters, .. } => {
            parameters.iter().map(|room| &room.range).collect()
        }
        EnvelopeFinding::Inside { parameters } | EnvelopeFinding::Outside { parameters, .. } => {
            parameters.iter().collect()
        }
        EnvelopeFinding::Fails(_) | EnvelopeFinding::None { .. } => {
            return Err(ExportError::NoBox);
        }
    };
    let differs = |difference: String| Err(ExportError::OtherParameters { difference });
    if ranges.len() != plan.parameters.len() {
        return differs(format!("{}, not {}", ranges.len(), plan.parameters.len()));
    }
    for (range, parameter) in ranges.iter().zip(&plan.parameters) {
        let (theirs, ours) = (&range.quantity, parameter);
        if theirs.name != ours.name {
            return differs(format!("{}, not {}", theirs.name, ours.name));
        }
        if theirs.nominal != ours.nominal {
            let (name, theirs, ours) = (&ours.name, &theirs.nominal, &ours.nominal);
            return differs(format!("nominal value of {name}: {theirs}, not {ours}"));
        }
    }
    let intervals = ranges.iter().map(|range| elbowroom_num::Interval {
        lower: range.lower.clone(),
        upper: range.upper.clone(),
    });
    DecoupledEnvelope::new(plan, intervals.collect()).ok_or(ExportError::NoBox)
}

/// Returns the network of a plan for an executor that relies on a box. Durations that the world
/// decides are contingent links; values that are never observed are at their worst. The dynamic and
/// the strong guarantee refer to this network. Time zero is called `Z`.
///
/// # Errors
/// When a bound has to hold for an unbounded parameter.
pub fn stnu(
    task: &Task,
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> Result<NetworkFile, ExportError> {
    let network = plan.uncertain_network(envelope);
    let network = network.map_err(|impossible| unlimited(plan, envelope, impossible.0))?;
    Ok(NetworkFile {
        format: Format::Elbowroom,
        name: task.problem().name.clone(),
        points: names::points(&plan.plan),
        reference: Some(network_node(NodeId::ZERO)),
        durations: vec![None; network.network.links().len()],
        network: network.network,
        correlations: Vec::new(),
        waits: Vec::new(),
        remarks: Vec::new(),
    })
}

/// Returns the check whether the plan is guaranteed to work in a box, as SMT-LIB 2, with comments.
/// It consists of several queries, separated by `(reset)`. The answers are all `unsat` exactly if
/// the box is inside. For the dynamic guarantee, the network of [`stnu`] must also be dynamically
/// controllable.
///
/// # Errors
/// When the plan has no schedule at the values nearest to the nominal ones, or is beyond exact
/// analysis.
pub fn box_check(
    task: &Task,
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
    guarantee: Guarantee,
) -> Result<String, ExportError> {
    let around = envelope.nearest(&plan.nominal());
    let form = LinearForm::new(task, plan, envelope, &around, MAX_POSITIONS).map_err(refused)?;
    let text = smt::Text::new(task, plan, &form);
    let mut written = text.box_heading(envelope, guarantee);
    text.conditions(envelope, &mut written);
    match guarantee {
        Guarantee::Weak => text.schedules(envelope, &mut written),
        Guarantee::Strong => {
            let network = plan.uncertain_network(envelope);
            let network = network.map_err(|impossible| unlimited(plan, envelope, impossible.0))?;
            text.fixed_times(&network.network, &mut written);
        }
        _ => {}
    }
    Ok(written)
}

/// Returns all values for which the plan has a schedule, and every schedule is valid, as SMT-LIB 2,
/// with comments: the region of the weak guarantee, restricted to the order of happenings at the
/// nominal values.
///
/// # Errors
/// When the plan has no schedule at its nominal values, or is beyond exact analysis.
pub fn region(task: &Task, plan: &ParametrizedPlan) -> Result<String, ExportError> {
    let ranges = DecoupledEnvelope::ranges(plan);
    let form = LinearForm::new(task, plan, &ranges, &plan.nominal(), MAX_POSITIONS);
    let form = form.map_err(refused)?;
    Ok(smt::Text::new(task, plan, &form).region(&ranges))
}

fn refused(refusal: Refusal) -> ExportError {
    match refusal {
        Refusal::NoNominalSchedule => ExportError::NoSchedule,
        refusal => ExportError::Refused(refusal),
    }
}

/// Returns the unbounded parameter of a constraint that has to hold for all its values.
fn unlimited(
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
    constraint: usize,
) -> ExportError {
    let constraint = &plan.plan.constraints[constraint];
    let ids = [&constraint.lower, &constraint.upper].map(elbowroom_plan::Bound::parameter);
    let is_unlimited = |id: &ParameterId| {
        BoxEnd::all(plan.parameters.len())
            .any(|end| end.parameter == *id && end.reach(envelope).is_none())
    };
    let id = ids.into_iter().flatten().find(is_unlimited);
    ExportError::Unlimited {
        parameter: id.map_or_else(String::new, |id| plan.parameter(id).name.clone()),
    }
}
