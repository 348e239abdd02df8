//! The windows of a stream that fix the parameters of a job, as they are answered.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::JobId;
use super::design::PredictedParameter;
use super::spec::InitialStateSpec;
use crate::estimation::Finding;

/// Which windows of a stream to estimate from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Selection {
    /// The model.
    #[schema(example = "first_order")]
    pub model: String,
    /// The finished job whose parameters the windows are to fix.
    pub job: JobId,
    /// The stream.
    #[schema(example = "press_7")]
    pub stream: String,
    /// Where the first window begins.
    #[schema(value_type = String, format = DateTime)]
    pub from: Timestamp,
    /// Where the last window ends.
    #[schema(value_type = String, format = DateTime)]
    pub to: Timestamp,
    /// How long a window is `[s]`.
    pub window_s: f64,
    /// Where states start in every window, where the request said so.
    pub initial_state: BTreeMap<String, InitialStateSpec>,
    /// Whether every window was looked at and no exchange of windows would help; else this is the best that was found
    /// in the time that the job had.
    pub finished: bool,
    /// The parameters that matter.
    pub wanted: Vec<WantedParameter>,
    /// Whether the chosen windows fix the wanted parameters as closely as was asked for; `null` where nothing was.
    pub reached: Option<bool>,
    /// Samples of the chosen windows together.
    pub samples: u64,
    /// The chosen windows, the oldest first.
    pub chosen: Vec<ChosenWindow>,
    /// What would be known with the chosen windows.
    pub with_chosen: Vec<PredictedParameter>,
    /// What would be known with as many windows that are drawn among those that have samples: for each parameter the
    /// middle of 25 draws.
    pub with_random: Vec<PredictedParameter>,
    /// What would be known with all windows that say something.
    pub with_all: Vec<PredictedParameter>,
    /// The wanted parameters that not even all windows together fix as closely as was asked for, or to half their
    /// value where nothing was.
    pub never_fixed: Vec<String>,
    /// The inputs that follow an output: a controller makes them, and noise counts as excitation.
    #[serde(default)]
    pub feedback: Vec<FollowedOutput>,
    /// The windows one after the other.
    pub windows: WindowsOfSelection,
    /// How many windows were left out, by the reason.
    pub left_out: Vec<LeftOutCount>,
    /// What the user should know.
    pub findings: Vec<Finding>,
}

/// A parameter that is to be fixed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WantedParameter {
    /// The parameter.
    #[schema(example = "gain")]
    pub name: String,
    /// The total standard error that was asked for, SI; `null` where none was.
    pub target: Option<f64>,
}

/// An input whose changes follow what the model leaves of an output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FollowedOutput {
    /// The input of the model.
    #[schema(example = "valve")]
    pub input: String,
    /// The output of the model.
    #[schema(example = "level")]
    pub output: String,
    /// After how many samples the input follows most.
    pub samples_later: u64,
    /// The correlation over all windows, as standard deviations of what chance makes of it.
    #[schema(example = -12.5)]
    pub score: f64,
}

/// A window that was chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ChosenWindow {
    /// The place of the window among all, from 0.
    pub window: u64,
    /// Where the window begins.
    #[schema(value_type = String, format = DateTime)]
    pub from: Timestamp,
    /// Where the window ends.
    #[schema(value_type = String, format = DateTime)]
    pub to: Timestamp,
    /// The instants at which the window is measured.
    pub samples: u64,
    /// For each parameter how much of what is known of it comes from the window: the share by which its total variance
    /// would be larger without the window, 0 to 1.
    pub adds: BTreeMap<String, f64>,
    /// The inputs of the model that moved in the window.
    pub moved: Vec<String>,
}

/// The windows of a selection one after the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WindowsOfSelection {
    /// How many there are.
    pub count: u64,
    /// For each wanted parameter the total standard error that each window alone would leave, SI; `null` where the
    /// window was left out, or does not fix the parameter.
    pub alone: BTreeMap<String, Vec<Option<f64>>>,
    /// Why each window was left out; `null` where the window says something.
    pub left_out: Vec<Option<LeftOut>>,
}

/// Why a window was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LeftOut {
    /// The request left it out.
    Excluded,
    /// The stream has fewer than two samples in it.
    NoSamples,
    /// More than a tenth of it has no samples.
    Gaps,
    /// It has more samples than can be looked at.
    TooManySamples,
    /// No input moved in it.
    InputsStoodStill,
    /// A sensor stood still in it.
    OutputStoodStill,
    /// The model starts elsewhere than its first samples.
    StartsElsewhere,
    /// The job cannot be worked on it.
    NotUsable,
    /// The model cannot be simulated over it.
    NotSimulated,
}

/// How many windows were left out for a reason.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LeftOutCount {
    /// The reason.
    pub reason: LeftOut,
    /// How many windows.
    pub windows: u64,
    /// How long they are together `[h]`.
    pub hours: f64,
}

impl Selection {
    /// The chosen windows as a table in CSV.
    #[must_use]
    pub fn csv(&self) -> String {
        let names: Vec<&String> = self
            .chosen
            .first()
            .map_or_else(Vec::new, |window| window.adds.keys().collect());
        let mut text = "window,from,to,samples,moved".to_owned();
        text.extend(names.iter().map(|name| format!(",adds_{name}")));
        text.push('\n');
        for window in &self.chosen {
            let moved = window.moved.join(" ");
            let ChosenWindow {
                window: place,
                from,
                to,
                samples,
                ..
            } = window;
            text.push_str(&format!("{place},{from},{to},{samples},{moved}"));
            text.extend(names.iter().map(|name| format!(",{}", window.adds[*name])));
            text.push('\n');
        }
        text
    }
}
