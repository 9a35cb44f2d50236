//! Deordering: plans with only the orderings and bounds that they need.

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::deorder::DeorderError;
use elbowroom_plan::{Bound, Constraint, Node, NodeId, ParametrizedPlan};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{RequestError, Version, ViolationAnswer, exact};
use crate::AnyPlan;
use crate::dot;
use crate::pipeline::{self, PipelineError};

/// Requests a plan with only the orderings and bounds that it needs.
#[derive(Clone, Debug)]
pub struct StnRequest<'a> {
    /// The problem.
    pub task: &'a Task,
    /// The plan. A plan that is already a network is not changed.
    pub plan: AnyPlan,
}

/// The answer, and the network.
#[derive(Clone, Debug)]
pub struct StnOutcome {
    /// The answer as a document.
    pub answer: StnAnswer,
    /// The network; `None` if the validator rejects the plan.
    pub plan: Option<ParametrizedPlan>,
}

/// A plan as a network: `docs/reference/formats/stn-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StnAnswer {
    /// Format of the document.
    pub format: StnFormat,
    /// Version of the document.
    pub version: Version,
    /// The answer itself.
    #[serde(flatten)]
    pub finding: StnFinding,
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum StnFormat {
    /// The name `elbowroom-stn`.
    #[default]
    #[serde(rename = "elbowroom-stn")]
    Stn,
}

/// The result of the deordering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "lowercase")]
pub enum StnFinding {
    /// The plan as a network.
    Network {
        /// The domain's name.
        domain: String,
        /// The problem's name.
        problem: String,
        /// The time points.
        nodes: Vec<NodeAnswer>,
        /// Bounds on their differences.
        constraints: Vec<ConstraintAnswer>,
    },
    /// The validator rejects the plan.
    Invalid {
        /// The reason.
        violation: ViolationAnswer,
    },
}

/// A time point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodeAnswer {
    /// Its name in STN plan files.
    pub name: String,
    /// The happening, in words.
    pub what: String,
    /// The time of timed initials.
    #[serde(with = "exact::option")]
    pub time: Option<Rational>,
}

/// `lower <= to - from <= upper`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConstraintAnswer {
    /// The name of a node.
    pub from: String,
    /// The name of a node.
    pub to: String,
    /// The lower bound.
    #[serde(
        serialize_with = "BoundAnswer::serialize_lower",
        deserialize_with = "BoundAnswer::deserialize_lower"
    )]
    pub lower: BoundAnswer,
    /// The upper bound.
    #[serde(
        serialize_with = "BoundAnswer::serialize_upper",
        deserialize_with = "BoundAnswer::deserialize_upper"
    )]
    pub upper: BoundAnswer,
    /// The reason for the constraint, in one word.
    pub reason: String,
}

/// A bound of a constraint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BoundAnswer {
    /// No bound.
    Infinite,
    /// A number.
    Finite(Rational),
    /// The parameter of that name.
    Parameter(String),
}

/// Converts a plan into a network.
///
/// # Errors
/// When the plan cannot be deordered. An invalid plan is an answer, not an error.
pub fn stn(request: &StnRequest<'_>) -> Result<StnOutcome, RequestError> {
    let task = request.task;
    if let Some(feature) = task.unsupported_by_analysis() {
        return Err(PipelineError::from(DeorderError::Unsupported { feature }).into());
    }
    let plan = match &request.plan {
        AnyPlan::Stn(plan) => plan.clone(),
        AnyPlan::TimeTriggered(plan) => match pipeline::free(task, plan) {
            Ok(freed) => pipeline::without_parameters(task, freed),
            Err(PipelineError::Invalid(violation)) => {
                let violation = (&*violation).into();
                return Ok(StnOutcome {
                    answer: answer(StnFinding::Invalid { violation }),
                    plan: None,
                });
            }
            Err(error) => return Err(error.into()),
        },
    };
    Ok(StnOutcome {
        answer: answer(network(task, &plan)),
        plan: Some(plan),
    })
}

fn answer(finding: StnFinding) -> StnAnswer {
    StnAnswer {
        format: StnFormat::Stn,
        version: Version,
        finding,
    }
}

fn network(task: &Task, plan: &ParametrizedPlan) -> StnFinding {
    let nodes = plan.plan.nodes();
    let constraints = plan.plan.constraints.iter();
    StnFinding::Network {
        domain: task.problem().domain.clone(),
        problem: task.problem().name.clone(),
        nodes: nodes.map(|(id, what)| node(task, plan, id, what)).collect(),
        constraints: constraints.map(|own| constraint(plan, own)).collect(),
    }
}

fn node(task: &Task, plan: &ParametrizedPlan, id: NodeId, what: Node) -> NodeAnswer {
    NodeAnswer {
        name: plan.plan.node_label(id),
        what: plan.plan.describe_node(task, id),
        time: match what {
            Node::Timed(index) => Some(task.timed()[index].time.clone()),
            _ => None,
        },
    }
}

fn constraint(plan: &ParametrizedPlan, constraint: &Constraint) -> ConstraintAnswer {
    let bound = |bound: &Bound| match bound {
        Bound::Infinite => BoundAnswer::Infinite,
        Bound::Finite(value) => BoundAnswer::Finite(value.clone()),
        Bound::Parameter(id) => BoundAnswer::Parameter(plan.parameter(*id).name.clone()),
    };
    ConstraintAnswer {
        from: plan.plan.node_label(constraint.from),
        to: plan.plan.node_label(constraint.to),
        lower: bound(&constraint.lower),
        upper: bound(&constraint.upper),
        reason: dot::reason(&constraint.reason).to_owned(),
    }
}

/// A bound in a document: either a parameter or a number.
#[derive(Deserialize)]
struct Written {
    parameter: Option<String>,
    exact: Option<String>,
}

#[derive(Serialize)]
struct Named<'a> {
    parameter: &'a str,
}

impl BoundAnswer {
    fn serialize_lower<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.serialize(exact::MINUS_INFINITY, serializer)
    }

    fn serialize_upper<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.serialize(exact::INFINITY, serializer)
    }

    fn deserialize_lower<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::deserialize(exact::MINUS_INFINITY, deserializer)
    }

    fn deserialize_upper<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::deserialize(exact::INFINITY, deserializer)
    }

    fn serialize<S: Serializer>(
        &self,
        infinity: &'static str,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match self {
            Self::Infinite => exact::infinite(infinity, serializer),
            Self::Finite(value) => exact::serialize(value, serializer),
            Self::Parameter(parameter) => Named { parameter }.serialize(serializer),
        }
    }

    fn deserialize<'de, D: Deserializer<'de>>(
        infinity: &'static str,
        deserializer: D,
    ) -> Result<Self, D::Error> {
        match Written::deserialize(deserializer)? {
            Written {
                parameter: Some(parameter),
                ..
            } => Ok(Self::Parameter(parameter)),
            Written {
                exact: Some(exact), ..
            } if exact == infinity => Ok(Self::Infinite),
            Written {
                exact: Some(exact), ..
            } => exact.parse().map(Self::Finite).map_err(D::Error::custom),
            _ => Err(D::Error::custom("a bound is a number or a parameter")),
        }
    }
}
