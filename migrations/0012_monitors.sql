-- What is watched in recordings that grow.

create table monitors (
    id          text    not null primary key,
    name        text,
    stream      text    not null references streams (name),
    -- What was asked for.
    spec        text    not null,
    -- What it knows by now: the last estimates, the detectors, the next window.
    state       text    not null,
    -- When the next window ends, nanoseconds since 1970.
    due_ns      integer not null,
    -- The job that works a window.
    job         text,
    -- How long it waits for data before it says that they stopped, and whether it said so.
    patience_ms integer not null,
    silent      integer not null default 0 check (silent in (0, 1)),
    -- Grows with every change; a step that knew an older one changes nothing.
    revision    integer not null default 1,
    last_event  integer not null default 0,
    last_alarm  integer not null default 0,
    created_at  text    not null
) strict, without rowid;

create index monitors_by_stream on monitors (stream);

create table monitor_windows (
    monitor text    not null references monitors (id) on delete cascade,
    number  integer not null,
    job     text,
    dataset text,
    row     text    not null,
    primary key (monitor, number)
) strict, without rowid;

create table monitor_alarms (
    monitor text    not null references monitors (id) on delete cascade,
    id      integer not null,
    row     text    not null,
    primary key (monitor, id)
) strict, without rowid;

create table monitor_events (
    monitor text    not null references monitors (id) on delete cascade,
    id      integer not null,
    name    text    not null,
    data    text    not null,
    primary key (monitor, id)
) strict, without rowid;
