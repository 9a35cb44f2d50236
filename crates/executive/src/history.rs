//! History of a run: its closed goals and ended actions, from the segments of its journal.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use elbowroom::num::Rational;
use elbowroom::report::exact::Exact;
use elbowroom::report::trace::Stored;

use crate::interface::documents::HistoryNow;
use crate::interface::{SegmentHistory, Status};
use crate::journal::{Journal, WallTime, segments_of};
use crate::learning::LOG;

/// The greatest number of entries of one page, apart from those at the same time.
pub(crate) const MAX_PAGE: usize = 1000;

/// Files with the segments of a run.
#[derive(Clone, Debug)]
pub struct HistoryFiles {
    /// The journal; its earlier segments are beside it.
    pub journal: PathBuf,
    /// A folder with copies of its segments (`--learn`), if there is one.
    pub archive: Option<PathBuf>,
}

/// A segment of a journal, by the wall-clock time of its first record.
struct Segment {
    begun: Option<WallTime>,
    stored: Stored,
}

impl HistoryFiles {
    /// Returns the paths of all segments that may belong to the run, without the present one.
    fn earlier_paths(&self) -> BTreeSet<PathBuf> {
        let mut paths: BTreeSet<PathBuf> = segments_of(&self.journal).into_iter().collect();
        paths.remove(&self.journal);
        let archive = self
            .archive
            .iter()
            .filter_map(|folder| fs::read_dir(folder).ok());
        for entry in archive.flatten().flatten() {
            let path = entry.path();
            if path.extension().is_some_and(|it| it == LOG) && path.is_file() {
                paths.insert(path);
            }
        }
        paths
    }
}

fn read_segment(path: &Path) -> Option<Segment> {
    // The last record may be written at this moment.
    let journal = Journal::read(&fs::read_to_string(path).ok()?).ok()?;
    Some(Segment {
        begun: *journal.recorded.first()?,
        stored: Stored::read(&journal.text).ok()?,
    })
}

/// Returns the closed goals and ended actions before a time of the world's clock, the latest first: `limit` of them, and
/// those at the same time as the last one. `present` is the trace in memory, for runs without a journal.
pub(crate) fn page(
    files: Option<&HistoryFiles>,
    present: &dyn Fn() -> String,
    status: &Status,
    before: Option<&Rational>,
    limit: usize,
) -> HistoryNow {
    let mut page = HistoryNow {
        goals: Vec::new(),
        actions: Vec::new(),
        next: None,
    };
    let mut segment = match files {
        Some(files) => read_segment(&files.journal),
        None => Stored::read(&present()).ok().map(|stored| Segment {
            begun: None,
            stored,
        }),
    };
    let mut earlier: Option<BTreeMap<WallTime, Segment>> = None;
    while let Some(current) = segment.take() {
        let begin = current
            .stored
            .snapshot()
            .ok()
            .flatten()
            .map(|it| it.now().clone());
        // The snapshot of the earliest segment also has goals that were closed before.
        let found = SegmentHistory::of(&current.stored, status);
        let is_asked = |end: &Exact| before.is_none_or(|before| end.0 < *before);
        page.goals
            .extend(found.goals.into_iter().filter(|it| is_asked(&it.since)));
        page.actions
            .extend(found.actions.into_iter().filter(|it| is_asked(&it.end)));
        let is_full =
            cut(&page, limit).is_some_and(|cut| begin.as_ref().is_none_or(|it| *it < cut));
        if begin.is_none() || (is_full && page.goals.len() + page.actions.len() > limit) {
            break;
        }
        let earlier = earlier.get_or_insert_with(|| {
            let paths = files.map(HistoryFiles::earlier_paths).unwrap_or_default();
            let segments = paths.iter().filter_map(|path| read_segment(path));
            segments.filter_map(|it| Some((it.begun?, it))).collect()
        });
        segment = current.begun.and_then(|begun| {
            let (&last, _) = earlier.range(..begun).next_back()?;
            earlier.remove(&last)
        });
        if segment.is_none() {
            let closed = found.closed_before.into_iter();
            page.goals.extend(closed.filter(|it| is_asked(&it.since)));
        }
    }
    page.goals
        .sort_by(|one, other| other.since.0.cmp(&one.since.0));
    page.actions
        .sort_by(|one, other| other.end.0.cmp(&one.end.0));
    if let Some(cut) = cut(&page, limit) {
        let before = page.goals.len() + page.actions.len();
        page.goals.retain(|it| it.since.0 >= cut);
        page.actions.retain(|it| it.end.0 >= cut);
        let is_complete = page.goals.len() + page.actions.len() == before;
        page.next = (!is_complete).then_some(Exact(cut));
    }
    page
}

/// Returns the time of the last entry of a page with `limit` entries; `None` if there are fewer.
fn cut(page: &HistoryNow, limit: usize) -> Option<Rational> {
    let goals = page.goals.iter().map(|it| &it.since.0);
    let mut times: Vec<&Rational> = goals
        .chain(page.actions.iter().map(|it| &it.end.0))
        .collect();
    times.sort();
    let index = times.len().checked_sub(limit)?;
    times.get(index).map(|time| (*time).clone())
}
