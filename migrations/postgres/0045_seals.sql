-- What is stored of each row that something is computed from or answered with, as a digest: 64 bits of SHA-256
-- over the name of the table, the key and the content, in little endian. Rows of before have none.

alter table jobs add column seal bigint;
alter table datasets add column seal bigint;
alter table dataset_chunks add column seal bigint;
alter table stream_blocks add column seal bigint;
alter table checkpoints add column seal bigint;
alter table results add column seal bigint;
alter table events add column seal bigint;
alter table generations add column seal bigint;
alter table candidate_records add column seal bigint;
alter table candidates add column seal bigint;
alter table monitors add column seal bigint;
alter table monitor_windows add column seal bigint;
alter table monitor_alarms add column seal bigint;
alter table monitor_events add column seal bigint;
alter table models add column seal bigint;
alter table shared_parts add column seal bigint;

-- A server that knows nothing of seals would change what is stored and leave the seal as it was.
update schema_support set oldest = 45;
