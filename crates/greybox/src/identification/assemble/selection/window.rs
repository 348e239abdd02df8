//! The windows of a selection: where they lie, what is read of them, and what was seen of them.

use crate::identification::selection::LeftOut;
use crate::uncertainty::design::history::WindowInformation;
use crate::uncertainty::feedback::LAGS;
use greybox_recording::Rows;
use serde::{Deserialize, Serialize};

/// Where windows lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelectedSpan {
    /// Where the first window begins, nanoseconds since 1970.
    pub from: i64,
    /// Where the last window ends, nanoseconds since 1970.
    pub until: i64,
    /// How long a window is `[ns]`.
    pub window: i64,
}

impl SelectedSpan {
    /// How many windows there are; the last one may be shorter.
    #[must_use]
    pub fn count(&self) -> usize {
        match self.until.saturating_sub(self.from) {
            length if length > 0 => {
                usize::try_from((length - 1) / self.window + 1).unwrap_or(usize::MAX)
            }
            _ => 0,
        }
    }

    /// From where to where a window is, nanoseconds since 1970.
    #[must_use]
    pub fn bounds(&self, window: usize) -> (i64, i64) {
        let from = self
            .from
            .saturating_add(self.window.saturating_mul(window as i64));
        (from, from.saturating_add(self.window).min(self.until))
    }
}

/// A window before it is looked at.
#[derive(Clone, Debug)]
pub enum HistoryWindow {
    /// The samples of the window are there.
    Recorded {
        /// The samples.
        rows: Rows,
        /// Where the window begins and ends, nanoseconds since 1970.
        bounds: (i64, i64),
    },
    /// The samples need not be read.
    LeftOut(LeftOut),
}

/// A window that was looked at: what it holds, or why it was left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LookedWindow {
    /// The window says something.
    Informs {
        /// The information of the window.
        information: WindowInformation,
        /// The least and the greatest value of each input of the model.
        inputs: Vec<[f32; 2]>,
        /// For each compared output, and there for each input, how the changes of the input follow the residuals.
        following: Vec<Option<[f32; 2 * LAGS]>>,
    },
    /// The window was left out.
    LeftOut(LeftOut),
}
