//! Conversion of the entries of a run's record to the lines of a trace.

use elbowroom_execution::run::{ExecutedStep, Report, Verdict};
use elbowroom_execution::{
    ActionHandle, Command, Decision, Ending, Entry, Event, GoalChange, Measured, Observation,
    Order, Planned, PreparedPlan, Reason, Request, UnreachedGoal, WarningCause,
};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{Bound, ParametrizedPlan};
use indexmap::IndexMap;

use super::schema::{
    BoundLine, CommandLine, ConstraintLine, DecidedLine, DecisionLine, ExecutedLine,
    GoalChangeLine, GoalLookLine, GoalState, IdleLine, InstanceLine, InterruptedLine, IntervalLine,
    IssuedCommandLine, KeptPlanLine, Line, NetworkLine, ObservationLine, ObservedLine, OrderLine,
    ParameterLine, PlanLine, PlannedLine, PlanningLine, ReasonLine, ReportLine, RunningLine,
    ShortfallLine, SituationLine, StepLine, TermsLine, TimeAdvanceLine, UnreachedLine, WarningLine,
    WindowLine, WorldFailedLine,
};
use crate::exact::Exact;

impl Line {
    /// Converts an entry to a line; `task` names facts and fluents.
    #[allow(clippy::too_many_lines, reason = "one arm for each entry")]
    pub fn of(task: &Task, entry: &Entry<'_>) -> Self {
        let line = |it: &Observation| ObservationLine::of(task, it);
        let observed = |observations: &[Observation]| observations.iter().map(line).collect();
        match *entry {
            Entry::PlanAdopted(mission) => Self::Plan(mission_line(mission)),
            Entry::Decided { now, decided } => Self::Decided(DecidedLine {
                now: exact(now),
                decision: decision(&decided.decision),
                reason: ReasonLine::of(&decided.reason),
            }),
            Entry::Command {
                now,
                command,
                planned,
                expected,
                timeout,
            } => Self::Command(CommandLine {
                now: exact(now),
                command: IssuedCommandLine::of(command),
                planned: window(planned),
                expected: expected.map(exact),
                timeout: timeout.map(exact),
            }),
            Entry::Passed {
                until,
                now,
                observations,
            } => Self::Passed(TimeAdvanceLine {
                until: exact(until),
                now: exact(now),
                observations: observed(observations),
            }),
            Entry::Looked { now, observations } => Self::Looked(GoalLookLine {
                now: exact(now),
                observations: observed(observations),
            }),
            Entry::Taken {
                now,
                observation,
                planned,
                remark,
            } => Self::Observed(ObservedLine {
                now: exact(now),
                observation: ObservationLine::of(task, observation),
                planned: window(planned),
                remark: remark.map(str::to_owned),
            }),
            Entry::Planning {
                now,
                reason,
                situation,
            } => Self::Planning(PlanningLine {
                now: exact(now),
                reason: ReasonLine::of(reason),
                situation: situation_line(task, situation),
            }),
            Entry::Planned {
                now,
                took,
                plan,
                why_not,
                is_unsolvable,
                has_failed,
                remark,
                shortfall,
            } => Self::Planned(PlannedLine {
                now: exact(now),
                took: exact(took),
                plan: plan.map(steps),
                why_not: why_not.map(str::to_owned),
                is_unsolvable,
                has_failed,
                remark: remark.map(str::to_owned),
                shortfall: ShortfallLine::of(shortfall),
            }),
            Entry::Warning {
                now,
                ticket,
                action,
                until,
                cause,
            } => Self::Warning(WarningLine {
                now: exact(now),
                ticket: ticket.0,
                action: action.to_owned(),
                until: exact(until),
                is_timeout: cause == WarningCause::Timeout,
                words: warning(action, &(until - now), cause),
            }),
            Entry::Kept { now, reason } => Self::Kept(KeptPlanLine {
                now: exact(now),
                reason: ReasonLine::of(reason),
            }),
            Entry::Goal { now, name, change } => {
                let (becomes, why) = match change {
                    GoalChange::Achieved => (GoalState::Achieved, None),
                    GoalChange::SetAside { why } => (GoalState::SetAside, Some(why.to_owned())),
                    GoalChange::Pursued => (GoalState::Pursued, None),
                    GoalChange::Released => (GoalState::Released, None),
                    GoalChange::Kept => (GoalState::Kept, None),
                    GoalChange::Queued { why } => (GoalState::Queued, Some(why.to_owned())),
                    GoalChange::Failed { why } => (GoalState::Failed, Some(why.to_owned())),
                };
                Self::Goal(GoalChangeLine {
                    now: exact(now),
                    name: name.to_owned(),
                    becomes,
                    why,
                })
            }
            Entry::Resting {
                now,
                verdict,
                goals,
                dead_end,
                unreached,
            } => Self::Resting(IdleLine {
                now: exact(now),
                verdict: verdict.map(|it| it.name().to_owned()),
                why: verdict.and_then(Verdict::why).map(str::to_owned),
                goals: goals.to_vec(),
                dead_end: dead_end.iter().map(ReasonLine::of).collect(),
                unreached: (!unreached.is_empty())
                    .then(|| unreached.iter().map(unreached_line).collect()),
            }),
            Entry::Interrupted { now } => Self::Interrupted(InterruptedLine { now: exact(now) }),
            Entry::WorldFailed { now, why } => Self::WorldFailed(WorldFailedLine {
                now: exact(now),
                why: why.to_owned(),
            }),
            Entry::Over(report) => Self::Over(ReportLine::of(report)),
        }
    }
}

impl Line {
    /// Returns `true` if a replay with this line reproduces the stored line `self`. Fields that
    /// earlier versions did not write are not compared.
    ///
    /// `is_interrupted` if the line follows an interruption ([`Line::is_interrupted_after`]). Then
    /// planned times of reports are not compared: a decision that was ended early may have changed
    /// them.
    pub fn agrees_with(&self, replayed: &Self, is_interrupted: bool) -> bool {
        match (self, replayed) {
            (Self::Observed(stored), Self::Observed(replayed)) if is_interrupted => {
                stored.now == replayed.now && stored.observation == replayed.observation
            }
            (Self::Resting(stored), Self::Resting(replayed)) if stored.unreached.is_none() => {
                let unreached = None;
                *stored
                    == IdleLine {
                        unreached,
                        ..replayed.clone()
                    }
            }
            _ => self == replayed,
        }
    }

    /// Returns `true` if the lines after this one follow an interruption of the run, given whether
    /// this line does.
    pub fn is_interrupted_after(&self, is_interrupted: bool) -> bool {
        match self {
            Self::Interrupted(_) => true,
            Self::Over(_) => false,
            _ => is_interrupted,
        }
    }
}

fn unreached_line(goal: &UnreachedGoal) -> UnreachedLine {
    UnreachedLine {
        name: goal.name.clone(),
        impossible: goal.is_impossible,
        reasons: goal.reasons.iter().map(ReasonLine::of).collect(),
    }
}

impl ReportLine {
    /// Converts the report of a run to a line.
    pub fn of(report: &Report) -> Self {
        Self {
            verdict: report.verdict.name().to_owned(),
            why: report.verdict.why().map(str::to_owned),
            time: report.time.clone(),
            replans: report.replans,
            reasons: report.reasons.iter().map(ReasonLine::of).collect(),
            dead_end: report.dead_end.iter().map(ReasonLine::of).collect(),
            starts: report.starts,
            executed: report.executed.iter().map(executed).collect(),
        }
    }
}

impl ReasonLine {
    /// Converts a reason to a line.
    pub fn of(reason: &Reason) -> Self {
        Self {
            cause: reason.cause.name().to_owned(),
            words: reason.to_string(),
            action: reason.action.clone(),
            about: reason.about.as_ref().map(ToString::to_string),
            observed: optional(reason.observed.as_ref()),
            allowed: reason.allowed.as_ref().map(interval),
            behind: reason.evidence.iter().map(ToString::to_string).collect(),
            by: optional(reason.by.as_ref()),
            since: optional(reason.since.as_ref()),
            promise: reason.guarantee.map(|promise| promise.name().to_owned()),
        }
    }
}

impl IssuedCommandLine {
    /// Converts a command to a line.
    pub fn of(command: &Command) -> Self {
        match command {
            Command::Start {
                ticket,
                action,
                duration,
            } => Self::Start {
                ticket: ticket.0,
                action: action.name.clone(),
                duration: optional(duration.as_ref()),
            },
            Command::Cancel { ticket } => Self::Cancel { ticket: ticket.0 },
        }
    }
}

impl ObservationLine {
    /// Converts an observation to a line.
    pub fn of(task: &Task, observation: &Observation) -> Self {
        let time = exact(&observation.time);
        let amounts = |measured: &[Measured]| {
            let amounts = measured.iter();
            let amounts = amounts.map(|it| (task.fluent_name(it.fluent), exact(&it.amount)));
            amounts.collect::<IndexMap<_, _>>()
        };
        match &observation.event {
            Event::Started { ticket, measured } => Self::Started {
                ticket: ticket.0,
                measured: amounts(measured),
                time,
            },
            Event::Ended {
                ticket,
                ending,
                measured,
            } => Self::Ended {
                ticket: ticket.0,
                outcome: ending.name().to_owned(),
                measured: amounts(measured),
                why: match ending {
                    Ending::Failed { why } => Some(why.clone()),
                    Ending::Succeeded | Ending::Cancelled => None,
                },
                time,
            },
            Event::Feedback {
                ticket,
                completion,
                note,
            } => Self::Feedback {
                ticket: ticket.0,
                completion: optional(completion.as_ref()),
                note: note.clone(),
                time,
            },
            Event::Fact { fact, truth } => Self::Fact {
                fact: task.fact_name(*fact),
                becomes: *truth,
                time,
            },
            Event::Value { fluent, value } => Self::Value {
                fluent: task.fluent_name(*fluent),
                value: exact(value),
                time,
            },
            Event::Requested(request) => Self::from_request(request, time),
            Event::PlanMade => Self::PlanMade { time },
            Event::PlanReady => Self::PlanReady { time },
            Event::Unintelligible { said, why } => Self::Unintelligible {
                said: said.clone(),
                why: why.clone(),
                time,
            },
        }
    }
}

impl ObservationLine {
    fn from_request(request: &Request, time: Exact) -> Self {
        match request {
            Request::Pursue { name, goal, terms } => {
                let TermsLine {
                    value,
                    deadline,
                    release,
                    keep,
                    by,
                } = TermsLine::of(terms);
                Self::Goal {
                    name: name.clone(),
                    goal: goal.clone(),
                    value,
                    deadline,
                    release,
                    keep,
                    by,
                    time,
                }
            }
            Request::Abandon { name } => Self::Abandon {
                name: name.clone(),
                time,
            },
            Request::CancelAction { ticket } => Self::CancelAction {
                ticket: ticket.0,
                time,
            },
            Request::Pause => Self::Pause { time },
            Request::Resume => Self::Resume { time },
        }
    }

    /// Returns the event and its time if the line is an event of the run itself and not of a world:
    /// a request, or the completion or preparation of a background plan.
    pub fn run_event(&self) -> Option<(Event, &Rational)> {
        if let Self::PlanMade { time } = self {
            return Some((Event::PlanMade, &time.0));
        }
        if let Self::PlanReady { time } = self {
            return Some((Event::PlanReady, &time.0));
        }
        let (request, time) = match self {
            Self::Goal {
                name,
                goal,
                value,
                deadline,
                release,
                keep,
                by,
                time,
            } => {
                let terms = TermsLine {
                    value: value.clone(),
                    deadline: deadline.clone(),
                    release: release.clone(),
                    keep: *keep,
                    by: by.clone(),
                };
                let request = Request::Pursue {
                    name: name.clone(),
                    goal: goal.clone(),
                    terms: terms.terms(),
                };
                (request, time)
            }
            Self::Abandon { name, time } => {
                let name = name.clone();
                (Request::Abandon { name }, time)
            }
            Self::CancelAction { ticket, time } => {
                let ticket = ActionHandle(*ticket);
                (Request::CancelAction { ticket }, time)
            }
            Self::Pause { time } => (Request::Pause, time),
            Self::Resume { time } => (Request::Resume, time),
            _ => return None,
        };
        Some((Event::Requested(request), &time.0))
    }
}

fn exact(number: &Rational) -> Exact {
    Exact(number.clone())
}

fn optional(number: Option<&Rational>) -> Option<Exact> {
    number.map(exact)
}

fn executed(executed: &ExecutedStep) -> ExecutedLine {
    ExecutedLine {
        start: exact(&executed.step.start),
        action: executed.step.action.name.clone(),
        duration: optional(executed.step.duration.as_ref()),
        ticket: executed.ticket.0,
        outcome: executed.ending.as_ref().map(|it| it.name().to_owned()),
    }
}

fn decision(decision: &Decision) -> DecisionLine {
    match decision {
        Decision::Start(orders) => DecisionLine::Start {
            orders: orders.iter().map(order).collect(),
        },
        Decision::Wait { until } => DecisionLine::Wait {
            until: optional(until.as_ref()),
        },
        Decision::Cancel(steps) => DecisionLine::Cancel {
            steps: steps.iter().map(|step| step.0).collect(),
        },
        Decision::Replan => DecisionLine::Replan,
        Decision::GoalReached => DecisionLine::GoalReached,
    }
}

fn order(order: &Order) -> OrderLine {
    OrderLine {
        step: order.step.0,
        action: order.action.name.clone(),
        duration: optional(order.duration.as_ref()),
        planned: window(&order.planned),
    }
}

fn window(planned: &Planned) -> WindowLine {
    WindowLine {
        earliest: optional(planned.earliest.as_ref()),
        latest: optional(planned.latest.as_ref()),
    }
}

fn mission_line(mission: &PreparedPlan) -> PlanLine {
    PlanLine {
        now: exact(&mission.now),
        origin: exact(&mission.origin),
        steps: steps(&mission.time_triggered),
        network: network(&mission.plan),
        parameters: parameters(mission),
    }
}

fn network(plan: &ParametrizedPlan) -> NetworkLine {
    let label = |node| plan.plan.node_label(node);
    let bound = |bound: &Bound| match bound {
        Bound::Infinite => None,
        Bound::Finite(value) => Some(BoundLine::Number(exact(value))),
        Bound::Parameter(id) => Some(BoundLine::Parameter {
            parameter: plan.parameter(*id).name.clone(),
        }),
    };
    let constraints = plan.plan.constraints.iter();
    let instances = plan.plan.instances.iter();
    NetworkLine {
        instances: instances
            .map(|instance| InstanceLine {
                label: instance.label.clone(),
                action: instance.action.name.clone(),
            })
            .collect(),
        constraints: constraints
            .map(|constraint| ConstraintLine {
                from: label(constraint.from),
                to: label(constraint.to),
                lower: bound(&constraint.lower),
                upper: bound(&constraint.upper),
            })
            .collect(),
    }
}

fn parameters(mission: &PreparedPlan) -> Vec<ParameterLine> {
    let numbered = mission.plan.parameters.iter().enumerate();
    let parameters = numbered.map(|(index, parameter)| {
        let allowed = mission.envelope.as_ref();
        let allowed = allowed.and_then(|envelope| envelope.intervals().get(index));
        ParameterLine {
            name: parameter.name.clone(),
            nominal: exact(&parameter.nominal),
            envelope: allowed.map(interval),
        }
    });
    parameters.collect()
}

/// Returns the ends of an interval, `None` if infinite.
fn interval(interval: &Interval) -> IntervalLine {
    (
        optional(interval.lower.value()),
        optional(interval.upper.value()),
    )
}

pub(super) fn steps(plan: &TimeTriggeredPlan) -> Vec<StepLine> {
    let steps = plan.steps.iter();
    steps
        .map(|step| StepLine {
            start: exact(&step.start),
            action: step.action.name.clone(),
            duration: optional(step.duration.as_ref()),
        })
        .collect()
}

fn situation_line(task: &Task, situation: &Situation) -> SituationLine {
    // Sorted by name, because the numbers of facts depend on earlier uses of the task.
    let facts = situation.state.facts.iter();
    let mut facts: Vec<String> = facts.map(|&fact| task.fact_name(fact)).collect();
    facts.sort_unstable();
    let values = situation.state.values.iter();
    let mut values: IndexMap<_, _> = values
        .map(|(&fluent, value)| (task.fluent_name(fluent), exact(value)))
        .collect();
    values.sort_unstable_keys();
    let running = situation.running.iter();
    SituationLine {
        time: exact(&situation.time),
        facts,
        values,
        running: running
            .map(|running| RunningLine {
                action: running.action.name.clone(),
                start: exact(&running.start),
                duration: interval(&running.duration),
            })
            .collect(),
    }
}

fn warning(action: &str, left: &Rational, cause: WarningCause) -> String {
    let left = left.to_decimal(3);
    match cause {
        WarningCause::Slack => {
            format!("{action} has used its slack: {left} s until a new plan is needed")
        }
        WarningCause::Timeout => {
            format!("no progress of {action}: it times out in {left} s and is cancelled then")
        }
    }
}
