-- Streams and monitors belong to a project; those that were there to `default`.

-- A stream is one of its project: its identity is its name, with that of its project before it where
-- it belongs to another one than `default`.
alter table streams rename column name to identity;
alter table streams add column project text not null default 'default';
alter table streams add column name text not null default '';
update streams set name = identity;
create unique index streams_by_project on streams (project, name);

alter table monitors add column project text not null default 'default';
create index monitors_by_project on monitors (project, id);
