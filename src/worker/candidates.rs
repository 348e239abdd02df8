//! Which of the candidates that a run reports are new to the record of its job.

use std::sync::Arc;

use crate::job::candidate::Selection;
use crate::job::{Candidate, CandidateColumn};
use crate::store::{CandidatePage, NewCandidates};

/// Collects the candidates that a slice has to write.
#[derive(Debug)]
pub(super) struct Candidates {
    selection: Selection,
    /// Known from the first candidates on.
    columns: Option<Arc<[CandidateColumn]>>,
    waiting: Vec<Candidate>,
    /// The cut that the record tells of.
    reported_cut: Option<u32>,
}

impl Candidates {
    /// Keeps `limit` candidates of the job at the most.
    pub(super) fn new(limit: u64) -> Self {
        Self {
            selection: Selection::new(limit),
            columns: None,
            waiting: Vec::new(),
            reported_cut: None,
        }
    }

    /// Takes in what was kept before.
    pub(super) fn recall(&mut self, kept: &CandidatePage) {
        self.reported_cut = kept.cut_in_generation;
        self.selection.recall(&kept.candidates, self.reported_cut);
    }

    /// Takes in what a generation simulated.
    pub(super) fn take(&mut self, columns: Arc<[CandidateColumn]>, candidates: Vec<Candidate>) {
        self.columns = Some(columns);
        self.waiting.extend(self.selection.admit(candidates));
    }

    /// What is new since the last call.
    pub(super) fn news(&mut self) -> Option<NewCandidates> {
        let cut_in_generation = self.selection.cut_in_generation();
        if self.waiting.is_empty() && self.reported_cut == cut_in_generation {
            return None;
        }
        self.reported_cut = cut_in_generation;
        Some(NewCandidates {
            columns: self.columns.clone()?,
            candidates: std::mem::take(&mut self.waiting),
            kept: self.selection.count(),
            cut_in_generation,
        })
    }
}
