//! AVEVA's adapters and other senders of the Open Message Format write as to a PI server.

use std::collections::BTreeMap;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode};
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use super::omf_answer::OmfAnswer;
use super::protocol::Protocol;
use super::{ActedOn, StoredPoints, not_read, store};
use crate::access::Project;
use crate::api::ApiState;
use crate::api::client::Client;
use crate::api::error::{Answer, Kind, Problem};
use crate::api::extract::Named;
use crate::api::http_headers::json;
use crate::api::mappings::MappingName;
use crate::api::streams::stamps::{latest, nanoseconds};
use crate::store::{DefinitionsPut, MAX_DEFINITION_BYTES, MAX_DEFINITIONS};
use greybox::intake::omf::{self, MOST_OMF_BYTES, OmfDefinitions, OmfError, OmfHeader, OmfMessage};

/// The mapping of senders that name none.
const DEFAULT_MAPPING: &str = "omf";

/// What the headers of a request say. Other headers are not looked at.
#[derive(IntoParams)]
#[into_params(parameter_in = Header)]
#[allow(dead_code, reason = "it describes headers that `OmfHeader` reads")]
pub struct OmfHeaders {
    /// `type`, `container` or `data`; `schema` or `instance` for OMF 2.0.
    #[param(example = "data")]
    messagetype: String,
    /// `1.0`, `1.1`, `1.2` or `2.0`.
    #[param(example = "1.2")]
    omfversion: String,
    /// `create`, `update` or `delete`; `create` where it is left out.
    #[param(example = "create")]
    action: Option<String>,
    /// `json`.
    #[param(example = "json")]
    messageformat: Option<String>,
    /// `gzip` where the body is compressed.
    #[param(example = "gzip")]
    compression: Option<String>,
}

/// Messages of OMF, 2 MiB at the most.
#[derive(Serialize, ToSchema)]
#[serde(untagged)]
#[schema(example = json!([{"containerid": "Tank-1.Pressure",
                           "values": [{"Timestamp": "2026-03-02T08:15:00Z", "Value": 1.5}]}]))]
#[allow(
    dead_code,
    reason = "it describes a body that `OmfHeader` says how to read"
)]
pub enum OmfBody {
    /// Types, containers or data of OMF 1.0 to 1.2.
    Messages(Vec<serde_json::Value>),
    /// Named arrays of OMF 2.0.
    Arrays(BTreeMap<String, Vec<serde_json::Value>>),
}

/// Write messages of the Open Message Format (OMF) by the mapping `omf`.
///
/// As `POST /omf/{name}` with the name `omf`.
#[utoipa::path(
    post, path = "/omf", operation_id = "write_omf", tag = "agents",
    params(OmfHeaders),
    request_body(content = OmfBody, content_type = "application/json"),
    responses((status = 200, description = "All is stored, or listed", body = OmfAnswer))
)]
pub async fn write_default(
    State(state): State<ApiState>,
    client: Client,
    request: Request,
) -> Answer {
    write_by(&state, client, DEFAULT_MAPPING, request).await
}

/// Write messages of the Open Message Format (OMF) 1.0, 1.1, 1.2 or 2.0.
///
/// A mapping of the name in the path says which stream and signal each property of a container goes to: the container's
/// id is the measurement of a rule, the property the field. What no rule names is listed at `GET /v1/mappings/{name}`
/// and not stored. Types and containers are stored as they come, also in the place of those of their ids: the property
/// with `isindex` is the instant; a unit (`uom`) and an interpolation count where the rule leaves them out; properties
/// with `isquality` say how good a value is, by the codes that the rule names; names of an enumeration become its
/// numbers. Values of a container that is not defined are refused, and so are values without an instant. Static data
/// and links are not looked at. The samples of one request are stored in one transaction; a value that is wrong is not
/// stored at all and keeps no other out. Credentials are a token as `Authorization: Bearer`, as the password of
/// `Basic`, or as `producertoken`.
#[utoipa::path(
    post, path = "/omf/{name}", operation_id = "write_omf_by_mapping", tag = "agents",
    params(("name" = String, Path, description = "The mapping", example = "plant"), OmfHeaders),
    request_body(content = OmfBody, content_type = "application/json"),
    responses((status = 200, description = "All is stored, or listed", body = OmfAnswer))
)]
pub async fn write(
    State(state): State<ApiState>,
    client: Client,
    Named(MappingName(name)): Named<MappingName>,
    request: Request,
) -> Answer {
    write_by(&state, client, &name, request).await
}

async fn write_by(state: &ApiState, client: Client, name: &str, request: Request) -> Answer {
    let acted_on = ActedOn(format!("/omf/{name}"));
    let target = OmfTarget {
        state,
        name,
        project: client.project.clone(),
    };
    match target.write(client, request).await {
        Ok(remarks) => {
            let mut response = json(StatusCode::OK, &OmfAnswer::success(remarks));
            response.extensions_mut().insert(acted_on);
            Ok(response)
        }
        Err(problem) => Err(problem.with_note(acted_on)),
    }
}

/// Where messages go.
struct OmfTarget<'s> {
    state: &'s ApiState,
    /// The name of the mapping.
    name: &'s str,
    project: Project,
}

impl OmfTarget<'_> {
    /// Stores what a request says, and tells what there is to say.
    async fn write(&self, client: Client, request: Request) -> Answer<Vec<String>> {
        let header = header(request.headers());
        let header = header.map_err(|detail| Problem::new(Kind::Malformed, detail))?;
        let mappings = self.state.store.mappings();
        let mapping = mappings.find(&self.project, self.name).await?;
        let mapping = mapping.ok_or_else(|| self.unknown())?.mapping;
        let bodies = &self.state.bodies;
        let received = bodies.receive(request.into_body(), MOST_OMF_BYTES).await?;
        let bytes = received.bytes();
        let _permit = self.state.work.recording_permit_of(bytes).await?;
        let parsed = bodies.parse_received(received, move |text| {
            omf::read(text, header).map_err(not_taken)
        });
        match parsed.await?.value {
            OmfMessage::Definitions(definitions) => self.define(definitions).await,
            OmfMessage::Data(data) => {
                let passed_over = data.passed_over;
                let containers = data.containers();
                let containers = mappings.containers(&self.project, self.name, containers);
                let containers = containers.await?;
                let latest_ns = nanoseconds(latest(&self.state.limits));
                let written = self.state.work.convert_bytes(bytes, move || {
                    omf::spread(data, mapping, &containers, latest_ns).map_err(not_read)
                });
                let stored = store(self.state, client, self.name, written.await?).await?;
                let stored = stored.ok_or_else(|| self.unknown())?;
                stored.into_answer()?;
                let remark = format!(
                    "{passed_over} messages with static data or links are not samples and are not kept"
                );
                Ok((passed_over > 0).then_some(remark).into_iter().collect())
            }
        }
    }

    /// Stores types and containers, those that are right also where others are wrong.
    async fn define(&self, definitions: OmfDefinitions) -> Answer<Vec<String>> {
        let OmfDefinitions { changes, refused } = definitions;
        let stored = StoredPoints::new(changes.len() as u64, refused);
        let mappings = self.state.store.mappings();
        match mappings.define(&self.project, self.name, changes).await? {
            DefinitionsPut::Stored => stored.into_answer().map(|()| Vec::new()),
            DefinitionsPut::NoMapping => Err(self.unknown()),
            DefinitionsPut::TooMany => {
                let detail = format!(
                    "a mapping has {MAX_DEFINITIONS} types and containers and {} MiB of them at the most",
                    MAX_DEFINITION_BYTES >> 20
                );
                Err(Problem::new(Kind::Malformed, detail))
            }
        }
    }

    fn unknown(&self) -> Problem {
        Protocol::Omf.unknown_target(self.name)
    }
}

fn header(headers: &HeaderMap) -> Result<OmfHeader, String> {
    OmfHeader::read(|name| headers.get(name)?.to_str().ok())
}

fn not_taken(error: OmfError) -> Problem {
    match error {
        OmfError::Source(error) => error.into(),
        OmfError::TooLarge => Problem::new(Kind::TooLarge, error.to_string()),
        OmfError::Malformed(detail) => Problem::new(Kind::Malformed, detail),
    }
}
