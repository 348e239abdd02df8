-- What a database holds. River keeps its own tables (river_*) in the same file, so that a job and its queue
-- entry are written in one transaction.

create table jobs (
    id                    text    not null primary key,
    name                  text,
    labels                text    not null,
    model                 text    not null,
    spec                  text    not null,
    status                text    not null
        check (status in ('queued', 'running', 'paused', 'succeeded', 'failed', 'cancelled')),
    -- What was asked of a running job and not yet done.
    request               text    check (request in ('cancel', 'pause')),
    -- Raised by each slice that begins; a write that carries an older one changes nothing.
    epoch                 integer not null default 0,
    -- Slices begun since the last checkpoint.
    attempt               integer not null default 0,
    -- The River entry that may begin slices of this job.
    queue_entry           integer not null,
    running_ms            integer not null default 0,
    progress              text,
    -- The last generation and the number of refinements that events told of, and when.
    told_generation       integer not null default 0,
    told_refinements      integer not null default 0,
    told_at_ms            integer not null default 0,
    error                 text,
    last_event            integer not null,
    revision              integer not null default 1,
    created_at            text    not null,
    started_at            text,
    finished_at           text,
    -- Lives of the server in a row that were cut off while the job was at work.
    deaths                integer not null default 0,
    -- The life in which the last slice of the job began, while that slice has neither ended nor left a checkpoint.
    at_work_in            integer,
    project               text    not null default 'default',
    method                text    generated always as (json_extract(spec, '$.method.name')) virtual,
    -- Whether other nodes may do some of what is left to do.
    is_shared             integer not null default 0 check (is_shared in (0, 1)),
    check ((finished_at is not null) = (status in ('succeeded', 'failed', 'cancelled')))
) strict;

create index jobs_by_status on jobs (status, id);
create index jobs_by_request on jobs (request) where request is not null;
create index jobs_by_model on jobs (model, id);
create index jobs_by_project on jobs (project, id);
create index jobs_by_project_and_status on jobs (project, status, id);
create index jobs_by_project_and_model on jobs (project, model);
create index jobs_at_work on jobs (at_work_in) where at_work_in is not null;
create index jobs_with_deaths on jobs (deaths) where deaths > 0;
create index jobs_shared on jobs (id) where is_shared = 1;

create table job_labels (
    job   text not null references jobs (id) on delete cascade,
    label text not null,
    value text not null,
    primary key (job, label)
) strict, without rowid;

create index jobs_by_label on job_labels (label, value, job);

create table job_datasets (
    job     text not null references jobs (id) on delete cascade,
    dataset text not null,
    primary key (job, dataset)
) strict, without rowid;

create index jobs_by_dataset on job_datasets (dataset, job);

create table events (
    job  text    not null references jobs (id) on delete cascade,
    id   integer not null,
    name text    not null,
    data text    not null,
    primary key (job, id)
) strict, without rowid;

create table generations (
    job        text    not null references jobs (id) on delete cascade,
    generation integer not null,
    row        text    not null,
    primary key (job, generation)
) strict, without rowid;

create table checkpoints (
    job         text    not null primary key references jobs (id) on delete cascade,
    state       blob    not null,
    -- Iterations of the refinement that went before it.
    refinements integer not null
) strict;

create table results (
    job     text not null primary key references jobs (id) on delete cascade,
    outcome text not null,
    trust   text generated always as (json_extract(outcome, '$.verdict.trust')) virtual
) strict;

create index results_by_trust on results (job, trust);

-- A key of a project outlives what it made, so that a key never makes two things.
create table idempotency (
    project     text not null,
    key         text not null,
    body_digest text not null,
    made        text not null,
    primary key (project, key)
) strict, without rowid;

-- What is kept of a job's candidates.
create table candidate_records (
    job               text    not null primary key references jobs (id) on delete cascade,
    -- What each of a candidate's values stands for.
    columns           text    not null,
    kept              integer not null,
    -- The generation in which the limit was reached; what came later is not kept.
    cut_in_generation integer
) strict, without rowid;

-- A row for each generation that simulated any. The candidates stand one after another, little
-- endian: place (u32), failure (u8; 0 for none), cost (f64; NaN where it failed), values (f64 each).
create table candidates (
    job        text    not null references jobs (id) on delete cascade,
    generation integer not null,
    candidates blob    not null,
    primary key (job, generation)
) strict;

-- What several nodes do of a job together, while the job is at work.
create table shared_parts (
    number integer primary key,
    job    text not null references jobs (id) on delete cascade,
    -- What is done, and what came of it, in JSON.
    name   text not null,
    part   text not null,
    unique (job, name)
) strict;

create table comparisons (
    id         text not null primary key,
    created_at text not null,
    project    text not null default 'default'
) strict, without rowid;

create index comparisons_by_project on comparisons (project, id);

create table comparison_jobs (
    comparison text    not null references comparisons (id) on delete cascade,
    -- In the order in which its runs were asked for, from 0.
    position   integer not null,
    job        text    not null references jobs (id) on delete cascade,
    primary key (comparison, position)
) strict, without rowid;

create index comparison_of_job on comparison_jobs (job);

-- Recordings. Samples are little-endian f64, cut into chunks so that no row is large.

create table datasets (
    id          text    not null primary key,
    name        text,
    -- The digest, after the project: a recording is kept once in each project.
    identity    text    not null unique,
    -- The recording without its samples: start, time axis, names and units.
    description text    not null,
    summary     text    not null,
    created_at  text    not null,
    project     text    not null default 'default',
    digest      text    not null default '',
    -- The bytes of the samples.
    bytes       integer not null default 0
) strict;

create index datasets_by_project on datasets (project, id, bytes);

-- Position 0 is the time axis of a recording that is not uniform; signals follow from 1.
create table dataset_chunks (
    dataset  text    not null references datasets (id) on delete cascade,
    position integer not null,
    chunk    integer not null,
    samples  blob    not null,
    primary key (dataset, position, chunk)
) strict;

-- Models that users wrote. A row never changes; its reference is its name and part of its digest, and names the
-- same document in every project that has it.
create table models (
    project    text not null,
    reference  text not null,
    name       text not null,
    digest     text not null,
    document   text not null,
    created_at text not null,
    -- The address that the model came from.
    client     text not null,
    primary key (project, reference)
) strict;

create index models_by_reference on models (reference);

-- Recordings that grow: samples by their instant, in blocks that do not overlap.

create table streams (
    -- The name, after the project where a stream belongs to another project than `default`.
    identity    text    not null primary key,
    -- The signals in the order in which they came: names, units, how they go on.
    signals     text    not null,
    zone        text,
    samples     integer not null,
    bytes       integer not null,
    -- The first and the last instant, nanoseconds since 1970.
    first_ns    integer not null,
    last_ns     integer not null,
    -- What is kept: so long before the last instant, and so much.
    keep_s      real,
    keep_mib    integer not null,
    created_at  text    not null,
    received_at text    not null,
    project     text    not null default 'default',
    name        text    not null default ''
) strict, without rowid;

create unique index streams_by_project on streams (project, name);

-- Little endian: the instants (i64), then for each of the first signals of the stream its values (f64;
-- NaN is a missing sample), then for each of them a byte for the class of each sample.
create table stream_blocks (
    stream   text    not null references streams (identity) on delete cascade,
    first_ns integer not null,
    last_ns  integer not null,
    rows     integer not null,
    samples  blob    not null,
    primary key (stream, first_ns)
) strict;

-- What was answered to batches that came with a key.
create table stream_batches (
    id     text not null primary key,
    answer text not null
) strict, without rowid;

-- What is watched in recordings that grow.

create table monitors (
    id          text    not null primary key,
    name        text,
    stream      text    not null references streams (identity),
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
    created_at  text    not null,
    project     text    not null default 'default'
) strict, without rowid;

create index monitors_by_stream on monitors (stream);
create index monitors_by_project on monitors (project, id);

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

create table tokens (
    id           integer not null primary key,
    name         text    not null,
    -- SHA-256 of the secret, which is not kept.
    digest       text    not null unique,
    scope        text    not null check (scope in ('read', 'submit', 'admin')),
    project      text    not null,
    created_at   text    not null,
    expires_at   text,
    revoked_at   text,
    last_used_at text
) strict;

create unique index tokens_by_name on tokens (name) where revoked_at is null;

-- People at the page, who brought a token: each request of a session is one of its token.

create table sessions (
    -- A digest of what stands in the cookie, which is not kept.
    digest     text    not null primary key,
    token      integer not null references tokens (id) on delete cascade,
    created_at text    not null,
    expires_at text    not null
) strict, without rowid;

create index sessions_by_token on sessions (token, created_at);

-- Who changed what, and who was refused. Rows are added; they never change, and go only with age.
create table audit (
    id         integer not null primary key autoincrement,
    at         text    not null,
    who        text    not null,
    project    text,
    address    text    not null,
    method     text    not null,
    path       text    not null,
    status     integer not null,
    request_id text    not null,
    -- Refusals before this one that were too many to be written down singly.
    left_out   integer not null default 0
) strict;

create index audit_by_project on audit (project, id);

create trigger audit_never_changes before update on audit begin
    select raise(abort, 'the audit log is only added to');
end;

create trigger audit_is_kept before delete on audit
when julianday('now') - julianday(old.at) < 30 begin
    select raise(abort, 'the audit log is kept for 30 days at the least');
end;

-- The time that the jobs of a project were at work, for each day (UTC).
create table project_days (
    project   text    not null,
    day       text    not null,
    worked_ms integer not null,
    primary key (project, day)
) strict, without rowid;

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

-- The servers that work with the database, one row for each life of one: each start is a new one. A file
-- has one at a time.
create table nodes (
    life     integer not null primary key,
    -- For people: the machine and the process.
    name     text    not null,
    -- Raised again and again for as long as it lives, and how often [ms].
    beat     integer not null default 0,
    beat_ms  integer not null,
    -- `dead` is one that did not end in order.
    state    text    not null check (state in ('live', 'ended', 'dead')),
    begun_at text    not null
) strict;

-- Written to see whether the database can be.
create table write_probes (
    id     integer not null primary key check (id = 1),
    filler blob    not null
) strict;
