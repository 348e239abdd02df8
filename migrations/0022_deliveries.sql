-- Where events are delivered, and what is on its way.

create table webhooks (
    id         text not null primary key,
    project    text not null,
    url        text not null,
    -- The types of events that it wants, as JSON.
    events     text not null,
    -- What its deliveries are signed with.
    secret     text not null,
    created_at text not null
) strict, without rowid;

create index webhooks_by_project on webhooks (project, id);

create table deliveries (
    id              text    not null primary key,
    webhook         text    not null references webhooks (id) on delete cascade,
    event           text    not null,
    payload         text    not null,
    state           text    not null check (state in ('waiting', 'delivered', 'given_up')),
    attempts        integer not null default 0,
    -- When it is due, and from when on it is counted for how long it has been tried [ms since 1970].
    due_at_ms       integer not null,
    tried_from_ms   integer not null,
    -- What came of the last attempt.
    last_status     integer,
    last_error      text,
    created_at      text    not null,
    delivered_at    text
) strict, without rowid;

create index deliveries_by_webhook on deliveries (webhook, id);
create index deliveries_that_wait on deliveries (webhook, due_at_ms) where state = 'waiting';
