-- What grows is counted for each project, and ends.

-- A key goes with age. A key that came before this migration counts from the migration on.
alter table idempotency add column created_at text not null default '';
update idempotency set created_at = strftime('%Y-%m-%dT%H:%M:%fZ', 'now');
create index idempotency_by_age on idempotency (created_at);

-- The signals of a stream as answers to batches list them: once for all answers with the same list.
create table signal_lists (
    -- The project and a digest of the list.
    id      text not null primary key,
    project text not null,
    signals text not null
) strict, without rowid;

-- An answer that names a list is kept without it.
alter table stream_batches add column signals text references signal_lists (id);
create index stream_batches_by_signals on stream_batches (signals) where signals is not null;

-- An entry that states a loss: the entries of the numbers up to `lost_up_to`, written from `lost_from` to
-- `lost_to`, were let go because the log had too many. `left_out` is how many.
alter table audit add column lost_from text;
alter table audit add column lost_to text;
alter table audit add column lost_up_to integer;
create index audit_losses on audit (lost_up_to) where lost_up_to is not null;

drop trigger audit_is_kept;
create trigger audit_is_kept before delete on audit
when julianday('now') - julianday(old.at) < 30
    and not exists (select 1 from audit where lost_up_to >= old.id) begin
    select raise(abort, 'the audit log is kept for 30 days at the least, unless an entry states the loss');
end;

-- What each project keeps, in bytes of texts and numbers. Triggers keep the counts, whoever writes.
create table stored_bytes (
    project text    not null primary key,
    -- The samples of recordings and streams.
    samples integer not null default 0,
    -- The specifications, events, histories, candidates and results of jobs.
    jobs    integer not null default 0,
    -- Idempotency keys, and the answers to batches that came with keys.
    keys    integer not null default 0
) strict, without rowid;

create table job_bytes (
    job     text    not null primary key,
    project text    not null,
    bytes   integer not null
) strict, without rowid;

insert into job_bytes (job, project, bytes)
    select id, project, octet_length(spec)
        + coalesce((select sum(octet_length(data)) from events where job = jobs.id), 0)
        + coalesce((select sum(octet_length(row)) from generations where job = jobs.id), 0)
        + coalesce((select sum(octet_length(candidates)) from candidates where job = jobs.id), 0)
        + coalesce((select octet_length(outcome) from results where job = jobs.id), 0)
    from jobs;

insert into stored_bytes (project, samples, jobs, keys)
    select project, sum(samples), sum(jobs), sum(keys) from (
        select project, bytes as samples, 0 as jobs, 0 as keys from datasets
        union all select project, bytes, 0, 0 from streams
        union all select project, 0, bytes, 0 from job_bytes
        union all select project, 0, 0, octet_length(key) + octet_length(body_digest) + octet_length(made)
            + coalesce((select octet_length(answer) from stream_batches where id = made), 0)
            from idempotency
    ) group by project;

create trigger recordings_come after insert on datasets begin
    insert into stored_bytes (project, samples) values (new.project, new.bytes)
        on conflict (project) do update set samples = samples + excluded.samples;
end;
create trigger recordings_go after delete on datasets begin
    update stored_bytes set samples = samples - old.bytes where project = old.project;
end;
create trigger streams_come after insert on streams begin
    insert into stored_bytes (project, samples) values (new.project, new.bytes)
        on conflict (project) do update set samples = samples + excluded.samples;
end;
create trigger streams_grow after update of bytes on streams when new.bytes <> old.bytes begin
    update stored_bytes set samples = samples + new.bytes - old.bytes where project = new.project;
end;
create trigger streams_go after delete on streams begin
    update stored_bytes set samples = samples - old.bytes where project = old.project;
end;

create trigger jobs_come after insert on jobs begin
    insert into job_bytes (job, project, bytes) values (new.id, new.project, octet_length(new.spec));
end;
create trigger jobs_go before delete on jobs begin
    delete from job_bytes where job = old.id;
end;
create trigger job_bytes_come after insert on job_bytes begin
    insert into stored_bytes (project, jobs) values (new.project, new.bytes)
        on conflict (project) do update set jobs = jobs + excluded.jobs;
end;
create trigger job_bytes_grow after update of bytes on job_bytes begin
    update stored_bytes set jobs = jobs + new.bytes - old.bytes where project = new.project;
end;
create trigger job_bytes_go after delete on job_bytes begin
    update stored_bytes set jobs = jobs - old.bytes where project = old.project;
end;
create trigger events_come after insert on events begin
    update job_bytes set bytes = bytes + octet_length(new.data) where job = new.job;
end;
create trigger generations_come after insert on generations begin
    update job_bytes set bytes = bytes + octet_length(new.row) where job = new.job;
end;
create trigger generations_change after update of row on generations begin
    update job_bytes set bytes = bytes + octet_length(new.row) - octet_length(old.row) where job = new.job;
end;
create trigger candidates_come after insert on candidates begin
    update job_bytes set bytes = bytes + octet_length(new.candidates) where job = new.job;
end;
create trigger candidates_go after delete on candidates begin
    update job_bytes set bytes = bytes - octet_length(old.candidates) where job = old.job;
end;
create trigger results_come after insert on results begin
    update job_bytes set bytes = bytes + octet_length(new.outcome) where job = new.job;
end;
create trigger results_change after update of outcome on results begin
    update job_bytes set bytes = bytes + octet_length(new.outcome) - octet_length(old.outcome) where job = new.job;
end;

-- The answer to a batch is written before its key, and goes after it.
create trigger keys_come after insert on idempotency begin
    insert into stored_bytes (project, keys) values (new.project,
        octet_length(new.key) + octet_length(new.body_digest) + octet_length(new.made)
        + coalesce((select octet_length(answer) from stream_batches where id = new.made), 0))
        on conflict (project) do update set keys = keys + excluded.keys;
end;
create trigger keys_go after delete on idempotency begin
    update stored_bytes set keys = keys
        - octet_length(old.key) - octet_length(old.body_digest) - octet_length(old.made)
        - coalesce((select octet_length(answer) from stream_batches where id = old.made), 0)
    where project = old.project;
end;
create trigger signal_lists_come after insert on signal_lists begin
    insert into stored_bytes (project, keys) values (new.project, octet_length(new.signals))
        on conflict (project) do update set keys = keys + excluded.keys;
end;
create trigger signal_lists_go after delete on signal_lists begin
    update stored_bytes set keys = keys - octet_length(old.signals) where project = old.project;
end;
