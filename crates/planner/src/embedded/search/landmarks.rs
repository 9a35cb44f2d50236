//! The landmarks of a search that counts them, and the landmarks that a state lacks.

use super::super::landmarks::Landmarks;
use super::super::relaxed::Labels;
use super::super::state::State;
use super::goals::conjuncts;
use super::{Expansion, Search};

/// Work of a turn that searches for landmarks, per unit of the maximum work of an estimate.
const WORK_OF_TURN: u64 = 4;

/// State of the landmarks in a search.
#[derive(Debug)]
pub(super) enum SearchLandmarks {
    Unknown,
    /// The landmarks are being computed. The number is the work done so far.
    Computing(Box<Labels>, u64),
    Known(Landmarks),
}

impl Search<'_> {
    /// Computes the landmarks of the first state, if they count, a part of them in each turn.
    /// Returns `None` when this is finished.
    pub(super) fn find_landmarks(&mut self, initial: &State) -> Option<Expansion> {
        if !self.strategy.counts_landmarks {
            return None;
        }
        let found = match std::mem::replace(&mut self.landmarks, SearchLandmarks::Unknown) {
            SearchLandmarks::Unknown => {
                let labels = self.relaxed.labels(initial);
                labels.map(|labels| SearchLandmarks::Computing(Box::new(labels), 0))
            }
            SearchLandmarks::Computing(mut labels, before) => {
                let most = WORK_OF_TURN * (1 + self.weight());
                let (work, is_all) = self.relaxed.propagate(&mut labels, most);
                let work = before + work;
                if is_all {
                    let graph = self.relaxed.graph();
                    let found = Landmarks::of(graph, &labels, &initial.open);
                    // If all landmarks are goals, they are no better than counting goals.
                    let is_only = self.compiled.tuning.only.is_some();
                    let found = found.filter(|found| found.intermediate_count > 0 || is_only);
                    found.map(SearchLandmarks::Known)
                } else if work > self.compiled.tuning.most_landmark_work {
                    None
                } else {
                    Some(SearchLandmarks::Computing(labels, work))
                }
            }
            SearchLandmarks::Known(landmarks) => {
                self.landmarks = SearchLandmarks::Known(landmarks);
                return None;
            }
        };
        self.total_work += WORK_OF_TURN;
        let Some(found) = found else {
            // Without landmarks, this search has no purpose.
            self.is_lossy = true;
            return Some(Expansion::Over);
        };
        self.landmarks = found;
        Some(Expansion::Nothing)
    }

    /// Returns the accepted landmarks after a choice that led to the state, and the number of
    /// remaining ones. Where novelty counts without landmarks, returns the number of remaining
    /// goals.
    pub(super) fn remaining_landmarks(&self, parent: u32, state: &State) -> (Vec<u64>, u32) {
        if let SearchLandmarks::Known(landmarks) = &self.landmarks {
            let parent = self.nodes.get(parent as usize);
            let before = parent.and_then(|parent| self.shared.accepted.get(parent.accepted));
            let before = before.map(|before| &before[..]);
            return landmarks.progress(self.compiled, before, state);
        }
        match self.strategy.novelty {
            Some(_) => {
                let left = conjuncts(self.compiled, state).filter(|holds| !holds);
                (Vec::new(), u32::try_from(left.count()).unwrap_or(u32::MAX))
            }
            None => (Vec::new(), 0),
        }
    }
}
