//! What a monitor is asked to do.

use std::collections::BTreeMap;
use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::template::JobTemplate;
use greybox::identification::spec::MAX_NAME_CHARS;
use greybox::parsing::Fault;
use greybox::parsing::reader::{Field, read_document};
use greybox::parsing::settings::Section as _;
use greybox::settings;

/// A window is so long at the least `[s]`.
const LEAST_LENGTH_S: f64 = 1e-3;
/// A time is so long at the most `[s]`: a century.
const LONGEST_S: f64 = 3.2e9;
/// Data have stopped after so many periods, where the monitor does not say when.
const PATIENCE_PERIODS: f64 = 3.0;
/// Data have not stopped before so long without data, where the monitor does not say when `[s]`.
const LEAST_PATIENCE_S: f64 = 60.0;
/// An input moves when it moves by this share of what it ever moved.
const USUAL_MOVEMENT: f64 = 0.05;
/// Windows whose job and recording are kept.
const USUAL_KEPT: u32 = 100;

/// A job that is done again and again, on a window of a stream after the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({
    "name": "rig 4, air in the oil",
    "stream": "rig-4",
    "window": {"length_s": 60, "every_s": 600},
    "only_when": {"signal": "valve_command", "moves_more_than": 0.2},
    "alarms": {"false_alarm_rate": 0.001},
    "job": {
        "model": "single_rod_servo",
        "experiments": [{"signals": {"valve_command": "valve_command", "position": "position"}}],
        "parameters": {"bulk_modulus": {"estimate": {"lower": 2e8, "upper": 2.4e9}}},
        "outputs": {"position": {"noise_std": 1e-5}}
    }
}))]
pub struct MonitorSpec {
    /// A name for people.
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// The stream that is watched.
    pub stream: String,
    /// Which windows of the stream are watched.
    pub window: WindowPlan,
    /// Which of them are worth a job, by how far a signal moves; left out, those whose data would fix a
    /// parameter to within half its value, and before there is an estimate those in which an input of the
    /// model moves by more than a twentieth of all that it moved so far. In the others nothing is estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub only_when: Option<Movement>,
    /// How fast parameters may drift, by the model's names. The estimate of a window, as uncertain as
    /// it was and as this makes it by the next, is the prior of the next. Left out, the prior is so
    /// wide that each window speaks for itself.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(required = false)]
    pub drift: BTreeMap<String, Drift>,
    /// When to raise an alarm.
    #[serde(default)]
    #[schema(required = false)]
    pub alarms: AlarmSpec,
    /// The newest windows whose jobs and recordings are kept; what was estimated from others stays.
    #[schema(required = false, minimum = 1, maximum = 10_000)]
    pub keep_jobs: u32,
    /// The job, as `POST /v1/jobs` takes it. Its one experiment names neither `dataset` nor
    /// `window`: those are the windows of the stream.
    #[schema(value_type = Object)]
    pub job: JobTemplate,
}

/// Which windows of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WindowPlan {
    /// How long a window is `[s]`.
    #[schema(minimum = 0.001, maximum = 3.2e9, example = 60.0)]
    pub length_s: f64,
    /// The time from the beginning of one to that of the next `[s]`; left out, its length.
    #[schema(required = false, minimum = 0.001, maximum = 3.2e9)]
    pub every_s: f64,
    /// How long after its end a window waits for late samples, in the time of the stream `[s]`.
    #[schema(required = false, minimum = 0, maximum = 3.2e9)]
    pub delay_s: f64,
    /// When the first begins; left out, with the oldest sample of the stream.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>, format = DateTime, nullable = false)]
    pub from: Option<Timestamp>,
}

/// A signal that moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Movement {
    /// The signal of the stream.
    pub signal: String,
    /// The range of the signal in a window, as a share of its range in all windows so far.
    #[schema(minimum = 0, maximum = 1, example = 0.2)]
    pub moves_more_than: f64,
}

/// A random walk.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Drift {
    /// The standard deviation of what a parameter drifts, SI …
    #[schema(exclusive_minimum = 0)]
    pub std: f64,
    /// … in this time `[s]`. It grows with the square root of time.
    #[schema(exclusive_minimum = 0, example = 86_400.0)]
    pub per_s: f64,
}

settings! {
    /// When to raise an alarm.
    #[derive(Copy)]
    pub struct AlarmSpec {
        /// How many windows in which nothing changes may raise an alarm that something has: one in a
        /// thousand when left out. It is that of the whole monitor, however many parameters it has.
        #[schema(example = 0.001)]
        false_alarm_rate: f64 = 1e-3, from 1e-6, to 0.1;
        /// Data have stopped when none came for so long, by the clock of the server `[s]`; left out,
        /// three periods, and a minute at the least.
        data_stopped_after_s: Option<f64> = None, from 0.001, to 3.2e9;
    }
}

impl MonitorSpec {
    /// Reads a submitted document, or says everything that is wrong with it. Whether the job makes
    /// sense is not looked at.
    ///
    /// # Errors
    /// The faults.
    pub fn read(document: &Value) -> Result<Self, Vec<Fault>> {
        read_document(document, read)
    }

    /// The share of its range that a signal must move by.
    #[must_use]
    pub fn movement(&self) -> f64 {
        let movement = self.only_when.as_ref();
        movement.map_or(USUAL_MOVEMENT, |movement| movement.moves_more_than)
    }

    /// How long it waits for data before it says that they stopped.
    #[must_use]
    pub fn patience(&self) -> Duration {
        let usual = (PATIENCE_PERIODS * self.window.every_s).max(LEAST_PATIENCE_S);
        Duration::from_secs_f64(self.alarms.data_stopped_after_s.unwrap_or(usual))
    }
}

fn read(document: &Field<'_>) -> Option<MonitorSpec> {
    let mut root = document.object()?;
    let name = root.optional("name").and_then(|field| {
        let text = field.text()?;
        if text.chars().count() > MAX_NAME_CHARS {
            field.fault("too_long", format!("more than {MAX_NAME_CHARS} characters"));
        }
        Some(text.to_owned())
    });
    let stream = root.required("stream").and_then(|field| field.text());
    let window = root.required("window").and_then(|field| plan(&field));
    let only_when = root.optional("only_when").and_then(|field| {
        let mut object = field.object()?;
        let signal = object.required("signal").and_then(|field| field.text());
        let share = object.required("moves_more_than");
        let share = share.and_then(|field| field.number_within(0.0, 1.0));
        object.finish();
        Some(Movement {
            signal: signal?.to_owned(),
            moves_more_than: share?,
        })
    });
    let drift = root.optional("drift").and_then(|field| drifts(&field));
    let alarms = root.optional("alarms");
    let alarms = alarms.map(|field| AlarmSpec::read(&field));
    let keep_jobs = root.optional("keep_jobs");
    let keep_jobs = keep_jobs.and_then(|field| field.integer(1, 10_000));
    let job = root
        .required("job")
        .and_then(|field| JobTemplate::read(&field));
    root.finish();
    Some(MonitorSpec {
        name,
        stream: stream?.to_owned(),
        window: window?,
        only_when,
        drift: drift.unwrap_or_default(),
        alarms: alarms.unwrap_or_default(),
        keep_jobs: keep_jobs.map_or(USUAL_KEPT, |kept| u32::try_from(kept).unwrap_or(u32::MAX)),
        job: job?,
    })
}

fn plan(field: &Field<'_>) -> Option<WindowPlan> {
    let mut object = field.object()?;
    let long = |field: Field<'_>| field.number_within(LEAST_LENGTH_S, LONGEST_S);
    let length = object.required("length_s").and_then(long);
    let every = object.optional("every_s").map(long);
    let delay = object.optional("delay_s");
    let delay = delay.map(|field| field.number_within(0.0, LONGEST_S));
    let from = object.optional("from").and_then(|field| field.instant());
    object.finish();
    let length_s = length?;
    Some(WindowPlan {
        length_s,
        every_s: every.unwrap_or(Some(length_s))?,
        delay_s: delay.unwrap_or(Some(0.0))?,
        from,
    })
}

fn drifts(field: &Field<'_>) -> Option<BTreeMap<String, Drift>> {
    let mut drifts = BTreeMap::new();
    for (name, field) in field.object()?.entries() {
        let Some(mut object) = field.object() else {
            continue;
        };
        let std = object.required("std").and_then(|field| field.positive());
        let per = object.required("per_s").and_then(|field| field.positive());
        object.finish();
        if let (Some(std), Some(per_s)) = (std, per) {
            drifts.insert(name.to_owned(), Drift { std, per_s });
        }
    }
    Some(drifts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_left_out_is_completed_and_reads_back() {
        let document = json!({
            "stream": "rig-4", "window": {"length_s": 60},
            "job": {"model": "lag", "seed": 1}
        });
        let spec = MonitorSpec::read(&document).expect("it is sound");
        assert_eq!((spec.window.every_s, spec.keep_jobs), (60.0, USUAL_KEPT));
        assert_eq!(spec.patience(), Duration::from_secs(180));
        let stored = serde_json::to_value(&spec).expect("text keys");
        assert_eq!(
            serde_json::from_value::<MonitorSpec>(stored).ok(),
            Some(spec.clone())
        );
    }

    #[test]
    fn all_faults_are_told_at_once_each_with_its_place() {
        let document = json!({
            "stream": 4, "window": {"length_s": 0, "evry_s": 5}, "alarms": {"false_alarm_rate": 2},
            "drift": {"mass": {"std": -1}},
            "job": {"experiments": [{"dataset": "ds_1"}, {}]}
        });
        let faults = MonitorSpec::read(&document).expect_err("much is wrong");
        let places: Vec<&str> = faults.iter().map(|fault| fault.pointer()).collect();
        for place in [
            "/stream",
            "/window/length_s",
            "/window/evry_s",
            "/alarms/false_alarm_rate",
            "/drift/mass/std",
            "/drift/mass",
            "/job/experiments/0/dataset",
            "/job/experiments/1",
        ] {
            assert!(places.contains(&place), "{place} in {places:?}");
        }
    }
}
