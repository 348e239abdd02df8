//! Agents write as they write to InfluxDB or to a PI server, and a mapping of the operator says which stream and
//! signal each series goes to.
//!
//! One request is one transaction. A point that is wrong is not stored at all and keeps no others out; it is told
//! as the server of its protocol tells it. A series that no rule names is listed under the mapping.

pub(super) mod credentials;
pub mod health;
pub mod omf;
pub mod omf_answer;
pub(super) mod protocol;

use axum::extract::{Query, Request, State};
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use super::ApiState;
use super::audit::ActedOn;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::streams::stamps::{latest, nanoseconds};
use crate::store::{BatchOutcome, Keep, MAX_STREAMS, NewBatch, NewWrite};
use greybox::intake::ReadError;
use greybox::intake::lines::{self, Precision};
use greybox::intake::spread::{RefusedPoints, StreamBatch, WrittenSamples};
use greybox::recording::MAX_SIGNALS;
use protocol::{Protocol, name_version};

/// Sentences on lines and streams in one answer at the most.
const MOST_SENTENCES: usize = 40;

/// An error as InfluxDB 1 tells it.
#[derive(Serialize, ToSchema)]
pub struct Influx1Error {
    /// The fault in words.
    #[schema(example = "partial write: unable to parse 'rig': missing fields dropped=1")]
    error: String,
}

/// An error as InfluxDB 2 tells it.
#[derive(Serialize, ToSchema)]
pub struct Influx2Error {
    /// The kind of error: `invalid`, `unauthorized`, `forbidden`, `not found`, `request too large`,
    /// `too many requests`, `unavailable` or `internal error`.
    #[schema(example = "invalid")]
    code: String,
    /// The fault in words.
    #[schema(example = "partial write: unable to parse 'rig': missing fields dropped=1")]
    message: String,
}

/// How a request of InfluxDB 1 is asked. Other parameters are not looked at.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
#[allow(dead_code, reason = "it describes a query that is read pair by pair")]
pub struct Influx1Query {
    /// The database: the name of a mapping.
    db: String,
    /// The unit of the stamps: `n`, `ns`, `u`, `us`, `ms`, `s`, `m` or `h`.
    #[param(default = "ns")]
    precision: Option<String>,
    /// The retention policy, which is not looked at: a stream says what it keeps.
    rp: Option<String>,
    /// The name of a user, which is not looked at.
    u: Option<String>,
    /// The secret of a token; looked at where `u` is given too.
    p: Option<String>,
}

/// How a request of InfluxDB 2 is asked. Other parameters are not looked at.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
#[allow(dead_code, reason = "it describes a query that is read pair by pair")]
pub struct Influx2Query {
    /// The bucket: the name of a mapping.
    bucket: String,
    /// The organization, which is not looked at: a token is of one project.
    org: Option<String>,
    /// The unit of the stamps: `ns`, `us`, `ms` or `s`, and those of InfluxDB 1.
    #[param(default = "ns")]
    precision: Option<String>,
}

/// The parameter of a query that names the mapping.
struct TargetParameter {
    name: &'static str,
    /// The word of the protocol for the target.
    target: &'static str,
}

const DATABASE: TargetParameter = TargetParameter {
    name: "db",
    target: "database",
};
const BUCKET: TargetParameter = TargetParameter {
    name: "bucket",
    target: "bucket",
};

/// Where lines go, and the unit of their stamps.
struct WriteTarget {
    protocol: Protocol,
    /// The name of the mapping.
    name: String,
    precision: Precision,
    /// The target of the request, for the audit log.
    acted_on: ActedOn,
}

impl WriteTarget {
    fn read(protocol: Protocol, parameter: &TargetParameter, uri: &Uri) -> Answer<Self> {
        let malformed = |detail: &str| Problem::new(Kind::Malformed, detail);
        let pairs = Query::<Vec<(String, String)>>::try_from_uri(uri);
        let Query(pairs) = pairs.map_err(|_| malformed("the query cannot be read"))?;
        let value = |name: &str| {
            let value = pairs.iter().find(|(key, _)| key == name);
            value
                .map(|(_, value)| value.as_str())
                .filter(|value| !value.is_empty())
        };
        let TargetParameter { name: key, target } = parameter;
        let name = value(key).ok_or_else(|| malformed(&format!("{target} is required")))?;
        let precision = value("precision").map_or(Some(Precision::NANOSECONDS), Precision::named);
        let precision = precision.ok_or_else(|| {
            malformed("invalid precision; valid precision units are n, ns, u, us, ms, s, m and h")
        })?;
        Ok(Self {
            protocol,
            name: name.to_owned(),
            precision,
            acted_on: ActedOn(format!("{}?{key}={name}", uri.path())),
        })
    }

    fn unknown(&self) -> Problem {
        self.protocol.unknown_target(&self.name)
    }
}

/// Write lines as to InfluxDB 1.
///
/// A mapping of the name `db` says which stream and signal each field goes to; what no rule names is listed at
/// `GET /v1/mappings/{name}` and not stored. Each line needs its stamp. Lines that are wrong are refused with 400
/// and `partial write: …` while the others are stored. The samples of one request are stored in one transaction,
/// also where they go to several streams; a line that is wrong is not stored at all. Writing the same lines again
/// changes nothing. Credentials are a token as `Authorization: Bearer` or `Token`, as the password of `Basic`, or
/// as `p` beside `u`.
#[utoipa::path(
    post, path = "/write", operation_id = "write_influx_1", tag = "agents",
    params(Influx1Query,
           ("Content-Encoding" = Option<String>, Header, example = "gzip",
            description = "`gzip` where the body is compressed")),
    request_body(
        description = "Lines of InfluxDB's line protocol",
        content((String = "text/plain",
                 example = "rig,hall=2 position=101.2,pressure=8.31e6 1465839830100400200\n"))
    ),
    responses((status = 204, description = "All lines are stored, or listed",
               headers(("X-Influxdb-Version" = String,
                        description = "The version of InfluxDB whose protocol is spoken"))))
)]
pub async fn write_influx_1(
    State(state): State<ApiState>,
    client: Client,
    request: Request,
) -> Answer {
    let target = WriteTarget::read(Protocol::Influx1, &DATABASE, request.uri())?;
    write(&state, client, target, request).await
}

/// Write lines as to InfluxDB 2.
///
/// A mapping of the name `bucket` says where they go, as at `POST /write`. Credentials are a token as
/// `Authorization: Token` or `Bearer`.
#[utoipa::path(
    post, path = "/api/v2/write", operation_id = "write_influx_2", tag = "agents",
    params(Influx2Query,
           ("Content-Encoding" = Option<String>, Header, example = "gzip",
            description = "`gzip` where the body is compressed")),
    request_body(
        description = "Lines of InfluxDB's line protocol",
        content((String = "text/plain",
                 example = "rig,hall=2 position=101.2,pressure=8.31e6 1465839830100400200\n"))
    ),
    responses((status = 204, description = "All lines are stored, or listed"))
)]
pub async fn write_influx_2(
    State(state): State<ApiState>,
    client: Client,
    request: Request,
) -> Answer {
    let target = WriteTarget::read(Protocol::Influx2, &BUCKET, request.uri())?;
    write(&state, client, target, request).await
}

async fn write(state: &ApiState, client: Client, target: WriteTarget, request: Request) -> Answer {
    let mappings = state.store.mappings();
    let mapping = mappings.find(&client.project, &target.name).await?;
    let mapping = mapping.ok_or_else(|| target.unknown())?.mapping;
    let limit = state.limits.dataset_bytes;
    let received = state.bodies.receive(request.into_body(), limit).await?;
    let _permit = state.work.recording_permit_of(received.bytes()).await?;
    let latest_ns = nanoseconds(latest(&state.limits));
    let precision = target.precision;
    let parsed = state.bodies.parse_received(received, move |text| {
        lines::written(text, &mapping, precision, latest_ns).map_err(not_read)
    });
    let stored = store(state, client, &target.name, parsed.await?.value).await?;
    let stored = stored.ok_or_else(|| target.unknown())?;
    if let Err(problem) = stored.into_answer() {
        return Err(problem.with_note(target.acted_on));
    }
    let mut response: Response = StatusCode::NO_CONTENT.into_response();
    name_version(response.headers_mut());
    response.extensions_mut().insert(target.acted_on);
    Ok(response)
}

/// What became of the points of a request.
struct StoredPoints {
    /// Points whose samples are stored, or whose series are listed.
    taken: u64,
    /// Points that are not.
    refused: RefusedPoints,
    /// Points that are refused and on which nothing is said.
    untold: u64,
}

/// Stores samples; nothing where the mapping has gone.
async fn store(
    state: &ApiState,
    client: Client,
    mapping: &str,
    written: WrittenSamples,
) -> Answer<Option<StoredPoints>> {
    let WrittenSamples {
        batches,
        unmapped,
        unlisted,
        mut taken,
        mut refused,
    } = written;
    for batch in &batches {
        client.check_append(&batch.stream)?;
    }
    let untold = untold(&refused);
    if taken > 0 {
        let sizes: Vec<(String, u64)> = batches
            .iter()
            .map(|batch| (batch.stream.clone(), batch.points))
            .collect();
        let batches = batches.into_iter().map(|batch| of_project(&client, batch));
        let new = NewWrite {
            batches: batches.collect(),
            project: client.project,
            mapping: mapping.to_owned(),
            unmapped,
            unlisted,
        };
        let Some(outcomes) = state.store.mappings().write(new).await? else {
            return Ok(None);
        };
        for ((stream, points), outcome) in sizes.into_iter().zip(outcomes) {
            let Some(sentence) = refusal(&stream, &outcome) else {
                continue;
            };
            refused.points += points;
            taken = taken.saturating_sub(points);
            if refused.told.len() < MOST_SENTENCES {
                refused.told.push(sentence);
            }
        }
    }
    Ok(Some(StoredPoints {
        taken,
        refused,
        untold,
    }))
}

/// A body that was not read to its end: it broke off, or its samples would take too much memory, which agents
/// that are told so send in parts.
fn not_read(error: ReadError) -> Problem {
    match error {
        ReadError::Malformed(_) => Problem::new(Kind::TooLarge, error.to_string()),
        error => error.into(),
    }
}

fn of_project(client: &Client, batch: StreamBatch) -> NewBatch {
    NewBatch {
        project: client.project.clone(),
        stream: batch.stream,
        batch: batch.batch,
        keep: Keep::default(),
        idempotency: None,
    }
}

/// Why a stream did not take its samples; nothing where it did.
fn refusal(stream: &str, outcome: &BatchOutcome) -> Option<String> {
    match outcome {
        BatchOutcome::Stored(..) | BatchOutcome::Replayed(_) => None,
        BatchOutcome::UnitsDiffer(signal, before, came) => Some(format!(
            "field type conflict: signal \"{signal}\" of stream \"{stream}\" is in `{before}`, and the mapping \
             makes it `{came}`"
        )),
        BatchOutcome::TooManySignals => Some(format!(
            "stream \"{stream}\" would have more than {MAX_SIGNALS} signals"
        )),
        BatchOutcome::TooManyStreams => Some(format!(
            "stream \"{stream}\" is new, and the project has {MAX_STREAMS} streams already"
        )),
        BatchOutcome::KeyReused | BatchOutcome::HourCameTwice => {
            Some(format!("stream \"{stream}\" did not take the samples"))
        }
    }
}

/// How many points are refused without a sentence.
fn untold(refused: &RefusedPoints) -> u64 {
    refused.points.saturating_sub(refused.told.len() as u64)
}

impl StoredPoints {
    fn new(taken: u64, refused: RefusedPoints) -> Self {
        Self {
            taken,
            untold: untold(&refused),
            refused,
        }
    }

    /// A refusal where points are refused, also where others are taken.
    fn into_answer(self) -> Answer<()> {
        match self.refused.points {
            0 => Ok(()),
            _ => Err(Problem::new(Kind::Malformed, self.told())),
        }
    }

    /// The sentence of InfluxDB on lines that were not stored, of which some are not told one by one.
    fn told(&self) -> String {
        let sentences = self.refused.told.join("\n");
        let more = match self.untold {
            0 => String::new(),
            more => format!("\nand {more} more"),
        };
        match self.taken {
            0 => format!("{sentences}{more}"),
            _ => {
                let dropped = self.refused.points;
                format!("partial write: {sentences}{more} dropped={dropped}")
            }
        }
    }
}
