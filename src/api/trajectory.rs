//! Measured and simulated outputs of a result, for plots or whole.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use super::ApiState;
use super::error::Answer;
use super::extract::Named;
use super::finished_job::FinishedJob;
use super::http_headers::{json, prefers};
use super::query::{FromQuery, Params, QueryReader};
use super::results;
use crate::job::assemble::{ExperimentTrajectory, OutputTrajectory};
use crate::job::{DatasetId, JobId};
use crate::recording::kept_indices;

/// Points of a plot when the client does not say.
const DEFAULT_POINTS: u64 = 2000;
/// Points of a plot at the most.
const MAX_POINTS: u64 = 100_000;

/// How finely.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct TrajectoryQuery {
    /// Points of each experiment at the most; the extremes of each stretch are kept.
    #[param(minimum = 2, maximum = 100_000, default = 2000)]
    pub max_points: Option<u64>,
}

impl FromQuery for TrajectoryQuery {
    fn read(query: &mut QueryReader) -> Self {
        Self {
            max_points: query.integer("max_points", 2, MAX_POINTS),
        }
    }
}

/// Measured and simulated outputs.
#[derive(Serialize, ToSchema)]
pub struct Trajectory {
    /// The job.
    job: JobId,
    /// The experiments, in the order of the job.
    experiments: Vec<Experiment>,
}

/// One experiment.
#[derive(Serialize, ToSchema)]
#[schema(as = TrajectoryExperiment)]
struct Experiment {
    /// The recording.
    dataset: DatasetId,
    /// Where the data that were estimated from end and those held back begin `[s]`.
    estimation_until_s: Option<f64>,
    /// The instants, from the recording's first sample `[s]`.
    time_s: Vec<f64>,
    /// The measured outputs by name.
    outputs: BTreeMap<String, Output>,
}

/// One output: its samples at the instants, SI.
#[derive(Serialize, ToSchema)]
#[schema(as = TrajectoryOutput)]
struct Output {
    /// The SI unit.
    #[schema(example = "m")]
    unit: String,
    /// As measured; `null` where a sample is missing.
    measured: Vec<Option<f64>>,
    /// As simulated.
    simulated: Vec<Option<f64>>,
    /// measured − simulated; `null` where a sample is missing.
    residual: Vec<Option<f64>>,
}

/// Compare measured and simulated outputs of a result: decimated for plots as JSON, or every
/// sample as CSV.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/trajectory", operation_id = "read_trajectory", tag = "jobs",
    params(("id" = JobId, Path, description = "The job"), TrajectoryQuery),
    responses(
        (status = 200, description = "The outputs",
         content((Trajectory = "application/json"), (String = "text/csv"))),
        (status = 409, description = "There is no result, or not yet, or its recording is gone")
    )
)]
pub async fn trajectory(
    State(state): State<ApiState>,
    Named(id): Named<JobId>,
    Params(query): Params<TrajectoryQuery>,
    headers: HeaderMap,
) -> Answer {
    let job = FinishedJob::read(&state, id).await?;
    let as_csv = prefers(&headers, "text/csv");
    let points = query.max_points.unwrap_or(DEFAULT_POINTS);
    let points = usize::try_from(points).expect("the limit is small");
    let compared = state.compute(move |stop| {
        let experiments = job.trajectory(stop)?;
        if as_csv {
            return Ok(results::csv(csv(&experiments)));
        }
        let experiments = experiments.iter().map(|e| decimated(e, points)).collect();
        let trajectory = Trajectory {
            job: id,
            experiments,
        };
        Ok(json(StatusCode::OK, &trajectory))
    });
    compared.await
}

fn decimated(experiment: &ExperimentTrajectory, points: usize) -> Experiment {
    let outputs = experiment.outputs.iter();
    let columns: Vec<&[f64]> = outputs
        .flat_map(|output| [&output.measured[..], &output.simulated, &output.residual])
        .collect();
    let kept = kept_indices(&columns, 0..experiment.time.len(), points);
    let pick = |values: &[f64]| kept.iter().map(|&k| finite(values[k])).collect();
    let output = |output: &OutputTrajectory| Output {
        unit: output.unit.clone(),
        measured: pick(&output.measured),
        simulated: pick(&output.simulated),
        residual: pick(&output.residual),
    };
    let held_back = experiment.time.get(experiment.estimation_samples);
    Experiment {
        dataset: experiment.dataset,
        estimation_until_s: held_back.or(experiment.time.last()).copied(),
        time_s: kept.iter().map(|&k| experiment.time[k]).collect(),
        outputs: experiment
            .outputs
            .iter()
            .map(|of| (of.name.clone(), output(of)))
            .collect(),
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// One row a sample; the first column counts the experiments from 0.
fn csv(experiments: &[ExperimentTrajectory]) -> String {
    let mut text = String::from("experiment,time [s]");
    for output in experiments.iter().take(1).flat_map(|e| &e.outputs) {
        let OutputTrajectory { name, unit, .. } = output;
        let columns = ["measured", "simulated", "residual"];
        text.extend(columns.map(|column| format!(",{name}_{column} [{unit}]")));
    }
    text.push('\n');
    for (number, experiment) in experiments.iter().enumerate() {
        for (k, time) in experiment.time.iter().enumerate() {
            push(&mut text, format_args!("{number},{time}"));
            let outputs = experiment.outputs.iter();
            let series = outputs.flat_map(|o| [&o.measured, &o.simulated, &o.residual]);
            for values in series {
                push_field(&mut text, values[k]);
            }
            text.push('\n');
        }
    }
    text
}

/// A missing sample is an empty field.
fn push_field(text: &mut String, value: f64) {
    match finite(value) {
        Some(value) => push(text, format_args!(",{value}")),
        None => text.push(','),
    }
}

fn push(text: &mut String, words: std::fmt::Arguments<'_>) {
    text.write_fmt(words)
        .expect("writing to a string does not fail");
}
