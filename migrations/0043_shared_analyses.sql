-- Refits of an analysis that several nodes do together, while the job is at work.
create table shared_refits (
    number integer primary key,
    job    text not null references jobs (id) on delete cascade,
    -- What is fitted, and what came of it, in JSON.
    name   text not null,
    refit  text not null,
    unique (job, name)
) strict;

-- Whether other nodes may do some of what is left to do.
alter table jobs add column is_shared integer not null default 0 check (is_shared in (0, 1));

create index jobs_shared on jobs (id) where is_shared = 1;
