-- Rows that change are sealed too, and small rows that were not (0045): where a row has a seal of what never changes,
-- the other is `state_seal`. A new row has none, and a change takes the seal away, whoever writes; the end of each
-- transaction seals what has none. The indices of rows without a seal are empty between transactions.

alter table jobs add column state_seal integer;
alter table job_labels add column seal integer;
alter table job_datasets add column seal integer;
alter table datasets add column state_seal integer;
alter table models add column state_seal integer;
alter table comparisons add column seal integer;
alter table comparison_jobs add column seal integer;
alter table idempotency add column seal integer;
alter table signal_lists add column seal integer;
alter table stream_batches add column seal integer;
alter table streams add column seal integer;
alter table monitors add column state_seal integer;
alter table monitor_windows add column state_seal integer;
alter table mappings add column seal integer;
alter table unmapped_series add column seal integer;
alter table tokens add column state_seal integer;
alter table sessions add column seal integer;
alter table project_days add column seal integer;
alter table webhooks add column seal integer;
alter table deliveries add column seal integer;
alter table nodes add column seal integer;

create index jobs_without_seal on jobs (id) where state_seal is null;
create index job_labels_without_seal on job_labels (job, label) where seal is null;
create index job_datasets_without_seal on job_datasets (job, dataset) where seal is null;
create index datasets_without_seal on datasets (id) where state_seal is null;
create index models_without_seal on models (project, reference) where state_seal is null;
create index comparisons_without_seal on comparisons (id) where seal is null;
create index comparison_jobs_without_seal on comparison_jobs (comparison, position) where seal is null;
create index idempotency_without_seal on idempotency (project, key) where seal is null;
create index signal_lists_without_seal on signal_lists (id) where seal is null;
create index stream_batches_without_seal on stream_batches (id) where seal is null;
create index streams_without_seal on streams (identity) where seal is null;
create index monitors_without_seal on monitors (id) where state_seal is null;
create index monitor_windows_without_seal on monitor_windows (monitor, number) where state_seal is null;
create index mappings_without_seal on mappings (project, name) where seal is null;
create index unmapped_series_without_seal on unmapped_series (project, mapping, series) where seal is null;
create index tokens_without_seal on tokens (digest) where state_seal is null;
create index sessions_without_seal on sessions (digest) where seal is null;
create index project_days_without_seal on project_days (project, day) where seal is null;
create index webhooks_without_seal on webhooks (id) where seal is null;
create index deliveries_without_seal on deliveries (id) where seal is null;
create index nodes_without_seal on nodes (life) where seal is null;

create trigger jobs_lose_their_seal after update of status, request, epoch, attempt, queue_entry, running_ms,
    progress, told_generation, told_refinements, told_at_ms, error, last_event, revision, created_at,
    started_at, finished_at, deaths, at_work_in, is_shared on jobs
when new.state_seal is not null begin
    update jobs set state_seal = null where id = new.id;
end;
create trigger streams_lose_their_seal after update of project, name, signals, zone, samples, bytes,
    first_ns, last_ns, keep_s, keep_mib, created_at, received_at on streams
when new.seal is not null begin
    update streams set seal = null where identity = new.identity;
end;
create trigger monitors_lose_their_seal after update of job, patience_ms, silent, revision, last_event,
    last_alarm, created_at on monitors
when new.state_seal is not null begin
    update monitors set state_seal = null where id = new.id;
end;
create trigger monitor_windows_lose_their_seal after update of job, dataset on monitor_windows
when new.state_seal is not null begin
    update monitor_windows set state_seal = null where monitor = new.monitor and number = new.number;
end;
create trigger mappings_lose_their_seal after update of rules, unlisted, created_at, changed_at on mappings
when new.seal is not null begin
    update mappings set seal = null where project = new.project and name = new.name;
end;
create trigger unmapped_series_lose_their_seal after update of samples, last_value, last_ns on unmapped_series
when new.seal is not null begin
    update unmapped_series set seal = null where project = new.project and mapping = new.mapping and series = new.series;
end;
create trigger tokens_lose_their_seal after update of id, revoked_at, last_used_at on tokens
when new.state_seal is not null begin
    update tokens set state_seal = null where digest = new.digest;
end;
create trigger project_days_lose_their_seal after update of worked_ms on project_days
when new.seal is not null begin
    update project_days set seal = null where project = new.project and day = new.day;
end;
create trigger webhooks_lose_their_seal after update of project, url, events, secret, created_at on webhooks
when new.seal is not null begin
    update webhooks set seal = null where id = new.id;
end;
create trigger deliveries_lose_their_seal after update of webhook, event, payload, state, attempts,
    due_at_ms, tried_from_ms, last_status, last_error, created_at, delivered_at on deliveries
when new.seal is not null begin
    update deliveries set seal = null where id = new.id;
end;
create trigger nodes_lose_their_seal after update of name, beat_ms, state, begun_at on nodes
when new.seal is not null begin
    update nodes set seal = null where life = new.life;
end;
