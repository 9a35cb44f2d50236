//! Page of the region: all values for which a plan works.

mod one_at_a_time;

use elbowroom::answers::envelope::Quantity;
use elbowroom::answers::region::{
    BoxAnswer, Measure, PieceAnswer, RegionAnswer, RegionFinding, RowAnswer, Share,
};
use elbowroom::num::{End, Rational};
use elbowroom::report::decimal::nearest;
use std::collections::BTreeMap;

use crate::document::{
    Document, Plane, PlaneBox, PlaneQuantity, PlaneRow, Section, Table, Texts, Tone, Verdict,
};
use crate::plan::{
    SliderInterval, chart, name_of, negative_verdict, positive_verdict, prose, quantities,
    repair_advice, sliders, times,
};
use one_at_a_time::{IntervalWithOthersFixed, reach};

/// Maximum number of quantities.
const MAX_TABLE_ROWS: usize = 100;

/// The page about a region.
pub(crate) fn region(answer: &RegionAnswer) -> Document {
    let mut texts = Texts::default();
    let mut facts = vec![
        ("domain".to_owned(), answer.domain.clone()),
        ("problem".to_owned(), answer.problem.clone()),
        ("plan".to_owned(), answer.plan.clone()),
        ("epsilon".to_owned(), nearest(&answer.epsilon)),
    ];
    let mut sections = Vec::new();
    let verdict = match &answer.finding {
        RegionFinding::Region {
            parameters,
            pieces,
            missing,
            boxes,
            measure,
            timeline,
            inequalities,
        } => {
            if let Some(timeline) = timeline {
                sections.push(Section::Chart(chart(timeline, &[], &mut texts)));
                let alone: Vec<IntervalWithOthersFixed> = (0..parameters.len())
                    .map(|place| IntervalWithOthersFixed::of(parameters, pieces, place))
                    .collect();
                let reaches: Vec<SliderInterval<'_>> =
                    alone.iter().zip(parameters).map(reach).collect();
                let sliders = inequalities
                    .as_ref()
                    .and_then(|it| sliders(timeline, &reaches, it));
                sections.extend(sliders.map(Section::Sliders));
            }
            if !parameters.is_empty() && parameters.len() <= MAX_TABLE_ROWS && !pieces.is_empty() {
                sections.push(Section::Plane(plane(parameters, pieces, boxes)));
            }
            if let Some(measure) = measure {
                facts.push(("volume".to_owned(), volume(measure)));
                sections.extend(shares(boxes));
            }
            sections.push(Section::Table(rows(pieces, &mut texts)));
            sections.push(Section::Table(quantities(parameters)));
            sections.extend(
                timeline
                    .as_ref()
                    .map(|it| Section::Table(times(it, "for which the plan works"))),
            );
            match (&pieces[..], missing) {
                ([], _) => negative_verdict("The plan fails for all values."),
                (_, Some(missing)) => positive_verdict(&format!(
                    "The plan works with all values below. The list may be incomplete: {missing}."
                )),
                ([_], None) => positive_verdict(
                    "The plan works with all values that satisfy the inequalities below.",
                ),
                (several, None) => positive_verdict(&format!(
                    "The plan works with all values that satisfy one of {} lists of inequalities.",
                    several.len()
                )),
            }
        }
        RegionFinding::Invalid { violation } => {
            sections.push(prose("Violation", vec![violation.message.clone()]));
            sections.push(repair_advice());
            negative_verdict("The plan is not valid.")
        }
        RegionFinding::Unscheduled => {
            negative_verdict("The plan has no schedule at its nominal values.")
        }
        RegionFinding::None { reason } => Verdict {
            tone: Tone::Plain,
            words: format!("The region is not known: {reason}."),
        },
    };
    Document {
        title: format!(
            "Feasible region of {}",
            name_of(&answer.plan, &answer.problem)
        ),
        verdict,
        facts,
        sections,
        texts: texts.into_texts(),
        is_paused: false,
        more: Vec::new(),
    }
}

fn plane(parameters: &[Quantity], pieces: &[PieceAnswer], boxes: &[BoxAnswer]) -> Plane {
    let places: BTreeMap<&str, usize> = parameters
        .iter()
        .enumerate()
        .map(|(place, it)| (it.name.as_str(), place))
        .collect();
    let piece = |piece: &PieceAnswer| {
        let row = |row: &RowAnswer| PlaneRow {
            factors: row
                .factors
                .iter()
                .filter_map(|(name, factor)| Some((*places.get(name.as_str())?, factor.0.to_f64())))
                .collect(),
            bound: row.bound.to_f64(),
        };
        piece.rows.iter().map(row).collect()
    };
    let drawn = |own: &BoxAnswer| PlaneBox {
        name: box_name(&own.name).to_owned(),
        intervals: parameters
            .iter()
            .map(|parameter| {
                let interval = own.intervals.get(&parameter.name);
                let end = |end: &End| end.value().map(Rational::to_f64);
                interval.map_or((None, None), |it| (end(&it.lower), end(&it.upper)))
            })
            .collect(),
    };
    let boxes: Vec<PlaneBox> = boxes.iter().map(drawn).collect();
    let pieces: Vec<Vec<PlaneRow>> = pieces.iter().map(piece).collect();
    let all: Vec<f64> = parameters.iter().map(|it| it.nominal.to_f64()).collect();
    let quantity = |(place, parameter): (usize, &Quantity)| {
        let nominal = parameter.nominal.to_f64();
        let size = nominal.abs().max(1.0);
        // The axis covers the boxes, and the values for which the plan works with the others as
        // planned, unless these are too far away to show the rest.
        let far = 4.0 * size;
        let near = |value: &f64| (value - nominal).abs() <= far;
        let intervals = || boxes.iter().map(|own| own.intervals[place]);
        let lower = intervals().filter_map(|(lower, _)| lower).filter(near);
        let upper = intervals().filter_map(|(_, upper)| upper).filter(near);
        let alone = || {
            ends_with_others_fixed(&pieces, &all, place)
                .into_iter()
                .filter(near)
        };
        let from = lower.chain(alone()).fold(nominal - size, f64::min);
        let to = upper.chain(alone()).fold(nominal + 1.5 * size, f64::max);
        // Durations are not negative.
        let from = if nominal >= 0.0 { from.max(0.0) } else { from };
        PlaneQuantity {
            name: parameter.name.clone(),
            quantity: parameter.quantity.clone(),
            nominal,
            from,
            to: to + (to - from) / 20.0,
        }
    };
    let quantities = parameters.iter().enumerate().map(quantity).collect();
    Plane {
        heading: "Two quantities at a time".to_owned(),
        note: "Feasible values of two quantities. The other quantities have the values of the \
               sliders."
            .to_owned(),
        quantities,
        pieces,
        boxes,
    }
}

/// Returns the values at which rows limit a quantity while the others have these values.
fn ends_with_others_fixed(pieces: &[Vec<PlaneRow>], values: &[f64], place: usize) -> Vec<f64> {
    let end = |row: &PlaneRow| {
        let own = row.factors.iter().find(|(index, _)| *index == place)?.1;
        let others = row.factors.iter().filter(|(index, _)| *index != place);
        let taken: f64 = others.map(|(index, factor)| factor * values[*index]).sum();
        Some((row.bound - taken) / own)
    };
    pieces.iter().flatten().filter_map(end).collect()
}

fn box_name(name: &str) -> &str {
    match name {
        "irr" => "IRR's box",
        "least-slack" => "the box with the best least slack",
        "widths" => "the box with the best sum of widths",
        other => other,
    }
}

fn rows(pieces: &[PieceAnswer], texts: &mut Texts) -> Table {
    let several = pieces.len() > 1;
    let mut rows = Vec::new();
    for (index, piece) in pieces.iter().enumerate() {
        for row in &piece.rows {
            let mut cells = Vec::new();
            if several {
                cells.push((index + 1).to_string().into());
            }
            cells.push(row.text.as_str().into());
            cells.push(texts.share(&row.because.join("; ")));
            rows.push(cells);
        }
    }
    let mut columns = Vec::new();
    if several {
        columns.push(("list".to_owned(), true));
    }
    columns.push(("inequality".to_owned(), false));
    columns.push(("source".to_owned(), false));
    Table {
        heading: "Inequalities".to_owned(),
        columns,
        rows,
        ..Table::default()
    }
}

fn volume(measure: &Measure) -> String {
    match (&measure.volume, measure.log10_interval) {
        (Some(volume), _) if volume.0.to_string().len() <= 24 => volume.0.to_string(),
        (None, Some([lower, upper])) => {
            format!(
                "10^{:.2}, 95 % interval 10^{lower:.2} to 10^{upper:.2}",
                measure.log10
            )
        }
        _ => format!("10^{:.2}", measure.log10),
    }
}

/// Builds the table of each box's share of the region's volume.
fn shares(boxes: &[BoxAnswer]) -> Option<Section> {
    let percent = |share: f64| {
        let percent = 100.0 * share;
        if percent >= 0.01 {
            format!("{percent:.2} %")
        } else {
            format!("{percent:.1e} %")
        }
    };
    let words = |share: &Share| match share.interval {
        None => percent(share.decimal),
        Some([lower, upper]) => format!(
            "{}, 95 % interval {} to {}",
            percent(share.decimal),
            percent(lower),
            percent(upper)
        ),
    };
    let rows: Vec<_> = boxes
        .iter()
        .filter_map(|own| {
            let share = own.share.as_ref()?;
            Some(vec![box_name(&own.name).into(), words(share).into()])
        })
        .collect();
    (!rows.is_empty()).then(|| {
        Section::Table(Table {
            heading: "Share of the region in each box".to_owned(),
            columns: vec![
                ("box".to_owned(), false),
                ("share of the volume".to_owned(), false),
            ],
            rows,
            ..Table::default()
        })
    })
}
