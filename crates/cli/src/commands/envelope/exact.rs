//! `elbowroom envelope --method exact`: the set of all values for which the plan works.

use std::fmt::Write as _;
use std::sync::Arc;

use elbowroom::answers::region::{
    BoxAnswer, Measure, Others, PictureError, PieceAnswer, Plane, RegionFinding, RegionOutcome,
    RegionSettings, partial_result, picture, region,
};
use elbowroom::answers::{EnvelopeRequest, Observer};

use super::{failure, specifications};
use crate::args::{self, EnvelopeArgs};
use crate::deadline::run_with_deadline;
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use crate::terminal::{ERROR, HINT, SECONDARY, SUCCESS, TextLayout, stdout_layout, styled};
use crate::time_limit::{Stopwatch, duration};
use elbowroom::report::console::push_wrapped;
use elbowroom_executive::messages::count_with_noun;

/// Maximum number of reasons printed for an inequality; `--json` has all.
const REASONS_SHOWN: usize = 2;
/// Maximum number of digits of a printed exact volume; larger volumes are printed as powers of ten.
const MAX_DIGITS: usize = 24;

/// Prints the region.
pub(super) fn run(arguments: &EnvelopeArgs, output: &mut Output) -> Answer {
    let limit = arguments.time_limit.as_ref().map(duration);
    let stopwatch = Stopwatch::start(&Interrupt::listen()).with_limit(limit);
    let task = input::task(&arguments.problem, &arguments.epsilon, output)?;
    let mut vary = specifications(&arguments.vary)?;
    vary.extend(specifications(&args::controllable(
        &arguments.controllable,
    ))?);
    let plan = input::any_plan(&task, &arguments.plan, &arguments.rounding(), output)?;
    let mut request = EnvelopeRequest {
        name: arguments.plan.display().to_string(),
        vary,
        enforce: arguments.enforce,
        ..EnvelopeRequest::new(&Arc::new(task), plan)
    };
    request.search.best.max_deviation = arguments.cap_or_default();
    let plane = requested_plane(arguments);
    let settings = RegionSettings {
        with_boxes: arguments.volume || plane.is_some(),
        with_volume: arguments.volume,
        seed: arguments.seed,
    };
    let mut watch = stopwatch.clone();
    let request = Arc::new(request);
    let (theirs, mut listener) = (Arc::clone(&request), watch.clone());
    let outcome = run_with_deadline(
        stopwatch,
        move || region(&theirs, &settings, &mut listener),
        |_| Ok(partial_result(&request)),
    )
    .map_err(failure)?;
    let drawn = draw(arguments, plane.as_ref(), &outcome, &mut watch);
    // The answer is printed even if the picture cannot be written.
    if arguments.json {
        output.document(&outcome.answer)?;
    } else {
        output::print(&text(&outcome, stdout_layout()))?;
        if matches!(outcome.answer.finding, RegionFinding::Invalid { .. }) {
            input::advise_repair();
        }
    }
    drawn?;
    Ok(match &outcome.answer.finding {
        RegionFinding::Region { pieces, .. } if !pieces.is_empty() => Exit::Yes,
        RegionFinding::None { .. } => Exit::Limit,
        _ => Exit::No,
    })
}

fn requested_plane(arguments: &EnvelopeArgs) -> Option<Plane> {
    let both = [
        (&arguments.slice, Others::Nominal),
        (&arguments.projection, Others::Any),
    ];
    both.into_iter().find_map(|(axes, others)| {
        let [x, y] = axes.as_deref()? else {
            return None;
        };
        Some(Plane {
            axes: [x.clone(), y.clone()],
            others,
        })
    })
}

/// Writes the picture, if there is one to write.
fn draw(
    arguments: &EnvelopeArgs,
    plane: Option<&Plane>,
    outcome: &RegionOutcome,
    watch: &mut Stopwatch,
) -> Result<(), Failure> {
    let (Some(path), Some(plane)) = (&arguments.picture, plane) else {
        return Ok(());
    };
    let flow = &mut || watch.flow().map_break(|_| ());
    match picture(outcome, plane, flow) {
        Ok(drawn) => output::write_file(path, &drawn.svg()),
        // The answer contains the reason.
        Err(PictureError::NoRegion) => Ok(()),
        Err(error @ PictureError::Limit(_)) => Err(Failure::new(
            error,
            "use --slice, or vary fewer quantities (--vary)",
        )),
        Err(error) => Err(Failure::new(error, "")),
    }
}

fn text(outcome: &RegionOutcome, look: TextLayout) -> String {
    let file = &outcome.answer.plan;
    let mut text = String::new();
    let mut say = |words: &str, indent: usize| push_wrapped(&mut text, words, indent, look.width);
    match &outcome.answer.finding {
        RegionFinding::Invalid { violation } => {
            say(
                &format!("{}: {file} does not work", styled(ERROR, "invalid")),
                0,
            );
            say(&violation.message, 2);
        }
        RegionFinding::Unscheduled => {
            say(&format!("{}: {file}", styled(ERROR, "no region")), 0);
            say(
                "The plan has no schedule at its nominal values. The region is computed for the \
                 order of happenings in such a schedule.",
                2,
            );
        }
        RegionFinding::None { reason } => {
            say(&format!("{}: {file}", styled(HINT, "undecided")), 0);
            say(&format!("{reason}."), 2);
        }
        RegionFinding::Region {
            parameters,
            pieces,
            missing,
            boxes,
            measure,
            timeline: _,
            inequalities: _,
        } => {
            if parameters.is_empty() {
                say(
                    &format!("{file}: no quantity of the plan may vary (--vary)."),
                    0,
                );
                return text;
            }
            match &pieces[..] {
                [] => say(
                    &format!("{}: {file} works for no values.", styled(ERROR, "empty")),
                    0,
                ),
                [_] => say(
                    &format!(
                        "{}: {file} works for all values that satisfy",
                        styled(SUCCESS, "exact")
                    ),
                    0,
                ),
                several => say(
                    &format!(
                        "{}: {file} works for all values that satisfy one of {}",
                        styled(SUCCESS, "exact"),
                        count_with_noun(several.len(), "list")
                    ),
                    0,
                ),
            }
            for (index, piece) in pieces.iter().enumerate() {
                if pieces.len() > 1 {
                    // Writing to a string cannot fail.
                    let _ = writeln!(text, "list {}", index + 1);
                }
                rows(piece, look, &mut text);
            }
            if let Some(missing) = missing {
                let words = format!("incomplete: the region may be larger, because {missing}");
                push_wrapped(&mut text, &words, 0, look.width);
            }
            text.push('\n');
            if let Some(measure) = measure {
                volume(measure, boxes, look, &mut text);
            }
            for parameter in parameters {
                let words = format!(
                    "{}: {}, nominal value {}",
                    parameter.name, parameter.quantity, parameter.nominal
                );
                push_wrapped(&mut text, &words, 0, look.width);
            }
        }
    }
    text
}

/// Appends the volume, and the shares of the boxes.
fn volume(measure: &Measure, boxes: &[BoxAnswer], look: TextLayout, text: &mut String) {
    let mut say = |words: &str| push_wrapped(text, words, 0, look.width);
    match (&measure.volume, measure.log10_interval) {
        (Some(volume), _) => {
            let exact = volume.0.to_string();
            let words = if exact.len() > MAX_DIGITS {
                format!(
                    "volume: 10^{:.2}, exact (--json has all digits)",
                    measure.log10
                )
            } else {
                format!("volume: {exact}")
            };
            say(&words);
        }
        (None, Some([lower, upper])) => say(&format!(
            "volume: 10^{:.2}, sampled: 95 % confidence interval 10^{lower:.2} to 10^{upper:.2}",
            measure.log10
        )),
        (None, None) => say(&format!("volume: 10^{:.2}", measure.log10)),
    }
    if !measure.unbounded.is_empty() {
        say(&format!(
            "Nothing bounds {}: values beyond --cap times the nominal value are not counted.",
            measure.unbounded.join(", ")
        ));
    }
    for own in boxes {
        let name = match own.name.as_str() {
            "irr" => "IRR's box",
            "least-slack" => "the box with the largest least slack",
            _ => "the box with the largest sum of widths",
        };
        let Some(share) = &own.share else {
            continue;
        };
        let words = match share.interval {
            None => format!("{name} covers {} of it", percent(share.decimal)),
            Some([lower, upper]) => format!(
                "{name} covers {} of it (95 % confidence interval {} to {})",
                percent(share.decimal),
                percent(lower),
                percent(upper)
            ),
        };
        say(&words);
    }
    text.push('\n');
}

/// Formats a percentage with two significant digits.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent >= 10.0 {
        format!("{percent:.0} %")
    } else if percent >= 0.01 {
        format!("{percent:.2} %")
    } else {
        format!("{percent:.1e} %")
    }
}

fn rows(piece: &PieceAnswer, look: TextLayout, text: &mut String) {
    for row in &piece.rows {
        push_wrapped(text, &row.text, 2, look.width);
        for reason in row.because.iter().take(REASONS_SHOWN) {
            let mut line = String::new();
            push_wrapped(&mut line, reason, 4, look.width);
            text.push_str(&styled(SECONDARY, line.trim_end()));
            text.push('\n');
        }
    }
}
