-- What a PostgreSQL database holds: the same tables as in SQLite, whose migration has the same number. Texts are ordered by their bytes, as there. Samples are stored as they come, because
-- they do not get smaller.

create table jobs (
    id                    text collate "C"    not null primary key,
    name                  text collate "C",
    labels                text collate "C"    not null,
    model                 text collate "C"    not null,
    spec                  text collate "C"    not null,
    status                text collate "C"    not null
        check (status in ('queued', 'running', 'paused', 'succeeded', 'failed', 'cancelled')),
    -- What was asked of a running job and not yet done.
    request               text collate "C"    check (request in ('cancel', 'pause')),
    -- Raised by each slice that begins; a write that carries an older one changes nothing.
    epoch                 bigint not null default 0,
    -- Slices begun since the last checkpoint.
    attempt               bigint not null default 0,
    -- The River entry that may begin slices of this job.
    queue_entry           bigint not null,
    running_ms            bigint not null default 0,
    progress              text collate "C",
    -- The last generation and the number of refinements that events told of, and when.
    told_generation       bigint not null default 0,
    told_refinements      bigint not null default 0,
    told_at_ms            bigint not null default 0,
    error                 text collate "C",
    last_event            bigint not null,
    revision              bigint not null default 1,
    created_at            text collate "C"    not null,
    started_at            text collate "C",
    finished_at           text collate "C",
    deaths bigint not null default 0,
    at_work_in bigint,
    project text collate "C" not null default 'default',
    method text collate "C"
    generated always as (spec::json #>> '{method,name}') stored,
    -- Whether other nodes may do some of what is left to do.
    is_shared bigint not null default 0 check (is_shared in (0, 1)),
    check ((finished_at is not null) = (status in ('succeeded', 'failed', 'cancelled')))
);

create index jobs_by_status on jobs (status, id);

create index jobs_by_request on jobs (request) where request is not null;

create table job_labels (
    job   text collate "C" not null references jobs (id) on delete cascade,
    label text collate "C" not null,
    value text collate "C" not null,
    primary key (job, label)
);

create index jobs_by_label on job_labels (label, value, job);

create table job_datasets (
    job     text collate "C" not null references jobs (id) on delete cascade,
    dataset text collate "C" not null,
    primary key (job, dataset)
);

create index jobs_by_dataset on job_datasets (dataset, job);

create table events (
    job  text collate "C"    not null references jobs (id) on delete cascade,
    id   bigint not null,
    name text collate "C"    not null,
    data text collate "C"    not null,
    primary key (job, id)
);

create table generations (
    job        text collate "C"    not null references jobs (id) on delete cascade,
    generation bigint not null,
    row        text collate "C"    not null,
    primary key (job, generation)
);

create table checkpoints (
    job         text collate "C"    not null primary key references jobs (id) on delete cascade,
    state       bytea    not null,
    -- Iterations of the refinement that went before it.
    refinements bigint not null
);

create table results (
    job     text collate "C" not null primary key references jobs (id) on delete cascade,
    outcome text collate "C" not null,
    trust text collate "C"
    generated always as (outcome::json #>> '{verdict,trust}') stored);

create table datasets (
    id          text collate "C"    not null primary key,
    name        text collate "C",
    identity      text collate "C"    not null unique,
    -- The recording without its samples: start, time axis, names and units.
    description text collate "C"    not null,
    summary     text collate "C"    not null,
    created_at  text collate "C"    not null,
    project text collate "C" not null default 'default',
    digest text collate "C" not null default '',
    bytes bigint not null default 0);

create table dataset_chunks (
    dataset  text collate "C"    not null references datasets (id) on delete cascade,
    position bigint not null,
    chunk    bigint not null,
    samples  bytea    not null,
    primary key (dataset, position, chunk)
);

create index jobs_by_model on jobs (model, id);

create table candidate_records (
    job               text collate "C"    not null primary key references jobs (id) on delete cascade,
    -- What each of a candidate's values stands for.
    columns           text collate "C"    not null,
    kept              bigint not null,
    -- The generation in which the limit was reached; what came later is not kept.
    cut_in_generation bigint
);

create table candidates (
    job        text collate "C"    not null references jobs (id) on delete cascade,
    generation bigint not null,
    candidates bytea    not null,
    primary key (job, generation)
);

-- The servers that work with the database, one row for each life of one: each start is a new one.
create table nodes (
    life     bigint not null primary key,
    -- For people: the machine and the process.
    name     text   not null,
    -- Raised again and again for as long as it lives, and how often [ms].
    beat     bigint not null default 0,
    beat_ms  bigint not null,
    -- `dead` is one that did not end in order.
    state    text collate "C" not null check (state in ('live', 'ended', 'dead')),
    begun_at text   not null
) with (fillfactor = 50);

-- What several nodes do of a job together, while the job is at work.
create table shared_parts (
    number bigint generated always as identity primary key,
    job    text collate "C" not null references jobs (id) on delete cascade,
    -- What is done, and what came of it, in JSON.
    name   text collate "C" not null,
    part   text not null,
    unique (job, name)
);

create index jobs_at_work on jobs (at_work_in) where at_work_in is not null;

create index jobs_with_deaths on jobs (deaths) where deaths > 0;

create index jobs_shared on jobs (id) where is_shared = 1;

create table comparisons (
    id         text collate "C" not null primary key,
    created_at text collate "C" not null,
    project text collate "C" not null default 'default');

create table comparison_jobs (
    comparison text collate "C"    not null references comparisons (id) on delete cascade,
    -- In the order in which its runs were asked for, from 0.
    position   bigint not null,
    job        text collate "C"    not null references jobs (id) on delete cascade,
    primary key (comparison, position)
);

create index comparison_of_job on comparison_jobs (job);

create table write_probes (
    id     bigint not null primary key check (id = 1),
    filler bytea    not null
);

create table streams (
    identity        text collate "C"    not null primary key,
    -- The signals in the order in which they came: names, units, how they go on.
    signals     text collate "C"    not null,
    zone        text collate "C",
    samples     bigint not null,
    bytes       bigint not null,
    -- The first and the last instant, nanoseconds since 1970.
    first_ns    bigint not null,
    last_ns     bigint not null,
    -- What is kept: so long before the last instant, and so much.
    keep_s      double precision,
    keep_mib    bigint not null,
    created_at  text collate "C"    not null,
    received_at text collate "C"    not null,
    project text collate "C" not null default 'default',
    name text collate "C" not null default '');

create table stream_blocks (
    stream   text collate "C"    not null references streams (identity) on delete cascade,
    first_ns bigint not null,
    last_ns  bigint not null,
    rows     bigint not null,
    samples  bytea    not null,
    primary key (stream, first_ns)
);

create table stream_batches (
    id     text collate "C" not null primary key,
    answer text collate "C" not null
);

create table monitors (
    id          text collate "C"    not null primary key,
    name        text collate "C",
    stream      text collate "C"    not null references streams (identity),
    -- What was asked for.
    spec        text collate "C"    not null,
    -- What it knows by now: the last estimates, the detectors, the next window.
    state       text collate "C"    not null,
    -- When the next window ends, nanoseconds since 1970.
    due_ns      bigint not null,
    -- The job that works a window.
    job         text collate "C",
    -- How long it waits for data before it says that they stopped, and whether it said so.
    patience_ms bigint not null,
    silent      bigint not null default 0 check (silent in (0, 1)),
    -- Grows with every change; a step that knew an older one changes nothing.
    revision    bigint not null default 1,
    last_event  bigint not null default 0,
    last_alarm  bigint not null default 0,
    created_at  text collate "C"    not null,
    project text collate "C" not null default 'default');

create index monitors_by_stream on monitors (stream);

create table monitor_windows (
    monitor text collate "C"    not null references monitors (id) on delete cascade,
    number  bigint not null,
    job     text collate "C",
    dataset text collate "C",
    row     text collate "C"    not null,
    primary key (monitor, number)
);

create table monitor_alarms (
    monitor text collate "C"    not null references monitors (id) on delete cascade,
    id      bigint not null,
    row     text collate "C"    not null,
    primary key (monitor, id)
);

create table monitor_events (
    monitor text collate "C"    not null references monitors (id) on delete cascade,
    id      bigint not null,
    name    text collate "C"    not null,
    data    text collate "C"    not null,
    primary key (monitor, id)
);

create table tokens (
    id           bigint generated always as identity primary key,
    name         text collate "C"    not null,
    -- SHA-256 of the secret, which is not kept.
    digest       text collate "C"    not null unique,
    scope        text collate "C"    not null check (scope in ('read', 'submit', 'admin')),
    project      text collate "C"    not null,
    created_at   text collate "C"    not null,
    expires_at   text collate "C",
    revoked_at   text collate "C",
    last_used_at text collate "C"
);

create unique index tokens_by_name on tokens (name) where revoked_at is null;

create index jobs_by_project on jobs (project, id);

create index jobs_by_project_and_status on jobs (project, status, id);

create index comparisons_by_project on comparisons (project, id);

create table idempotency (
    project     text collate "C" not null,
    key         text collate "C" not null,
    body_digest text collate "C" not null,
    made        text collate "C" not null,
    primary key (project, key)
);

create table models (
    project    text collate "C" not null,
    reference  text collate "C" not null,
    name       text collate "C" not null,
    digest     text collate "C" not null,
    document   text collate "C" not null,
    created_at text collate "C" not null,
    client     text collate "C" not null,
    primary key (project, reference)
);

create index models_by_reference on models (reference);

create index jobs_by_project_and_model on jobs (project, model);

create table audit (
    id         bigint generated always as identity primary key,
    at         text collate "C"    not null,
    who        text collate "C"    not null,
    project    text collate "C",
    address    text collate "C"    not null,
    method     text collate "C"    not null,
    path       text collate "C"    not null,
    status     bigint not null,
    request_id text collate "C"    not null,
    -- Refusals before this one that were too many to be written down singly.
    left_out   bigint not null default 0
);

create index audit_by_project on audit (project, id);

create index datasets_by_project on datasets (project, id, bytes);

create table project_days (
    project   text collate "C"    not null,
    day       text collate "C"    not null,
    worked_ms bigint not null,
    primary key (project, day)
);

create table webhooks (
    id         text collate "C" not null primary key,
    project    text collate "C" not null,
    url        text collate "C" not null,
    -- The types of events that it wants, as JSON.
    events     text collate "C" not null,
    -- What its deliveries are signed with.
    secret     text collate "C" not null,
    created_at text collate "C" not null
);

create index webhooks_by_project on webhooks (project, id);

create table deliveries (
    id              text collate "C"    not null primary key,
    webhook         text collate "C"    not null references webhooks (id) on delete cascade,
    event           text collate "C"    not null,
    payload         text collate "C"    not null,
    state           text collate "C"    not null check (state in ('waiting', 'delivered', 'given_up')),
    attempts        bigint not null default 0,
    -- When it is due, and from when on it is counted for how long it has been tried [ms since 1970].
    due_at_ms       bigint not null,
    tried_from_ms   bigint not null,
    -- What came of the last attempt.
    last_status     bigint,
    last_error      text collate "C",
    created_at      text collate "C"    not null,
    delivered_at    text collate "C"
);

create index deliveries_by_webhook on deliveries (webhook, id);

create index deliveries_that_wait on deliveries (webhook, due_at_ms) where state = 'waiting';

create index results_by_trust on results (job, trust);

create table sessions (
    -- A digest of what stands in the cookie, which is not kept.
    digest     text collate "C"    not null primary key,
    token      bigint not null references tokens (id) on delete cascade,
    created_at text collate "C"    not null,
    expires_at text collate "C"    not null
);

create index sessions_by_token on sessions (token, created_at);

create unique index streams_by_project on streams (project, name);

create index monitors_by_project on monitors (project, id);

alter table dataset_chunks alter column samples set storage external;
alter table stream_blocks alter column samples set storage external;

create function audit_is_only_added_to() returns trigger language plpgsql as $$
begin
    if tg_op = 'DELETE' then
        if now() - old.at::timestamptz >= interval '30 days' then
            return old;
        end if;
        raise exception 'the audit log is kept for 30 days at the least';
    end if;
    raise exception 'the audit log is only added to';
end
$$;

create trigger audit_is_only_added_to before update or delete on audit
for each row execute function audit_is_only_added_to();

-- The oldest schema whose servers can work with the database as it is. A server that is older opens a database
-- of a newer schema from this one on.
create table schema_support (
    id     bigint not null primary key check (id = 1),
    oldest bigint not null
);

insert into schema_support (id, oldest) values (1, 44);
