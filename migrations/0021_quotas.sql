-- What projects use.

-- The bytes of its samples.
alter table datasets add column bytes integer not null default 0;
update datasets set bytes = coalesce(
    (select sum(length(samples)) from dataset_chunks where dataset = datasets.id), 0);
drop index datasets_by_project;
create index datasets_by_project on datasets (project, id, bytes);

-- The time that the jobs of a project were at work, for each day (UTC).
create table project_days (
    project   text    not null,
    day       text    not null,
    worked_ms integer not null,
    primary key (project, day)
) strict, without rowid;
