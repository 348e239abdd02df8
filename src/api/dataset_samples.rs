//! The samples of a recording, thinned out for plots or all of them.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use utoipa::IntoParams;

use super::body::Bodies;
use super::datasets::csv;
use super::error::{Answer, Kind, Problem};
use super::extract::{Named, PathName as _};
use super::http_headers::{json, prefers};
use super::query::{FromQuery, Params, QueryReader};
use crate::store::DatasetPart;
use greybox::identification::DatasetId;
use greybox::parsing::Fault;
use greybox::recording::{Recording, Samples};

/// Points of a plot when the client does not say.
const DEFAULT_POINTS: u64 = 2000;
/// Points of a plot at the most.
const MAX_POINTS: u64 = 100_000;

/// Which samples.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct SamplesQuery {
    /// Names of signals, separated by commas; all when absent.
    #[param(value_type = Option<String>, example = "reference,position")]
    pub signals: Option<Vec<String>>,
    /// From this instant on `[s]`.
    pub from: Option<f64>,
    /// Up to this instant `[s]`.
    pub to: Option<f64>,
    /// Points at the most; the extremes of each stretch are kept.
    #[param(minimum = 2, maximum = 100_000, default = 2000)]
    pub max_points: Option<u64>,
}

impl FromQuery for SamplesQuery {
    fn read(query: &mut QueryReader) -> Self {
        let (from, to) = query.interval();
        Self {
            signals: named_signals(query),
            from,
            to,
            max_points: max_points(query),
        }
    }
}

/// The names of the signals whose samples are wanted.
pub(super) fn named_signals(query: &mut QueryReader) -> Option<Vec<String>> {
    let names = query.text("signals");
    names.map(|names| names.split(',').map(str::to_owned).collect())
}

/// The points of a plot that are wanted at the most.
pub(super) fn max_points(query: &mut QueryReader) -> Option<u64> {
    query.integer("max_points", 2, MAX_POINTS)
}

/// Read samples: decimated for plots as JSON, or all of them as CSV.
#[utoipa::path(
    get, path = "/v1/datasets/{id}/samples", operation_id = "read_samples", tag = "datasets",
    params(("id" = DatasetId, Path, description = "The recording"), SamplesQuery),
    responses((status = 200, description = "The samples in SI",
               content((Samples = "application/json"), (String = "text/csv"))))
)]
pub async fn samples(
    State(bodies): State<Bodies>,
    Named(id): Named<DatasetId>,
    Params(query): Params<SamplesQuery>,
    headers: HeaderMap,
) -> Answer {
    let permit = bodies.work.recording_permit().await?;
    let wants_csv = prefers(&headers, "text/csv");
    let part = DatasetPart {
        signals: query.signals.clone(),
        from: query.from,
        to: query.to,
    };
    let recording = match wants_csv {
        true => bodies.datasets.recording(id).await?,
        false => bodies.datasets.with_part(id, part).await?,
    };
    let recording = recording.ok_or_else(|| id.not_found())?;
    check_names(&recording, query.signals.as_deref())?;
    if wants_csv {
        return csv::answer(
            &bodies,
            whole(Arc::unwrap_or_clone(recording), query)?,
            permit,
        )
        .await;
    }
    let points = points(query.max_points);
    let written = bodies.work.convert_bytes(recording.bytes(), move || {
        let _permit = permit;
        let names = query.signals.as_deref();
        let samples = recording.decimate(names, query.from, query.to, points);
        Ok(json(StatusCode::OK, &samples))
    });
    written.await
}

/// The points of a plot at the most.
pub(super) fn points(wanted: Option<u64>) -> usize {
    let points = wanted.unwrap_or(DEFAULT_POINTS);
    usize::try_from(points).expect("the limit is small")
}

/// Refuses names of signals that a recording does not have.
pub(super) fn check_names(recording: &Recording, names: Option<&[String]>) -> Answer<()> {
    let names = names.into_iter().flatten();
    let unknown = names.filter(|name| recording.signal(name).is_none());
    let faults: Vec<Fault> = unknown
        .map(|name| {
            let detail = format!("the recording has no signal `{name}`");
            Fault::of_parameter("signals", "unknown_signal", detail)
        })
        .collect();
    if faults.is_empty() {
        Ok(())
    } else {
        Err(Problem::of_faults(Kind::Invalid, faults))
    }
}

/// A recording with the signals of which every sample is written.
fn whole(mut recording: Recording, query: SamplesQuery) -> Answer<Recording> {
    for (parameter, given) in [
        ("from", query.from.is_some()),
        ("to", query.to.is_some()),
        ("max_points", query.max_points.is_some()),
    ] {
        if given {
            let detail = "text/csv always has all samples".to_owned();
            return Err(query_fault(parameter, "invalid_parameter", detail));
        }
    }
    if let Some(names) = query.signals {
        recording
            .signals
            .retain(|signal| names.contains(&signal.name));
    }
    Ok(recording)
}

fn query_fault(parameter: &str, code: &'static str, detail: String) -> Problem {
    Problem::of_faults(
        Kind::Invalid,
        [Fault::of_parameter(parameter, code, detail)],
    )
}
