-- What keeps a server that others reach at work: its lives, comparisons as things of their own, whose
-- models are whose, and whether the disk takes writes.

-- The life of the server that has the database: each start is a new one. One that has not ended in
-- order when the next begins was cut off.
create table server_life (
    id               integer not null primary key check (id = 1),
    number           integer not null,
    ended_in_order   integer not null check (ended_in_order in (0, 1))
) strict;

-- Lives in a row that were cut off while the job was at work.
alter table jobs add column deaths integer not null default 0;
-- The life in which its last slice began, while that has neither ended nor left a checkpoint.
alter table jobs add column at_work_in integer;

create index jobs_at_work on jobs (at_work_in) where at_work_in is not null;
create index jobs_with_deaths on jobs (deaths) where deaths > 0;

create table comparisons (
    id         text not null primary key,
    created_at text not null
) strict, without rowid;

create table comparison_jobs (
    comparison text    not null references comparisons (id) on delete cascade,
    -- In the order in which its runs were asked for, from 0.
    position   integer not null,
    job        text    not null references jobs (id) on delete cascade,
    primary key (comparison, position)
) strict, without rowid;

create index comparison_of_job on comparison_jobs (job);

-- Before this, a comparison was the jobs that carried its identifier as a label.
insert into comparisons (id, created_at)
    select value, min(created_at) from job_labels join jobs on jobs.id = job
    where label = 'comparison' and value glob 'cmp_*' group by value;
insert into comparison_jobs (comparison, position, job)
    select value, row_number() over (partition by value order by job) - 1, job from job_labels
    where label = 'comparison' and value glob 'cmp_*';

-- A key makes a job or a comparison.
alter table idempotency rename column job to made;

-- Who stored it: the address that it came from.
alter table models add column client text not null default '';

-- Written to see whether the database can be.
create table write_probes (
    id     integer not null primary key check (id = 1),
    filler blob    not null
) strict;
