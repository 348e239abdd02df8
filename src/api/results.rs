//! What a job came to: the history of its search and its result.

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use super::ApiState;
use super::error::Answer;
use super::extract::Named;
use super::finished_job::{result_of, unreadable};
use super::http_headers::{json, prefers, tagged_stored};
use super::jobs::no_job;
use super::query::{FromQuery, NoQuery, Params, QueryReader};
use crate::job::{GenerationEvent, JobKind, ResultOfJob};
use crate::store::{Jobs, Results};
use greybox::identification::{JobId, Outcome};

/// Rows of the history in one answer when the client does not say.
const DEFAULT_ROWS: u64 = 1000;
/// Rows of the history in one answer at the most.
const MAX_ROWS: u64 = 10_000;

/// Which part of the history.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct GenerationsQuery {
    /// Only generations after this one.
    #[param(value_type = u64, maximum = 4294967295_i64, default = 0, required = false)]
    pub after: u32,
    /// The most generations in one answer.
    #[param(minimum = 1, maximum = 10000, default = 1000, required = false)]
    pub limit: u32,
}

impl FromQuery for GenerationsQuery {
    fn read(query: &mut QueryReader) -> Self {
        let small = |number: u64| u32::try_from(number).expect("the range was checked");
        let after = query.integer("after", 0, u32::MAX.into()).unwrap_or(0);
        let limit = query.integer("limit", 1, MAX_ROWS).unwrap_or(DEFAULT_ROWS);
        Self {
            after: small(after),
            limit: small(limit),
        }
    }
}

/// A part of the history of a search.
#[derive(Serialize, ToSchema)]
#[schema(as = Generations)]
pub struct GenerationList {
    /// The generations, in order.
    items: Vec<GenerationEvent>,
}

/// Read the history of a search, a row a generation: as JSON, or as CSV with the champion's
/// parameters in columns.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/generations", operation_id = "read_generations", tag = "jobs",
    params(("id" = JobId, Path, description = "The job"), GenerationsQuery),
    responses((status = 200, description = "Generations in order; fewer than `limit` when there \
                                            are no more yet",
               content((GenerationList = "application/json"), (String = "text/csv"))))
)]
pub async fn generations(
    State(state): State<ApiState>,
    Named(id): Named<JobId>,
    Params(query): Params<GenerationsQuery>,
    headers: HeaderMap,
) -> Answer {
    let items = state
        .store
        .generations()
        .after(id, query.after, query.limit)
        .await?;
    if items.is_empty() && state.store.jobs().find(id).await?.is_none() {
        return Err(no_job(id));
    }
    let as_csv = prefers(&headers, "text/csv");
    let written = state.work.convert(move || {
        Ok(match as_csv {
            true => csv(GenerationEvent::csv(&items)),
            false => json(StatusCode::OK, &GenerationList { items }),
        })
    });
    written.await
}

/// An answer in CSV.
pub fn csv(text: String) -> Response {
    let csv_type = HeaderValue::from_static("text/csv; charset=utf-8");
    ([(header::CONTENT_TYPE, csv_type)], text).into_response()
}

/// Read the estimate, the experiment of a design, or the windows of a selection: final when the job succeeded, the best
/// so far when it was paused or cancelled. As JSON in full, or as CSV: the estimates alone, what a design plays, or the
/// chosen windows.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/result", operation_id = "read_result", tag = "jobs",
    params(
        ("id" = JobId, Path, description = "The job"),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` that the client has")
    ),
    responses(
        (status = 200, description = "The result",
         content((ResultOfJob = "application/json"), (String = "text/csv")),
         headers(("ETag" = String, description = "Changes with the answer"))),
        (status = 304, description = "The client has this already"),
        (status = 409, description = "There is no result, or not yet")
    )
)]
pub async fn result(
    State(jobs): State<Jobs>,
    State(results): State<Results>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
) -> Answer {
    let row = jobs.find(id).await?.ok_or_else(|| no_job(id))?;
    let result = result_of(&results, &row).await?;
    if !prefers(&headers, "text/csv") {
        return Ok(tagged_stored(&headers, result.into_json()));
    }
    let table = match row.task.kind() {
        JobKind::Design => result.design().map(|design| design.csv()),
        JobKind::Selection => result.selection().map(|selection| selection.csv()),
        JobKind::Identification => result.outcome().map(|outcome| estimates_csv(&outcome)),
    };
    table.map(csv).map_err(unreadable)
}

fn estimates_csv(outcome: &Outcome) -> String {
    let mut text = String::from(
        "name,experiment,unit,estimate,standard_error,interval_lower,interval_upper,\
         interval_method,range_lower,range_upper,at_bound,identifiable\n",
    );
    let parameters = outcome.parameters.iter().map(|parameter| {
        let named = (&parameter.name, &parameter.unit, &parameter.estimate);
        let experiment = parameter.experiment;
        (
            named,
            experiment.map_or_else(String::new, |place| place.to_string()),
        )
    });
    let states = outcome.initial_states.iter().map(|state| {
        let named = (&state.state, &state.unit, &state.estimate);
        (named, state.experiment.to_string())
    });
    let field = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    for ((name, unit, estimate), experiment) in parameters.chain(states) {
        let interval = estimate.confidence_interval.as_ref();
        let fields = [
            name.clone(),
            experiment,
            unit.clone(),
            estimate.estimate.to_string(),
            field(estimate.standard_error),
            field(interval.and_then(|interval| interval.lower)),
            field(interval.and_then(|interval| interval.upper)),
            interval.map_or_else(String::new, |interval| interval.method.clone()),
            estimate.lower.to_string(),
            estimate.upper.to_string(),
            estimate.at_bound.to_string(),
            estimate.identifiable.to_string(),
        ];
        text.push_str(&fields.join(","));
        text.push('\n');
    }
    text
}
