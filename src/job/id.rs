//! Identifiers of jobs, comparisons, monitors and webhooks: UUIDv7 with a prefix that says what
//! they name.

use greybox::identifier;

identifier!(
    /// Names a comparison.
    ComparisonId,
    "cmp_",
    "cmp_0192d3a4b5c67d8e9f00112233445566"
);

identifier!(
    /// Names a monitor.
    MonitorId,
    "mon_",
    "mon_0192d3a4b5c67d8e9f00112233445566"
);

identifier!(
    /// Names a place that events are delivered to.
    WebhookId,
    "whk_",
    "whk_0192d3a4b5c67d8e9f00112233445566"
);

identifier!(
    /// Names an event on its way to one place.
    DeliveryId,
    "msg_",
    "msg_0192d3a4b5c67d8e9f00112233445566"
);
