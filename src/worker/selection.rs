//! The selection of windows as a job: from the stored task to [`Selecting`], some windows a unit, and from there to
//! events and the result.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::run::{Advance, Assignment, Past, Row, Run, StopReason, StreamReader, unread};
use crate::job::event::SelectionEvent;
use crate::job::{Failure, ResultOfJob, SelectionTask};
use greybox::estimation::{Phase, Progress};
use greybox::identification::assemble::{
    HistoryWindow, LookedWindow, PastResult, SelectedSpan, Selecting,
};
use greybox::identification::selection::{LeftOut, Selection};
use greybox::identification::spec::design::PastJob;
use greybox::identification::spec::selection::SelectionSpec;
use greybox::model::Model;
use greybox::parsing::Fault;
use greybox::recording::Recording;

/// Windows that are looked at in one unit of work.
const WINDOWS_A_UNIT: usize = 32;
/// Instants of a window that are read at the most.
const MOST_INSTANTS: usize = 2_000_000;
/// Events of the windows that were looked at, about.
const EVENTS: usize = 50;

/// Nobody raises it.
static NEVER: AtomicBool = AtomicBool::new(false);

/// Begins a selection, or goes on where it was saved.
pub(super) fn begin(
    task: &SelectionTask,
    model: Arc<Model>,
    assignment: Assignment,
) -> Result<Box<dyn Run>, Failure> {
    let (Some(past), Some(stream)) = (assignment.past, assignment.stream) else {
        let detail = "a selection needs a finished job and a stream".to_owned();
        return Err(Failure::cannot_run(detail, Vec::new()));
    };
    let before = PastJob::new(&past.spec, &past.outcome);
    let spec = task
        .selection
        .read(Some(model.description()), Some(&before))
        .map_err(cannot)?;
    let nanoseconds =
        |instant: jiff::Timestamp| i64::try_from(instant.as_nanosecond()).unwrap_or(i64::MAX);
    let span = SelectedSpan {
        from: nanoseconds(task.from),
        until: nanoseconds(task.to),
        window: (spec.window * 1e9).max(1.0) as i64,
    };
    let looked = match assignment.checkpoint {
        Some(bytes) => serde_json::from_slice(&bytes).map_err(|error| unread(&error))?,
        None => Vec::new(),
    };
    let recordings = assignment.datasets.into_iter();
    Ok(Box::new(SelectionRun {
        beginning: Some(Beginning {
            spec,
            model,
            past,
            recordings: recordings.map(|(_, recording)| recording).collect(),
        }),
        selecting: None,
        stream,
        span,
        looked,
        selection: None,
        failure: None,
    }))
}

/// What a selection is begun from.
struct Beginning {
    spec: SelectionSpec,
    model: Arc<Model>,
    past: Past,
    recordings: Vec<Arc<Recording>>,
}

fn cannot(faults: Vec<Fault>) -> Failure {
    Failure::cannot_run("the selection cannot be made".to_owned(), faults)
}

struct SelectionRun {
    /// Until the selection has begun, which may take as long as its job's recordings are long.
    beginning: Option<Beginning>,
    selecting: Option<Selecting>,
    stream: Arc<dyn StreamReader>,
    span: SelectedSpan,
    /// The windows that were looked at, the oldest first.
    looked: Vec<LookedWindow>,
    /// The choice among all windows.
    selection: Option<Selection>,
    failure: Option<Failure>,
}

impl SelectionRun {
    /// Begins where that was not done, and looks at the next windows or chooses among all; whether `stop` was not
    /// raised meanwhile.
    fn go_on(&mut self, stop: &AtomicBool) -> Result<bool, Failure> {
        if let Some(beginning) = &self.beginning {
            let past = PastResult {
                spec: &beginning.past.spec,
                outcome: &beginning.past.outcome,
                recordings: &beginning.recordings,
            };
            let spec = beginning.spec.clone();
            let begun = Selecting::begin(spec, &beginning.model, past, stop).map_err(cannot)?;
            if begun.is_some() {
                self.selecting = begun;
                self.beginning = None;
            }
        }
        let Some(selecting) = &self.selecting else {
            return Ok(false);
        };
        let next = self.looked.len();
        if next == self.span.count() {
            self.selection = selecting.select(self.span, &self.looked, stop);
            return Ok(!stop.load(Ordering::Relaxed));
        }
        let last = (next + WINDOWS_A_UNIT).min(self.span.count());
        let windows = self.read(selecting, next..last)?;
        let looked = selecting.look(windows, self.stream.signals(), stop);
        let is_whole = looked.is_some();
        self.looked.extend(looked.into_iter().flatten());
        Ok(is_whole)
    }

    /// Reads windows that follow each other: together, where they are not too long for that.
    fn read(
        &self,
        selecting: &Selecting,
        windows: Range<usize>,
    ) -> Result<Vec<HistoryWindow>, Failure> {
        let (from, until) = (
            self.span.bounds(windows.start).0,
            self.span.bounds(windows.end - 1).1,
        );
        let together = self.stream.rows(from..until, MOST_INSTANTS)?;
        let read = windows.map(|window| {
            let bounds = self.span.bounds(window);
            if selecting.is_excluded(bounds) {
                return Ok(HistoryWindow::LeftOut(LeftOut::Excluded));
            }
            let rows = match &together {
                Some(together) => Some(together.within(bounds.0, bounds.1)),
                None => self.stream.rows(bounds.0..bounds.1, MOST_INSTANTS)?,
            };
            Ok(match rows {
                Some(rows) => HistoryWindow::Recorded { rows, bounds },
                None => HistoryWindow::LeftOut(LeftOut::TooManySamples),
            })
        });
        read.collect()
    }

    /// The event of the windows that were looked at, where a fiftieth of them is full.
    fn news(&self, before: usize) -> Option<Row> {
        let (looked, windows) = (self.looked.len(), self.span.count());
        let step = windows.div_ceil(EVENTS).max(1);
        let is_due = looked / step > before / step || looked == windows;
        is_due.then_some(Row::Selection(SelectionEvent {
            looked: looked as u64,
            windows: windows as u64,
        }))
    }
}

impl Run for SelectionRun {
    fn advance(&mut self, stop: &AtomicBool, rows: &mut dyn FnMut(Row)) -> Advance {
        let before = self.looked.len();
        match self.go_on(stop) {
            Ok(true) => {}
            Ok(false) => return Advance::Interrupted,
            Err(failure) => {
                self.failure = Some(failure);
                return Advance::Finished;
            }
        }
        if before < self.looked.len()
            && let Some(row) = self.news(before)
        {
            rows(row);
        }
        match self.selection {
            Some(_) => Advance::Finished,
            None => Advance::Working,
        }
    }

    fn progress(&self) -> Progress {
        let (looked, windows) = (self.looked.len(), self.span.count());
        Progress {
            phase: Phase::Search,
            generation: 0,
            generations: 0,
            evaluations: looked as u64,
            best_cost: None,
            best_credit: None,
            fraction: (looked as f64 / windows.max(1) as f64).min(1.0),
            eta_s: None,
        }
    }

    fn checkpoint(&self) -> Vec<u8> {
        serde_json::to_vec(&self.looked).expect("a checkpoint has only text keys")
    }

    fn outcome(
        &mut self,
        stopped: Option<StopReason>,
        hurry: &AtomicBool,
    ) -> Result<Option<ResultOfJob>, Failure> {
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        let selection = match (self.selection.take(), &self.selecting) {
            (None, Some(selecting)) if !self.looked.is_empty() => {
                let stop = if stopped.is_some() { hurry } else { &NEVER };
                selecting.select(self.span, &self.looked, stop)
            }
            (selection, _) => selection,
        };
        Ok(selection.map(|selection| ResultOfJob::Selection(Box::new(selection))))
    }
}

#[cfg(test)]
mod tests;
