//! Answers of an executive in words.

use std::fmt::Write as _;

use elbowroom::answers::exact::{INFINITY, MINUS_INFINITY};
use elbowroom::execution::GuaranteeLevel;
use elbowroom::num::{End, Rational};
use elbowroom::report::console::wrap;
use elbowroom::report::exact::Exact;
use elbowroom_executive::interface::documents::{
    Activity, EndedAction, GoalNow, GoalsNow, GuaranteeNow, HistoryNow, NextNow, PlanNow, State,
    StepNow, WhatIf,
};
use elbowroom_executive::messages::{count_with_noun, escape_control};

use crate::number::nearest;
use crate::terminal::{EMPHASIS, stdout_layout, styled};

pub(super) fn history(history: &HistoryNow) -> String {
    let goal = |goal: &GoalNow| {
        let words = goals(&GoalsNow {
            goals: vec![goal.clone()],
        });
        (goal.since.0.clone(), words)
    };
    let action = |it: &EndedAction| {
        let (since, end) = (nearest(&it.since.0), nearest(&it.end.0));
        (
            it.end.0.clone(),
            format!("{} {} from {since} to {end}\n", it.action, it.state),
        )
    };
    let goals = history.goals.iter().map(goal);
    let mut entries: Vec<_> = goals.chain(history.actions.iter().map(action)).collect();
    entries.sort_by(|one, other| other.0.cmp(&one.0));
    let mut text: String = entries.into_iter().map(|(_, words)| words).collect();
    if let Some(next) = &history.next {
        let _ = writeln!(text, "earlier ones: --before {}", next.0);
    }
    text
}

pub(super) fn what_if(answer: &WhatIf) -> String {
    let mut text = match &answer.done {
        Some(done) => format!("done at {}", nearest(&done.0)),
        None => answer.verdict.replace('-', " "),
    };
    let percent = |share: &Exact| format!("{} %", nearest(&(&share.0 * &Rational::from(100))));
    match (&answer.slack_now, &answer.slack_then) {
        (Some(now), Some(then)) => {
            let _ = write!(text, ", least slack {} to {}", percent(now), percent(then));
        }
        (None, Some(then)) => {
            let _ = write!(text, ", least slack {}", percent(then));
        }
        _ => {}
    }
    if let Some(why) = &answer.why {
        let _ = write!(text, ": {}", escape_control(why));
    }
    text.push('\n');
    for name in &answer.missed {
        let _ = writeln!(text, "  {} would be missed", escape_control(name));
    }
    text
}

pub(super) fn goals(goals: &GoalsNow) -> String {
    let mut text = String::new();
    for goal in &goals.goals {
        let name = escape_control(&goal.name);
        let state = styled(EMPHASIS, &goal.state.replace('-', " "));
        let since = nearest(&goal.since.0);
        let value = match &goal.value.0 {
            value if *value == Rational::ONE => String::new(),
            value => format!(", value {}", nearest(value)),
        };
        let time = |word: &str, time: &Option<Exact>| {
            let time = time.as_ref();
            time.map_or(String::new(), |it| format!(", {word} {}", nearest(&it.0)))
        };
        let (from, until) = (time("from", &goal.release), time("by", &goal.deadline));
        let keep = if goal.keep { ", to be kept" } else { "" };
        let author = goal.by.as_ref();
        let author = author.map_or(String::new(), |it| {
            format!(", given by {}", escape_control(it))
        });
        let mut line = format!(
            "{name}{value}{from}{until}{keep}{author}: {state} since {since}: {}",
            escape_control(&goal.goal)
        );
        if let Some(why) = &goal.why {
            let _ = write!(line, "; {}", escape_control(why));
        }
        let _ = writeln!(text, "{}", wrap(&line, stdout_layout().width, 2));
    }
    if text.is_empty() {
        text.push_str("there is no goal\n");
    }
    text
}

pub(super) fn state(state: &State) -> String {
    // The documents keep their older word.
    let activity = match state.activity {
        Activity::Resting => "idle".to_owned(),
        other => other.to_string(),
    };
    let mut text = format!(
        "{} at {}, plan {}",
        styled(EMPHASIS, &activity),
        nearest(&state.now.0),
        state.plans
    );
    if let Some(why) = &state.why {
        let _ = write!(text, ": {}", escape_control(why));
    }
    text.push('\n');
    if let Some(why) = &state.restarting {
        let why = format!("world restarting: {}", escape_control(why));
        let _ = writeln!(text, "{}", wrap(&why, stdout_layout().width, 2));
    }
    if let Some(seconds) = state.unanswered {
        let why = format!(
            "the world has not answered for {seconds} s: until it does, no action is started and \
             no request is processed"
        );
        let _ = writeln!(text, "{}", wrap(&why, stdout_layout().width, 2));
    }
    for goal in &state.goals {
        let (name, pddl) = (escape_control(&goal.name), escape_control(&goal.goal));
        let aside = goal.aside.as_ref();
        let aside = aside.map_or(String::new(), |why| {
            format!("; set aside: {}", escape_control(why))
        });
        let release = goal.release.as_ref();
        let release = release.map_or(String::new(), |it| {
            format!("; queued until {}", nearest(&it.0))
        });
        let keep = goal.keep.as_ref();
        let keep = keep.map_or(String::new(), |state| format!("; to be kept, {state}"));
        let _ = writeln!(text, "  goal {name}: {pddl}{aside}{keep}{release}");
    }
    for running in &state.running {
        let _ = write!(
            text,
            "  running {} (ticket {}) since {}",
            running.action,
            running.ticket,
            nearest(&running.since.0)
        );
        if let Some(planned) = &running.planned {
            let _ = write!(text, ", planned {}", nearest(&planned.0));
        }
        if let Some(times_out) = &running.times_out {
            let times_out = nearest(&times_out.0);
            let _ = write!(text, "; without progress, it times out at {times_out}");
        }
        if let Some(needed) = &running.needed {
            let _ = write!(
                text,
                "; if it continues, a new plan is needed at {}",
                nearest(&needed.0)
            );
        }
        if let Some(note) = &running.note {
            let _ = write!(text, ": {}", escape_control(note));
        }
        text.push('\n');
    }
    for doubt in &state.in_doubt {
        let (name, since) = (escape_control(&doubt.name), nearest(&doubt.since.0));
        let line = format!(
            "{name} is in doubt since {since}: {}",
            escape_control(&doubt.why)
        );
        let _ = writeln!(text, "{}", wrap(&line, stdout_layout().width, 2));
    }
    let _ = writeln!(text, "  {}", count_with_noun(state.facts.len(), "fact"));
    for fact in &state.facts {
        let _ = writeln!(text, "    {fact}");
    }
    for number in &state.numbers {
        let _ = writeln!(text, "    {} = {}", number.fluent, nearest(&number.value.0));
    }
    text
}

fn step(step: &StepNow) -> String {
    let duration = step.duration.as_ref();
    let duration = duration.map_or(String::new(), |it| format!(" [{}]", nearest(&it.0)));
    format!(
        "{:>10}: {}{duration} {}",
        nearest(&step.start.0),
        step.action,
        step.state
    )
}

pub(super) fn plan(plan: &PlanNow) -> String {
    let mut text = match &plan.since {
        Some(since) => format!("plan {}, since {}\n", plan.plans, nearest(&since.0)),
        None => "there is no plan\n".to_owned(),
    };
    for own in &plan.steps {
        let _ = writeln!(text, "{}", step(own));
    }
    text
}

pub(super) fn guarantee(guarantee: &GuaranteeNow) -> String {
    let promise = guarantee.promise.as_deref();
    let mut known = GuaranteeLevel::TERMS.iter();
    let level = known.find(|(_, name, _)| Some(*name) == promise);
    let name = match level {
        Some((level, ..)) => level.label(),
        None if promise.is_some() => GuaranteeLevel::Luck.label(),
        None => "none",
    };
    let condition = level.and_then(|(level, ..)| level.condition());
    let mut text = format!("guarantee: {name}");
    if let Some(since) = &guarantee.since {
        let _ = write!(text, ", since {}", nearest(&since.0));
    }
    text.push('\n');
    if let Some(deviation) = &guarantee.deviation {
        let _ = writeln!(text, "  last deviation: {}", escape_control(deviation));
    }
    if let Some(condition) = condition {
        let before = match guarantee.timeout.as_str() {
            "none" => "",
            _ => " and each action ends before its time-out",
        };
        let _ = writeln!(text, "  the plan works as long as {condition}{before}");
    }
    if guarantee.durations == "believed" {
        text.push_str("  planned with the mean durations of the believed world\n");
    }
    let end = |end: &End, infinity: &str| end.value().map_or(infinity.to_owned(), nearest);
    for room in &guarantee.parameters {
        let nominal = nearest(&room.nominal.0);
        let _ = write!(text, "  {}, {}: planned {nominal}", room.name, room.meaning);
        if let (Some(least), Some(most)) = (&room.least, &room.most) {
            let (least, most) = (end(&least.0, MINUS_INFINITY), end(&most.0, INFINITY));
            let _ = write!(text, ", from {least} to {most}");
        }
        if let Some(timeout) = &room.timeout {
            let _ = write!(text, ", time-out {}", nearest(&timeout.0));
        }
        text.push('\n');
    }
    text
}

pub(super) fn next(next: &NextNow) -> String {
    let mut text = next
        .decision
        .as_deref()
        .unwrap_or("no decision yet")
        .to_owned();
    if let Some(until) = &next.until {
        let _ = write!(text, " until {}", nearest(&until.0));
    }
    if let Some(why) = &next.why {
        let _ = write!(text, ": {}", escape_control(why));
    }
    text.push('\n');
    if let Some(own) = &next.step {
        let _ = writeln!(text, "{}", step(own));
    }
    text
}
