//! Pictures of two parameters of a region.

use std::ops::ControlFlow;

use elbowroom_envelope::{ExactError, Polygon};
use elbowroom_num::Rational;
use elbowroom_plan::box_text::{self, BoxTextError};
use elbowroom_plan::{ParameterId, ParametrizedPlan};
use elbowroom_report::plane::PlanePicture;

use super::{RegionFinding, RegionOutcome};

/// Selection of a picture of a region.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plane {
    /// The horizontal and the vertical parameter, named as in boxes
    /// ([`parse_box`](elbowroom_plan::box_text::parse_box)).
    pub axes: [String; 2],
    /// Values of the other parameters.
    pub others: Others,
}

/// Values of the parameters that a picture does not show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Others {
    /// They have their nominal values: a slice.
    Nominal,
    /// They have any values inside the region: a projection.
    Any,
}

/// Reasons for a missing picture.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// There is no such parameter.
    #[error(transparent)]
    Name(#[from] BoxTextError),
    /// Both axes are the same.
    #[error("`{0}` is given for both axes of the picture, which needs two parameters")]
    Same(String),
    /// The projection exceeds a limit.
    #[error("no projection: {0}")]
    Limit(#[from] ExactError),
    /// There is no region.
    #[error("there is no region to draw")]
    NoRegion,
}

/// Draws a region, with the boxes of its answer.
///
/// # Errors
/// When a name is not one of the plan, there is no region, or a projection exceeds a limit or the
/// time allowed by `flow`.
pub fn picture(
    outcome: &RegionOutcome,
    plane: &Plane,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<PlanePicture, PictureError> {
    let (Some(plan), Some(region), RegionFinding::Region { boxes, .. }) =
        (&outcome.plan, &outcome.region, &outcome.answer.finding)
    else {
        return Err(PictureError::NoRegion);
    };
    let axes = [
        box_text::find(&plane.axes[0], plan)?,
        box_text::find(&plane.axes[1], plan)?,
    ];
    if axes[0] == axes[1] {
        return Err(PictureError::Same(plane.axes[0].clone()));
    }
    let nominal = plan.nominal();
    let flats = match plane.others {
        Others::Nominal => region.slice(axes, &|id| nominal[id].clone()),
        Others::Any => region.projection(axes, flow)?,
    };
    let names: Vec<String> = axes.iter().map(|id| label(plan, *id)).collect();
    let rectangles: Vec<(&str, Vec<[Option<&Rational>; 2]>)> = boxes
        .iter()
        .map(|own| {
            let ends = axes.map(|id| {
                let interval = &own.intervals[&plan.parameter(id).name];
                [interval.lower.value(), interval.upper.value()]
            });
            (own.name.as_str(), ends.to_vec())
        })
        .collect();
    let window = axes.map(|id| window(id, plan, axes, &flats, &rectangles));
    let [lower, upper] = [0, 1].map(|end| [window[0][end].clone(), window[1][end].clone()]);
    let float = |point: &[Rational; 2]| [point[0].to_f64(), point[1].to_f64()];
    let areas = flats.iter().map(|flat| flat.polygon(&lower, &upper));
    let areas = areas.filter(|corners| corners.len() > 2);
    let boxes = rectangles.iter().map(|(name, ends)| {
        let end = |side: usize, infinite: f64| {
            let value = |axis: usize| ends[axis][side].map_or(infinite, Rational::to_f64);
            [value(0), value(1)]
        };
        let corners = [end(0, f64::NEG_INFINITY), end(1, f64::INFINITY)];
        (box_name(name), corners)
    });
    let subtitle = match plane.others {
        Others::Nominal => "A slice: all other quantities at their nominal values",
        Others::Any => "A projection: for some values of all other quantities",
    };
    Ok(PlanePicture {
        title: format!("Where {} works", short_name(&outcome.answer.plan)),
        subtitle: subtitle.to_owned(),
        axes: [names[0].clone(), names[1].clone()],
        window: [float(&lower), float(&upper)],
        areas: areas.map(|area| area.iter().map(float).collect()).collect(),
        areas_name: "the plan works".to_owned(),
        boxes: boxes.collect(),
        point: Some(("as planned".to_owned(), axes.map(|id| nominal[id].to_f64()))),
    })
}

/// Returns the label of a box in pictures.
fn box_name(name: &str) -> String {
    match name {
        "irr" => "IRR's box".to_owned(),
        "least-slack" => "best least slack".to_owned(),
        "widths" => "best sum of widths".to_owned(),
        other => other.to_owned(),
    }
}

/// Returns the label of a parameter: `dur_0: (drive rover depot shelf)`.
fn label(plan: &ParametrizedPlan, id: ParameterId) -> String {
    let parameter = plan.parameter(id);
    match parameter.kind {
        elbowroom_plan::ParameterKind::Duration(instance) => {
            let action = &plan.plan.instance(instance).action.name;
            format!("{}: duration of {action}", parameter.name)
        }
        _ => parameter.name.clone(),
    }
}

/// Returns the ends of an axis. It covers the surroundings of the nominal value, the boxes, and the
/// parts of the region that are not much further away.
fn window(
    id: ParameterId,
    plan: &ParametrizedPlan,
    axes: [ParameterId; 2],
    flats: &[Polygon],
    rectangles: &[(&str, Vec<[Option<&Rational>; 2]>)],
) -> [Rational; 2] {
    let own = usize::from(axes[1] == id);
    let nominal = &plan.parameter(id).nominal;
    let room = nominal.abs().max(Rational::ONE);
    // At most three times the nominal value away from it; unbounded parts leave the picture there.
    let far = &room * Rational::from(3);
    let (least, most) = (nominal - &far, nominal + &far);
    let (mut from, mut to) = (nominal - &room, nominal + &room);
    let mut stretch = |value: &Rational| {
        if *value >= least && *value <= most {
            from = from.clone().min(value.clone());
            to = to.clone().max(value.clone());
        }
    };
    for (_, ends) in rectangles {
        ends[own].iter().flatten().for_each(|end| stretch(end));
    }
    let wide = axes.map(|id| {
        let nominal = &plan.parameter(id).nominal;
        let far = nominal.abs().max(Rational::ONE) * Rational::from(3);
        [nominal - &far, nominal + &far]
    });
    let lower = [wide[0][0].clone(), wide[1][0].clone()];
    let upper = [wide[0][1].clone(), wide[1][1].clone()];
    for flat in flats {
        for corner in flat.polygon(&lower, &upper) {
            stretch(&corner[own]);
        }
    }
    // The axis does not exceed the parameter's range: durations begin at zero.
    let range = &plan.parameter(id).range;
    if let Some(least) = range.lower.value()
        && from < *least
    {
        from = least.clone();
    }
    let margin = (&to - &from) * Rational::new(1, 20);
    [from - &margin, to + &margin]
}

/// Returns the last part of a path.
fn short_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}
