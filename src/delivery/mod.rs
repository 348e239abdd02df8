//! Delivers events to the places that want them, as Standard Webhooks says: signed, at least once,
//! with the same identifier at each attempt, and tried for three days.
//!
//! An event is stored with what it tells of and sent after; what was on its way when the server went
//! down goes on when it is up again. One delivery at a time goes to each place, so that a slow receiver
//! holds up no other.

mod destination;
mod exchange;
mod signature;

use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use url::Url;

use crate::event::EventHub;
use crate::job::WebhookId;
use crate::store::{Attempt, AuditEntry, DeliveryRow, Store, StoreError, WebhookRow};

pub use destination::{Destinations, InvalidDestination, RefusedDestination};
use exchange::{Exchange, Failure, Message};
pub use signature::SigningSecret;

/// How long a receiver may take, from its name to its answer.
const LONGEST_ANSWER: Duration = Duration::from_secs(15);
/// How often it is looked at the latest whether something is due.
const LOOK_INTERVAL: Duration = Duration::from_secs(30);
/// How soon it is looked again after the database failed.
const BACK_OFF: Duration = Duration::from_secs(1);

/// Delivers what waits.
#[derive(Clone)]
pub struct Sender {
    store: Store,
    destinations: Arc<Destinations>,
    exchange: Exchange,
}

impl Sender {
    /// A sender to destinations that the operator allows.
    #[must_use]
    pub fn new(store: Store, destinations: Arc<Destinations>) -> Self {
        Self {
            store,
            exchange: Exchange::new(Arc::clone(&destinations)),
            destinations,
        }
    }

    /// Delivers until the server goes down. What is on its way then is sent again later.
    pub async fn run(self, hub: EventHub, closing: CancellationToken) {
        let mut under_way = JoinSet::new();
        let mut busy: Vec<WebhookId> = Vec::new();
        loop {
            let wait = match self.due().await {
                Ok((due, next)) => {
                    self.begin(due, &mut busy, &mut under_way);
                    until(next)
                }
                Err(error) => {
                    tracing::error!(%error, "deliveries that are due could not be looked for");
                    BACK_OFF
                }
            };
            tokio::select! {
                () = closing.cancelled() => return,
                () = hub.delivery_waits() => {}
                Some(ended) = under_way.join_next(), if !under_way.is_empty() => match ended {
                    Ok(webhook) => busy.retain(|other| *other != webhook),
                    Err(error) => {
                        tracing::error!(%error, "a delivery ended badly");
                        return;
                    }
                },
                () = tokio::time::sleep(wait) => {}
            }
        }
    }

    /// What is due, where this server delivers, and when something will be.
    async fn due(&self) -> Result<(Vec<DeliveryRow>, Option<Timestamp>), StoreError> {
        if self.store.nodes().is_in_charge() {
            self.store.deliveries().due(Timestamp::now()).await
        } else {
            Ok((Vec::new(), None))
        }
    }

    /// Begins those that are due, one at a time for each place.
    fn begin(
        &self,
        due: Vec<DeliveryRow>,
        busy: &mut Vec<WebhookId>,
        under_way: &mut JoinSet<WebhookId>,
    ) {
        for delivery in due {
            if !busy.contains(&delivery.webhook) {
                busy.push(delivery.webhook);
                under_way.spawn(self.clone().deliver(delivery));
            }
        }
    }

    async fn deliver(self, delivery: DeliveryRow) -> WebhookId {
        if let Err(error) = self.attempt(&delivery).await {
            tracing::error!(delivery = %delivery.id, %error, "an attempt could not be noted");
            // It is due still; not at once again.
            tokio::time::sleep(BACK_OFF).await;
        }
        delivery.webhook
    }

    /// Makes one attempt and notes what came of it.
    async fn attempt(&self, delivery: &DeliveryRow) -> Result<(), StoreError> {
        let Some(webhook) = self.store.webhooks().find(delivery.webhook).await? else {
            return Ok(());
        };
        let sent = tokio::time::timeout(LONGEST_ANSWER, self.send(&webhook, delivery)).await;
        let sent = sent.unwrap_or_else(|_time_is_up| {
            let why = format!("no answer within {} s", LONGEST_ANSWER.as_secs());
            Err(Failure::Other(why))
        });
        let outcome = if sent.is_ok() { "delivered" } else { "failed" };
        metrics::counter!("greybox_delivery_attempts_total", "outcome" => outcome).increment(1);
        if let Err(failure @ (Failure::Refused(_) | Failure::Redirect(_))) = &sent {
            let id = delivery.id;
            tracing::warn!(delivery = %id, webhook = %webhook.id, %failure, "not delivered");
            self.audit(&webhook, delivery, failure.status()).await?;
        }
        let attempt = Attempt {
            status: sent
                .as_ref()
                .map_or_else(Failure::status, |status| Some(*status)),
            error: sent.err().map(|failure| failure.to_string()),
        };
        self.store
            .deliveries()
            .note_attempt(delivery.id, attempt)
            .await
    }

    /// Sends a delivery; answers the status with which it was taken.
    async fn send(&self, webhook: &WebhookRow, delivery: &DeliveryRow) -> Result<u16, Failure> {
        let url = self
            .destinations
            .check(&webhook.url)
            .map_err(Failure::Refused)?;
        let secret: Result<SigningSecret, _> = webhook.secret.parse();
        let secret = secret.map_err(|error| Failure::Other(format!("its secret: {error}")))?;
        let (at, id) = (Timestamp::now().as_second(), delivery.id.to_string());
        let message = Message {
            signature: secret.sign(&id, at, &delivery.payload),
            body: delivery.payload.clone(),
            id,
            at,
        };
        self.exchange.post(&url, message).await
    }

    /// Writes down that a receiver led, or was led, where nothing is delivered to.
    async fn audit(
        &self,
        webhook: &WebhookRow,
        delivery: &DeliveryRow,
        status: Option<u16>,
    ) -> Result<(), StoreError> {
        let entry = AuditEntry {
            who: format!("webhook {}", webhook.id),
            project: Some(webhook.project.clone()),
            address: receiver_of(&webhook.url),
            method: "DELIVER".to_owned(),
            path: format!("/v1/webhooks/{}/deliveries", webhook.id),
            status: status.unwrap_or(403),
            request_id: delivery.id.to_string(),
            left_out: 0,
        };
        self.store.audit().add(entry).await
    }
}

/// The receiver of an address: what comes after may be a secret of the receiver.
fn receiver_of(address: &str) -> String {
    Url::parse(address).map_or_else(|_| String::new(), |url| url.origin().ascii_serialization())
}

/// How long until something is due.
fn until(next: Option<Timestamp>) -> Duration {
    let wait = next.map(|next| next.duration_since(Timestamp::now()));
    let wait = wait.map(|wait| Duration::try_from(wait).unwrap_or_default());
    wait.unwrap_or(LOOK_INTERVAL).min(LOOK_INTERVAL)
}
