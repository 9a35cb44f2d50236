//! Reduction of cases to smaller ones with the same bug.

use elbowroom_model::problem::{Body, Condition, Effect, Expression, Unknown};
use elbowroom_plan::{Bound, BoxEnd, InstanceId, Node, ParameterId, ParameterKind};

use crate::second_oracle::case::{Case, box_of, instance_of};
use crate::second_oracle::contest::{Script, Step};
use crate::second_oracle::numbers;

/// Removes one part after the other as long as the script fails in the same way.
pub(crate) fn shrink(script: &Script, fails: &mut dyn FnMut(&Script) -> bool) -> Script {
    let mut script = script.clone();
    while let Some(smaller) = smaller(&script).into_iter().find(|smaller| fails(smaller)) {
        script = smaller;
    }
    script
}

fn smaller(script: &Script) -> Vec<Script> {
    let mut candidates = Vec::new();
    for index in 0..script.steps.len() {
        let mut candidate = script.clone();
        candidate.steps.remove(index);
        candidates.push(candidate);
    }
    let with_case = |case: Option<Case>| {
        case.map(|case| Script {
            case,
            steps: script.steps.clone(),
        })
    };
    let case = &script.case;
    let actions = case.problem.schemas.len();
    if actions > 1 {
        let smaller = (0..actions).map(|index| without_action(case, index));
        candidates.extend(smaller.filter_map(|case| with_case(Some(case))));
    }
    for index in 0..case.timed_times().len() {
        candidates.extend(with_case(without_timed(case, index)));
    }
    for index in 0..case.parameters.len() {
        candidates.push(without_parameter(script, index));
    }
    for index in 0..case.gaps.len() {
        let mut smaller = case.clone();
        smaller.gaps.remove(index);
        candidates.extend(with_case(Some(smaller)));
        for is_lower in [true, false] {
            let mut smaller = case.clone();
            let gap = &mut smaller.gaps[index];
            let bound = if is_lower {
                &mut gap.lower
            } else {
                &mut gap.upper
            };
            if *bound != Bound::Infinite {
                *bound = Bound::Infinite;
                candidates.extend(with_case(Some(smaller)));
            }
        }
    }
    candidates.extend(
        without_parts(case)
            .into_iter()
            .filter_map(|c| with_case(Some(c))),
    );
    candidates
}

fn without_action(case: &Case, removed: usize) -> Case {
    let mut case = case.clone();
    let moved = |id: InstanceId| InstanceId::from(id.index() - usize::from(id.index() > removed));
    let own = InstanceId::from(removed);
    for parameter in &mut case.parameters {
        if let ParameterKind::Duration(id) = parameter.kind {
            parameter.kind = if id == own {
                ParameterKind::Bound
            } else {
                ParameterKind::Duration(moved(id))
            };
        }
    }
    case.problem.schemas.remove(removed);
    case.gaps
        .retain(|gap| instance_of(gap.from) != Some(own) && instance_of(gap.to) != Some(own));
    for gap in &mut case.gaps {
        for node in [&mut gap.from, &mut gap.to] {
            *node = match *node {
                Node::Start(id) => Node::Start(moved(id)),
                Node::End(id) => Node::End(moved(id)),
                Node::Instant(id) => Node::Instant(moved(id)),
                other => other,
            };
        }
    }
    case
}

fn without_timed(case: &Case, removed: usize) -> Option<Case> {
    if case.timed.contains_key(&removed) {
        return None;
    }
    let mut case = case.clone();
    let times = case.timed_times();
    case.problem
        .timed
        .retain(|timed| timed.time != times[removed]);
    let moved = |group: usize| group - usize::from(group > removed);
    case.timed = case.timed.iter().map(|(&g, &id)| (moved(g), id)).collect();
    for parameter in &mut case.parameters {
        if let ParameterKind::Timed(group) = parameter.kind {
            parameter.kind = ParameterKind::Timed(moved(group));
        }
    }
    let is_removed = |node: Node| node == Node::Timed(removed);
    case.gaps
        .retain(|gap| !is_removed(gap.from) && !is_removed(gap.to));
    for gap in &mut case.gaps {
        for node in [&mut gap.from, &mut gap.to] {
            if let Node::Timed(group) = *node {
                *node = Node::Timed(moved(group));
            }
        }
    }
    Some(case)
}

/// Replaces a parameter by its nominal value.
fn without_parameter(script: &Script, removed: usize) -> Script {
    let mut script = script.clone();
    let case = &mut script.case;
    let nominal = case.parameters.remove(removed).nominal;
    let gone = ParameterId::from(removed);
    let moved = |id: ParameterId| ParameterId::from(id.index() - usize::from(id > gone));
    for gap in &mut case.gaps {
        for bound in [&mut gap.lower, &mut gap.upper] {
            if let Bound::Parameter(id) = *bound {
                *bound = if id == gone {
                    Bound::Finite(nominal.clone())
                } else {
                    Bound::Parameter(moved(id))
                };
            }
        }
    }
    numbers::visit(&mut case.problem, &mut |leaf| {
        if let Expression::Unknown(Unknown::Domain(index)) = leaf {
            let id = ParameterId(*index);
            if id == gone {
                *leaf = Expression::Constant(nominal.clone());
            } else {
                *index = moved(id).0;
            }
        }
    });
    case.initial.retain(|_, id| *id != gone);
    case.timed.retain(|_, id| *id != gone);
    for id in case.initial.values_mut().chain(case.timed.values_mut()) {
        *id = moved(*id);
    }
    script.steps.retain_mut(|step| match step {
        Step::Jump(envelope) | Step::Look(envelope) => {
            let mut intervals = envelope.intervals().to_vec();
            intervals.remove(removed);
            *envelope = box_of(intervals);
            true
        }
        Step::Widen { end, .. } | Step::LookWider { end, .. } => {
            let keeps = end.parameter != gone;
            *end = BoxEnd {
                parameter: moved(end.parameter),
                ..*end
            };
            keeps
        }
    });
    script
}

/// Returns the cases with one condition, effect or duration bound removed.
fn without_parts(case: &Case) -> Vec<Case> {
    let mut cases = Vec::new();
    let mut index = 0;
    loop {
        let mut smaller = case.clone();
        let mut left = index;
        let mut removed = remove_conjunct(&mut smaller.problem.goal, &mut left);
        for schema in &mut smaller.problem.schemas {
            removed = removed || remove_from_body(&mut schema.body, &mut left);
        }
        removed = removed || remove_nth(&mut smaller.problem.initial_facts, &mut left);
        removed = removed || remove_timed(&mut smaller, &mut left);
        if !removed {
            return cases;
        }
        cases.push(smaller);
        index += 1;
    }
}

/// Removes one of several changes of the same group.
fn remove_timed(case: &mut Case, left: &mut usize) -> bool {
    for index in 0..case.problem.timed.len() {
        let time = case.problem.timed[index].time.clone();
        let same = case.problem.timed.iter().filter(|t| t.time == time).count();
        if same > 1 {
            if *left == 0 {
                case.problem.timed.remove(index);
                return true;
            }
            *left -= 1;
        }
    }
    false
}

fn remove_from_body(body: &mut Body, left: &mut usize) -> bool {
    match body {
        Body::Instantaneous { condition, effects } => {
            remove_conjunct(condition, left) || remove_effect(effects, left)
        }
        Body::Durative {
            duration,
            at_start,
            over_all,
            at_end,
            start_effects,
            end_effects,
            continuous,
        } => {
            remove_nth(duration, left)
                || remove_conjunct(at_start, left)
                || remove_conjunct(over_all, left)
                || remove_conjunct(at_end, left)
                || remove_effect(start_effects, left)
                || remove_effect(end_effects, left)
                || remove_nth(continuous, left)
        }
    }
}

fn remove_effect(effects: &mut Vec<Effect>, left: &mut usize) -> bool {
    for effect in effects.iter_mut() {
        for guard in [&mut effect.guard.at_start, &mut effect.guard.now] {
            if !guard.is_trivial() {
                if *left == 0 {
                    *guard = Condition::TRUE;
                    return true;
                }
                *left -= 1;
            }
        }
    }
    remove_nth(effects, left)
}

fn remove_nth<T>(list: &mut Vec<T>, left: &mut usize) -> bool {
    if *left < list.len() {
        list.remove(*left);
        return true;
    }
    *left -= list.len();
    false
}

/// Removes a conjunct, or replaces it by one of its disjuncts.
fn remove_conjunct(condition: &mut Condition, left: &mut usize) -> bool {
    let Condition::And(parts) = condition else {
        return false;
    };
    for part in parts.iter_mut() {
        if let Condition::Or(alternatives) = part {
            if *left < alternatives.len() {
                *part = alternatives[*left].clone();
                return true;
            }
            *left -= alternatives.len();
        }
    }
    remove_nth(parts, left)
}
