//! Content of a page as data, read by the script in the page.
//!
//! Numbers are approximate and used for drawing only. Displayed values are texts, computed exactly.

use std::collections::BTreeMap;

use elbowroom::answers::envelope::Inequalities;
use serde::Serialize;

/// A page.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Document {
    /// The heading.
    pub title: String,
    /// The answer in one line.
    pub verdict: Verdict,
    /// The subject of the page: names and values.
    pub facts: Vec<(String, String)>,
    /// The sections, from top to bottom.
    pub sections: Vec<Section>,
    /// Texts that occur often; see [`Text`].
    pub texts: Vec<String>,
    /// `true` for a run that is paused.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_paused: bool,
    /// Subpages, linked from rows of tables ([`Table::opens`]).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub more: Vec<Document>,
}

/// The answer in one line.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// The tone, which determines the colour.
    pub tone: Tone,
    /// The words.
    pub words: String,
}

/// Tone of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    /// Positive.
    Good,
    /// Negative.
    Bad,
    /// Neutral.
    Plain,
}

/// A text, or the position of one that occurs often in [`Document::texts`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Text {
    /// The text itself.
    Own(String),
    /// Its position in [`Document::texts`].
    Shared(usize),
}

impl From<String> for Text {
    fn from(text: String) -> Self {
        Self::Own(text)
    }
}

impl From<&str> for Text {
    fn from(text: &str) -> Self {
        Self::Own(text.to_owned())
    }
}

/// Texts that occur often, each once.
#[derive(Debug, Default)]
pub(crate) struct Texts {
    texts: Vec<String>,
    positions: BTreeMap<String, usize>,
}

impl Texts {
    /// Returns a reference to the text, which is added if it is new.
    pub(crate) fn share(&mut self, text: &str) -> Text {
        if let Some(&position) = self.positions.get(text) {
            return Text::Shared(position);
        }
        let position = self.texts.len();
        self.texts.push(text.to_owned());
        self.positions.insert(text.to_owned(), position);
        Text::Shared(position)
    }

    pub(crate) fn into_texts(self) -> Vec<String> {
        self.texts
    }
}

/// A part of a page.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum Section {
    /// Actions in time.
    Chart(Chart),
    /// A table.
    Table(Table),
    /// Shares with their intervals.
    Rates(Rates),
    /// Numbers over time.
    Series(Series),
    /// Sliders for quantities, with their effects on the plan.
    Sliders(Sliders),
    /// Region of valid values, as a plot of two quantities.
    Plane(Plane),
    /// Sentences.
    Prose(Prose),
}

/// Timeline of actions, on lanes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Chart {
    /// The heading.
    pub heading: String,
    /// End of the time axis, which begins at 0.
    pub end: f64,
    /// The possible assignments of actions to lanes.
    pub groupings: Vec<Grouping>,
    /// Position of the initial grouping.
    pub chosen: usize,
    /// Names of the plans if there are several; see [`Bar::plan`].
    pub plans: Vec<String>,
    /// The actions.
    pub bars: Vec<Bar>,
    /// Deadlines and other moments.
    pub marks: Vec<Mark>,
    /// The orderings of the plans: positions of the earlier and of the later action in
    /// [`Chart::bars`].
    pub orderings: Vec<(usize, usize)>,
    /// The guarantee over time.
    pub guarantee: Vec<Segment>,
    /// The changes of facts and numbers, in order of time; only for a run. The page uses them to
    /// compute the state at any time.
    pub changes: Vec<Change>,
    /// The decisions, in order of time; only for a run.
    pub decisions: Vec<DecisionAt>,
    /// `true` if the actions were executed.
    pub is_run: bool,
}

/// An assignment of actions to lanes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Grouping {
    /// The kind of lane, such as `robot`.
    pub name: String,
    /// The lanes' names.
    pub lanes: Vec<String>,
}

/// An action of a chart.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Bar {
    /// The action.
    pub name: String,
    /// Planned start and end; equal for an instantaneous action.
    pub planned: Option<(f64, f64)>,
    /// Observed start and end.
    pub actual: Option<(f64, f64)>,
    /// Outcome: `succeeded`, `failed`, `cancelled`, `running`, or empty.
    pub outcome: &'static str,
    /// Earliest and latest start; `None` where there is no limit.
    pub starts: Option<(Option<f64>, Option<f64>)>,
    /// Earliest and latest end.
    pub ends: Option<(Option<f64>, Option<f64>)>,
    /// The lane in each grouping.
    pub lanes: Vec<usize>,
    /// Position of its plan in [`Chart::plans`].
    pub plan: usize,
    /// The details shown on hover: names and values.
    pub details: Vec<(&'static str, Text)>,
}

/// A marked moment on the time axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mark {
    /// Time of the moment.
    pub at: f64,
    /// The happening.
    pub name: String,
    /// `true` for an event of the run, `false` for a moment of the problem.
    pub is_event: bool,
}

/// A period with a constant guarantee.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Segment {
    /// Start of the period.
    pub from: f64,
    /// End of the period.
    pub to: f64,
    /// Level of the guarantee. 3: whole envelope; 2: part of the envelope; 1: planned durations
    /// only; 0: none, the plan may succeed by chance; -1: not applicable.
    pub level: i8,
    /// The guarantee in words.
    pub words: String,
}

/// A change of a fact or a number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Time of the change.
    pub at: f64,
    /// `fact` or `number`.
    pub kind: &'static str,
    /// Name of the fact or fluent.
    pub name: Text,
    /// New value; `None` for a fact that has become false.
    pub value: Option<String>,
}

/// A decision.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DecisionAt {
    /// Time of the decision.
    pub at: f64,
    /// The decision and its reason.
    pub words: String,
}

/// A table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Table {
    /// The heading.
    pub heading: String,
    /// A note on it.
    pub note: String,
    /// The columns: heading, and `true` if the column holds numbers.
    pub columns: Vec<(String, bool)>,
    /// The rows.
    pub rows: Vec<Vec<Text>>,
    /// The time of each row, in ascending order, if the rows are events of a run.
    pub times: Vec<f64>,
    /// For each row, the position of its action in the bars of the first chart, if rows are about
    /// actions.
    pub bars: Vec<usize>,
    /// For each row, the position of the linked page in [`Document::more`], if rows link to pages.
    pub opens: Vec<Option<usize>>,
}

/// Success rates with their confidence intervals.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Rates {
    /// The heading.
    pub heading: String,
    /// A note on them.
    pub note: String,
    /// The groups.
    pub groups: Vec<RateGroup>,
}

/// Rates that are compared with each other.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RateGroup {
    /// The property that the rates of the group share.
    pub name: String,
    /// The rates.
    pub rates: Vec<Rate>,
}

/// A rate with its confidence interval.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Rate {
    /// The name of the rate.
    pub name: String,
    /// Rate, lower and upper end of its interval, between 0 and 1; `None` without trials.
    pub share: Option<(f64, f64, f64)>,
    /// Reference value: a published rate, or the greatest possible one.
    pub mark: Option<f64>,
    /// The rate as text.
    pub words: String,
}

/// Numbers over time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Series {
    /// The heading.
    pub heading: String,
    /// End of the time axis.
    pub end: f64,
    /// One line for each number.
    pub lines: Vec<SeriesLine>,
}

/// A number over time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SeriesLine {
    /// Its name.
    pub name: String,
    /// Time and value, ordered by time; linear in between.
    pub points: Vec<(f64, f64)>,
    /// Its first, least, greatest and last value.
    pub words: String,
    /// Limits that conditions impose.
    pub limits: Vec<Limit>,
    /// Description of the smallest distance from a limit; `None` without limits.
    pub closest: Option<String>,
}

/// A limit of a number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// Start of the limit.
    pub from: f64,
    /// End of the limit; equal to `from` for a single moment.
    pub to: f64,
    /// The limit.
    pub value: f64,
    /// -1: lower bound; 1: upper bound; 0: required value.
    pub side: i8,
    /// The limit in words: `>= 20 during (drive rover depot shelf)`.
    pub words: String,
}

/// Sliders for quantities. The page decides in integer arithmetic if the plan works with the chosen
/// values.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Sliders {
    /// The heading.
    pub heading: String,
    /// Explanatory note.
    pub note: String,
    /// One slider for each quantity.
    pub sliders: Vec<Slider>,
    /// For each bar of the first chart, the time points of its start and end.
    pub bars: Vec<(usize, usize)>,
    /// Names of these bars.
    pub names: Vec<Text>,
    /// Inequalities that every schedule satisfies.
    pub system: Inequalities,
}

/// A slider for a quantity. Numbers are exact.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Slider {
    /// The parameter's name.
    pub name: String,
    /// Description of the quantity.
    pub quantity: String,
    /// The value as planned.
    pub nominal: String,
    /// Interval of guaranteed values, as text.
    pub guaranteed: String,
    /// Lower end of the slider.
    pub from: String,
    /// Upper end of the slider.
    pub to: String,
    /// Smallest change.
    pub step: String,
}

/// A region, plotted for two quantities at a time. Numbers are approximate and used for drawing
/// only.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Plane {
    /// The heading.
    pub heading: String,
    /// A note on it.
    pub note: String,
    /// The quantities.
    pub quantities: Vec<PlaneQuantity>,
    /// Polytopes whose union is the region: the plan works if all rows of at least one of them
    /// hold.
    pub pieces: Vec<Vec<PlaneRow>>,
    /// Boxes to draw.
    pub boxes: Vec<PlaneBox>,
}

/// A quantity of a region.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PlaneQuantity {
    /// The parameter's name.
    pub name: String,
    /// Description of the quantity.
    pub quantity: String,
    /// The value as planned.
    pub nominal: f64,
    /// Lower end of its axis.
    pub from: f64,
    /// Upper end of its axis.
    pub to: f64,
}

/// `Σ factor · quantity <= bound`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PlaneRow {
    /// Positions of quantities with their factors.
    pub factors: Vec<(usize, f64)>,
    /// The upper bound of the sum.
    pub bound: f64,
}

/// A box to draw.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PlaneBox {
    /// The name.
    pub name: String,
    /// Lower and upper end for each quantity; `None` if unbounded.
    pub intervals: Vec<(Option<f64>, Option<f64>)>,
}

/// Sentences.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Prose {
    /// The heading.
    pub heading: String,
    /// One paragraph each.
    pub paragraphs: Vec<String>,
}
