-- Not refits alone: whatever several nodes do of a job together.
alter table shared_refits rename to shared_parts;
alter table shared_parts rename column refit to part;
