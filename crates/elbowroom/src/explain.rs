//! What the library finds out about a plan, in words.

mod conflict;
mod control;
mod spoiler;
mod timed;

pub(crate) use conflict::Seen;

use elbowroom_envelope::obligations::Requirement;
use elbowroom_envelope::soundness::{Broken, Counterexample};
use elbowroom_envelope::{Limit, Objection, Oracle};
use elbowroom_model::Task;
use elbowroom_model::validate::{self, Verdict};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{
    DecoupledEnvelope, InstanceId, Node, NodeId, ParameterId, ParameterKind, ParametrizedPlan,
    Schedule, Side, Valuation, network_node,
};
use elbowroom_stn::{ConsistentNetwork, Constraint};

/// The reason given for an end that nothing limits, although it is finite.
pub const ANY_FINITE: &str = "every greater finite deviation is inside as well, but no times \
    fixed in advance suit all of them";

/// Says in words what was found out about one plan.
#[derive(Clone, Copy, Debug)]
pub struct Explainer<'a> {
    pub(crate) task: &'a Task,
    pub(crate) plan: &'a ParametrizedPlan,
}

/// Why a plan does not work somewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// What goes wrong, without the numbers of the example: several boxes that fail for one
    /// reason have the same text here.
    pub reason: String,
    /// By how much, where that is one number.
    pub shortfall: Option<Shortfall>,
    /// Values of the parameters at which it goes wrong.
    pub valuation: Valuation,
    /// A time for each node at which it goes wrong; `None` if there is no schedule at all.
    pub schedule: Option<Schedule>,
    /// The judge's verdict on that schedule.
    pub verdict: Option<String>,
    /// Where there is a schedule for all values, but none that can be found in time: how the world
    /// beats an executor that starts everything early, and one that starts everything late.
    pub plays: Vec<String>,
}

impl Explanation {
    /// Whether only the course of processes and events is known to become another one, with which
    /// the plan may work as well.
    pub(crate) fn may_be_harmless(&self, task: &Task) -> bool {
        let is_accepted = self.schedule.is_some() && self.verdict.is_none();
        is_accepted && !task.autonomous().is_empty()
    }
}

/// By how much something fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Shortfall {
    /// Something can happen so much too late.
    Time(Rational),
    /// Something can happen as late as one likes.
    Boundless,
    /// A comparison fails by so much.
    Amount(Rational),
}

impl Shortfall {
    /// The number; `None` if there is no limit.
    pub fn value(&self) -> Option<&Rational> {
        match self {
            Self::Time(value) | Self::Amount(value) => Some(value),
            Self::Boundless => None,
        }
    }
}

impl<'a> Explainer<'a> {
    /// Explains what concerns this plan.
    pub fn new(task: &'a Task, plan: &'a ParametrizedPlan) -> Self {
        Self { task, plan }
    }

    /// Why a box is not inside the envelope, with an example.
    pub fn objection(
        &self,
        oracle: &Oracle,
        refused: &DecoupledEnvelope,
        objection: &Objection,
    ) -> Explanation {
        match objection {
            Objection::NoSchedule(valuation) => self.no_schedule(valuation),
            Objection::Broken(broken) => {
                let example = oracle
                    .worst_case(refused, broken)
                    .filter(|worst| self.verdict(worst).is_some())
                    .or_else(|| oracle.counterexample(refused, broken));
                self.broken(broken, example)
            }
            Objection::Uncontrollable(conflict) => Explanation {
                plays: self.spoiled(refused),
                ..self.without_example(self.uncontrollable_in(conflict, refused))
            },
            other => self.without_example(other.to_string()),
        }
    }

    /// Why the plan has no schedule at these values. If it has one, the explanation is empty.
    pub fn no_schedule(&self, valuation: &Valuation) -> Explanation {
        let conflict = conflict::find(self, valuation);
        Explanation {
            reason: conflict
                .as_ref()
                .map_or_else(String::new, |c| c.reason.clone()),
            shortfall: conflict.map(|conflict| Shortfall::Time(conflict.excess)),
            valuation: valuation.clone(),
            schedule: None,
            verdict: None,
            plays: Vec::new(),
        }
    }

    /// The reason why an end of a parameter's interval cannot move further; `None` if there is
    /// none.
    pub fn limit(&self, id: ParameterId, side: Side, limit: &Limit) -> Option<String> {
        self.limit_beside((id, side), limit, &mut Seen::default())
    }

    /// The same. What was `seen` of other ends' reasons is not worked out again.
    pub(crate) fn limit_beside(
        &self,
        (id, side): (ParameterId, Side),
        limit: &Limit,
        seen: &mut Seen,
    ) -> Option<String> {
        match limit {
            Limit::Unbounded => None,
            Limit::AnyFinite => Some(ANY_FINITE.to_owned()),
            Limit::Range => Some(self.range(id, side)),
            Limit::Undecided => Some("there are too many cases to decide".to_owned()),
            Limit::Objection(objection) => Some(match objection {
                Objection::NoSchedule(valuation) => seen.reason(self, id, valuation),
                Objection::Broken(broken) => self.requirement(&broken.requirement),
                Objection::Uncontrollable(conflict) => self.uncontrollable(conflict),
                other => other.to_string(),
            }),
        }
    }

    fn broken(&self, broken: &Broken, example: Option<Counterexample>) -> Explanation {
        let reason = self.requirement(&broken.requirement);
        let Some(mut example) = example else {
            return self.without_example(reason);
        };
        let shortfall = match &broken.requirement {
            Requirement::Separation { first, second } => {
                let mut late = example.clone();
                let shortfall = self.make_late(&mut late, *first, *second);
                // The wrong way round may do no harm; too near always does.
                if self.verdict(&late).is_some() || self.verdict(&example).is_none() {
                    example = late;
                }
                shortfall
            }
            _ => shortfall(broken, &example),
        };
        Explanation {
            reason,
            shortfall,
            verdict: self.verdict(&example),
            valuation: example.valuation,
            schedule: Some(example.schedule),
            plays: Vec::new(),
        }
    }

    fn without_example(&self, reason: String) -> Explanation {
        Explanation {
            reason,
            shortfall: None,
            valuation: self.plan.nominal(),
            schedule: None,
            verdict: None,
            plays: Vec::new(),
        }
    }

    /// Gives the example a schedule in which `first` comes as late as it can, compared with
    /// `second`; a little after it, if there is no limit.
    fn make_late(
        &self,
        example: &mut Counterexample,
        first: NodeId,
        second: NodeId,
    ) -> Option<Shortfall> {
        let network = self.plan.plan.network(&example.valuation);
        let mut network = ConsistentNetwork::try_from(network).ok()?;
        let (first, second) = (network_node(first), network_node(second));
        let most = network.distance(second, first);
        let late = most.clone().unwrap_or(Rational::ONE);
        network
            .add(Constraint::at_least(second, first, late))
            .ok()?;
        let schedule = network.earliest_schedule(network_node(NodeId::ZERO));
        example.schedule = schedule.into();
        Some(most.map_or(Shortfall::Boundless, |most| {
            Shortfall::Time(&most + self.task.epsilon())
        }))
    }

    /// What the judge says of the plan at these values if all happens as early as possible; `None` as in
    /// [`verdict`](Self::verdict), and where there is no schedule.
    pub(crate) fn verdict_at(&self, valuation: Valuation) -> Option<String> {
        let network = self.plan.plan.network(&valuation);
        let network = ConsistentNetwork::try_from(network).ok()?;
        let schedule = network.earliest_schedule(network_node(NodeId::ZERO)).into();
        self.verdict(&Counterexample {
            valuation,
            schedule,
            moment: None,
        })
    }

    /// What the judge says about the example; `None` where it cannot be asked, because something
    /// else than the plan's own numbers is left open, or if it finds nothing wrong.
    fn verdict(&self, example: &Counterexample) -> Option<String> {
        let is_askable = self.plan.parameters.iter().all(|parameter| {
            matches!(
                parameter.kind,
                ParameterKind::Duration(_) | ParameterKind::Constant(_) | ParameterKind::Bound
            )
        });
        if !is_askable {
            return None;
        }
        let plan = self.plan.plan.at(&example.valuation);
        let plan = plan.scheduled(&example.schedule);
        let settings = validate::Settings::default();
        match validate::validate(self.task, &plan, &settings) {
            Verdict::Invalid(violation) => Some(violation.to_string()),
            _ => None,
        }
    }

    /// A requirement in words.
    pub fn requirement(&self, requirement: &Requirement) -> String {
        let plan = &self.plan.plan;
        let Requirement::Separation { first, second } = requirement else {
            return self.with_names(requirement.describe(self.task, plan));
        };
        let epsilon = self.task.epsilon().to_decimal(6);
        let kind = |node: &NodeId| plan.nodes[node.index()];
        match (kind(first), kind(second)) {
            (Node::Start(start), Node::End(end)) if start == end => self.own_separation(),
            (_, Node::Timed(index)) => self.deadline(*first, index),
            (Node::Timed(index), _) => format!(
                "{} must come {epsilon} after {}{}",
                plan.node_words(self.task, *second),
                self.timed_change(*second, index),
                self.at_time(index),
            ),
            _ => format!(
                "{} must come {epsilon} before {}",
                plan.node_words(self.task, *first),
                plan.node_words(self.task, *second),
            ),
        }
    }

    /// The text with the names of parameters, which a task does not know, for their numbers.
    fn with_names(&self, mut text: String) -> String {
        // From the last on: `?parameter1` is the beginning of `?parameter10`.
        for (index, parameter) in self.plan.parameters.iter().enumerate().rev() {
            text = text.replace(&format!("?parameter{index}"), &parameter.name);
        }
        text
    }

    /// A parameter in plain words: `duration of (drive rover depot shelf)`.
    pub fn quantity(&self, id: ParameterId) -> String {
        match self.plan.parameter(id).kind {
            ParameterKind::Timed(index) => self.timed_quantity(index),
            _ => self.plan.describe(self.task, id),
        }
    }

    /// Which values a parameter can take at all.
    fn range(&self, id: ParameterId, side: Side) -> String {
        let parameter = self.plan.parameter(id);
        let end = side.of(&parameter.range).value();
        let is_natural = parameter.range == Interval::at_least(Rational::ZERO);
        match (end, parameter.kind) {
            (Some(_), ParameterKind::Duration(_)) if is_natural => {
                "a duration is at least 0".to_owned()
            }
            (Some(_), ParameterKind::Constant(_)) if is_natural => {
                "an amount is at least 0".to_owned()
            }
            (Some(end), _) if side == Side::Lower => {
                format!("the domain or --vary allows at least {}", end.to_decimal(6))
            }
            (Some(end), _) => format!("the domain or --vary allows at most {}", end.to_decimal(6)),
            (None, _) => String::new(),
        }
    }

    /// Why an action cannot take no time at all.
    fn own_separation(&self) -> String {
        let epsilon = self.task.epsilon().to_decimal(6);
        format!("an action whose start and end interfere takes at least {epsilon}")
    }

    pub(crate) fn action_name(&self, id: InstanceId) -> &'a str {
        &self.plan.plan.instance(id).action.name
    }
}

/// By how much the example breaks a requirement on numbers.
fn shortfall(broken: &Broken, example: &Counterexample) -> Option<Shortfall> {
    let [inequality] = broken.case.inequalities.as_slice() else {
        return None;
    };
    let times = example.schedule.iter().chain(&example.moment);
    let times = times.cloned().collect();
    let value = inequality.expression.value(&times, &example.valuation);
    (!value.is_zero()).then(|| Shortfall::Amount(value.abs()))
}
