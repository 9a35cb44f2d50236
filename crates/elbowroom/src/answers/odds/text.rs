//! Text output of the success probability.

use std::fmt::Write as _;

use super::{
    BestOrderAnswer, ExecutedAnswer, LossAnswer, LossReason, Odds, OddsAnswer, OddsFinding,
    OrderAnswer, ValueAnswer,
};
use elbowroom_report::table::Table;

use elbowroom_report::console::{
    EMPHASIS, ERROR, HINT, TextLayout, count_with_noun, push_paragraph, styled,
};

/// Maximum number of losses, or of possible gains, that are listed.
const MAX_ROWS: usize = 12;

/// Minimum share that is listed.
const NEGLIGIBLE: f64 = 0.000_05;

impl OddsAnswer {
    /// Renders the answer as text for a console, with the facts that each happening needs if `with_layers`.
    pub fn text(&self, with_layers: bool, look: TextLayout) -> String {
        render(self, with_layers, look)
    }
}

fn render(answer: &OddsAnswer, with_layers: bool, look: TextLayout) -> String {
    match &answer.finding {
        OddsFinding::Odds(odds) => analysis_text(odds, with_layers, look),
        OddsFinding::NoOrder => {
            let label = styled(ERROR, "no order");
            format!("{label}: no order of the plan's actions can succeed\n")
        }
        OddsFinding::NoPlan => format!("{}: the problem has no plan\n", styled(ERROR, "no plan")),
        OddsFinding::None { reason } => format!("{reason}\n"),
        OddsFinding::Invalid { violation } => {
            let mut text = String::new();
            let words = format!(
                "{}: {}; `elbowroom check` explains why.",
                styled(ERROR, "not valid"),
                violation.message
            );
            push_paragraph(&mut text, &words, look.width);
            text
        }
    }
}

fn analysis_text(odds: &Odds, with_layers: bool, look: TextLayout) -> String {
    let order = &odds.order;
    let mut text = summary(order, look);
    steps(&mut text, order, with_layers, look);
    losses(&mut text, order, look);
    gains(&mut text, odds, look);
    if !odds.executed.is_empty() {
        executed(&mut text, &odds.executed, look);
    }
    text
}

fn summary(order: &OrderAnswer, look: TextLayout) -> String {
    let mut text = String::new();
    let title = format!("Succeeds with probability {}", number(order.probability));
    let _ = writeln!(text, "{}\n", styled(EMPHASIS, &title));
    let which = match (order.is_best, order.is_proven) {
        (false, _) => "This is the order of the plan's times.",
        (true, Some(true)) => "This is the best order of the plan's actions.",
        (true, _) => {
            "This is the best order found within the search limit; there may be a better one."
        }
    };
    let mut words = format!(
        "All happenings succeed with probability {}, P(A); and the goal holds after them with \
         {}, P(A and G). {which}",
        number(order.actions_probability),
        number(order.probability)
    );
    if !order.has_time {
        words.push_str(" Durations and timed initials admit no schedule in this order.");
    }
    if order.assumed_conditions > 0 {
        let count = count_with_noun(order.assumed_conditions, "condition");
        let _ = write!(
            words,
            " {count} on numbers that depend on the schedule were assumed to hold."
        );
    }
    push_paragraph(&mut text, &words, look.width);
    text
}

fn steps(text: &mut String, order: &OrderAnswer, with_layers: bool, look: TextLayout) {
    let mut headings = vec!["step", "happening", "earliest", "so far"];
    if with_layers {
        headings.push("needs");
    }
    let layer = |conditions: &[String]| conditions.join(" ");
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (at, happening) in order.happenings.iter().enumerate() {
        let earliest = happening.earliest.as_ref();
        let mut row = vec![
            (at + 1).to_string(),
            if happening.together {
                format!("{}, at the same moment", happening.what)
            } else {
                happening.what.clone()
            },
            earliest.map_or_else(|| "-".to_owned(), |time| time.to_decimal(3)),
            number(happening.probability_so_far),
        ];
        if with_layers {
            row.push(layer(&happening.layer.conditions));
        }
        rows.push(row);
    }
    let mut goal = vec![
        String::new(),
        "goal".to_owned(),
        String::new(),
        number(order.probability),
    ];
    if with_layers {
        goal.push(layer(&order.goal.conditions));
    }
    rows.push(goal);
    table(text, &headings, rows, look);
}

fn losses(text: &mut String, order: &OrderAnswer, look: TextLayout) {
    let mut losses: Vec<&LossAnswer> = order.losses.iter().collect();
    losses.sort_by(|a, b| b.mass.total_cmp(&a.mass));
    losses.retain(|loss| loss.mass >= NEGLIGIBLE);
    if losses.is_empty() {
        return;
    }
    heading(text, "Causes of failure");
    let others: f64 = losses.iter().skip(MAX_ROWS).map(|loss| loss.mass).sum();
    let mut rows: Vec<Vec<String>> = losses
        .iter()
        .take(MAX_ROWS)
        .map(|loss| vec![number(loss.mass), loss.at.clone(), reason(&loss.reason)])
        .collect();
    if losses.len() > MAX_ROWS {
        let elsewhere = format!("{} more", losses.len() - MAX_ROWS);
        rows.push(vec![number(others), elsewhere, String::new()]);
    }
    table(text, &["lost", "at", "cause"], rows, look);
}

fn reason(reason: &LossReason) -> String {
    let since = |condition: &str, since: &Option<String>| match since {
        Some(since) => format!("{condition} does not hold, last changed by {since}"),
        None => format!("{condition} no longer holds"),
    };
    match reason {
        LossReason::Start => "it does not start".to_owned(),
        LossReason::End => "it fails".to_owned(),
        LossReason::During { action } => format!("{action} fails while it is running"),
        LossReason::Condition {
            condition,
            since: by,
        } => since(condition, by),
        LossReason::Throughout {
            action,
            condition,
            since: by,
        } => {
            format!("{} during {action}", since(condition, by))
        }
        LossReason::Goal {
            condition,
            since: by,
        } => format!("goal: {}", since(condition, by)),
    }
}

fn gains(text: &mut String, odds: &Odds, look: TextLayout) {
    let order = &odds.order;
    let mut ways: Vec<(f64, String)> = Vec::new();
    for action in &order.actions {
        let name = &action.action;
        ways.push((action.if_certain, format!("{name} never failed")));
        let retried = action.if_retried.filter(|p| *p < action.if_certain);
        ways.extend(retried.map(|p| (p, format!("{name} were retried until it starts"))));
        let again = action.if_done_again.filter(|p| *p < action.if_certain);
        ways.extend(again.map(|p| (p, format!("{name} were repeated until it succeeds"))));
    }
    for fact in &order.facts {
        ways.push((
            fact.if_steady,
            format!("{} never changed by itself", fact.fact),
        ));
    }
    ways.retain(|(p, _)| *p - order.probability >= NEGLIGIBLE);
    ways.sort_by(|a, b| b.0.total_cmp(&a.0));
    ways.truncate(MAX_ROWS);
    heading(text, "Possible improvements");
    let row = |p: f64, what: String| vec![number(p), what];
    let mut rows: Vec<Vec<String>> = Vec::new();
    let mut unknown: Vec<(String, String)> = Vec::new();
    let mut value = |value: &ValueAnswer, what: &str| match value {
        ValueAnswer::Probability(p) => rows.push(row(*p, what.to_owned())),
        ValueAnswer::Bounds { lower, upper } => {
            // Four digits, rounded outwards.
            let (lower, upper) = ((lower * 1e4).floor() / 1e4, (upper * 1e4).ceil() / 1e4);
            let range = format!("{} to {}", number(lower), number(upper));
            rows.push(vec![range, format!("{what} (bounds)")]);
        }
        ValueAnswer::Unknown(why) => match unknown.iter_mut().find(|(_, known)| known == why) {
            Some((all, _)) => *all = format!("{all}, or {what}"),
            None => unknown.push((what.to_owned(), why.clone())),
        },
    };
    let gains = &odds.gains;
    value(
        &gains.any_action,
        "any actions, chosen according to the state",
    );
    value(
        &gains.as_the_state_asks,
        "the plan's actions, repeated or skipped according to the state",
    );
    let best = |best: &BestOrderAnswer, what: &str| {
        let perhaps = if best.is_proven { "" } else { " found" };
        row(best.probability, format!("{what}{perhaps}"))
    };
    if let Some(other) = &gains.planners_plan {
        rows.push(best(other, "another plan, in its best order"));
    }
    if let Some(other) = gains.best_order.as_ref().filter(|_| !order.is_best) {
        rows.push(best(other, "the best order of this plan"));
    }
    rows.extend(
        ways.into_iter()
            .map(|(p, what)| row(p, format!("if {what}"))),
    );
    table(text, &["P", "change"], rows, look);
    for (what, why) in unknown {
        let words = format!(
            "{}: gain not computed for {what}: {why}",
            styled(HINT, "note")
        );
        text.push('\n');
        push_paragraph(text, &words, look.width);
    }
}

fn executed(text: &mut String, all: &[ExecutedAnswer], look: TextLayout) {
    let samples = all.first().map_or(0, |one| one.samples);
    heading(text, &format!("Executed in {samples} samples of the world"));
    let rows = all.iter().map(|one| {
        let interval = one.interval.map_or_else(String::new, |(low, high)| {
            format!("{} to {}", number(low), number(high))
        });
        #[allow(clippy::cast_precision_loss, reason = "counts of samples")]
        let share = one.reached as f64 / one.samples.max(1) as f64;
        let end = one.ends.first().map(|end| {
            let cause = end.cause.as_deref().unwrap_or(&end.verdict);
            let action = end.action.as_deref().unwrap_or_default();
            format!("{}x {cause} {action}", end.samples)
                .trim_end()
                .to_owned()
        });
        let replans = if one.replans { "yes" } else { "no" };
        vec![
            one.executor.clone(),
            replans.to_owned(),
            number(share),
            interval,
            end.unwrap_or_default(),
        ]
    });
    let headings = [
        "executor",
        "new plans",
        "reached",
        "95 % interval",
        "main cause",
    ];
    table(text, &headings, rows.collect(), look);
}

fn heading(text: &mut String, words: &str) {
    let _ = writeln!(text, "\n{}", styled(EMPHASIS, words));
}

fn table(text: &mut String, headings: &[&str], rows: Vec<Vec<String>>, look: TextLayout) {
    let table = Table {
        caption: String::new(),
        headings: headings.iter().map(|it| (*it).to_owned()).collect(),
        keys: 1,
        rows,
        notes: Vec::new(),
    };
    text.push('\n');
    text.push_str(table.fit_to_width(look.width).trim_start_matches('\n'));
}

/// Formats a probability with four digits.
fn number(p: f64) -> String {
    format!("{p:.4}")
}
