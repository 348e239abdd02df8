//! What acted on the plant beside its inputs over the recordings of a result, for plots or whole.

use std::collections::BTreeMap;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde::Serialize;
use utoipa::ToSchema;

use super::computed::computed;
use super::error::Answer;
use super::extract::Named;
use super::http_headers::{json, prefers};
use super::query::Params;
use super::trajectory::{ExperimentSpan, TrajectoryQuery, finite, push, push_field};
use super::{ApiState, results};
use greybox::identification::assemble::{
    DatedEvent, DisturbancePath, ExperimentDisturbances, NamedPath, OutputInnovations,
};
use greybox::identification::spec::{ActsOnSpec, NoiseKind};
use greybox::identification::{DatasetId, JobId};
use greybox::recording::kept_indices;

/// Events of one disturbance that are listed at the most.
const MOST_EVENTS: usize = 200;

/// What acted on the plant beside its inputs.
#[derive(Serialize, ToSchema)]
pub struct Disturbances {
    /// The job.
    job: JobId,
    /// The experiments that were asked for, in the order of the job.
    experiments: Vec<DisturbanceExperiment>,
}

/// One experiment.
#[derive(Serialize, ToSchema)]
struct DisturbanceExperiment {
    /// The number of the experiment in the order of the job, from 0.
    experiment: usize,
    /// The recording.
    dataset: DatasetId,
    /// The first and the last instant that the job uses `[s]`, whatever part is shown.
    span_s: Option<[f64; 2]>,
    /// Where the data that were estimated from end and those held back begin `[s]`. The disturbances are
    /// those that all samples show, held-back ones included.
    estimation_until_s: Option<f64>,
    /// The instants, from the recording's first sample `[s]`.
    time_s: Vec<f64>,
    /// The disturbances of the noise model that was chosen, in the order of the result.
    disturbances: Vec<DisturbanceSeries>,
    /// The states of the model by name, as all samples put them.
    states: BTreeMap<String, SmoothedState>,
    /// The measured outputs by name, as they are expected from sample to sample.
    outputs: BTreeMap<String, OutputPrediction>,
}

/// One disturbance at the instants, SI.
#[derive(Serialize, ToSchema)]
struct DisturbanceSeries {
    /// What the disturbance acts on; a state's rate is disturbed.
    acts_on: ActsOnSpec,
    /// How the disturbance moves.
    kind: NoiseKind,
    /// The SI unit of what the disturbance acts on: that of `value`, `deviation` and `size`.
    #[schema(example = "m/s/s")]
    unit: String,
    /// The disturbance at each instant; white noise as its mean from the sample to the next, `null` at the last.
    value: Vec<Option<f64>>,
    /// One standard deviation of the error of `value`.
    deviation: Vec<Option<f64>>,
    /// What the disturbance received from each sample to the next, in units of what the samples could show of it:
    /// standard normal where the noise model holds. `null` at the last sample, and where no later sample tells.
    t: Vec<Option<f64>>,
    /// The events in the order of time: stretches in which `t` is beyond 4. Where there are more than 200, the
    /// largest.
    events: Vec<ListedEvent>,
    /// The number of events, those that are not listed included.
    event_count: usize,
    /// For each output the share of its variance that the disturbance makes.
    share_of_output: BTreeMap<String, f64>,
}

/// A stretch of time in which a disturbance received more than its noise model expects.
#[derive(Serialize, ToSchema)]
#[schema(as = DisturbanceEvent)]
struct ListedEvent {
    /// When the event begins `[s]`.
    start_s: f64,
    /// When the event ends `[s]`.
    end_s: f64,
    /// When `t` is largest `[s]`.
    peak_s: f64,
    /// `t` there.
    t: f64,
    /// How large the event is, in the disturbance's unit: the mean of white noise over the event, the change of any
    /// other disturbance from the start of the event to its end.
    size: f64,
}

/// A state at the instants, SI.
#[derive(Serialize, ToSchema)]
struct SmoothedState {
    /// The SI unit.
    #[schema(example = "m/s")]
    unit: String,
    /// As all samples put it.
    value: Vec<Option<f64>>,
    /// One standard deviation of its error.
    deviation: Vec<Option<f64>>,
}

/// One output at the instants, SI, as it is expected from all samples before.
#[derive(Serialize, ToSchema)]
struct OutputPrediction {
    /// The SI unit.
    #[schema(example = "m")]
    unit: String,
    /// As expected before the sample is read.
    expected: Vec<Option<f64>>,
    /// measured − expected; `null` where a sample is missing.
    innovation: Vec<Option<f64>>,
    /// The standard deviation that the innovation should have.
    deviation: Vec<Option<f64>>,
}

/// Show what acted on the plant beside its inputs, where the result has process noise: decimated for plots as JSON,
/// or every sample as CSV.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/disturbance", operation_id = "read_disturbance", tag = "jobs",
    params(("id" = JobId, Path, description = "The job"), TrajectoryQuery),
    responses(
        (status = 200, description = "The disturbances with their bands and events",
         content((Disturbances = "application/json"), (String = "text/csv"))),
        (status = 409, description = "There is no result, or not yet, it has no process noise, or its recording is gone")
    )
)]
pub async fn disturbance(
    State(state): State<ApiState>,
    Named(id): Named<JobId>,
    Params(query): Params<TrajectoryQuery>,
    headers: HeaderMap,
) -> Answer {
    let smoothed = computed::<ExperimentDisturbances>(&state, id).await?;
    let as_csv = prefers(&headers, "text/csv");
    let written = state.work.convert(move || {
        if as_csv {
            return Ok(results::csv(csv(&smoothed, &query)));
        }
        let experiments = smoothed.iter().enumerate();
        let wanted = experiments.filter(|(number, _)| query.wants(*number));
        let disturbances = Disturbances {
            job: id,
            experiments: wanted
                .map(|(number, of)| decimated(number, of, &query))
                .collect(),
        };
        Ok(json(StatusCode::OK, &disturbances))
    });
    written.await
}

fn decimated(
    number: usize,
    experiment: &ExperimentDisturbances,
    query: &TrajectoryQuery,
) -> DisturbanceExperiment {
    let of_disturbances = experiment.disturbances.iter();
    let columns: Vec<&[f64]> = of_disturbances
        .flat_map(|of| [&of.path.values[..], &of.residuals])
        .chain(experiment.outputs.iter().map(|of| &of.innovation[..]))
        .collect();
    let samples = query.samples(&experiment.time);
    let part = match samples.clone().last() {
        Some(last) => [experiment.time[samples.start], experiment.time[last]],
        None => [f64::INFINITY, f64::NEG_INFINITY],
    };
    let kept = kept_indices(&columns, samples, query.points());
    let disturbances = experiment.disturbances.iter();
    let states = experiment.states.iter();
    let outputs = experiment.outputs.iter();
    let span = ExperimentSpan::of(&experiment.time, experiment.estimation_samples);
    DisturbanceExperiment {
        experiment: number,
        dataset: experiment.dataset,
        span_s: span.span_s,
        estimation_until_s: span.estimation_until_s,
        time_s: kept.iter().map(|&k| experiment.time[k]).collect(),
        disturbances: disturbances.map(|of| series(of, part, &kept)).collect(),
        states: states.map(|of| state_series(of, &kept)).collect(),
        outputs: outputs.map(|of| prediction(of, &kept)).collect(),
    }
}

fn pick(values: &[f64], kept: &[usize]) -> Vec<Option<f64>> {
    kept.iter().map(|&k| finite(values[k])).collect()
}

/// A disturbance at the instants that are kept, and its events that reach into a part of the time.
fn series(
    disturbance: &DisturbancePath,
    [from, to]: [f64; 2],
    kept: &[usize],
) -> DisturbanceSeries {
    let events = disturbance.events.iter();
    let inside = |event: &&DatedEvent| event.end >= from && event.start <= to;
    let mut events: Vec<&DatedEvent> = events.filter(inside).collect();
    let event_count = events.len();
    events.sort_by(|a, b| b.residual.abs().total_cmp(&a.residual.abs()));
    events.truncate(MOST_EVENTS);
    events.sort_by(|a, b| a.start.total_cmp(&b.start));
    DisturbanceSeries {
        acts_on: disturbance.acts_on.clone(),
        kind: disturbance.kind,
        unit: disturbance.unit.clone(),
        value: pick(&disturbance.path.values, kept),
        deviation: pick(&disturbance.path.deviations, kept),
        t: pick(&disturbance.residuals, kept),
        events: events
            .into_iter()
            .map(|event| ListedEvent {
                start_s: event.start,
                end_s: event.end,
                peak_s: event.peak,
                t: event.residual,
                size: event.size,
            })
            .collect(),
        event_count,
        share_of_output: disturbance.share_of_output.clone(),
    }
}

fn state_series(state: &NamedPath, kept: &[usize]) -> (String, SmoothedState) {
    let series = SmoothedState {
        unit: state.unit.clone(),
        value: pick(&state.path.values, kept),
        deviation: pick(&state.path.deviations, kept),
    };
    (state.name.clone(), series)
}

fn prediction(output: &OutputInnovations, kept: &[usize]) -> (String, OutputPrediction) {
    let prediction = OutputPrediction {
        unit: output.unit.clone(),
        expected: pick(&output.expected.values, kept),
        innovation: pick(&output.innovation, kept),
        deviation: pick(&output.expected.deviations, kept),
    };
    (output.name.clone(), prediction)
}

/// The name of a disturbance's column.
fn column_name(acts_on: &ActsOnSpec) -> String {
    match acts_on {
        ActsOnSpec::Parameter(name) => name.clone(),
        ActsOnSpec::State(name) => format!("rate_of_{name}"),
        ActsOnSpec::Output(name) => format!("sensor_of_{name}"),
        ActsOnSpec::Sampled(name) => format!("computed_{name}"),
    }
}

/// One row a sample; the first column counts the experiments from 0.
fn csv(experiments: &[ExperimentDisturbances], query: &TrajectoryQuery) -> String {
    let mut text = String::from("experiment,time [s]");
    if let Some(first) = experiments.first() {
        for disturbance in &first.disturbances {
            let (name, unit) = (column_name(&disturbance.acts_on), &disturbance.unit);
            let columns = format!(",{name} [{unit}],{name}_deviation [{unit}],{name}_t [1]");
            text.push_str(&columns);
        }
        for NamedPath { name, unit, .. } in &first.states {
            text.push_str(&format!(",{name} [{unit}],{name}_deviation [{unit}]"));
        }
        for OutputInnovations { name, unit, .. } in &first.outputs {
            let columns = ["expected", "innovation", "innovation_deviation"];
            text.extend(columns.map(|column| format!(",{name}_{column} [{unit}]")));
        }
    }
    text.push('\n');
    let wanted = experiments.iter().enumerate();
    for (number, experiment) in wanted.filter(|(number, _)| query.wants(*number)) {
        let disturbances = experiment.disturbances.iter();
        let disturbances =
            disturbances.flat_map(|of| [&of.path.values, &of.path.deviations, &of.residuals]);
        let states = experiment.states.iter();
        let states = states.flat_map(|of| [&of.path.values, &of.path.deviations]);
        let outputs = experiment.outputs.iter();
        let outputs =
            outputs.flat_map(|of| [&of.expected.values, &of.innovation, &of.expected.deviations]);
        let series: Vec<&Vec<f64>> = disturbances.chain(states).chain(outputs).collect();
        for k in query.samples(&experiment.time) {
            push(&mut text, format_args!("{number},{}", experiment.time[k]));
            series
                .iter()
                .for_each(|values| push_field(&mut text, values[k]));
            text.push('\n');
        }
    }
    text
}
