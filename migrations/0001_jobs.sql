-- Jobs and what belongs to them. River keeps its own tables (river_*) in the same file, so that a
-- job and its queue entry are written in one transaction.

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
    check ((finished_at is not null) = (status in ('succeeded', 'failed', 'cancelled')))
) strict;

create index jobs_by_status on jobs (status, id);
create index jobs_by_request on jobs (request) where request is not null;

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
    outcome text not null
) strict;

-- Outlives its job, so that a key never makes two.
create table idempotency (
    key         text not null primary key,
    body_digest text not null,
    job         text not null
) strict, without rowid;
