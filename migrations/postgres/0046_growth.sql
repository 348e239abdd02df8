-- What grows is counted for each project, and ends.

-- A key goes with age. A key that came before this migration counts from the migration on.
alter table idempotency add column created_at text collate "C" not null
    default to_char(now() at time zone 'utc', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"');
create index idempotency_by_age on idempotency (created_at);

-- The signals of a stream as answers to batches list them: once for all answers with the same list.
create table signal_lists (
    -- The project and a digest of the list.
    id      text collate "C" not null primary key,
    project text collate "C" not null,
    signals text collate "C" not null
);

-- An answer that names a list is kept without it. Servers before this cannot read such an answer.
alter table stream_batches add column signals text collate "C" references signal_lists (id);
create index stream_batches_by_signals on stream_batches (signals) where signals is not null;
update schema_support set oldest = 46;

-- An entry that states a loss: the entries of the numbers up to `lost_up_to`, written from `lost_from` to
-- `lost_to`, were let go because the log had too many. `left_out` is how many.
alter table audit add column lost_from text collate "C";
alter table audit add column lost_to text collate "C";
alter table audit add column lost_up_to bigint;
create index audit_losses on audit (lost_up_to) where lost_up_to is not null;

create or replace function audit_is_only_added_to() returns trigger language plpgsql as $$
begin
    if tg_op = 'DELETE' then
        if now() - old.at::timestamptz >= interval '30 days'
            or exists (select 1 from audit where lost_up_to >= old.id) then
            return old;
        end if;
        raise exception 'the audit log is kept for 30 days at the least, unless an entry states the loss';
    end if;
    raise exception 'the audit log is only added to';
end
$$;

-- What each project keeps, in bytes of texts and numbers. Triggers keep the counts, whoever writes.
create table stored_bytes (
    project text collate "C" not null primary key,
    -- The samples of recordings and streams.
    samples bigint not null default 0,
    -- The specifications, events, histories, candidates and results of jobs.
    jobs    bigint not null default 0,
    -- Idempotency keys, and the answers to batches that came with keys.
    keys    bigint not null default 0
) with (fillfactor = 50);

create table job_bytes (
    job     text collate "C" not null primary key,
    project text collate "C" not null,
    bytes   bigint not null
) with (fillfactor = 70);

-- A key with the answer to its batch. The answer is written before the key, and goes after it.
create function bytes_of_key(key text, body_digest text, made text) returns bigint language sql stable as $$
    select octet_length($1) + octet_length($2) + octet_length($3)
        + coalesce((select octet_length(answer) from stream_batches where id = $3), 0)::bigint
$$;

-- Counts everything anew, while the triggers below are off.
create function count_all_bytes() returns void language sql as $$
    delete from job_bytes;
    delete from stored_bytes;
    insert into job_bytes (job, project, bytes)
        select id, project, octet_length(spec)
            + coalesce((select sum(octet_length(data)) from events where job = jobs.id), 0)
            + coalesce((select sum(octet_length(g.row)) from generations as g where job = jobs.id), 0)
            + coalesce((select sum(octet_length(candidates)) from candidates where job = jobs.id), 0)
            + coalesce((select octet_length(outcome) from results where job = jobs.id), 0)
        from jobs;
    insert into stored_bytes (project, samples, jobs, keys)
        select project, sum(samples), sum(jobs), sum(keys) from (
            select project, bytes as samples, 0::bigint as jobs, 0::bigint as keys from datasets
            union all select project, bytes, 0, 0 from streams
            union all select project, 0, bytes, 0 from job_bytes
            union all select project, 0, 0, bytes_of_key(key, body_digest, made) from idempotency
            union all select project, 0, 0, octet_length(signals) from signal_lists
        ) as kept group by project;
$$;
select count_all_bytes();

create function count_samples() returns trigger language plpgsql as $$
begin
    if tg_op <> 'INSERT' then
        update stored_bytes set samples = samples - old.bytes where project = old.project;
    end if;
    if tg_op <> 'DELETE' then
        insert into stored_bytes (project, samples) values (new.project, new.bytes)
            on conflict (project) do update set samples = stored_bytes.samples + excluded.samples;
    end if;
    return null;
end
$$;
create trigger recordings_are_counted after insert or update of bytes or delete on datasets
for each row execute function count_samples();
create trigger streams_are_counted after insert or update of bytes or delete on streams
for each row execute function count_samples();

create function count_new_jobs() returns trigger language plpgsql as $$
begin
    insert into job_bytes (job, project, bytes) select id, project, octet_length(spec) from new_rows;
    return null;
end
$$;
create trigger jobs_come after insert on jobs referencing new table as new_rows
for each statement execute function count_new_jobs();

create function give_job_back() returns trigger language plpgsql as $$
begin
    delete from job_bytes where job = old.id;
    return old;
end
$$;
create trigger jobs_go before delete on jobs for each row execute function give_job_back();

create function count_jobs() returns trigger language plpgsql as $$
begin
    if tg_op = 'INSERT' then
        insert into stored_bytes (project, jobs) select project, sum(bytes) from new_rows group by project
            on conflict (project) do update set jobs = stored_bytes.jobs + excluded.jobs;
    elsif tg_op = 'DELETE' then
        update stored_bytes set jobs = jobs - gone.bytes
            from (select project, sum(bytes) as bytes from old_rows group by project) as gone
            where stored_bytes.project = gone.project;
    else
        update stored_bytes set jobs = jobs + change.bytes
            from (select later.project, sum(later.bytes - earlier.bytes) as bytes
                  from new_rows as later join old_rows as earlier on earlier.job = later.job
                  group by later.project) as change
            where stored_bytes.project = change.project;
    end if;
    return null;
end
$$;
create trigger job_bytes_come after insert on job_bytes referencing new table as new_rows
for each statement execute function count_jobs();
create trigger job_bytes_grow after update on job_bytes
referencing old table as old_rows new table as new_rows
for each statement execute function count_jobs();
create trigger job_bytes_go after delete on job_bytes referencing old table as old_rows
for each statement execute function count_jobs();

create function add_job_bytes(which text, added bigint) returns void language plpgsql as $$
begin
    update job_bytes set bytes = bytes + added where job = which;
end
$$;

create function count_events() returns trigger language plpgsql as $$
begin
    perform add_job_bytes(job, sum(octet_length(data))) from new_rows group by job;
    return null;
end
$$;
create trigger events_come after insert on events referencing new table as new_rows
for each statement execute function count_events();

create function count_generations() returns trigger language plpgsql as $$
begin
    if tg_op = 'UPDATE' then
        perform add_job_bytes(r.job, -sum(octet_length(r.row))) from old_rows as r group by r.job;
    end if;
    perform add_job_bytes(r.job, sum(octet_length(r.row))) from new_rows as r group by r.job;
    return null;
end
$$;
create trigger generations_come after insert on generations referencing new table as new_rows
for each statement execute function count_generations();
create trigger generations_change after update on generations
referencing old table as old_rows new table as new_rows
for each statement execute function count_generations();

create function count_candidates() returns trigger language plpgsql as $$
begin
    if tg_op = 'DELETE' then
        perform add_job_bytes(job, -sum(octet_length(candidates))) from old_rows group by job;
    else
        perform add_job_bytes(job, sum(octet_length(candidates))) from new_rows group by job;
    end if;
    return null;
end
$$;
create trigger candidates_come after insert on candidates referencing new table as new_rows
for each statement execute function count_candidates();
create trigger candidates_go after delete on candidates referencing old table as old_rows
for each statement execute function count_candidates();

create function count_results() returns trigger language plpgsql as $$
begin
    if tg_op = 'UPDATE' then
        perform add_job_bytes(old.job, -octet_length(old.outcome));
    end if;
    perform add_job_bytes(new.job, octet_length(new.outcome));
    return null;
end
$$;
create trigger results_are_counted after insert or update of outcome on results
for each row execute function count_results();

create function count_keys() returns trigger language plpgsql as $$
begin
    if tg_op = 'DELETE' then
        update stored_bytes set keys = keys - gone.bytes
            from (select project, sum(bytes_of_key(key, body_digest, made)) as bytes
                  from old_rows group by project) as gone
            where stored_bytes.project = gone.project;
    else
        insert into stored_bytes (project, keys)
            select project, sum(bytes_of_key(key, body_digest, made)) from new_rows group by project
            on conflict (project) do update set keys = stored_bytes.keys + excluded.keys;
    end if;
    return null;
end
$$;
create trigger keys_come after insert on idempotency referencing new table as new_rows
for each statement execute function count_keys();
create trigger keys_go after delete on idempotency referencing old table as old_rows
for each statement execute function count_keys();

create function count_signal_lists() returns trigger language plpgsql as $$
begin
    if tg_op = 'DELETE' then
        update stored_bytes set keys = keys - octet_length(old.signals) where project = old.project;
    else
        insert into stored_bytes (project, keys) values (new.project, octet_length(new.signals))
            on conflict (project) do update set keys = stored_bytes.keys + excluded.keys;
    end if;
    return null;
end
$$;
create trigger signal_lists_are_counted after insert or delete on signal_lists
for each row execute function count_signal_lists();
