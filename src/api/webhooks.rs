//! Webhooks: where events of a project are delivered, and what became of each delivery.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::Named;
use super::http_headers::json;
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, NoQuery, Params, QueryReader};
use crate::delivery::{Destinations, RefusedDestination, SigningSecret};
use crate::job::{DeliveryId, WebhookId};
use crate::store::{Deliveries, DeliveryRow, MAX_WEBHOOKS, WebhookRow, Webhooks};
use greybox::parsing::Fault;
use greybox::parsing::reader::{Field, read_document};

/// The types of events that are delivered.
pub const EVENTS: [&str; 2] = ["job.ended", "monitor.alarm"];

/// A webhook, as it is asked for.
#[derive(ToSchema)]
#[schema(example = json!({"url": "https://mes.plant.example/greybox", "events": ["job.ended"]}))]
#[allow(dead_code, reason = "it describes a body that is read field by field")]
pub struct WebhookSpec {
    /// The address that events are sent to, by POST.
    url: String,
    /// The types of events that are sent: `job.ended`, `monitor.alarm`; left out, all.
    #[schema(required = false)]
    events: Vec<String>,
}

/// A webhook.
#[derive(Serialize, ToSchema)]
pub struct Webhook {
    /// The identifier of the webhook.
    id: WebhookId,
    /// The address that events are sent to.
    url: String,
    /// The types of events that are sent.
    events: Vec<String>,
    /// What deliveries are signed with (Standard Webhooks); shown once, when the webhook is made.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false, example = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw")]
    secret: Option<String>,
    /// When the webhook was made.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
}

impl From<WebhookRow> for Webhook {
    fn from(row: WebhookRow) -> Self {
        Self {
            id: row.id,
            url: row.url,
            events: row.events,
            secret: None,
            created_at: row.created_at,
        }
    }
}

/// All webhooks of the project.
#[derive(Serialize, ToSchema)]
#[schema(as = Webhooks)]
pub struct WebhookList {
    /// The webhooks, the oldest first.
    items: Vec<Webhook>,
}

/// A delivery.
#[derive(Serialize, ToSchema)]
pub struct Delivery {
    /// The identifier of the delivery, the header `webhook-id` of each attempt.
    id: DeliveryId,
    /// The webhook.
    webhook: WebhookId,
    /// The type of the event.
    #[schema(example = "job.ended")]
    event: String,
    /// The document that is sent.
    #[schema(value_type = Object)]
    payload: Value,
    /// `waiting`, `delivered`, or `given_up` after three days or where the receiver answered 410 Gone.
    #[schema(value_type = String, example = "delivered")]
    state: &'static str,
    /// Attempts so far.
    attempts: u32,
    /// When the next attempt is due; `null` where no attempt is due.
    #[schema(value_type = Option<String>, format = DateTime)]
    next_attempt_at: Option<Timestamp>,
    /// The status that the receiver answered last.
    last_status: Option<u16>,
    /// Why the last attempt failed.
    last_error: Option<String>,
    /// When the event happened.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
    /// When the receiver took the delivery.
    #[schema(value_type = Option<String>, format = DateTime)]
    delivered_at: Option<Timestamp>,
}

impl From<DeliveryRow> for Delivery {
    fn from(row: DeliveryRow) -> Self {
        use crate::store::DeliveryState::Waiting;
        Self {
            id: row.id,
            webhook: row.webhook,
            event: row.event,
            payload: serde_json::from_str(&row.payload).unwrap_or_default(),
            state: row.state.as_str(),
            attempts: row.attempts,
            next_attempt_at: (row.state == Waiting).then_some(row.due_at),
            last_status: row.last_status,
            last_error: row.last_error,
            created_at: row.created_at,
            delivered_at: row.delivered_at,
        }
    }
}

/// Have events of the project delivered, as [Standard Webhooks](https://www.standardwebhooks.com)
/// says.
///
/// An event is stored with what it tells of and sent after that, at least once, with the same
/// `webhook-id` at each attempt. What the receiver does not answer with a status of success is tried
/// again, after 5 s at first, for three days; a receiver that answers 410 Gone ends all that waits for it. Only destinations that the server was started with are
/// delivered to; redirects are not followed.
#[utoipa::path(
    post, path = "/v1/webhooks", operation_id = "create_webhook", tag = "access",
    request_body(content = WebhookSpec, content_type = "application/json"),
    responses(
        (status = 201, description = "It is stored; its secret is shown this once", body = Webhook,
         headers(("Location" = String, description = "Where the webhook is"))),
        (status = 409, description = "The project has as many webhooks as it may")
    )
)]
pub async fn create(
    State(webhooks): State<Webhooks>,
    State(destinations): State<Arc<Destinations>>,
    client: Client,
    _query: Params<NoQuery>,
    document: JsonDocument,
) -> Answer {
    let (url, events) = read_document(&document.value, read).map_err(Problem::of_document)?;
    destinations.check(&url).map_err(refused)?;
    let secret = SigningSecret::new().map_err(|error| {
        tracing::error!(%error, "the system gives no random bytes");
        Problem::of_status(StatusCode::INTERNAL_SERVER_ERROR)
    })?;
    let row = WebhookRow {
        id: WebhookId::new(),
        project: client.project,
        url,
        events,
        secret: secret.expose(),
        created_at: Timestamp::now(),
    };
    if !webhooks.insert(row.clone()).await? {
        let detail = format!("a project has {MAX_WEBHOOKS} webhooks at the most");
        return Err(Problem::new(Kind::WrongState, detail));
    }
    let location = HeaderValue::from_str(&format!("/v1/webhooks/{}", row.id));
    let mut shown = Webhook::from(row);
    shown.secret = Some(secret.expose());
    let mut response = json(StatusCode::CREATED, &shown);
    let location = location.expect("an identifier is visible ASCII");
    response.headers_mut().insert(header::LOCATION, location);
    Ok(response)
}

fn read(root: &Field<'_>) -> Option<(String, Vec<String>)> {
    let mut object = root.object()?;
    let url = object.required("url").and_then(|field| field.text());
    let events = object.optional("events");
    let events = events.map(|field| read_events(&field));
    object.finish();
    let all = || EVENTS.map(str::to_owned).to_vec();
    Some((url?.to_owned(), events.unwrap_or_else(|| Some(all()))?))
}

fn read_events(field: &Field<'_>) -> Option<Vec<String>> {
    let mut events: Vec<String> = Vec::new();
    for entry in field.array()? {
        let name = entry.text()?;
        if !EVENTS.contains(&name) {
            let detail = format!("the types of events are {}", EVENTS.join(", "));
            entry.fault("unknown_event", detail);
        } else if events.iter().any(|before| before == name) {
            entry.fault("duplicate", format!("`{name}` is named twice"));
        }
        events.push(name.to_owned());
    }
    if events.is_empty() {
        field.fault("empty", "it names no type of events".to_owned());
    }
    Some(events)
}

/// A destination that nothing is delivered to: a fault where it is no address, else not allowed.
fn refused(refused: RefusedDestination) -> Problem {
    let detail = refused.to_string();
    match refused {
        RefusedDestination::Form(_) => {
            Problem::of_document(vec![Fault::new("/url", "invalid_url", detail)])
        }
        _ => Problem::new(Kind::Forbidden, detail),
    }
}

/// List the webhooks of the project.
#[utoipa::path(
    get, path = "/v1/webhooks", operation_id = "list_webhooks", tag = "access",
    responses((status = 200, description = "All webhooks", body = WebhookList))
)]
pub async fn list(
    State(webhooks): State<Webhooks>,
    client: Client,
    _query: Params<NoQuery>,
) -> Answer {
    let rows = webhooks.list(&client.project).await?;
    let items = rows.into_iter().map(Webhook::from).collect();
    Ok(json(StatusCode::OK, &WebhookList { items }))
}

/// Show a webhook, without its secret.
#[utoipa::path(
    get, path = "/v1/webhooks/{id}", operation_id = "show_webhook", tag = "access",
    params(("id" = WebhookId, Path, description = "The webhook")),
    responses((status = 200, description = "The webhook", body = Webhook))
)]
pub async fn show(
    State(webhooks): State<Webhooks>,
    Named(id): Named<WebhookId>,
    _query: Params<NoQuery>,
) -> Answer {
    let row = webhooks.find(id).await?;
    let row = row.ok_or_else(|| no_webhook(id))?;
    Ok(json(StatusCode::OK, &Webhook::from(row)))
}

fn no_webhook(id: WebhookId) -> Problem {
    Problem::not_found("webhook", &id.to_string())
}

/// Remove a webhook with its deliveries; nothing more is sent there.
#[utoipa::path(
    delete, path = "/v1/webhooks/{id}", operation_id = "remove_webhook", tag = "access",
    params(("id" = WebhookId, Path, description = "The webhook")),
    responses((status = 204, description = "It is removed"))
)]
pub async fn remove(
    State(webhooks): State<Webhooks>,
    Named(id): Named<WebhookId>,
    _query: Params<NoQuery>,
) -> Answer {
    match webhooks.delete(id).await? {
        true => Ok(StatusCode::NO_CONTENT.into_response()),
        false => Err(no_webhook(id)),
    }
}

/// The page of a list.
pub struct WhichDeliveries(Cursor<DeliveryId>);

impl FromQuery for WhichDeliveries {
    fn read(query: &mut QueryReader) -> Self {
        Self(Cursor::read(query))
    }
}

/// List the deliveries of a webhook, newest first.
#[utoipa::path(
    get, path = "/v1/webhooks/{id}/deliveries", operation_id = "list_deliveries", tag = "access",
    params(("id" = WebhookId, Path, description = "The webhook"), PageParams),
    responses((status = 200, description = "A page of deliveries", body = Page<Delivery>,
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn deliveries(
    State(webhooks): State<Webhooks>,
    State(deliveries): State<Deliveries>,
    Named(id): Named<WebhookId>,
    Params(WhichDeliveries(cursor)): Params<WhichDeliveries>,
    uri: Uri,
) -> Answer {
    if webhooks.find(id).await?.is_none() {
        return Err(no_webhook(id));
    }
    let page = deliveries.list(id, cursor.before, cursor.limit).await?;
    let items: Vec<Delivery> = page.rows.into_iter().map(Delivery::from).collect();
    Ok(Page::new(items, page.next.map(|id| id.to_string())).answer(&uri))
}

/// Show a delivery.
#[utoipa::path(
    get, path = "/v1/deliveries/{id}", operation_id = "show_delivery", tag = "access",
    params(("id" = DeliveryId, Path, description = "The delivery")),
    responses((status = 200, description = "The delivery", body = Delivery))
)]
pub async fn show_delivery(
    State(deliveries): State<Deliveries>,
    Named(id): Named<DeliveryId>,
    _query: Params<NoQuery>,
) -> Answer {
    shown(&deliveries, id, StatusCode::OK).await
}

async fn shown(deliveries: &Deliveries, id: DeliveryId, status: StatusCode) -> Answer<Response> {
    let row = deliveries.find(id).await?;
    let row = row.ok_or_else(|| Problem::not_found("delivery", &id.to_string()))?;
    Ok(json(status, &Delivery::from(row)))
}

/// Send a delivery once more, now, whatever became of it.
#[utoipa::path(
    post, path = "/v1/deliveries/{id}/resend", operation_id = "resend_delivery", tag = "access",
    params(("id" = DeliveryId, Path, description = "The delivery")),
    responses((status = 202, description = "It will be sent", body = Delivery))
)]
pub async fn resend(
    State(deliveries): State<Deliveries>,
    Named(id): Named<DeliveryId>,
    _query: Params<NoQuery>,
) -> Answer {
    deliveries.resend(id).await?;
    shown(&deliveries, id, StatusCode::ACCEPTED).await
}
