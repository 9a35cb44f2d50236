//! The rule about rounded plans: the differences between a printed plan and a valid one that count
//! as rounding.
//!
//! Planners round or truncate the numbers that they print, and the validator tolerates no
//! difference. So a printed plan is read as a valid plan whose times and durations differ from the
//! printed numbers by at most one unit of the last printed digit, and by at most 0.001; or by at
//! most the tolerance that the user gives. Happenings that interfere keep their printed order.
//! Without such a plan, the numbers of the text are taken as they are, and the verdict is the
//! validator's. Every command that reads a plan reads it by this rule; `docs/reference/formats/plan.md`
//! states it for users.

use elbowroom_model::problem::Comparison;
use elbowroom_model::validate::{
    self, Reason as Because, Settings, Verdict, Violation, ViolationKind,
};
use elbowroom_model::{Step, Task, TimeTriggeredPlan};
use elbowroom_num::{End, Interval, Rational};
use elbowroom_pddl::{
    Diagnostic, Diagnostics, PrintedPlan, PrintedStep, Source, read_printed_plan,
};
use elbowroom_plan::deorder::{allowed_durations, deorder_ignoring_processes, unordered};
use elbowroom_plan::{
    Bound, Constraint, InstanceId, NodeId, ParametrizedPlan, Reason, Schedule, StnPlan, Valuation,
    network_node,
};
use elbowroom_stn::{ConsistentNetwork, IncrementalWindows, Window};
use elbowroom_text::Severity;

use crate::{RepairLimits, RepairRun, repair};

/// The largest difference that counts as rounding if the user gives no tolerance.
const LARGEST_UNIT: (i64, i64) = (1, 1000);
/// Limit on the steps of plans whose numeric conditions are met by linear programs.
const MAX_STEPS: usize = 200;
/// Limit on the linear programs solved for one plan.
pub(crate) const MAX_PROGRAMS: usize = 60;

/// The rule about rounded plans, with its settings.
#[derive(Clone, Debug, Default)]
pub struct RoundingRule {
    /// The allowed difference of each number. Without it, one unit of the last printed digit, at
    /// most 0.001. If 0, plans are used exactly as printed.
    pub tolerance: Option<Rational>,
    /// The rules of the validator.
    pub settings: Settings,
}

/// The result of applying the rule to a printed plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Accepted {
    /// The plan with the printed numbers, or the valid plan that they are rounded from.
    pub plan: TimeTriggeredPlan,
    /// The first violation of the printed numbers, if `plan` has other numbers.
    pub rounded: Option<Box<Violation>>,
}

impl RoundingRule {
    /// Creates the rule, with a tolerance if there is one.
    pub fn with_tolerance(tolerance: Option<Rational>) -> Self {
        Self {
            tolerance,
            ..Self::default()
        }
    }

    /// Reads a plan and applies the rule to its numbers. A warning reports that the result differs
    /// from the printed numbers.
    ///
    /// # Errors
    /// When the text is not a plan for the task. An invalid plan is not an error.
    pub fn read_plan(
        &self,
        source: &Source,
        task: &Task,
    ) -> Result<(TimeTriggeredPlan, Vec<Diagnostic>), Diagnostics> {
        let (printed, mut warnings) = read_printed_plan(source, task)?;
        let accepted = self.accept(task, &printed);
        if let Some(violation) = &accepted.rounded {
            warnings.push(warning(source, &printed, violation));
        }
        warnings.extend(self_overlap(source, &printed, &accepted.plan));
        Ok((accepted.plan, warnings))
    }

    /// Returns the valid plan within rounding of the printed numbers. Returns the printed plan itself if
    /// it is valid, or if there is no such plan.
    pub fn accept(&self, task: &Task, printed: &PrintedPlan) -> Accepted {
        self.accept_within(task, printed, MAX_PROGRAMS)
    }

    /// As [`accept`](Self::accept), with a limit on the linear programs.
    fn accept_within(&self, task: &Task, printed: &PrintedPlan, programs: usize) -> Accepted {
        let windows = self.windows(printed);
        let as_printed = Accepted {
            plan: printed.plan.clone(),
            rounded: None,
        };
        if windows.iter().all(StepWindow::is_exact) {
            return as_printed;
        }
        let Verdict::Invalid(violation) = self.verdict(task, &printed.plan) else {
            return as_printed;
        };
        match self.valid_plan_within(task, &printed.plan, (&windows, programs)) {
            Some(plan) => Accepted {
                plan,
                rounded: Some(Box::new(violation)),
            },
            None => as_printed,
        }
    }

    /// Returns `true` if the printed plan is valid, exactly or within rounding, and at most
    /// `programs` linear programs are needed to find that. [`accept`](Self::accept) then accepts it.
    pub(crate) fn is_valid(&self, task: &Task, printed: &PrintedPlan, programs: usize) -> bool {
        let accepted = self.accept_within(task, printed, programs);
        accepted.rounded.is_some() || self.verdict(task, &accepted.plan).is_valid()
    }

    fn windows(&self, printed: &PrintedPlan) -> Vec<StepWindow> {
        let (numerator, denominator) = LARGEST_UNIT;
        let largest = Rational::new(numerator, denominator);
        let reach = |unit: &Rational| match &self.tolerance {
            Some(tolerance) => tolerance.clone(),
            None => unit.min(&largest).clone(),
        };
        let around = |value: &Rational, reach: Rational| {
            let lower = (value - &reach).max(Rational::ZERO);
            Interval::closed(lower, value + reach)
        };
        let window = |(step, own): (&Step, &PrintedStep)| StepWindow {
            start: around(&step.start, reach(&own.start_unit)),
            duration: step
                .duration
                .as_ref()
                .map(|duration| around(duration, reach(&own.duration_unit))),
        };
        printed
            .plan
            .steps
            .iter()
            .zip(&printed.steps)
            .map(window)
            .collect()
    }

    fn verdict(&self, task: &Task, plan: &TimeTriggeredPlan) -> Verdict {
        validate::validate(task, plan, &self.settings)
    }

    /// Returns a valid plan with all numbers in these windows and near to the printed ones, but not always
    /// the nearest.
    fn valid_plan_within(
        &self,
        task: &Task,
        printed: &TimeTriggeredPlan,
        (windows, programs): (&[StepWindow], usize),
    ) -> Option<TimeTriggeredPlan> {
        let mut plan = with_allowed_durations(task, printed, windows);
        match self.verdict_with_durations(task, &mut plan, windows) {
            Verdict::Valid(_) => return Some(plan.in_order()),
            Verdict::Undecided(_) => return None,
            Verdict::Invalid(_) => {}
        }
        // The durations of the domain usually restore the order that the plan had before rounding,
        // unless an action starts exactly at the end of another one.
        let orders = [
            plan.clone(),
            printed.clone(),
            with_ends_at_starts(&plan, windows),
        ];
        let mut distinct = orders.iter().enumerate().filter(|(index, order)| {
            let earlier = &orders[..*index];
            !earlier.contains(order)
        });
        let found = distinct.find_map(|(_, order)| {
            self.valid_plan_in_order(task, order, &plan, (windows, programs))
        })?;
        Some(found.in_order())
    }

    /// Returns a valid plan with all numbers in the windows and with times near to those of `plan`.
    /// Interfering happenings have the order of `order`.
    fn valid_plan_in_order(
        &self,
        task: &Task,
        order: &TimeTriggeredPlan,
        plan: &TimeTriggeredPlan,
        (windows, programs): (&[StepWindow], usize),
    ) -> Option<TimeTriggeredPlan> {
        // No plan results if interfering happenings have no order.
        let refitted = fit_times_to_windows(task, order, plan, windows)?;
        match self.verdict(task, &refitted) {
            Verdict::Valid(_) => Some(refitted),
            Verdict::Invalid(violation) if is_about_numbers(&violation) => {
                self.by_linear_programs(task, order, (windows, programs))
            }
            Verdict::Invalid(_) | Verdict::Undecided(_) => None,
        }
    }

    /// Returns the verdict on the plan after durations have been corrected one after the other: each to
    /// the value that the validator demands, if its window contains that value. Bounds on durations may
    /// depend on values that change.
    fn verdict_with_durations(
        &self,
        task: &Task,
        plan: &mut TimeTriggeredPlan,
        windows: &[StepWindow],
    ) -> Verdict {
        for _ in 0..plan.steps.len() {
            let verdict = self.verdict(task, plan);
            let demanded = verdict.violation().and_then(demanded_duration);
            let within = demanded.filter(|(step, value)| {
                let window = windows[*step].duration.as_ref();
                window.is_some_and(|window| window.contains(value))
            });
            let Some((step, value)) = within else {
                return verdict;
            };
            plan.steps[step].duration = Some(value.clone());
        }
        self.verdict(task, plan)
    }

    /// Returns a valid plan with numbers in the windows that satisfies its numeric conditions. The search
    /// is that for repairs, with the times as the only variables.
    fn by_linear_programs(
        &self,
        task: &Task,
        plan: &TimeTriggeredPlan,
        (windows, programs): (&[StepWindow], usize),
    ) -> Option<TimeTriggeredPlan> {
        if task.unsupported_by_analysis().is_some() || plan.steps.len() > MAX_STEPS {
            return None;
        }
        let mut free = unordered(task, plan);
        bound_times(&mut free.plan, &free.instances, windows);
        let closed = ParametrizedPlan::closed(task, free.plan);
        let at = |schedule: &Schedule| with_times(plan, &closed.plan, &free.instances, schedule);
        let limits = RepairLimits {
            cases: programs,
            ..RepairLimits::default()
        };
        let run = repair(
            task,
            &closed,
            Some(&free.times),
            &[],
            &limits,
            &mut |_, schedule| self.verdict(task, &at(schedule)).is_valid(),
            &mut || std::ops::ControlFlow::Continue(()),
        );
        match run {
            Ok(RepairRun::Repaired { repair, .. }) => Some(at(&repair.schedule)),
            _ => None,
        }
    }
}

/// The values that the numbers of a step may have.
struct StepWindow {
    start: Interval,
    duration: Option<Interval>,
}

impl StepWindow {
    /// Returns `true` if the numbers are exactly those of the text.
    fn is_exact(&self) -> bool {
        let is_point = |interval: &Interval| interval.lower == interval.upper;
        is_point(&self.start) && self.duration.as_ref().is_none_or(is_point)
    }
}

/// Returns the plan with each duration moved to the nearest one that the domain allows. A duration
/// stays if its bounds depend on the times of the plan, or if its window does not contain the new value.
fn with_allowed_durations(
    task: &Task,
    plan: &TimeTriggeredPlan,
    windows: &[StepWindow],
) -> TimeTriggeredPlan {
    let mut plan = plan.clone();
    let allowed = allowed_durations(task, &plan);
    for ((step, window), allowed) in plan.steps.iter_mut().zip(windows).zip(allowed) {
        let (Some(duration), Some(window), Some(allowed)) =
            (&mut step.duration, &window.duration, allowed)
        else {
            continue;
        };
        let nearest = clamped(duration, allowed.lower.value(), allowed.upper.value());
        if window.contains(&nearest) && allowed.contains(&nearest) {
            *duration = nearest;
        }
    }
    plan
}

/// Returns the step of a violated duration bound, and the duration that satisfies the bound.
fn demanded_duration(violation: &Violation) -> Option<(usize, &Rational)> {
    let step = violation.action.as_ref()?.step;
    match &violation.kind {
        ViolationKind::Duration {
            comparison: Comparison::Less | Comparison::Greater,
            ..
        } => None,
        ViolationKind::Duration { value, .. } => Some((step, value)),
        _ => None,
    }
}

/// Returns `true` if the violation is about a number, so that other times in the same order may resolve
/// it.
fn is_about_numbers(violation: &Violation) -> bool {
    match &violation.kind {
        ViolationKind::Duration { .. } => true,
        ViolationKind::Condition { reasons, .. } | ViolationKind::Constraint { reasons, .. } => {
            reasons
                .iter()
                .any(|reason| matches!(reason, Because::Comparison { .. }))
        }
        _ => false,
    }
}

/// Returns the plan with each end moved to the last start before it, if rounding may have separated
/// the two.
fn with_ends_at_starts(plan: &TimeTriggeredPlan, windows: &[StepWindow]) -> TimeTriggeredPlan {
    let mut moved = plan.clone();
    let lower = |window: &Interval| window.lower.value().cloned().unwrap_or_default();
    for (step, window) in moved.steps.iter_mut().zip(windows) {
        let (end, Some(duration)) = (step.end(), &window.duration) else {
            continue;
        };
        let earliest = lower(&window.start) + lower(duration);
        let starts = plan.steps.iter().zip(windows);
        let near = starts.filter(|(other, own)| {
            let latest = own.start.upper.value();
            other.start >= step.start
                && other.start < end
                && latest.is_some_and(|latest| *latest >= earliest)
        });
        if let Some(start) = near.map(|(other, _)| &other.start).max() {
            step.duration = Some(start - &step.start);
        }
    }
    moved
}

/// Returns the plan with times within the windows, each as near as possible to its own time.
/// Interfering happenings have the order of `order` and are separated. `None` if there are no such
/// times.
fn fit_times_to_windows(
    task: &Task,
    order: &TimeTriggeredPlan,
    plan: &TimeTriggeredPlan,
    windows: &[StepWindow],
) -> Option<TimeTriggeredPlan> {
    let deordered = deorder_ignoring_processes(task, order).ok()?;
    let (mut network, instances) = (deordered.plan, deordered.instances);
    bound_times(&mut network, &instances, windows);
    let zero = network_node(NodeId::ZERO);
    let consistent = ConsistentNetwork::try_from(network.network(&Valuation::default())).ok()?;
    let mut moving = IncrementalWindows::new(consistent, zero);
    let mut times = vec![Rational::ZERO; network.nodes.len()];
    let mut fix = |node: NodeId, wish: &Rational| {
        let Window { earliest, latest } = moving.window(network_node(node));
        let time = clamped(wish, earliest.as_ref(), latest.as_ref());
        moving.fix(network_node(node), &time).ok()?;
        times[node.index()] = time.clone();
        Some(time)
    };
    let mut by_start: Vec<(&Step, InstanceId)> =
        plan.steps.iter().zip(instances.iter().copied()).collect();
    by_start.sort_by(|(one, _), (other, _)| one.start.cmp(&other.start));
    for (step, instance) in by_start {
        let start = fix(network.start(instance), &step.start)?;
        if let Some(duration) = &step.duration {
            fix(network.end(instance), &(start + duration))?;
        }
    }
    let schedule = Schedule::from(elbowroom_stn::Schedule::new(times));
    Some(with_times(plan, &network, &instances, &schedule))
}

/// Adds the windows of the steps to their network.
fn bound_times(plan: &mut StnPlan, instances: &[InstanceId], windows: &[StepWindow]) {
    for (&instance, window) in instances.iter().zip(windows) {
        let (start, end) = (plan.start(instance), plan.end(instance));
        plan.constraints
            .push(within(NodeId::ZERO, start, &window.start));
        if let Some(duration) = &window.duration {
            plan.constraints.push(within(start, end, duration));
        }
    }
}

fn within(from: NodeId, to: NodeId, window: &Interval) -> Constraint {
    let bound = |end: &End| match end.value() {
        Some(value) => Bound::Finite(value.clone()),
        None => Bound::Infinite,
    };
    Constraint {
        from,
        to,
        lower: bound(&window.lower),
        upper: bound(&window.upper),
        reason: Reason::Given,
    }
}

/// Returns the plan with the times of a schedule of its network.
fn with_times(
    plan: &TimeTriggeredPlan,
    network: &StnPlan,
    instances: &[InstanceId],
    schedule: &Schedule,
) -> TimeTriggeredPlan {
    let mut plan = plan.clone();
    for (step, &instance) in plan.steps.iter_mut().zip(instances) {
        let (start, end) = (network.start(instance), network.end(instance));
        step.start = schedule[start].clone();
        if let Some(duration) = &mut step.duration {
            *duration = &schedule[end] - &schedule[start];
        }
    }
    plan
}

/// Returns the number between two limits that is nearest to a value.
fn clamped(value: &Rational, least: Option<&Rational>, most: Option<&Rational>) -> Rational {
    let value = least.map_or(value, |least| value.max(least));
    most.map_or(value, |most| value.min(most)).clone()
}

/// Returns the warning that an action overlaps itself, in the printed numbers and in those that are
/// used.
fn self_overlap(
    source: &Source,
    printed: &PrintedPlan,
    accepted: &TimeTriggeredPlan,
) -> Option<Diagnostic> {
    accepted.self_overlap()?;
    let [earlier, later] = printed.plan.self_overlap()?;
    let [first, second] = [earlier, later].map(|place| &printed.plan.steps[place]);
    let place = printed.steps.get(later);
    let place = place.map_or(0..0, |own| own.place.clone());
    let message = format!(
        "{} overlaps itself: it starts at {}, before the instance from {} to {} has ended",
        second.action.name,
        second.start.to_decimal(6),
        first.start.to_decimal(6),
        first.end().to_decimal(6),
    );
    let mut warning = Diagnostic::new(Severity::Warning, source, place, message);
    warning.advise(
        "PDDL allows it, but many planners and performers do not; `elbowroom plan` makes such plans only \
         with `--self-overlap`",
    );
    Some(warning)
}

/// Creates the warning that the plan differs from the printed numbers.
fn warning(source: &Source, printed: &PrintedPlan, violation: &Violation) -> Diagnostic {
    let step = violation.action.as_ref().map(|action| action.step);
    let place = step.and_then(|step| printed.steps.get(step));
    let place = place.map_or(0..0, |own| own.place.clone());
    let message = format!("{violation} with the printed numbers, which are assumed to be rounded");
    let mut warning = Diagnostic::new(Severity::Warning, source, place, message);
    warning.advise(
        "the plan is valid with numbers within one unit of the last printed digit, which are \
         used; `--tolerance 0` uses the printed numbers",
    );
    warning
}
