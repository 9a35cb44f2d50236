//! Bounds that make every schedule of a deordered plan valid, as loose as possible.
//!
//! Deordering keeps the orderings that facts require. Conditions on numbers may require more, for
//! example that a pump starts within some time after another one. The soundness check finds the
//! differences of times that matter ([`pin_until_sound`]). They are first fixed to their values in
//! the plan, which is always sufficient. Then the ends of these pins are moved outwards
//! alternately, together with those of the open durations, as long as every schedule works. So the
//! pins and the durations share the slack.

use elbowroom_model::Task;
use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::deorder::{
    keeps_all_that_is_read, pin_until_sound, with_compatible_sides, with_permanent_sides,
    without_sides,
};
use elbowroom_plan::{
    Bound, BoxEnd, Constraint, DecoupledEnvelope, InstanceId, Node, NodeId, Parameter, ParameterId,
    ParameterKind, ParametrizedPlan, Reason, Schedule, Side, StnPlan,
};

use crate::linear::Factor;
use crate::obligations::Requirement;
use crate::soundness::{Broken, SoundBox, broken_in};

/// Does the same as [`pin`] for a deordered plan, which often needs no further bounds.
pub fn pin_deordered(task: &Task, plan: ParametrizedPlan, nominal: &Schedule) -> ParametrizedPlan {
    if keeps_all_that_is_read(task, &plan, nominal) {
        return plan;
    }
    pin(task, &plan, nominal)
}

/// Returns the plan with as few fixed differences as possible, and with bounds as loose as
/// possible, such that every nominal schedule works. If fixing all of them is not sufficient, the
/// box check reports the problem later.
pub fn pin(task: &Task, plan: &ParametrizedPlan, nominal: &Schedule) -> ParametrizedPlan {
    // Too many open sides would lead to too many cases.
    let is_manageable = most_sides(&plan.plan) <= MAX_SIDES;
    if is_manageable && let Some(found) = pinned(task, plan, nominal) {
        return found;
    }
    let sided = |sided: fn(StnPlan) -> StnPlan| ParametrizedPlan {
        plan: sided(plan.plan.clone()),
        ..plan.clone()
    };
    if let Some(found) = pinned(task, &sided(with_compatible_sides), nominal) {
        return found;
    }
    let all = sided(with_permanent_sides);
    pinned(task, &all, nominal).unwrap_or(all)
}

/// Returns the plan of a problem with processes and events with all its happenings in their order.
/// Each happening keeps its distance from the one before it, within bounds that keep every schedule
/// valid. Ends of actions with open durations keep only the order.
pub fn pin_in_order(
    task: &Task,
    mut plan: ParametrizedPlan,
    nominal: &Schedule,
) -> ParametrizedPlan {
    plan.plan = without_sides(plan.plan).0;
    let given = plan.plan.constraints.len();
    let is_open = |instance: InstanceId| {
        let parameters = &mut plan.parameters.iter();
        parameters.any(|own| own.kind == ParameterKind::Duration(instance))
    };
    let mut order: Vec<NodeId> = plan.plan.nodes().map(|(node, _)| node).collect();
    order.sort_by(|a, b| nominal[*a].cmp(&nominal[*b]).then(a.cmp(b)));
    let mut pins = Vec::new();
    for (&from, &to) in order.iter().zip(order.iter().skip(1)) {
        let distance = &nominal[to] - &nominal[from];
        let what = plan.plan.nodes[to.index()];
        let is_chosen = match what {
            Node::Zero | Node::Timed(_) => false,
            Node::Start(_) | Node::Instant(_) => true,
            Node::End(instance) => !is_open(instance),
        };
        let least = task.epsilon().clone().min(distance.clone());
        if !matches!(what, Node::Timed(_)) || !matches!(plan.plan.nodes[from.index()], Node::Zero) {
            pins.push((from, to, least, None));
        }
        if is_chosen {
            pins.push((from, to, distance.clone(), Some(distance)));
        }
    }
    // Mere orderings come first; they are not loosened.
    pins.sort_by_key(|(_, _, _, upper)| upper.is_some());
    let orders = pins
        .iter()
        .filter(|(_, _, _, upper)| upper.is_none())
        .count();
    let constraints = pins.into_iter().map(|(from, to, lower, upper)| Constraint {
        from,
        to,
        lower: Bound::Finite(lower),
        upper: upper.map_or(Bound::Infinite, Bound::Finite),
        reason: Reason::Pinned,
    });
    plan.plan.constraints.extend(constraints);
    let scale = longest(&plan.plan, nominal);
    loosened(task, plan, given + orders, &scale)
}

/// Maximum number of open sides of one time point.
const MAX_SIDES: usize = 12;

/// Returns the greatest number of sides of one time point.
fn most_sides(plan: &StnPlan) -> usize {
    let mut counts = vec![0_usize; plan.nodes.len()];
    let sides = plan.constraints.iter();
    for side in sides.filter(|constraint| constraint.reason == Reason::Side) {
        counts[side.from.index()] += 1;
        counts[side.to.index()] += 1;
    }
    counts.into_iter().max().unwrap_or(0)
}

/// Returns the plan with pins, without redundant ones, as loose as possible; `None` if the
/// soundness is undecided.
fn pinned(task: &Task, plan: &ParametrizedPlan, nominal: &Schedule) -> Option<ParametrizedPlan> {
    let mut free = plan.clone();
    free.plan = without_sides(free.plan).0;
    let given = free.plan.constraints.len();
    let with_pins = |fixed: &StnPlan| {
        let mut candidate = free.clone();
        let pins = fixed.constraints[given..].iter().cloned();
        candidate.plan.constraints.extend(pins);
        candidate
    };
    let point = DecoupledEnvelope::point(&plan.nominal());
    let mut is_refused = false;
    let mut oracle = |fixed: &StnPlan| {
        let candidate = with_pins(fixed);
        let broken = broken_in(task, &candidate, &point);
        is_refused |= broken.is_err();
        let broken = broken.ok().flatten()?;
        Some(nodes_of(&broken, candidate.plan.nodes.len()))
    };
    let at_nominal = plan.plan.at(&plan.nominal());
    let fixed = pin_until_sound(at_nominal, nominal, &mut oracle)?;
    let scale = longest(&plan.plan, nominal);
    (!is_refused).then(|| loosened(task, with_pins(&fixed), given, &scale))
}

/// Returns the longest duration of an action.
fn longest(plan: &StnPlan, nominal: &Schedule) -> Rational {
    let durations = plan.instances.iter().enumerate().map(|(index, _)| {
        let id = InstanceId::from(index);
        &nominal[plan.end(id)] - &nominal[plan.start(id)]
    });
    durations.max().unwrap_or_default()
}

/// Returns the time points of a violated obligation.
fn nodes_of(broken: &Broken, count: usize) -> Vec<NodeId> {
    let differences = broken.case.differences.iter();
    let mut nodes: Vec<NodeId> = differences
        .flat_map(|difference| [difference.from, difference.to])
        .collect();
    for inequality in &broken.case.inequalities {
        let expression = &inequality.expression;
        nodes.extend(expression.times.keys());
        nodes.extend(
            expression
                .products
                .keys()
                .filter_map(|(_, factor)| match factor {
                    Factor::Time(node) => Some(node),
                    Factor::Parameter(_) => None,
                }),
        );
    }
    // The moment inside an over-all condition is not a node of the plan.
    nodes.retain(|node| node.index() < count);
    if let Requirement::Condition { node, .. }
    | Requirement::Defined { node, .. }
    | Requirement::SingleUpdate { node, .. } = broken.requirement
    {
        nodes.push(node);
    }
    nodes
}

/// Returns the plan with loosened bounds in its constraints from number `given` on.
fn loosened(
    task: &Task,
    plan: ParametrizedPlan,
    given: usize,
    scale: &Rational,
) -> ParametrizedPlan {
    let mut open = plan.clone();
    let mut pins = Vec::new();
    // Closed durations keep their planned values if there are open quantities.
    let stays = |constraint: &Constraint| {
        let node = |id: NodeId| plan.plan.nodes[id.index()];
        let ends = (node(constraint.from), node(constraint.to));
        !plan.parameters.is_empty()
            && matches!(ends, (Node::Start(from), Node::End(to)) if from == to)
    };
    for (index, constraint) in open.plan.constraints.iter_mut().enumerate().skip(given) {
        let Bound::Finite(least) = &constraint.lower else {
            continue;
        };
        if stays(constraint) {
            continue;
        }
        let id = ParameterId::from(open.parameters.len());
        open.parameters.push(Parameter {
            name: format!("pin {index}"),
            kind: ParameterKind::Bound,
            nominal: least.clone(),
            weight: Rational::ONE,
            range: match constraint.upper {
                Bound::Infinite => Interval::at_most(least.clone()),
                _ => Interval::EVERYTHING,
            },
        });
        if constraint.lower == constraint.upper {
            constraint.upper = Bound::Parameter(id);
        }
        constraint.lower = Bound::Parameter(id);
        pins.push((index, id));
    }
    if pins.is_empty() {
        return plan;
    }
    let Ok(Some(sound)) = SoundBox::new(task, &open) else {
        return plan;
    };
    let mut growth = Growth {
        sound,
        plan: &open,
        checks: 0,
    };
    growth.run(scale, task.epsilon());
    for &(_, id) in &pins {
        growth.remove_infinite_ends(id);
    }
    let envelope = growth.sound.envelope();
    let mut loose = plan;
    for &(index, id) in &pins {
        let bound = |end: &End| end.value().cloned().map_or(Bound::Infinite, Bound::Finite);
        let interval = envelope.interval(id);
        let constraint = &mut loose.plan.constraints[index];
        constraint.lower = bound(&interval.lower);
        if constraint.upper != Bound::Infinite {
            constraint.upper = bound(&interval.upper);
        }
    }
    loose.plan.constraints.retain(|constraint| {
        let is_empty =
            (&constraint.lower, &constraint.upper) == (&Bound::Infinite, &Bound::Infinite);
        !is_empty || matches!(constraint.reason, Reason::Duration(_) | Reason::Timed(_))
    });
    loose
}

/// Maximum number of box checks; after that, bounds keep their values.
const MAX_CHECKS: usize = 2_000;

/// A box that is widened as long as every schedule works.
///
/// Unlike in an envelope, there need not be a schedule for each value of a pin; it is sufficient
/// that all schedules with that value work.
struct Growth<'a> {
    sound: SoundBox<'a>,
    plan: &'a ParametrizedPlan,
    checks: usize,
}

impl Growth<'_> {
    /// Moves all ends that are times outwards alternately, by decreasing steps: 500, 200, 100, 50,
    /// … down to ε, or to a thousandth of `scale` if there are several.
    fn run(&mut self, scale: &Rational, epsilon: &Rational) {
        let ends = self.ends();
        let is_shared = ends.len() > 2;
        let share = scale * &Rational::new(1, 1000);
        let steps = steps(scale, epsilon).into_iter();
        for step in steps.filter(|step| !is_shared || *step >= share) {
            let mut open = ends.clone();
            // Four steps of one size exceed the next larger one, which was rejected unless the end
            // is unlimited.
            for _ in 0..MAX_STEPS {
                open.retain(|&end| self.try_move(end, &step));
            }
        }
    }

    /// Returns the lower and upper ends of all parameters that are times between two happenings.
    fn ends(&self) -> Vec<BoxEnd> {
        let is_time = |parameter: &Parameter| {
            matches!(
                parameter.kind,
                ParameterKind::Duration(_) | ParameterKind::Bound
            )
        };
        let parameters = self.plan.parameters.iter().enumerate();
        parameters
            .filter(|(_, parameter)| is_time(parameter))
            .flat_map(|(index, _)| {
                Side::BOTH.map(|side| BoxEnd {
                    parameter: ParameterId::from(index),
                    side,
                })
            })
            .collect()
    }

    fn try_move(&mut self, end: BoxEnd, step: &Rational) -> bool {
        let Some(reach) = end.reach(self.sound.envelope()) else {
            return false;
        };
        let reach = reach + step;
        let border = end.side.reach(&self.plan.parameter(end.parameter).range);
        border.is_none_or(|border| reach <= border) && self.accepts(end, Some(reach))
    }

    fn accepts(&mut self, end: BoxEnd, reach: Option<Rational>) -> bool {
        self.checks += 1;
        self.checks <= MAX_CHECKS && self.sound.try_reach(end, reach).unwrap_or(false)
    }

    /// Removes the ends of a pin without a limit.
    fn remove_infinite_ends(&mut self, pin: ParameterId) {
        for side in Side::BOTH {
            let end = BoxEnd {
                parameter: pin,
                side,
            };
            self.accepts(end, None);
        }
    }
}

/// Maximum number of steps of one size for an end.
const MAX_STEPS: usize = 4;

/// Returns 5, 2 and 1 times each power of ten times `least`, from the first value up to `largest`
/// down to `least`.
fn steps(largest: &Rational, least: &Rational) -> Vec<Rational> {
    let ten = Rational::from(10);
    let mut unit = least.clone();
    let mut steps = Vec::new();
    while unit <= *largest {
        steps.extend([1, 2, 5].map(|factor| &unit * &Rational::from(factor)));
        unit = &unit * &ten;
    }
    steps.retain(|step| step <= largest);
    steps.reverse();
    steps
}
