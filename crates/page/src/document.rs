//! What a page shows, as data: what the script in the page reads.
//!
//! Numbers are for drawing; whatever is read is a text, and was worked out exactly.

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
    /// Whether this is a run that is paused.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_paused: bool,
    /// Pages that rows of tables lead to ([`Table::opens`]).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub more: Vec<Document>,
}

/// The answer in one line.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// How it looks.
    pub tone: Tone,
    /// The words.
    pub words: String,
}

/// How an answer is to be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    /// Yes.
    Good,
    /// No.
    Bad,
    /// Neither.
    Plain,
}

/// A text, or the position of one that occurs often in [`Document::texts`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Text {
    /// The text itself.
    Own(String),
    /// Its position.
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
    /// The text's position.
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
    /// Quantities to change, and what comes of it.
    Sliders(Sliders),
    /// Where a plan works, by two quantities at a time.
    Plane(Plane),
    /// Sentences.
    Prose(Prose),
}

/// Actions in time, on lanes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Chart {
    /// The heading.
    pub heading: String,
    /// Where the time axis ends; it begins at 0.
    pub end: f64,
    /// The ways to put the actions on lanes.
    pub groupings: Vec<Grouping>,
    /// The grouping to begin with.
    pub chosen: usize,
    /// The plans, by name, if there are several; [`Bar::plan`] says which one's an action is.
    pub plans: Vec<String>,
    /// The actions.
    pub bars: Vec<Bar>,
    /// Deadlines and other moments.
    pub marks: Vec<Mark>,
    /// The orderings of the plans: positions in [`Chart::bars`], the one that comes first, and the
    /// other.
    pub orderings: Vec<(usize, usize)>,
    /// The guarantee over time.
    pub guarantee: Vec<Segment>,
    /// The changes of facts and numbers in order of time, so that the state at any time can be
    /// shown; only of a run.
    pub changes: Vec<Change>,
    /// The decisions, in order of time; only of a run.
    pub decisions: Vec<DecisionAt>,
    /// Whether the actions were executed: there is a past to look at.
    pub is_run: bool,
}

/// A way to put actions on lanes.
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
    /// Real start and end.
    pub actual: Option<(f64, f64)>,
    /// How it came out: `succeeded`, `failed`, `cancelled`, `running`, or nothing.
    pub outcome: &'static str,
    /// The earliest and latest start; `None` where there is no limit.
    pub starts: Option<(Option<f64>, Option<f64>)>,
    /// The earliest and latest end.
    pub ends: Option<(Option<f64>, Option<f64>)>,
    /// The lane in each grouping.
    pub lanes: Vec<usize>,
    /// The plan that it belongs to.
    pub plan: usize,
    /// The details shown on hover: names and values.
    pub details: Vec<(&'static str, Text)>,
}

/// A moment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mark {
    /// When.
    pub at: f64,
    /// The happening.
    pub name: String,
    /// Whether it is a moment of the run, not one of the problem.
    pub is_event: bool,
}

/// A stretch of time with one guarantee.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Segment {
    /// From when on.
    pub from: f64,
    /// Until when.
    pub to: f64,
    /// 3: all of the envelope; 2: a part of it; 1: as planned; 0: luck; -1: none is made.
    pub level: i8,
    /// The guarantee in words.
    pub words: String,
}

/// A fact or a number that has changed, or an action that starts or ends.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// When.
    pub at: f64,
    /// `fact` or `number`.
    pub kind: &'static str,
    /// Which fact, fluent or action.
    pub name: Text,
    /// The new value; a fact that no longer holds has `None`.
    pub value: Option<String>,
}

/// A decision.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DecisionAt {
    /// When.
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
    /// The columns: their headings, and whether they hold numbers.
    pub columns: Vec<(String, bool)>,
    /// The rows.
    pub rows: Vec<Vec<Text>>,
    /// The time of each row, in ascending order, if the rows are events of a run.
    pub times: Vec<f64>,
    /// The bar of the first chart that each row is about, if rows are about actions.
    pub bars: Vec<usize>,
    /// For each row, the page that it leads to, by its position in [`Document::more`], if rows lead
    /// to pages.
    pub opens: Vec<Option<usize>>,
}

/// Shares with their intervals.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Rates {
    /// The heading.
    pub heading: String,
    /// A note on them.
    pub note: String,
    /// The groups.
    pub groups: Vec<RateGroup>,
}

/// Shares that are compared with each other.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RateGroup {
    /// The property that they share.
    pub name: String,
    /// The shares.
    pub rates: Vec<Rate>,
}

/// A share with its interval.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Rate {
    /// The name of the share.
    pub name: String,
    /// The share, its lower and its upper end, between 0 and 1; `None` if there was no trial.
    pub share: Option<(f64, f64, f64)>,
    /// A share to compare it with: a published one, or the greatest possible.
    pub mark: Option<f64>,
    /// The same in words.
    pub words: String,
}

/// Numbers over time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Series {
    /// The heading.
    pub heading: String,
    /// Where the time axis ends.
    pub end: f64,
    /// One line for each.
    pub lines: Vec<SeriesLine>,
}

/// A number over time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SeriesLine {
    /// Its name.
    pub name: String,
    /// Time and value, in order of time; between them, it changes evenly.
    pub points: Vec<(f64, f64)>,
    /// Its first, least, greatest and last value.
    pub words: String,
    /// Which values conditions allowed.
    pub limits: Vec<Limit>,
    /// Where it came closest to a limit, in words; `None` if there are no limits.
    pub closest: Option<String>,
}

/// A limit of a number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// Since when.
    pub from: f64,
    /// Until when; equal to `from` for a moment.
    pub to: f64,
    /// The limit.
    pub value: f64,
    /// -1: the number is not to be below it; 1: not above; 0: neither.
    pub side: i8,
    /// The limit in words: `>= 20 during (drive rover depot shelf)`.
    pub words: String,
}

/// Quantities to change. Whether the plan works with the values chosen is worked out on the page,
/// in whole numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Sliders {
    /// The heading.
    pub heading: String,
    /// What there is to say about them.
    pub note: String,
    /// One for each quantity.
    pub sliders: Vec<Slider>,
    /// For each bar of the first chart, the time points of its start and end.
    pub bars: Vec<(usize, usize)>,
    /// What these bars are called.
    pub names: Vec<Text>,
    /// What every schedule has to satisfy.
    pub system: Inequalities,
}

/// A quantity to change. Numbers are exact.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Slider {
    /// The parameter's name.
    pub name: String,
    /// What it is.
    pub quantity: String,
    /// The value as planned.
    pub nominal: String,
    /// From where to where it may go, in words.
    pub room: String,
    /// Where the slider begins.
    pub from: String,
    /// Where it ends.
    pub to: String,
    /// The least change.
    pub step: String,
}

/// A region, to look at by two quantities at a time. Numbers are for drawing.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Plane {
    /// The heading.
    pub heading: String,
    /// A note on it.
    pub note: String,
    /// The quantities.
    pub quantities: Vec<PlaneQuantity>,
    /// The plan works with the values that satisfy all rows of one of these.
    pub pieces: Vec<Vec<PlaneRow>>,
    /// Boxes to draw.
    pub boxes: Vec<PlaneBox>,
}

/// A quantity of a region.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PlaneQuantity {
    /// The parameter's name.
    pub name: String,
    /// What it is.
    pub quantity: String,
    /// The value as planned.
    pub nominal: f64,
    /// Where its axis begins.
    pub from: f64,
    /// Where its axis ends.
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
    /// Both ends for each quantity; `None` where there is none.
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
