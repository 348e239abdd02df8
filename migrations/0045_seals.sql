-- What is stored of each row that something is computed from or answered with, as a digest: 64 bits of SHA-256
-- over the name of the table, the key and the content, in little endian. Rows of before have none.

alter table jobs add column seal integer;
alter table datasets add column seal integer;
alter table dataset_chunks add column seal integer;
alter table stream_blocks add column seal integer;
alter table checkpoints add column seal integer;
alter table results add column seal integer;
alter table events add column seal integer;
alter table generations add column seal integer;
alter table candidate_records add column seal integer;
alter table candidates add column seal integer;
alter table monitors add column seal integer;
alter table monitor_windows add column seal integer;
alter table monitor_alarms add column seal integer;
alter table monitor_events add column seal integer;
alter table models add column seal integer;
alter table shared_parts add column seal integer;
