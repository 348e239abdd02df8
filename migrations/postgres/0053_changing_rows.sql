-- Rows that change are sealed too, and small rows that were not (0045): where a row has a seal of what never changes,
-- the other is `state_seal`. A new row has none, and a change takes the seal away, whoever writes; the end of each
-- transaction seals what has none. The indices of rows without a seal are empty between transactions.

alter table jobs add column state_seal bigint;
alter table job_labels add column seal bigint;
alter table job_datasets add column seal bigint;
alter table datasets add column state_seal bigint;
alter table models add column state_seal bigint;
alter table comparisons add column seal bigint;
alter table comparison_jobs add column seal bigint;
alter table idempotency add column seal bigint;
alter table signal_lists add column seal bigint;
alter table stream_batches add column seal bigint;
alter table streams add column seal bigint;
alter table monitors add column state_seal bigint;
alter table monitor_windows add column state_seal bigint;
alter table mappings add column seal bigint;
alter table unmapped_series add column seal bigint;
alter table tokens add column state_seal bigint;
alter table sessions add column seal bigint;
alter table project_days add column seal bigint;
alter table webhooks add column seal bigint;
alter table deliveries add column seal bigint;
alter table nodes add column seal bigint;

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

create function lose_seal() returns trigger language plpgsql as $$
begin
    new.seal := null;
    return new;
end
$$;
create function lose_state_seal() returns trigger language plpgsql as $$
begin
    new.state_seal := null;
    return new;
end
$$;

create trigger jobs_lose_their_seal before update of status, request, epoch, attempt, queue_entry,
    running_ms, progress, told_generation, told_refinements, told_at_ms, error, last_event, revision,
    created_at, started_at, finished_at, deaths, at_work_in, is_shared on jobs
for each row execute function lose_state_seal();
create trigger streams_lose_their_seal before update of project, name, signals, zone, samples, bytes,
    first_ns, last_ns, keep_s, keep_mib, created_at, received_at on streams
for each row execute function lose_seal();
create trigger monitors_lose_their_seal before update of job, patience_ms, silent, revision, last_event,
    last_alarm, created_at on monitors
for each row execute function lose_state_seal();
create trigger monitor_windows_lose_their_seal before update of job, dataset on monitor_windows
for each row execute function lose_state_seal();
create trigger mappings_lose_their_seal before update of rules, unlisted, created_at, changed_at on mappings
for each row execute function lose_seal();
create trigger unmapped_series_lose_their_seal before update of samples, last_value, last_ns on unmapped_series
for each row execute function lose_seal();
create trigger tokens_lose_their_seal before update of id, revoked_at, last_used_at on tokens
for each row execute function lose_state_seal();
create trigger project_days_lose_their_seal before update of worked_ms on project_days
for each row execute function lose_seal();
create trigger webhooks_lose_their_seal before update of project, url, events, secret, created_at on webhooks
for each row execute function lose_seal();
create trigger deliveries_lose_their_seal before update of webhook, event, payload, state, attempts,
    due_at_ms, tried_from_ms, last_status, last_error, created_at, delivered_at on deliveries
for each row execute function lose_seal();
create trigger nodes_lose_their_seal before update of name, beat_ms, state, begun_at on nodes
for each row execute function lose_seal();
