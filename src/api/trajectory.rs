//! Measured and simulated outputs of a result, for plots or whole.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use super::computed::computed;
use super::error::Answer;
use super::extract::Named;
use super::http_headers::{json, prefers};
use super::query::{FromQuery, Params, QueryReader};
use super::{ApiState, results};
use greybox::identification::assemble::{ExperimentTrajectory, OutputTrajectory};
use greybox::identification::spec::MAX_EXPERIMENTS;
use greybox::identification::{DatasetId, JobId};
use greybox::recording::kept_indices;

/// Points of a plot when the client does not say.
const DEFAULT_POINTS: u64 = 2000;
/// Points of a plot at the most.
const MAX_POINTS: u64 = 100_000;

/// Which part, and how finely.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct TrajectoryQuery {
    /// Only this experiment, counted from 0 in the order of the job.
    #[param(minimum = 0, maximum = 31)]
    pub experiment: Option<u64>,
    /// From this instant on `[s]`, from the recording's first sample.
    pub from: Option<f64>,
    /// Up to this instant `[s]`.
    pub to: Option<f64>,
    /// Points of each experiment at the most; the extremes of each stretch are kept.
    #[param(minimum = 2, maximum = 100_000, default = 2000)]
    pub max_points: Option<u64>,
}

impl FromQuery for TrajectoryQuery {
    fn read(query: &mut QueryReader) -> Self {
        let (from, to) = query.interval();
        Self {
            experiment: query.integer("experiment", 0, MAX_EXPERIMENTS as u64 - 1),
            from,
            to,
            max_points: query.integer("max_points", 2, MAX_POINTS),
        }
    }
}

impl TrajectoryQuery {
    pub(super) fn wants(&self, experiment: usize) -> bool {
        self.experiment
            .is_none_or(|wanted| wanted == experiment as u64)
    }

    /// Points of each experiment at the most.
    pub(super) fn points(&self) -> usize {
        let points = self.max_points.unwrap_or(DEFAULT_POINTS);
        usize::try_from(points).expect("the limit is small")
    }

    /// The samples that lie between the instants.
    pub(super) fn samples(&self, time: &[f64]) -> Range<usize> {
        let first = self
            .from
            .map_or(0, |from| time.partition_point(|t| *t < from));
        let end = self
            .to
            .map_or(time.len(), |to| time.partition_point(|t| *t <= to));
        first..end.max(first)
    }
}

/// Measured and simulated outputs.
#[derive(Serialize, ToSchema)]
pub struct Trajectory {
    /// The job.
    job: JobId,
    /// The experiments that were asked for, in the order of the job.
    experiments: Vec<Experiment>,
}

/// One experiment.
#[derive(Serialize, ToSchema)]
#[schema(as = TrajectoryExperiment)]
struct Experiment {
    /// The number of the experiment in the order of the job, from 0.
    experiment: usize,
    /// The recording.
    dataset: DatasetId,
    /// The first and the last instant that the job uses `[s]`, whatever part is shown.
    span_s: Option<[f64; 2]>,
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
    /// One standard deviation of the simulated samples through the errors of the estimates; absent where
    /// these are not known, or where there are too many samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    deviation: Option<Vec<Option<f64>>>,
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
    let simulated = computed::<ExperimentTrajectory>(&state, id).await?;
    let as_csv = prefers(&headers, "text/csv");
    let written = state.work.convert(move || {
        if as_csv {
            return Ok(results::csv(csv(&simulated, &query)));
        }
        let experiments = simulated.iter().enumerate();
        let wanted = experiments.filter(|(number, _)| query.wants(*number));
        let trajectory = Trajectory {
            job: id,
            experiments: wanted
                .map(|(number, of)| decimated(number, of, &query))
                .collect(),
        };
        Ok(json(StatusCode::OK, &trajectory))
    });
    written.await
}

fn decimated(
    number: usize,
    experiment: &ExperimentTrajectory,
    query: &TrajectoryQuery,
) -> Experiment {
    let outputs = experiment.outputs.iter();
    let columns: Vec<&[f64]> = outputs
        .flat_map(|output| [&output.measured[..], &output.simulated, &output.residual])
        .collect();
    let kept = kept_indices(&columns, query.samples(&experiment.time), query.points());
    let pick = |values: &[f64]| kept.iter().map(|&k| finite(values[k])).collect();
    let output = |output: &OutputTrajectory| Output {
        unit: output.unit.clone(),
        measured: pick(&output.measured),
        simulated: pick(&output.simulated),
        residual: pick(&output.residual),
        deviation: output.deviation.as_deref().map(pick),
    };
    let span = ExperimentSpan::of(&experiment.time, experiment.estimation_samples);
    Experiment {
        experiment: number,
        dataset: experiment.dataset,
        span_s: span.span_s,
        estimation_until_s: span.estimation_until_s,
        time_s: kept.iter().map(|&k| experiment.time[k]).collect(),
        outputs: experiment
            .outputs
            .iter()
            .map(|of| (of.name.clone(), output(of)))
            .collect(),
    }
}

/// The instants of an experiment that a client draws its plots between.
pub(super) struct ExperimentSpan {
    /// The first and the last instant `[s]`; none where there is no sample.
    pub span_s: Option<[f64; 2]>,
    /// The instant at which the samples that are held back begin, or the last one `[s]`.
    pub estimation_until_s: Option<f64>,
}

impl ExperimentSpan {
    pub(super) fn of(time: &[f64], estimation_samples: usize) -> Self {
        let (first, last) = (time.first().copied(), time.last().copied());
        Self {
            span_s: first.zip(last).map(|(first, last)| [first, last]),
            estimation_until_s: time.get(estimation_samples).copied().or(last),
        }
    }
}

pub(super) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// One row a sample; the first column counts the experiments from 0.
fn csv(experiments: &[ExperimentTrajectory], query: &TrajectoryQuery) -> String {
    let mut text = String::from("experiment,time [s]");
    for output in experiments.iter().take(1).flat_map(|e| &e.outputs) {
        let OutputTrajectory { name, unit, .. } = output;
        let columns = ["measured", "simulated", "residual"];
        text.extend(columns.map(|column| format!(",{name}_{column} [{unit}]")));
    }
    text.push('\n');
    let wanted = experiments.iter().enumerate();
    for (number, experiment) in wanted.filter(|(number, _)| query.wants(*number)) {
        for k in query.samples(&experiment.time) {
            push(&mut text, format_args!("{number},{}", experiment.time[k]));
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
pub(super) fn push_field(text: &mut String, value: f64) {
    match finite(value) {
        Some(value) => push(text, format_args!(",{value}")),
        None => text.push(','),
    }
}

pub(super) fn push(text: &mut String, words: std::fmt::Arguments<'_>) {
    text.write_fmt(words)
        .expect("writing to a string does not fail");
}
