//! The landmarks of a search that counts them, and what a state lacks.

use super::super::landmarks::Landmarks;
use super::super::mutex::Mutexes;
use super::super::relaxed::Labels;
use super::super::state::State;
use super::super::tuning::IS_WHOLE;
use super::novelty::goals_left;
use super::{Search, Turn};

/// The work of one turn of finding landmarks, for each unit of what an estimate may take.
const WORK_OF_TURN: u64 = 4;

/// What a search knows of the landmarks.
#[derive(Debug)]
pub(super) enum SearchLandmarks {
    Unknown,
    /// They are being found. So much has been done.
    InTheMaking(Box<Labels>, u64),
    Known(Landmarks),
}

impl Search<'_> {
    /// Finds the landmarks from the first state on, if they count, a part of them in each turn. `None` if
    /// nothing of that is left to do.
    pub(super) fn find_landmarks(&mut self, initial: &State) -> Option<Turn> {
        if !self.strategy.counts_landmarks {
            return None;
        }
        let found = match std::mem::replace(&mut self.landmarks, SearchLandmarks::Unknown) {
            SearchLandmarks::Unknown => {
                let labels = self.relaxed.labels(initial);
                labels.map(|labels| SearchLandmarks::InTheMaking(Box::new(labels), 0))
            }
            SearchLandmarks::InTheMaking(mut labels, before) => {
                let most = WORK_OF_TURN * (1 + self.weight());
                let (work, is_all) = self.relaxed.propagate(&mut labels, most);
                let work = before + work;
                if is_all {
                    let graph = self.relaxed.graph();
                    let found = Landmarks::of(graph, &labels, &initial.open);
                    // Without any on the way to the goal, they count no more than parts of the goal.
                    let is_only = self.compiled.tuning.only.is_some();
                    let found = found.filter(|found| found.on_the_way > 0 || is_only);
                    found.map(|mut landmarks| {
                        if IS_WHOLE && self.compiled.tuning.reasonable_orders > 0 {
                            let most = self.compiled.tuning.most_mutex_work;
                            let mutexes = Mutexes::of(self.compiled, initial, most);
                            landmarks.order_reasonably(graph, &labels, &mutexes);
                        }
                        SearchLandmarks::Known(landmarks)
                    })
                } else if work > self.compiled.tuning.most_landmark_work {
                    None
                } else {
                    Some(SearchLandmarks::InTheMaking(labels, work))
                }
            }
            SearchLandmarks::Known(landmarks) => {
                self.landmarks = SearchLandmarks::Known(landmarks);
                return None;
            }
        };
        self.labour += WORK_OF_TURN;
        let Some(found) = found else {
            // Without landmarks, this search is none.
            self.has_lost = true;
            return Some(Turn::Over);
        };
        self.landmarks = found;
        Some(Turn::Nothing)
    }

    /// The landmarks accepted after a choice that led to the state, and how many are left; where novelty
    /// counts without landmarks, how much of the goal is left.
    pub(super) fn left(&self, parent: u32, state: &State) -> (Vec<u64>, u32) {
        if let SearchLandmarks::Known(landmarks) = &self.landmarks {
            let parent = self.nodes.get(parent as usize);
            let before = parent.and_then(|parent| self.shared.accepted.get(parent.accepted));
            let before = before.map(|before| &before[..]);
            return landmarks.progress(self.compiled, before, state);
        }
        match self.strategy.novelty {
            Some(_) => (Vec::new(), goals_left(self.compiled, state)),
            None => (Vec::new(), 0),
        }
    }
}
